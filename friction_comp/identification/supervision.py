# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tells, while a joint is identified, whether it answers the currents as a joint does.

One idea serves all faults: what was commanded says what must be measured. The measured current
follows the commanded one, and soon; the position goes where the measured velocity leads; and a
current well above what set the joint free accelerates it. What contradicts that is a fault of the
wiring, of the encoder, of the units or of the machine, or somebody's hand, and ends the run before
a model is written.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
import math

from friction_comp.drive import Drive
from friction_comp.identification.current_lag import Answer, CurrentLag, MEMORY
from friction_comp.identification.goal import IdentificationError, IdentificationGoal
from friction_comp.identification.kinetic import KineticPoint

# s over which currents are smoothed before they are compared: longer than any drive's own lag. What
# is later comes of the way between drive and controller.
_SMOOTHING = 0.05
# Measured over commanded current that is believed; beyond, a unit or a constant is wrong.
_LEAST_GAIN, _MOST_GAIN = 0.5, 2.0
# Correlation from which on a measured current is the commanded one of some time before; and s from
# which on that is what keeps a joint from answering.
_ALIKE, _LATE = 0.9, 0.01
# Share of what smoothing takes away of the commanded current that has to be left of it.
_STANDS_OUT = 0.2
# Overall gain beyond which the result says so.
_DOUBTFUL = 0.15
# s over which the way by position and the way by velocity are compared.
_BLOCK = 0.1
# Counts, and rad, below which that comparison says nothing.
_FEW_COUNTS, _SHORT = 50.0, 2e-3
# s by which a drive's filter may delay the velocity it measures: the way it leads then falls short
# by as much as the speed changed over that time.
_VELOCITY_LAG = 0.02
# Longest step between samples over which anything is integrated, s.
_STEP = 0.02
# A current so many times what sets the joint free must accelerate it visibly.
_SURPLUS = 1.5
# Counts that such a joint must be expected to have moved, and the share that it must have; and s
# that it is given to answer, for delay, current loop and a filter take some milliseconds.
_EXPECTED_COUNTS, _ANSWERED, _ANSWER_TIME = 30.0, 0.1, 0.01


