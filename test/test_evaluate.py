# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluation of recorded trials, and how certain it is."""

from dataclasses import replace
import json

import numpy as np
import pytest
from recording_maker import record_with_diagnostics
from scipy.signal import lfilter

from friction_comp.__main__ import run
from friction_comp.evaluation.conditions import compare, evaluate, evaluate_recordings
from friction_comp.evaluation.repetitions import Compensation, find_movements, Movement, Repetition
from friction_comp.recordings.scan import Activity
from friction_comp.recordings.writer import write_samples
from friction_comp.samples import RecordingInfo, Samples

# The evaluation of trials with known torques returns these torques, condition by condition.

REST, RAMP, CRUISE, SPEED = 2.0, 0.5, 1.5, 0.4
MOVE = 2 * RAMP + CRUISE
PERIOD = REST + MOVE


def trial(peaks, push=0.2, directions=None, step=2e-3):
    """Make a trial with one entry of peaks a movement; even ones are positive.

    The torque is a bump of the peak's height 0.2 s after the movement begins, and `push` along the
    movement while it lasts at constant velocity.
    """
    time = np.arange(round((len(peaks) * PERIOD + REST) / step)) * step
    velocity, load = np.zeros_like(time), np.zeros_like(time)
    direction = np.zeros(len(time), dtype=int)
    for k, peak in enumerate(peaks):
        sign = 1 if k % 2 == 0 else -1
        since = time - k * PERIOD - REST
        shape = np.clip(np.minimum(since, MOVE - since) / RAMP, 0.0, 1.0)
        velocity += sign * SPEED * shape
        load += sign * peak * np.exp(-((since - 0.2) / 0.05) ** 2)
        load[(since > RAMP) & (since < RAMP + CRUISE)] += sign * push
        if directions is not None:
            direction[(since > -0.5) & (since < RAMP + CRUISE)] = directions[k]
    position = np.cumsum(velocity) * step
    return Samples(
        time=time, position=position, current=np.zeros_like(time), load=load, direction=direction,
        reference_position=position, reference_velocity=velocity, joint='elbow')


