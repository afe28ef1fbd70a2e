# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A plain verdict on the whole: trust it, trust it in part, or record again and how."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from friction_comp.refinement.judge.control import Control
from friction_comp.refinement.thresholds import TRUST_LEFT, TRUST_NOISE, TRUST_R2

TRUST, IN_PART, AGAIN = 'trust', 'trust in part', 'record again'


@dataclass
class Verdict:
    """The verdict, its reasons, and how to record what would change it.

    Parameters
    ----------
    word : str
        `TRUST`, `IN_PART` or `AGAIN`.
    reasons, recordings : list of str
    """

    word: str = TRUST
    reasons: list[str] = field(default_factory=list)
    recordings: list[str] = field(default_factory=list)

    def lower(self, word: str, reason: str, recording: str = '') -> None:
        """Make the verdict at most this good, for a reason."""
        order = (TRUST, IN_PART, AGAIN)
        self.word = max(self.word, word, key=order.index)
        self.reasons.append(reason)
        if recording and recording not in self.recordings:
            self.recordings.append(recording)


def verdict_of(report: dict[str, Any], control: Control, no_friction: bool, coarse: str) -> Verdict:
    """Return the verdict on a report.

    Parameters
    ----------
    report : dict
        With `after`, `noise_floor`, `unexplained`, `ambiguous` and `warnings`.
    control : Control
    no_friction : bool
        Whether the current does not resist the motion at all.
    coarse : str
        A sentence where positions are too coarse.
    """
    found = Verdict()
    if control.law:
        found.lower(AGAIN, control.law, 'move the joint over its speeds and accelerations with a '
                    'softer or a position controller, in both directions')
        return found
    if control.sequence:
        found.lower(IN_PART, control.sequence, 'let a controller follow constant speeds, slow to '
                    'fast and back')
    if no_friction:
        found.lower(AGAIN, 'On the whole the current does not resist the motion: the sign of '
                    'effort or position is reversed, something that was not recorded moves the '
                    'joint, or effort holds what a controller asked for (the weight, say) and '
                    'friction is made up for elsewhere.', 'check the signs of effort and position, '
                    'and that effort is measured; record the load, or take it away')
    _by_errors(found, report)
    _by_what_is_open(found, report, coarse)
    if not found.reasons:
        found.reasons.append('On data that were not fitted, what remains is close to the noise '
                             'from sample to sample, and no variable takes a large part in it.')
    return found


def lower_report(report: dict[str, Any], word: str, reason: str, recording: str) -> None:
    """Make the verdict of a finished report at most this good, for a reason."""
    found = Verdict(report['verdict'], list(report['reasons']), list(report['record_again']))
    if found.word == TRUST:
        found.reasons = []
    found.lower(word, reason, recording)
    report.update(verdict=found.word, reasons=found.reasons, record_again=found.recordings)


def _by_errors(found: Verdict, report: dict[str, Any]) -> None:
    after, noise = report['after'], report['noise_floor']
    if after['held_out_r2'] < TRUST_R2 and after['held_out_rmse'] > TRUST_NOISE * noise:
        found.lower(AGAIN, f"Only {100 * max(after['held_out_r2'], 0.0):.0f} % of the current are "
                    'explained on data not fitted: what decides on it is not in the recording.',
                    'record what loads the joint (torque sensor, other joints), or move it without '
                    'load')
    elif after['held_out_rmse'] > TRUST_NOISE * noise:
        times = after['held_out_rmse'] / max(noise, 1e-300)
        found.lower(IN_PART, f'The error is {times:.2g} times the noise: something is not '
                    'explained yet.')


def _by_what_is_open(found: Verdict, report: dict[str, Any], coarse: str) -> None:
    for entry in report['unexplained']:
        if entry['strength'] > TRUST_LEFT:
            found.lower(IN_PART, f"The remaining error goes with {entry['variable']}.")
    for entry in report['ambiguous']:
        found.lower(IN_PART, f"{' or '.join(dict.fromkeys(entry['between']))}: {entry['why']}.",
                    entry['experiment'])
    if coarse:
        found.lower(IN_PART, coarse, 'record the motor-side encoder, or move over a wider range')
    for line in report['warnings']:
        if line.startswith('Other joints moved') and (
                report['after']['held_out_rmse'] > TRUST_NOISE * report['noise_floor']):
            found.lower(IN_PART, line, 'move this joint alone, or give a URDF of the arm (--urdf)')
        if line.startswith('Position changes by'):
            # Every term is written in speed or acceleration: what they are is not known then.
            found.lower(IN_PART, line, 'let one clock stamp position, velocity and current, and '
                        'check the units of velocity')
        if 'one direction' in line or 'Speed hardly' in line:
            found.lower(IN_PART, line, 'move in both directions, at speeds from slow to fast')
