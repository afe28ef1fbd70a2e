# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Whether a model still fits, and what the doctor finds in a running system."""

from argparse import Namespace
from dataclasses import replace

from helpers import note_model, ROOT
from hypothesis import given, strategies as st
import numpy as np
import pytest

from friction_comp.messages import TOPICS
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import Recorded
from friction_comp.monitoring.checkup import check_system, Endpoint, Observation
from friction_comp.monitoring.live_residual import LiveResidual
from friction_comp.tools import doctor

# The monitoring is silent if the model fits, and otherwise names the cause.

MODEL = note_model(1)
STEP = 0.02
RATIO = MODEL.drive.torque_per_current


def rows(seconds, change=lambda t, q, heat, v: 1.0, carried=None, seed=0):
    """Measurements of a joint whose friction is the model's times a change.

    `carried` is the share that a person carries and a torque sensor measures.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, STEP)
    q = 0.6 * np.sin(0.8 * t) + 0.15 * np.sin(0.37 * t)
    v = np.gradient(q, t)
    heat = 25.0 + 15.0 * (1.0 - np.exp(-t / 900.0))
    friction = MODEL.sigmoid(v) * change(t, q, heat, v) + 0.02 * np.gradient(v, t)
    share = 0.0 if carried is None else carried
    load = np.full(len(t), np.nan) if carried is None else (
        share * friction * RATIO + 0.1 * rng.standard_normal(len(t)))
    current = (1.0 - share) * friction + 5e-3 * rng.standard_normal(len(t))
    return np.column_stack((t, q, v, current, load, heat))


def watched(data, batch=2000, model=MODEL):
    """Give (time, verdict) after each batch of measurements."""
    residual = LiveResidual(model)
    for begin in range(0, len(data), batch):
        part = data[begin:begin + batch]
        residual.add(part)
        yield part[-1, 0], residual.verdict()


@pytest.mark.slow
def test_silent_for_an_hour_while_the_model_fits():
    verdicts = [verdict for _, verdict in watched(rows(3600.0), batch=500)]
    assert all(verdict.fits for verdict in verdicts)
    assert verdicts[-1].known
    assert 'fits' in verdicts[-1].text


def loaded(load=2.0, friction=1.0, carried=0.0, offset=0.0, one_way=False):
    """Measurements of a joint whose weight is several times its friction, changed in some way.

    `load` is that of its model, whose friction is about 0.25 A, and `carried` a weight more, A.
    """
    t = np.arange(0.0, 60.0, STEP)
    q = np.abs(0.4 * t) if one_way else 0.8 * np.sin(0.9 * t) + 0.15 * np.sin(0.37 * t)
    v = np.gradient(q, t)
    weight = load * np.cos(q) + carried * np.sin(q)
    current = friction * MODEL.sigmoid(v) + weight + offset
    nothing = np.full(len(t), np.nan)
    return np.column_stack((t, q, v, current, nothing, nothing))


LOADED = replace(MODEL, effects=[EFFECTS['gravity']({'coefficients': [2.0, 0.0]})])


@pytest.mark.parametrize('change', [
    {}, {'friction': 1.6}, {'friction': 0.6}, {'carried': 0.3}, {'offset': 0.2},
    {'friction': 1.5, 'one_way': True}])
def test_on_a_joint_that_carries_a_weight_the_error_is_compared_with_friction(change):
    *_, (_, verdict) = watched(loaded(**change), model=LOADED)
    assert verdict.known
    assert verdict.fits == (not change)
    assert ('the model fits' if verdict.fits else 'no longer fits') in verdict.text


@pytest.mark.parametrize(('change', 'effects', 'fits'), [
    (1.0, [], True), (1.5, [], False),
    # An acceleration is computed, and the warm-up of one recording is not that of the next.
    (1.0, [EFFECTS['inertia']({'coefficients': [0.02]})], True),
    (1.5, [EFFECTS['inertia']({'coefficients': [0.02]})], False),
    (1.0, [EFFECTS['warm_up']({'time_constant': 600.0, 'transition': 0.02,
                               'coefficients': [0.2, 0.0, 0.0]})], True)])
@pytest.mark.parametrize('carried', [None, 1.0])
def test_friction_counts_whoever_overcomes_it_and_inertia_does_not(change, effects, fits, carried):
    """Also where a person carries the joint and the load is measured."""
    data = rows(60.0, lambda t, q, heat, v: change, carried=carried)
    data[:, 3] += 0.3 * np.gradient(data[:, 2], data[:, 0])
    *_, (_, verdict) = watched(data, model=replace(MODEL, effects=effects))
    assert verdict.known
    assert verdict.fits == fits


def test_an_error_that_refinement_expected_is_no_change():
    data = loaded(friction=1.5)
    for error, fits in ((0.02, False), (0.15, True)):
        model = replace(LOADED, recorded=Recorded(error=error))
        *_, (_, verdict) = watched(data, model=model)
        assert verdict.fits == fits
    assert '50 % of the friction' in verdict.text
    assert 'refine expected: the model was never better' in verdict.text


def test_a_worn_joint_is_reported_within_a_minute_of_motion():
    told = [time for time, verdict in watched(
        rows(300.0, lambda t, q, heat, v: np.where(t > 120.0, 1.5, 1.0)), batch=50)
        if not verdict.fits]
    assert told
    assert 120.0 < told[0] < 180.0


def test_a_signal_that_the_model_needs_and_nobody_measures_is_said():
    model = FrictionModel.from_dict(MODEL.to_dict())
    model.effects.append(EFFECTS['load_friction'](
        {'exponent': 1.0, 'transition': 0.1, 'coefficients': [0.01]}))
    residual = LiveResidual(model)
    residual.add(rows(30.0))
    assert 'load' in residual.blind
    assert not residual.verdict().known


@given(st.lists(st.integers(1, 400), min_size=1, max_size=12), st.integers(0, 1000))
def test_the_verdict_does_not_depend_on_how_samples_are_grouped(sizes, seed):
    data = rows(40.0, lambda t, q, heat, v: 1.2, seed=seed)
    whole, parts = LiveResidual(MODEL), LiveResidual(MODEL)
    whole.add(data)
    begin = 0
    for size in [*sizes, len(data)]:
        parts.add(data[begin:begin + size])
        begin += size
    assert parts.verdict().known == whole.verdict().known
    assert parts.verdict().share == pytest.approx(whole.verdict().share, abs=0.02)


def test_time_that_begins_anew_and_rows_without_numbers_do_no_harm():
    data = rows(40.0)
    residual = LiveResidual(MODEL)
    broken = data.copy()
    broken[::7, 1] = np.nan
    residual.add(np.empty((0, 6)))
    residual.add(broken)
    residual.add(data)
    assert residual.verdict().fits


# The doctor names the faults of a system, and reports nothing if there are none.

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
    (column(3, np.degrees), JOINT, 'velocity is in deg/s'),
    (column(4, lambda effort: np.full_like(effort, np.nan)), JOINT, 'have no effort'),
    (column(4, np.negative), JOINT, 'wrong sign'),
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
     'build the package again')])
def test_what_is_missing_on_this_machine_is_named(monkeypatch, capsys, change, about, words):
    monkeypatch.setattr(doctor, *change)
    assert doctor.doctor(['--seconds', '0']) == 1
    lines = capsys.readouterr().out.splitlines()
    assert any(about in line and words in then for line, then in zip(lines, lines[1:]))
    assert about in lines[-1]
