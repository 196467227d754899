"""``strapdown filters``: what there is."""


def filters() -> None:
    """List the estimators."""
