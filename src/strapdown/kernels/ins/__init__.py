"""Kernels of the loosely coupled GNSS/INS filter `strapdown.navigation.LooselyCoupled`."""
