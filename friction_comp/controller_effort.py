# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Efforts that follow from other signals: of a position controller, and of a gear alone."""

from __future__ import annotations

import numpy as np

# Share of the top speed over which friction is taken to change its sign.
_TRANSITION = 0.03
# Parts of a recording whose scatter gives the standard error.
_PARTS = 10


def controller_effort(time: np.ndarray, target: np.ndarray, position: np.ndarray,
                      velocity: np.ndarray | None, stiffness: float | np.ndarray,
                      damping: float | np.ndarray, target_velocity: np.ndarray | None = None
                      ) -> tuple[np.ndarray, str]:
    """Return the effort in N·m, shape (N,), and a note on how it was computed.

    It is k_p (target - position) - k_d velocity, or with the velocity of the target subtracted from
    the joint's where that was recorded. Some controllers do the latter without recording it: it is
    assumed only if friction would otherwise have to push, and then does not.
    """
    usable = np.isfinite(time) & np.isfinite(target) & np.isfinite(position)
    if velocity is None:
        velocity = _rate(time, position, usable)
    spring = stiffness * (target - position)
    plain = spring - damping * velocity
    if target_velocity is not None:
        return plain + damping * target_velocity, (
            'effort is k_p (target - position) + k_d (target velocity - velocity)')
    follows = plain + damping * _rate(time, target, usable)
    acceleration = _rate(time, velocity, usable)
    (first, error), (second, _) = (_viscous_friction(effort, position, velocity, acceleration)
                                   for effort in (plain, follows))
    if first < -2.0 * error and second > 0.0:
        return follows, (
            'effort is k_p (target - position) + k_d (rate of target - velocity): without the rate '
            'of the target, friction would have to push')
    return plain, 'effort is k_p (target - position) - k_d velocity'


def without_link_torque(effort: np.ndarray, link_torque: np.ndarray | None, is_torque: bool,
                        notes: list[str]) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the effort that is left for the gear, and the load in N·m or None, both (N,).

    The torque of the link, measured behind the gear in N·m, is nearly all of the effort; in some
    robots it has the opposite sign. It is subtracted from an effort that is a torque. Another
    effort stays, with this load, whose factor can then be fitted. A text is added to `notes`.
    """
    if link_torque is None:
        return effort, None
    both = np.isfinite(effort) & np.isfinite(link_torque)
    words = ''
    if float(effort[both] @ link_torque[both]) < 0.0:
        link_torque = -link_torque
        words = ', whose sign is reversed: it is opposite to that of effort'
    if is_torque:
        notes.append(f'friction is effort minus link_torque{words}')
        return effort - link_torque, None
    notes.append('the effort is no torque, from which link_torque could be subtracted: '
                 f'link_torque is the load, whose share is fitted{words}')
    return effort, -link_torque


def _rate(time: np.ndarray, values: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """Return the derivative of the cubic spline through the usable values, shape (N,)."""
    from scipy.interpolate import make_interp_spline

    usable = usable & np.isfinite(values)
    knots, first = np.unique(time[usable], return_index=True)
    if len(knots) < 4:
        return np.zeros(len(time))
    spline = make_interp_spline(knots, values[usable][first], 3)
    return spline(np.where(np.isfinite(time), time, knots[0]), 1)


def _viscous_friction(effort: np.ndarray, position: np.ndarray, velocity: np.ndarray,
                      acceleration: np.ndarray) -> tuple[float, float]:
    """Return viscous friction of a plain drive, and its standard error."""
    width = max(_TRANSITION * float(np.nanmax(np.abs(velocity))), 1e-9)
    columns = np.column_stack([velocity, np.tanh(velocity / width), np.ones_like(velocity),
                               acceleration, np.sin(position), np.cos(position)])
    rows = np.flatnonzero(np.isfinite(columns).all(axis=1) & np.isfinite(effort))
    if len(rows) < _PARTS * 2 * columns.shape[1]:
        return 0.0, 0.0
    found = [np.linalg.lstsq(columns[part], effort[part], rcond=None)[0][0]
             for part in np.array_split(rows, _PARTS)]
    return float(np.mean(found)), float(np.std(found, ddof=1)) / _PARTS ** 0.5
