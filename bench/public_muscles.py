#!/usr/bin/env python3
# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Onsets in public recordings of forearm muscles: found, missed, late, without cause.

The folder is a copy of one of two sets of bracelets of eight channels, 8 bit:

- aljazfrancic/myo-readings-dataset: 200 samples per second; five seconds of rest and five of a
  wrist's flexion or extension in turn.
- EMG_data of cechava/EMG_gestures (Lobov et al. 2018): a fist, flexion, extension and other
  gestures, three seconds each. Half of the samples were lost on the way, at irregular times, so
  that only envelopes can be had of them. A label begins after the onset that it belongs to.

Two of the channels are used, chosen on the first flexion and extension. Nobody recorded the wrist:
it is taken to move 0.6 s after the muscle, as a joint does that friction holds, and back when the
muscle lets go.

The truth is found with the whole recording: when the smoothed energy of both channels passes 15 %
of the contraction's for 0.15 s. What is announced where no label asks for a movement is `unasked`;
`without cause` is what is announced while both muscles are quiet: less than three times as large as
in the quietest fifth of the recording. The simplest rival knows the onset, waits for 0.6 s and
tells the `stronger` muscle.
"""

import argparse
from pathlib import Path
from typing import NamedTuple

# Importing it lets the package beside this folder be used, not one that is installed.
from bench_tools import ROOT  # noqa: F401
import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, sosfilt, sosfiltfilt

from friction_comp.direction.sensed_direction import CALIBRATION_TIME, SensedDirection
from friction_comp.errors import InputError

RATE = 200.0
# s of the muscle before the joint moves, and of that movement, rad.
DELAY, DURATION, TRAVEL = 0.6, 0.5, 0.6
# s about an onset, before and after it.
BEFORE, AFTER = 0.1, 0.6
HIGH_PASS = butter(2, 20.0, 'high', fs=RATE, output='sos')
# Labels: the movements are 1 and -1, rest is 0.
OTHER = 9


class Recording(NamedTuple):
    """Values and labels of two muscles.

    `calibrated` is the first and the last sample of the calibration; `calm` is where a person who
    does as told rests; labels are `trimmed` where they begin after the onset, not before.
    """

    values: np.ndarray
    labels: np.ndarray
    calibrated: tuple[int, int]
    calm: np.ndarray
    trimmed: bool


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('--every', type=int, help='of so many sessions or people, one is used')
    parser.add_argument('--first', type=int, default=0)
    parser.add_argument('--kind', choices=('muscle_raw', 'muscle_envelope'))
    options = parser.parse_args()
    read, every, kind = read_pair, 8, 'muscle_raw'
    sessions = sorted(path.parent for path in options.folder.glob('_readings_right*/*/1.txt'))
    if not sessions:
        read, every, kind = read_gestures, 2, 'muscle_envelope'
        sessions = sorted(path for path in options.folder.glob('[0-9]*') if path.is_dir())
    counts, delays = dict.fromkeys(
        ('onsets', 'found', 'other muscle', 'missed', 'stronger', 'refused', 'unasked',
         'without cause'), 0), []
    rest = 0.0
    for session in sessions[options.first::options.every or every]:
        for recording in read(session):
            rest += judge(recording, options.kind or kind, counts, delays)
        print(session.name, counts, flush=True)
    if delays:
        print(f'{rest:.0f} s quiet; delay {1e3 * np.median(delays):.0f} ms (median)')


def read_pair(session):
    """Return the recordings of both movements in a session; none if they are unusable."""
    try:
        tables = [np.loadtxt(session / f'{movement}.txt', delimiter=',') for movement in (1, 2)]
    except ValueError:
        return []
    if any(stretches(table[:, 8])[0][2] for table in tables):
        return []
    for table, side in zip(tables, (1, -1)):
        table[:, 8] = side * (table[:, 8] != 0)
    own, found = chosen(tables), []
    for table in tables:
        calm = np.zeros(len(table), dtype=bool)
        for begin, end, label in stretches(table[:, 8]):
            calm[begin + 300:end - 150] = not label and end - begin > 600
        found.append(Recording(table[:, own], table[:, 8], (
            round(0.5 * RATE), round((0.6 + CALIBRATION_TIME) * RATE)), calm, False))
    return found


def read_gestures(person):
    """Return the recordings of a person; each value is held until the next one."""
    found = []
    for path in sorted(person.glob('*.txt')):
        table = np.genfromtxt(path, skip_header=1, invalid_raise=False)
        at = np.searchsorted(table[:, 0], np.arange(table[0, 0], table[-1, 0], 1e3 / RATE))
        labels = np.array([OTHER, 0, OTHER, 1, -1, OTHER, OTHER, OTHER])[table[at, 9].astype(int)]
        if {0, 1, -1} <= {*labels.tolist()}:
            values = np.column_stack([1e5 * table[at, 1:9], labels])
            begin = np.flatnonzero(labels == 0)[0]
            rest = begin + np.flatnonzero(labels[begin:])[0]
            found.append(Recording(values[:, chosen([values, values])], labels, (
                round(0.2 * RATE), rest), labels == 0, True))
    return found


def chosen(tables):
    """Return the channels of flexor and extensor, from tables with movements 1 and -1."""
    power = []
    for table, side in zip(tables, (1, -1)):
        begin, end = next((b, e) for b, e, label in stretches(table[:, 8]) if label == side)
        begin += min(200, (end - begin) // 2)
        power.append(np.std(sosfiltfilt(HIGH_PASS, table[:, :8], axis=0)[begin:end], axis=0))
    return [int(np.argmax(a / b * (a > 0.3 * a.max()))) for a, b in (power, power[::-1])]


def stretches(labels):
    """Return begin, end and label of each stretch of equal labels."""
    cuts = [0, *(np.flatnonzero(np.diff(labels)) + 1).tolist(), len(labels)]
    return [(b, e, labels[b]) for b, e in zip(cuts[:-1], cuts[1:])]


def contractions(recording):
    """Return first and last sample and side of each movement, where none is asked, and quiet."""
    labels = recording.labels
    # Of movements one after the other, a label's onset is the last before it.
    before, after = (700, 0) if recording.trimmed else (150, 250)
    energies = np.sqrt(uniform_filter1d(
        sosfiltfilt(HIGH_PASS, recording.values, axis=0)**2, 10, axis=0))
    energy = np.sqrt(np.mean(energies**2, axis=1))
    calm = energy[recording.calm]
    level, scatter = np.median(calm), np.percentile(calm, 84) - np.median(calm)
    found = []
    for begin, end, label in stretches(labels):
        strength = np.percentile(energy[begin:end], 70) - level
        if label not in (1, -1) or begin < before or strength < 6.0 * scatter:
            continue
        active = energy > level + max(0.15 * strength, 4.0 * scatter)
        lasting = [uniform_filter1d(flags.astype(float), 30, origin=-15) > 0.9
                   for flags in (active, ~active)]
        on = np.flatnonzero(lasting[0][begin - before:begin + after])
        if recording.trimmed:
            on = np.flatnonzero(lasting[1][begin - before:begin])[-1:] + 30
        off = np.flatnonzero(lasting[1][end - 100:end + 300]) if end < len(labels) else []
        if len(on):
            found.append((begin - before + on[0], end - 100 + off[0] if len(off) else end, label))
    # None is asked from 1.5 s after a contraction until 0.2 s before the next.
    unasked = labels == 0
    unasked[:recording.calibrated[1] + 40] = False
    for begin, end, _ in found:
        unasked[max(0, begin - 40):end + 300] = False
    active = (energies > 3.0 * np.percentile(energies, 20, axis=0)).any(axis=1)
    return found, unasked, unasked & (uniform_filter1d(active.astype(float), 60) < 1e-9)


def announced(recording, found, kind):
    """Return what is announced at each sample."""
    values, place = recording.values, np.zeros(len(recording.values))
    for begin, end, side in found:
        for at, way in ((begin / RATE + DELAY, side), (end / RATE, -side)):
            u = np.clip((np.arange(len(values)) / RATE - at) / DURATION, 0.0, 1.0)
            place += way * TRAVEL * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    if kind == 'muscle_envelope':
        values = np.abs(sosfilt(butter(2, 5.0, fs=RATE, output='sos'), np.abs(
            sosfilt(HIGH_PASS, values, axis=0)), axis=0))
    source, said = SensedDirection(kind, (-128.5, 128.5)), np.zeros(len(values), dtype=int)
    begin, end = recording.calibrated
    for k, row in enumerate(values):
        time = (k + 1) / RATE
        source.motion.add(time, place[k])
        if k == begin:
            source.begin_calibration()
        elif k == end:
            source.end_calibration()
        source.add(time, row[None])
        said[k] = source.at(time).direction
    return said


def judge(recording, kind, counts, delays):
    """Add a recording to counts and delays; return how long both muscles were quiet, s."""
    found, unasked, quiet = contractions(recording)
    try:
        said = announced(recording, found, kind)
    except InputError:
        counts['refused'] += 1
        return 0.0
    for begin, _, side in found:
        first = begin - round(BEFORE * RATE)
        if first < recording.calibrated[1] + round(0.1 * RATE):
            continue
        window = said[first:begin + round(AFTER * RATE)]
        at = np.flatnonzero(window)
        counts['onsets'] += 1
        counts['stronger'] += int(side * np.diff(np.var(
            sosfilt(HIGH_PASS, recording.values, axis=0)[begin:begin + round(AFTER * RATE)],
            axis=0))[0] < 0.0)
        outcome = 'missed' if not len(at) else (
            'found' if window[at[0]] == side else 'other muscle')
        counts[outcome] += 1
        if outcome == 'found':
            delays.append(at[0] / RATE - BEFORE)
    onsets = (said[1:] != 0) & (said[:-1] == 0)
    counts['unasked'] += int(np.sum(onsets & unasked[1:]))
    counts['without cause'] += int(np.sum(onsets & quiet[1:]))
    return float(quiet.sum()) / RATE


if __name__ == '__main__':
    main()
