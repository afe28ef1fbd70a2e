# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The identification action over DDS: in lockstep with a simulated joint, and fed by the test."""

from contextlib import nullcontext
from dataclasses import replace
import math
import re
import signal
import time
from types import SimpleNamespace

from action_msgs.msg import GoalStatus
from friction_comp_interfaces.action import IdentifyFriction
from helpers import Bench, note_model
from node_process import Process, unread_pipe
import numpy as np
import pytest
from ros_system import BEST_EFFORT, FakeDriver, Goals, joint_state, MODELS, own_domain, probe_node
from std_msgs.msg import Float64MultiArray

from friction_comp.errors import InputError
from friction_comp.identification.goal import Carried, GOAL_LIMITS
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.nodes.identification import identification_goal, IdentificationNode
from friction_comp.ros.node_parts import described

# A name with slashes, as of an arm in a namespace, must not name another folder.
JOINT, WEIGHT = '/left/elbow', 0.02    # A
GOAL = {'joint': JOINT, 'speeds': [0.8, 1.4], 'motion_range': 0.8, 'ramp_slope': 0.2,
        'ramp_period': 2.0, 'breakaway_cycles': 2}


def goals_of(probe):
    return Goals(probe, IdentifyFriction, 'identify_friction', {'joint': 'nobody'})


@pytest.fixture(scope='module')
def room(tmp_path_factory):
    return tmp_path_factory.mktemp('identification')


class Driver(FakeDriver):
    """A best-effort driver in real time whose joint never moves."""

    def __init__(self, probe):
        super().__init__(probe, [JOINT], BEST_EFFORT)
        self.position = 0.0

    def publish(self):
        self.states.publish(joint_state(time.time_ns(), [JOINT], [self.position]))
        self.probe.spin_for(0.004)

    def drive(self, condition, what):
        """Publish states until the condition holds."""
        self.probe.until(lambda: self.publish() or condition(), what)

    def pushed(self, goals):
        """Let a goal push the joint; return the future of its result."""
        self.commands.clear()
        self.position = 0.0
        outcome = goals.begin(self.publish, **GOAL).get_result_async()
        # A joint that does not move is pushed ever harder.
        self.drive(lambda: any(abs(m.data[0]) > 0.005 for m in self.commands[-100:])
                   or outcome.done(), 'a current')
        return outcome


def test_a_goal_that_fails_leaves_zero_current_and_no_file(room):
    """Whether states fall silent, one is not finite, or the node ends, and nobody reads its log."""
    with unread_pipe(room) as pipe, own_domain(), probe_node() as probe, Process(
            room, 'identification', {
                'joints': [JOINT], 'model_files': MODELS[:1], 'output_folder': str(room / 'failed'),
                'joint_state_timeout': 0.5}, error=pipe) as process:
        driver, goals = Driver(probe), goals_of(probe)

        def leaves_zero():
            probe.until(lambda: driver.commands[-1].data[0] == 0.0, 'zero current')
        assert not goals.ask(**GOAL).accepted, 'without joint states nothing can be identified'
        for _ in range(2):
            outcome, begin = driver.pushed(goals), time.monotonic()
            leaves_zero()
            assert time.monotonic() - begin < 0.7
            reply = probe.complete(outcome, 'the result')
            assert reply.status == GoalStatus.STATUS_ABORTED
            # On a busy machine they may wait to be read before the test lets them fall silent.
            assert re.search('silent|s old', reply.result.message)
        outcome = driver.pushed(goals)
        driver.position = float('nan')
        driver.drive(outcome.done, 'the result')
        assert re.search('finite|silent|s old', outcome.result().result.message)
        leaves_zero()
        driver.pushed(goals)
        process.send(signal.SIGTERM)
        driver.drive(lambda: not process.running, 'the end')
        assert process.wait() == 0
        leaves_zero()
        assert not (room / 'failed').exists()
        goals.close()


@pytest.fixture(scope='module')
def system(room):
    """A plant in lockstep and the server, for all tests that let them live.

    The model of the joint that is not moved carries a weight that its friction could hold as well.
    """
    weight = EFFECTS['gravity']({'coefficients': [WEIGHT, 0.0]})
    wrist = replace(FrictionModel.load(MODELS[1]), effects=[weight])
    wrist.save(room / 'wrist.yaml')
    with probe_node() as probe, Process(room, 'plant', {
            'joints': [JOINT, 'wrist'], 'model_files': MODELS[:2], 'clock': 'lockstep',
            'seed': 4, 'wrench_period': 0.032, 'sample_time': 8e-3}), Process(
                room, 'identification', {
                    'joints': [JOINT, 'wrist'], 'use_sim_time': True,
                    'model_files': [MODELS[0], str(room / 'wrist.yaml')],
                    'output_folder': str(room / 'models'), 'input_reliability': 'reliable',
                    'joint_state_timeout': 10.0}):
        probe.listen(Float64MultiArray, 'current_command')
        goals = goals_of(probe)
        goals.models = room / 'models'
        yield goals
        goals.close()


@pytest.mark.parametrize(('changes', 'words'), [
    ({'joint': 'knee'}, "unknown joint 'knee'"), ({'ramp_slope': 100.0}, 'current limit')])
def test_refuses_goals_that_cannot_be_reached(system, changes, words):
    assert not system.ask(**{**GOAL, **changes}).accepted
    system.probe.status_of('identification', lambda status: any(
        item.key == 'last refusal' and words in item.value for item in status.values))


