# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads long or many recordings in limited memory, by averaging a few samples at a time.

All signals are averaged over the same samples, so that they are filtered alike. If there are still
too many averages at the lowest rate, only pieces spread evenly over all recordings are kept.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math
from pathlib import Path

import numpy as np

from friction_comp.errors import InputError
from friction_comp.recordings.joint_samples import number_recordings
from friction_comp.recordings.reader import read_recording_with_info, stream_recording_with_info
from friction_comp.recordings.sources import find_recordings, part_of, Progress, size_of
from friction_comp.recordings.storage import AnyPath
from friction_comp.samples import RecordingInfo, Samples
from friction_comp.statistics import evenly_spread
from friction_comp.tables.columns import Layout

# Most samples of one fit: about 600 MB of working memory, ten times the size of most recordings.
LIMIT = 400_000
# Lowest rate of averages, Hz: averages over a longer time hide friction at a reversal.
_SLOWEST_RATE = 100.0
# Length of a stretch that is read at once, and of a piece that is kept or omitted, s.
_STRETCH, _PIECE = 60.0, 10.0
# Length that is read to estimate the number of samples, s.
_PROBE = 600.0
# Smallest size of a sample in a file, bytes.
_LEAST_SAMPLE_SIZE = 10


@dataclass(frozen=True)
class Averaging:
    """Averaging over `length` samples at a time, after which a share of all pieces is kept."""

    length: int = 1
    share: float = 1.0

    def apply(self, samples: Samples) -> Samples:
        """Return the averages of samples that are kept."""
        samples = samples.averaged(self.length)
        if self.share >= 1.0 or not len(samples):
            return samples
        piece = np.floor(samples.time / _PIECE) + 7919 * samples.recording
        return samples.take(evenly_spread(piece) < self.share)

    def __str__(self) -> str:
        share = f'{100 * self.share:.3g} %'
        if self.length == 1:
            return f'the recordings are long: {share} of their samples were kept'
        kept = f', and {share} of them kept' if self.share < 1.0 else ''
        return (f'{self.length} samples at a time were averaged{kept}: the recordings are long; '
                'errors are those of the averages')


def condensed(samples: Samples, limit: int) -> Samples:
    """Return averages of a recording at about 100 Hz, of which at most about `limit` are kept."""
    length = _longest_average(samples)
    return Averaging(length, min(1.0, limit * length / max(len(samples), 1))).apply(samples)


def _longest_average(samples: Samples) -> int:
    return max(1, round(1.0 / max(samples.sample_time, 1e-9) / _SLOWEST_RATE))


def read_condensed(paths: AnyPath | Sequence[AnyPath], joint: str | None = None,
                   torque_per_current: float = 1.0, progress: Progress | None = None,
                   layout: Layout | None = None, limit: int = LIMIT
                   ) -> list[tuple[Samples, RecordingInfo]]:
    """Read recordings of one joint as `read_recording_with_info` does, in limited memory.

    More than about `limit` samples of all recordings together are averaged, and a note says so.
    """
    recordings = find_recordings(paths)
    averaging = _choose_averaging(recordings, joint, layout, limit)
    if averaging == Averaging():
        return read_recording_with_info(recordings, joint, torque_per_current, progress, layout)
    read = number_recordings(_read(averaging, path, stream_recording_with_info(
        path, joint, torque_per_current, _STRETCH, part_of(progress, index, len(recordings)),
        layout and layout.of_recording(index, len(recordings)), others=True))
        for index, path in enumerate(recordings))
    read[0][1].notes.append(str(averaging))
    return read


def _choose_averaging(recordings: Sequence[Path], joint: str | None, layout: Layout | None,
                      limit: int) -> Averaging:
    """Return the averaging for about `limit` samples, by how the largest recording begins."""
    sizes = [size_of(path) for path in recordings]
    if sum(sizes) < _LEAST_SAMPLE_SIZE * limit:
        return Averaging()
    shares_read: list[float] = []
    index = int(np.argmax(sizes))
    samples, _ = next(stream_recording_with_info(
        recordings[index], joint, seconds=_PROBE, progress=shares_read.append,
        layout=layout and layout.of_recording(index, len(recordings))))
    in_largest = len(samples) / max(shares_read[-1], 1e-9)
    total = in_largest * sum(sizes) / max(sizes)
    length = int(np.clip(math.ceil(total / limit), 1, _longest_average(samples)))
    return Averaging(length, min(1.0, limit * length / total))


def _read(averaging: Averaging, path: Path, stretches: Iterator[tuple[Samples, RecordingInfo]]
          ) -> tuple[Samples, RecordingInfo]:
    """Return the averages of one recording, read in stretches."""
    parts: list[Samples] = []
    notes: list[str] = []
    for samples, info in stretches:
        kept = averaging.apply(samples)
        if len(kept):
            parts.append(kept)
        notes += [note for note in info.notes if note not in notes]
    if not parts:
        raise InputError(f'{path}: has too few samples of joint {info.joint!r}')
    info.stamps = info.rows = None
    info.notes = notes
    return Samples.concatenate(parts), info
