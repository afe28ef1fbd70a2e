# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What is compiled of a model: memory of effects over long recordings, and torques of rigid bodies.

Imported where it is needed: importing the compiler takes as long as stepping through a million
samples without it. The torques are those of the recursive Newton-Euler algorithm (Luh, Walker and
Paul, J. Dyn. Sys., Meas., Control 102(2), 1980), with all vectors in the frame of the base.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import njit
import numpy as np

from friction_comp.model.steps import backlash_step, dahl_step, rest_step

# One function for all kinds: compiled code is kept for functions that it names, not for arguments.
KINDS = ('hysteresis', 'backlash', 'rest_time')
_dahl, _backlash, _rest = (njit(cache=True)(step) for step in (dahl_step, backlash_step, rest_step))


class Memory(NamedTuple):
    """The constants of all steps, of which each reads its own."""

    distance: float = 1.0
    exponent: float = 1.0
    gap: float = 1.0
    time_constant: float = 1.0
    velocity: float = 1.0


@njit(cache=True)
def all_states(kind: int, time: np.ndarray, position: np.ndarray, velocity: np.ndarray,
               begins: np.ndarray, start: np.ndarray, c: Any) -> np.ndarray:
    """Return the states at all samples, (N,), from those at the start of segments."""
    result = start.copy()
    for k in np.flatnonzero(~begins):
        before, dt, dq = result[k - 1], time[k] - time[k - 1], position[k] - position[k - 1]
        if kind == 0:
            result[k] = _dahl(before, dt, dq, velocity[k], c)
        elif kind == 1:
            result[k] = _backlash(before, dt, dq, velocity[k], c)
        else:
            result[k] = _rest(before, dt, dq, velocity[k], c)
    return result


# Three numbers in a tuple, which needs no heap memory.
Vector = tuple[float, float, float]


@njit(cache=True)
def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@njit(cache=True)
def plus(a: Vector, b: Vector) -> Vector:
    """Return the sum of two vectors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@njit(cache=True)
def times(factor: float, a: Vector) -> Vector:
    """Return a vector times a number."""
    return (factor * a[0], factor * a[1], factor * a[2])


@njit(cache=True)
def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def row(values: np.ndarray, k: int) -> Vector:
    """Return a row of an array, shape (L, 3), as a vector."""
    return (values[k, 0], values[k, 1], values[k, 2])


@njit(cache=True)
def set_row(values: np.ndarray, k: int, a: Vector) -> None:
    """Write a vector into a row of an array, shape (L, 3)."""
    values[k, 0], values[k, 1], values[k, 2] = a[0], a[1], a[2]


@njit(cache=True)
def in_base(frame: np.ndarray, a: Vector) -> Vector:
    """Return a vector of a frame in the base; the rows of `frame` are its unit vectors there."""
    return plus(plus(times(a[0], row(frame, 0)), times(a[1], row(frame, 1))),
                times(a[2], row(frame, 2)))


@njit(cache=True)
def turned(axis: Vector, angle: float, a: Vector) -> Vector:
    """Return a vector turned about a unit axis (Rodrigues)."""
    c, s = np.cos(angle), np.sin(angle)
    return plus(plus(times(c, a), times(s, cross(axis, a))), times(dot(axis, a) * (1.0 - c), axis))


@njit(cache=True)
def angular_momentum(frame: np.ndarray, p: np.ndarray, w: Vector) -> Vector:
    """Return the product of a link's inertia about its joint's origin with a vector."""
    a, b, c = dot(row(frame, 0), w), dot(row(frame, 1), w), dot(row(frame, 2), w)
    return in_base(frame, (p[4] * a + p[5] * b + p[7] * c, p[5] * a + p[6] * b + p[8] * c,
                           p[7] * a + p[8] * b + p[9] * c))


@njit(cache=True)
def joint_torques(parents: np.ndarray, prismatic: np.ndarray, rotations: np.ndarray,
                  places: np.ndarray, axes: np.ndarray, parameters: np.ndarray,
                  gravity: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray,
                  torques: np.ndarray) -> None:
    """Write the torque that every joint has to supply, N·m or N, (N, L); arguments as of `Tree`."""
    # A parent of -1 is the base, the last frame, which accelerates upwards instead of gravity.
    size = len(parents)
    frames = np.zeros((size + 1, 3, 3))
    frames[size] = np.eye(3)
    levers, directions = np.zeros((size, 3)), np.zeros((size, 3))
    spins, spin_rates = np.zeros((size + 1, 3)), np.zeros((size + 1, 3))
    accelerations = np.zeros((size + 1, 3))
    accelerations[size] = -gravity
    for n in range(len(q)):
        forces, moments = np.zeros((size + 1, 3)), np.zeros((size + 1, 3))
        for k in range(size):
            up, frame, parent = frames[parents[k]], frames[k], parents[k]
            w, dw = row(spins, parent), row(spin_rates, parent)
            lever = in_base(up, row(places, k))
            for i in range(3):
                r = rotations[k]
                set_row(frame, i, in_base(up, (r[0, i], r[1, i], r[2, i])))
            axis = in_base(frame, row(axes, k))
            if prismatic[k]:
                lever = plus(lever, times(q[n, k], axis))
            acceleration = plus(row(accelerations, parent),
                                plus(cross(dw, lever), cross(w, cross(w, lever))))
            if prismatic[k]:
                acceleration = plus(acceleration, plus(
                    times(a[n, k], axis), times(2.0 * v[n, k], cross(w, axis))))
            else:
                for i in range(3):
                    set_row(frame, i, turned(axis, q[n, k], row(frame, i)))
                dw = plus(dw, plus(times(a[n, k], axis), times(v[n, k], cross(w, axis))))
                w = plus(w, times(v[n, k], axis))
            set_row(levers, k, lever)
            set_row(directions, k, axis)
            set_row(spins, k, w)
            set_row(spin_rates, k, dw)
            set_row(accelerations, k, acceleration)
            link = parameters[k]
            h = in_base(frame, (link[1], link[2], link[3]))
            set_row(forces, k, plus(times(link[0], acceleration),
                                    plus(cross(dw, h), cross(w, cross(w, h)))))
            set_row(moments, k, plus(cross(h, acceleration), plus(
                angular_momentum(frame, link, dw), cross(w, angular_momentum(frame, link, w)))))
        for k in range(size - 1, -1, -1):
            force, moment, parent = row(forces, k), row(moments, k), parents[k]
            torques[n, k] = dot(row(directions, k), force if prismatic[k] else moment)
            set_row(forces, parent, plus(row(forces, parent), force))
            set_row(moments, parent, plus(row(moments, parent), plus(
                moment, cross(row(levers, k), force))))
