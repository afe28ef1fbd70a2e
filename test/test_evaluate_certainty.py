# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What is said of conditions holds as often as it is said to, whatever happens in a session."""

from dataclasses import replace

import numpy as np
import pytest
from recording_maker import record_with_diagnostics
from scipy.signal import lfilter
from test_evaluate import PERIOD, REST
from test_evaluate_sessions import both, info_of

from friction_comp.evaluation.compare import compare, mean_interval, share_interval
from friction_comp.evaluation.conditions import evaluate, evaluate_recordings, MeasuredJoint
from friction_comp.evaluation.movements import Movement
from friction_comp.evaluation.repetitions import Compensation, Repetition
from friction_comp.recordings import RecordingInfo, write_samples
from friction_comp.recordings.activity import Activity
from friction_comp.reports.evaluation_words import verdict

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
            {'peak_torque': torque + scatter * noise[k]}, True, False, False, place=k + 1000 * day))
    return found


def peaks_of(repetitions):
    comparison, = compare(repetitions)
    return comparison


@pytest.mark.parametrize('reference', [True, False])
@pytest.mark.parametrize(('after', 'before', 'counted'), [
    # s after the beginning of the fourth of six movements.
    (-0.8, 'paper', 6), (0.1, 'paper', 5), (1.0, 'paper', 5), (2.3, 'paper', 5), (3.0, 'paper', 6),
    (1.0, 'continuous', 6)])
def test_a_movement_during_which_the_law_changed_counts_for_none(after, before, counted, reference):
    samples = both([1.0] * 3 + [0.4] * 3)
    if not reference:
        samples = samples.with_(reference_position=None, reference_velocity=None)
    about = info_of(activity=[
        (0.0, before, 'a.yaml'), (3 * PERIOD + REST + after, 'continuous', 'a.yaml')])
    evaluation = evaluate([samples], about=[about])
    assert sum(c.repetitions for c in evaluation.conditions) == counted
    assert len(evaluation.repetitions) == counted
    assert 'changed' not in {c.compensation.law for c in evaluation.conditions}
    left_out = [note for note in evaluation.notes if 'changed: left out' in note]
    assert [note.split()[0] for note in left_out] == ['1'] * (6 - counted)


def test_only_a_change_that_matters_is_one():
    """Not another joint's model, nor what a compensator that does nothing has loaded."""
    samples = both([1.0] * 4)
    middle = PERIOD + REST + 1.0

    def laws(*reports, **changes):
        about = RecordingInfo('trial', 'elbow', activity=[
            (since, Activity(0, *report).of('elbow')) for since, report in zip(
                (0.0, middle), reports)])
        return sorted(r.compensation.law for r in evaluate(
            [samples.with_(**changes)], about=[about]).repetitions)

    files = 'shoulder, elbow'
    assert laws(('active', 'paper', 'a.yaml, b.yaml', files),
                ('active', 'paper', 'c.yaml, b.yaml', files)) == ['paper'] * 4
    assert laws(('unconfigured', 'paper', ''), ('inactive', 'continuous', 'a.yaml')) == ['none'] * 4
    # Starting or stopping on the way is one, unless all commands were zero.
    assert laws(('inactive', 'paper', 'a.yaml'), ('active', 'paper', 'a.yaml')) == [
        'none', 'paper', 'paper']
    assert laws(('inactive', 'paper', 'a.yaml'), ('active', 'paper', 'a.yaml'),
                command=np.zeros(len(samples))) == ['none'] * 4


def test_a_compensator_that_fell_silent_compensates_nothing(tmp_path):
    """Its last report says active, and its last command is a current."""
    samples = both([1.0] * 10)
    time, command = samples.time, np.ones(len(samples))
    # From within the third movement until after the sixth; shorter than a driver's timeout; to the
    # end, though the joint does not start again.
    begin, rest = 2 * PERIOD + REST + 1.0, 8 * PERIOD + 0.5
    command[((time > begin) & (time < 6 * PERIOD + 0.5)) | (time > rest)] = np.nan
    short = 6 * PERIOD + REST + 1.0
    command[(time > short) & (time < short + 0.05)] = np.nan
    position = samples.position.copy()
    position[time > rest] = position[time > rest][0]
    record_with_diagnostics(tmp_path / 'r', samples.with_(position=position, command=command), [
        (0, ('continuous', 'a.yaml'))])
    evaluation, = evaluate_recordings([tmp_path / 'r'])
    assert [r.compensation.law for r in sorted(
        evaluation.repetitions, key=lambda r: r.begin)] == (
        ['continuous'] * 2 + ['none'] * 3 + ['continuous'] * 2 + ['none'] * 2)
    assert any('1 movement during which' in note for note in evaluation.notes)


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


def test_what_two_repetitions_show_is_not_judged():
    comparison = peaks_of(session([0, 0, 1, 1], np.random.default_rng(0), help=0.5, scatter=0.01))
    assert 'fewer than 5 repetitions' in comparison.untested
    assert (comparison.p_value, comparison.without_drift.half) == (None, None)
    assert comparison.difference == pytest.approx(-0.5, abs=0.05)
    assert mean_interval([1.0, 2.0, 3.0, 4.0]).half is None
    assert mean_interval([1.0, 2.0, 3.0, 4.0, 5.0]).half > 0.0


