"""Compiled kernels: plain array functions in the subset numba compiles, compiled when first used, cached on disk.

A kernel stays in the file of its method, decorated with :func:`kernel`; importing it does not import numba. A large one
is made of functions decorated with :func:`part`, which are compiled into it; it may call other kernels, too. They are
kept where :mod:`cartctl.kernel_cache` says. With ``NUMBA_DISABLE_JIT=1`` the same functions run as Python.
"""

from __future__ import annotations

import logging
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FunctionType
from typing import Any, Generic, ParamSpec, TypeVar

from cartctl.kernel_cache import cache_folder

P = ParamSpec("P")
R = TypeVar("R")

_SLOW = 1.0  # s of compiling that pass without a word
_log = logging.getLogger("cartctl")

# Sums may be reordered and fused, so that dot products are vectorised; nan and inf keep their meaning.
_FAST = {"reassoc", "contract", "nsz"}


class Kernel(Generic[P, R]):
    """A function that compiles itself, for one signature, when it is first called or asked for."""

    def __init__(self, function: Callable[P, R], signature: str, fast: bool, alone: bool, lean: bool) -> None:
        self.function = function
        self.signature = signature
        self.fast = fast
        self.alone = alone
        self.lean = lean
        self.__doc__ = function.__doc__
        self.__name__ = function.__name__

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Call the compiled function."""
        return self.compiled(*args, **kwargs)

    @property
    def compiled(self) -> Callable[P, R]:
        """The compiled function itself; hot loops hold on to it."""
        try:
            return self._compiled
        except AttributeError:
            with _deferred_interrupt():
                self._compiled: Callable[P, R] = _compile(self)
            return self._compiled

    @property
    def inner(self) -> Any:
        """What another kernel calls: the compiled function, with the same numbers as when Python calls it."""
        return self.compiled


class Part(Generic[P, R]):
    """A function that kernels are made of; called from Python, it runs as Python."""

    def __init__(self, function: Callable[P, R], lean: bool) -> None:
        self.function = function
        self.lean = lean
        self.__doc__ = function.__doc__
        self.__name__ = function.__name__
        self._inner: Any = None

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Run as Python."""
        return self.function(*args, **kwargs)

    @property
    def inner(self) -> Any:
        """What a kernel calls: compiled with it, for the types it is called with."""
        if self._inner is None:
            import numba

            # said in both cases, or it would be as in the caller
            options = {"error_model": "numpy", "fastmath": _FAST, "_nrt": not self.lean}
            self._inner = numba.njit(**options)(_with_parts(self.function))
        return self._inner


def part(function: Callable[P, R]) -> Part[P, R]:
    """Mark a function as a part of kernels in this or another file."""
    return Part(function, False)


def lean_part(function: Callable[P, R]) -> Part[P, R]:
    """A :func:`part` that makes no arrays: those it is given outlive it, so it counts no references to them.

    In a loop over small arrays, counting takes half the time. One that returns views is for other lean ones alone: who
    counts would give them back.
    """
    return Part(function, True)


def _with_parts(function: Callable[P, R]) -> Callable[P, R]:
    """``function`` with the parts and kernels among its globals as numba can call them.

    A kernel is linked as it is, with its own signature: compiled once, whoever calls it.
    """
    assert isinstance(function, FunctionType)
    known = function.__globals__
    parts = {name: known[name] for name in function.__code__.co_names if isinstance(known.get(name), Part | Kernel)}
    if not parts:
        return function
    inner = {name: found.inner for name, found in parts.items()}
    bound = FunctionType(function.__code__, known | inner, function.__name__, function.__defaults__)
    bound.__qualname__, bound.__module__ = function.__qualname__, function.__module__
    return bound


@contextmanager
def _deferred_interrupt() -> Iterator[None]:
    """Hold back Ctrl-C while compiling: inside the compiler's callbacks it would be swallowed."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    caught: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: caught.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if caught:
            raise KeyboardInterrupt


def kernel(
    signature: str, *, fast: bool = False, alone: bool = False, lean: bool = False
) -> Callable[[Callable[P, R]], Kernel[P, R]]:
    """Mark a function as a kernel of the given signature, such as ``"bool(matrix, vector, float, out_vector)"``.

    ``vector`` and ``matrix`` are float64 arrays of any memory order, read-only ones included, ``ints`` an int64 array;
    ``out_store`` and ``out_int_store`` are contiguous vectors, which kernels make views of. The kernel writes only to
    an ``out_`` argument. One signature means one compilation, at a time of the caller's
    choosing. fast: sums may be reordered, as they may in every :func:`part`. alone: it lets go of the interpreter's
    lock, so that several threads may run it at once. lean: it is as a :func:`lean_part`.
    """
    return lambda function: Kernel(function, signature, fast, alone, lean)


def _numba_type(name: str) -> Any:
    from numba import types

    arrays = {"vector": (types.float64, 1), "matrix": (types.float64, 2), "ints": (types.int64, 1)}
    bare = name.removeprefix("out_")
    if bare in arrays:
        return types.Array(*arrays[bare], "A", readonly=bare == name)
    if name in ("out_store", "out_int_store"):
        return types.Array(types.float64 if name == "out_store" else types.int64, 1, "C")
    return {"float": types.float64, "int": types.int64, "bool": types.boolean, "void": types.void}[name]


def _compile(kernel: Kernel[P, R]) -> Callable[P, R]:
    returned, _, arguments = kernel.signature.rstrip(")").partition("(")
    types = _numba_type(returned)(*(_numba_type(name.strip()) for name in arguments.split(",")))
    function = _with_parts(kernel.function)
    options: dict[str, Any] = {
        "error_model": "numpy",
        "fastmath": _FAST if kernel.fast else False,
        "nogil": kernel.alone,
        "_nrt": not kernel.lean,
    }
    folder = cache_folder(Path(function.__code__.co_filename))
    with _told_when_slow(folder):
        return _compiled_into(folder, types, options, function)  # type: ignore[no-any-return]


def _compiled_into(folder: Path | None, types: Any, options: dict[str, Any], function: Callable[P, R]) -> Any:
    import numba

    if folder is None:
        return numba.njit(types, **options)(function)
    # numba reads the folder while it decorates; the setting is global, so it is put back for the caller's own functions
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        return numba.njit(types, cache=True, **options)(function)
    finally:
        numba.config.CACHE_DIR = before


_told = threading.Event()


@contextmanager
def _told_when_slow(folder: Path | None) -> Iterator[None]:
    """Say why it takes so long, once a process, where compiling takes more than a second."""
    timer = threading.Timer(_SLOW, _tell, (folder,))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _tell(folder: Path | None) -> None:
    """A line on stderr for whoever waits there; for a pipe or a file, a remark for the log."""
    if not _told.is_set():
        _told.set()
        how = "anew in every process: no folder to keep it in" if folder is None else "once, then kept on disk"
        waits = sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)
        _log.log(logging.WARNING if waits else logging.INFO, "cartctl is compiling (%s); this takes a moment", how)
