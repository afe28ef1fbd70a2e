# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identification of a drive, sample by sample (note, sections 2.3 and 2.4).

Whatever calls `IdentificationRun.update` once a sample runs the procedure, be it a ROS node or a
plain loop. The procedure itself is `script.Script`; here are the safety about it,
its progress, and the evaluation of what it measured.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from friction_comp.identification.goal import (
    IdentificationError,
    IdentificationGoal,
    IdentificationResult,
)
from friction_comp.identification.kinetic import merge_points
from friction_comp.identification.push import acceleration_of_cycle
from friction_comp.identification.ramp import Sample
from friction_comp.identification.ramp_evaluation import evaluate_ramps, RampEvaluation
from friction_comp.identification.script import Script
from friction_comp.identification.sigmoid_fit import fit_sigmoid
from friction_comp.identification.supervision import loaded, Supervision

if TYPE_CHECKING:
    from friction_comp.drive import Drive

__all__ = ['IdentificationError', 'IdentificationGoal', 'IdentificationResult',
           'IdentificationRun']

LONGEST_GAP = 0.25      # s without a sample after which the joint is out of control


class IdentificationRun:
    """One identification, from standstill to zero current.

    Call `update` with every sample and apply the current that it returns, until `finished`. Then
    `result()` fits the model.

    Parameters
    ----------
    goal : IdentificationGoal
    drive : Drive

    Attributes
    ----------
    phase : str
        'standstill', 'push', 'velocity', 'travel', 'breakaway', 'done', or 'failed'.
    progress : float
        0 to 1, never falling.
    remaining : float
        Estimated time to the end in s.
    finished : bool
        Whether the measurement is complete.
    error : str
        Why the run failed; empty while it has not.

    Raises
    ------
    InputError
        If the drive cannot do what the goal asks for.
    """

    def __init__(self, goal: IdentificationGoal, drive: Drive) -> None:
        goal.check(drive)
        self.goal, self.drive = goal, drive
        self.error, self.finished = '', False
        self.progress, self.remaining = 0.0, math.nan
        self.warnings: list[str] = []
        self._supervision = Supervision(goal, drive)
        self._script = Script(goal, drive, self._supervision)
        self._steps = self._script.run()
        next(self._steps)
        self._begin: float | None = None
        self._last: float | None = None
        self._estimated, self._command = -math.inf, 0.0
        self._result: IdentificationResult | None = None

    @property
    def phase(self) -> str:
        """What the run is doing."""
        if self.error:
            return 'failed'
        return 'done' if self.finished else self._script.phase

    def update(self, time: float, position: float, velocity: float | None = None,
               current: float = 0.0, temperature: float | None = None) -> float:
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
        temperature : float, optional
            Motor temperature in degrees Celsius.

        Returns
        -------
        float
            A; zero when finished.

        Raises
        ------
        IdentificationError
            When the joint leaves its range, the encoder fails, or the drive does not do what
            identification needs. From then on every call returns zero.
        """
        if self.finished or self.error:
            return 0.0
        try:
            self._check(time, position)
            if self._last is not None and time <= self._last:
                return self._command
            self._supervision.look(
                float(time), float(position), velocity, float(current), self._command,
                self._script.friction, self._script.acceleration)
            command = self._steps.send(Sample(
                float(time), float(position),
                float(current) if math.isfinite(current) else math.nan,
                math.nan if temperature is None else float(temperature)))
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
            self._steps.close()

    def result(self) -> IdentificationResult:
        """Fit the curve of Eq. 6, evaluate the ramps and return an `IdentificationResult`.

        Raises
        ------
        IdentificationError
            If the run is not finished, too many ramps show no breakaway, or backlash makes it
            scatter.
        """
        if not self.finished:
            raise IdentificationError(f'identification is not complete: {self.error or self.phase}')
        if self._result is None:
            script = self._script
            points = merge_points(script.points)
            sigmoid, error = fit_sigmoid([p.speed for p in points], [p.current for p in points])
            self.warnings = script.warnings + self._supervision.warnings()
            acceleration = self._acceleration()
            ramps = self._evaluate_ramps(sigmoid.viscous, acceleration)
            self.warnings += ramps.warnings
            statistics = ramps.records.statistics()
            wrong, doubtful = loaded(
                points, (statistics.positive_mean, statistics.negative_mean),
                max(statistics.positive_std, statistics.negative_std))
            if wrong:
                raise IdentificationError(wrong)
            self.warnings += [doubtful] if doubtful else []
            self._result = IdentificationResult(
                points=points, sigmoid=sigmoid, sigmoid_error=error,
                breakaway=statistics, records=ramps.records,
                acceleration_per_current=acceleration, goal=self.goal,
                warnings=list(self.warnings), presliding=ramps.presliding,
                backlash=ramps.backlash)
        return self._result

    def _check(self, time: float, position: float) -> None:
        if not math.isfinite(time):
            raise IdentificationError('the time of a sample is not finite')
        if not math.isfinite(position):
            raise IdentificationError('the joint position is not finite: encoder failure')
        if self._last is not None and abs(time - self._last) > LONGEST_GAP:
            what = 'no sample for' if time > self._last else 'time went back by'
            raise IdentificationError(
                f'{what} {abs(time - self._last):.2g} s; {LONGEST_GAP} s are tolerated')
        # Before the first sample the centre is NaN, and nothing is too far from it.
        if abs(position - self._script.centre) > 0.5 * self.goal.motion_range:
            raise IdentificationError(
                f'the joint left its motion range of {self.goal.motion_range:g} rad')

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

    def _evaluate_ramps(self, viscous: float, acceleration: float) -> RampEvaluation:
        script = self._script
        return evaluate_ramps(
            script.ramps, script.stopping, self.goal.ramp_slope,
            self.drive.position_resolution or 1e-6, acceleration, viscous)

    def _acceleration(self) -> float:
        """k_t·n/J in rad/s² per A by the cycles' changes of speed; by the push where they fail."""
        push = self._script.acceleration
        found = [acceleration_of_cycle(cycle) for cycle in self._script.cycles_driven]
        plausible = [rate for rate in found if push / 5.0 < rate < 5.0 * push]
        # The fastest cycle has the largest accelerations.
        return plausible[-1] if plausible else push
