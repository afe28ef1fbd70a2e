# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs a script that moves a joint, sample by sample, and releases it at the first fault.

A script says what to command, and what was commanded says what must be measured: the measured
current is the commanded one, and soon; the position goes where the measured velocity leads; and a
current well above what set the joint free accelerates it. What contradicts that is a fault of the
wiring, of the encoder, of the units or of the machine, or somebody's hand, and ends the run before
a model is written: **zero current whenever the joint does not do what a joint does**. Until the
measured current is known to be the commanded one, no more is commanded than the first ramp, which
is cut when the joint moves.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
import math
from typing import NamedTuple, TYPE_CHECKING

from friction_comp.drive import Drive
from friction_comp.identification.goal import IdentificationError, MotionGoal
from friction_comp.identification.kinetic import KineticPoint
from friction_comp.signal_checks import Answer, current_fault, CurrentCheck, VelocityCheck

if TYPE_CHECKING:
    from friction_comp.identification.motion import Motion

LONGEST_GAP = 0.25      # s without a sample after which the joint is out of control
# Accepted ratios of measured to commanded current, and of integrated velocity to change of
# position; outside, a unit or a constant is wrong.
_FACTOR = 2.0
# Standard errors by which a gain must be outside these limits to be wrong, and the largest standard
# error, as a share of the gain, with which it is known to be right.
_ERRORS, _KNOWN = 3.0, 0.25
# Correlation above which a measured current is a delayed commanded one; and delay in s above which
# that explains why a joint does not respond.
_ALIKE, _LATE = 0.9, 0.01
# Share of the ramps' peak that the commanded current must have to be compared.
_LEAST = 0.02
# Overall gain above which the result reports it.
_DOUBTFUL = 0.15
# Longest step between samples that is integrated, s.
_STEP = 0.02
# A current of this multiple of breakaway must accelerate the joint visibly.
_SURPLUS = 1.5
# Counts by which such a joint must be expected to have moved, and the share of them that it must
# have moved; and s that it has to respond, since delay, current loop and filter take some
# milliseconds.
_EXPECTED_COUNTS, _ANSWERED, _ANSWER_TIME = 30.0, 0.1, 0.01


class Sample(NamedTuple):
    """A sample for the script: s, rad and A, the last NaN where unknown."""

    time: float
    position: float
    current: float


