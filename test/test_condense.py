# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Long recordings are read as averages, in bounded memory."""

import re

import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.recordings import read_recording, read_recording_with_info, scan, write_samples
from friction_comp.recordings.reader import read_condensed
from friction_comp.refinement import refine
from friction_comp.samples import Samples

RATE, NOISE = 500.0, 0.01


def recorded(seconds, seed=0, joint='elbow'):
    """A drive with a ripple that nobody declared, 24 times a turn."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    position = np.sum([0.08 / f * np.sin(2 * np.pi * f * time + rng.uniform(0, 6))
                       for f in (0.05, 0.083, 0.131, 0.27)], axis=0)
    velocity = np.gradient(position, 1.0 / RATE)
    current = 0.3 * np.tanh(velocity / 0.02) + 0.1 * velocity + 0.05 * np.sin(24 * position)
    return Samples(time=time, position=position, velocity=velocity, joint=joint,
                   current=current + NOISE * rng.standard_normal(len(time)))


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp('long')
    for k in range(2):
        write_samples(folder / f'r{k}', recorded(75.0, k))
    return folder


@pytest.mark.slow
def test_all_signals_are_averaged_alike_and_a_note_says_so(folder):
    found = read_condensed(folder, limit=20_000)
    assert '4 samples at a time were averaged' in found[0][1].notes[-1]
    whole, _ = read_recording(folder)
    kept, _ = found[0]
    assert kept.sample_time == pytest.approx(4.0 / RATE)
    for name in ('time', 'position', 'velocity', 'current'):
        averages = getattr(whole, name)[:len(kept) * 4].reshape(-1, 4).mean(axis=1)
        assert np.allclose(getattr(kept, name), averages, atol=1e-9)
    assert [samples.recording[0] for samples, _ in found] == [0, 1]


@pytest.mark.slow
def test_pieces_from_everywhere_are_kept_where_averages_are_too_many(folder):
    found = read_condensed(folder, limit=5_000)
    kept = sum(len(samples) for samples, _ in found)
    assert 2_500 <= kept <= 7_500
    for samples, _ in found:
        assert samples.time[0] < 25.0
        assert samples.time[-1] > 50.0


@pytest.mark.slow
def test_a_ripple_is_found_in_averages(folder):
    found = [samples for samples, _ in read_condensed(folder, limit=10_000)]
    report = refine(found, drive=Drive(1.0, 1.0)).report
    assert [effect.name for effect in report.effects] == ['cogging']
    # The noise of averages is smaller by this factor.
    assert report.after.held_out_rmse < 1.2 * NOISE / 5 ** 0.5


@pytest.mark.parametrize('wrapped', [False, True])
def test_turns_are_continued_between_pieces_and_none_are_added(tmp_path, wrapped):
    """A joint that swings about pi; the second half was recorded after a pause, a turn away."""
    time = np.arange(6000) * 0.01
    late = time > 30.0
    swing = np.pi + 0.6 * np.sin(1.1 * time) + 2.0 * np.pi * late
    position = (swing + np.pi) % (2.0 * np.pi) - np.pi if wrapped else swing
    write_samples(tmp_path / 'log', Samples(
        time + 100.0 * late, position, np.sign(np.cos(1.1 * time))))
    whole, = read_recording(tmp_path / 'log')
    for half in (late, ~late):
        assert np.ptp(whole.position[half] - swing[half]) < 1e-6
    # Half of the pieces are left out: the joint may have turned in between.
    (kept, info), = read_condensed(tmp_path / 'log', limit=3000)
    assert re.fullmatch(r'the recordings are long: [\d.]+ % of them were kept',
                        info.notes[-1])
    assert 500 < len(kept) < 5000
    assert np.allclose(kept.position, np.interp(kept.time, whole.time, whole.position))


def test_of_a_very_long_bag_the_beginning_is_read(tmp_path, monkeypatch):
    """As much as the memory takes, and a note says so."""
    write_samples(tmp_path / 'log', recorded(40.0))
    for name, value in (('_BATCH', 500), ('_MOST', 15_000)):
        monkeypatch.setattr(scan, name, value)
    (kept, info), = read_recording_with_info(tmp_path / 'log')
    assert 'the recording is very long: only its first 11 s were read' in info.notes
    assert 5_000 <= len(kept) <= 6_000
