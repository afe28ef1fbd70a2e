# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""All nodes in lockstep on a busy machine give the numbers of the plain loop."""

import random
import signal
import time

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not in this environment')

from node_process import Process
from ros_system import MODELS, own_domain, probe_node, value_of

from friction_comp.compensation.law import CompensationLaw
from friction_comp.exercise.reference_movement import ReferenceMovement
from friction_comp.model.friction_model import FrictionModel
from friction_comp.recordings import read_recording_with_info
from friction_comp.simulation.joint import Plant
from simulated_recordings.closed_loop import closed_loop

JOINT = 'elbow'
MOVEMENT = {'amplitude': 0.25, 'speed': 0.7, 'acceleration_time': 0.2, 'standstill': 0.4,
            'announcement': 0.3, 'repetitions': 1}
SEED = 8
STEP = 2e-3  # s
pytestmark = pytest.mark.slow


def hold_up(processes):
    """Stop one process after the other for longer and shorter, as a busy machine does.

    What this costs the machine is nothing, and no machine is so fast that it would not show.
    """
    rng, last = random.Random(SEED), processes[-1]
    while last.running:
        one = rng.choice(processes)
        one.send(signal.SIGSTOP)
        time.sleep(rng.choice((0.002, 0.02, 0.15)))
        one.send(signal.SIGCONT)
        time.sleep(rng.uniform(0.0, 0.1))


def run(folder):
    """Run one exercise, its nodes held up, and return the recording's samples."""
    models = {'joints': [JOINT], 'model_files': MODELS[:1]}
    follower = {'use_sim_time': True, 'input_reliability': 'reliable'}
    with own_domain(), probe_node() as probe, Process(folder, 'plant', {
            **models, 'clock': 'lockstep', 'wait_for_reference': True, 'seed': SEED,
            # The compensator, the recorder and the exercise.
            'wait_for_listeners': 3, 'sample_time': STEP}) as plant, Process(
                folder, 'compensator', {
                    **models, **follower, 'law': 'continuous', 'joint_state_timeout': 10.0}
                ) as compensator, Process(
                    folder, 'recorder', {
                        **follower, 'output': str(folder / 'recording')}) as recorder:
        probe.until(lambda: probe.count_subscribers('current_command') == 2
                    and probe.count_publishers('current_command') == 1
                    and probe.count_subscribers('joint_states') == 2, 'all nodes')
        with Process(folder, 'exercise', {
                'joints': [JOINT], **follower, **MOVEMENT, 'clock': 'ticks',
                'wait_for_listeners': 2, 'when_done': 'exit'}) as exercise:
            hold_up([plant, compensator, recorder, exercise])
            assert exercise.wait(180.0) == 0
        # The last reference still lets the joint run to the next tick.
        times = [None]

        def rests(status):
            times.append(float(value_of(status, 'time [s]')))
            return times[-1] == times[-2] and value_of(status, 'waits for') == 'reference'
        probe.status_of('plant', rests)
        counts = [(0, 0)]

        def has_all(status):
            # What a reader that was held up has lost is sent to it again, seconds later.
            counts.append(tuple(int(value_of(status, topic))
                                for topic in ('joint_states', 'current_command')))
            return counts[-1] == counts[-2] and min(counts[-1]) >= round(times[-1] / STEP)
        probe.status_of('recorder', has_all)
        recorder.send()
        assert recorder.wait() == 0
    return read_recording_with_info(folder / 'recording', JOINT, 0.119, 100.0)[0][0]


class Later:
    """The movement as the exercise node shows it: from its second tick on."""

    def __init__(self, tick):
        self._movement, self._tick = ReferenceMovement(**MOVEMENT), tick

    def at(self, time):
        return self._movement.at(round((time - self._tick) * 1e9) * 1e-9)


def expected(count):
    model = FrictionModel.load(MODELS[0])
    return closed_loop(
        Plant([model], SEED, sample_time=STEP), CompensationLaw([model], 'continuous'),
        Later(0.01), count * STEP)


def test_the_nodes_give_the_numbers_of_the_plain_loop_whatever_the_load(tmp_path):
    samples = run(tmp_path)
    assert len(samples) > ReferenceMovement(**MOVEMENT).duration / STEP
    log = expected(len(samples))
    for name in ('time', 'position', 'velocity', 'current', 'load', 'command'):
        signal = log['interaction_torque' if name == 'load' else name]
        np.testing.assert_allclose(
            getattr(samples, name), signal.reshape(-1), rtol=0, atol=1e-9, err_msg=name)
    # Not because the joint stood still: the person moved it with help.
    assert np.ptp(samples.position) > 0.1
    assert np.abs(samples.command).max() > 0.05
