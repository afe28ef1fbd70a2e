# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Joint torques of a tree of rigid bodies by the recursive Newton-Euler algorithm, compiled.

Featherstone, Rigid Body Dynamics Algorithms (2008), Table 5.1, in the frames of the joints.
"""

from __future__ import annotations

import numpy as np

from friction_comp.compiling import njit

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
def out_of(r: np.ndarray, a: Vector) -> Vector:
    """Return a vector of a joint's frame in that of its parent, by the rotation r."""
    return (r[0, 0] * a[0] + r[0, 1] * a[1] + r[0, 2] * a[2],
            r[1, 0] * a[0] + r[1, 1] * a[1] + r[1, 2] * a[2],
            r[2, 0] * a[0] + r[2, 1] * a[1] + r[2, 2] * a[2])


@njit(cache=True)
def into(r: np.ndarray, a: Vector) -> Vector:
    """Return a vector of the parent's frame in that of the joint, by the rotation r."""
    return (r[0, 0] * a[0] + r[1, 0] * a[1] + r[2, 0] * a[2],
            r[0, 1] * a[0] + r[1, 1] * a[1] + r[2, 1] * a[2],
            r[0, 2] * a[0] + r[1, 2] * a[1] + r[2, 2] * a[2])


@njit(cache=True)
def turned(axis: Vector, c: float, s: float, a: Vector) -> Vector:
    """Return a vector turned about a unit axis by an angle of cosine c and sine s (Rodrigues)."""
    side = cross(axis, a)
    share = dot(axis, a) * (1.0 - c)
    return (c * a[0] + s * side[0] + share * axis[0], c * a[1] + s * side[1] + share * axis[1],
            c * a[2] + s * side[2] + share * axis[2])


@njit(cache=True)
def inertia_times(p: np.ndarray, a: Vector) -> Vector:
    """Return the product of a link's inertia about its joint's origin with a vector."""
    return (p[4] * a[0] + p[5] * a[1] + p[7] * a[2], p[5] * a[0] + p[6] * a[1] + p[8] * a[2],
            p[7] * a[0] + p[8] * a[1] + p[9] * a[2])


@njit(cache=True)
def gather(parents: np.ndarray, prismatic: np.ndarray, rotations: np.ndarray, places: np.ndarray,
           axes: np.ndarray, q: np.ndarray, force: np.ndarray, moment: np.ndarray,
           torques: np.ndarray) -> None:
    """Hand each link's force and moment down to its parent, and read off the joints' torques."""
    for k in range(len(parents) - 1, -1, -1):
        axis, r, parent = row(axes, k), rotations[k], parents[k]
        f, t = row(force, k), row(moment, k)
        if prismatic[k]:
            torques[k] = dot(axis, f)
            t = plus(t, cross(times(q[k], axis), f))
        else:
            torques[k] = dot(axis, t)
            c, s = np.cos(q[k]), np.sin(q[k])
            f, t = turned(axis, c, s, f), turned(axis, c, s, t)
        if parent >= 0:
            f = out_of(r, f)
            t = plus(out_of(r, t), cross(row(places, k), f))
            set_row(force, parent, plus(row(force, parent), f))
            set_row(moment, parent, plus(row(moment, parent), t))


@njit(cache=True)
def joint_torques(parents: np.ndarray, prismatic: np.ndarray, rotations: np.ndarray,
                  places: np.ndarray, axes: np.ndarray, parameters: np.ndarray,
                  gravity: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray,
                  torques: np.ndarray) -> None:
    """Compute the torque that every joint has to supply in every sample.

    Parameters
    ----------
    parents : ndarray of int, shape (L,)
        Number of the joint each is carried by, smaller than its own; -1 for the base.
    prismatic : ndarray of bool, shape (L,)
    rotations, places : ndarray, shape (L, 3, 3) and (L, 3)
        Frame of each joint in that of its parent, m.
    axes : ndarray, shape (L, 3)
        Unit vector of each joint in its own frame.
    parameters : ndarray, shape (L, 10)
        As in `Tree`.
    gravity : ndarray, shape (3,)
        Acceleration of free fall in the frame of the base, m/s².
    q, v, a : ndarray, shape (N, L)
        Position, velocity and acceleration: rad or m, s.
    torques : ndarray, shape (N, L)
        N·m or N; written.
    """
    size = len(parents)
    spin, turn = np.zeros((size, 3)), np.zeros((size, 3))
    rate, lift = np.zeros((size, 3)), np.zeros((size, 3))
    force, moment = np.zeros((size, 3)), np.zeros((size, 3))
    for n in range(len(q)):
        for k in range(size):
            axis, r, origin, parent = row(axes, k), rotations[k], row(places, k), parents[k]
            if parent < 0:
                w, dw, u = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
                du = (-gravity[0], -gravity[1], -gravity[2])
            else:
                w, dw = row(spin, parent), row(turn, parent)
                u, du = row(rate, parent), row(lift, parent)
            # The parent's motion at this joint's origin; u and du are spatial, not of a point.
            u, du = into(r, plus(u, cross(w, origin))), into(r, plus(du, cross(dw, origin)))
            w, dw = into(r, w), into(r, dw)
            own = times(v[n, k], axis)
            if prismatic[k]:
                shift = times(q[n, k], axis)
                u, du = plus(u, cross(w, shift)), plus(du, cross(dw, shift))
                du = plus(plus(du, times(a[n, k], axis)), cross(w, own))
                u = plus(u, own)
            else:
                c, s = np.cos(q[n, k]), -np.sin(q[n, k])
                u, du = turned(axis, c, s, u), turned(axis, c, s, du)
                w, dw = turned(axis, c, s, w), turned(axis, c, s, dw)
                du = plus(du, cross(u, own))
                dw = plus(plus(dw, times(a[n, k], axis)), cross(w, own))
                w = plus(w, own)
            set_row(spin, k, w)
            set_row(turn, k, dw)
            set_row(rate, k, u)
            set_row(lift, k, du)
            link = parameters[k]
            m, h = link[0], (link[1], link[2], link[3])
            p = plus(times(m, u), cross(w, h))
            angular = plus(inertia_times(link, w), cross(h, u))
            set_row(force, k, plus(plus(times(m, du), cross(dw, h)), cross(w, p)))
            set_row(moment, k, plus(plus(inertia_times(link, dw), cross(h, du)),
                                plus(cross(w, angular), cross(u, p))))
        gather(parents, prismatic, rotations, places, axes, q[n], force, moment, torques[n])
