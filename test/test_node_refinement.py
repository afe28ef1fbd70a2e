# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The refinement action over DDS: from messages in memory to a model that is loaded."""

from pathlib import Path

from action_msgs.msg import GoalStatus
from friction_comp_interfaces.action import RefineModel
from geometry_msgs.msg import WrenchStamped
from node_process import Process, ROOT
import numpy as np
import pytest
from rclpy.serialization import serialize_message
from ros_system import Goals, joint_state, MODELS, probe_node, RELIABLE
from sensor_msgs.msg import JointState

from friction_comp.model.friction_model import FrictionModel
from friction_comp.nodes.refinement import live_rows
from friction_comp.recordings.scan import tracks_of

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
                self.stamp, [JOINT], [x], [v], [i]))
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
    start = {'joints': [JOINT], 'model_files': MODELS[:1], 'output_folder': str(room / 'out'),
             'effort_holds': 'current'}
    with probe_node() as probe, \
            Process(room, 'compensator', {
                'joints': [JOINT], 'model_files': MODELS[:1], 'autostart': False}), \
            Process(room, 'refinement', start):
        bench = Bench(probe)
        yield bench
        bench.close()


def test_states_have_the_load_of_their_time():
    heard, second = [], 10**9

    def add(topic, stamp, message):
        heard.append((topic, stamp, serialize_message(message)))

    for k in range(1, 11):
        stamp = k * second // 100
        wrench = WrenchStamped()
        wrench.header.frame_id = JOINT
        wrench.wrench.torque.z = 0.1 * k
        add('interaction_wrench', stamp + 10**6, wrench)
        for repeated in range(2):
            # Some hundred a second are enough.
            add('joint_states', stamp + repeated * 10**5, joint_state(
                stamp, ['wrist', JOINT], [7.0, 0.5], [1.0, 0.2], [3.0, 4.0]))
    # An old load is none.
    add('joint_states', second, joint_state(second, [JOINT], [0.5], [0.2], [4.0]))
    tracks = tracks_of(heard)
    mine, other = live_rows(tracks, JOINT, 2.0), live_rows(tracks, 'wrist', 1.0)
    np.testing.assert_allclose(mine[:, 0], [*(0.01 * np.arange(1, 11)), 1.0])
    np.testing.assert_allclose(mine[:, 1:4], [[0.5, 0.2, 2.0]] * 11)
    np.testing.assert_allclose(mine[:, 4], [*(0.1 * np.arange(1, 11)), np.nan])
    assert np.isnan(mine[:, 5]).all()
    assert np.isnan(other[:, 4]).all()
    assert not len(live_rows({}, JOINT, 1.0))


def loaded(probe):
    return probe.get_parameter_of('compensator', 'model_files')


def test_without_recent_messages_there_is_nothing_to_refine(bench):
    handle = bench.refine()
    assert handle.accepted
    outcome = bench.outcome(handle)
    assert outcome.status == GoalStatus.STATUS_ABORTED
    assert 'no messages are kept' in outcome.result.message


@pytest.mark.timeout(1200)
def test_a_model_that_no_longer_fits_is_noticed_refined_and_loaded(bench, room):
    probe = bench.probe
    bench.move(20.0, ripple=0.0)
    fits = probe.status_of('refinement', lambda s: any(
        'the model fits' in item.value for item in s.values))
    assert fits.level == b'\x00'
    bench.move(40.0, ripple=0.6)
    warned = probe.status_of(
        'refinement', lambda s: s.level == b'\x01' and 'refine it' in s.message)
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
    assert f'verdict: {result.verdict}' in result.message
    assert loaded(probe) == [result.model_file]
    model = FrictionModel.load(result.model_file)
    assert model.breakaway == MODEL.breakaway
    assert Path(result.report).is_file()
    shares = [step.progress for step in bench.feedback]
    # A step that is over sooner than feedback is due is not told.
    assert shares == sorted(shares)
    assert shares[-1] > 0.0

    # From now on the motion is compared with the new model.
    bench.move(40.0, ripple=0.6, seed=1)
    probe.status_of('refinement', lambda s: s.level == b'\x00' and any(
        item.value == result.model_file for item in s.values))


def test_a_recording_that_cannot_be_read_is_named_and_a_goal_can_be_cancelled(bench, room):
    outcome = bench.outcome(bench.refine(recording=str(room / 'nothing')))
    assert outcome.status == GoalStatus.STATUS_ABORTED
    assert 'nothing' in outcome.result.message
    assert not outcome.result.success
    handle = bench.refine(recording=str(ROOT / 'examples' / 'elbow'))
    bench.probe.until(lambda: bench.feedback, 'feedback')
    outcome = bench.cancel(handle)
    assert outcome.status == GoalStatus.STATUS_CANCELED
    assert not outcome.result.model_file
