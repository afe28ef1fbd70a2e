# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The verdict on a refined model: that of the worst of its findings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

TRUST, IN_PART, AGAIN = 'trust', 'trust in part', 'record again'
_ORDER = (TRUST, IN_PART, AGAIN)


@dataclass(frozen=True)
class Finding:
    """Something that a reader should know before using the model.

    Parameters
    ----------
    code : str
        For programs; one of the codes of msg_docs/refine_report.md.
    text : str
        One sentence, for people.
    grade : str
        How good the verdict can be with it: `TRUST` for a mere note.
    record : str
        What recording would change it; empty where none would.
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
        """Add findings whose code is not there with the same text."""
        self.findings += [one for one in findings if one not in self.findings]

    @property
    def word(self) -> str:
        """`TRUST`, `IN_PART` or `AGAIN`: the worst grade."""
        return max((one.grade for one in self.findings), key=_ORDER.index, default=TRUST)

    def to_dict(self) -> dict[str, Any]:
        """Return the entries of report.json."""
        bad = [one for one in self.findings if one.grade != TRUST]
        bad.sort(key=lambda one: -_ORDER.index(one.grade))
        reasons = [one.text for one in bad] or [
            'On long parts of the recording that were not fitted the model predicts about as well '
            'as where it was fitted, and no variable explains a large part of what remains.']
        return {
            'verdict': self.word, 'reasons': reasons,
            'record_again': list(dict.fromkeys(one.record for one in bad if one.record)),
            'warnings': [one.text for one in self.findings if one not in bad],
            'findings': [{'code': one.code, 'grade': one.grade, 'text': one.text,
                          'record': one.record} for one in self.findings]}
