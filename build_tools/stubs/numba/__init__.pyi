# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What of numba the package uses, for type checkers: compiled functions keep their types."""

from collections.abc import Callable
from typing import TypeVar

F = TypeVar('F', bound=Callable[..., object])

def njit(*, cache: bool = ..., parallel: bool = ...) -> Callable[[F], F]: ...
def vectorize(*, cache: bool = ...) -> Callable[[F], F]: ...

prange = range
