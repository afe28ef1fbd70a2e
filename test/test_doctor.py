# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The doctor names the faults of a system, and reports nothing if there are none."""

from argparse import Namespace
import json

from helpers import ROOT
import numpy as np
import pytest

from friction_comp.model.friction_model import FrictionModel
from friction_comp.monitoring.checkup import check_system, Endpoint, Observation
from friction_comp.tools import doctor
from friction_comp.topics import TOPICS

FILE = ROOT / 'config' / 'armin_configuration_1.yaml'
DRIVE = FrictionModel.load(FILE).drive
JOINT = 'elbow'
STATES, DIRECTIONS, COMMANDS = (
    TOPICS[name] for name in ('joint_states', 'direction', 'current_command'))


def healthy():
    """Return a system in which nothing is wrong: a motor moves a joint, as it is commanded."""
    driver, commander = '/driver', '/compensator'
    stamp = 1e9 + np.arange(0.0, 10.0, 0.002)
    position = 0.5 * np.sin(1.3 * (stamp - 1e9))
    current = 0.1 * np.cos(1.3 * (stamp - 1e9))
    return Observation(
        10.0, nodes=[driver, commander], names={name: f'/{name}' for name in TOPICS},
        topics={'/joint_states': ([Endpoint(driver, STATES)], [Endpoint(commander, STATES, False)]),
                '/current_command': ([Endpoint(commander, COMMANDS)],
                                     [Endpoint(driver, COMMANDS)])},
        states={JOINT: np.column_stack((stamp + 1e-3, stamp, position, np.gradient(position, stamp),
                                        DRIVE.torque_per_current * current))},
        commands=np.column_stack((stamp + 1e-3, current)),
        parameters={driver: {'command_timeout': 0.1}, commander: {
            'joints': [JOINT], 'model_files': [str(FILE)], 'joint_state_timeout': 0.05}})


def column(index, change):
    """Return what changes a column of the joint's states."""
    def harm(seen):
        rows = seen.states[JOINT]
        rows[:, index] = change(rows[:, index])
    return harm


def topic(name, publishers, subscribers=()):
    """Return what puts nodes with types at the ends of a topic."""
    ends = tuple([Endpoint(node, kind) for node, kind in some] for some in (
        publishers, subscribers))
    return lambda seen: seen.topics.update({f'/{name}': ends})


def alone(seen):
    seen.topics['/robot/joint_states'] = seen.topics.pop('/joint_states')
    seen.topics['/joint_states'] = [], [Endpoint('/compensator', STATES)]
    seen.states.clear()


def degrees(seen):
    column(2, np.degrees)(seen)
    column(3, np.degrees)(seen)


@pytest.mark.parametrize(('harm', 'about', 'words'), [
    (lambda seen: seen.topics['/current_command'][1].clear(), 'current_command', 'nobody reads'),
    (lambda seen: seen.topics['/current_command'][0].append(Endpoint('/other', COMMANDS)),
     'current_command', 'several nodes publish it: /compensator, /other'),
    (lambda seen: seen.topics['/joint_states'][1].append(Endpoint('/viewer', STATES)) or
     seen.topics['/joint_states'][0].__setitem__(0, Endpoint('/driver', STATES, False)), 'QoS',
     '/viewer reads it as sensor_msgs/msg/JointState, reliable: nothing arrives'),
    (topic('direction', [('/planner', 'std_msgs/msg/String')], [('/compensator', DIRECTIONS)]),
     'QoS', '/planner publishes /direction as std_msgs/msg/String'),
    (alone, 'joint_states', '/robot/joint_states has that type'),
    (lambda seen: seen.states.clear(), 'joint_states', 'nothing arrives'),
    (lambda seen: seen.states[JOINT][2500:, :2].__iadd__(0.2), JOINT, 'longest gap 202 ms'),
    (lambda seen: seen.states.update({JOINT: seen.states[JOINT][::5]}), JOINT, '100 Hz'),
    (column(0, lambda received: received + 3.0), 'clocks', '3 s old'),
    (lambda seen: seen.states[JOINT].__setitem__((70, 1), 0.0), 'clocks', 'go backwards'),
    (column(3, np.negative), JOINT, '-1 times'),
    (column(3, np.degrees), JOINT, 'velocity is in deg/s'),
    (degrees, JOINT, 'degrees or that of'),
    (column(4, lambda effort: np.full_like(effort, np.nan)), JOINT, 'have no effort'),
    (column(4, np.negative), JOINT, 'wrong sign'),
    (column(4, lambda effort: 1000.0 * effort), JOINT, 'N·mm'),
    (topic('direction', [('/one', DIRECTIONS), ('/two', DIRECTIONS)]), 'direction', '/one, /two'),
    (lambda seen: seen.parameters.pop('/driver'), 'driver', 'no parameter for a command timeout'),
    (lambda seen: seen.diagnostics.update({'compensator: compensation': (2, 'no joint_states')}),
     'compensator: compensation', 'no joint_states')])
def test_each_fault_is_reported_with_a_remedy(harm, about, words):
    assert {finding.level for finding in check_system(healthy())} == {'ok'}
    seen = healthy()
    harm(seen)
    found = [one for one in check_system(seen) if one.level != 'ok' and one.about == about]
    assert any(words in one.what for one in found), found
    assert all(one.do for one in found)


@pytest.mark.parametrize(('torque', 'ampere'), [(True, False), (False, True), (True, True)])
def test_currents_are_compared_in_the_units_that_the_nodes_say(torque, ampere):
    seen = healthy()
    if torque:
        seen.commands[:, 1] *= DRIVE.torque_per_current
        seen.in_torque = True
    if ampere:
        column(4, lambda effort: effort / DRIVE.torque_per_current)(seen)
        seen.parameters['/identification'] = {'effort_holds': 'current'}
    assert {one.level for one in check_system(seen)} == {'ok'}


def test_without_a_running_system_it_says_so_and_ends_well():
    found, = check_system(Observation(1.0))
    assert found.level == 'note'
    assert 'ROS_DOMAIN_ID' in found.do


@pytest.mark.parametrize(('change', 'about', 'words'), [
    (('_REQUIRED', ('no_such_module',)), 'no_such_module', 'pip install no_such_module'),
    (('import_module', lambda _: Namespace(IdentifyFriction=None, RefineModel=None)), 'actions',
     'build the package again'),
    (('middlewares', lambda: ['rmw_fastrtps_cpp']), 'middleware', 'unset it here')])
def test_what_is_missing_on_this_machine_is_named(monkeypatch, capsys, change, about, words):
    monkeypatch.setattr(doctor, *change)
    monkeypatch.setenv('RMW_IMPLEMENTATION', 'rmw_of_another_world_cpp')
    assert doctor.main(['--seconds', '0', '--json']) == 1
    found, = (one for one in json.loads(capsys.readouterr().out)['findings']
              if one['about'] == about)
    assert words in found['do']
    assert doctor.main(['--seconds', '0']) == 1
    assert about in capsys.readouterr().out.splitlines()[-1]


def test_it_asks_for_what_the_package_is_installed_with():
    needed = (ROOT / 'requirements' / 'run.txt').read_text(encoding='utf-8').lower()
    assert [name for name in doctor._REQUIRED if name not in needed] == []
