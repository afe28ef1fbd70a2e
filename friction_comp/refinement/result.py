# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What refinement returns: complete when it is made, and never changed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np

from friction_comp.model.effect import Coverage
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.friction_numbers import FrictionNumbers
from friction_comp.samples import Samples
from friction_comp.terminal import in_own_units

TRUST, IN_PART, AGAIN = 'trust', 'trust in part', 'record again'


@dataclass(frozen=True)
class Origin:
    """What is known of recordings beside their samples."""

    unit: str = ''  # of `Samples.current`; A if the drive is declared, else N·m where it is empty
    # Whether torque constant and gear ratio are known; those of a given drive are by default.
    declared: bool | None = None
    warnings: Sequence[str] = ()  # for the reader of the report
    assumed: Sequence[str] = ()  # what the numbers rest on and no recording tells
    notes: Mapping[str, Any] = field(default_factory=dict)  # for the model file


@dataclass(frozen=True)
class Predicted:
    """A model and its residuals of all samples, A, each (N,)."""

    model: FrictionModel
    own: np.ndarray  # of the model itself
    held_out: np.ndarray  # of each regime of motion, by a fit to all others
    no_presliding: str = ''  # why the recordings do not show presliding; empty where it is known


@dataclass(frozen=True)
class Errors:
    """The errors of a model, A."""

    model: str  # names of its parts
    fit_rmse: float  # RMS in motion, as written, by `predict` on the recording
    held_out_rmse: float  # RMS in motion, each regime predicted by a fit to all others
    held_out_max: float  # largest
    held_out_r2: float  # share of the variance that is explained
    worst_part_rmse: float  # of the regime with the largest error
    standstill_rmse: float | None  # at and near standstill; null if there is none
    elsewhere_rmse: float  # to expect on another recording, with standstill
    elsewhere_motion_rmse: float  # the same in motion only


@dataclass(frozen=True)
class FoundEffect:
    """An effect that the recordings show."""

    name: str  # that in the model file
    variable: str  # what it depends on
    held_out_rmse: float  # with it and all effects above it
    chosen: float  # share of regimes predicted better with it, 0..1
    parameters: dict[str, Any]  # as in the model file
    intervals: dict[str, Any]  # 95 %, of the same names
    holds_on_another_day: bool | None  # false if it is this recording's alone; none of a lag
    in_words: str  # for readers
    formula: str  # the same as a formula
    # Other effects that predict as well.
    instead: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Question:
    """Two effects that explain the recordings equally well, by the variables they depend on."""

    between: list[str]  # the variables that they depend on
    why: str  # in words
    experiment: str  # a recording that would decide

    @property
    def variables(self) -> str:
        """The variables in words; both effects may depend on the same one."""
        return ' or '.join(dict.fromkeys(self.between))


@dataclass(frozen=True)
class Finding:
    """A fact that a reader should know before using the model."""

    code: str  # one of those of docs/reports.md, for programs
    text: str  # one sentence, for people
    grade: str = TRUST  # the best verdict that this finding allows: `TRUST` for a mere note
    record: str = ''  # a recording that would settle it; empty if none would


@dataclass(frozen=True)
class Dependence:
    """A variable on which the residual depends."""

    variable: str
    strength: float  # share of the residual's variance that it explains, 0..1, beyond chance
    note: str


@dataclass(frozen=True)
class Verdict:
    """How far a model can be trusted, and why."""

    verdict: str
    reasons: list[str]
    record_again: list[str]
    warnings: list[str]
    findings: list[Finding]


@dataclass(frozen=True)
class RefinementReport(Mapping[str, Any]):
    """The report of a refinement: docs/reports.md explains each entry.

    It reads like the mapping that report.json holds, too: ``report['after']['held_out_rmse']``.
    """

    unit: str  # of all figures
    joint: str  # its name
    samples: int  # rows read
    samples_in_motion: int  # rows that are fitted
    samples_clipped: int  # rows at a limit of the current
    held_out: str  # how fitted and held-out data were split
    signal_rms: float  # RMS of the current in motion
    before: Errors  # of the model given, or of the friction curve alone
    after: Errors  # of the refined model
    noise_floor: float  # standard deviation of the white noise in the residual
    effects: list[FoundEffect]  # those found, in the order in which they lower the error
    friction: FrictionNumbers  # the numbers of a sliding joint
    assumed: list[str]  # columns of a table without a unit, with the one taken for granted
    unexplained: list[Dependence]  # variables on which the residual still depends
    ambiguous: list[Question]  # effects that the recording cannot tell apart
    differentiation: dict[str, Any]  # how velocity and acceleration were computed
    stopped_because: str  # why the search ended
    verdict: str  # trust, trust in part, or record again: the worst grade of the findings
    reasons: list[str]  # texts of the findings that lower the verdict
    record_again: list[str]  # what to record instead
    warnings: list[str]  # texts of the other findings, and notes on the recordings
    findings: list[Finding]  # all that a reader should know

    def content(self) -> dict[str, Any]:
        """Return the content of report.json."""
        content = asdict(self)
        for effect in content['effects']:
            if effect['holds_on_another_day'] is None:
                del effect['holds_on_another_day']
        return content

    def __getitem__(self, name: str) -> Any:
        return self.content()[name]

    def __iter__(self) -> Iterator[str]:
        return (one.name for one in fields(self))

    def __len__(self) -> int:
        return len(fields(self))


@dataclass(frozen=True, repr=False)
class RefineResult:
    """The result of refinement."""

    report: RefinementReport
    model: FrictionModel  # the refined model, fitted to all usable samples
    start: FrictionModel  # the initial model
    samples: Samples  # all, with velocity and acceleration
    usable: np.ndarray  # (N,): which samples are in motion and fitted
    # (N,): residual of parts that were not fitted, by the initial and by the refined model, A.
    before: np.ndarray
    after: np.ndarray
    coverage: Coverage  # the ranges that the recordings cover

    def content(self) -> dict[str, Any]:
        """Return the content of report.json, that of a linear axis in m and N."""
        return in_own_units(self.report.content(), self.model.is_linear)

    def __repr__(self) -> str:
        """Return verdict, numbers and errors, not the samples, as shown at a prompt."""
        report = self.report
        return (f'<RefineResult: {report.verdict}\n{report.friction.formula}\n'
                f'{report.before.held_out_rmse:.3g} → {report.after.held_out_rmse:.3g} '
                f'{report.unit} RMS on data not fitted ({report.after.model})>')
