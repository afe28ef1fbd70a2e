# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The recorder loses nothing, however it ends and whatever its publishers offer."""

from contextlib import contextmanager
from pathlib import Path
import random
import resource
import shutil
import signal

from diagnostic_msgs.msg import DiagnosticArray
from node_process import Process
import numpy as np
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from ros_system import joint_state, own_domain, probe_node, value_of
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int8MultiArray

from friction_comp.recordings.reader import find_recordings, read_recording_with_info
from friction_comp.recordings.scan import Scan


def talk_until(probe, publisher, condition, what, count=0):
    """Publish numbered states until a condition holds; return how many there were."""
    def publish():
        nonlocal count
        for _ in range(10):
            publisher.publish(joint_state(
                1_000_000_000 + count * 1_000_000, ['elbow'], [1e-3 * count],
                effort=[float(count)]))
            count += 1
        probe.spin_for(0.01)
        return condition(count)
    probe.until(publish, what)
    return count


def on_disk(folder):
    """Return the states that whoever looks at the disk now can read."""
    try:
        (samples, info), = read_recording_with_info(find_recordings(folder))
    except Exception:
        return np.zeros(0), None
    return samples.current, info


@contextmanager
def at_work(tmp_path, folder):
    """Yield a recorder with a hundred states on the disk, their sender and how many there were."""
    with own_domain(), probe_node() as probe:
        states = probe.talk(JointState, 'joint_states')
        with Process(tmp_path / 'log', 'recorder', {'output': str(folder)}) as recorder:
            probe.matched(states)
            count = talk_until(probe, states, lambda n: len(on_disk(folder)[0]) > 100, 'states')
            yield recorder, probe, states, count


def test_what_was_recorded_survives_the_recorder(tmp_path):
    folder = tmp_path / 'r'
    # Some while into the recording, at no moment in particular.
    wanted = random.Random(1).randrange(300, 1500)
    with at_work(tmp_path, folder) as (recorder, probe, states, count):
        talk_until(probe, states, lambda n: n >= wanted, 'states', count)
        before = on_disk(folder)[0]
        recorder.send(signal.SIGKILL)
        recorder.wait()
    current, info = on_disk(folder)
    assert len(current) >= len(before) > 100
    np.testing.assert_array_equal(np.diff(current), 1.0)
    assert any('not finished' in note for note in info.notes)


def test_a_folder_that_is_deleted_ends_the_recorder_with_a_message(tmp_path):
    folder = tmp_path / 'r'
    with at_work(tmp_path, folder) as (recorder, probe, states, count):
        shutil.rmtree(folder)
        talk_until(probe, states, lambda n: not recorder.running, 'the end', count)
        assert recorder.wait() == 2
    assert 'was deleted while it was written' in recorder.text
    assert 'Traceback' not in recorder.text
    assert not folder.exists()


def test_every_publisher_is_heard_from_its_first_message(tmp_path):
    folder = tmp_path / 'r'
    with own_domain(), probe_node() as probe:
        lasting = probe.talk(Int8MultiArray, 'direction', QoSProfile(
            depth=1, reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL))
        loose = probe.talk(Float64MultiArray, 'current_command', QoSProfile(
            depth=10, reliability=ReliabilityPolicy.BEST_EFFORT))
        states = probe.talk(JointState, 'joint_states')
        with Process(tmp_path / 'log', 'recorder', {'output': str(folder)}) as recorder:
            probe.until(lambda: states.get_subscription_count() >= 1
                        and loose.get_subscription_count() >= 1, 'the recorder')
            # Until it knows of the publishers, too.
            probe.spin_for(0.5)
            commands = 0

            def both(count):
                nonlocal commands
                lasting.publish(Int8MultiArray(data=[1]))
                loose.publish(Float64MultiArray(data=[0.5]))
                commands += 1
                return count >= 350
            count = talk_until(probe, states, both, 'states')
            probe.status_of(
                'recorder', lambda status: value_of(status, 'joint_states') == str(count))
            recorder.send()
            assert recorder.wait() == 0
            assert 'incompatible' not in recorder.text
    (samples, info), = read_recording_with_info(folder)
    np.testing.assert_array_equal(samples.current, np.arange(float(count)))
    assert (samples.direction[10:] == 1).all()
    # Best-effort messages may be lost on a busy machine, but losses are reported.
    if Scan(folder).counts['/current_command'] != commands:
        assert any('lost' in note and 'current_command' in note for note in info.notes)
    assert not any('lost' in note and 'joint_states' in note for note in info.notes)


