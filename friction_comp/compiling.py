# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compiles functions with numba: at once, or later while plain Python does their work.

Importing numba and loading compiled code takes most of the start-up time of a node, and compiling
without a cache takes many seconds. A process that must start fast calls `begin_plain` before it
imports compiled functions: its kernels are then plain Python until `compile_rest`, in another
thread, has compiled them for the argument types they were called with. Each kernel is exchanged
between two calls, and returns the same numbers before and after, except for the last bit of an
exponential.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import update_wrapper
import gc
import sys
from typing import Any, TypeVar

import numpy as np

F = TypeVar('F', bound=Callable[..., Any])

_SPARED = ('scipy.linalg.cython_blas', 'coverage')
# The kernels of this process that start as plain Python; None if all are compiled at once.
_later: list[Kernel] | None = None
_plain = False
_compiling = False


def begin_plain() -> None:
    """Let kernels that are imported from now on begin as plain Python.

    Where numba is there already there is nothing to be gained, and nothing changes.
    """
    global _later, _plain
    if 'numba' not in sys.modules and _later is None:
        _later, _plain = [], True


def njit(*, cache: bool = False) -> Callable[[F], F]:
    """Return numba's decorator of that name, or in its place one whose functions begin plain."""
    if _later is None:
        import numba
        return numba.njit(cache=cache)
    return lambda function: Kernel(function, cache)  # type: ignore[return-value]


def import_numba() -> None:
    """Import numba in half of the time, for a process of this package.

    Numba imports scipy only to detect BLAS, and coverage if it is installed. No kernel of this
    package multiplies matrices, but kernels of other packages may, so that this is called only by
    the package's own programs. Another thread must not import scipy meanwhile: the law, which runs
    in parallel, does not need it (`test_compiling`).
    """
    spared = [name for name in _SPARED if name not in sys.modules]
    # For Python's importer, None marks a module that is known to be missing.
    sys.modules.update(dict.fromkeys(spared))  # type: ignore[arg-type]
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        for name in spared:
            del sys.modules[name]


def compiling() -> bool:
    """Return whether kernels are being compiled in another thread.

    Libraries are then opened, which holds up every thread of the process: for 10 ms at most on a
    machine with nothing else to do.
    """
    return _compiling


def compile_rest() -> int:
    """Compile the kernels that started as plain Python, for the arguments they were called with.

    To be called in another thread than the one that runs the kernels. Returns how many were
    exchanged.
    """
    global _plain, _compiling
    if not _later or not _plain:
        return 0
    _compiling = True
    # Garbage collection stops all threads, for longer the more was imported.
    gc.disable()
    try:
        import_numba()
        import numba
        exchanged = 0 if numba.config.DISABLE_JIT else sum(k.exchange() for k in _later)
        _plain = bool(numba.config.DISABLE_JIT)
        return exchanged
    finally:
        gc.freeze()
        gc.enable()
        _compiling = False


class Row:
    """One record of a structured array, its fields as attributes."""


class Kernel:
    """A function that runs as plain Python until its compiled form is there.

    Structured arrays reach the plain function as lists of `Row`, since numpy's own records are
    slow to read by name; what it writes there is written back.
    """

    def __init__(self, function: Callable[..., Any], cache: bool) -> None:
        update_wrapper(self, function)
        self.py_func, self._cache = function, cache
        self._run: Any = None
        self._dispatcher: Any = None
        self._first: tuple[Any, ...] | None = None
        assert _later is not None
        _later.append(self)

    def __call__(self, *args: Any) -> Any:
        """Run the function, compiled where it can be."""
        run = self._run
        if run is not None:
            return run(*args)
        if args and isinstance(args[0], Row):
            # Called from another plain kernel.
            return self.py_func(*args)
        if not _plain:
            self._run = self.dispatcher
            return self._run(*args)
        if self._first is None:
            self._first = args
        return self._call_plain(args)

    @property
    def dispatcher(self) -> Any:
        """Numba's own object for the function."""
        if self._dispatcher is None:
            import numba
            self._dispatcher = numba.njit(cache=self._cache)(self.py_func)
        return self._dispatcher

    @property
    def _numba_type_(self) -> Any:
        # What compiled callers of this function see.
        from numba import types
        return types.Dispatcher(self.dispatcher)

    def exchange(self) -> bool:
        """Compile it for the arguments that it was first called with, and take that from now on."""
        if self._first is None:
            return False
        from numba import typeof
        self.dispatcher.compile(tuple(typeof(value) for value in self._first))
        self._run, self._first = self._dispatcher, None
        return True

    def _call_plain(self, args: tuple[Any, ...]) -> Any:
        given, records = list(args), []
        for index, value in enumerate(args):
            if isinstance(value, np.ndarray) and value.dtype.names:
                given[index], before = _rows(value)
                records.append((value, given[index], before))
        result = self.py_func(*given)
        for array, rows, before in records:
            for j, row in enumerate(rows):
                after = tuple(vars(row).values())
                if after != before[j]:
                    array[j] = after
        return result


def _rows(array: np.ndarray) -> tuple[list[Row], list[tuple[Any, ...]]]:
    """Return the records of an array, shape (J,), as objects and as tuples."""
    names, rows, values = array.dtype.names or (), [], []
    for j in range(len(array)):
        values.append(array[j].item())
        row = Row()
        vars(row).update(zip(names, values[-1]))
        rows.append(row)
    return rows, values
