# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates any number of recordings of any length and any joints, in bounded memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
import math
from pathlib import Path

from friction_comp.errors import InputError
from friction_comp.evaluation.conditions import Evaluation, MeasuredJoint, repetitions_of
from friction_comp.evaluation.ensemble import LEAD
from friction_comp.layout import Layout
from friction_comp.model.friction_model import FrictionModel
from friction_comp.parallel import Failure, run_each, Runner
from friction_comp.recordings import find_recordings, recorded_joints, stream_recording_with_info
from friction_comp.recordings.sources import without_topic
from friction_comp.samples import Samples

# Length of the stretches in which recordings are read, s; those shorter than two are read whole.
_STRETCH = 300.0


@dataclass(frozen=True)
class Piece:
    """One joint of one recording, or the whole recording where the joint is None."""

    path: Path
    joint: str | None
    layout: Layout | None = None

    def __str__(self) -> str:
        return str(self.path)


def pieces_of(paths: Sequence[str | Path], joint: str | None = None,
              layout: Layout | None = None) -> tuple[list[Piece], list[Failure]]:
    """Return the pieces that can be evaluated, and the reasons why other recordings cannot.

    `paths` are recordings or folders of them, `layout` has the columns of tables.
    """
    pieces: list[Piece] = []
    failures: list[Failure] = []
    found = find_recordings([Path(path) for path in paths])
    for index, path in enumerate(found):
        own = layout and layout.of_recording(index, len(found))
        try:
            names = [joint] if joint is not None else recorded_joints(path, own) or ['']
        except InputError as error:
            failures.append(Failure(str(error)))
            continue
        pieces.extend(Piece(path, name or None, own) for name in names)
    return pieces, failures


def evaluate_recordings(paths: Sequence[str | Path], joint: str | None = None,
                        seconds: float = _STRETCH) -> list[Evaluation]:
    """Evaluate recordings, or folders of them, by `pieces_of` and `evaluate_pieces`."""
    return evaluate_pieces(*pieces_of(paths, joint), seconds=seconds)


def evaluate_pieces(pieces: Sequence[Piece], failures: Sequence[Failure] = (),
                    model: str | Path | None = None, seconds: float = _STRETCH,
                    progress: Callable[[float], None] | None = None,
                    run: Runner = run_each) -> list[Evaluation]:
    """Evaluate pieces; return one evaluation for each joint, whatever the order of the pieces.

    Recordings of `failures`, and those that cannot be used, are named in the notes. `model` is the
    file of one joint or of an arm, for the missing current (see `conditions.evaluate`); pieces of
    joints that it does not hold are left out. Recordings are read in stretches of so many
    `seconds`; `progress` is called with the share 0..1 that is done; `run` does the work, here or
    in several processes. Raises InputError if no recording can be used, with the first one's
    reason.
    """
    joints: dict[str, MeasuredJoint] = {}
    left_out = list(failures)
    work = partial(_measure_piece, model=model, seconds=seconds)
    for outcome in _in_order(run(work, pieces) if pieces else (), len(pieces), progress):
        if isinstance(outcome, Failure):
            left_out.append(outcome)
        else:
            joints.setdefault(outcome.joint, MeasuredJoint(outcome.joint)).merge(outcome)
    if not joints:
        raise InputError(left_out[0].reason)
    active = ', '.join(dict.fromkeys(
        model for measured in joints.values() for model in measured.models)) or None
    for measured in joints.values():
        measured.notes += [f'left out: {failure.reason}' for failure in left_out]
    return [measured.evaluate(active) for measured in joints.values()]


def _in_order(outcomes: Iterable[tuple[int, MeasuredJoint | Failure]], count: int,
              progress: Callable[[float], None] | None) -> Iterator[MeasuredJoint | Failure]:
    """Yield outcomes in the order of the pieces, so that sums do not depend on the processes."""
    waiting: dict[int, MeasuredJoint | Failure] = {}
    done = following = 0
    for index, outcome in outcomes:
        waiting[index], done = outcome, done + 1
        if progress:
            progress(done / count)
        while following in waiting:
            yield waiting.pop(following)
            following += 1


def _measure_piece(piece: Piece, model: str | Path | None, seconds: float) -> MeasuredJoint:
    path, friction = piece.path, None
    if model is not None:
        name = without_topic(path, piece.joint)
        friction = FrictionModel.load(model, name)
        friction.check_joint(name, model)
    gain = 1.0 if friction is None else friction.drive.torque_per_current
    measured = MeasuredJoint('')
    notes = measured.notes
    buffer: Samples | None = None
    cut = -math.inf     # end of the last movement measured
    for part, info in stream_recording_with_info(
            path, piece.joint, gain, seconds, layout=piece.layout):
        notes.extend(text for note in info.notes if (text := f'{path}: {note}') not in notes)
        at_end = not len(part)
        if not at_end:
            # `concatenate` keeps the signals that all have, and numbers them as several recordings.
            buffer = part if buffer is None else Samples.concatenate([buffer, part])
            buffer = buffer.with_(recording=0 * buffer.recording)
        if buffer is None or len(buffer) < 2 or not (
                at_end or buffer.time[-1] - buffer.time[0] >= 2.0 * seconds):
            continue
        # The last stretch is evaluated again with the next: movements are compared with neighbours.
        end = buffer.time[-1] - (0.0 if at_end else seconds)
        # A movement that begins before the cut is the slow end of the last one.
        found = [r for r in repetitions_of(buffer, str(path), info, friction, notes, at_end)
                 if r.movement.begin > cut]
        finished = [r for r in found if at_end or r.movement.end < end]
        if friction is None:
            for repetition in finished:
                # Without a drive, effort in N·m is not known as a current.
                repetition.figures.pop('rms_current', None)
        measured.add_repetitions(finished)
        if finished:
            cut = first = finished[-1].movement.end
        else:
            first = min([end, *(r.movement.begin - LEAD for r in found)])
        buffer = buffer.take(buffer.time >= first)
    if not measured.repetitions:
        raise InputError(f'{path}: no movement of joint {info.joint!r} found in it')
    # Joints of one name in several topics are different drives.
    measured.joint = piece.joint or info.joint
    measured.models = [info.model] if info.model else []
    return measured
