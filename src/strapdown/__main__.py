"""Lets ``python -m strapdown`` be the command line."""

import sys

from strapdown.cli import main

if __name__ == "__main__":
    sys.exit(main())
