# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The doctor names the faults of a system, and reports nothing if there are none."""

from argparse import Namespace
from dataclasses import replace
import json
import re

from helpers import ROOT
import numpy as np
import pytest

from friction_comp.__main__ import main
from friction_comp.facts.resolution import encoder_fault
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import write_arm
from friction_comp.monitoring.checkup import check_joint, check_system
from friction_comp.monitoring.observation import (
    Endpoint,
    Finding,
    Observation,
    PROBLEM,
    StatesSeen,
    TopicSeen,
    WARNING,
)
from friction_comp.package_files import package_file
from friction_comp.tools import doctor
from friction_comp.topics import TOPICS

MODEL = FrictionModel.load(package_file('config', 'armin_configuration_1.yaml'))
JOINT = 'elbow'


def states(share=1.0):
    """Half a minute of a motor that moves with a share of the model's friction."""
    time = 1e9 + np.arange(0.0, 30.0, 0.002)
    position = 0.5 * np.sin(1.3 * (time - 1e9))
    velocity = np.gradient(position, time)
    effort = share * MODEL.sigmoid(velocity) * MODEL.drive.torque_per_current
    return StatesSeen([JOINT], time + 1e-3, time, position[:, None],
                      velocity[:, None], effort[:, None])


def healthy():
    """Return a system in which nothing is wrong: a motor moves the joint."""
    driver, commander = Endpoint('/driver'), Endpoint('/controller')
    return Observation(
        30.0, nodes=['/driver', '/controller'], names={name: f'/{name}' for name in TOPICS},
        topics={'/joint_states': TopicSeen([TOPICS['joint_states']], [driver], [commander]),
                '/current_command': TopicSeen([TOPICS['current_command']], [commander], [driver])},
        states=states(), commands=np.zeros((15000, 1)),
        parameters={'/driver': {'command_timeout': 0.1, 'use_sim_time': False}})


def wrong(seen, *levels):
    return [finding for finding in check_system(seen) if finding.level in (
        levels or (PROBLEM, WARNING))]


def test_a_healthy_system_has_no_problem_and_no_warning():
    assert wrong(healthy()) == []
    assert {finding.level for finding in check_joint(healthy(), JOINT, MODEL)} == {'ok'}


def test_two_drivers_with_a_joint_each_are_no_fault():
    seen = healthy()
    one, first = seen.states, np.arange(len(seen.states.stamp)) % 2 == 0
    named = np.column_stack((first, ~first))
    # Each message arrives later than it was stamped, by a time of its own.
    seen.states = StatesSeen(
        [JOINT, 'wrist'], one.received, one.stamp - np.where(first, 0.0, 3e-3),
        *(np.where(named, values, np.nan) for values in (one.position, one.velocity, one.effort)),
        named=named)
    seen.commands, seen.commanded = seen.commands[first][1:], one.received[first][1:]
    seen.topics['/current_command'].publishers[:] = [Endpoint('/compensator')]
    assert wrong(seen) == []
    for joint in seen.states.joints:
        assert {finding.level for finding in check_joint(seen, joint, MODEL)} <= {'ok', 'note'}
    seen.states.stamp[100] -= 1.0
    assert any('backwards' in finding.what for finding in wrong(seen))


def test_a_planner_that_stamps_its_directions_is_one():
    seen = healthy()
    seen.topics['/direction'] = TopicSeen([TOPICS['direction']], [], [Endpoint('/compensator')])
    assert any(finding.about == 'direction' for finding in check_system(seen))
    seen.topics['/direction_stamped'] = TopicSeen(
        [TOPICS['direction_stamped']], [Endpoint('/planner')], [Endpoint('/compensator')])
    assert not any(finding.about == 'direction' for finding in check_system(seen))


