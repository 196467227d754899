"""Recordings made in code, with their truth."""

from strapdown.simulation import demo

__all__ = ["demo"]
