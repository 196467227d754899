"""Test session set-up: compiled kernels are kept per checkout, in a folder that is ignored."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT.parent / "shared" / "data"

# The package keeps one folder per digest of all kernel sources inside this one, so an edited
# kernel never runs stale. Commands that tests start inherit the variable.
os.environ.setdefault("STRAPDOWN_CACHE_DIR", str(ROOT / ".numba_cache"))


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the real recordings; the test is skipped where it is absent."""
    if not DATA.is_dir():
        pytest.skip("needs the real recordings in ../shared/data")
    return DATA


@pytest.fixture(scope="session")
def broad_02(data_dir: Path) -> Path:
    """A slow undisturbed rotation of BROAD: 9 axes at 286 Hz with optical reference."""
    return data_dir / "broad" / "02_undisturbed_slow_rotation_B.mat"


@pytest.fixture(scope="session")
def parking_lot(data_dir: Path) -> Path:
    """A short road drive: IMU, GNSS and a better receiver's fused reference."""
    return data_dir / "drives" / "parking-lot-figure8-nominal-001"
