"""Names of columns in the spellings that phones, autopilots, data sets and people use."""

import pytest

from strapdown.io._headers import recognise, recognise_all

# Name, role, unit; units of names that state none are None.
NAMES = [
    ("gx", "gyr_x", None),
    ("gyro_x", "gyr_x", None),
    ("gyr_x_dps", "gyr_x", "dps"),
    ("gyro_dps_z", "gyr_z", "dps"),
    ("GyrX", "gyr_x", None),
    ("Gyro Y (deg/s)", "gyr_y", "dps"),
    ("Gyroscope z (rad/s)", "gyr_z", "rad_s"),
    ("gyroRotationX(rad/s)", "gyr_x", "rad_s"),
    ("rotationRateZ", "gyr_z", None),
    ("w_RS_S_x [rad s^-1]", "gyr_x", "rad_s"),
    ("field.angular_velocity.y", "gyr_y", None),
    ("gyro_rad[2]", "gyr_z", "rad_s"),
    ("xgyro", "gyr_x", None),
    ("gx_radps", "gyr_x", "rad_s"),
    ("wx", "gyr_x", None),
    ("ax", "acc_x", None),
    ("ax [m/s^2]", "acc_x", "m_s2"),
    ("ax_mps2", "acc_x", "m_s2"),
    ("acc_z_g", "acc_z", "g"),
    ("accel_g_y", "acc_y", "g"),
    ("ACC_X (mg)", "acc_x", "mg"),
    ("accelerometer_x", "acc_x", None),
    ("accelerometer_m_s2[0]", "acc_x", "m_s2"),
    ("accelerometerAccelerationX(G)", "acc_x", "g"),
    ("Acceleration x (m/s^2)", "acc_x", "m_s2"),
    ("a_RS_S_z [m s^-2]", "acc_z", "m_s2"),
    ("Shimmer_6_Accel_LN_X_CAL", "acc_x", None),
    ("specific_force_z", "acc_z", None),
    ("mag_x_ut", "mag_x", "ut"),
    ("Mag_X_uT", "mag_x", "ut"),
    ("Magnetic field y (µT)", "mag_y", "ut"),
    ("magnetometer_ga[1]", "mag_y", "gauss"),
    ("mag_z_t", "mag_z", "t"),
    ("t", "t", None),
    ("timestamp", "t", None),
    ("time_us", "t", "us"),
    ("t_ms", "t", "ms"),
    ("Time (s)", "t", "s"),
    ("TimeUS", "t", "us"),
    ("time_usec", "t", "us"),
    ("seconds_elapsed", "t", "s"),
    ("#timestamp [ns]", "t", "ns"),
    ("%time", "t", None),
    ("field.header.stamp", "t", None),
    ("millis", "t", "ms"),
    ("lat", "lat", None),
    ("Latitude (°)", "lat", "deg"),
    ("lon_deg", "lon", "deg"),
    ("alt", "height", None),
    ("altitude_msl_m", "height", "m"),
    ("vn_mps", "v_n", "m_s"),
    ("vel_d_m_s", "v_d", "m_s"),
    ("pos_std_n_m", "std_n", "m"),
    ("vel_std_e_mps", "std_v_e", "m_s"),
    ("heading_rad", "heading", "rad"),
    ("Pressure (hPa)", "pressure", "hpa"),
    ("temp_degc", "temp", "degc"),
    ("gyro_temp", "temp", None),
    ("baro_temp_degc", "temp", "degc"),
    ("locationLatitude(WGS84)", "lat", None),
    ("wheel_speed_kmh", "speed", "kmh"),
    ("encoder_deg", "angle", "deg"),
    ("qw", "q_w", None),
    ("quat_x", "q_x", None),
    ("roll_deg", "roll", "deg"),
    ("ref_q_nb_w", "ref_q_w", None),
    ("ref_yaw_deg", "ref_yaw", "deg"),
]


@pytest.mark.parametrize(("name", "role", "unit"), NAMES)
def test_common_spellings_are_recognised(name: str, role: str, unit: str | None) -> None:
    meaning = recognise(name, ros="field." in name)
    assert meaning.role == role
    assert (meaning.unit.name if meaning.unit else None) == unit


@pytest.mark.parametrize(
    "name",
    [
        "Linear Acceleration x (m/s^2)",  # gravity is taken off
        "motionUserAccelerationX(G)",
        "FreeAcc_X",
        "gravity_x",
        "gyro_bias_x",
        "gyro_integral_dt",
        "accelerometer_timestamp_relative",
        "angular_velocity_covariance[0]",
        "Absolute acceleration (m/s^2)",
        "mag_count",
        "x",
        "x_m",
        "index",
        "",
        "event",
        "roll_rate_setpoint",
    ],
)
def test_names_that_are_no_sample_of_a_sensor_stay_unknown(name: str) -> None:
    assert recognise(name).role is None


def test_bare_axes_belong_to_the_sensor_of_the_file() -> None:
    names = ["time", "seconds_elapsed", "z", "y", "x"]
    roles = [m.role for m in recognise_all(names, context="gyr")]
    assert roles == ["t", "t", "gyr_z", "gyr_y", "gyr_x"]


def test_linear_acceleration_of_ros_is_specific_force() -> None:
    names = ["%time", "field.angular_velocity.x", "field.linear_acceleration.x"]
    assert [m.role for m in recognise_all(names)] == ["t", "gyr_x", "acc_x"]


def test_of_two_sensors_of_one_kind_the_first_counts() -> None:
    names = ["gyro1_x", "gyro1_y", "gyro1_z", "gyro2_x"]
    assert [m.role for m in recognise_all(names)] == ["gyr_x", "gyr_y", "gyr_z", None]


def test_a_strange_unit_is_kept_for_the_message() -> None:
    assert recognise("GYR_X (LSB)").strange_unit == "LSB"


def test_altitude_alone_is_no_fix() -> None:
    assert recognise_all(["t", "altitude"])[1].role is None
