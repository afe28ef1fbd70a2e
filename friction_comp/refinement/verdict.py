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


_FINDINGS = {
    'pushes': (
        AGAIN, 'Friction would have to push to explain the current: the current is a '
        "controller's response, something that was not recorded moves the joint, or the sign of "
        'effort or position is reversed.',
        'check the signs of effort and position, and that effort is measured; follow a trajectory '
        'with a softer or a position controller'),
    'explains_nothing': (
        AGAIN, 'Where it was not fitted, the model may be {error:.2g} A off in motion, of '
        '{signal:.2g} A: the current depends on something that is not in the recording.',
        'record what loads the joint (torque sensor, other joints), or move it without load'),
    'explains_part': (
        IN_PART, '{error:.2g} A of {signal:.2g} A remain unexplained.',
        'record what loads the joint (torque sensor, other joints)'),
    'extrapolates': (
        IN_PART, 'A third of the {variable} range that was not fitted is predicted with '
        '{growth:.2g} times the error: the model is only supported where it was fitted.',
        'record more values of {variable}, in another order'),
    'unexplained': (IN_PART, 'The remaining error depends on {variable}: {note}.', ''),
    'ambiguous': (IN_PART, '{variables}: {why}.', '{experiment}'),
    'other_joints': (
        IN_PART, 'Other joints moved too ({joints}), and no URDF gives the torques of their '
        'links: the model may not hold in other postures.',
        'move this joint alone, or give a URDF of the arm (--urdf)'),
    'moves_as_one': (
        AGAIN, 'The position of {joint} follows from those of the other joints: the recording '
        'cannot show on which of them the current depends, and other motion may be predicted much '
        'worse.', 'move the joints independently of each other'),
    'velocity': (
        IN_PART, '{fault}.', 'let one clock stamp position, velocity and current, and check the '
        'units of velocity'),
    'coarse': (
        IN_PART, '{reason}', 'record the motor-side encoder, or move over a wider range'),
    'one_direction': (
        IN_PART, 'Motion was in one direction only: Coulomb friction cannot be distinguished from '
        'an offset.', 'move in both directions'),
    'ceiling': (
        IN_PART, 'The current ends at a limit, {ends}, in {percent:.1f} % of the samples, which '
        'are left out.',
        'raise the limit of current or sensor, or use less acceleration and speed'),
    'no_temperature': (
        TRUST, 'Motor temperature was not recorded: its effect can only show as drift over time.',
        ''),
    'no_load': (
        TRUST, 'No load was recorded: effects of load, and an error of the torque constant, cannot '
        'be seen.', ''),
    'not_seen': (TRUST, '{reason}', ''),
    'short': (
        TRUST, 'The longest recording lasts {duration:.3g} s: warm-up takes minutes and cannot be '
        'seen in full.', ''),
    'written': (
        AGAIN, 'The model as written predicts with an error of {error:.3g} A, but its fit had '
        '{fitted:.3g} A.', '')}

_EXPERIMENTS = {
    ('temperature', 'time'):
        'record the motor once warm from the start, or cool it while it goes on moving',
    ('acceleration', 'history'):
        'record movements of the same speed with several different accelerations, and reversals',
    ('acceleration', 'position'):
        'record the same positions at several accelerations, such as two different tempos',
    ('position', 'velocity'):
        'record the same positions at several speeds and in both directions',
    ('position', 'time'): 'record the same positions early and late, several times over',
    ('time', 'velocity'): 'record the same speeds early and late, in another order',
    ('temperature', 'velocity'): 'record the same speeds cold and warm',
    ('direction', 'velocity'): 'record the same speeds in both directions'}


def finding(code: str, **values: Any) -> Finding:
    """Return a finding with values put into its words."""
    grade, text, record = _FINDINGS[code]
    return Finding(code, text.format(**values), grade, record.format(**values))


def experiment(first: str, second: str) -> str:
    """Return the recording that would distinguish two variables."""
    known = _EXPERIMENTS.get((min(first, second), max(first, second)))
    return known or (f'record motion in which {first} changes while {second} does not, and the '
                     'other way round')


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
