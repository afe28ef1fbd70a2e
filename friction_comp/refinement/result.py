# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What refinement returns: complete when it is made, and never changed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np

from friction_comp.model.effects import Coverage
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.friction_numbers import FrictionNumbers
from friction_comp.refinement.dependence import Dependence
from friction_comp.samples import Samples
from friction_comp.units import in_own_units

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
    held_out: np.ndarray  # of each part, by a fit to all others
    no_presliding: str = ''  # why the recordings do not show presliding; empty where it is known


@dataclass(frozen=True)
class Errors:
    """The errors of a model, A."""

    model: str
    fit_rmse: float
    held_out_rmse: float
    held_out_max: float
    held_out_r2: float
    worst_part_rmse: float
    standstill_rmse: float | None
    overall_rmse: float
    elsewhere_rmse: float
    elsewhere_motion_rmse: float
    part_rmse: list[float]


@dataclass(frozen=True)
class FoundEffect:
    """An effect that the recordings show."""

    name: str
    variable: str
    held_out_rmse: float  # with it and all effects above it
    chosen: float  # share of the repeated searches, 0..1
    parameters: dict[str, Any]
    intervals: dict[str, Any]
    holds_on_another_day: bool | None  # None of a lag, which belongs to the electronics
    in_words: str
    formula: str
    # Names of other effects that would predict as well: the recording cannot tell which it is.
    instead: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Correlation:
    """Two parameters that the recordings determine together better than each alone."""

    between: list[str]
    correlation: float


@dataclass(frozen=True)
class Question:
    """Two effects that explain the recordings equally well, by the variables they depend on."""

    between: list[str]
    why: str
    experiment: str  # a recording that would decide

    @property
    def variables(self) -> str:
        """The variables in words; both effects may depend on the same one."""
        return ' or '.join(dict.fromkeys(self.between))


@dataclass(frozen=True)
class Finding:
    """A fact that a reader should know before using the model."""

    code: str  # one of those of msg_docs/reports.md, for programs
    text: str  # one sentence, for people
    grade: str = TRUST  # the best verdict that this finding allows: `TRUST` for a mere note
    record: str = ''  # a recording that would settle it; empty if none would


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
    """The report of a refinement: msg_docs/reports.md explains each entry.

    It reads like the mapping that report.json holds, too: ``report['after']['held_out_rmse']``.
    """

    unit: str
    joint: str
    samples: int
    samples_in_motion: int
    samples_clipped: int
    held_out: str
    signal_rms: float
    before: Errors
    after: Errors
    noise_floor: float
    effects: list[FoundEffect]
    friction: FrictionNumbers
    assumed: list[str]
    correlations: list[Correlation]
    unexplained: list[Dependence]
    ambiguous: list[Question]
    thirds: dict[str, float]
    differentiation: dict[str, Any]
    stopped_because: str
    verdict: str
    reasons: list[str]
    record_again: list[str]
    warnings: list[str]
    findings: list[Finding]

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
