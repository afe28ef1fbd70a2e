# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A joint's limits, from options, from joint_limits.yaml, or from a URDF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from pathlib import Path

from friction_comp.checks import check_number
from friction_comp.errors import InputError
from friction_comp.files import read_xml, read_yaml


@dataclass(frozen=True)
class JointLimits:
    """Limits of one joint; `InputError` if one is no number, not positive, or leaves no range."""

    joint: str
    lowest: float  # of position, rad
    highest: float
    velocity: float  # largest magnitude, rad/s
    acceleration: float  # rad/s²
    effort: float = math.inf  # of the torque at the joint, N·m; infinite where it is not limited

    def __post_init__(self) -> None:
        what = f'joint {self.joint!r}: the limit of'
        # Beyond any joint that is planned for.
        for end in (self.lowest, self.highest):
            check_number(end, f'{what} position', least=-100.0, most=100.0)
        for name in ('velocity', 'acceleration', 'effort'):
            if name != 'effort' or self.effort != math.inf:
                check_number(getattr(self, name), f'{what} {name}', least=1e-6, most=1e6)
        if not self.lowest < self.highest:
            raise InputError(f'joint {self.joint!r}: the lowest position {self.lowest:g} is not '
                             f'below the highest {self.highest:g}')

    @property
    def centre(self) -> float:
        """The middle of the range, rad."""
        return 0.5 * (self.lowest + self.highest)


def from_yaml(path: str | Path, joints: Sequence[str] = ()) -> list[JointLimits]:
    """Return limits, of all joints by default, in a file like MoveIt's; or raise InputError."""
    document = read_yaml(path)
    entries = document.get('joint_limits') if isinstance(document, dict) else None
    if not isinstance(entries, dict) or not entries:
        raise InputError(f'{path}: has no joint_limits')
    # YAML reads a joint named 1 as a number.
    entries = {str(joint): entry for joint, entry in entries.items()}
    limits = []
    for joint in joints or entries:
        entry = entries.get(joint)
        if not isinstance(entry, dict):
            raise InputError(f'{path}: has no limits of joint {joint!r}')
        try:
            low, high, velocity, acceleration = (entry[name] for name in (
                'min_position', 'max_position', 'max_velocity', 'max_acceleration'))
        except KeyError as missing:
            raise InputError(f'{path}: joint {joint!r} has no {missing.args[0]}') from None
        # Files without a limit of effort often state it as 0.
        limited = entry.get('has_effort_limits', True)
        effort = entry.get('max_effort', math.inf) if limited else math.inf
        limits.append(JointLimits(joint, low, high, velocity, acceleration, effort))
    return limits


def from_urdf(path: str | Path, acceleration: float,
              joints: Sequence[str] = ()) -> list[JointLimits]:
    """Return the limits, of all revolute joints by default, that a URDF states in ``<limit>``.

    Not of joints that mimic another; a URDF does not state the acceleration, rad/s². Raises
    InputError if the file cannot be used, or a joint has no limits of position.
    """
    _, root = read_xml(path)
    found = {str(one.get('name')): one for one in root.findall('joint')
             if one.get('type') == 'revolute'}
    revolute = {name: one.find('limit') for name, one in found.items() if one.find('mimic') is None}
    if not revolute:
        raise InputError(f'{path}: the URDF has no revolute joint')
    limits = []
    for name in joints or revolute:
        limit = revolute.get(name)
        if name in found and name not in revolute:
            raise InputError(f'{path}: joint {name!r} mimics another, and cannot be moved itself')
        if limit is None:
            raise InputError(f'{path}: has no revolute joint {name!r} with a <limit>')
        try:
            low, high, velocity = (float(limit.get(key, ''))
                                   for key in ('lower', 'upper', 'velocity'))
            effort = float(limit.get('effort', 'inf'))
        except ValueError:
            raise InputError(f'{path}: the <limit> of joint {name!r} needs lower, upper and '
                             'velocity as numbers') from None
        limits.append(JointLimits(name, low, high, velocity, acceleration, effort))
    return limits
