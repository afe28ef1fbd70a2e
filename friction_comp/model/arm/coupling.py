# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What other joints ask of a joint's motor, as a sum of terms found without a URDF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from friction_comp.errors import InputError


@dataclass(frozen=True)
class Group:
    """Terms that belong together.

    Parameters
    ----------
    kind : {'weight', 'inertia', 'velocities'}
        Cosine and sine of a sum of angles; an acceleration, or the product of two velocities,
        alone or times these.
    angles : tuple of (str, int)
        Joint and sign of each angle in the sum.
    joints : tuple of str
        Whose acceleration, or whose velocities.
    """

    kind: str
    angles: tuple[tuple[str, int], ...] = ()
    joints: tuple[str, ...] = ()

    def columns(self, names: Sequence[str], q: np.ndarray, v: np.ndarray,
                a: np.ndarray) -> np.ndarray:
        """Return the terms.

        Parameters
        ----------
        names : sequence of str, length J
        q, v, a : ndarray, shape (N, J)

        Returns
        -------
        ndarray, shape (N, 1) or (N, 2)
        """
        place = {name: k for k, name in enumerate(names)}
        factor = np.ones(len(q))
        if self.kind == 'inertia':
            factor = a[:, place[self.joints[0]]]
        elif self.kind == 'velocities':
            factor = v[:, place[self.joints[0]]] * v[:, place[self.joints[1]]]
        if not self.angles:
            return factor[:, None]
        total = sum(side * q[:, place[name]] for name, side in self.angles)
        return factor[:, None] * np.column_stack((np.cos(total), np.sin(total)))

    @property
    def everyone(self) -> set[str]:
        """Names of all joints in it."""
        return {name for name, _ in self.angles} | set(self.joints)

    def describe(self) -> str:
        """Return the group in words."""
        total = ' '.join(('+' if side > 0 else '-') + name for name, side in self.angles)
        total = total.removeprefix('+')
        if self.kind == 'weight':
            return f'weight over the angle {total}'
        if self.kind == 'inertia':
            return f'acceleration of {self.joints[0]}' + (f' over the angle {total}' * bool(total))
        return (f'velocities of {self.joints[0]} and {self.joints[1]}'
                + f' over the angle {total}' * bool(total))


@dataclass(frozen=True)
class Coupling:
    """A joint's current due to other joints, found without a URDF.

    Parameters
    ----------
    groups : tuple of Group
    coefficients : tuple of tuple of float
        A per unit of each term.
    """

    groups: tuple[Group, ...]
    coefficients: tuple[tuple[float, ...], ...]
    errors: tuple[Any, ...] = field(default=(), compare=False)

    def current(self, names: Sequence[str], q: np.ndarray, v: np.ndarray,
                a: np.ndarray) -> np.ndarray:
        """Return the current in A, shape (N,), for the motion of all joints."""
        lacking = {name for group in self.groups for name in group.everyone} - set(names)
        if lacking:
            raise InputError(f'the model needs joint {sorted(lacking)[0]!r}, which is not recorded')
        total = np.zeros(len(q))
        for group, coefficients in zip(self.groups, self.coefficients):
            total += group.columns(names, q, v, a) @ np.asarray(coefficients)
        return total

    @property
    def joints(self) -> list[str]:
        """Names of the joints that matter, in order of appearance."""
        return list(dict.fromkeys(
            name for group in self.groups for name in sorted(group.everyone)))

    def to_dict(self) -> dict[str, Any]:
        """Return the coupling as the plain values of a model file."""
        return {'groups': [
            {'kind': group.kind, 'angles': [[name, side] for name, side in group.angles],
             'joints': list(group.joints), 'coefficients': list(coefficients)}
            for group, coefficients in zip(self.groups, self.coefficients)]}

    @classmethod
    def from_dict(cls, document: Any) -> Coupling:
        """Make a coupling of the plain values of a model file.

        Raises
        ------
        InputError
            If something is missing or makes no sense.
        """
        groups, coefficients = [], []
        try:
            for entry in document['groups']:
                group = Group(
                    str(entry['kind']),
                    tuple((str(name), int(side)) for name, side in entry['angles']),
                    tuple(str(name) for name in entry['joints']))
                numbers = tuple(float(value) for value in entry['coefficients'])
                joints = {'weight': 0, 'inertia': 1, 'velocities': 2}.get(group.kind)
                if joints != len(group.joints) or len(numbers) != (2 if group.angles else 1):
                    raise InputError(f'coupling: a group of kind {group.kind!r} is not complete')
                if not np.isfinite(numbers).all():
                    raise InputError('coupling: coefficients must be finite')
                groups.append(group)
                coefficients.append(numbers)
        except (KeyError, TypeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f'coupling: {error}') from None
        return cls(tuple(groups), tuple(coefficients))
