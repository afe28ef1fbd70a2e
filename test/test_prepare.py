# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings as loggers leave them: gaps, limits, stamps, rate, origin, sign and length."""


from helpers import swings
import numpy as np
import pytest

from friction_comp import refine
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.recordings import scan
from friction_comp.recordings.reader import read_recording, read_recording_with_info
from friction_comp.recordings.writer import write_samples
from friction_comp.refinement.prepare import clipped, join
from friction_comp.samples import Samples
from friction_comp.statistics import rms

DRIVE = Drive(0.1, 100.0)


def test_samples_that_are_no_numbers_are_left_out_and_a_signal_that_is_hardly_there_too():
    samples = swings(1)
    current, temperature, load = samples.current.copy(), np.full(4000, np.nan), np.zeros(4000)
    current[10] = np.nan
    load[20:30] = np.inf
    temperature[::3] = 30.0
    joined = join([samples.with_(current=current, load=load, temperature=temperature)])
    assert len(joined) == 4000 - 11
    assert joined.temperature is None
    assert np.isfinite(joined.load).all()


STILL, SPIKES = np.zeros((2, 4000))
STILL[3900:] = 0.1 * np.sin(0.4 * np.arange(100))
SPIKES[::300] = -7.0
UNSEEN = {'velocity': None, 'acceleration': None}


@pytest.mark.parametrize(('change', 'words'), [
    ({'position': np.full(4000, 0.3)}, 'never moves'),
    ({'position': STILL, **UNSEEN}, 'hardly moves'),
    ({'current': np.clip(50.0 * swings(1).velocity, -1.0, 1.0)}, 'at a limit in nearly all motion'),
    ({'current': np.full(4000, 1e-308)}, '^the current is zero throughout.*the motor has to'),
    ({'current': SPIKES}, 'the current is zero in nearly all motion'),
    ({'time': np.zeros(4000)}, 'time stamps')])
def test_a_recording_that_shows_no_friction_is_refused_in_one_line(change, words):
    with pytest.raises(InputError, match=words) as caught:
        refine([swings(1).with_(**change)], drive=DRIVE)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(('parts', 'words'), [
    ([], 'no samples'), ([swings(1).take(slice(0, 150))], '150 usable samples are too few')])
def test_too_few_samples_are_refused(parts, words):
    with pytest.raises(InputError, match=words):
        join(parts)


@pytest.mark.parametrize('step', [0.0, 0.02, 0.05])
def test_a_current_that_is_cut_off_is_seen_and_one_that_is_not_is_left_alone(step):
    """Also one in coarse steps, A, and one that constant speeds repeat, except for its noise."""
    samples = swings(4)
    current = step * np.round(samples.current / step) if step else samples.current
    limit = 4.0 * step or float(np.quantile(np.abs(current), 0.8))
    assert np.array_equal(clipped(np.clip(current, -limit, limit)),
                          np.abs(current) >= limit - 1e-9)
    assert not clipped(current).any()
    speed = np.convolve(0.6 * np.sign(np.sin(0.25 * np.pi * samples.time)), np.ones(30) / 30.0,
                        mode='same')
    noise = 0.01 * np.random.default_rng(5).standard_normal(4000)
    assert not clipped(0.4 * np.tanh(speed / 0.01) + 0.3 * speed + noise).any()


def levels(rests):
    """Return a joint's current, pushed to and fro by 1 A, or now and then not at all."""
    rng = np.random.default_rng(0)
    pushes = np.repeat(np.tile([1.0, -1.0], 40), rng.integers(80, 200, 80))
    if rests:
        pushes[rng.integers(0, len(pushes) - 60, 4)[:, None] + np.arange(60)] = 0.0
    return pushes


def ramps(*held):
    """Return ramps and steps of a commanded current."""
    ramp = np.interp(np.arange(6000.0), (0.0, 1500.0, 4500.0, 6000.0), (0.0, 0.9, -0.9, 0.0))
    return np.concatenate(3 * [ramp, *(part for level in held for part in (
        np.full(600, level), np.zeros(300)))])


@pytest.mark.parametrize(('current', 'viscous'), [
    (levels(False), 0.0), (levels(True), 0.0), (ramps(0.9), 0.1),
    (ramps(0.5, -0.5, 0.9, -0.9), 0.1)])
def test_a_step_that_is_held_at_the_largest_current_does_no_harm(current, viscous):
    """One of two levels is a command, and no limit; Coulomb friction 0.3 A, inertia 0.05."""
    step, velocity = 0.002, np.zeros(len(current))
    for n, pushed in enumerate(current[:-1]):
        driven = velocity[n] + step / 0.05 * (pushed - viscous * velocity[n])
        velocity[n + 1] = np.sign(driven) * max(abs(driven) - step / 0.05 * 0.3, 0.0)
    report = refine([Samples(time=step * np.arange(len(current)), current=current,
                             position=step * np.cumsum(velocity))]).report
    assert viscous or report.samples_clipped == 0
    assert report.friction.coulomb == pytest.approx(0.3, rel=0.02 if viscous else 0.03)
    assert report.friction.inertia == pytest.approx(0.05, rel=0.02)