class Supervision:
    """Compares what is measured with what was commanded, sample by sample."""

    def __init__(self, goal: MotionGoal, drive: Drive):
        self._drive = drive
        self._least = _LEAST * goal.ramp_peak
        self._resolution = drive.position_resolution or 1e-6
        self._last: tuple[float, float] | None = None
        self._currents = CurrentCheck()
        self._ways = VelocityCheck(_FACTOR, resolution=self._resolution, zeros=True)
        self._window: deque[tuple[float, float]] = deque(maxlen=10)
        self._begin_answer(0.0, 0.0, 0.0)

    def check(self, time: float, position: float, velocity: float | None, current: float,
              command: float, friction: Sequence[float] | None, acceleration: float) -> None:
        """Take a sample and the current that was applied before it; raise if the joint is at fault.

        `velocity` is None or NaN where it is not measured; `friction` and `acceleration` are those
        of `Motion`.
        """
        if self._last is None:
            self._last = time, position
            return
        step = time - self._last[0]
        if step <= 0.0:
            return
        self._last = time, position
        if math.isfinite(current):
            self._currents.take(time, min(step, _STEP), command, current)
            self._compare_currents()
        # The position goes where the velocity leads.
        if velocity is None or not math.isfinite(velocity) or step > _STEP:
            self._ways.interrupt()
        elif fault := self._ways.take(time, position, velocity):
            raise IdentificationError(fault)
        if friction is not None and math.isfinite(acceleration):
            self._expect_motion(step, time, position, command, friction, acceleration)

    # The measured current is the commanded one.

    def _compare_currents(self) -> None:
        gain = self._currents.gain(self._least)
        if not math.isfinite(gain) or 1.0 / _FACTOR <= gain <= _FACTOR:
            return
        answer = self._currents.answer()
        _refuse_late(answer)
        # A current that had no time to take effect is not compared yet.
        if answer.earliest > self._least:
            self._refuse_gain(answer)

    def known(self) -> bool:
        """Return whether the measured current is known to be the commanded one by now."""
        answer = self._currents.answer()
        return (1.0 / _FACTOR <= answer.gain <= _FACTOR
                and answer.error <= _KNOWN * answer.gain)

    def require_known(self) -> None:
        """Raise unless the measured current is known; the drive has had the time to answer."""
        if self.known():
            return
        answer = self._currents.answer()
        _refuse_late(answer)
        self._refuse_gain(answer)
        raise IdentificationError(
            f'the measured current cannot be told to be the commanded one: {answer.gain:.2g} '
            f'times as large, but for {answer.error:.2g}: effort is too noisy, or not measured')

    def _refuse_gain(self, answer: Answer) -> None:
        """Raise IdentificationError where a gain is wrong whatever the noise."""
        gain, error = answer.gain, _ERRORS * answer.error
        if 1.0 / _FACTOR - error <= gain <= _FACTOR + error:
            return
        raise IdentificationError(
            f'the measured current is {gain:.2g} times the commanded one of '
            f'{self._currents.commanded:.3g} A: {current_fault(gain, self._drive)}')

    def warnings(self) -> list[str]:
        """Return warnings, in words."""
        gain = self._currents.gain(self._least, lately=False)
        if not math.isfinite(gain) or abs(gain - 1.0) <= _DOUBTFUL:
            return []
        return [f'the measured current is {gain:.2f} times the commanded one: torque constant, '
                'gear ratio or current controller are not quite as the model file has them']

    # A current well above friction must accelerate the joint.

    def _begin_answer(self, time: float, position: float, sign: float) -> None:
        self._sign, self._since, self._from = sign, time, position
        self._drift = 0.0
        if self._window and time > self._window[0][0]:
            self._drift = (position - self._window[0][1]) / (time - self._window[0][0])
        self._speed = self._expected = 0.0

    def _expect_motion(self, step: float, time: float, position: float, command: float,
                       friction: Sequence[float], acceleration: float) -> None:
        sign = math.copysign(1.0, command)
        surplus = sign * command - _SURPLUS * abs(friction[0] if sign > 0.0 else friction[1])
        if surplus <= 0.0 or sign != self._sign or step > _STEP:
            self._window.append((time, position))
            self._begin_answer(time, position, sign)
            return
        self._window.append((time, position))
        self._speed += surplus * acceleration * step
        self._expected += self._speed * step
        if (self._expected < _EXPECTED_COUNTS * self._resolution
                or time - self._since < _ANSWER_TIME):
            return
        # It kept moving, or it deviates from its expected motion, for instance because it is
        # braked.
        went = position - self._from
        gained = went - self._drift * (time - self._since)
        if max(sign * went, sign * gained) < _ANSWERED * self._expected:
            _refuse_late(self._currents.answer())
            raise IdentificationError(
                f'the joint does not move at {command:.3g} A, although less set it free before: '
                'it is blocked, at a stop or held, or the encoder is stuck')
        self._begin_answer(time, position, sign)


def _refuse_late(answer: Answer) -> None:
    """Raise IdentificationError where the measured current is the commanded one, but late."""
    if (answer.delay >= _LATE and answer.likeness > _ALIKE
            and 1.0 / _FACTOR <= answer.gain <= _FACTOR):
        raise IdentificationError(
            f'the measured current follows the commanded one {answer.delay:.2g} s late, in the '
            f'right size ({answer.gain:.2g} times as large): a joint cannot be controlled so '
            'late. Machine or network are overloaded, or the driver lets currents or states wait')


