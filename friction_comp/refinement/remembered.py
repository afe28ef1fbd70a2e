# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a search asks again it is told from memory: nothing is fitted twice to the same data."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, cast, Concatenate, ParamSpec, TypeVar

import numpy as np

from friction_comp.refinement.prepare.fit_data import FitData

P = ParamSpec('P')
R = TypeVar('R')


def remembered(function: Callable[Concatenate[FitData, P], R]
               ) -> Callable[Concatenate[FitData, P], R]:
    """Return a function that works something out once for the same data, fits and all else.

    Fits are the same where they are one object: none is changed after it was solved. Memory lasts
    as long as the `FitData`.
    """
    @wraps(function)
    def asked(data: FitData, *args: P.args, **named: P.kwargs) -> R:
        key = (function, *map(_key, args), *((name, _key(named[name])) for name in sorted(named)))
        if key not in data.known:
            # The arguments are kept as well, or another object might get the place of one.
            data.known[key] = function(data, *args, **named), args, named
        return cast(R, data.known[key][0])
    return cast('Callable[Concatenate[FitData, P], R]', asked)


def _key(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return tuple(map(_key, value))
    return id(value) if isinstance(value, np.ndarray) else value
