# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a report can find, and the verdict, which is the grade of the worst finding."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
import re

from friction_comp.refinement.result import AGAIN, Finding, IN_PART, TRUST, Verdict

CODES = {
    'wrong_sign': 'a sign is reversed', 'not_friction': 'the current is not that of friction',
    'explains_little': 'much is not in the recording',
    'extrapolates': 'other motion is predicted worse',
    'recordings_differ': 'recordings contradict each other',
    'unexplained': 'the error depends on a variable', 'ambiguous': 'two effects explain it',
    'other_joints': 'other joints moved, or stood',
    'little_motion': 'motion or load hardly varied', 'signals': 'signals contradict, or are cut',
    'impossible': 'a number that no drive has', 'not_known': 'what does not show'}
"""Codes of all findings, each with what it says."""

_EXPERIMENTS = {
    ('temperature', 'time'):
        'record the motor once warm from the start, or cool it while it keeps moving',
    ('acceleration', 'history'):
        'record movements of the same speed with several different accelerations, and reversals',
    ('acceleration', 'position'):
        'record the same positions at several accelerations, such as two different tempos',
    ('position', 'velocity'):
        'record the same positions at several speeds and in both directions',
    ('position', 'position'):
        'move over a wider range, at a slow constant speed and in both directions',
    ('history', 'velocity'):
        'record slow constant speeds that last, and reversals without a rest',
    ('velocity', 'velocity'): 'record more constant speeds, slow ones among them',
    ('position', 'time'): 'record the same positions early and late, several times over',
    ('time', 'velocity'): 'record the same speeds early and late, in another order',
    ('acceleration', 'time'): 'record the same tempos early and late, in another order',
    ('temperature', 'velocity'): 'record the same speeds cold and warm',
    ('direction', 'velocity'): 'record the same speeds in both directions'}


def experiment(first: str, second: str) -> str:
    """Return the recording that would distinguish two variables."""
    known = _EXPERIMENTS.get((min(first, second), max(first, second)))
    if first == second:
        return known or f'record a wider range of {first}'
    return known or (f'record motion in which {first} changes while {second} does not, and the '
                     'other way round')


def verdict_of(findings: Iterable[Finding], unit: str = 'A') -> Verdict:
    """Return what follows from findings on a model in a unit."""
    found = [replace(finding, text=in_unit(finding.text, unit)) for finding in findings]
    bad = sorted((finding for finding in found if finding.grade != TRUST),
                 key=lambda finding: (AGAIN, IN_PART).index(finding.grade))
    reasons = [finding.text for finding in bad] or [
        'The model predicts motion of the recording that was not fitted about as well as that '
        'which was, and no variable explains a large part of the remaining error.']
    return Verdict(
        bad[0].grade if bad else TRUST, reasons,
        list(dict.fromkeys(finding.record for finding in bad if finding.record)),
        [finding.text for finding in found if finding.grade == TRUST], found)


def in_unit(text: str, unit: str) -> str:
    """Return a sentence about currents in A with the unit of the recording in its place."""
    return text if unit == 'A' else re.sub(r'(?<=\d) A\b', f' {unit}', text)
