# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The refinement action over DDS: from messages in memory to a model that is loaded."""

import asyncio
from pathlib import Path
import shutil
import signal
import time
from types import SimpleNamespace

from action_msgs.msg import GoalStatus
from friction_comp_interfaces.action import RefineModel
from geometry_msgs.msg import WrenchStamped
from node_process import Process, ROOT
import numpy as np
import pytest
from rclpy.serialization import serialize_message
from ros_system import Goals, joint_state, MODELS, own_domain, probe_node, RELIABLE
from sensor_msgs.msg import JointState

from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import write_arm
from friction_comp.monitoring.live_residual import JointWatch
from friction_comp.nodes.live_signals import LiveSignals
from friction_comp.nodes.refine_job import Message, RecentPast, RefineJob
from friction_comp.nodes.refinement import RefinementNode

JOINT = 'elbow'
STEP = 0.02
MODEL = FrictionModel.load(MODELS[0])


def motion(seconds, ripple, seed=0):
    """Positions and motor currents of a joint whose friction ripples over its turn."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, STEP)
    position = 0.7 * np.sin(0.9 * time) + 0.25 * np.sin(2.3 * time + 1.0)
    velocity = np.gradient(position, time)
    current = MODEL.sigmoid(velocity) * (1.0 + ripple * np.sin(7.0 * position))
    return time, position, velocity, current + 1e-3 * rng.standard_normal(len(time))


def rows_of(*signals):
    """Return a motion as rows for a residual, without load and temperature."""
    unknown = np.full(len(signals[0]), np.nan)
    return np.column_stack((*signals, unknown, unknown))


class Bench(Goals):
    """A joint that is moved by hand of the test, and a client of the action."""

    def __init__(self, probe):
        self.states = probe.talk(JointState, 'joint_states', RELIABLE)
        self.stamp = 10**9
        super().__init__(probe, RefineModel, 'refine_model', {'joint': 'nobody'})
        probe.matched(self.states)

    def move(self, seconds, ripple, seed=0):
        """Publish motion as fast as it is taken."""
        begin = self.stamp
        for k, (t, x, v, i) in enumerate(zip(*motion(seconds, ripple, seed))):
            self.stamp = begin + round(t * 1e9)
            self.states.publish(joint_state(
                self.stamp, [JOINT], [x], [v], [i * MODEL.drive.torque_per_current]))
            if k % 200 == 199:
                self.probe.spin_for(0.05)
        self.stamp += 10_000_000

    def refine(self, **goal):
        return self.ask(**{'joint': JOINT, **goal})

    def outcome(self, handle):
        # Refinement has the lowest priority: it waits for long if others keep both cores busy.
        return self.result(handle, 900.0)


@pytest.fixture(scope='module')
def room(tmp_path_factory):
    return tmp_path_factory.mktemp('refinement')


@pytest.fixture(scope='module')
def bench(room):
    start = {'joints': [JOINT], 'model_files': MODELS[:1], 'output_folder': str(room / 'out')}
    with probe_node() as probe, \
            Process(room, 'compensator', {
                'joints': [JOINT], 'model_files': MODELS[:1], 'autostart': False}), \
            Process(room, 'refinement', start):
        bench = Bench(probe)
        yield bench
        bench.close()


def test_a_late_message_does_not_shorten_the_recent_past():
    past = RecentPast(600.0, 10**9)
    second = 10**9
    for k in range(1, 11):
        past.add(Message(k * second, 'states', 'kind', b'1234'))
    past.add(Message(4 * second, 'load', 'kind', b'1234'))
    assert len(past.last()) == 11
    # One wrong stamp, in either direction, affects only its own message.
    for wrong in (2 * second, 10**6 * second):
        past.add(Message(wrong, 'states', 'kind', b'1234'))
        past.add(Message(11 * second, 'states', 'kind', b'1234'))
    assert len(past.last()) == 13
    # If the stamps of a topic start over, it is another run.
    past.add(Message(2 * second, 'states', 'kind', b'1234'))
    past.add(Message(3 * second, 'states', 'kind', b'1234'))
    assert [message.stamp for message in past.last()] == [2 * second, 3 * second]


@pytest.mark.slow
def test_kept_messages_whose_effort_is_in_ampere_are_refined_as_currents(tmp_path):
    messages = []
    for t, x, v, i in zip(*motion(20.0, 0.0)):
        stamp = 10**9 + round(t * 1e9)
        messages.append(Message(
            stamp, 'joint_states', 'sensor_msgs/msg/JointState',
            bytes(serialize_message(joint_state(stamp, [JOINT], [x], [v], [i])))))
    job = RefineJob(JOINT, MODELS[0], tmp_path, '', messages, in_ampere=True)
    while not job.poll():
        time.sleep(0.05)
    refined = job.result()
    assert refined.model.drive == MODEL.drive
    assert refined.report.after.held_out_rmse < 3e-3
    assert refined.model.sigmoid(0.5) == pytest.approx(MODEL.sigmoid(0.5), rel=0.05)


@pytest.mark.parametrize('states_first', [False, True])
def test_states_have_the_load_of_their_time_when_many_are_taken_at_once(states_first):
    """A busy machine reads all waiting messages of one topic before those of the next."""
    signals, second = LiveSignals([JOINT], [1.0]), 10**9

    def add_load(stamp, torque):
        wrench = WrenchStamped()
        wrench.header.frame_id = JOINT
        wrench.wrench.torque.z = torque
        signals.add_message('interaction_wrench', stamp, serialize_message(wrench))

    def add_state(stamp):
        signals.add_state(stamp, serialize_message(joint_state(stamp, [JOINT], [0.0])))

    def add_states():
        for k in range(200):
            add_state(second + k * second // 100)

    add_load(second, 0.0)
    if states_first:
        add_states()
        assert len(signals.take()[0]) == 1
    for k in range(101):
        add_load(second + k * second // 50, 0.01 * k)
    if not states_first:
        add_states()
    load = signals.take()[0][:, 4]
    np.testing.assert_allclose(load, 0.01 * (np.arange(200) // 2)[-len(load):])
    assert len(load) >= 199
    # An old load is ignored, and a clock that starts over discards what was before.
    add_state(5 * second)
    add_state(11 * second)
    assert np.isnan(signals.take()[0][0, 4])
    add_load(second, 7.0)
    add_state(second)
    assert signals.take()[0][0, 4] == 7.0


def loaded(probe):
    return probe.get_parameter_of('compensator', 'model_files')


def test_without_recent_messages_there_is_nothing_to_refine(bench):
    handle = bench.refine()
    assert handle.accepted
    outcome = bench.outcome(handle)
    assert outcome.status == GoalStatus.STATUS_ABORTED
    assert 'no messages are kept' in outcome.result.message


@pytest.mark.timeout(1200)
def test_a_model_that_no_longer_fits_is_noticed_refined_loaded_and_reverted(bench, room):
    probe = bench.probe
    bench.move(20.0, ripple=0.0)
    fits = probe.status_of('refinement', lambda s: any(
        'the model fits' in item.value for item in s.values))
    assert fits.level == b'\x00'
    bench.move(40.0, ripple=0.6)
    warned = probe.status_of(
        'refinement', lambda s: s.level == b'\x01' and 'position' in s.message)
    assert 'no longer fits' in warned.message

    handle = bench.refine(seconds=40.0, load=True)
    assert not bench.refine().accepted, 'one goal at a time'
    outcome = bench.outcome(handle)
    result = outcome.result
    assert outcome.status == GoalStatus.STATUS_SUCCEEDED, result.message
    assert result.success
    assert 'position' in list(result.variables)
    assert result.error_after < 0.7 * result.error_before
    assert result.loaded, result.message
    assert f'verdict: {result.verdict}: ' in result.message
    assert loaded(probe) == [result.model_file]
    model = FrictionModel.load(result.model_file)
    assert model.breakaway == MODEL.breakaway
    assert Path(result.report).is_file()
    shares = [step.progress for step in bench.feedback]
    assert shares == sorted(shares)
    assert any(step.step.startswith('trying') for step in bench.feedback)

    # The joint is as it was at first: the refined model is the worse one now.
    bench.move(40.0, ripple=0.0, seed=1)
    probe.until(lambda: loaded(probe) == MODELS[:1], 'the model that fits is back')
    probe.status_of('refinement', lambda s: any(
        'unloaded' in item.value for item in s.values))


def test_a_recording_that_cannot_be_read_is_named_and_a_goal_can_be_cancelled(bench, room):
    outcome = bench.outcome(bench.refine(recording=str(room / 'nothing')))
    assert outcome.status == GoalStatus.STATUS_ABORTED
    assert 'nothing' in outcome.result.message
    assert not outcome.result.success
    written = set((room / 'out').glob('*'))
    handle = bench.refine(recording=str(ROOT / 'examples' / 'elbow'))
    bench.probe.until(lambda: bench.feedback, 'feedback')
    outcome = bench.cancel(handle)
    assert outcome.status == GoalStatus.STATUS_CANCELED
    assert not outcome.result.model_file
    for folder in set((room / 'out').glob('*')) - written:
        assert not (folder / 'model.yaml').exists()
        shutil.rmtree(folder)


def test_a_goal_that_is_cancelled_before_it_starts_refines_nothing(bench):
    bench.move(20.0, ripple=0.6)
    assert bench.cancel_at_once(joint=JOINT).status == GoalStatus.STATUS_CANCELED


def test_the_client_is_told_when_the_node_is_stopped(tmp_path):
    with own_domain(), probe_node() as probe, Process(tmp_path, 'refinement', {
            'joints': [JOINT], 'model_files': MODELS[:1], 'output_folder': str(tmp_path)}) as node:
        bench = Bench(probe)
        # A first result arrives only once the node has found the client.
        assert not bench.result(bench.refine(recording='nowhere')).result.success
        outcome = bench.refine(recording=str(ROOT / 'examples' / 'elbow')).get_result_async()
        probe.until(lambda: bench.feedback, 'feedback')
        node.send(signal.SIGTERM)
        result = probe.complete(outcome, 'the result', 20.0).result
        assert result.message == 'the node was stopped'
        bench.close()


def test_a_joint_of_an_arm_file_is_watched_with_its_own_model(tmp_path):
    models = [FrictionModel.load(path) for path in MODELS[:2]]
    path = tmp_path / 'arm.yaml'
    write_arm(path, dict(zip((JOINT, 'wrist'), models)))
    watch = JointWatch(0.25, 'wrist', MODELS[0])
    watch.use(str(path))
    assert watch.residual.model.sigmoid == models[1].sigmoid


def test_a_trial_ends_with_enough_motion_and_names_the_previous_model_if_that_was_better(tmp_path):
    same = tmp_path / 'same.yaml'
    shutil.copy(MODELS[0], same)
    rows = rows_of(*motion(200.0, 0.0))
    ends = {}
    for path in (str(same), MODELS[2]):
        watch = JointWatch(0.25, JOINT, MODELS[0])
        watch.start_trial(path)
        watch.add(rows[:500])
        assert watch.end_trial() is None
        assert watch.trial is not None
        # All of the trial's motion at once, as when the machine was busy.
        watch.add(rows[500:])
        ends[path] = watch.end_trial()
        assert watch.trial is None
    assert ends[str(same)] is None
    previous, reason = ends[MODELS[2]]
    assert previous == MODELS[0]
    assert 'blocks of motion' in reason


def test_a_worse_model_is_unloaded_as_soon_as_the_compensator_answers():
    watch, asked = JointWatch(0.25, JOINT, MODELS[0]), []
    watch.use(MODELS[2])

    async def load(joint, path):
        asked.append((joint, path))
        if len(asked) == 1:
            raise InputError('the compensator does not answer')
    node = SimpleNamespace(
        _watches={JOINT: watch}, _to_unload={JOINT: (MODELS[2], MODELS[0], 'it is worse')},
        _compensator=SimpleNamespace(load=load), _last_result='',
        get_logger=lambda: SimpleNamespace(warning=lambda text: None))
    with pytest.raises(InputError, match='does not answer'):
        asyncio.run(RefinementNode._unload(node, JOINT))
    assert watch.file == MODELS[2]
    asyncio.run(RefinementNode._unload(node, JOINT))
    assert asked == 2 * [(JOINT, MODELS[0])]
    assert (watch.file, node._to_unload) == (MODELS[0], {})
    # Not if another one was loaded meanwhile.
    node._to_unload[JOINT] = MODELS[2], MODELS[1], 'it is worse'
    asyncio.run(RefinementNode._unload(node, JOINT))
    assert (len(asked), watch.file, node._to_unload) == (2, MODELS[0], {})
