"""The one place where compiler options are chosen, and where compiled code is kept."""

import ast
import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numba import config, njit
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numpy.typing import NDArray

# Arrays that the caller owns; the C exporter writes them as float[:], float[:, :] and int[:].
Vec = NDArray[np.float64]
Mat = NDArray[np.float64]
IntVec = NDArray[np.int64]

F = TypeVar("F", bound=Callable[..., Any])


@cache
def source_digest(path: Path) -> str:
    """Digest of a kernel module and of all kernel modules that it calls.

    Numba's own disk cache looks at one file only: a caller stays stale when a function it
    calls in another file changes, be it by an edit or by an upgrade of the package.
    """
    digest = hashlib.sha256()
    for source in sorted(_with_imports(path)):
        digest.update(source.name.encode() + source.read_bytes())
    return digest.hexdigest()[:16]


def _with_imports(path: Path) -> set[Path]:
    """Return `path` and the kernel modules that it imports, directly or not."""
    found = {path}
    new = [path]
    while new:
        for source in _imports(new.pop()) - found:
            found.add(source)
            new.append(source)
    return found


@cache
def _imports(path: Path) -> frozenset[Path]:
    """Return the files of the modules of this package that a file imports."""
    package = __package__ or ""
    root = Path(__file__).parent
    files = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(package):
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names if alias.name.startswith(package)]
        else:
            continue
        for name in names:
            place = root.joinpath(*str(name).removeprefix(package).strip(".").split("."))
            files.add(place.with_suffix(".py") if place != root else root / "__init__.py")
    return frozenset(file for file in files if file.is_file())


@cache
def cache_dir(path: Path) -> Path | None:
    """Folder of the compiled kernels of exactly this source, or None if nowhere can be written.

    ``STRAPDOWN_CACHE_DIR`` overrides the place; otherwise it is the user's cache folder.
    """
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    base = Path(os.environ.get("STRAPDOWN_CACHE_DIR") or os.path.join(home, "strapdown"))
    folder = base / f"{path.stem}-{source_digest(path)}"
    try:
        if not folder.exists():
            folder.mkdir(parents=True)
            _remove_old(base)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return None


def _remove_old(base: Path) -> None:
    """Remove compiled kernels of other sources that nobody has used for a month."""
    for folder in base.glob("*-*"):
        if time.time() - folder.stat().st_mtime > 30 * 86400:
            shutil.rmtree(folder, ignore_errors=True)


class _Locator(_CacheLocator):  # type: ignore[misc]
    """Puts compiled code under `cache_dir`, stamped with the digest of its sources."""

    def __init__(self, py_func: Any, py_file: str) -> None:
        self._path = Path(py_file)
        self._py_func = py_func
        self._lineno = py_func.__code__.co_firstlineno

    def get_cache_path(self) -> str:
        return str(cache_dir(self._path))

    def get_source_stamp(self) -> str:
        return source_digest(self._path)

    def get_disambiguator(self) -> str:
        return f"{self._py_func.__module__}-{self._lineno}"

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> "_Locator | None":
        return None if cache_dir(Path(py_file)) is None else cls(py_func, py_file)


class _CacheImpl(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = [_Locator]  # noqa: RUF012 - numba's own interface


class _Cache(FunctionCache):  # type: ignore[misc]
    _impl_class = _CacheImpl


def kernel(func: F) -> F:
    """Compile `func` in nopython mode with the project's options.

    ``fastmath`` stays off: it makes ``isnan`` return False and breaks
    batch/stream equality.  ``error_model='numpy'`` gives inf/nan instead of
    raising ZeroDivisionError in the middle of a loop.
    """
    return _compiled(func, inline=False)


def inlined_kernel(func: F) -> F:
    """`kernel` whose code is put into its callers: for what every sample passes through.

    The compiler alone leaves functions of that size as calls, which costs Madgwick's filter a
    quarter of its time.
    """
    return _compiled(func, inline=True)


def _compiled(func: F, *, inline: bool) -> F:
    """Return `func` with a compiler behind it, and a place for what it makes."""
    compiled = njit(error_model="numpy", forceinline=inline)(func)
    if not config.DISABLE_JIT and cache_dir(_source(func)) is not None:
        compiled._cache = _Cache(func)
    return cast(F, compiled)


def is_compiled(func: Callable[..., Any]) -> bool:
    """Whether calling `func` starts at once: compiled in this process, or kept on disk."""
    if config.DISABLE_JIT or getattr(func, "signatures", None):
        return True
    folder = cache_dir(_source(func))
    stem = f"{func.__name__}-"
    return folder is not None and any(
        func.__module__ in path.name and stem in path.name for path in folder.glob("*.nbi")
    )


def _source(func: Callable[..., Any]) -> Path:
    """Return the file in which a function is written."""
    return Path(func.__code__.co_filename)
