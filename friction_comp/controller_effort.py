# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Efforts that follow from other signals: of a position controller, and of a gear alone."""

from __future__ import annotations

import numpy as np

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


def load_behind_gear(effort: np.ndarray, link_torque: np.ndarray | None, is_torque: bool,
                     notes: list[str]) -> np.ndarray | None:
    """Return the load on a gear in N·m by the torque of the link behind it, (N,), None without one.

    The load moves the joint, and the gear moves the link: one is minus the other. In some robots
    the sensor has the opposite sign, which is reversed. Texts are added to `notes`; beside an
    effort that `is_torque`, one says that its gear ratio is missing where the link's torque is
    many times as large.
    """
    if link_torque is None:
        return None
    both = np.isfinite(effort) & np.isfinite(link_torque)
    product, power = float(effort[both] @ link_torque[both]), float(effort[both] @ effort[both])
    if product < 0.0:
        link_torque = -link_torque
        notes.append('the sign of link_torque is reversed: it is opposite to that of effort')
    ratio = abs(product) / max(power, 1e-300)
    # More than any friction makes of it.
    if is_torque and ratio > 3.0:
        notes.append(f'link_torque is about {ratio:.2g} times the effort, as if that were before a '
                     'gear: give its ratio, --unit effort=100Nm if it is 100')
    return -link_torque


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
    # Friction changes its sign over 3 % of the top speed.
    width = max(0.03 * float(np.nanmax(np.abs(velocity))), 1e-9)
    columns = np.column_stack([velocity, np.tanh(velocity / width), np.ones_like(velocity),
                               acceleration, np.sin(position), np.cos(position)])
    rows = np.flatnonzero(np.isfinite(columns).all(axis=1) & np.isfinite(effort))
    if len(rows) < _PARTS * 2 * columns.shape[1]:
        return 0.0, 0.0
    found = [np.linalg.lstsq(columns[part], effort[part], rcond=None)[0][0]
             for part in np.array_split(rows, _PARTS)]
    return float(np.mean(found)), float(np.std(found, ddof=1)) / _PARTS ** 0.5