def test_a_cancelled_goal_leaves_zero_current_and_no_file(system):
    handle = system.begin(**GOAL)
    system.probe.until(lambda: any(f.phase == 'velocity' for f in system.feedback), 'movement')
    assert not system.ask(**GOAL).accepted, 'one goal at a time'
    outcome = system.cancel(handle)
    assert outcome.status == GoalStatus.STATUS_CANCELED
    assert not outcome.result.success
    assert 'cancel' in outcome.result.message
    assert list(system.probe.all_heard('current_command')[-1].data) == [0.0, 0.0]
    assert not system.models.exists()


def test_identifies_a_drive(system):
    system.probe.heard['current_command'].clear()
    outcome = system.result(system.begin(**GOAL), 240.0)
    assert outcome.status == GoalStatus.STATUS_SUCCEEDED
    result = outcome.result
    assert result.success
    truth = FrictionModel.load(MODELS[0])
    speeds = sorted([*GOAL['speeds'], *(-v for v in GOAL['speeds'])])
    np.testing.assert_allclose(result.speeds, speeds, rtol=1e-3)
    np.testing.assert_allclose(result.currents, truth.sigmoid(np.array(speeds)), atol=6e-3)
    assert all(0.0 <= value < 0.02 for value in result.standard_deviations)
    # Two ramps a side, whose scatter is 3.4 %.
    assert result.breakaway_positive_mean == pytest.approx(0.0995, rel=0.1)
    assert result.breakaway_negative_mean == pytest.approx(-0.0995, rel=0.1)
    assert result.breakaway_positive_std < 0.01
    assert result.model_file == str(system.models / 'left_elbow.yaml')
    model = FrictionModel.load(result.model_file)
    assert model.joint == JOINT
    np.testing.assert_allclose(
        model.sigmoid.coefficients(), result.coefficients, rtol=1e-6, atol=1e-12)
    assert model.drive == truth.drive
    # Feedback comes now and then in real time: which samples it shows is left to the machine.
    progress = [f.progress for f in system.feedback]
    assert progress == sorted(progress)
    assert 0.0 <= progress[0] < progress[-1] <= 1.0
    assert {'velocity', 'breakaway'} & {f.phase for f in system.feedback}
    assert any(f.velocity for f in system.feedback)
    assert all(abs(f.position) < GOAL['motion_range'] for f in system.feedback)
    # Only the joint of the goal was driven, the other one held; both were left at zero current.
    commands = np.array([m.data for m in system.probe.all_heard('current_command')])
    assert np.abs(commands[:, 0]).max() > 0.1
    held = commands[commands[:, 0] != 0.0, 1]
    np.testing.assert_allclose(held, WEIGHT, rtol=0.01)
    assert not commands[-1].any()


def test_what_a_goal_leaves_out_are_the_parameters():
    parameters = {one.name: one for one in described('identification')}
    defaults = {name: parameters[f'default_{name}'].default for name in GOAL_LIMITS}
    assert all(parameters[f'default_{name}'].range[1] == highest
               for name, (_, highest, _) in GOAL_LIMITS.items() if name != 'speeds')
    assert identification_goal(IdentifyFriction.Goal(), [JOINT], defaults)[1].speeds[-1] > 1.7
    with pytest.raises(InputError, match='motion_range must be'):
        identification_goal(IdentifyFriction.Goal(motion_range=math.nan), [JOINT], defaults)


@pytest.mark.parametrize(('held', 'carried', 'refused'), [
    (0.05, 0.0, False), (0.5, 0.0, True), (-0.5, 0.0, True), (0.5, 0.48, False), (0.0, 0.5, False)])
def test_a_goal_is_refused_while_a_motor_holds_another_joint(held, carried, refused):
    """Unless its model carries it, or a brake or friction (0.0995 A) holds it."""
    node = SimpleNamespace(
        _joints=[JOINT, 'wrist'], _per_effort=[1.0, 1.0], _torque=False,
        _models=[FrictionModel.load(MODELS[0])] * 2,
        _carried=SimpleNamespace(at=lambda _: np.array([0.0, carried])),
        _states=SimpleNamespace(position=np.zeros(2), effort=np.array([9.0, held])))
    with (pytest.raises(InputError, match='wrist holds it with .*0.5 A, of which its model carries '
                                          '0 A: it would fall') if refused else nullcontext()):
        IdentificationNode._check_held(node, 0)


def test_a_goal_ends_when_another_joint_falls():
    node, goal = SimpleNamespace(_joints=[JOINT, 'wrist']), SimpleNamespace(
        places=None, index=0, joint=JOINT)
    for places in ([0.0, 0.2], [1.0, 0.25], [2.0, math.nan]):
        IdentificationNode._check_at_rest(node, goal, np.array(places))
    with pytest.raises(InputError, match=f'wrist moved by 0.2 rad while {JOINT} was moved'):
        IdentificationNode._check_at_rest(node, goal, np.array([0.0, 0.4]))


def test_what_was_measured_is_not_lost_with_its_file(tmp_path):
    """If the folder for the model files was deleted meanwhile."""
    model = note_model(1)
    bench = Bench(seed=1, step=8e-3, speeds=(0.8, 1.4), ramp_slope=0.2, ramp_period=2.0,
                  breakaway_cycles=1)
    bench.finish()
    run = bench.run
    (tmp_path / 'gone').write_text('no folder')
    node = SimpleNamespace(
        _joints=[JOINT], _models=[model], _carried=Carried([JOINT], [model]),
        _settings={'output_folder': str(tmp_path / 'gone')})
    result = IdentifyFriction.Result()
    with pytest.raises(InputError, match='gone'):
        IdentificationNode._finish_identification(node, run, 0, result)
    assert result.breakaway_positive_mean == pytest.approx(0.0995, rel=0.1)
    assert len(result.speeds) == 4
    assert not result.model_file