def test_gaps_and_noise_are_not_reported_as_wrong_velocity():
    seen = healthy()
    good = seen.states
    random = np.random.default_rng(1)
    # On a busy machine the simulation sometimes pauses while its stamps go on.
    stamp = good.stamp + 0.2 * (np.arange(len(good.stamp)) // 1000)
    seen.states = replace(good, stamp=stamp, received=stamp + 1e-3,
                          velocity=good.velocity + 0.5 * random.standard_normal(
                              good.velocity.shape))
    assert not [finding for finding in wrong(seen) if 'velocity' in finding.what]


def held_up(seen):
    received = seen.states.received.copy()
    received[7000:] += 0.2
    seen.states = replace(seen.states, received=received, stamp=received - 1e-3)


def other_name(seen):
    seen.topics['/robot/joint_states'] = seen.topics.pop('/joint_states')
    seen.states = None


def announced(seen, value, *planners):
    for name, planner in zip(('direction', 'direction_stamped'), planners):
        seen.topics[f'/{name}'] = TopicSeen([TOPICS[name]], [Endpoint(planner)], [])
    seen.directions = [[value]] * 300


def changed(**changes):
    """Return what changes the joint states of a system."""
    return lambda seen: setattr(seen, 'states', replace(seen.states, **changes))


@pytest.mark.parametrize(('harm', 'about', 'words'), [
    (lambda seen: seen.topics['/current_command'].subscribers.clear(),
     'current_command', 'nobody subscribes'),
    (lambda seen: seen.topics['/current_command'].publishers.append(Endpoint('/compensator')),
     'current_command', 'may command'),
    (lambda seen: seen.topics['/joint_states'].publishers.append(
        Endpoint('/driver', reliable=False)), 'QoS', 'best effort'),
    (lambda seen: seen.topics.update({'/direction': TopicSeen(
        ['std_msgs/msg/String', TOPICS['direction']],
        [Endpoint('/planner', kind='std_msgs/msg/String')],
        [Endpoint('/compensator', kind=TOPICS['direction'])])}), 'types',
     '/planner publishes std_msgs/msg/String: nothing arrives'),
    (other_name, 'joint_states', '/robot/joint_states'),
    (held_up, 'rate', 'longest gap'),
    (changed(received=healthy().states.received + 3.0), 'clocks', 'old'),
    (lambda seen: seen.parameters.update({'/compensator': {'use_sim_time': True}}),
     'clocks', '/clock'),
    (changed(velocity=-healthy().states.velocity), JOINT, '-1 times'),
    (changed(velocity=np.degrees(healthy().states.velocity)), JOINT, 'velocity is in deg/s'),
    (changed(position=np.degrees(healthy().states.position),
             velocity=np.degrees(healthy().states.velocity)), JOINT, 'degrees or that of'),
    (changed(twice=[JOINT]), 'joint_states', f'{JOINT} is named twice'),
    (lambda seen: seen.states.position.__setitem__(7, 1e300), JOINT, '1e+300 rad is impossible'),
    (lambda seen: announced(seen, 1, '/exercise', '/planner'), 'direction', '/exercise, /planner'),
    (lambda seen: announced(seen, 2, '/exercise'), 'direction', '[2]'),
    (lambda seen: seen.states.effort.fill(np.nan), JOINT, 'no effort'),
    (lambda seen: seen.parameters['/driver'].update(command_timeout=0.0),
     'driver', 'command_timeout'),
    (lambda seen: seen.diagnostics.update(compensator=(2, 'no joint_states')),
     'compensator', 'no joint_states'),
    (lambda seen: seen.diagnostics.update({
        'compensator: compensation': (2, 'an error in the law (latched)')}),
     'compensator: compensation', 'law (latched)')])
def test_each_fault_is_reported_with_a_remedy(harm, about, words):
    seen = healthy()
    harm(seen)
    found = [finding for finding in wrong(seen) if finding.about == about]
    assert any(words in finding.what for finding in found), wrong(seen)
    assert all(finding.do for finding in found)


@pytest.mark.parametrize('counts, said', [
    (None, ''), (0.5, ''), (1.0, ''), (20.0, '20 times that of drive.encoder_counts')])
def test_a_position_coarser_than_the_encoder_of_the_model_is_named(counts, said):
    seen, drive = healthy(), MODEL.drive
    if counts:
        step = counts * drive.position_resolution
        seen.states = replace(
            seen.states, position=np.round(seen.states.position / step) * step)
    found = [finding.what for finding in check_joint(seen, JOINT, MODEL)
             if 'encoder_counts' in finding.what]
    assert len(found) == bool(said)
    assert said in ' '.join(found)
    # A constant velocity has equal changes, whatever the encoder.
    assert not encoder_fault(drive, 0.0123 * np.arange(1000))


def test_a_current_against_the_motion_is_a_problem_before_any_model_is_compared():
    seen = healthy()
    seen.states = states(share=-1.0)
    found = check_joint(seen, JOINT, MODEL)
    assert [finding.level for finding in found] == [PROBLEM]
    assert 'sign' in found[0].do


def lowered(sign):
    """Ten seconds in which a weight of four times the friction goes up fast and down slowly."""
    time = 1e9 + np.arange(0.0, 10.0, 0.002)
    phase = np.minimum((time - 1e9) % 5.0 / 1.0, 1.0 - ((time - 1e9) % 5.0 - 1.0) / 4.0)
    position = 1.0 + 0.5 * np.sin(np.pi * (phase - 0.5))
    velocity = np.gradient(position, time)
    friction = MODEL.sigmoid(velocity)
    effort = sign * (friction + 4.0 * friction.max() * np.sin(position)
                     ) * MODEL.drive.torque_per_current
    return StatesSeen([JOINT], time + 1e-3, time, position[:, None], velocity[:, None],
                      effort[:, None])


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_weight_that_is_lowered_is_no_current_against_the_motion(sign):
    seen = healthy()
    seen.states = lowered(sign)
    current, velocity = seen.states.effort[:, 0], seen.states.velocity[:, 0]
    # Most of the time, the motor holds back the weight.
    assert np.mean(sign * current * np.sign(velocity)) < 0.0
    found = check_joint(seen, JOINT, MODEL)
    assert any('opposes' in finding.what for finding in found) == (sign < 0.0)
    assert any('same sign' in finding.what for finding in found) == (sign > 0.0)


def test_in_one_direction_alone_the_sign_of_the_current_is_not_judged():
    seen = healthy()
    whole = lowered(-1.0)
    one = whole.velocity[:, 0] < -1e-3
    seen.states = StatesSeen(
        [JOINT], whole.received[one], whole.stamp[one], whole.position[one], whole.velocity[one],
        whole.effort[one])
    found = check_joint(seen, JOINT, MODEL)
    assert not any('same sign' in finding.what or 'opposes' in finding.what for finding in found)
    assert any('could not be checked' in finding.what and finding.do for finding in found)


def test_an_effort_in_ampere_is_compared_as_a_current():
    seen = healthy()
    seen.states.effort /= MODEL.drive.torque_per_current
    assert any('lower' in finding.what for finding in check_joint(seen, JOINT, MODEL))
    seen.effort_is_current = True
    assert {finding.level for finding in check_joint(seen, JOINT, MODEL)} == {'ok'}


def compensated(share):
    """Return a system whose compensator's commands come out as a share of themselves."""
    seen = healthy()
    seen.topics['/current_command'].publishers[:] = [Endpoint('/compensator')]
    seen.parameters['/compensator'] = {'joints': [JOINT], 'model_files': ['a.yaml']}
    seen.commands = seen.states.effort / MODEL.drive.torque_per_current / share
    # Each answers the state before.
    seen.commanded = seen.states.received + 1e-3
    return seen


def test_a_joint_of_the_compensator_is_read_from_the_file_of_a_whole_arm(tmp_path):
    seen = compensated(1.0)
    write_arm(tmp_path / 'arm.yaml',
              {name: replace(MODEL, joint=name) for name in (JOINT, 'wrist')})
    seen.parameters['/compensator']['model_files'] = [str(tmp_path / 'arm.yaml')]
    found = doctor._check_models(seen, [])
    assert {finding.level for finding in found} <= {'ok', 'note'}
    assert 'follows' in found[0].what


@pytest.mark.parametrize(('share', 'level', 'words'), [
    (1.0, 'ok', 'follows'), (-1.0, PROBLEM, 'sign'), (0.5, WARNING, '0.5 times')])
def test_the_measured_current_is_compared_with_the_commanded_one(share, level, words):
    found = check_joint(compensated(share), JOINT, MODEL)
    assert found[0].level == level
    assert words in found[0].what
    assert bool(found[0].do) == (level != 'ok')


def test_a_commanded_torque_is_compared_as_the_current_that_it_is():
    seen = compensated(1.0)
    seen.commands, seen.command_unit = seen.states.effort, 'N·m'
    assert 'follows' in check_joint(seen, JOINT, MODEL)[0].what
    assert any('N·m' in finding.what for finding in check_system(seen)
               if finding.about == 'current_command')


def test_a_command_that_the_drive_does_not_obey_is_named():
    seen = compensated(1.0)
    seen.commands = seen.commands[::-1] * np.random.default_rng(0).choice(
        (-1.0, 1.0), seen.commands.shape)
    found = check_joint(seen, JOINT, MODEL)
    assert found[0].level == WARNING
    assert 'does not follow' in found[0].what


def test_half_the_current_is_a_model_that_does_not_fit():
    seen = healthy()
    seen.states = states(share=0.5)
    found = check_joint(seen, JOINT, MODEL)
    assert found[-1].level == WARNING
    assert '50 % lower' in found[-1].what


def test_under_a_compensator_only_a_measured_load_tells_about_the_model():
    seen = healthy()
    seen.topics['/current_command'].publishers[:] = [Endpoint('/compensator')]
    found = check_joint(seen, JOINT, MODEL)
    assert 'no load is measured' in found[0].what
    seen.load[JOINT] = np.column_stack((seen.states.received, np.zeros(len(seen.states.received))))
    assert {finding.level for finding in check_joint(seen, JOINT, MODEL)} == {'ok'}


def test_observing_for_longer_is_no_advice_where_a_signal_of_the_model_is_missing():
    warm = EFFECTS['temperature'](
        {'reference_temperature': 25.0, 'transition': 0.02, 'coefficients': [0.01, 0.0]})
    found = check_joint(healthy(), JOINT, replace(MODEL, effects=[warm]))
    assert 'temperature' in found[-1].what
    assert not found[-1].do


def test_without_a_running_system_it_says_so_and_ends_well():
    found = check_system(Observation(1.0))
    assert [finding.level for finding in found] == ['note']
    assert 'ROS_DOMAIN_ID' in found[0].do


def test_the_machine_alone(capsys, monkeypatch):
    assert doctor.main(['--installed', '--json']) in (0, 1)
    findings = json.loads(capsys.readouterr().out)['findings']
    assert {'Python', 'numpy', 'ROS 2'} <= {finding['about'] for finding in findings}
    monkeypatch.setattr(doctor, '_PACKAGES', (('no_such_module', 'nothing', '', False),))
    assert doctor.main(['--installed']) == 1
    assert 'pip install nothing' in capsys.readouterr().out


def test_everything_that_is_required_is_looked_for():
    required = re.findall(r'^[\w-]+', (ROOT / 'requirements' / 'run.txt').read_text(
        encoding='utf-8'), re.MULTILINE)
    looked_for = {name for _, name, _, optional in doctor._PACKAGES if not optional}
    assert {name.lower() for name in looked_for} == {name.lower() for name in required}


@pytest.mark.parametrize('only', [[], ['--installed']])
def test_a_model_that_cannot_be_used_is_named_before_anything_is_looked_at(
        monkeypatch, capsys, only):
    monkeypatch.setattr(doctor, 'check_machine', lambda: 1 / 0)
    assert main(['doctor', *only, '--model', 'nothere.yaml']) == 2
    assert 'nothere.yaml: No such file' in capsys.readouterr().err


@pytest.mark.parametrize(('levels', 'said'), [
    ([PROBLEM], '1 problem, 0 warnings'), ([PROBLEM, PROBLEM, WARNING], '2 problems, 1 warning')])
def test_problems_and_warnings_are_counted(capsys, levels, said):
    doctor._print([Finding(level, 'rate', 'slow') for level in levels])
    assert said in capsys.readouterr().out.splitlines()


def test_a_middleware_that_is_not_installed_is_named_before_it_ends_the_process(
        capsys, monkeypatch):
    pytest.importorskip('rclpy', reason='ROS 2 is not in this environment')
    monkeypatch.setenv('RMW_IMPLEMENTATION', 'rmw_of_another_world_cpp')
    assert doctor.main(['--seconds', '0.1', '--json']) == 1
    finding, = (one for one in json.loads(capsys.readouterr().out)['findings']
                if one['about'] == 'middleware')
    assert 'rmw_of_another_world_cpp' in finding['what']
    assert 'unset RMW_IMPLEMENTATION' in finding['do']


def test_every_action_is_looked_for(monkeypatch):
    built = Namespace(IdentifyFriction=None, RefineModel=None)
    monkeypatch.setattr(doctor.importlib, 'import_module', lambda name: built)
    finding, = doctor._interfaces()
    assert (finding.level, finding.what) == (PROBLEM, 'no PlayTrajectory')
    built.PlayTrajectory = None
    finding, = doctor._interfaces()
    assert finding.what == 'IdentifyFriction, PlayTrajectory, RefineModel'
