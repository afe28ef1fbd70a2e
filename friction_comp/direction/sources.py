# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What is announced for a joint: by a plan, a stream of desired positions, or a sensor of force.

A plan, as sent to a trajectory controller, is an exercise that begins when it is sent: movements
from rest are announced ahead, the direction changes at a turn, and returns to 0 at the end. A joint
away from the plan has none. Of a leader, or a reference, positions are used, since its speeds are
differences of encoder counts: it moves if it has covered more than an encoder count, and this
distance is the hysteresis at a turn, too.

A cheap sensor of a person's force is calibrated at rest. From then on one test tells when its value
has left that of rest: a cumulative sum of deviations (CUSUM; Page 1954), whose limit follows from
the rate of false alarms (Lorden 1971). The direction is the side of the force. It begins at rest,
since only there is a push an attempt to move, and ends with the push or the motion; whatever is in
doubt announces nothing.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from friction_comp.direction.exercise import ExerciseScript
from friction_comp.errors import InputError

STILL = 0.02
"""rad/s. Below, a joint rests: presliding and the flex of a gear, 2 mrad at most, stay below it."""
SILENCE = 0.2
"""s without a position after which nothing is known of a joint, or of its reference."""
# Window of the speed, s, and the least time between the positions that it keeps; time over which a
# reference covers its distance, s.
_WINDOW, _STEP, _COVERED = 0.1, 0.008, 0.2
CALIBRATION_TIME = 3.0
"""s at rest."""
# Standard deviations by which a value may deviate without adding to a sum: half of the smallest
# change that is to be found.
_ALLOWANCE = 1.5
# s after which a sensor is silent; values on the same side that an onset needs.
_SILENT, _AGREE = 0.1, 3
# s of rest before an attempt, and after it.
_REARM, _OVER = 0.3, 0.15


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


class ChangeTest:
    """Tests values for a rise or a fall from their level at rest; learnt from values at rest, (N,).

    `level` and scatter follow the values while `follow` is called. `alarm` is +1 or -1 while they
    are above or below, else 0, `sure` the same beyond doubt.
    """

    def __init__(self, values: np.ndarray, rate: float) -> None:
        time = np.arange(len(values))
        own = values - np.polyval(np.polyfit(time, values, 1), time)
        # The upper limit (99 %) of what so few values show, and at least a step of the converter.
        known = float(np.std(own)) * (1.0 + 2.33 / math.sqrt(2.0 * len(own)))
        steps = np.abs(np.diff(values))
        self._least = max(known, float(steps[steps > 0.0].min(initial=math.inf))) ** 2
        self._variance = self._recent = self._least
        # Two sides, with an alarm without cause in four hours. The sum times twice the allowance is
        # one of log likelihood ratios.
        self.limit = math.log(2.0 * 3600.0 * rate / 0.25) / (2.0 * _ALLOWANCE)
        # Level and scatter are 0.15 s behind, so that an onset does not hide itself.
        self._step, self._delay = 1.0 / rate, round(0.15 * rate)
        self.settle(float(values.mean()))

    @property
    def scatter(self) -> float:
        """Standard deviation at rest; never below that of the calibration."""
        return math.sqrt(self._variance)

    def settle(self, level: float) -> None:
        """Begin anew at a level of rest."""
        self.level, self.alarm, self.sure = level, 0, 0
        self._up = self._down = 0.0
        self._waiting: deque[float] = deque()

    def add(self, value: float) -> int:
        """Add a value and return the alarm."""
        # At twice the limit a push is beyond doubt: without a cause, once in a thousand years.
        z, most = (value - self.level) / self.scatter, 2.0 * self.limit
        self._up = min(most, max(0.0, self._up + z - _ALLOWANCE))
        self._down = min(most, max(0.0, self._down - z - _ALLOWANCE))
        self.sure = (self._up == most) - (self._down == most)
        self.alarm = (self._up > self.limit) - (self._down > self.limit)
        if self.alarm:
            # What came before an alarm belongs to it.
            self._waiting.clear()
        return self.alarm

    def follow(self, value: float) -> None:
        """Let level and scatter follow a value at rest."""
        self._waiting.append(value)
        if len(self._waiting) <= self._delay:
            return
        deviation = self._waiting.popleft() - self.level
        # Within 1 s; the scatter grows within 0.2 s, and shrinks within 30 s.
        self.level += deviation * min(1.0, self._step)
        self._recent += min(1.0, self._step / 0.2) * (deviation**2 - self._recent)
        shrunk = self._variance * (1.0 - min(1.0, self._step / 30.0))
        self._variance = max(self._least, self._recent, shrunk)


