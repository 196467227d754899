"""Small logs for tests of files, and what it means that two recordings are the same."""

import numpy as np

from strapdown.recording import Recording

G = 9.80665


def unit_rows(rng: np.random.Generator, n: int) -> np.ndarray:
    """Random unit quaternions."""
    q = rng.normal(size=(n, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def six_axes(n: int = 50, rate: float = 100.0) -> np.ndarray:
    """Columns of a device that turns slowly: t [s], gyr [rad/s], acc [m/s^2]."""
    t = np.arange(n) / rate
    gyr = np.column_stack((0.3 * np.sin(t), 0.2 * np.cos(2 * t), 0.1 + 0 * t))
    acc = np.column_stack((0.5 * np.sin(t), 0.4 * np.cos(t), -G + 0.1 * t))
    return np.column_stack((t, gyr, acc))


def assert_same(a: Recording, b: Recording) -> None:
    """Streams, reference and metadata are the same bit for bit, NaN included."""
    pairs = [dict(a.streams()), dict(b.streams())]
    assert list(pairs[0]) == list(pairs[1])
    if a.reference is not None or b.reference is not None:
        assert a.reference is not None
        assert b.reference is not None
        assert a.reference.heading == b.reference.heading
        for pair, rec in zip(pairs, (a, b), strict=True):
            pair |= {f"reference.{n}": s for n, s in rec.reference.streams()}
    assert list(pairs[0]) == list(pairs[1])
    for name, stream in pairs[0].items():
        other = pairs[1][name]
        assert stream.t.tobytes() == other.t.tobytes(), name
        for spec in stream.FIELDS:
            x, y = getattr(stream, spec.name), getattr(other, spec.name)
            assert (x is None) == (y is None), (name, spec.name)
            if x is not None:
                assert x.dtype == y.dtype
                assert x.tobytes() == y.tobytes(), (name, spec.name)
    assert dict(a.meta) == dict(b.meta)
