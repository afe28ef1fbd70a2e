# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The evaluation of trials with known torques returns these torques."""

import html

import numpy as np
import pytest

from friction_comp.__main__ import run
from friction_comp.errors import InputError
from friction_comp.evaluation.conditions import evaluate
from friction_comp.evaluation.movements import find_movements
from friction_comp.evaluation.repetitions import Compensation
from friction_comp.recordings import RecordingInfo, write_samples
from friction_comp.recordings.activity import Activity
from friction_comp.reports.evaluation_words import measure_text
from friction_comp.samples import Samples

REST, RAMP, CRUISE, SPEED = 2.0, 0.5, 1.5, 0.4
MOVE = 2 * RAMP + CRUISE
PERIOD = REST + MOVE
STEP = 2e-3


def trial(peaks, push=0.2, directions=None, seed=0, noise=0.0, step=STEP):
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
    load = load + noise * np.random.default_rng(seed).normal(size=len(time))
    return Samples(
        time=time, position=position,
        current=np.zeros_like(time), load=load, direction=direction,
        reference_position=position, reference_velocity=velocity, joint='elbow')


def by_key(evaluation):
    return {(c.direction, c.movement): c for c in evaluation.conditions}


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
    # Without a reference the motion itself tells, a little less sharply.
    bare = find_movements(samples.with_(reference_position=None, reference_velocity=None))
    assert [m.sign for m in bare] == [1, -1, 1, -1]
    assert bare[2].begin == pytest.approx(2 * PERIOD + REST, abs=0.12)
    # A reference without velocity gives the same result.
    shown = find_movements(samples.with_(reference_velocity=None))
    assert shown[1].begin == pytest.approx(PERIOD + REST, abs=0.01)


def test_figures_of_each_condition():
    plain = trial([1.2] * 6)
    assisted = trial([0.4] * 6, directions=[1, -1] * 3)
    evaluation = evaluate([plain, assisted])
    conditions = by_key(evaluation)
    assert set(conditions) == {(0, 'positive'), (0, 'negative'), (1, 'positive'), (-1, 'negative')}
    for condition in conditions.values():
        expected = 1.2 if condition.direction == 0 else 0.4
        assert condition.repetitions == 3
        assert condition.peak_torque == pytest.approx(expected, rel=1e-3)
        assert condition.peak_torque_std == pytest.approx(0.0, abs=1e-3)
        assert condition.peak_time == pytest.approx(0.2, abs=0.01)
        assert condition.mean_torque_constant_velocity == pytest.approx(0.2, rel=0.05)
        square = expected ** 2 * 0.05 * np.sqrt(np.pi / 2) + 0.2 ** 2 * CRUISE
        assert condition.rms_torque == pytest.approx(np.sqrt(square / MOVE), rel=0.02)
        assert condition.false_starts == 0
    assert evaluation.reduction('peak_torque') == pytest.approx(1 - 0.4 / 1.2, rel=1e-3)
    assert 0.0 < evaluation.reduction('rms_torque') < evaluation.reduction('peak_torque')


def test_averages_and_deviations_over_repetitions():
    peaks = [1.0, 5.0, 1.2, 5.0, 1.4, 5.0]
    condition = by_key(evaluate([trial(peaks)]))[0, 'positive']
    assert condition.peak_torque == pytest.approx(1.2, rel=1e-3)
    assert condition.peak_torque_std == pytest.approx(np.std([1.0, 1.2, 1.4], ddof=1), rel=1e-2)
    at = np.argmin(abs(condition.time - 0.2))
    assert condition.torque_std[at] == pytest.approx(0.2, rel=0.03)
    # Averaging reduces noise, but not in the peaks of single repetitions.
    noisy = by_key(evaluate([trial([1.0, 1.0] * 10, noise=0.05)]))[0, 'positive']
    assert noisy.peak_torque == pytest.approx(1.0, abs=0.06)


def test_conditions_of_several_recordings_are_merged():
    evaluation = evaluate([trial([1.0] * 4), trial([2.0] * 2), trial([0.5] * 2,
                                                                      directions=[1, -1])])
    conditions = by_key(evaluation)
    assert conditions[0, 'positive'].repetitions == 3
    assert conditions[0, 'positive'].peak_torque == pytest.approx(4 / 3, rel=1e-3)
    assert evaluation.reduction('peak_torque') == pytest.approx(1 - 0.5 * 3 / 4, rel=1e-3)


def test_direction_against_the_movement_is_not_compared():
    evaluation = evaluate([trial([1.0] * 2), trial([3.0] * 2, directions=[-1, 1])])
    assert by_key(evaluation)[-1, 'positive'].peak_torque == pytest.approx(3.0, rel=1e-3)
    assert evaluation.reduction('peak_torque') is None
    assert evaluation.reduction('rms_torque') is None


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


def test_a_joint_that_finds_no_rest_is_mentioned():
    samples = trial([1.0] * 4)
    shaking = samples.position + 0.01 * np.sin(2 * np.pi * 5.0 * samples.time)
    evaluation = evaluate([samples.with_(position=shaking)])
    assert any('did not come to rest' in note for note in evaluation.notes)
    assert sum(c.false_starts for c in evaluation.conditions) == 0
    assert not any('rest' in note for note in evaluate([samples]).notes)


