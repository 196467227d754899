"""Independent truths: closed forms and high-precision arithmetic, no code of the package."""
