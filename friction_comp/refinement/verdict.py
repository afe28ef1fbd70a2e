# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The verdict on a refined model, which is the grade of its worst finding."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

TRUST, IN_PART, AGAIN = 'trust', 'trust in part', 'record again'
_ORDER = (TRUST, IN_PART, AGAIN)


@dataclass(frozen=True)
class Finding:
    """A fact that a reader should know before using the model.

    Parameters
    ----------
    code : str
        One of the codes of msg_docs/reports.md, for programs.
    text : str
        One sentence, for people.
    grade : str
        The best verdict that this finding allows: `TRUST` for a mere note.
    record : str
        A recording that would settle it; empty where none would.
    """

    code: str
    text: str
    grade: str = TRUST
    record: str = ''


@dataclass
class Verdict:
    """The verdict on a model.

    Parameters
    ----------
    findings : list of Finding
    """

    findings: list[Finding] = field(default_factory=list)

    def add(self, findings: Iterable[Finding]) -> None:
        """Add findings that are not in the list yet."""
        self.findings += [finding for finding in findings if finding not in self.findings]

    @property
    def word(self) -> str:
        """`TRUST`, `IN_PART` or `AGAIN`: the worst grade."""
        return max((finding.grade for finding in self.findings), key=_ORDER.index, default=TRUST)

    def to_dict(self) -> dict[str, Any]:
        """Return the entries of report.json."""
        bad = [finding for finding in self.findings if finding.grade != TRUST]
        bad.sort(key=lambda finding: -_ORDER.index(finding.grade))
        reasons = [finding.text for finding in bad] or [
            'The model predicts long parts of the recording that were not fitted about as well as '
            'those that were, and no variable explains a large part of the remaining error.']
        return {
            'verdict': self.word, 'reasons': reasons,
            'record_again': list(dict.fromkeys(
                finding.record for finding in bad if finding.record)),
            'warnings': [finding.text for finding in self.findings if finding not in bad],
            'findings': [{'code': finding.code, 'grade': finding.grade, 'text': finding.text,
                          'record': finding.record} for finding in self.findings]}