def both(heights, seed=0):
    """Make a trial at 50 Hz whose announced movements' peaks differ a little."""
    random = np.random.default_rng(seed)
    peaks = [height * (1.0 + 0.05 * random.normal()) for height in heights]
    return trial(peaks, directions=[1, -1] * (len(heights) // 2), step=2e-2)


def info_of(*activity):
    """Return the information of a recording: since when, law, model, and settings if any."""
    return RecordingInfo('trial', 'elbow', start=1.0, activity=[
        (since, Activity(0, 'active', law, name, settings=', '.join(settings)))
        for since, law, name, *settings in activity])


LAW, KINETIC = (info_of((0.0, law, 'a.yaml')) for law in ('continuous', 'kinetic'))


def by_key(evaluation):
    return {(c.direction, c.movement): c for c in evaluation.conditions}


def laws(evaluation):
    return {c.compensation.law for c in evaluation.conditions}


# Movements and their figures.


def test_movements_are_found_where_they_were_made():
    samples = trial([1.0] * 4, directions=[1, -1, 0, 1])
    movements = find_movements(samples)
    assert [m.sign for m in movements] == [1, -1, 1, -1]
    assert [m.direction for m in movements] == [1, -1, 0, 1]
    for k, movement in enumerate(movements):
        begin = k * PERIOD + REST
        assert movement.begin == pytest.approx(begin, abs=0.01)
        assert movement.end == pytest.approx(begin + MOVE, abs=0.01)
        assert movement.constant_begin == pytest.approx(begin + RAMP, abs=0.05)
        assert movement.constant_end == pytest.approx(begin + RAMP + CRUISE, abs=0.05)
        assert movement.travel == pytest.approx(SPEED * (RAMP + CRUISE), rel=0.02)
    # Without a reference the motion itself tells, also behind minutes of rest.
    rest = np.arange(1, 700_000) * 2e-3
    before = samples.take(np.zeros(len(rest), dtype=int)).with_(time=rest)
    late = Samples.concatenate([before, samples.with_(time=samples.time + rest[-1] + 2e-3)])
    late = late.with_(recording=np.zeros(len(late), dtype=int))
    for one in (late, late.with_(reference_position=None, reference_velocity=None)):
        assert [m.begin - rest[-1] for m in find_movements(one)] == pytest.approx(
            [REST + k * PERIOD for k in range(4)], abs=0.12)


def test_figures_of_each_condition():
    evaluation = evaluate([trial([1.2] * 6), trial([0.3, 0.4, 0.5] * 2, directions=[1, -1] * 3)])
    conditions = by_key(evaluation)
    assert set(conditions) == {(0, 'positive'), (0, 'negative'), (1, 'positive'), (-1, 'negative')}
    for condition in conditions.values():
        expected, spread = (1.2, 0.0) if condition.direction == 0 else (0.4, 0.1)
        assert condition.repetitions == 3
        assert condition.peak_torque == pytest.approx(expected, rel=1e-3)
        assert condition.peak_torque_std == pytest.approx(spread, abs=1e-3)
        assert condition.peak_time == pytest.approx(0.2, abs=0.01)
        assert condition.mean_torque_constant_velocity == pytest.approx(0.2, rel=0.05)
        square = expected ** 2 * 0.05 * np.sqrt(np.pi / 2) + 0.2 ** 2 * CRUISE
        assert condition.rms_torque == pytest.approx(np.sqrt(square / MOVE), rel=0.02)
        assert condition.false_starts == 0
        at = np.argmin(abs(condition.time - 0.2))
        assert condition.torque_std[at] == pytest.approx(spread, abs=3e-3)
    assert evaluation.reduction('peak_torque') == pytest.approx(1 - 0.4 / 1.2, rel=1e-3)
    assert 0.0 < evaluation.reduction('rms_torque') < evaluation.reduction('peak_torque')
    # A direction against the movement is a condition, and compared with none.
    against = evaluate([trial([1.0] * 2), trial([3.0] * 2, directions=[-1, 1])])
    assert by_key(against)[-1, 'positive'].peak_torque == pytest.approx(3.0, rel=1e-3)
    assert against.reduction('peak_torque') is None


def test_a_joint_that_starts_by_itself_is_seen():
    samples = trial([1.0] * 6, directions=[1, -1] * 3)
    position = samples.position.copy()
    # Before the third movement the joint runs ahead by 2 degrees while nobody pushes.
    begin = 2 * PERIOD + REST
    ahead = (samples.time > begin - 0.3) & (samples.time < begin + 0.3)
    position[ahead] += 0.035
    conditions = by_key(evaluate([samples.with_(position=position)]))
    assert conditions[1, 'positive'].false_starts == 1
    assert conditions[-1, 'negative'].false_starts == 0
    # An early push is not a false start.
    load = samples.load.copy()
    load[ahead | ((samples.time > begin - 0.5) & (samples.time < begin))] += 0.5
    conditions = by_key(evaluate([samples.with_(position=position, load=load)]))
    assert conditions[1, 'positive'].false_starts == 0
    # Nor is one that never rests.
    shaking = samples.position + 0.01 * np.sin(2 * np.pi * 5.0 * samples.time)
    evaluation = evaluate([samples.with_(position=shaking)])
    assert sum(c.false_starts for c in evaluation.conditions) == 0


def test_what_was_not_recorded_is_not_invented():
    """A peak within a hole of the torque is not known, nor a movement in a gap of the motion."""
    samples = trial([1.0] * 6, step=2e-2)
    since = samples.time - 2 * PERIOD - REST
    found = by_key(evaluate([samples.with_(load=np.where(abs(since - 0.2) < 0.3, np.nan,
                                                         samples.load))]))[0, 'positive']
    assert found.repetitions == 3
    assert {found.figures[name][2] for name in ('peak_torque', 'rms_torque')} == {2}
    assert found.peak_torque == pytest.approx(1.0, abs=0.1)
    none = by_key(evaluate([samples.with_(load=np.where(samples.position < 0, 1.0, np.nan))]))
    assert not {'peak_torque', 'peak_time'} & set(none[0, 'positive'].figures)
    for begin, end in ((0.0, 0.5), (1.0, 1.3), (2.3, 3.5)):
        gap = evaluate([samples.take((since < begin) | (since > end))])
        assert sum(c.repetitions for c in gap.conditions) == 5
    cut = evaluate([samples.take(since < 3 * PERIOD + 1.0)])
    assert sorted(c.repetitions for c in cut.conditions) == [2, 3]


# Conditions: who compensated, and how.


def test_laws_models_and_settings_are_never_averaged():
    about = [info_of((0.0, 'paper', 'a.yaml')), info_of((0.0, 'continuous', 'a.yaml')),
             info_of((0.0, 'continuous', 'b.yaml')),
             info_of((0.0, 'continuous', 'a.yaml', 'breakaway_gain 0.5'))]
    evaluation = evaluate([both([peak] * 6, seed) for seed, peak in enumerate(
        (1.0, 0.5, 0.3, 0.7))], about=about)
    found = {evaluation.label(c.compensation): round(c.peak_torque, 1)
             for c in evaluation.conditions if c.movement == 'positive'}
    plain, *others = (f'd = ±1 · {law}' for law in (
        'continuous · a.yaml', 'continuous, breakaway_gain 0.5 · a.yaml', 'continuous · b.yaml',
        'paper · a.yaml'))
    assert found == {plain: 0.5, **dict(zip(others, (0.7, 0.3, 1.0)))}
    # Without a condition d = 0 there is no statement about an improvement over it.
    assert evaluation.reduction('peak_torque') is None


def test_what_changes_within_a_recording_is_told_apart():
    samples = both([1.0] * 4 + [0.4] * 4)
    change = 4 * PERIOD + 0.5 * REST
    about = info_of((0.0, 'paper', 'a.yaml'), (change, 'continuous', 'a.yaml'))
    conditions = evaluate([samples], about=[about]).conditions
    assert {(c.compensation.law, c.movement, c.repetitions) for c in conditions} == {
        (law, way, 2) for law in ('paper', 'continuous') for way in ('positive', 'negative')}
    # A command of zero counts as no compensation, whatever was active.
    off = samples.with_(command=np.where(samples.time < change, 0.0, 0.1))
    assert laws(evaluate([off], about=[about])) == {'none', 'continuous'}
    # A command while the compensator was inactive came from another node.
    other = RecordingInfo('trial', 'elbow', activity=[(0.0, Activity(0, 'inactive', '', ''))])
    assert laws(evaluate([samples.with_(command=np.ones(len(samples)))], about=[other])) == {
        'other'}


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


# The program.


def test_a_joint_that_stuck_took_more_than_was_given():
    def stuck(samples):
        return samples.with_(position=np.zeros(len(samples)))
    plain, helped = both([1.0] * 10), both([0.4] * 10)
    assert evaluate([stuck(plain), helped], about=[KINETIC, LAW]).is_bound
    # The second torque may be more than the bound.
    assert not evaluate([plain, stuck(helped)], about=[KINETIC, LAW]).is_bound
    # The command to a joint at rest is zero although the law is active, and no law twice is one.
    idle = stuck(plain).with_(command=np.zeros(len(plain)))
    assert laws(evaluate([idle], about=[KINETIC])) == {'kinetic'}
    none = RecordingInfo('trial', 'elbow', activity=[(0.0, Activity(0, 'active', 'none', 'a'))])
    assert {c.compensation for c in evaluate([
        idle.with_(direction=None), plain.with_(direction=None)], about=[none] * 2).conditions} == {
        Compensation('none', '', 0)}


def test_each_joint_is_evaluated(tmp_path, capsys):
    write_samples(tmp_path / 'r', [trial([peak] * 4, step=2e-2).with_(joint=joint) for joint, peak
                                   in (('elbow', 1.0), ('wrist', 0.5))])
    (tmp_path / 'broken.mcap').write_bytes(b'no recording')
    command = [str(tmp_path), '--output', str(tmp_path / 'out')]
    assert run('evaluate', command) == 0
    assert 'left out: ' in capsys.readouterr().out
    report = json.loads((tmp_path / 'out' / 'report.json').read_text())
    assert {one['joint']: one['conditions'][0]['peak_torque'] for one in report['joints']} == (
        pytest.approx({'elbow': 1.0, 'wrist': 0.5}, rel=0.02))


# What is said of conditions holds as often as it is said to, whatever happens in a session.

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
            {'peak_torque': torque + scatter * noise[k]}, True, False))
    return found


