"""Compiled code is kept per module, and made anew when anything that it calls has changed."""

from pathlib import Path

import pytest

from strapdown.kernels import _jit

KERNELS = Path(_jit.__file__).parent


@pytest.mark.parametrize(
    ("module", "called"),
    [
        ("madgwick.py", "quat.py"),
        ("robust_eskf.py", "robust_eskf_update.py"),
        ("ins/step.py", "ins/covariance.py"),
        ("ins/smooth.py", "quat.py"),
        ("mekf.py", "_jit.py"),
    ],
)
def test_a_module_is_known_by_its_source_and_by_what_it_calls(module: str, called: str) -> None:
    sources = _jit._with_imports(KERNELS / module)
    assert {KERNELS / module, KERNELS / called} <= sources


def test_a_module_does_not_depend_on_what_it_does_not_call() -> None:
    assert KERNELS / "ins/step.py" not in _jit._with_imports(KERNELS / "madgwick.py")


def test_digest_changes_with_a_file_that_is_called_by_a_called_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "package"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "outer.py").write_text("from package.middle import b\n")
    (package / "middle.py").write_text("from package import inner\n")
    (package / "inner.py").write_text("X = 1\n")
    monkeypatch.setattr(_jit, "__file__", str(package / "_jit.py"))
    monkeypatch.setattr(_jit, "__package__", "package")
    before = _jit.source_digest(package / "outer.py")
    _jit.source_digest.cache_clear()
    (package / "inner.py").write_text("X = 2\n")
    assert _jit.source_digest(package / "outer.py") != before
