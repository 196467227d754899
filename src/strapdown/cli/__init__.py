"""The command line: one module per verb, what they share in modules with an underscore."""

from strapdown.cli._app import main

__all__ = ["main"]
