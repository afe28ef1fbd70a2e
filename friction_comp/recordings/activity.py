# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Which law and model a compensator reported while a recording was made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import re
from typing import Any

from rosbags.typesys import get_typestore, Stores

DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
# Nodes that command, in whose diagnostics activity is.
SOURCES = (b'compensator', b'identification')
# ns of a recording within which a compensator that runs has said so: it does every second, in
# which a simulation may have gone on for several.
_FIRST_WORD = 10_000_000_000


@dataclass(frozen=True)
class Activity:
    """What a compensator reported from one moment on.

    Attributes
    ----------
    time : int
        Receive time in ns.
    state : str
        Its lifecycle state, for instance 'active'; '' where it did not say; 'identification' while
        that node moved the joint.
    law, model : str
        Compensation law and model file; '' where it did not say.
    joints : str
        The joints that the files of `model` belong to, in their order; '' where it did not say.
    """

    time: int
    state: str
    law: str
    model: str
    joints: str = ''

    @property
    def models(self) -> dict[str, str]:
        """Model file of each joint; empty where they are not reported."""
        joints, models = self.joints.split(', '), self.model.split(', ')
        return dict(zip(joints, models)) if self.model and len(joints) == len(models) else {}

    def of(self, joint: str) -> Activity:
        """Return the same with the model file of one joint, where several are named."""
        return replace(self, model=self.models.get(joint, self.model))


def from_diagnostics(messages: Sequence[tuple[int, bytes]], begin: int) -> list[Activity]:
    """Return what changed, in order of time.

    A compensator's first word holds for what was just before it, as it repeats itself every second.

    Parameters
    ----------
    messages : sequence of (int, bytes)
        Receive time in ns and serialised DiagnosticArray.
    begin : int
        Receive time in ns of the recording's first message.

    Returns
    -------
    list of Activity
        Each differs from the one before in more than its time.
    """
    store = get_typestore(Stores.ROS2_JAZZY)
    activities: list[Activity] = []
    for time, raw in sorted(messages):
        try:
            message: Any = store.deserialize_cdr(raw, DIAGNOSTICS)
        # A message that breaks off costs itself.
        except Exception:
            continue
        for status in message.status:
            if 'identification' in status.name:
                # It has a phase only while it moves a joint.
                if any(item.key == 'phase' for item in status.values):
                    _note(activities, Activity(time, 'identification', '', ''))
                elif activities and activities[-1].state == 'identification':
                    _note(activities, Activity(time, '', '', ''))
            elif (now := compensator_says(status, time)) is not None:
                _note(activities, now)
    if activities:
        first = activities[0]
        if first.time - begin < _FIRST_WORD and first.state != 'identification':
            activities[0] = replace(first, time=min(first.time, begin))
    return activities


def compensator_says(status: Any, time: int = 0) -> Activity | None:
    """Return a compensator's state from a diagnostic status; None for another node's.

    Parameters
    ----------
    status : diagnostic_msgs/msg/DiagnosticStatus
    time : int
        Receive time in ns.
    """
    if 'compensator' not in f'{status.name} {status.hardware_id}':
        return None
    values = {item.key: item.value for item in status.values}
    model = next((values[key] for key in ('model_file', 'model_files', 'model')
                  if values.get(key, '').strip('[] ')), '')
    # One file a joint comes as a list: its brackets and quotes are no names.
    return Activity(time, values.get('state', ''), values.get('law', ''),
                    re.sub(r"""['"\[\]]""", '', model), status.hardware_id)


def _note(activities: list[Activity], now: Activity) -> None:
    """Add an activity that differs from the one before."""
    if not activities or (activities[-1].state, activities[-1].law, activities[-1].model) != (
            now.state, now.law, now.model):
        activities.append(now)
