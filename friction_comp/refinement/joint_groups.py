# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Candidate terms for the torques of other joints, where no URDF is given.

The potential energy of a serial arm is a sum of harmonics of sums and differences of joint angles,
its kinetic energy of such harmonics times two velocities; the torque of a joint follows from both
by Lagrange's equations. Each harmonic is a group of columns. Two facts of mechanics rule out groups
that could only stand in for something else: a joint's weight torque depends on its own angle, and
its angle does not change the inertia of the links behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
import functools
from itertools import combinations

from friction_comp.model.arm.coupling import Group


@functools.lru_cache(maxsize=8)
def groups_for(names: Sequence[str], joint: str) -> list[Group]:
    """Return the groups of terms through which other joints may affect a joint's current.

    `names` are all joints in the order of the recording, usually that along the arm. Terms that
    depend on the joint alone are left to its own effects.
    """
    sums: list[tuple[tuple[str, int], ...]] = [
        ((first, 1), (second, side)) for first, second in combinations(names, 2)
        for side in (1, -1)]
    sums += [tuple((name, 1) for name in names[start:stop])
             for start in range(len(names)) for stop in range(start + 3, len(names) + 1)]
    groups = [Group('weight', angles) for angles in sums if joint in (name for name, _ in angles)]
    singles: list[tuple[tuple[str, int], ...]] = [()] + [((name, 1),) for name in names]
    neighbours = list(zip(names, names[1:]))
    sums = singles + [((first, 1), (second, 1)) for first, second in neighbours]
    pairs = [(joint, name) for name in names] + [
        pair for pair in [(name, name) for name in names] + neighbours if joint not in pair]
    for first, second in pairs:
        for angles in sums:
            turning = {name for name, _ in angles}
            # The coupled inertia of two joints does not depend on the angle of the first, and a
            # term without the joint's own acceleration has to depend on its angle.
            possible = not {first, second} <= turning and (first != second or turning)
            if possible and (joint in (first, second) or joint in turning):
                groups.append(Group('kinetic', angles, (joint, first, second)))
    return groups


def neighbourhood(names: Sequence[str], joint: str) -> list[Group]:
    """Return the groups of a joint and its neighbours, and the weight of the links behind it.

    Where an arm swings freely, weight and inertia cancel, and none of these groups helps alone, so
    they are tried together.
    """
    index = list(names).index(joint)
    neighbours = set(names[max(0, index - 1):index + 2])
    return [group for group in groups_for(tuple(names), joint)
            if group.everyone <= neighbours or is_weight_of_link(group, names)]


def is_weight_of_link(group: Group, names: Sequence[str]) -> bool:
    """Return whether a group is the weight of a link at the summed angle of adjacent joints."""
    indices = sorted(list(names).index(name) for name, _ in group.angles)
    return (group.kind == 'weight' and all(side > 0 for _, side in group.angles)
            and indices[-1] - indices[0] == len(indices) - 1)
