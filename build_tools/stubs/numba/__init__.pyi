# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What of numba the package uses, for type checkers: compiled functions keep their types."""

from collections.abc import Callable
from typing import Any, overload, TypeVar

F = TypeVar('F', bound=Callable[..., Any])

class Signature: ...

@overload
def njit(function: F, /, *, cache: bool = ..., parallel: bool = ...) -> F: ...
@overload
def njit(signature: Signature, /, *, cache: bool = ...) -> Callable[[F], F]: ...
@overload
def njit(*, cache: bool = ..., parallel: bool = ...) -> Callable[[F], F]: ...

# It takes arrays of any shape where the function is written for one number.
def vectorize(*, cache: bool = ...) -> Callable[[Callable[..., float]], Callable[..., Any]]: ...
def float64(*arguments: object) -> Signature: ...

types: Any
prange = range
