# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads long or many recordings as averages over a few samples each.

One principle: **memory is set by what a fit can use, not by what was recorded**. What is read is
averaged at once, position, velocity, current, load and temperature over the same samples, so that
what averaging does to one of them it does to all. If that is too much still at the slowest rate,
pieces spread over all recordings are kept.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math
from pathlib import Path

import numpy as np

from friction_comp.columns import Layout
from friction_comp.errors import InputError
from friction_comp.recordings.reader import read_recording_with_info, RecordingInfo
from friction_comp.recordings.scan import AnyPath, find_recordings, Progress
from friction_comp.recordings.stream import stream_recording_with_info
from friction_comp.samples import Samples

# Samples that one fit uses at most: about 600 MB of working memory, and ten times as many as most
# recordings hold.
LIMIT = 400_000
# Hz; averages over a longer time hide what friction does at a reversal.
_SLOWEST_RATE = 100.0
# s of a recording that are read at once, and that are kept or left out together.
_STRETCH, _PIECE = 60.0, 10.0
# s that are read to see how much there is.
_LOOK = 600.0
# Whose multiples are spread evenly over 0 to 1 without a period.
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
# Bytes that a sample takes at least.
_SMALLEST = 10


@dataclass(frozen=True)
class Condensing:
    """How much of recordings is kept.

    Parameters
    ----------
    length : int
        Samples that are averaged.
    share : float
        Of pieces of these averages that are kept.
    """

    length: int = 1
    share: float = 1.0

    def of(self, samples: Samples) -> Samples:
        """Return what is kept of samples."""
        samples = samples.averaged(self.length)
        if self.share >= 1.0 or not len(samples):
            return samples
        piece = np.floor(samples.time / _PIECE) + 7919 * samples.recording
        return samples.take((piece * _GOLDEN) % 1.0 < self.share)

    def __str__(self) -> str:
        kept = f', and {100 * self.share:.2g} % of them kept' if self.share < 1.0 else ''
        return (f'{self.length} samples at a time were averaged{kept}: the recordings are long; '
                'errors are those of the averages')


def condensed(samples: Samples, limit: int) -> Samples:
    """Return averages at 100 Hz or more, about so many of them, from all over a recording.

    Parameters
    ----------
    samples : Samples
        Of one recording.
    limit : int
    """
    length = max(1, round(1.0 / max(samples.sample_time, 1e-9) / _SLOWEST_RATE))
    return Condensing(length, min(1.0, limit * length / max(len(samples), 1))).of(samples)


def read_condensed(paths: AnyPath | Sequence[AnyPath], joint: str | None = None,
                   torque_constant: float = 1.0, gear_ratio: float = 1.0,
                   progress: Progress | None = None, layout: Layout | None = None,
                   limit: int = LIMIT) -> list[tuple[Samples, RecordingInfo]]:
    """Read recordings of one joint, in memory that does not grow with what they hold.

    Parameters
    ----------
    paths, joint, torque_constant, gear_ratio, progress, layout
        As for `read_recording`.
    limit : int
        About how many samples are kept of all recordings together; below, all are, as recorded.

    Returns
    -------
    list of (Samples, RecordingInfo)
        One per recording. Where samples were averaged, the first's notes say so.

    Raises
    ------
    InputError
        As `read_recording`.
    """
    recordings = find_recordings(paths)
    how = _condensing(recordings, joint, layout, limit)
    if how == Condensing():
        return read_recording_with_info(recordings, joint, torque_constant, gear_ratio,
                                        progress=progress, layout=layout)
    results: list[tuple[Samples, RecordingInfo]] = []
    for index, path in enumerate(recordings):
        def report(share: float, index: int = index) -> None:
            if progress:
                progress((index + share) / len(recordings))
        samples, info = _read(how, path, stream_recording_with_info(
            path, joint, torque_constant, gear_ratio, _STRETCH, layout=layout, others=True,
            progress=report))
        if results:
            info.check_joint(results[0][1])
        results.append((samples.with_(recording=np.full(len(samples), index)), info))
    results[0][1].notes.append(str(how))
    return results


def _condensing(recordings: Sequence[Path], joint: str | None, layout: Layout | None, limit: int
                ) -> Condensing:
    """Return how much to keep, from the first stretch of the largest recording."""
    sizes = [_bytes(path) for path in recordings]
    if sum(sizes) < _SMALLEST * limit:
        return Condensing()
    first: list[float] = []
    largest = recordings[int(np.argmax(sizes))]
    stretches = stream_recording_with_info(largest, joint, seconds=_LOOK, layout=layout,
                                           progress=first.append)
    samples, _ = next(stretches)
    rows = len(samples) / max(first[-1], 1e-9) * sum(sizes) / max(sizes)
    most = max(1, round(1.0 / max(samples.sample_time, 1e-9) / _SLOWEST_RATE))
    length = int(np.clip(math.ceil(rows / limit), 1, most))
    return Condensing(length, min(1.0, limit * length / rows))


def _bytes(path: Path) -> int:
    parts = [path] if path.is_file() else [part for part in path.rglob('*') if part.is_file()]
    return sum(part.stat().st_size for part in parts)


def _read(how: Condensing, path: Path, stretches: Iterator[tuple[Samples, RecordingInfo]]
          ) -> tuple[Samples, RecordingInfo]:
    """Return what is kept of one recording."""
    parts: list[Samples] = []
    notes: list[str] = []
    for samples, info in stretches:
        if parts and len(samples):
            samples = _same_turn(samples, parts[-1])
        kept = how.of(samples)
        if len(kept):
            parts.append(kept)
        notes += [note for note in info.notes if note not in notes]
    if not parts:
        raise InputError(f'{path}: holds too little of joint {info.joint!r}')
    info.stamps = info.rows = None
    info.notes = notes
    return Samples.concatenate(parts), info


def _same_turn(samples: Samples, before: Samples) -> Samples:
    """Return samples without a whole turn between them and those before.

    An angle that wraps around is followed within a stretch alone.
    """
    turns = round(float(samples.position[0] - before.position[-1]) / (2.0 * math.pi))
    return samples.with_(position=samples.position - 2.0 * math.pi * turns) if turns else samples
