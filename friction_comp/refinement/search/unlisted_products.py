# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Dependences that no effect known to the package describes, tried beside those that do.

A wrong name is worse than none: where the product of two variables explains clearly more than the
best effect with a name, that effect would only stand in for it. Such a product never becomes part
of a model; its variables are what is reported.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.friction_sign import sign
from friction_comp.refinement.search.candidate_fit import chance_of, try_kind

if TYPE_CHECKING:
    from friction_comp.model.effects.scene import Scene
    from friction_comp.refinement.fit.effect_sum import Fit
    from friction_comp.refinement.prepare.fit_data import FitData
    from friction_comp.refinement.search.candidate_fit import CandidateFit
    from friction_comp.samples import Samples

# So many times as much as the best effect with a name has a product to explain; less where that
# effect needs several numbers more to do so.
_CLEARLY, _AS_MUCH, _SIMPLE = 1.25, 0.85, 1


def _scaled(values: np.ndarray) -> np.ndarray:
    """Return values about their middle, of size one."""
    low, high = np.percentile(values, (1, 99))
    return (values - 0.5 * (low + high)) / max(0.5 * (high - low), 1e-300)


class Nameless(Effect):
    """What is tried like an effect and never becomes part of a model."""

    variables: tuple[str, ...] = ()

    @staticmethod
    def columns(x: Any, c: Any) -> tuple[Any, ...]:
        """Return no column: what has no name is never evaluated one sample at a time."""
        return ()

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """Return the one way to try it."""
        return [{'transition': scene.transition}]


def _product(words: str, words_of: tuple[Any, ...], of: Callable[..., Any],
             signals: tuple[Any, ...] = ()) -> type[Effect]:
    """Return a stand-in for an effect, made of a function of samples and sign of friction."""
    class Product(Nameless):
        """One column: a product of variables, each about its middle."""

        name, needs = words, tuple(signals)
        variable, variables = words_of[0], tuple(words_of)
        constants = {'transition': None}

        @classmethod
        def matrix(cls, samples: Samples, constants: dict[str, float]) -> np.ndarray:
            """Return one column, shape (N, 1)."""
            return of(samples, constants['transition'])[:, None]
    return Product


class Change(Nameless):
    """Friction of another level from some moment on."""

    name = 'another level of friction from some moment on'
    variable, variables = 'time', ('time',)
    constants = {'moment': None, 'transition': None}

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """Return moments all through the longest recording."""
        return [{'moment': share * scene.duration, 'transition': scene.transition}
                for share in np.linspace(0.04, 0.96, 47)]

    @classmethod
    def matrix(cls, samples: Samples, constants: dict[str, float]) -> np.ndarray:
        """Return two columns, of Coulomb and of viscous friction, shape (N, 2)."""
        later = (samples.time > constants['moment']).astype(float)
        return np.column_stack((later * sign(samples.velocity, constants['transition']),
                                later * samples.velocity))


PRODUCTS = (
    Change,
    _product('the product of position and velocity', ('position', 'velocity'),
             lambda s, _: _scaled(s.position) * s.velocity),
    _product('the product of position and speed', ('position', 'velocity'),
             lambda s, _: _scaled(s.position) * np.abs(s.velocity)),
    _product('the size of the acceleration', ('acceleration',),
             lambda s, _: np.abs(s.acceleration)),
    _product('the size of the acceleration as friction', ('acceleration',),
             lambda s, t: np.abs(s.acceleration) * sign(s.velocity, t)),
    _product('the product of load and speed', ('load', 'velocity'),
             lambda s, _: s.load * np.abs(s.velocity), ('load',)),
    _product('the product of the size of the load and velocity', ('load', 'velocity'),
             lambda s, _: np.abs(s.load) * s.velocity, ('load',)),
    _product('the product of load and position', ('load', 'position'),
             lambda s, _: s.load * _scaled(s.position), ('load',)),
    _product('friction as the product of load and position', ('load', 'position'),
             lambda s, t: np.abs(s.load) * _scaled(s.position) * sign(s.velocity, t), ('load',)),
)


def products_for(data: FitData) -> list[type[Effect]]:
    """Return the products whose signals were recorded."""
    return [kind for kind in PRODUCTS
            if all(getattr(data.samples, signal) is not None for signal in kind.needs)]


def better(trial: CandidateFit, named: list[CandidateFit], limit: float) -> bool:
    """Tell whether a product explains clearly more than every effect with a name.

    Parameters
    ----------
    trial : CandidateFit
        Of the product.
    named : list of CandidateFit
    limit : float
        p-value that the product must stay below.
    """
    if trial.p_value >= limit or trial.advantage <= 0.0:
        return False
    if not named:
        return True
    best = max(named, key=lambda other: other.advantage)
    simpler = trial.kind is not Change and best.complexity > _SIMPLE + trial.complexity
    share = _AS_MUCH if simpler else _CLEARLY
    return trial.advantage > share * best.advantage


def best_product(data: FitData, fits: list[Fit], residual: np.ndarray, named: list[CandidateFit],
                 least: float) -> type[Effect] | None:
    """Return the product that explains most, None where an effect with a name does as well.

    Parameters
    ----------
    data : FitData
    fits : list of Fit
    residual : ndarray, shape (N,)
    named : list of CandidateFit
        Of the effects with a name.
    least : float
        Advantage in A² that is worth a word.
    """
    best = None
    products = products_for(data)
    for kind in products:
        trial = try_kind(data, fits, residual, kind)
        if trial is None or trial.advantage < least:
            continue
        if better(trial, named, chance_of(kind, len(products))) and (
                best is None or trial.advantage > best.advantage):
            best = trial
    return best.kind if best else None
