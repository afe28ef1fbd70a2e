# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The verdict on a refined model, which is the grade of its worst finding."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
import re
from typing import Any

TRUST, IN_PART, AGAIN = 'trust', 'trust in part', 'record again'
_ORDER = (AGAIN, IN_PART, TRUST)


@dataclass(frozen=True)
class Finding:
    """A fact that a reader should know before using the model."""

    code: str  # one of those of msg_docs/reports.md, for programs
    text: str  # one sentence, for people
    grade: str = TRUST  # the best verdict that this finding allows: `TRUST` for a mere note
    record: str = ''  # a recording that would settle it; empty where none would


def verdict_of(findings: Iterable[Finding], unit: str = 'A') -> dict[str, Any]:
    """Return the entries of report.json that follow from findings on a model in a unit."""
    found = [replace(finding, text=in_unit(finding.text, unit)) for finding in findings]
    bad = sorted((finding for finding in found if finding.grade != TRUST),
                 key=lambda finding: _ORDER.index(finding.grade))
    reasons = [finding.text for finding in bad] or [
        'The model predicts long parts of the recording that were not fitted about as well as '
        'those that were, and no variable explains a large part of the remaining error.']
    return {
        'verdict': bad[0].grade if bad else TRUST, 'reasons': reasons,
        'record_again': list(dict.fromkeys(finding.record for finding in bad if finding.record)),
        'warnings': [finding.text for finding in found if finding.grade == TRUST],
        'findings': [asdict(finding) for finding in found]}


def in_unit(text: str, unit: str) -> str:
    """Return a sentence about currents with A replaced by the unit of the recording.

    Effects describe themselves in A; a recording may hold torque in N·m or a servo's voltage.
    """
    return text if unit == 'A' else re.sub(r'(?<=\d) A\b', f' {unit}', text)