def loaded(points: Sequence[KineticPoint], breakaway: tuple[float, float],
           spread: float) -> tuple[str, str]:
    """Return from a finished run what is wrong, and what is doubtful; empty where nothing is.

    Friction takes as much in both directions, but for a few per cent. What adds to one and takes
    from the other is a load: gravity, a spring, or somebody who leans on the joint. Gravity is
    the same in the table of velocities and in the breakaway currents, whose means and largest
    standard deviation are given in A; a person need not be.
    """
    friction = 0.5 * (breakaway[0] - breakaway[1])
    shift = 0.5 * (breakaway[0] + breakaway[1])
    sides = [[p.current for p in points if p.speed * sign > 0.0] for sign in (1, -1)]
    sliding = 0.5 * sum(sum(side) / len(side) for side in sides) if all(sides) else shift
    if friction <= 0.0:
        return 'breakaway takes no current: the joint was pushed', ''
    if spread > 0.6 * friction:
        return (f'the breakaway currents scatter by {spread:.3g} A about {friction:.3g} A: the '
                'joint was touched while it was measured', '')
    if abs(shift - sliding) > 0.6 * friction:
        return (f'a load of {sliding:.3g} A while the joint moved, but of {shift:.3g} A when it '
                'broke free: somebody leant on it for a part of the run', '')
    if max(abs(shift), abs(sliding)) > 0.12 * friction:
        return '', (f'one direction takes {2.0 * max(shift, sliding, key=abs):.3g} A more than '
                    'the other: gravity or a spring, or somebody leant on the joint')
    return '', ''


class SupervisedRun:
    """One run of a script, from standstill to zero current.

    Call `update` with every sample and apply the current that it returns, until `finished`.

    """

    def __init__(self, script: Motion) -> None:
        self.drive = script.drive
        self.error = ''             # why the run failed; empty while it has not
        self.finished = False       # whether all was done
        self.progress = 0.0         # 0 to 1, never falling
        self.remaining = math.nan   # estimated time to the end, s
        self._script: Motion = script
        self._run = script.run()
        next(self._run)
        self._begin: float | None = None
        self._last: float | None = None
        self._estimated, self._command = -math.inf, 0.0

    @property
    def phase(self) -> str:
        """The run's present step."""
        if self.error:
            return 'failed'
        return 'done' if self.finished else self._script.phase

    def update(self, time: float, position: float, velocity: float | None = None,
               current: float = 0.0) -> float:
        """Take one sample of the joint and return the current to apply.

        Parameters
        ----------
        time : float
            s, on any time base; a sample that is not newer than the last one changes nothing.
        position : float
            rad.
        velocity : float, optional
            rad/s. The position must go where it leads; for all else the position is finer.
        current : float
            Measured motor current in A.

        Returns
        -------
        float
            A; zero when finished.

        Raises
        ------
        IdentificationError
            When the joint leaves its range, the encoder fails, or the drive does not answer as a
            drive does. From then on every call returns zero.
        """
        if self.finished or self.error:
            return 0.0
        try:
            self._check(time, position)
            if self._last is not None and time <= self._last:
                return self._command
            self._script.supervision.check(
                float(time), float(position), velocity, float(current), self._command,
                self._script.friction, self._script.acceleration)
            command = self._run.send(Sample(
                float(time), float(position),
                float(current) if math.isfinite(current) else math.nan))
        except StopIteration:
            self.finished = True
            self.progress, self.remaining, self._command = 1.0, 0.0, 0.0
            return 0.0
        except Exception as error:
            self.abort(str(error))
            raise
        self._last = float(time)
        self._estimate(self._last)
        limit = self.drive.current_limit
        self._command = min(max(command, -limit), limit)
        return self._command

    def abort(self, reason: str = 'cancelled') -> None:
        """End the run: every later `update` returns zero current."""
        if not self.finished:
            self.error, self._command, self.remaining = reason or 'cancelled', 0.0, 0.0
            self._run.close()

    def _check(self, time: float, position: float) -> None:
        if not math.isfinite(time):
            raise IdentificationError('the time of a sample is not finite')
        if not math.isfinite(position):
            raise IdentificationError('the joint position is not finite: encoder failure')
        if self._last is None:
            return
        if abs(time - self._last) > LONGEST_GAP:
            what = 'no sample for' if time > self._last else 'time went back by'
            raise IdentificationError(
                f'{what} {abs(time - self._last):.2g} s; {LONGEST_GAP} s are tolerated')
        low, high = self._script.bounds()
        if not low <= position <= high:
            raise IdentificationError(
                f'the joint left its motion range of {high - low:.4g} rad')

    def _estimate(self, now: float) -> None:
        """Renew `remaining` and `progress`, ten times a second of the joint's time."""
        if self._begin is None:
            self._begin = now
        elif now - self._estimated < 0.1:
            return
        self._estimated = now
        elapsed = now - self._begin
        self.remaining = self._script.remaining()
        share = elapsed / max(elapsed + self.remaining, 1e-9)
        self.progress = max(self.progress, min(0.999, share))
