# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compiles functions with numba, at once or later while they run in plain Python.

Importing numba and loading compiled code takes most of the start-up time of a node, and compiling
without a cache takes many seconds. A process that must start fast calls `defer_compilation` before
it imports compiled functions. These kernels then run in plain Python until `compile_deferred`, in
another thread, has compiled them for the argument types of their first call. Each kernel is
replaced between two calls, and returns the same numbers before and after, except for the last bit
of an exponential.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import update_wrapper
import gc
import importlib
import sys
import threading
from typing import Any, TypeVar

import numpy as np

F = TypeVar('F', bound=Callable[..., Any])

_SKIPPED_MODULES = ('scipy.linalg.cython_blas', 'coverage')
# The kernels of this process that start as plain Python; None if all are compiled at once.
_deferred: list[Kernel] | None = None
_plain = False
_compiling = False
# Held while modules are hidden from numba; see `import_beside`.
_hiding = threading.Lock()


def defer_compilation() -> None:
    """Start kernels that are imported from now on as plain Python; see `compile_deferred`.

    It has no effect if numba has already been imported.
    """
    global _deferred, _plain
    if 'numba' not in sys.modules and _deferred is None:
        _deferred, _plain = [], True


def njit(*, cache: bool = False) -> Callable[[F], F]:
    """Return ``numba.njit`` or, after `defer_compilation`, a decorator that makes a `Kernel`.

    With ``NUMBA_DISABLE_JIT=1`` kernels stay plain Python: records have no attributes otherwise.
    """
    global _deferred, _plain
    if _deferred is None:
        import numba
        if not numba.config.DISABLE_JIT:
            return numba.njit(cache=cache)
        _deferred, _plain = [], True
    return lambda function: Kernel(function, cache)  # type: ignore[return-value]


def import_numba() -> None:
    """Import numba in half of the time, for a process of this package.

    Numba imports scipy only to detect BLAS, and coverage if it is installed; both are skipped. No
    kernel of this package multiplies matrices, but those of other packages may, so only the
    package's own programs call this. Another thread that needs scipy meanwhile takes it from
    `import_beside`; the law, which runs in parallel, does not need it (`test_compiling`).
    """
    with _hiding:
        skipped = [name for name in _SKIPPED_MODULES if name not in sys.modules]
        # For Python's importer, None marks a module as missing.
        sys.modules.update(dict.fromkeys(skipped))  # type: ignore[arg-type]
        try:
            import numba.np.arraymath  # noqa: F401
        finally:
            for name in skipped:
                del sys.modules[name]


def import_beside(name: str) -> None:
    """Import a module that needs scipy in a process that may be importing numba; waits for that."""
    if name not in sys.modules:
        with _hiding:
            importlib.import_module(name)


def compiling() -> bool:
    """Return whether kernels are being compiled in another thread.

    Libraries are then loaded, which blocks all threads of the process, for 10 ms at most on an idle
    machine.
    """
    return _compiling


def compile_deferred() -> int:
    """Compile the kernels that started as plain Python, for the arguments of their first call.

    Must be called in a thread other than the one that runs the kernels. Returns the number of
    kernels replaced.
    """
    global _plain, _compiling
    if not _deferred or not _plain:
        return 0
    _compiling = True
    # Garbage collection stops all threads, and takes longer the more was imported.
    gc.disable()
    try:
        import_numba()
        import numba
        replaced = 0 if numba.config.DISABLE_JIT else sum(k.compile() for k in _deferred)
        _plain = bool(numba.config.DISABLE_JIT)
        return replaced
    finally:
        gc.freeze()
        gc.enable()
        _compiling = False


class RecordView:
    """One record of a structured array, with its fields as attributes."""


class Kernel:
    """A function that runs as plain Python until it is compiled.

    Structured arrays are passed to the plain function as lists of `RecordView`, since reading
    fields of numpy's records is slow; changes are written back to the array.
    """

    def __init__(self, function: Callable[..., Any], cache: bool) -> None:
        update_wrapper(self, function)
        self.py_func, self._cache = function, cache
        self._run: Any = None
        self._dispatcher: Any = None
        self._first_args: tuple[Any, ...] | None = None
        assert _deferred is not None
        _deferred.append(self)

    def __call__(self, *args: Any) -> Any:
        """Run the function, compiled if possible.

        While compilation is deferred, the first arguments are kept: `compile` needs their types.
        """
        if (run := self._run) is not None:
            return run(*args)
        if args and isinstance(args[0], RecordView):
            # Called from another plain kernel.
            return self.py_func(*args)
        if not _plain:
            self._run = self.dispatcher
            return self._run(*args)
        if self._first_args is None:
            self._first_args = args
        return self._call_plain(args)

    @property
    def dispatcher(self) -> Any:
        """Numba's compiled function."""
        if self._dispatcher is None:
            import numba
            self._dispatcher = numba.njit(cache=self._cache)(self.py_func)
        return self._dispatcher

    @property
    def _numba_type_(self) -> Any:
        # The type of this function for numba when it compiles a caller.
        from numba import types
        return types.Dispatcher(self.dispatcher)

    def compile(self) -> bool:
        """Compile for the types of the first call's arguments; return False if there was none."""
        if self._first_args is None:
            return False
        from numba import typeof
        self.dispatcher.compile(tuple(typeof(value) for value in self._first_args))
        self._run, self._first_args = self._dispatcher, None
        return True

    def _call_plain(self, args: tuple[Any, ...]) -> Any:
        plain_args, records = list(args), []
        for index, value in enumerate(args):
            if isinstance(value, np.ndarray) and value.dtype.names:
                plain_args[index], before = _rows(value)
                records.append((value, plain_args[index], before))
        result = self.py_func(*plain_args)
        for array, rows, before in records:
            for j, row in enumerate(rows):
                after = tuple(vars(row).values())
                if after != before[j]:
                    array[j] = after
        return result


def _rows(array: np.ndarray) -> tuple[list[RecordView], list[tuple[Any, ...]]]:
    """Return the records of an array, shape (J,), as objects and as tuples."""
    names, rows, values = array.dtype.names or (), [], []
    for j in range(len(array)):
        values.append(array[j].item())
        row = RecordView()
        vars(row).update(zip(names, values[-1]))
        rows.append(row)
    return rows, values
