# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identification of a drive, sample by sample (note, sections 2.3 and 2.4).

Whatever calls `IdentificationRun.update` once a sample runs the procedure, be it a ROS node or a
plain loop. The procedure itself is `script.Script`, the safety about it `supervision`; here is
the evaluation of what it measured.
"""

from __future__ import annotations

from friction_comp.drive import Drive
from friction_comp.identification.goal import (
    IdentificationError,
    IdentificationGoal,
    IdentificationResult,
)
from friction_comp.identification.inertia import acceleration_of_cycle
from friction_comp.identification.kinetic import merge_points
from friction_comp.identification.ramp_evaluation import evaluate_ramps
from friction_comp.identification.script import Script
from friction_comp.identification.sigmoid_fit import fit_sigmoid
from friction_comp.identification.supervision import loaded, SupervisedRun


class IdentificationRun(SupervisedRun):
    """One identification, from standstill to zero current; see `SupervisedRun`.

    Call `update` with every sample and apply the current that it returns, until `finished`. Then
    `result()` fits the model.

    Parameters
    ----------
    goal : IdentificationGoal
    drive : Drive

    Raises
    ------
    InputError
        If the drive cannot meet the goal.
    """

    _script: Script

    def __init__(self, goal: IdentificationGoal, drive: Drive) -> None:
        goal.check(drive)
        super().__init__(Script(goal, drive))
        self.goal = goal
        self.warnings: list[str] = []
        self._result: IdentificationResult | None = None

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
            self.warnings = script.warnings + script.supervision.warnings()
            acceleration = self._acceleration()
            ramps = evaluate_ramps(
                script.ramps, script.stopping, self.goal.ramp_slope,
                self.drive.position_resolution or 1e-6, acceleration, sigmoid.viscous)
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

    def _acceleration(self) -> float:
        """k_t·n/J in rad/s² per A by the cycles' changes of speed; by the push where they fail."""
        push = self._script.acceleration
        rates = [acceleration_of_cycle(cycle) for cycle in self._script.cycles_driven]
        plausible = [rate for rate in rates if push / 5.0 < rate < 5.0 * push]
        # The fastest cycle has the largest accelerations.
        return plausible[-1] if plausible else push
