# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the law and model that a compensator reported during a recording."""

from __future__ import annotations

from dataclasses import dataclass, replace
import re
from typing import Any

DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
# A compensator that runs from the beginning of a recording reports within this time, ns. It reports
# every second of real time, in which a simulation may advance by several.
_FIRST_REPORT = 10_000_000_000


@dataclass(frozen=True)
class Activity:
    """What a compensator reported, valid from `time` on; '' if not reported."""

    time: int           # received at, ns
    state: str          # its lifecycle state; 'identification' while that node moved the joint
    law: str
    model: str          # model files
    joints: str = ''    # joints of the model files, in the same order
    settings: str = ''  # of the law, where they are not the defaults

    @property
    def models(self) -> dict[str, str]:
        """Model file of each joint; empty if they were not reported."""
        joints, models = self.joints.split(', '), self.model.split(', ')
        return dict(zip(joints, models)) if self.model and len(joints) == len(models) else {}

    def of(self, joint: str) -> Activity:
        """Return the activity with only the model file of one joint, where several are listed."""
        return replace(self, model=self.models.get(joint, self.model))


class ActivityLog:
    """Collects the changes of activity from diagnostics, in the order they were received."""

    def __init__(self) -> None:
        self.changes: list[Activity] = []

    def add(self, time: int, message: Any, begin: int) -> None:
        """Add a DiagnosticArray received at `time`, ns.

        A compensator's first report also applies to the time before it, back to `begin`, ns.
        """
        before = len(self.changes)
        for status in message.status:
            last = self.changes[-1] if self.changes else None
            activity = _activity_of(status, time, last)
            if activity and (last is None or replace(
                    activity, time=last.time, joints=last.joints) != last):
                self.changes.append(activity)
        if not before and self.changes:
            first = self.changes[0]
            if first.time - begin < _FIRST_REPORT and first.state != 'identification':
                self.changes[0] = replace(first, time=min(first.time, begin))


def _activity_of(status: Any, time: int, last: Activity | None) -> Activity | None:
    """Return what a DiagnosticStatus of a compensator or of identification says, else None."""
    values = {item.key: item.value for item in status.values}
    if 'identification' in status.name:
        # The node reports a phase only while it moves a joint.
        if 'phase' in values:
            return Activity(time, 'identification', '', '', status.hardware_id)
        return Activity(time, '', '', '') if last and last.state == 'identification' else None
    if 'compensator' not in f'{status.name} {status.hardware_id}':
        return None
    # One file per joint is reported as a list: remove its brackets and quotes.
    model = re.sub(r"""['"\[\]]""", '', values.get('model_files', ''))
    return Activity(time, values.get('state', ''), values.get('law', ''), model, status.hardware_id,
                    values.get('settings', ''))
