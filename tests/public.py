"""What the package shows to its users, for the tests that walk over all of it."""

import pkgutil

import strapdown


def modules() -> list[str]:
    """Names of all public modules and packages."""
    found = [
        module.name
        for module in pkgutil.walk_packages(strapdown.__path__, "strapdown.")
        if not any(part.startswith("_") for part in module.name.split("."))
    ]
    return ["strapdown", *found]