class Supervision:
    """Compares what is measured with what was commanded, sample by sample.

    Parameters
    ----------
    goal : IdentificationGoal
    drive : Drive
    """

    def __init__(self, goal: IdentificationGoal, drive: Drive):
        self._peak = goal.ramp_peak
        self._resolution = drive.position_resolution or 1e-6
        self._last: tuple[float, float] | None = None
        # Commanded and measured current, smoothed; their products, remembered and over all.
        self._commanded = self._measured = 0.0
        self._recent, self._all = [0.0] * 3, [0.0] * 3
        self._rattle = 0.0
        self._lag = CurrentLag()
        self._quiet: list[float] = []
        self._noise: float | None = 0.0
        self._begin_block()
        self._moving = False        # whether a velocity other than zero was ever measured
        self._window: deque[tuple[float, float]] = deque(maxlen=10)
        self._begin_answer(0.0, 0.0, 0.0)

    def look(self, time: float, position: float, velocity: float | None, current: float,
             command: float, friction: Sequence[float] | None, acceleration: float) -> None:
        """Take a sample and the current that was applied before it.

        Parameters
        ----------
        time, position : float
            s, rad.
        velocity : float or None
            Measured velocity in rad/s; None or NaN where there is none.
        current, command : float
            Measured and commanded current in A.
        friction : pair of float, or None
            Largest current in A known to be taken by friction in the positive and, negative, in
            the negative direction; None before it is known.
        acceleration : float
            k_t·n/J in rad/s² per A; NaN before it is known.

        Raises
        ------
        IdentificationError
            If the joint does not answer as a joint does.
        """
        if self._last is None:
            self._last = time, position
            return
        step = time - self._last[0]
        if step <= 0.0:
            return
        self._last = time, position
        if math.isfinite(current):
            self._compare_currents(min(step, _STEP), time, current, command)
        self._compare_ways(step, time, position, velocity)
        if friction is not None and math.isfinite(acceleration):
            self._expect_motion(step, time, position, command, friction, acceleration)

    # The measured current follows the commanded one.

    def _compare_currents(self, step: float, time: float, current: float,
                          command: float) -> None:
        if command == 0.0 and self._commanded == 0.0 and len(self._quiet) < 1000:
            self._quiet.append(current)
            self._noise = None
        share = -math.expm1(-step / _SMOOTHING)
        self._commanded += share * (command - self._commanded)
        self._measured += share * (current - self._measured)
        self._lag.add(time, self._commanded, self._measured)
        products = (self._commanded ** 2, self._commanded * self._measured, 1.0)
        fading = math.exp(-step / MEMORY)
        self._rattle = fading * self._rattle + step * (command - self._commanded) ** 2
        for k, value in enumerate(products):
            self._recent[k] = fading * self._recent[k] + step * value
            self._all[k] += step * value
        if self._recent[2] < 0.3 * MEMORY or not self._is_loud(self._recent):
            return
        # What smoothing leaves of a controller that rattles is no current to compare: an amplifier
        # follows it late and in part.
        if self._recent[0] < _STANDS_OUT ** 2 * self._rattle:
            return
        gain = self._recent[1] / self._recent[0]
        if _LEAST_GAIN <= gain <= _MOST_GAIN:
            return
        answer = self._lag.answer()
        _refuse_late(answer)
        # A current that nobody had time to answer tells nothing yet.
        if answer.earliest > self._threshold:
            gain = answer.gain if abs(answer.likeness) > _ALIKE else gain
            raise IdentificationError(
                f'the measured current is {gain:.2g} times the commanded one of '
                f'{math.copysign(1.0, self._commanded) * self._level(self._recent):.3g} A: '
                + _cause(gain))

    @property
    def _threshold(self) -> float:
        """Level in A below which a commanded current is not compared."""
        if self._noise is None:
            self._noise = 0.0
            if len(self._quiet) > 10:
                mean, last = sum(self._quiet) / len(self._quiet), self._quiet[-100:]
                self._noise = math.sqrt(sum((value - mean) ** 2 for value in last) / len(last))
        # Smoothing takes a tenth of white noise at a sample a millisecond.
        return max(0.5 * self._noise, 0.02 * self._peak)

    def _is_loud(self, products: list[float]) -> bool:
        return self._level(products) > self._threshold

    @staticmethod
    def _level(products: list[float]) -> float:
        return math.sqrt(products[0] / products[2])

    def warnings(self) -> list[str]:
        """Return what is doubtful, in words."""
        if self._all[2] <= 0.0 or not self._is_loud(self._all):
            return []
        gain = self._all[1] / self._all[0]
        if abs(gain - 1.0) <= _DOUBTFUL:
            return []
        return [f'the measured current is {gain:.2f} times the commanded one: torque constant, '
                'gear ratio or current controller are not quite as the model file has them']

    # The position goes where the velocity leads.

    def _begin_block(self, at: tuple[float, float] | None = None) -> None:
        self._block = at
        self._way, self._slowest, self._fastest = 0.0, math.inf, -math.inf

    def _compare_ways(self, step: float, time: float, position: float,
                      velocity: float | None) -> None:
        if velocity is None or not math.isfinite(velocity) or step > _STEP:
            self._begin_block()
            return
        if self._block is None:
            self._begin_block((time, position))
            return
        self._moving = self._moving or velocity != 0.0
        self._way += velocity * step
        self._slowest = min(self._slowest, velocity)
        self._fastest = max(self._fastest, velocity)
        if time - self._block[0] < _BLOCK:
            return
        went, way = position - self._block[1], self._way
        late = _VELOCITY_LAG * (self._fastest - self._slowest)
        self._begin_block((time, position))
        # Some drivers fill a velocity that they do not measure with zeros.
        if not self._moving or max(abs(went), abs(way)) < max(
                _SHORT, _FEW_COUNTS * self._resolution):
            return
        if abs(went - way) < late:
            return
        if abs(went) < 0.2 * abs(way):
            raise IdentificationError(
                f'the position stands still while the velocity leads {way:.3g} rad away: '
                'the encoder is stuck')
        if went * way < 0.0 or not 0.5 < abs(went / way if way else math.inf) < 2.0:
            raise IdentificationError(
                f'the position went {went:.3g} rad where the velocity leads {way:.3g} rad: '
                'they differ in sign or unit, or one of them is wrong')

    # A current well above friction accelerates the joint.

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
        # It went on, or it gained on where it would have gone, for instance by being braked.
        went = position - self._from
        gained = went - self._drift * (time - self._since)
        if max(sign * went, sign * gained) < _ANSWERED * self._expected:
            _refuse_late(self._lag.answer())
            raise IdentificationError(
                f'the joint does not move at {command:.3g} A, although less set it free before: '
                'it is blocked, at a stop or held, or the encoder is stuck')
        self._begin_answer(time, position, sign)


def _refuse_late(answer: Answer) -> None:
    """Raise IdentificationError where the measured current is the commanded one, but late."""
    if (answer.delay >= _LATE and answer.likeness > _ALIKE
            and _LEAST_GAIN <= answer.gain <= _MOST_GAIN):
        raise IdentificationError(
            f'the measured current follows the commanded one {answer.delay:.2g} s late, in the '
            f'right size ({answer.gain:.2g} times as large): a joint cannot be controlled so '
            'late. Machine or network are overloaded, or the driver lets currents or states wait')


def _cause(gain: float) -> str:
    if abs(gain) < 0.05:
        return 'effort is not measured, or is not the torque of this motor'
    if gain < 0.0:
        return 'effort has the wrong sign'
    return ('effort has another unit than N·m at the joint, or torque constant and gear ratio '
            'are not those of this drive')


def loaded(points: Sequence[KineticPoint], breakaway: tuple[float, float],
           spread: float) -> tuple[str, str]:
    """Tell from a finished run whether something other than friction was measured.

    Friction takes as much in both directions, but for a few per cent. What adds to one and takes
    from the other is a load: gravity, a spring, or somebody who leans on the joint. Gravity is
    the same in the table of velocities and in the breakaway currents; a person need not be.

    Parameters
    ----------
    points : sequence of KineticPoint
    breakaway : pair of float
        Mean breakaway currents in A, the second negative.
    spread : float
        Largest standard deviation of the breakaway currents of one direction, A.

    Returns
    -------
    (str, str)
        What is wrong, and what is doubtful; empty where nothing is.
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