class ForceDirection:
    """Announces the direction of one joint from its sensor.

    The force is positive if it pushes towards larger positions. `sensor_range` are the lowest and
    the highest value that the converter can give, else InputError. Positions of the joint go to its
    `motion`. Why the last calibration taught nothing is its `failure`, '' if it did.
    """

    def __init__(self, sensor_range: tuple[float, float]) -> None:
        low, high = sensor_range
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InputError('sensor_range must be the lowest and the highest value that the '
                             f'sensor can give, such as [0, 1023], not [{low:g}, {high:g}]')
        # At the ends of its range a value is saturated.
        margin = 0.005 * (high - low)
        self._inside = low + margin, high - margin
        self.motion = JointMotion()
        self._resting, self._stopped = False, -math.inf
        self.begin_calibration()
        self.calibrating, self.failure = False, 'not calibrated'

    def begin_calibration(self) -> None:
        """Collect values for `CALIBRATION_TIME` from when the joint's motion is known.

        Nothing is announced before it has ended; it is `calibrating` until then.
        """
        self.calibrating, self.failure = True, 'joint_states or values are missing'
        self._collected: list[np.ndarray] = []
        self._begun = self._arrived = math.nan
        self._test: ChangeTest | None = None
        self._fault, self._against, self._run = '', 0, 0
        self._alarmed, self._side = -math.inf, 0
        self._stop(-math.inf, 'at rest')

    def _learn(self, passed: float) -> None:
        """Learn from the values of a time in s."""
        self.calibrating, values = False, np.concatenate(self._collected)
        self.failure = self._unusable(values, passed)
        if self.failure:
            return
        # The first message has come at the beginning of the time that passed.
        rate = (len(values) - len(self._collected[0])) / passed
        changes = np.flatnonzero(np.diff(values) != 0.0)
        longest = np.diff(np.concatenate([[-1], changes, [len(values) - 1]])).max()
        self._flat, self._silent = max(4.0 * longest, 0.3 * rate), max(_SILENT, 5.0 / rate)
        self._recent: deque[float] = deque(maxlen=max(_AGREE + 2, round(_REARM * rate)))
        self._test = ChangeTest(values, rate)

    def _unusable(self, values: np.ndarray, passed: float) -> str:
        """Return why values at rest over a time in s teach nothing; '' if they do."""
        return next((why for wrong, why in (
            (len(values) <= 20.0 * passed, f'{len(values)} values in {CALIBRATION_TIME:g} s: at '
             'least 20 per second are needed'),
            (not np.isfinite(values).all(), 'values that are not finite'),
            (not self._inside[0] < values.min() <= values.max() < self._inside[1],
             f'saturated: values from {values.min():g} to {values.max():g}'),
            (np.count_nonzero(np.diff(values)) < 3,
             f'flat: {values[0]:g} does not change; is it connected?'),
            (self.motion.rest(self._arrived) < passed, 'the joint moved during the calibration'))
            if wrong), '')

    def add(self, time: float, values: Any) -> None:
        """Take values, shape (N,), of which the last was measured at a time in s."""
        samples = np.asarray(values, dtype=float)
        self._arrived = time
        if self._test is not None:
            for value in samples.tolist():
                self._take(time, value, self._test)
        elif self.calibrating and (self._collected or self.motion.known(time)):
            self._begun = self._begun if self._collected else time
            self._collected.append(samples)
            # By the values' own time, so that what is learnt follows from them alone.
            if time - self._begun >= CALIBRATION_TIME:
                self._learn(time - self._begun)

    def _take(self, time: float, value: float, test: ChangeTest) -> None:
        recent = self._recent
        self._run = self._run + 1 if recent and value == recent[-1] else 0
        alarm = test.add(value)
        hums = alarm == -self._side != 0 and time - self._alarmed < _SILENT
        if alarm:
            self._alarmed, self._side = time, alarm
        # Within a tenth of a second it was above and below its rest.
        self._fault = 'sensor: hums' if hums else self._find_fault(time, value)
        if self._fault:
            self._stop(time, self._fault)
            recent.clear()
            return
        recent.append(value)
        if self._direction:
            self._continue(time, value - test.level, alarm)
        elif not self._resting:
            if min(self.motion.rest(time), time - self._stopped) >= _REARM and self._quiet(test):
                self._resting, self._reason = True, 'at rest'
                test.settle(math.fsum(recent) / len(recent))
        elif self.motion.rest(time) == 0.0:
            self._stop(time, 'moves')
        elif alarm:
            self._begin(time, alarm, test)
        else:
            test.follow(value)

    def _find_fault(self, time: float, value: float | None = None) -> str:
        """Return what is wrong with the sensor, or with a value that has come; '' if nothing is."""
        return next((why for wrong, why in (
            (value is None and time - self._arrived > self._silent, 'sensor: silent'),
            (value is not None and not self._inside[0] < value < self._inside[1],
             f'sensor: saturated at {value}'),
            (self._run > self._flat, 'sensor: flat'),
            (self._against >= 3, 'the joint moves against the sensor: is its sign reversed?'),
            (not self.motion.known(time), 'joint_states are missing')) if wrong), '')

    def _quiet(self, test: ChangeTest) -> bool:
        """Return whether the values have not changed for as long as they are remembered."""
        values, half = np.array(self._recent), len(self._recent) // 2
        return len(values) == self._recent.maxlen and bool(
            abs(values[half:].mean() - values[:half].mean()) < 2.0 * test.scatter)

    def _begin(self, time: float, side: int, test: ChangeTest) -> None:
        """Announce a side on which all of the last values are, unless they jumped there."""
        values = [test.level, *list(self._recent)[-_AGREE - 1:]]
        if not all((value - test.level) * side > 0.0 for value in values[-_AGREE:]):
            return
        steps = [side * (after - before) for before, after in zip(values, values[1:])]
        largest, rise = max(steps[1:]), side * (values[-1] - values[0])
        stands = len(set(values[-3:])) == 1
        # The fastest contractions take 60 ms (Aagaard et al. 2002).
        if stands or largest > max(0.8 * rise, 6.0 * test.scatter):
            # Only the next value tells the newest step from the beginning of a push.
            if stands or steps[-1] < largest:
                self._stop(time, 'a jump, no push')
            return
        self._direction, self._reason, self._resting = side, 'onset of a push', False
        self._tried = self._strong = time
        self._largest, self._moved = rise, False

    def _continue(self, time: float, force: float, alarm: int) -> None:
        """End the attempt if the sensor or the motion says that it is over."""
        own, speed = force * self._direction, self.motion.speed * self._direction
        self._largest = max(self._largest, own)
        if own > 0.2 * self._largest:
            self._strong = time
        if speed > STILL:
            self._moved, self._against, self._tried = True, 0, time
        against = speed < -STILL and not self._moved
        self._against += against and alarm != -self._direction
        for ends, why in (
                (alarm == -self._direction, 'pushed the other way'),
                (against, 'moved against the push'),
                (speed < -STILL or (self._moved and self.motion.rest(time) > _OVER),
                 'the movement is over'),
                (time - self._strong > _OVER, 'the push is over'),
                (time - self._tried > 3.0, 'no movement followed')):
            if ends:
                self._stop(time, why)
                return

    def _stop(self, time: float, reason: str) -> None:
        """Take back what is announced; the next attempt begins from rest."""
        self._direction, self._reason, self._resting = 0, reason, False
        self._stopped = time

    def at(self, time: float) -> Announcement:
        """Return what is announced at a time in s."""
        if self._test is None:
            return Announcement(0, 'calibrating' if self.calibrating else
                                f'not calibrated: {self.failure}', fault=True)
        if fault := self._fault or self._find_fault(time):
            self._stop(time, fault)
            return Announcement(0, fault, fault=True)
        return Announcement(self._direction, self._reason,
                            is_pushed=self._test.sure * self._direction > 0)
