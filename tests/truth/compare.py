"""Comparison with the stated tolerance and no other."""

from functools import partial

import numpy as np

# NumPy's own default of rtol=1e-7 would hide every error in the last nine digits.
assert_close = partial(np.testing.assert_allclose, rtol=0.0, atol=0.0)
