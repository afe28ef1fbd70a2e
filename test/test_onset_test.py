# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The onset test: as many alarms at rest as stated, in any noise, and onsets without delay."""

import numpy as np
import pytest
from scipy.signal import lfilter

from friction_comp.direction.onset_test import alarm_limit, ALLOWANCE, OnsetTest, Rest


def test_white_noise_gives_at_most_as_many_alarms_as_stated():
    limit = alarm_limit(2000.0)
    random = np.random.default_rng(0)
    alarms, total = 0, 0.0
    for z in random.normal(size=1_000_000).tolist():
        total = max(0.0, total + z - ALLOWANCE)
        if total > limit:
            alarms, total = alarms + 1, 0.0
    assert 50 < alarms < 500


@pytest.mark.parametrize('kind', ['white', 'low pass', 'tremor'])
def test_three_seconds_show_the_scatter_of_any_noise_well_enough(kind):
    random = np.random.default_rng(1)
    false = 0
    for _ in range(20):
        count = 300 + 100 * 60
        noise = random.normal(size=count)
        if kind == 'low pass':
            for k in range(1, count):
                noise[k] += 0.8 * noise[k - 1]
        elif kind == 'tremor':
            noise += 4.0 * np.sin(0.5 * np.arange(count) + random.uniform(0.0, 6.0))
        test = OnsetTest(Rest.of(noise[:300], 100.0))
        for value in noise[300:]:
            if test.add(value):
                false += 1
                test.settle(0.0)
            test.follow()
    # 20 minutes at 0.25 an hour and channel.
    assert false <= 1


def test_the_lag_of_a_low_pass_does_not_delay_an_onset():
    random, samples = np.random.default_rng(1), []
    for _ in range(40):
        signal = random.normal(size=460) + 4.0 * (np.arange(460) >= 400)
        values = lfilter([0.1], [1.0, -0.9], signal)
        test = OnsetTest(Rest.of(values[:300], 100.0))
        alarms = []
        for value in values[300:]:
            alarms.append(test.add(value))
            test.follow()
        samples.append(alarms.index(1) - 99)
    # As a test of the values before the low pass would take: the limit over what each adds to it.
    assert test.limit / (4.0 - ALLOWANCE) == pytest.approx(2.0, abs=0.1)
    assert np.median(samples) <= 3
    assert min(samples) > 0
