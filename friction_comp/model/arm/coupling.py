# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Torques of other joints on a joint, as a sum of terms found without a URDF.

Each group of terms is the torque of one energy on the joint, by Lagrange's equations. A potential
energy is a harmonic of a sum of angles, a kinetic energy such a harmonic times two velocities.
Friction acts where a motor turns with the sum or the difference of two joints, as in a wrist.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import functools
from itertools import combinations
import math
from typing import Any

import numpy as np

from friction_comp.errors import InputError

# Number of joints that each kind of group names besides those of its angles.
_JOINTS = {'weight': 0, 'kinetic': 3, 'friction': 0}


@dataclass(frozen=True)
class Group:
    """Terms that belong together.

    Of kind 'weight': cosine and sine of a sum of angles; 'kinetic': the torque of a kinetic energy
    of two velocities, alone or times cosine and sine; 'friction': Coulomb and viscous friction of
    the rate of the sum of two angles.
    """

    kind: str
    angles: tuple[tuple[str, int], ...] = ()    # joint and sign of each angle in the sum
    # Of kind 'kinetic': the joint on which the torque acts, and the two joints of the velocities.
    joints: tuple[str, ...] = ()
    # Of kind 'friction': the velocity over which it changes sign, rad/s.
    width: float = 0.0

    def columns(self, names: Sequence[str], q: np.ndarray, v: np.ndarray,
                a: np.ndarray) -> np.ndarray:
        """Return the terms, shape (N, 1) or (N, 2), for motion of J named joints, (N, J)."""
        column = {name: k for k, name in enumerate(names)}
        factor, slope = np.ones(len(q)), np.zeros(len(q))
        if self.kind == 'friction':
            rate = sum((side * v[:, column[name]] for name, side in self.angles), np.zeros(len(v)))
            return np.column_stack((np.tanh(rate / self.width), rate))
        if self.kind == 'kinetic':
            factor, slope = self._kinetic_factors(column, v, a)
        if not self.angles:
            return factor[:, None]
        total = sum(side * q[:, column[name]] for name, side in self.angles)
        cosine, sine = np.cos(total), np.sin(total)
        return np.column_stack((factor * cosine - slope * sine, factor * sine + slope * cosine))

    def _kinetic_factors(self, column: dict[str, int], v: np.ndarray, a: np.ndarray
                         ) -> tuple[np.ndarray, np.ndarray]:
        """Return the factors of f and f' in the torque of the energy f(angles)·v_one·v_two."""
        own, one, two = (column[name] for name in self.joints)
        turning = sum((side * v[:, column[name]] for name, side in self.angles), np.zeros(len(v)))
        momentum = (own == one) * v[:, two] + (own == two) * v[:, one]
        of_own = dict(self.angles).get(self.joints[0], 0)
        return ((own == one) * a[:, two] + (own == two) * a[:, one],
                turning * momentum - of_own * v[:, one] * v[:, two])

    @property
    def all_joints(self) -> set[str]:
        """Names of all joints in the group, of angles and of velocities."""
        return {name for name, _ in self.angles} | set(self.joints)

    def describe(self) -> str:
        """Return a description of the group."""
        total = ' '.join(('+' if side > 0 else '-') + name for name, side in self.angles)
        over = f' over the angle {total.removeprefix("+")}' if total else ''
        if self.kind == 'weight':
            return f'weight{over}'
        if self.kind == 'friction':
            (own, _), (other, side) = self.angles
            return (f'friction between {own} and {other}, which turns with the '
                    f'{"sum" if side > 0 else "difference"} of their velocities')
        if self.joints[0] in self.joints[1:]:
            return f'inertia of {" with ".join(dict.fromkeys(self.joints[1:]))}{over}'
        return f'velocities of {" and ".join(dict.fromkeys(self.joints[-2:]))}{over}'


