# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Candidate terms for the torques of other joints, where no URDF is given.

The potential energy of a serial arm is a sum of harmonics of sums and differences of joint angles,
its kinetic energy of such harmonics times two velocities; the torque of a joint follows from both
by Lagrange's equations. Each harmonic is a group of columns. Two laws leave out what would only
stand in for something else: weight depends on the joint's own angle, and a joint's own angle
changes nothing of the inertia of the links behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
import functools
from itertools import combinations

from friction_comp.model.arm.coupling import Group


@functools.lru_cache(maxsize=8)
def groups_for(names: Sequence[str], own: str) -> list[Group]:
    """Return the groups of terms that other joints may add to the current of one.

    Parameters
    ----------
    names : tuple of str
        In the order of the recording, which mostly is that along the arm.
    own : str
        The joint; what depends on it alone is left to its own effects.
    """
    sums: list[tuple[tuple[str, int], ...]] = [
        ((one, 1), (two, side)) for one, two in combinations(names, 2) for side in (1, -1)]
    sums += [tuple((name, 1) for name in names[start:stop])
             for start in range(len(names)) for stop in range(start + 3, len(names) + 1)]
    groups = [Group('weight', angles) for angles in sums if own in (name for name, _ in angles)]
    singles: list[tuple[tuple[str, int], ...]] = [()] + [((name, 1),) for name in names]
    neighbours = list(zip(names, names[1:]))
    sums = singles + [((one, 1), (two, 1)) for one, two in neighbours]
    pairs = [(own, name) for name in names] + [
        pair for pair in [(name, name) for name in names] + neighbours if own not in pair]
    for one, two in pairs:
        for angles in sums:
            turning = {name for name, _ in angles}
            # Of two joints' common inertia the angle of the first one makes no difference, and
            # without accelerating itself a joint feels an energy by its own angle alone.
            if not {one, two} <= turning and (own in (one, two) or own in turning) and (
                    one != two or turning):
                groups.append(Group('kinetic', angles, (own, one, two)))
    return groups


def plain_name(group: Group) -> str:
    """Return the effect by which a joint alone has what a group says of several."""
    return 'gravity' if group.kind == 'weight' else 'inertia'


def neighbourhood(names: Sequence[str], own: str) -> list[Group]:
    """Return the groups of a joint and its neighbours, and the weight of the links behind it.

    Where an arm swings freely, weight and inertia cancel, and none of these helps alone: they are
    tried together.
    """
    index = list(names).index(own)
    near = set(names[max(0, index - 1):index + 2])
    return [group for group in groups_for(tuple(names), own)
            if group.everyone <= near or follows(group, names)]


def follows(group: Group, names: Sequence[str]) -> bool:
    """Return whether a group is the weight of a link whose angle neighbouring joints add up to."""
    places = sorted(list(names).index(name) for name, _ in group.angles)
    return (group.kind == 'weight' and all(side > 0 for _, side in group.angles)
            and places[-1] - places[0] == len(places) - 1)
