# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Joint torques of a tree of rigid bodies by the recursive Newton-Euler algorithm, compiled.

Featherstone, Rigid Body Dynamics Algorithms (2008), Table 5.1, in the frames of the joints.
"""

from __future__ import annotations

from numba import njit
import numpy as np


@njit(cache=True)
def turned(axis: np.ndarray, angle: float, vector: np.ndarray) -> np.ndarray:
    """Return a vector turned about a unit axis by an angle (Rodrigues)."""
    c, s = np.cos(angle), np.sin(angle)
    along = (axis[0] * vector[0] + axis[1] * vector[1] + axis[2] * vector[2]) * (1.0 - c)
    side = cross(axis, vector)
    return c * vector + s * side + along * axis


@njit(cache=True)
def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the vector product."""
    return np.array((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                     a[0] * b[1] - a[1] * b[0]))


@njit(cache=True)
def inertia_times(parameters: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return the product of a link's inertia about its joint's origin with a vector."""
    xx, xy, yy, xz, yz, zz = parameters[4:]
    x, y, z = vector
    return np.array((xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z))


@njit(cache=True)
def joint_torques(parents: np.ndarray, prismatic: np.ndarray, rotations: np.ndarray,
                  places: np.ndarray, axes: np.ndarray, parameters: np.ndarray, gravity: np.ndarray,
                  q: np.ndarray, v: np.ndarray, a: np.ndarray, torques: np.ndarray) -> None:
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
            axis, back, parent = axes[k], rotations[k].T, parents[k]
            if parent < 0:
                w, dw = np.zeros(3), np.zeros(3)
                u, du = np.zeros(3), -gravity
            else:
                w, dw, u, du = spin[parent], turn[parent], rate[parent], lift[parent]
            place = places[k]
            # The parent's motion at this joint's origin; u and du are spatial, not of a point.
            u, du = back @ (u + cross(w, place)), back @ (du + cross(dw, place))
            w, dw = back @ w, back @ dw
            if prismatic[k]:
                shift = axis * q[n, k]
                u, du = u + cross(w, shift), du + cross(dw, shift)
                du = du + axis * a[n, k] + cross(w, axis * v[n, k])
                u = u + axis * v[n, k]
            else:
                angle = -q[n, k]
                u, du = turned(axis, angle, u), turned(axis, angle, du)
                w, dw = turned(axis, angle, w), turned(axis, angle, dw)
                own = axis * v[n, k]
                du = du + cross(u, own)
                dw = dw + axis * a[n, k] + cross(w, own)
                w = w + own
            spin[k], turn[k], rate[k], lift[k] = w, dw, u, du
            m, h = parameters[k, 0], parameters[k, 1:4]
            p = m * u + cross(w, h)
            angular = inertia_times(parameters[k], w) + cross(h, u)
            force[k] = m * du + cross(dw, h) + cross(w, p)
            moment[k] = (inertia_times(parameters[k], dw) + cross(h, du) + cross(w, angular)
                         + cross(u, p))
        for k in range(size - 1, -1, -1):
            axis, parent = axes[k], parents[k]
            f, t = force[k], moment[k]
            if prismatic[k]:
                torques[n, k] = axis[0] * f[0] + axis[1] * f[1] + axis[2] * f[2]
                t = t + cross(axis * q[n, k], f)
            else:
                torques[n, k] = axis[0] * t[0] + axis[1] * t[1] + axis[2] * t[2]
                f, t = turned(axis, q[n, k], f), turned(axis, q[n, k], t)
            if parent >= 0:
                f = rotations[k] @ f
                t = rotations[k] @ t + cross(places[k], f)
                force[parent] = force[parent] + f
                moment[parent] = moment[parent] + t
