# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates any number of recordings of any length and any joints, stretch by stretch."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from friction_comp.attempts import Failure, in_turn, Runner
from friction_comp.columns import Layout
from friction_comp.errors import InputError
from friction_comp.evaluation.conditions import (
    Averages,
    evaluate_repetitions,
    Evaluation,
    repetitions_of,
    sum_up,
)
from friction_comp.evaluation.ensemble import Ensemble
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


@dataclass(frozen=True)
class Piece:
    """One joint of one recording, or the whole recording where the joint is None."""

    path: Path
    joint: str | None
    layout: Layout | None = None

    def __str__(self) -> str:
        return str(self.path)


@dataclass
class Measured:
    """What was measured of a piece."""

    joint: str
    repetitions: list[Repetition] = field(default_factory=list)
    averages: Averages = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    models: list[str] = field(default_factory=list)

    def add(self, other: Measured) -> None:
        """Take in what was measured of another piece of the same joint."""
        self.repetitions += other.repetitions
        for kind, ensemble in other.averages.items():
            self.averages.setdefault(kind, Ensemble()).add(ensemble)
        self.notes += other.notes
        self.models += other.models


def pieces_of(paths: Sequence[str | Path], joint: str | None = None,
              layout: Layout | None = None) -> tuple[list[Piece], list[Failure]]:
    """Return the pieces that can be evaluated, and why some recordings cannot.

    Parameters
    ----------
    paths : sequence of path-like
        Recordings, or folders of them.
    joint : str, optional
        This joint only.
    layout : Layout, optional
        What is known of a table's columns.

    Raises
    ------
    InputError
        If a path holds no recording.
    """
    pieces: list[Piece] = []
    failures: list[Failure] = []
    for path in find_recordings([Path(path) for path in paths]):
        try:
            names: list[str | None] = [joint] if joint is not None else [
                *recorded_joints(path, layout)] or [None]
        except InputError as error:
            failures.append(Failure(str(error)))
            continue
        pieces.extend(Piece(path, name or None, layout) for name in names)
    return pieces, failures


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
    pieces, failures = pieces_of(paths, joint)
    return evaluate_pieces(pieces, failures, friction, seconds, progress)


def evaluate_pieces(pieces: Sequence[Piece], failures: Sequence[Failure] = (),
                    friction: FrictionModel | None = None, seconds: float = _STRETCH,
                    progress: Callable[[float], None] | None = None,
                    run: Runner = in_turn) -> list[Evaluation]:
    """Evaluate pieces; the result does not depend on their order.

    Parameters
    ----------
    pieces : sequence of Piece
    failures : sequence of Failure
        Recordings that are left out already.
    friction, seconds, progress
        As for `evaluate_recordings`.
    run : callable
        Does the work: here, or in many processes.

    Returns
    -------
    list of Evaluation

    Raises
    ------
    InputError
        If nothing can be used; the first reason.
    """
    joints: dict[str, Measured] = {}
    left_out = list(failures)
    work = partial(_measured, friction=friction, seconds=seconds)
    for outcome in _in_order(run(work, pieces) if pieces else (), len(pieces), progress):
        if isinstance(outcome, Failure):
            left_out.append(outcome)
        else:
            joints.setdefault(outcome.joint, Measured(outcome.joint)).add(outcome)
    if not joints:
        raise InputError(left_out[0].reason)
    said = [f'left out: {failure.reason}' for failure in left_out]
    active = ', '.join(dict.fromkeys(
        model for found in joints.values() for model in found.models)) or None
    return [evaluate_repetitions(
        name, found.repetitions, found.averages, active, found.notes + said)
        for name, found in joints.items()]


def _in_order(outcomes: Iterable[tuple[int, Measured | Failure]], count: int,
              progress: Callable[[float], None] | None) -> Iterator[Measured | Failure]:
    """Yield outcomes in the order of the pieces: sums are the same however the work is shared."""
    waiting: dict[int, Measured | Failure] = {}
    done = due = 0
    for index, outcome in outcomes:
        waiting[index], done = outcome, done + 1
        if progress:
            progress(done / count)
        while due in waiting:
            yield waiting.pop(due)
            due += 1
    # Behind one that never came, where the work was broken off.
    for index in sorted(waiting):
        yield waiting[index]


def _measured(piece: Piece, friction: FrictionModel | None, seconds: float) -> Measured:
    """Measure the repetitions of a piece."""
    path, joint = piece.path, piece.joint
    drive = friction.drive if friction is not None else None
    constants = (drive.torque_constant, drive.gear_ratio) if drive is not None else (1.0, 1.0)
    repetitions: list[Repetition] = []
    averages: Averages = {}
    notes: list[str] = []
    held: Samples | None = None
    info = None
    for part, info in stream_recording_with_info(
            path, joint, *constants, seconds=seconds, layout=piece.layout):
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
        sum_up(closed, averages)
        repetitions.extend(closed)
        held = held.take(held.time >= (closed[-1].movement.end if closed else end))
    assert info is not None
    if not repetitions:
        raise InputError(f'{path}: no movement of joint {info.joint!r} found in it')
    return Measured(info.joint, repetitions, averages, notes, [info.model] if info.model else [])


def _joined(first: Samples, second: Samples) -> Samples:
    """Return two stretches as one; a signal that only one has is dropped."""
    joined = Samples.concatenate([first, second])
    return joined.with_(recording=0 * joined.recording)
