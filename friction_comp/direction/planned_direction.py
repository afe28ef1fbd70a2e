# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Directions of joints that follow a plan, as sent to a trajectory controller.

A plan is an exercise that begins when it is sent: movements from rest are announced ahead, the
direction changes at a turn, and returns to 0 at the end. A joint away from the plan has none.
"""

from __future__ import annotations

from collections.abc import Sequence
import math

import numpy as np

from friction_comp.direction.joint_motion import Announcement
from friction_comp.errors import InputError
from friction_comp.exercise.exercise_script import ExerciseScript


class PlannedDirection:
    """Announces what a plan says of the joints.

    A movement from rest is announced `announcement` seconds ahead; a joint that is farther from the
    plan than `tolerance`, rad, does not follow it.
    """

    def __init__(self, joints: Sequence[str], announcement: float, tolerance: float) -> None:
        self._joints = list(joints)
        self._announcement, self._tolerance = announcement, tolerance
        self.forget('no plan')

    def forget(self, reason: str) -> None:
        """Have no plan, for a reason."""
        self._plan: ExerciseScript | None = None
        self._reasons = dict.fromkeys(self._joints, reason)
        self._lost: set[str] = set()

    def take(self, names: Sequence[str], times: Sequence[float], positions: np.ndarray, now: float,
             begin: float, present: np.ndarray) -> None:
        """Replace the plan; raises InputError if it cannot be used, and there is none then.

        It moves the joints `names`, of which others than the node's do not matter, to `positions`
        in rad, (K, n), at `times` in s from its beginning. It was received `now`, s, begins at
        `begin`, and finds the node's joints at the positions `present`, rad, (J,).
        """
        self.forget('no plan')
        if len(times) == 0:
            return
        time, path = np.asarray(times, dtype=float), np.asarray(positions, dtype=float)
        if path.shape != (len(time), len(names)) or len(set(names)) < len(names):
            raise InputError('a plan needs distinct joints, and a position of each at every point')
        if not (np.isfinite(path).all() and np.isfinite(time).all() and time[0] >= 0.0
                and (np.diff(time) > 0.0).all()):
            raise InputError('the times of a plan must increase, and its positions be finite')
        own = [name for name in self._joints if name in names]
        path = path[:, [list(names).index(name) for name in own]]
        where = present[[self._joints.index(name) for name in own]]
        if not own or not np.isfinite(where).all():
            raise InputError('a plan needs joint_states of its joints')
        # Until the first point, the joints come from where they are, after a rest.
        wait = max(0.0, begin - now)
        if time[0] > 0.0:
            time, path = np.concatenate([[0.0], time]), np.concatenate([where[None], path])
        if wait > 0.0:
            time, path = np.concatenate([[0.0], time + wait]), np.concatenate([path[:1], path])
        late = max(0.0, now - begin)
        if len(time) < 2 or time[-1] <= late:
            self.forget('the plan is over')
            return
        self._begin = now - late
        self._plan = ExerciseScript(own, time, path, self._announcement)

    def at(self, time: float, position: np.ndarray) -> list[Announcement]:
        """Return an announcement for each joint at a time in s; `position` is in rad, (J,)."""
        if self._plan is None:
            return [Announcement(0, self._reasons[joint]) for joint in self._joints]
        since = time - self._begin
        planned, _, direction = self._plan.at(since)
        ends = self._plan.ends(since)
        said = []
        for joint, present in zip(self._joints, position.tolist()):
            if joint not in self._plan.joints:
                said.append(Announcement(0, 'not in the plan'))
                continue
            j = self._plan.joints.index(joint)
            if not abs(present - planned[j]) <= self._tolerance:
                # For good: a joint that comes across the plan does not follow it.
                self._lost.add(joint)
            if joint in self._lost:
                away = (f'{abs(present - planned[j]):.2f} rad away'
                        if math.isfinite(present) else 'position unknown')
                said.append(Announcement(0, f'the plan is not followed: {away}', fault=True))
            elif since > self._plan.duration:
                said.append(Announcement(0, 'the plan is over'))
            else:
                said.append(Announcement(
                    int(direction[j]), 'as planned' if direction[j] else 'the plan rests',
                    float(ends[j])))
        return said
