# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The loop that plans its own motion: from no data to a model that predicts new motion."""

import functools
import json
import math

from helpers import note_model, short_search
from node_process import fork_nodes_of_tools
import numpy as np
import pytest

from friction_comp.__main__ import run
from friction_comp.errors import InputError
from friction_comp.excitation.improve import improve, prediction_error, Schedule
from friction_comp.excitation.joint_limits import JointLimits
from friction_comp.excitation.plan import plan_joint
from friction_comp.excitation.separation import open_pairs
from friction_comp.model.friction_model import FrictionModel
from friction_comp.reports.excitation_report import improvement_report
from friction_comp.tools.processes import plant_parameters
from simulated_recordings.drives import random_drive
from simulated_recordings.played import PlayedDrive

LIMITS = JointLimits('joint', -1.5, 1.5, 1.2, 6.0)


@pytest.fixture(scope='module')
def improved():
    drive = random_drive(1, ['bump', 'gravity'])
    told = []
    with short_search(4):
        result = improve(PlayedDrive(drive, 1), LIMITS, drive.model.drive,
                         schedule=Schedule(20.0, 80.0, 1), done=told.append)
    return drive, result, told


@pytest.mark.slow
def test_two_hidden_effects_are_found_and_the_model_is_trusted(improved):
    drive, result, _ = improved
    assert result.verdict == 'trust'
    assert set(result.rounds[-1].effects) - {'inertia'} == {'bump', 'gravity'}
    assert result.rounds[-1].held_out_rmse < 1.3 * drive.noise_floor
    # As the verdict promises, motion that was not planned is predicted as accurately.
    with short_search(4):
        other = plan_joint(LIMITS, [('gravity', 'spring')], 20.0, 77)
    assert prediction_error(result.result.model, PlayedDrive(drive, 5)(other)) < (
        1.3 * result.rounds[-1].held_out_rmse)


@pytest.mark.slow
def test_no_model_is_trusted_before_a_new_motion_has_tested_it(improved):
    _, result, told = improved
    first = result.rounds[0]
    assert math.isnan(first.predicted_rmse)
    assert first.verdict != 'trust'
    assert any('tested' in reason for reason in first.reasons)
    assert [len(one.rounds) for one in told] == list(range(1, len(result.rounds) + 1))


@pytest.mark.slow
def test_page_and_report_tell_each_round(improved, tmp_path):
    _, result, _ = improved
    report = result.report()
    assert report['rounds'][0]['predicted_rmse'] is None
    assert report['rounds'][-1]['verdict'] == report['verdict'] == 'trust'
    json.dumps(report['rounds'], allow_nan=False)
    improvement_report(result, ['a']).save(tmp_path / 'page.html')
    text = (tmp_path / 'page.html').read_text(encoding='utf-8')
    assert 'Rounds' in text
    assert 'refinement.html' in text


@pytest.mark.slow
@short_search(1)
def test_a_drive_that_changes_between_rounds_is_not_trusted():
    drive = random_drive(3, ['gravity'])
    played, worse = PlayedDrive(drive, 2), []

    def play(plan):
        samples = played(plan)
        worse.append(1.0 + 0.25 * len(worse))
        return samples.with_(current=samples.current * worse[-1])
    result = improve(play, LIMITS, drive.model.drive, schedule=Schedule(20.0, 40.0, 3))
    assert result.verdict != 'trust'
    assert result.rounds[-1].predicted_rmse > 2.0 * drive.noise_floor


def test_a_budget_without_a_test_is_refused():
    with pytest.raises(InputError, match='less than two rounds'):
        Schedule(30.0, 50.0)


def test_what_a_report_leaves_open_is_asked_next():
    report = {'ambiguous': [{'between': ['position', 'time']}], 'unexplained': [],
              'effects': [{'name': 'stribeck', 'chosen': 0.7}, {'name': 'spring', 'chosen': 1.0}]}
    pairs = open_pairs(report)
    assert any(set(pair) == {'gravity', 'warm_up'} for pair in pairs)
    assert any(set(pair) == {'stribeck', 'viscous_shape'} for pair in pairs)
    assert len({frozenset(pair) for pair in pairs}) == len(pairs)
    assert open_pairs({'ambiguous': [], 'effects': [], 'unexplained': []}) == []


@pytest.mark.parametrize('wrong, words', [
    (['--undeclared', 'x.yaml'], '--undeclared goes with --simulate'),
    ([], '--model, or --torque-constant and --gear-ratio'),
    (['--torque-constant', '0.1', '--gear-ratio', '100', '--budget', '20'], 'less than two rounds'),
    (['--torque-constant', '0.1', '--gear-ratio', '100', '--recorded', 'missing'], 'missing')])
def test_wrong_input_is_one_line(wrong, words, refuses):
    refuses(words, 'improve', '--joint', 'elbow', '--position', '-1', '1', '--velocity', '1',
            '--acceleration', '5', *wrong)


@pytest.mark.slow
@pytest.mark.processes
@short_search(1)
def test_one_command_goes_from_nothing_to_a_tested_model(tmp_path, monkeypatch):
    pytest.importorskip('rclpy', reason='ROS 2 is not in this environment')
    fork_nodes_of_tools(monkeypatch)
    # The lowest sample rate that a plant allows.
    monkeypatch.setattr('friction_comp.tools.improve.plant_parameters', functools.partial(
        plant_parameters, sample_time=1e-2))
    output = tmp_path / 'improved'
    assert run('improve', [
        '--simulate', 'config/armin_configuration_1.yaml', '--position', '-1', '1', '--velocity',
        '1.5', '--acceleration', '6', '--seconds', '20', '--budget', '40', '--output',
        str(output)]) == 0
    report = json.loads((output / 'report.json').read_text(encoding='utf-8'))
    assert len(report['rounds']) == 2
    predicted, held_out = (report['rounds'][1][name] for name in ('predicted_rmse',
                                                                  'held_out_rmse'))
    assert predicted < 1.5 * held_out
    model = FrictionModel.load(output / 'model.yaml')
    speeds = np.array([-1.2, -0.6, 0.6, 1.2])
    np.testing.assert_allclose(model.sigmoid(speeds), note_model().sigmoid(speeds), rtol=0.1)
    assert {path.name for path in (output / 'recordings').iterdir()} == {'round_1', 'round_2'}
