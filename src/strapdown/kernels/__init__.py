"""The number crunching: floats and float64 arrays in, floats and arrays out. Nothing else.

One source, three lives: Numba compiles it, CPython runs it for debugging and coverage,
and it stays in the subset that translates to C.
"""
