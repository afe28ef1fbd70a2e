# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""All nodes in lockstep on a busy machine: the plain loop's numbers, recording, diagnostics.

Of two joints, one with an undeclared effect.
"""

from functools import partial
import random
import signal
import time

from closed_loop import closed_loop
from node_process import Process
import numpy as np
import pytest
from ros_system import CONFIG, MODELS, own_domain, probe_node, value_of

from friction_comp.compensation.law import CompensationLaw
from friction_comp.direction.exercise import ReferenceMovement
from friction_comp.model.friction_model import FrictionModel
from friction_comp.recordings.reader import read_recording_with_info
from friction_comp.simulation.joint import Plant
from friction_comp.simulation.undeclared import Undeclared

JOINTS = ['elbow', 'shoulder']
FILES = MODELS[:2]
UNDECLARED = str(CONFIG / 'undeclared_example.yaml')
SEED = 5
SAMPLE = 2_000_000
# Simulated time begins at 1 s.
BEGINNING = 1_000_000_000
# Samples between two ticks of the clock.
TICK = 5
MOVEMENT = {'amplitude': 0.3, 'speed': 1.5, 'acceleration_time': 0.1, 'standstill': 0.403,
            'announcement': 0.301, 'repetitions': 1}
# The exercise receives the positions of the joints at the first tick, and begins at the second.
LATE = TICK
DURATION_NS = round(ReferenceMovement(**MOVEMENT).duration * 1e9)
# The reference of the tick that ends the exercise is the last: time rests before the next.
STEPS = LATE + TICK * (-(-DURATION_NS // (TICK * SAMPLE)) + 1)
LAW = 'continuous'


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


def record(folder):
    """Run the exercise once, each node in a process of its own; return the recording's path."""
    path, logs = folder / 'recording', folder / 'logs'
    common = {'joints': JOINTS, 'use_sim_time': True, 'input_reliability': 'reliable'}
    # Real time may pass without a sample, and what it passed for makes no difference.
    patient = {'joint_state_timeout': 10.0, 'wait_for_direction': True}
    # As on a robot: what arrives within a report has had its time.
    start = partial(Process, logs, period=1.0)
    with own_domain(), probe_node() as probe, \
            start('plant', {
                'joints': JOINTS, 'model_files': FILES, 'clock': 'lockstep', 'seed': SEED,
                'undeclared_effect_files': ['', UNDECLARED],
                'sample_time': SAMPLE * 1e-9, 'wait_for_reference': True}) as plant, \
            start('recorder', {
                'output': str(path), 'model_file': FILES[0], 'use_sim_time': True,
                'input_reliability': 'reliable'}) as recorder, \
            start('exercise', {
                **common, **MOVEMENT, 'clock': 'ticks', 'when_done': 'exit',
                # The compensator and the recorder.
                'wait_for_listeners': 2}) as exercise, \
            start('compensator', {
                **common, **patient, 'model_files': FILES, 'law': LAW,
                'autostart': False}) as compensator:
        assert probe.transition('compensator', 'configure')
        # Time rests at the first sample until the compensator is activated. By then everyone has
        # heard everyone.
        probe.status_of('exercise', lambda status: status.message == 'waits for /clock')
        probe.status_of('recorder', lambda status: all(
            int(value_of(status, topic)) for topic in (
                'joint_states', 'reference', 'interaction_wrench'))
            # All four nodes.
            and int(value_of(status, 'publishers of /diagnostics')) == 4)
        # Said once a second, and recorded by now.
        for _ in range(2):
            probe.status_of('compensator', lambda status: status.message == 'inactive')
        assert probe.transition('compensator', 'activate')
        hold_up([plant, compensator, exercise])
        assert exercise.wait(180.0) == 0
        # Messages of the plant may still be in the queue.
        probe.status_of('plant', lambda status: (
            value_of(status, 'waits for') == 'reference'
            and float(value_of(status, 'time [s]')) > (STEPS - 1) * SAMPLE * 1e-9))
        # The joint's time rests: when the recorder's counts do, too, it has everything.
        counts = [None]

        def complete(status):
            counts.append([
                int(value_of(status, topic)) for topic in ('joint_states', 'current_command')])
            # The last command is dated, and counted, when the recording ends.
            return counts[-1] == counts[-2] and min(counts[-1]) >= STEPS - 1
        probe.status_of('recorder', complete)
        recorder.send()
        assert recorder.wait() == 0
        assert 'Traceback' not in recorder.text
    return path


@pytest.fixture(scope='module')
def joints(tmp_path_factory):
    """Return (Samples, RecordingInfo) of each joint, as the package reads them."""
    path, found = record(tmp_path_factory.mktemp('several')), []
    for joint, file in zip(JOINTS, FILES):
        drive = FrictionModel.load(file).drive
        found += read_recording_with_info(path, joint, drive.torque_per_current)
    return found


class BegunLate(ReferenceMovement):
    """The reference movement for a joint that nobody holds before the exercise begins."""

    def at(self, time):
        since = np.round(time * 1e9) - LATE * SAMPLE
        position, velocity, direction = super().at(since / 1e9)
        early = since < 0.0
        return (np.where(early, np.nan, position), np.where(early, np.nan, velocity),
                np.where(early, 0, direction))


def test_equals_the_plain_loop_whatever_the_load(joints):
    models = [FrictionModel.load(path) for path in FILES]
    plant = Plant(models, SEED, [None, Undeclared.from_file(UNDECLARED)], SAMPLE * 1e-9)
    loop = closed_loop(plant, CompensationLaw(models, LAW), BegunLate(**MOVEMENT),
                       STEPS * SAMPLE * 1e-9)

    def recorded(name):
        return np.stack([getattr(samples, name) for samples, _ in joints], axis=1)
    # Both joints moved, and the law's current was significant.
    assert (np.ptp(loop['position'], axis=0) > 0.1).all()
    assert (np.abs(loop['command']).max(axis=0) > 0.05).all()
    assert set(np.unique(loop['direction'])) == {-1, 0, 1}
    np.testing.assert_allclose(joints[0][0].time, loop['time'], rtol=0, atol=1e-9)
    for name, plain in (
            ('position', 'position'), ('velocity', 'velocity'), ('current', 'current'),
            ('load', 'interaction_torque'), ('command', 'command')):
        np.testing.assert_allclose(
            recorded(name), loop[plain], rtol=0, atol=1e-9, err_msg=name)
    # Direction and reference change on ticks.
    ticks = slice(LATE, None, TICK)
    for name in ('direction', 'reference_position', 'reference_velocity'):
        np.testing.assert_allclose(
            recorded(name)[ticks], loop[name][ticks], rtol=0, atol=1e-9, err_msg=name)


def test_the_recording_is_read_back_whole(joints):
    for samples, info in joints:
        stamps = np.round(samples.time * 1e9).astype(int)
        np.testing.assert_array_equal(stamps, SAMPLE * np.arange(STEPS))
        assert info.start == pytest.approx(BEGINNING * 1e-9)
        # A state sent again adds nothing; nothing else was left out.
        assert [note for note in info.notes if 'left out' in note and 'not later' not in note] == []
        assert info.model == FILES[0]
        for name in ('velocity', 'load', 'temperature', 'command', 'direction',
                     'reference_position', 'reference_velocity'):
            assert np.isfinite(getattr(samples, name)).all(), name