def test_movements_between_long_rests_are_found():
    """A robot that is adjusted to a patient rests for minutes."""
    samples = trial([1.0] * 4)
    rest = np.arange(1, 700_000) * STEP
    before = samples.take(np.zeros(len(rest), dtype=int)).with_(time=rest)
    long = Samples.concatenate([before, samples.with_(time=samples.time + rest[-1] + STEP)])
    long = long.with_(recording=np.zeros(len(long), dtype=int))
    for one in (long, long.with_(reference_position=None, reference_velocity=None)):
        movements = find_movements(one)
        assert [m.begin - rest[-1] for m in movements] == pytest.approx(
            [REST + k * PERIOD for k in range(4)], abs=0.1)


def test_a_movement_without_measured_torque_has_no_peak():
    samples = trial([1.0] * 2)
    load = np.where(samples.time > PERIOD, np.nan, samples.load)
    found = by_key(evaluate([samples.with_(load=load)]))
    assert found[0, 'positive'].figures['peak_torque'].mean == pytest.approx(1.0, rel=1e-2)
    assert not {'peak_torque', 'peak_time'} & set(found[0, 'negative'].figures)


def test_incomplete_and_odd_repetitions_are_left_out():
    samples = trial([1.0] * 6)
    cut = samples.take(slice(0, round((5 * PERIOD + REST + 1.0) / STEP)))
    evaluation = evaluate([cut])
    assert {key: c.repetitions for key, c in by_key(evaluation).items()} == {
        (0, 'positive'): 3, (0, 'negative'): 2}
    assert any('cut off' in note for note in evaluation.notes)


def test_recordings_without_what_is_needed():
    samples = trial([1.0] * 2)
    still = samples.with_(reference_velocity=None, reference_position=None,
                          position=np.zeros(len(samples)))
    with pytest.raises(InputError, match='no movement'):
        evaluate([still])
    # An oscillation by one count is not a movement, nor is that of another joint's reference.
    dither = still.with_(position=1e-3 * (np.arange(len(samples)) // 300 % 2))
    with pytest.raises(InputError, match='no movement'):
        evaluate([dither])
    with pytest.raises(InputError, match='no movement'):
        evaluate([samples.with_(reference_velocity=np.zeros(len(samples)))])
    with pytest.raises(InputError, match='no recording'):
        evaluate([])
    evaluation = evaluate([samples.with_(direction=None)])
    assert {c.direction for c in evaluation.conditions} == {0}
    assert any('d = 0 is assumed' in note for note in evaluation.notes)


def stuck_trial(set_out=None):
    """Make a trial of two movements in which the joint stands still, or sets out too late.

    The person is a spring to the reference: behind the positive movement 1.3 N·m are left, which
    are still there as the negative movement begins. Where the joint sets out, the push has grown
    to 1.7 N·m `set_out` seconds after the movement began.
    """
    samples = trial([0.0, 0.0], push=0.0)
    stiffness = 1.3 / samples.reference_position.max()
    position = np.zeros(len(samples))
    if set_out is not None:
        for k, sign in enumerate((1, -1)):
            since = samples.time - k * PERIOD - REST - set_out
            position += sign * samples.reference_position.max() * np.clip(since / 0.5, 0.0, 1.0)
    load = stiffness * (samples.reference_position - position)
    if set_out is not None:
        for k, sign in enumerate((1, -1)):
            since = samples.time - k * PERIOD - REST
            load += 0.4 * sign * np.clip(since - set_out + 1.0, 0.0, 1.0) * (since < set_out)
    return samples.with_(position=position, load=load, command=np.zeros(len(samples)))


def test_torque_left_from_the_previous_movement_is_not_a_peak():
    for condition in evaluate([stuck_trial()]).conditions:
        assert condition.stuck == 1
        assert condition.peak_time >= 0.0
        # The negative movement begins with 1.3 N·m left over and lowers this to zero.
        expected = 1.3 if condition.movement == 'positive' else 0.0
        assert condition.peak_torque == pytest.approx(expected, abs=0.01)


def test_the_peak_of_a_joint_that_starts_late_includes_the_torque_before_it():
    evaluation = evaluate([stuck_trial(set_out=MOVE + 0.6)])
    for condition, repetition in zip(evaluation.conditions, evaluation.repetitions):
        assert condition.stuck == 0
        assert condition.peak_torque == pytest.approx(1.7, abs=0.03)
        assert condition.peak_time == pytest.approx(MOVE + 0.6, abs=0.02)
        assert repetition.figures['onset'] == pytest.approx(MOVE + 0.6, abs=0.05)


def test_a_lower_bound_is_marked_and_no_compensation_is_one_condition(tmp_path, capsys):
    moved = trial([1.6, 1.6]).with_(command=np.zeros(round((2 * PERIOD + REST) / STEP)))
    both = Samples.concatenate([moved, stuck_trial().with_(
        time=stuck_trial().time + moved.time[-1] + STEP)])
    about = RecordingInfo('trial', 'elbow', activity=[
        (0.0, Activity(0, 'active', 'none', 'elbow.yaml'))])
    evaluation = evaluate([both.with_(recording=0 * both.recording)], about=[about])
    assert {c.compensation for c in evaluation.conditions} == {Compensation('none', '', 0)}
    report = evaluation.as_dict()
    assert [c['stuck'] for c in report['conditions']] == [1, 1]
    assert '>\u00a0' in measure_text(evaluation.conditions[0], 'peak_torque')
    write_samples(tmp_path / 'r', stuck_trial())
    assert run('evaluate', [str(tmp_path / 'r'), '--output', str(tmp_path / 'out')]) == 0
    out = capsys.readouterr().out
    assert 'the joint did not move in 2 of 2' in out
    assert '>\u00a0' in out
    page = (tmp_path / 'out' / 'report.html').read_text(encoding='utf-8')
    assert '>\u00a01.30' in html.unescape(page)
