# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What is announced for a joint: by a plan, or by a stream of desired positions.

A plan, as sent to a trajectory controller, is an exercise that begins when it is sent: movements
from rest are announced ahead, the direction changes at a turn, and returns to 0 at the end. A joint
away from the plan has none. Of a leader, or a reference, positions are used, since its speeds are
differences of encoder counts: it moves if it has covered more than an encoder count, and this
distance is the hysteresis at a turn, too.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np

from friction_comp.errors import InputError
from friction_comp.exercise.exercise_script import ExerciseScript

STILL = 0.02
"""rad/s. Below, a joint rests: presliding and the flex of a gear, 2 mrad at most, stay below it."""
SILENCE = 0.2
"""s without a position after which nothing is known of a joint, or of its reference."""
# Window of the speed, s, and the least time between the positions that it keeps; time over which a
# reference covers its distance, s.
_WINDOW, _STEP, _COVERED = 0.1, 0.008, 0.2


@dataclass(frozen=True)
class Announcement:
    """The direction of a joint's coming movement."""

    direction: int  # -1, 0 or +1
    reason: str  # why, in words for diagnostics
    end: float = math.nan  # position at which the announced movement ends, rad; NaN if not known
    fault: bool = False  # whether the source cannot be used; the direction is then 0
    is_pushed: bool = False  # whether a sensor feels beyond doubt that the person pushes this way


class JointMotion:
    """Rest of one joint, and its `speed`: the mean of the last 0.1 s, rad/s; NaN if not known."""

    def __init__(self) -> None:
        self._past: deque[tuple[float, float]] = deque()
        self._still_since = math.inf
        self.speed = math.nan

    def add(self, time: float, position: float) -> None:
        """Add a position in rad at a time in s."""
        past = self._past
        if not math.isfinite(position) or (past and 0.0 <= time - past[-1][0] < _STEP):
            return
        if past and not 0.0 <= time - past[-1][0] <= SILENCE:
            past.clear()
        past.append((time, position))
        while time - past[0][0] > _WINDOW + 0.5 * _STEP:
            past.popleft()
        begin, first = past[0]
        known = time - begin >= 0.5 * _WINDOW
        self.speed = (position - first) / (time - begin) if known else math.nan
        still = abs(self.speed) <= STILL
        self._still_since = min(self._still_since, time) if still else math.inf

    def known(self, time: float) -> bool:
        """Return whether the joint's motion is known at a time in s."""
        return bool(self._past) and math.isfinite(self.speed) and (
            time - self._past[-1][0] <= SILENCE)

    def rest(self, time: float) -> float:
        """Return for how long the joint has rested, s; 0 if it moves or nothing is known."""
        return max(0.0, time - self._still_since) if self.known(time) else 0.0


class DesiredMotion:
    """Announces the direction of one joint's reference, which moves from `least_speed` on, rad/s.

    Positions of the joint go to its `motion`.
    """

    def __init__(self, least_speed: float = 0.005) -> None:
        self.motion = JointMotion()
        self._least = least_speed * _COVERED
        self._past: deque[tuple[float, float]] = deque()
        self._step = math.inf
        self._direction, self._extreme = 0, math.nan

    def take(self, time: float, desired: float) -> None:
        """Take a desired position in rad at a time in s."""
        past = self._past
        if not math.isfinite(desired) or (past and time <= past[-1][0]):
            return
        if past and time - past[-1][0] > SILENCE:
            past.clear()
            self._direction = 0
        if past and desired != past[-1][1]:
            # Numerical noise is no step.
            self._step = min(self._step, max(1e-4, abs(desired - past[-1][1])))
        past.append((time, desired))
        while len(past) > 2 and time - past[1][0] >= _COVERED:
            past.popleft()
        # An encoder that flickers between two counts does not move.
        least = max(self._least, 1.5 * self._step if self._step < math.inf else 0.0)
        begin, position = past[0]
        covered = desired - position
        if self._direction == 0:
            if abs(covered) >= least:
                self._direction, self._extreme = 1 if covered > 0.0 else -1, desired
            return
        self._extreme = (max if self._direction > 0 else min)(self._extreme, desired)
        if (self._extreme - desired) * self._direction >= least:
            self._direction, self._extreme = -self._direction, desired
        # Half of what begins a movement, so that a slow one does not end and begin again.
        elif abs(covered) < 0.5 * least and time - begin >= 0.9 * _COVERED:
            self._direction = 0

    def at(self, time: float, position: float) -> Announcement:
        """Return what is announced at a time in s; `position` is the joint's, rad."""
        if not self._past or not 0.0 <= time - self._past[-1][0] <= SILENCE:
            return Announcement(0, 'no reference', fault=True)
        if not self.motion.known(time) or not math.isfinite(position):
            return Announcement(0, 'joint_states are missing', fault=True)
        if not self._direction:
            return Announcement(0, 'the reference rests')
        # By more than 0.01 rad: help would drive it farther.
        if (position - self._past[-1][1]) * self._direction > 0.01:
            return Announcement(0, 'the joint is ahead of the reference')
        return Announcement(self._direction, 'the reference moves')


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
        self._reason, self._lost = reason, set[str]()

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
        wait, late = max(0.0, begin - now), max(0.0, now - begin)
        if time[0] > 0.0:
            time, path = np.concatenate([[0.0], time]), np.concatenate([where[None], path])
        if wait > 0.0:
            time, path = np.concatenate([[0.0], time + wait]), np.concatenate([path[:1], path])
        if len(time) < 2 or time[-1] <= late:
            self.forget('the plan is over')
            return
        self._begin, self._plan = now - late, ExerciseScript(own, time, path, self._announcement)

    def at(self, time: float, position: np.ndarray) -> list[Announcement]:
        """Return an announcement for each joint at a time in s; `position` is in rad, (J,)."""
        plan = self._plan
        if plan is None:
            return [Announcement(0, self._reason) for _ in self._joints]
        since = time - self._begin
        planned, _, directions = plan.at(since)
        said = dict.fromkeys(self._joints, Announcement(0, 'not in the plan'))
        places = dict(zip(self._joints, position.tolist()))
        for joint, aim, direction, end in zip(
                plan.joints, planned.tolist(), directions.tolist(), plan.ends(since).tolist()):
            away = abs(places[joint] - aim)
            if not away <= self._tolerance:
                # For good: a joint that comes across the plan does not follow it.
                self._lost.add(joint)
            said[joint] = (
                Announcement(0, 'the plan is not followed: ' + (
                    f'{away:.2f} rad away' if math.isfinite(away) else 'position unknown'),
                    fault=True) if joint in self._lost else
                Announcement(0, 'the plan is over') if since > plan.duration else
                Announcement(direction, 'as planned' if direction else 'the plan rests', end))
        return list(said.values())