def peaks_of(repetitions):
    return compare('peak_torque', PLAIN, HELPED, repetitions)


@pytest.mark.parametrize('order', ['in turn', 'drawn'])
@pytest.mark.parametrize('change', [{}, {'drift': -0.3}, {'alike': 0.5}])
def test_sessions_without_a_difference_seldom_show_one(order, change):
    found = [peaks_of(session(ORDERS[order], np.random.default_rng(seed), **change))
             for seed in range(150)]
    assert all(one.interval for one in found)
    assert sum(one.significant for one in found) <= 0.1 * 150


def test_a_difference_is_seen_in_turn_and_never_where_one_came_after_the_other():
    found = [peaks_of(session(ORDERS[order], np.random.default_rng(seed), help=0.3, drift=-0.3))
             for order in ORDERS for seed in range(40)]
    assert not any(one.interval for one in found[:40])
    assert 'no more than 1' in found[0].untested
    assert sum(one.significant for one in found[40:]) > 0.8 * 80


def test_like_is_compared_with_like():
    random = np.random.default_rng(0)
    # What differs from day to day is no effect of what was recorded on one of them only.
    apart = session([0] * 8, random) + session([1] * 8, random, help=0.4, day=1)
    comparison = peaks_of(apart)
    assert (comparison.interval, comparison.pairs, comparison.turns) == (None, 0, 0)
    assert 'different days' in comparison.untested
    # A day on which only one of them was recorded, and a direction, count for nothing.
    same = session([0, 1] * 6, random, scatter=0.01)
    more = same + session([0] * 6, random, day=7)
    for r in more[24:]:
        r.figures['peak_torque'] = 9.0
    assert peaks_of(more).mean_first == pytest.approx(peaks_of(same).mean_first)
    assert peaks_of(more).interval == peaks_of(same).interval
    # Nor are other movements compared.
    faster = [replace(r, movement=replace(r.movement, end=r.movement.begin + 1.5))
              if r.compensation == HELPED else r for r in same]
    assert 'took longer or went farther' in peaks_of(faster).untested
    assert peaks_of(
        session([0, 0], random, signs=(1,)) + session([1, 1], random, signs=(-1,))) is None