@pytest.mark.parametrize(('order', 'least'), [('blocks', 0.8), ('drawn', 0.95), ('in turn', 0.95)])
def test_a_difference_is_found_where_the_order_allows_it(order, least):
    share = 0.3
    comparisons = [peaks_of(session(ORDERS[order], np.random.default_rng(seed), share))
                   for seed in range(60)]
    assert np.mean([c.significant for c in comparisons]) >= least
    held = np.mean([c.without_drift.low <= -share <= c.without_drift.high for c in comparisons])
    assert held >= 0.88
    assert {c.in_turn for c in comparisons} == {order != 'blocks'}


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


def test_few_restless_repetitions_are_not_trusted_for_many_steady_ones():
    found = 0
    for seed in range(100):
        random = np.random.default_rng(seed)
        repetitions = session([0, 1, 1, 1, 1] * 4, random, scatter=0.05)
        for r in repetitions:
            if r.compensation == PLAIN:
                r.figures['peak_torque'] += 0.5 * random.normal()
        found += peaks_of(repetitions).significant
    assert found <= 13


@pytest.mark.parametrize('torque', [0.0, 1.0])
@pytest.mark.parametrize('order', [[0, 1] * 6, [0] * 6 + [1] * 6])
def test_a_sensor_that_always_says_the_same_shows_no_difference(torque, order):
    repetitions = session(order, np.random.default_rng(0))
    for r in repetitions:
        r.figures['peak_torque'] = torque
    comparison = peaks_of(repetitions)
    assert comparison.without_drift.mean == pytest.approx(0.0, abs=1e-12)
    assert comparison.p_value is not None
    assert not comparison.significant


def test_a_torque_that_did_not_suffice_is_not_the_lower_one():
    repetitions = session([0, 1] * 6, np.random.default_rng(0), help=0.4)
    assert peaks_of(repetitions).significant
    repetitions[2].moved = repetitions[3].moved = False
    assert 'did not always move' in peaks_of(repetitions).untested
    # Of the larger torque a lower bound says enough.
    repetitions[2].moved = repetitions[3].moved = True
    repetitions[0].moved = False
    assert peaks_of(repetitions).significant


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
    assert 'Whether this is so is not known' in verdict(apart)


def test_what_was_not_recorded_is_not_invented(tmp_path):
    """A peak within a hole of the torque is not known, nor a movement in a gap of the motion."""
    samples = both([1.0] * 6)
    peak = 2 * PERIOD + REST + 0.2
    lost = abs(samples.time - peak) < 0.3
    write_samples(tmp_path / 'whole', samples)
    write_samples(tmp_path / 'hole', samples.with_(load=np.where(lost, np.nan, samples.load)))
    found, = evaluate_recordings([tmp_path / 'whole'])
    assert found.conditions[0].figures['peak_torque'].count == 3
    found, = evaluate_recordings([tmp_path / 'hole'])
    assert found.conditions[0].repetitions == 3
    for figure in ('peak_torque', 'rms_torque'):
        assert found.conditions[0].figures[figure].count == 2
    assert any('has gaps' in note for note in found.notes)
    assert found.conditions[0].peak_torque == pytest.approx(1.0, abs=0.1)
    for begin, end in ((0.0, 0.5), (1.0, 1.3), (2.3, 3.5)):
        since = samples.time - 2 * PERIOD - REST
        gap = evaluate([samples.take((since < begin) | (since > end))])
        assert sum(c.repetitions for c in gap.conditions) == 5
        assert '1 movement with a gap in the joint states: left out' in gap.notes


def test_a_torque_of_the_wrong_sign_is_noted():
    samples = both([1.0] * 8)
    still = samples.with_(command=np.zeros(len(samples)), direction=0 * samples.direction)
    for sign, offset, noted in ((1, 0.0, False), (-1, 0.0, True), (1, 0.6, False), (-1, 0.6, True)):
        evaluation = evaluate([still.with_(load=sign * still.load + offset)])
        assert noted == any('interaction_wrench may be wrong' in note for note in evaluation.notes)


def test_a_direction_that_no_law_hears_is_no_second_way_to_do_without():
    """Where the compensator went away, the direction is still announced."""
    repetitions = session([0] * 10 + [1] * 10, np.random.default_rng(0), help=0.4)
    for r in repetitions[30:]:
        r.compensation = Compensation('none', '', 1)
    evaluation = judged(repetitions)
    assert evaluation.pair() == (PLAIN, HELPED)
    assert 'is not known' not in verdict(evaluation)


def test_a_single_value_and_a_share_have_the_intervals_they_can_have():
    assert mean_interval([2.0]).low is None
    share = share_interval(0, 10)
    assert (share.mean, share.low) == (0.0, pytest.approx(0.0, abs=1e-12))
    assert 0.2 < share.high < 0.35
