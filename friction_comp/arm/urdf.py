# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads arms from URDF files, with Pinocchio."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import re
import sys
from typing import Any

import numpy as np

from friction_comp.errors import InputError
from friction_comp.files import read_xml
from friction_comp.model.arm import FREE_FALL, Tree

# Words that drivers and robot descriptions add to joint names.
_GENERIC_WORDS = ('joint', 'axis')
# kg, kg·m and kg·m² beyond any link of an arm; and the share of an inertia that is rounding.
_MOST, _ROUNDING = 1e6, 1e-6


class Chain:
    """An arm described by a URDF file, with its joints named as in recordings.

    `tree` has the file's parameters; `locked` joints of the file were not recorded and are assumed
    to stay at position zero, `unknown` recorded ones are not in the file, such as a gripper's.
    Raises InputError if Pinocchio is missing, or the file cannot be used or is another robot's.
    """

    def __init__(self, path: str | Path, joints: Sequence[str]) -> None:
        self._library = pinocchio()
        whole = _read(self._library, path)
        described = list(whole.names)[1:]
        names, self.unknown = match_names(joints, described, path)
        recorded_name = {in_urdf: recorded for recorded, in_urdf in names.items()}
        self.locked = [name for name in described if name not in recorded_name]
        self._model = whole
        if self.locked:
            self._model = self._library.buildReducedModel(
                whole, list(map(whole.getJointId, self.locked)), self._library.neutral(whole))
        self._data = self._model.createData()
        self.tree = self._to_tree([recorded_name[name] for name in list(self._model.names)[1:]])

    def _to_tree(self, joints: Sequence[str]) -> Tree:
        kinds, axes, placements, parameters, parents = [], [], [], [], []
        for index in range(1, self._model.njoints):
            joint = self._model.joints[index]
            if joint.nv != 1:
                raise InputError(f'joint {joints[index - 1]!r} of the URDF is neither revolute '
                                 'nor prismatic')
            # In the joint's own frame, its column of its Jacobian is how it moves.
            subspace = self._library.computeJointJacobian(
                self._model, self._data, self._library.neutral(self._model), index
            ).reshape(6, -1)[:, joint.idx_v]
            prismatic = not subspace[3:].any()
            kinds.append('prismatic' if prismatic else 'revolute')
            axes.append(subspace[:3] if prismatic else subspace[3:])
            placements.append(self._model.jointPlacements[index])
            parameters.append(self._model.inertias[index].toDynamicParameters())
            parents.append(self._model.parents[index] - 1)
        return Tree(
            tuple(joints), tuple(kinds), np.array(parents),
            np.array([placement.rotation for placement in placements]),
            np.array([placement.translation for placement in placements]),
            np.array(axes), np.array(parameters), np.array(FREE_FALL))

    def regressor(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the matrix, shape (N, L, 10·L), of joint torques per inertial parameter.

        Position, velocity and acceleration, shape (N, L), are in the order of `tree.joints`.
        """
        size = q.shape[1]
        result = np.empty((len(q), size, 10 * size))
        library, neutral = self._library, self._library.neutral(self._model)
        for n in range(len(q)):
            # Pinocchio represents joints without limits by cosine and sine.
            full = library.integrate(self._model, neutral, q[n])
            result[n] = library.computeJointTorqueRegressor(
                self._model, self._data, full, v[n], a[n])
        return result


def pinocchio() -> Any:
    """Return the library; raise InputError with a remedy if it is missing."""
    try:
        import pinocchio as library
    except ImportError as error:
        raise InputError(
            'a URDF needs Pinocchio, which cannot be imported '
            f"({error}): pip install 'friction_comp[arm]', or rosdep's pinocchio") from None
    if not hasattr(library, 'computeJointTorqueRegressor'):
        # Another package on PyPI has the same name.
        raise InputError("a URDF needs Pinocchio, but the module 'pinocchio' is something else: "
                         "pip uninstall pinocchio, then pip install pin")
    return library


def _read(library: Any, path: str | Path) -> Any:
    text, root = read_xml(path)
    if root.tag != 'robot':
        raise InputError(f'{path}: not a URDF file: it has no <robot>')
    if re.search(r'<xacro:(?!property\b)', text):
        raise InputError(f'{path}: a xacro file: convert it to URDF first (ros2 run xacro xacro)')
    # Pinocchio takes what is no number for nothing.
    for element in (*root.iter('mass'), *root.iter('inertia')):
        for name, value in element.attrib.items():
            if not _is_possible(value):
                raise InputError(f'{path}: {element.tag} {name} of {value}')
    try:
        with _silent():
            model = library.buildModelFromXML(text)
    except (ValueError, RuntimeError, IndexError) as error:
        reason = str(error).strip().splitlines()
        raise InputError(f'{path}: not a usable URDF file: '
                         f'{reason[0] if reason else "it cannot be parsed"}') from None
    model.gravity.linear = np.array(FREE_FALL)
    if model.njoints < 2:
        raise InputError(f'{path}: the URDF has no joint that moves')
    for name, inertia in zip(model.names, model.inertias):
        moments = np.linalg.eigvalsh(inertia.inertia)
        if inertia.mass < 0.0 or moments[0] < -_ROUNDING * np.abs(moments).max():
            raise InputError(f'{path}: what joint {name!r} carries has a negative mass, '
                             f'{inertia.mass:.3g} kg, or an inertia that is negative about an axis')
    return model


def _is_possible(text: str) -> bool:
    try:
        return abs(float(text)) <= _MOST
    except ValueError:
        return False


@contextmanager
def _silent() -> Iterator[None]:
    """Suppress what the XML parser writes to standard error."""
    sys.stderr.flush()
    original = os.dup(2)
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(original, 2)
        os.close(original)
        os.close(null)


def match_names(recorded: Sequence[str], described: Sequence[str],
                path: str | Path) -> tuple[dict[str, str], list[str]]:
    """Return each recorded joint's name in a URDF file, and the recorded joints that it lacks.

    Consecutive numbers, one for each joint, are the joints in order. Other names may differ in
    case, underscores, the words joint and axis, and a prefix. Raises InputError if a joint matches
    several, two match one, or most are not in the file.
    """
    if len(recorded) == len(described) and all(name.isdigit() for name in recorded):
        numbers = sorted(map(int, recorded))
        if numbers == list(range(numbers[0], numbers[0] + len(numbers))):
            return {name: described[int(name) - numbers[0]] for name in recorded}, []
    pairs: dict[str, str] = {}
    listed = ', '.join(map(repr, described))
    # Equal names of all joints come first: a gripper's finger_joint1 must not take joint1.
    for alike in (str.__eq__, _ends_alike):
        free = [other for other in described if other not in pairs.values()]
        found = {name: [other for other in free if alike(name, other)]
                 for name in recorded if name not in pairs}
        claims = Counter(other for matches in found.values() for other in matches)
        for name, matches in found.items():
            if len(matches) > 1 or any(claims[other] > 1 for other in matches):
                raise InputError(f'{path}: joint {name!r} of the recording matches several of the '
                                 f'URDF, or one that another matches: {listed}')
            if matches:
                pairs[name] = matches[0]
    unknown = [name for name in recorded if name not in pairs]
    if len(unknown) >= max(1, len(pairs)):
        raise InputError(f'{path}: joint {unknown[0]!r} of the recording is not in the URDF, whose '
                         f'joints are {listed}')
    return pairs, unknown


def _ends_alike(one: str, other: str) -> bool:
    """Return whether one of two names is the other after a prefix."""
    end, whole = sorted((_words(one), _words(other)), key=lambda words: len(''.join(words)))
    if end and end[0].isdigit():
        # No number is the end of another: joint 11 is not joint 1.
        return whole[-len(end):] == end
    return bool(end) and ''.join(whole).endswith(''.join(end))


def _words(name: str) -> list[str]:
    """Return a joint's words and numbers in lower case, without the words joint and axis."""
    words = re.findall(r'[^\W\d_]+|\d+', name.lower())
    return [word for word in words if word not in _GENERIC_WORDS] or words
