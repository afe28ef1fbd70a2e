# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What is said of conditions holds as often as it is said to, whatever happens in a session."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from friction_comp.evaluation.conditions import compare, mean_interval, MeasuredJoint
from friction_comp.evaluation.repetitions import Compensation, Movement, Repetition
from friction_comp.reports.evaluation_page import verdict

PLAIN, HELPED = Compensation('none', '', 0), Compensation('continuous', 'a.yaml', 1)
DAY = 86_400.0
ORDERS = {'blocks': [0] * 10 + [1] * 10, 'in turn': [0, 1] * 10,
          'drawn': [0, 1, 1, 0, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1, 0, 0, 1, 0, 1]}


def session(order, random, help=0.0, drift=0.0, alike=0.0, day=0, scatter=0.15, signs=(1, -1)):
    """Return repetitions, each a movement in every direction of `signs`, whose peaks are near 1.

    `order` has 1 where the direction was announced, which takes the share `help` off the torque;
    `drift` is the relative change over the session, `alike` the correlation of neighbours.
    """
    count = len(signs) * len(order)
    noise = lfilter([np.sqrt(1 - alike ** 2)], [1, -alike], random.normal(size=count + 30))[30:]
    found = []
    for k in range(count):
        is_helped, sign, begin = order[k // len(signs)], signs[k % len(signs)], 5.0 * k
        condition = (PLAIN, HELPED)[is_helped]
        movement = Movement(begin, begin + 2.5, begin + 0.5, begin + 2.0, begin - 2.0, begin + 4.5,
                            sign, sign * condition.announced, 0.8)
        torque = (1.0 + 0.1 * sign + drift * k / count) * (1.0 - help * is_helped)
        found.append(Repetition(
            f'{day}', 1e9 + DAY * day, f'2026-03-{day + 1:02}', movement, condition,
            {'peak_torque': torque + scatter * noise[k]}, True, False, place=k + 1000 * day))
    return found


def peaks_of(repetitions):
    comparison, = compare(repetitions)
    return comparison


@pytest.mark.parametrize('alike', [0.0, 0.3, 0.6])
def test_intervals_hold_the_truth_as_often_as_they_say(alike):
    """Also where neighbours are alike; Student's t alone is right 87 % of the time at 0.6."""
    random = np.random.default_rng(0)
    held = 0
    for _ in range(300):
        values = lfilter([np.sqrt(1 - alike ** 2)], [1, -alike], random.normal(size=40))[20:]
        interval = mean_interval(list(3.0 + values[::2]), 2 * np.arange(10))
        held += interval.low <= 3.0 <= interval.high
    assert 0.9 * 300 <= held <= 0.98 * 300


@pytest.mark.parametrize('order', ORDERS)
@pytest.mark.parametrize('change', [{}, {'drift': -0.3}, {'alike': 0.5}])
def test_sessions_without_a_difference_seldom_show_one(order, change):
    """Of pairs of n-th repetitions in blocks, drift shows one in most, likeness in every fourth."""
    found = sum(peaks_of(session(ORDERS[order], np.random.default_rng(seed), **change)).significant
                for seed in range(75))
    assert found <= 0.13 * 75


def test_few_repetitions_show_a_difference_far_larger_than_people_change():
    """Five movements there and back, all of one condition first, one of which takes 0.6."""
    found = [peaks_of(session([0] * 5 + [1] * 5, np.random.default_rng(seed), help=share,
                              drift=drift)).significant
             for share, drift in ((0.4, 0.0), (0.4, -0.3), (0.0, -0.4)) for seed in range(40)]
    assert sum(found[:40]) > 0.6 * 40
    assert sum(found[40:80]) > 0.45 * 40
    assert sum(found[80:]) <= 0.1 * 40


def test_like_is_compared_with_like():
    random = np.random.default_rng(0)
    # What differs from day to day is no effect of what was recorded on one of them only.
    apart = session([0] * 8, random) + session([1] * 8, random, help=0.4, day=1)
    comparison = peaks_of(apart)
    assert (comparison.p_value, comparison.without_drift.half, comparison.pairs) == (None, None, 0)
    assert 'different days' in comparison.untested
    # A day on which only one of them was recorded, and a direction, count for nothing.
    same = session([0, 1] * 6, random, scatter=0.01)
    more = same + session([0] * 6, random, day=7)
    for r in more[24:]:
        r.figures['peak_torque'] = 9.0
    assert peaks_of(more).mean_first == pytest.approx(peaks_of(same).mean_first)
    assert peaks_of(more).without_drift.mean == pytest.approx(0.0, abs=0.02)
    # Nor are other movements compared.
    faster = [replace(r, movement=replace(r.movement, end=r.movement.begin + 1.5))
              if r.compensation == HELPED else r for r in same]
    assert 'took longer or went farther' in peaks_of(faster).untested
    assert compare(session([0, 0], random, signs=(1,)) + session([1, 1], random, signs=(-1,))) == []


def judged(repetitions):
    joint = MeasuredJoint('elbow')
    for r in repetitions:
        r.curves = {'position': np.zeros(3000), 'load': np.full(3000, r.figures['peak_torque'])}
    joint.repetitions += repetitions
    return joint.evaluate(None)


def test_the_verdict_is_no_surer_than_the_comparison():
    random = np.random.default_rng(0)
    evaluation = judged(session([0, 1] * 8, random, help=0.4, scatter=0.05))
    assert 'chance' not in verdict(evaluation)
    assert 'after the other' not in verdict(evaluation)
    tired = judged(session([0] * 20 + [1] * 20, random, drift=1.0, help=0.2, scatter=0.05))
    words = verdict(tired)
    # The means rise although the direction helps: neither is called sure.
    assert 'after the other' in words
    assert 'may be chance, or have come with time' in verdict(tired)
    apart = judged(session([0] * 8, random) + session([1] * 8, random, help=0.4, day=1))
    assert 'recorded on different days' in verdict(apart)
    assert 'That is not judged' in verdict(apart)
