# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Refinement of recordings as loggers change them: rate, stamps, sign, origin and units."""

from helpers import sines
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.model.effects import EFFECTS
from friction_comp.refinement import refine
from friction_comp.refinement.effect_columns import Table, Term
from friction_comp.refinement.prepare import join, prepare
from friction_comp.refinement.search import own_shares
from friction_comp.samples import Samples
from friction_comp.statistics import rms

DRIVE = Drive(1.0, 1.0)


def joint(seed, duration=60.0, step=0.01, count=2e-4, load=None):
    """Return a joint with friction and inertia, in encoder counts, noise 0.02."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, duration, step)
    position, velocity, acceleration = sines(time, [
        (0.3 / frequency, 2 * np.pi * frequency * rng.uniform(0.95, 1.05), rng.uniform(0.0, 6.28))
        for frequency in (0.13, 0.31, 0.8, 1.4)])
    current = 0.5 * np.tanh(velocity / 0.05) + 0.2 * velocity + 0.06 * acceleration
    if load is not None:
        load = load[0] + load[1] * np.sin(2.9 * time + seed)
        current += 0.1 * np.tanh(velocity / 0.05) * load ** 1.5 - 0.3 * load
    return Samples(time=time, position=count * np.round(position / count),
                   current=current + 0.02 * rng.standard_normal(len(time)), load=load)


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
        model = refine([fit]).model
        errors.append(rms(new.current - model.predict(new)))
    assert errors[1] < 1.1 * errors[0]


def mirrored(samples):
    return samples.with_(position=-samples.position, current=-samples.current)


def moved(samples):
    return samples.with_(position=samples.position + 0.7)


@pytest.mark.parametrize(('change', 'of_places'), [
    (mirrored, lambda places: -places[::-1]), (moved, lambda places: places + 0.7)])
def test_neither_sign_nor_origin_of_position_matters(change, of_places):
    recordings = [joint(seed, 20.0) for seed in (1, 2, 3)]
    order, again = (join([change(one) for one in recordings] if changed else recordings).current
                    for changed in (False, True))
    assert np.array_equal(np.abs(order), np.abs(again))
    shares, places = [], []
    for samples in (recordings[0], change(recordings[0])):
        rows, _ = prepare(samples, DRIVE)
        table = Table(rows, 2.0 / rows.coverage.transition)
        terms = table.add([Term(EFFECTS['gravity']), *(
            Term(EFFECTS['spring'], constants) for constants in EFFECTS['spring'].grid(
                rows.coverage))])
        shares.append(own_shares(table, terms))
        places.append(np.unique([point['position'] for point in EFFECTS['bump'].grid(
            rows.coverage)]))
    assert shares[1] == pytest.approx(shares[0], rel=1e-3)
    assert places[1] == pytest.approx(of_places(places[0]), abs=1e-6)
