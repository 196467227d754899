"""Recordings made in code, with their truth."""

from strapdown.simulation.demo import demo_recording, demo_truth

__all__ = ["demo_recording", "demo_truth"]
