r"""Frames, rotations, signs and units: one convention, stated once.

Everything inside the package follows this page. Other conventions live at the borders:
in `strapdown.io`, in `strapdown.units`, in `strapdown.report`, and in the named converters
of `strapdown.rotation`.

Frames
------
====== ======================================================================================
Letter Frame, right-handed
====== ======================================================================================
``i``  Inertial: at the Earth's centre, not turning.
``e``  Earth-centred Earth-fixed (ECEF): x to latitude 0, longitude 0; z to the north pole.
``n``  Local level **north, east, down** (NED) at the sensor. "North" is true, magnetic or
       arbitrary; `Solution.heading_reference` says which.
``w``  Wander azimuth: level like n, but not turned about the vertical to follow north; for
       mechanisations near a pole.
``b``  Body: the **axes of the sensor as recorded**. A log may be z-up; nothing turns it.
``v``  Vehicle: forward, right, down. Roll, pitch and yaw of a vehicle are those of v; the
       mount ``q_vb`` leads to it.
``s``  Axes of a single sensor before its misalignment is taken out.
``a``  A point other than the sensor, such as the antenna.
====== ======================================================================================

Reading a symbol
----------------
==================== ========================================================================
Symbol               Meaning
==================== ========================================================================
``C_nb``             Matrix that takes components in b to components in n:
                     ``v_n = C_nb @ v_b``.
``q_nb``             The same rotation as a quaternion; ``q_nb = q_ne * q_eb``: the inner
                     letters cancel.
``rpy``              Roll, pitch, yaw of b relative to n: turn by yaw about z, by pitch about
                     the new y, by roll about the new x: ``C_nb = Rz(yaw) Ry(pitch) Rx(roll)``.
``omega_ib_b``       Rate of b relative to i, resolved in b: what a gyroscope measures.
                     Likewise ``omega_ie_n``, the Earth's rate, and ``omega_en_n``, the
                     transport rate.
``f_b``              Specific force in b: what an accelerometer measures.
``v_n``, ``r_e``     Velocity over ground in NED; position in ECEF.
``lla``              Latitude, longitude [rad] and height above the ellipsoid [m].
``phi_n``            Small attitude error resolved in n: true ``C_nb`` is ``exp(phi_n x)`` times
                     the estimated one.
``dtheta_b``         The same resolved in b: true ``C_nb`` is the estimated one times
                     ``exp(dtheta_b x)``.
``dx``               Error state: what must be *added to the estimate* to get the truth.
``b_g``, ``b_a``     Bias of gyroscope and accelerometer: measured is true plus bias.
==================== ========================================================================

Quaternions
-----------
``q = (w, x, y, z)``, the scalar first, with Hamilton's product (``i j = k``) and unit norm.
``v_n = q_nb v_b q_nb*``. q and -q are the same rotation. A rotation by the angle ``a`` about
the unit axis ``u`` is ``(cos(a/2), u sin(a/2))``; over an interval with the rotation vector
``theta_b = omega_ib_b dt`` the attitude goes on as ``q_nb * exp(theta_b)``.

Signs
-----
* Gravity points down: ``g_n = (0, 0, +g)``.
* At rest the specific force points **up**: ``f_n = (0, 0, -g)`` in NED. A sensor lying flat with
  its z axis up therefore reads +g on z, and with its z axis down reads -g.
* ``f_n = dv_n/dt - g_n`` but for the Earth's rotation.
* The magnetic field points north and, in the northern hemisphere, down. Declination is
  positive when magnetic north lies east of true north: ``true = magnetic + declination``.
  Inclination is positive when the field dips below the horizon.
* Yaw (heading) grows clockwise seen from above: north 0, east +90 deg.

In gimbal lock (pitch +-90 deg) roll is set to zero and yaw carries the whole turn.

Units
-----
SI and radians: s, rad, rad/s, m/s^2, T, m, m/s, Pa; temperature in degrees Celsius
(``temp_degc``). A name without a unit means SI. Any other unit is in the name: ``_deg``,
``_dps``, ``_deg_per_hr``, ``_mg``, ``_ut``, ``_hz``, ``_us``; columns of files and tables always
carry it. To convert, multiply at the call: ``30 * DEG``, ``0.3 * DEG_PER_SQRT_HR``.

Time is in seconds as float64, strictly increasing in each stream, with one origin for all
streams of a recording. ``gyr[k]`` covers the interval ``(t[k-1], t[k]]``.

Noise
-----
White noise is given as an **amplitude density**, the root of the two-sided power spectral
density, in unit per root hertz. A sample over the interval :math:`\Delta t` then has the
standard deviation

.. math:: \sigma_k = \frac{\text{density}}{\sqrt{\Delta t}}

and the integral over the time t, the random walk, :math:`\sigma = \text{density} \sqrt{t}`. This
is the angle or velocity random walk of an Allan plot. A density that was read from a one-sided
spectrum is larger by :math:`\sqrt{2}`: divide it first.

============================== ============================ ==================================
Quantity                       Unit                         On data sheets
============================== ============================ ==================================
Angle random walk              (rad/s)/sqrt(Hz)             deg/sqrt(h): ``DEG_PER_SQRT_HR``
Velocity random walk           (m/s^2)/sqrt(Hz)             ug/sqrt(Hz): ``UG_PER_SQRT_HZ``
Rate random walk (gyro bias)   (rad/s^2)/sqrt(Hz)
Magnetometer noise             T/sqrt(Hz)                   nT/sqrt(Hz): ``NT_PER_SQRT_HZ``
============================== ============================ ==================================

The same matrix in other books and programs
-------------------------------------------
==================== ========================= ================================================
Here                 There                     Note
==================== ========================= ================================================
``C_nb``             Groves ``C_b^n``          lower letter from, upper letter to
``C_nb``             KF-GINS ``cbn``           letters reversed
``C_nb``             gtsam ``nRb``
``C_nb``             pyins ``mat_nb``
``C_nb``             SciPy ``tf_n_b``          and ``Rotation.from_quat`` wants the scalar last
``q_nb``             JPL ``q_bn``              same numbers, scalar last: `jpl_from_quat`
==================== ========================= ================================================
"""
