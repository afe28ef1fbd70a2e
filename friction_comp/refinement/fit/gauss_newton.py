# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""All constants and coefficients of a fit together, by the Gauss-Newton method."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import TYPE_CHECKING

import numpy as np

from friction_comp.refinement.fit.effect_sum import TRIAL
from friction_comp.refinement.fit.robust_regression import huber_loss, side_by_side, solve

if TYPE_CHECKING:
    from friction_comp.refinement.fit.effect_sum import Fit

_HALVINGS = 4
_ENOUGH = 1e-4
# Steepness of the sigmoid, and the velocity over which other terms change sign, in parts of the
# top speed: outside of this the recordings cannot tell.
_STEEPEST, _FLATTEST = 3000.0, 2.0
# Friction that takes longer to change its sign than this part of the top speed is viscous.
_WIDEST = 0.15


@dataclass(frozen=True)
class Handle:
    """One constant of a fit: which, and the step in which it is measured.

    Parameters
    ----------
    place : int
        Of the term; -1 for what the sigmoid or all terms share.
    name : str
    unit : float
        The constant's change for a step of one; of its logarithm where `logarithmic`.
    logarithmic : bool
    """

    place: int
    name: str
    unit: float
    logarithmic: bool


def handles(fit: Fit, centered: bool) -> list[Handle]:
    """Return the constants of a fit that may be adjusted; `centered` leaves the shift alone."""
    found = [Handle(-1, 'steepness', 1.0, True)]
    if not centered and fit.data.scene.both_directions:
        found.append(Handle(-1, 'shift', 1.0 / fit.steepness, False))
    if any('transition' in term.constants for term in fit.terms):
        found.append(Handle(-1, 'transition', 1.0, True))
    for place, term in enumerate(fit.terms):
        for name, how in term.kind.constants.items():
            if how is None:
                continue
            if how.logarithmic:
                found.append(Handle(place, name, math.log(how.width), True))
            else:
                unit = how.width * how.unit(fit.data.scene, term.constants)
                found.append(Handle(place, name, unit if how.joint_only else 0.5 * unit, False))
    return found


def value_of(fit: Fit, handle: Handle) -> float:
    """Return a constant's value."""
    if handle.place < 0:
        return getattr(fit, handle.name)
    return fit.terms[handle.place].constants[handle.name]


def shifted(fit: Fit, moves: list[tuple[Handle, float]]) -> Fit:
    """Return a fit with constants moved by so many of their units, not solved yet.

    Parameters
    ----------
    fit : Fit
    moves : list of (Handle, float)
    """
    twin = fit.copy()
    reshaped = False
    for handle, step in moves:
        value = value_of(fit, handle)
        value = (value * math.exp(handle.unit * step) if handle.logarithmic
                 else value + handle.unit * step)
        if handle.place < 0:
            setattr(twin, handle.name, within(twin, handle.name, value))
        else:
            old = twin.terms[handle.place]
            value = old.kind.limited(
                handle.name, value, old.constants, fit.data.scene)
            twin.terms[handle.place] = old.with_constants(**{handle.name: value})
            reshaped = reshaped or old.kind.reshapes
    twin.terms = [term.turned(twin.transition) for term in twin.terms]
    if reshaped:
        twin.fill()
        return twin
    for place, (new, old) in enumerate(zip(twin.terms, fit.terms)):
        if new is not old:
            twin.evaluate(place)
    if (twin.steepness, twin.shift) != (fit.steepness, fit.shift):
        twin.evaluate(-1)
    return twin


def within(fit: Fit, name: str, value: float) -> float:
    """Return a constant of the sigmoid kept within what the recordings can tell."""
    speed = fit.data.scene.speed
    if name == 'steepness':
        return min(max(value, _FLATTEST / speed), _STEEPEST / speed)
    if name == 'transition':
        return min(max(value, 2.0 * speed / _STEEPEST), speed * _WIDEST)
    return min(max(value, -0.1 * speed), 0.1 * speed)


def gauss_newton(fit: Fit, rounds: int = 6, centered: bool = False) -> Fit:
    """Return the fit with all its constants adjusted together.

    Each round solves for the coefficients and for small changes of the constants at once, from
    the derivative of the prediction by every constant, and halves the step until it helps.

    Parameters
    ----------
    fit : Fit
    rounds : int
        At most so many.
    centered : bool
        Whether the middle of the sigmoid's transition has to stay where it is.

    Returns
    -------
    Fit
    """
    scale = fit.scale
    best = float(np.mean(huber_loss(fit.left, scale)))
    for _ in range(rounds):
        knobs = handles(fit, centered)
        small = 1e-3
        slopes = []
        for handle in knobs:
            twin = shifted(fit, [(handle, small)])
            changed = [((new - old) @ own)[:, None] for new, old, own in zip(
                twin.parts, fit.parts, fit.own_coefficients()) if new is not old]
            slopes.append(sum(changed, np.zeros((len(fit.index), 1))) / small)
        design = side_by_side([*fit.parts, *slopes])
        step = solve(design, fit.target[fit.index], fit.weights)[-len(knobs):]
        step = np.clip(step, -1.0, 1.0)
        better = None
        for halving in range(_HALVINGS):
            twin = shifted(fit, list(zip(knobs, step * 0.5 ** halving)))
            twin.solve(TRIAL)
            size = float(np.mean(huber_loss(twin.left, scale)))
            if size < best:
                better = (size, twin)
                break
        if better is None:
            break
        gain, best, fit = best - better[0], better[0], better[1]
        if gain < _ENOUGH * best:
            break
    fit = fit.copy()
    fit.solve()
    return fit


def gauss_newton_restarted(fit: Fit) -> Fit:
    """Return the better of two fits: adjusted from where it is, and from a centred sigmoid.

    The sigmoid's place and steepness may have been drawn away by effects that were not in the
    model yet, too far to find back in small steps.
    """
    near = gauss_newton(fit)
    speed = fit.data.scene.speed
    scale = near.scale
    fresh = None
    for steepness in (12.0 / speed, 40.0 / speed, 120.0 / speed, 400.0 / speed):
        twin = fit.copy()
        twin.steepness, twin.shift, twin.transition = steepness, 0.0, 2.0 / steepness
        twin.fill()
        twin.solve(TRIAL)
        size = float(np.mean(huber_loss(twin.left, scale)))
        if fresh is None or size < fresh[0]:
            fresh = (size, twin)
    limit = float(np.mean(huber_loss(near.left, scale)))
    # Only a start that is in reach of the present best is worth the way.
    if fresh[0] > 4.0 * limit + 1e-30:
        return near
    other = gauss_newton(fresh[1])
    size = float(np.mean(huber_loss(other.left, scale)))
    return other if size < limit else near


def center_sigmoid(fit: Fit) -> Fit:
    """Return the fit with its sigmoid's transition at zero velocity.

    Between standstill and the slowest motion recorded, the place of the transition is a matter of
    chance. It decides on the current at standstill, so that the plain choice is the safe one.
    """
    twin = fit.copy()
    twin.shift = 0.0
    twin.fill()
    twin.solve()
    return gauss_newton(twin, centered=True)
