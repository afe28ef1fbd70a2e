# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of any number, length and joints, evaluated one stretch after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from friction_comp.errors import InputError
from friction_comp.evaluation.conditions import (
    evaluate_repetitions,
    Evaluation,
    repetitions_of,
)
from friction_comp.evaluation.repetitions import Repetition
from friction_comp.recordings import (
    find_recordings,
    recorded_joints,
    stream_recording_with_info,
)
from friction_comp.samples import Samples

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel

# s; recordings shorter than two of these are looked at as a whole, of others so much is in memory.
_STRETCH = 300.0


def evaluate_recordings(paths: Sequence[str | Path], joint: str | None = None,
                        friction: FrictionModel | None = None, seconds: float = _STRETCH,
                        progress: Callable[[float], None] | None = None) -> list[Evaluation]:
    """Evaluate recordings, or folders of them, joint by joint.

    Parameters
    ----------
    paths : sequence of path-like
    joint : str, optional
        This joint only; all that are recorded, and move, when omitted.
    friction : FrictionModel, optional
        As for `friction_comp.evaluation.conditions.evaluate`.
    seconds : float
        Length of the stretches that are in memory at once.
    progress : callable, optional
        Called with the share 0..1 that is done.

    Returns
    -------
    list of Evaluation
        One a joint. Of several recordings, those that cannot be used are named in the notes.

    Raises
    ------
    InputError
        If none can be used; the first one's reason.
    """
    found = find_recordings([Path(path) for path in paths])
    joints: dict[str, list[Repetition]] = {}
    notes: dict[str, list[str]] = {}
    models: dict[str, None] = {}
    failures: list[InputError] = []
    for number, path in enumerate(found):
        try:
            wanted: list[str | None] = [joint] if joint is not None else list(
                recorded_joints(path)) or [None]
        except InputError as error:
            failures.append(error)
            continue
        for place, name in enumerate(wanted):
            try:
                measured, known, said, model = _measured(path, name or None, friction, seconds)
            except InputError as error:
                failures.append(error)
                continue
            if progress:
                progress((number + (place + 1) / len(wanted)) / len(found))
            joints.setdefault(known, []).extend(measured)
            notes.setdefault(known, []).extend(said)
            models.update({model: None} if model else {})
    if not joints:
        raise failures[0]
    left_out = [f'left out: {failure}' for failure in failures]
    active = ', '.join(models) or None
    return [evaluate_repetitions(known, joints[known], active, notes[known] + left_out)
            for known in joints]


def _measured(path: Path, joint: str | None, friction: FrictionModel | None,
              seconds: float) -> tuple[list[Repetition], str, list[str], str | None]:
    """Return the repetitions in a recording, the joint's name, what is to be noted, the model."""
    drive = friction.drive if friction is not None else None
    constants = (drive.torque_constant, drive.gear_ratio) if drive is not None else (1.0, 1.0)
    found: list[Repetition] = []
    notes: list[str] = []
    held: Samples | None = None
    info = None
    for part, info in stream_recording_with_info(path, joint, *constants, seconds=seconds):
        notes.extend(text for note in info.notes if (text := f'{path}: {note}') not in notes)
        if len(part):
            held = part if held is None else _joined(held, part)
        whole = not len(part)
        if held is None or not (whole or held.time[-1] - held.time[0] >= 2.0 * seconds):
            continue
        # The last stretch stays to be looked at with what follows: what a movement is, is judged
        # by those around it.
        end = held.time[-1] - (0.0 if whole else seconds)
        closed = [r for r in repetitions_of(held, str(path), info, friction, notes, whole)
                  if whole or r.movement.end < end]
        found.extend(closed)
        held = held.take(held.time >= (closed[-1].movement.end if closed else end))
    assert info is not None
    if not found:
        raise InputError(f'{path}: no movement of joint {info.joint!r} found in it')
    return found, info.joint, notes, info.model


def _joined(first: Samples, second: Samples) -> Samples:
    """Return two stretches as one; a signal that only one has is dropped."""
    joined = Samples.concatenate([first, second])
    return joined.with_(recording=0 * joined.recording)