def joint(seed, duration=60.0, step=0.01, count=2e-4):
    """Return a joint with friction and inertia, in encoder counts."""
    samples = swings(seed, duration, step, (0.13, 0.31, 0.8, 1.4), size=0.3, width=0.05,
                     inertia=0.06)
    return samples.with_(**UNSEEN, position=count * np.round(samples.position / count))


def test_a_model_of_a_slow_recording_predicts_a_faster_one():
    """What a filter at half the rate left out of the first must be left out of the second."""
    result = refine([joint(1).take(slice(None, None, 3))])
    other = joint(2)
    assert result.report.differentiation['bandwidth'] <= 0.5 / 0.03
    error = rms(other.current - result.model.predict(other))
    assert error < 1.5 * result.report.after.elsewhere_rmse


def test_late_stamps_cost_little():
    sound, other = (joint(seed, 30.0, count=1e-5, step=0.002) for seed in (1, 2))

    def late(samples, seed):
        wrong = 0.2 * 0.002 * np.random.default_rng(seed).uniform(-1.0, 1.0, len(samples))
        return samples.with_(time=samples.time + wrong)
    errors = []
    for fit, new in ((sound, other), (late(sound, 3), late(other, 4))):
        errors.append(rms(new.current - refine([fit]).model.predict(new)))
    assert errors[1] < 1.1 * errors[0]


@pytest.mark.parametrize(('side', 'origin'), [(-1.0, 0.0), (1.0, 0.7)])
def test_neither_sign_nor_origin_of_position_matters(side, origin):
    recordings = [one.with_(current=one.current + 0.3 * np.sin(one.position))
                  for one in (joint(seed, 20.0) for seed in (1, 2, 3))]
    changed = [one.with_(position=side * one.position + origin, current=side * one.current)
               for one in recordings]
    before, after = (refine(parts).report for parts in (recordings, changed))
    assert [one.name for one in after.effects] == [one.name for one in before.effects]
    assert after.after.held_out_rmse == pytest.approx(before.after.held_out_rmse, rel=1e-2)
    assert after.friction.coulomb == pytest.approx(before.friction.coulomb, rel=1e-2)


# Long recordings are read as averages, in bounded memory.

RATE = 500.0


def long(seconds, seed=0):
    """Return a drive with a ripple that nobody declared, 24 times a turn."""
    samples = swings(seed, seconds, 1.0 / RATE, (0.05, 0.083, 0.131, 0.27), size=0.08, coulomb=0.3,
                     viscous=0.1, width=0.02, noise=0.01)
    return samples.with_(joint='elbow', acceleration=None, current=(
        samples.current + 0.05 * np.sin(24.0 * samples.position)))


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp('long')
    for k in range(2):
        write_samples(folder / f'r{k}', long(75.0, k))
    return folder


@pytest.mark.slow
def test_all_signals_are_averaged_alike_and_a_note_says_so(folder):
    found = read_recording_with_info(folder, limit=20_000)
    assert '4 samples at a time were averaged' in found[0][1].notes[-1]
    whole, _ = read_recording(folder)
    kept, _ = found[0]
    assert kept.sample_time == pytest.approx(4.0 / RATE)
    for name in ('time', 'position', 'velocity', 'current'):
        averages = getattr(whole, name)[:len(kept) * 4].reshape(-1, 4).mean(axis=1)
        assert np.allclose(getattr(kept, name), averages, atol=1e-9)
    assert [samples.recording[0] for samples, _ in found] == [0, 1]


@pytest.mark.slow
def test_a_ripple_is_found_in_averages(folder):
    found = [samples for samples, _ in read_recording_with_info(folder, limit=10_000)]
    report = refine(found, drive=Drive(1.0, 1.0)).report
    assert [effect.name for effect in report.effects] == ['cogging']
    # The noise of averages is smaller by this factor.
    assert report.after.held_out_rmse < 1.2 * 0.01 / 5 ** 0.5


def test_of_a_very_long_bag_the_beginning_is_read(tmp_path, monkeypatch):
    """As much as the memory takes, and a note says so."""
    write_samples(tmp_path / 'log', long(40.0))
    monkeypatch.setattr(scan, '_MOST', 15_000)
    (kept, info), = read_recording_with_info(tmp_path / 'log')
    assert 'the recording is very long: only its beginning was read, 5001 messages' in info.notes[0]
    assert len(kept) == 5001