def spoilt(message, seconds, nanoseconds):
    message.header.stamp.sec, message.header.stamp.nanosec = seconds, nanoseconds
    return message


def test_a_bad_message_does_not_affect_others_and_the_end_loses_none(tmp_path):
    """Stamps that are no time, arrays that no robot has; while the driver goes on."""
    folder = tmp_path / 'r'
    bad = [*(spoilt(joint_state(0, ['elbow'], [7.0], effort=[1e5]), *stamp) for stamp in (
        (-5, 0), (-2**31, 2**32 - 1), (1, 4_000_000_000), (2**31 - 1, 999_999_999))),
           joint_state(1_000_000_000, ['elbow'] * 5000, [0.0] * 5000)]
    with at_work(tmp_path, folder) as (recorder, probe, publisher, count):
        commands = probe.talk(Float64MultiArray, 'current_command')
        probe.matched(commands)
        for message in bad:
            publisher.publish(message)
        commands.publish(Float64MultiArray(data=[1e300] * 100_000))
        commands.publish(Float64MultiArray(data=[0.25]))
        wanted = count + 100
        count = talk_until(probe, publisher, lambda n: n >= wanted, 'more states', count)
        recorder.send()
        while recorder.running:
            publisher.publish(joint_state(
                1_000_000_000 + count * 1_000_000, ['elbow'], [1e-3 * count],
                effort=[float(count)]))
            count += 1
            probe.spin_for(2e-4)
        assert recorder.wait() == 0, recorder.text
    (samples, _), = read_recording_with_info(folder)
    assert samples.current[-1] > wanted
    np.testing.assert_array_equal(np.diff(samples.current), 1.0)
    assert samples.command[-1] == 0.25
    assert Scan(folder).counts['/joint_states'] == len(samples) + 5


def test_a_full_disk_ends_the_recorder_with_a_message_and_a_readable_recording(tmp_path):
    folder = tmp_path / 'r'
    with at_work(tmp_path, folder) as (recorder, probe, states, count):
        probe.status_of('recorder')
        limit = sum(path.stat().st_size for path in Path(folder).glob('*.mcap')) + 50_000
        resource.prlimit(recorder._process.pid, resource.RLIMIT_FSIZE, (limit, limit))
        talk_until(probe, states, lambda n: not recorder.running, 'the end', count)
        assert recorder.wait() == 2
        probe.status_of('recorder', lambda status: status.level == b'\x02'
                        and 'cannot be written' in status.message)
        lines = [line for line in recorder.text.splitlines() if 'cannot be written' in line]
        assert len(lines) == 1
        assert 'what was written before can be read' in lines[0]
    current, _ = on_disk(folder)
    assert len(current) > 100
    np.testing.assert_array_equal(np.diff(current), 1.0)


def test_losses_are_counted(tmp_path):
    """What a publisher keeps no longer, when a recorder that was stopped asks for it."""
    folder = tmp_path / 'r'
    with own_domain(), probe_node() as probe:
        states = probe.talk(JointState, 'joint_states', QoSProfile(
            depth=10, reliability=ReliabilityPolicy.RELIABLE))
        with Process(tmp_path / 'log', 'recorder', {'output': str(folder)}) as recorder:
            count = talk_until(probe, states, lambda n: len(on_disk(folder)[0]) > 100, 'states')

            def heard(status):
                return int(value_of(status, 'joint_states')) + int(
                    value_of(status, 'messages lost'))
            # Not all of the first ones, which were sent before both ends knew each other.
            probe.listen(DiagnosticArray, '/diagnostics')
            probe.spin_for(1.0)
            before = heard(probe.status_of('recorder'))
            recorder.send(signal.SIGSTOP)
            for number in range(count, count + 4000):
                states.publish(joint_state(10**9 + number * 10**6, ['elbow'], [0.0]))
            recorder.send(signal.SIGCONT)
            status = probe.status_of('recorder', lambda one: heard(one) == before + 4000)
            assert 'messages lost' in status.message
            lost = value_of(status, 'messages lost')
            recorder.send()
            assert recorder.wait() == 0
    (_, info), = read_recording_with_info(folder)
    assert any(f'{lost} joint_states' in note for note in info.notes)
