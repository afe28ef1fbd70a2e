# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Whether all is recorded, and what the evaluation of an hour needs.

    python3 bench/recordings.py [--rows record hour] [--seconds N] [--joints J]

record   recorder and a publisher of six topics at 1 kHz in processes of their own, for N seconds:
         messages of each topic published and recorded, losses the recorder counted, its CPU
hour     `evaluate` of N s (an hour unless --seconds says otherwise) of joints at 1 kHz that move to
         and fro, with an announced direction: time, and peak memory
"""

from array import array
import os
from pathlib import Path
import resource
import subprocess
import sys
import tempfile
import time

from bench_tools import table_parser
from geometry_msgs.msg import WrenchStamped
from node_process import environment, Process
import numpy as np
from rclpy.duration import Duration
from ros_system import joint_state, own_domain, probe_node
from sensor_msgs.msg import Temperature
from std_msgs.msg import Float64MultiArray, Int8MultiArray

from friction_comp.recordings.reader import read_recording_with_info
from friction_comp.recordings.writer import RecordingWriter

RATE = 1000


def publish(probe, seconds, joints):
    """Publish all topics at 1 kHz for some seconds; what was late is caught up with."""
    names, values = [f'joint_{k}' for k in range(joints)], array('d', [0.1] * joints)
    wrench, temperature = WrenchStamped(), Temperature()
    wrench.header.frame_id = temperature.header.frame_id = names[0]
    messages = {
        'joint_states': joint_state(0, names, values, values, values),
        'reference': joint_state(0, names, values, values),
        'interaction_wrench': wrench, 'motor_temperature': temperature,
        'current_command': Float64MultiArray(data=values),
        'direction': Int8MultiArray(data=[0] * joints)}
    publishers = {topic: probe.talk(type(message), topic) for topic, message in messages.items()}
    for publisher in publishers.values():
        probe.matched(publisher)
    time.sleep(1.0)
    begin, sent = time.perf_counter(), 0
    while sent < seconds * RATE:
        while sent < min((time.perf_counter() - begin) * RATE, seconds * RATE):
            stamp = divmod(time.time_ns(), 1_000_000_000)
            for topic, message in messages.items():
                if hasattr(message, 'header'):
                    message.header.stamp.sec, message.header.stamp.nanosec = stamp
                publishers[topic].publish(message)
            sent += 1
        time.sleep(5e-4)
    # A publisher that goes takes with it what its readers do not have yet.
    for publisher in publishers.values():
        assert publisher.wait_for_all_acked(Duration(seconds=120))


def record(folder, seconds, joints):
    """Yield what was published and recorded of each topic, losses counted, and CPU time."""
    with own_domain(), probe_node() as probe, Process(
            folder / 'log', 'recorder', {'output': str(folder / 'load')}, fresh=True) as recorder:
        publish(probe, seconds, joints)
        recorder.send()
        recorder.wait()
    cpu = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    (_, info), = read_recording_with_info(folder / 'load', 'joint_0', others=False)
    yield 'published of each', round(seconds * RATE)
    yield 'recorded', {name[1:]: count for name, (_, count) in info.topics.items()}
    yield 'recorder says', next((n for n in info.notes if 'lost' in n), 'none lost')
    yield 'recorder user CPU / time', f'{cpu / seconds:.2f}'


def write_movements(path, seconds, joints):
    """Write joints that rest, go there, rest and come back, in 8 s, one after the other."""
    from rosbags.typesys import get_typestore, Stores

    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    names = [f'joint_{k + 1}' for k in range(joints)]
    empty = types['std_msgs/msg/MultiArrayLayout']([], 0)

    with RecordingWriter(path) as recording:
        def write(topic, kind, when, *values):
            recording.write(topic, kind, when, bytes(
                store.serialize_cdr(types[kind](*values), kind)))
        for k in range(round(seconds * RATE)):
            phase = (k / RATE + 0.3 * np.arange(joints)) % 8.0
            gone = np.clip((phase - 2.0) / 2.0, 0.0, 1.0) - np.clip((phase - 6.0) / 2.0, 0.0, 1.0)
            side = np.sign(((phase > 2.0) & (phase < 4.0)) - 1.0 * (phase > 6.0))
            when = round((k / RATE + 1.7e9) * 1e9)
            stamp = types['builtin_interfaces/msg/Time'](*divmod(when, 10 ** 9))
            write('/joint_states', 'sensor_msgs/msg/JointState', when,
                  types['std_msgs/msg/Header'](stamp, ''), names,
                  0.5 * np.sin(0.5 * np.pi * gone) ** 2, np.array([]), 0.2 * side)
            if k % 100 == 0:
                write('/direction', 'std_msgs/msg/Int8MultiArray', when, empty,
                      side.astype(np.int8))


def hour(folder, seconds, joints):
    """Yield what the evaluation of one long recording needs."""
    write_movements(folder / 'hour', seconds, joints)
    begin = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, '-m', 'friction_comp', 'evaluate', folder / 'hour',
         '--output', folder / 'out'], env=environment(), stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    assert status == 0
    size = sum(path.stat().st_size for path in (folder / 'hour').iterdir()) / 1e6
    yield 'recorded', f'{seconds:.0f} s of {joints} joints, {size:.0f} MB'
    yield 'movements', sum(1 for _ in (folder / 'out' / 'repetitions.csv').open()) - 1
    yield 'time', f'{time.monotonic() - begin:.0f} s, {used.ru_utime + used.ru_stime:.0f} s of CPU'
    yield 'peak memory', f'{used.ru_maxrss / 1024:.0f} MB'


ROWS = {'record': (record, 60.0), 'hour': (hour, 3600.0)}


def main():
    """Run all and print a table."""
    parser = table_parser(__doc__, joints=7)
    parser.add_argument('--rows', nargs='+', default=list(ROWS), choices=ROWS)
    parser.add_argument('--seconds', type=float)
    arguments = parser.parse_args()
    for row in arguments.rows:
        ask, seconds = ROWS[row]
        with tempfile.TemporaryDirectory() as folder:
            for key, value in ask(Path(folder), arguments.seconds or seconds, arguments.joints):
                print(f'{row:8} {key}: {value}', flush=True)


if __name__ == '__main__':
    main()
