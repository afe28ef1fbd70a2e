# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs all experiments of each configuration in order, and reports progress."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from friction_comp.evaluation.conditions import Evaluation
from friction_comp.identification.goal import IdentificationResult
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.measured import Breakaway
from friction_comp.note.condition_runs import CONDITIONS, mean_peak, run_trial, stand_still
from friction_comp.note.identify import identified_model, identify_breakaway, identify_table, Ramps
from friction_comp.note.published import Experiment, EXPERIMENTS, FALSE_START
from friction_comp.parallel import child_process

LAWS = ('paper', 'continuous')


@dataclass
class ExperimentOutcome:
    """Results of one configuration."""

    experiment: Experiment
    table: IdentificationResult
    ramps: Ramps
    model: FrictionModel  # the identified one
    trials: dict[str, Evaluation]  # by condition
    standstills: dict[str, np.ndarray]  # by law: distances in rad, as from `stand_still`
    drive_time: float  # simulated time that identification took, s

    @property
    def breakaway(self) -> Breakaway:
        """Breakaway currents as identified."""
        assert self.model.breakaway is not None, 'an identified model has breakaway currents'
        return self.model.breakaway

    @property
    def peaks(self) -> dict[str, float]:
        """Peak torque per condition in N·m."""
        return {name: mean_peak(trial) for name, trial in self.trials.items()}

    def reduction(self, law: str) -> float:
        """Share by which a law lowers the peak torque of the condition 'kinetic'."""
        return 1.0 - self.peaks[law] / self.peaks['kinetic']

    def false_starts(self, law: str) -> int:
        """Return the number of standstills in which the joint moved farther than `FALSE_START`."""
        return int(np.sum(self.standstills[law] > FALSE_START))

    def as_dict(self) -> dict[str, Any]:
        """Return the configuration's entry of results.json."""
        return {
            'breakaway': {
                **{f'{side}_{figure}': getattr(self.breakaway, f'{side}_{figure}')
                   for side in ('positive', 'negative') for figure in ('mean', 'std')},
                'cycles': int(np.sum(self.ramps.records.direction > 0))},
            'sigmoid': list(self.model.sigmoid.coefficients()),
            'sigmoid_error': self.table.sigmoid_error,
            'speeds': [point.speed for point in self.table.points],
            'currents': [point.current for point in self.table.points],
            'peak_torque': self.peaks,
            'peak_reduction': {law: self.reduction(law) for law in LAWS},
            'false_starts': {law: self.false_starts(law) for law in LAWS}}


def run_experiment(experiment: Experiment, table: Callable[[], tuple[IdentificationResult, float]],
                   cycles: int, seed: int, report: Callable[[float, str], None]
                   ) -> ExperimentOutcome:
    """Run all experiments except the look-up table, which `table` gets from another process."""
    report(0.0, 'current ramps')
    ramps = identify_breakaway(experiment, cycles, seed)
    report(0.15, 'look-up table')
    result, table_time = table()
    model = identified_model(experiment, result, ramps)
    report(0.3, 'trials')
    trials = {name: run_trial(experiment, model, name, seed) for name in CONDITIONS}
    standstills = {}
    for k, law in enumerate(LAWS):
        report(0.5 + 0.25 * k, f'standstill, {law} law')
        standstills[law] = stand_still(experiment, model, law, seed)
    report(1.0, 'done')
    return ExperimentOutcome(experiment, result, ramps, model, trials, standstills,
                             table_time + ramps.duration)


def run_experiments(cycles: int, seed: int,
                    report: Callable[[float, str], None]) -> list[ExperimentOutcome]:
    """Run the experiments of every configuration, with `cycles` current ramps per direction.

    Look-up tables are measured sample by sample in a separate process, all else runs compiled and
    in parallel. ``report(share, description)`` is called with the progress.
    """
    outcomes = []
    with child_process() as pool:
        tables = [pool.submit(identify_table, experiment, seed) for experiment in EXPERIMENTS]
        for k, experiment in enumerate(EXPERIMENTS):
            def report_part(share: float, what: str, k: int = k,
                            number: int = experiment.number) -> None:
                report((k + share) / len(EXPERIMENTS), f'configuration {number}: {what}')

            outcomes.append(run_experiment(experiment, tables[k].result, cycles, seed, report_part))
    return outcomes
