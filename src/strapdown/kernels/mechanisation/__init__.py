"""Strapdown mechanisations of four frames; no estimation, only integration."""