@dataclass(frozen=True)
class Coupling:
    """A joint's current due to other joints, found without a URDF; coefficients in A per term."""

    groups: tuple[Group, ...]
    coefficients: tuple[tuple[float, ...], ...]

    def current(self, names: Sequence[str], q: np.ndarray, v: np.ndarray,
                a: np.ndarray) -> np.ndarray:
        """Return the current in A, shape (N,), for the motion of all joints."""
        total = np.zeros(len(q))
        for group, coefficients in zip(self.groups, self.coefficients):
            total += group.columns(names, q, v, a) @ np.asarray(coefficients)
        return total

    def weight(self, names: Sequence[str], q: np.ndarray) -> float:
        """Return the current in A with all joints at rest at positions q, shape (J,), rad."""
        states = q[None]
        still = np.zeros_like(states)
        return float(sum(
            (group.columns(names, states, still, still) @ np.asarray(coefficients))[0]
            for group, coefficients in zip(self.groups, self.coefficients)
            if group.kind == 'weight'))

    def largest_weight(self) -> float:
        """Return a bound of `weight` over all postures, A: the amplitudes of its terms."""
        return float(sum(math.hypot(*coefficients)
                         for group, coefficients in zip(self.groups, self.coefficients)
                         if group.kind == 'weight'))

    @property
    def joints(self) -> list[str]:
        """Names of the joints that matter, in order of appearance."""
        return list(dict.fromkeys(
            name for group in self.groups for name in sorted(group.all_joints)))

    def to_dict(self) -> dict[str, Any]:
        """Return the coupling as the plain values of a model file."""
        return {'groups': [
            {'kind': group.kind, 'angles': [[name, side] for name, side in group.angles],
             'joints': list(group.joints), 'coefficients': list(coefficients),
             **({'width': group.width} if group.width else {})}
            for group, coefficients in zip(self.groups, self.coefficients)]}

    @classmethod
    def from_dict(cls, document: Any) -> Coupling:
        """Make a coupling of the plain values of a model file."""
        groups, coefficients = [], []
        try:
            for entry in document['groups']:
                angles = tuple((str(name), int(side)) for name, side in entry['angles'])
                if any(side not in (1, -1) for _, side in entry['angles']) or (
                        len(dict(angles)) < len(angles)):
                    raise ValueError('angles must be different joints, each with sign 1 or -1')
                group = Group(str(entry['kind']), angles, tuple(map(str, entry['joints'])),
                              float(entry.get('width', 0.0)))
                numbers = tuple(map(float, entry['coefficients']))
                wanted = 2 if group.angles else 1
                if _JOINTS.get(group.kind) != len(group.joints) or len(numbers) != wanted:
                    raise ValueError(f'a group of kind {group.kind!r} is not complete')
                if group.kind == 'friction' and not (
                        len(group.angles) == 2 and 0.0 < group.width < math.inf):
                    raise ValueError('friction needs the angles of two joints and a width above 0')
                if not np.isfinite(numbers).all():
                    raise ValueError('coefficients must be finite')
                groups.append(group)
                coefficients.append(numbers)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise InputError(f'coupling: {error}') from None
        return cls(tuple(groups), tuple(coefficients))


def friction_groups(names: Sequence[str], joint: str, widths: Sequence[float]) -> list[Group]:
    """Return friction of the sum and the difference of a joint's velocity and its neighbours'.

    `names` are in order along the arm; friction changes its sign over each of the `widths`, rad/s.
    """
    index = list(names).index(joint)
    neighbours = names[max(0, index - 1):index + 2]
    return [Group('friction', ((joint, 1), (name, side)), width=width)
            for name in neighbours if name != joint for side in (1, -1) for width in widths]


@functools.lru_cache(maxsize=8)
def groups_for(names: Sequence[str], joint: str) -> list[Group]:
    """Return the groups of terms through which other joints may affect a joint's current.

    `names` are all joints, usually in their order along the arm. The potential energy of a serial
    arm is a sum of harmonics of sums and differences of joint angles, its kinetic energy of such
    harmonics times two velocities; the torque of a joint follows from both by Lagrange's equations.
    Each harmonic is a group of columns. Two facts of mechanics rule out others: a joint's weight
    torque depends on its own angle, and its angle does not change the inertia of the links behind.
    """
    # Of each harmonic the angles that are added (1) or subtracted (-1).
    weights: list[tuple[tuple[str, int], ...]] = [
        ((first, 1), (second, side)) for first, second in combinations(names, 2)
        for side in (1, -1)]
    weights += [tuple((name, 1) for name in names[start:stop])
                for start in range(len(names)) for stop in range(start + 3, len(names) + 1)]
    groups = [Group('weight', angles) for angles in weights if joint in dict(angles)]
    neighbours = list(zip(names, names[1:]))
    inertias: list[tuple[tuple[str, int], ...]] = [
        (), *(((name, 1),) for name in names),
        *(((first, 1), (second, 1)) for first, second in neighbours)]
    moving = [(joint, name) for name in names] + [
        pair for pair in [(name, name) for name in names] + neighbours if joint not in pair]
    for first, second in moving:
        for angles in inertias:
            turning = {name for name, _ in angles}
            # The coupled inertia of two joints does not depend on the angle of the first, and a
            # term without the joint's own acceleration has to depend on its angle.
            possible = not {first, second} <= turning and (first != second or turning)
            if possible and (joint in (first, second) or joint in turning):
                groups.append(Group('kinetic', angles, (joint, first, second)))
    return groups


def neighbourhood(names: Sequence[str], joint: str) -> list[Group]:
    """Return the groups of a joint and its neighbours, and the weight of the links behind it.

    Where an arm swings freely, weight and inertia cancel, so that they are tried together.
    """
    index = list(names).index(joint)
    neighbours = set(names[max(0, index - 1):index + 2])

    def is_weight_of_link(group: Group) -> bool:
        """Return whether a group is the weight of a link at the summed angle of adjacent joints."""
        indices = sorted(list(names).index(name) for name, _ in group.angles)
        return (group.kind == 'weight' and all(side > 0 for _, side in group.angles)
                and indices[-1] - indices[0] == len(indices) - 1)
    return [group for group in groups_for(tuple(names), joint)
            if group.all_joints <= neighbours or is_weight_of_link(group)]
