"""The simulated drive, importable by the tests of this folder."""

import importlib.util
import sys
from pathlib import Path

_spec = importlib.util.spec_from_file_location("drive", Path(__file__).with_name("drive.py"))
assert _spec is not None
assert _spec.loader is not None
drive = importlib.util.module_from_spec(_spec)
sys.modules["drive"] = drive
_spec.loader.exec_module(drive)
