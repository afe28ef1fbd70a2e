#!/usr/bin/env python3
# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Onsets in public recordings of forearm muscles: found, missed, late, without cause.

The folder is a copy of the repository aljazfrancic/myo-readings-dataset: bracelets of eight
channels, 200 samples per second, 8 bit; five seconds of rest and five of a wrist's flexion or
extension in turn. Two of the channels are used, chosen on the first contraction. Nobody recorded
the wrist: it is taken to move 0.6 s after the muscle, as a joint does that friction holds.

The truth is found with the whole recording: when the smoothed energy of both channels passes 15 %
of the contraction's for 0.15 s. Contractions that the labels do not know count as no rest.
"""

import argparse
from pathlib import Path

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
# s after which the first onset may be judged, and about an onset, before and after it.
BEGIN, BEFORE, AFTER = 3.8, 0.1, 0.6
HIGH_PASS = butter(2, 20.0, 'high', fs=RATE, output='sos')


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('--every', type=int, default=8, help='of so many sessions, one is used')
    parser.add_argument('--first', type=int, default=0)
    parser.add_argument('--kind', default='muscle_raw', choices=('muscle_raw', 'muscle_envelope'))
    options = parser.parse_args()
    counts, delays = dict.fromkeys(
        ('onsets', 'found', 'other muscle', 'missed', 'refused', 'without cause'), 0), []
    rest = 0.0
    sessions = sorted(path.parent for path in options.folder.glob('_readings_right*/*/1.txt'))
    for session in sessions[options.first::options.every]:
        pair = read_pair(session)
        for values, labels, side in pair or ():
            rest += judge(values, labels, side, options.kind, counts, delays)
        print(session.name, counts, flush=True)
    if delays:
        print(f'{rest:.0f} s at rest; delay {1e3 * np.median(delays):.0f} ms (median)')


def read_pair(session):
    """Return values of flexor and extensor, labels and side of both movements; None if unusable."""
    try:
        tables = [np.loadtxt(session / f'{movement}.txt', delimiter=',') for movement in (1, 2)]
    except ValueError:
        return None
    if any(stretches(table[:, 8])[0][2] for table in tables):
        return None
    power = []
    for table in tables:
        begin, end = next((b, e) for b, e, label in stretches(table[:, 8]) if label)
        power.append(np.std(sosfiltfilt(HIGH_PASS, table[:, :8], axis=0)[begin + 200:end], axis=0))
    own = [int(np.argmax(a / b * (a > 0.3 * a.max()))) for a, b in (power, power[::-1])]
    return [(table[:, own], table[:, 8], side) for table, side in zip(tables, (1, -1))]


def stretches(labels):
    """Return begin, end and label of each stretch of equal labels."""
    cuts = [0, *(np.flatnonzero(np.diff(labels)) + 1).tolist(), len(labels)]
    return [(b, e, labels[b]) for b, e in zip(cuts[:-1], cuts[1:])]


def contractions(values, labels):
    """Return first and last sample of each contraction, and the samples that are certainly rest."""
    energy = np.sqrt(uniform_filter1d(
        np.mean(sosfiltfilt(HIGH_PASS, values, axis=0)**2, axis=1), 10))
    calm = np.concatenate([energy[b + 300:e - 150] for b, e, label in stretches(labels)
                           if not label and e - b > 600])
    level, scatter = np.median(calm), np.percentile(calm, 84) - np.median(calm)
    found = []
    resting = energy < level + 4.0 * scatter
    for begin, end, label in stretches(labels):
        strength = np.percentile(energy[begin:end], 70) - level
        if not label or begin < 150 or strength < 6.0 * scatter:
            continue
        active = energy > level + max(0.15 * strength, 4.0 * scatter)
        lasting = [uniform_filter1d(flags.astype(float), 30, origin=-15) > 0.9
                   for flags in (active, ~active)]
        on = np.flatnonzero(lasting[0][begin - 150:begin + 250])
        off = np.flatnonzero(lasting[1][end - 100:end + 300]) if end < len(labels) else []
        if len(on):
            found.append((begin - 150 + on[0], end - 100 + off[0] if len(off) else end))
    # Rest begins 1.5 s after a contraction and ends 0.2 s before the next.
    near = uniform_filter1d((~resting).astype(float), 60) > 1e-9
    for begin, end in found:
        near[max(0, begin - 40):end + 300] = True
    near[:round(BEGIN * RATE)] = True
    return found, ~near


def announced(values, found, side, kind):
    """Return what is announced at each sample."""
    place = np.zeros(len(values))
    for begin, end in found:
        for at, way in ((begin, 1.0), (end, -1.0)):
            u = np.clip((np.arange(len(values)) / RATE - at / RATE - DELAY) / DURATION, 0.0, 1.0)
            place += way * TRAVEL * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    if kind == 'muscle_envelope':
        values = np.abs(sosfilt(butter(2, 5.0, fs=RATE, output='sos'), np.abs(
            sosfilt(HIGH_PASS, values, axis=0)), axis=0))
    source, said = SensedDirection(kind, (-128.5, 128.5)), np.zeros(len(values), dtype=int)
    for k, row in enumerate(values):
        time = (k + 1) / RATE
        source.motion.add(time, side * place[k])
        if k == round(0.5 * RATE):
            source.begin_calibration()
        elif k == round((0.6 + CALIBRATION_TIME) * RATE):
            source.end_calibration()
        source.add(time, row[None])
        said[k] = source.at(time).direction
    return said


def judge(values, labels, side, kind, counts, delays):
    """Add a recording to counts and delays; return how long the person rested, s."""
    found, resting = contractions(values, labels)
    try:
        said = announced(values, found, side, kind)
    except InputError:
        counts['refused'] += 1
        return 0.0
    for begin, _ in found:
        if begin < BEGIN * RATE:
            continue
        first = begin - round(BEFORE * RATE)
        window = said[first:begin + round(AFTER * RATE)]
        at = np.flatnonzero(window)
        counts['onsets'] += 1
        outcome = 'missed' if not len(at) else (
            'found' if window[at[0]] == side else 'other muscle')
        counts[outcome] += 1
        if outcome == 'found':
            delays.append(at[0] / RATE - BEFORE)
    counts['without cause'] += int(
        np.sum((said[1:] != 0) & (said[:-1] == 0) & resting[1:]))
    return float(resting.sum()) / RATE


if __name__ == '__main__':
    main()
