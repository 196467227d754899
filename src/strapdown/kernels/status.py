"""Bits of the status word that every estimator writes; `solution.Status` names them for users."""

ALIGNING = 1
GYR_INVALID = 2
ACC_INVALID = 4
MAG_INVALID = 8
ACC_REJECTED = 16
MAG_REJECTED = 32
AIDING_REJECTED = 64
GAP = 128
REST = 256
SATURATED = 512
MAG_DISTURBED = 1024
OUTAGE = 2048
MAG_MISSING = 4096
GYR_STUCK = 8192

# What became of a measurement, in the diagnostics.
NOT_MEASURED = 0
ACCEPTED = 1
REJECTED_GATE = 2
REJECTED_INVALID = 3
REJECTED_DISTURBED = 4
