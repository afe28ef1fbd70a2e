# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Whether all is recorded, and what the evaluation of an hour needs.

    python3 bench/recordings.py [--rows record hour] [--seconds N] [--joints J]

record   recorder and a publisher of six topics at 1 kHz in processes of their own, for N seconds:
         messages of each topic published and recorded, losses the recorder counted, its CPU
hour     `evaluate` of N s (an hour unless --seconds says otherwise) of joints at 1 kHz that move to
         and fro, with an announced direction: time, and peak memory
"""

import argparse
from array import array
import os
from pathlib import Path
import resource
import signal
import subprocess
import sys
import tempfile
import time

from bench_tools import table_parser
from node_process import environment
import numpy as np

from friction_comp.demo.processes import leased_domain
from friction_comp.recordings import read_recording_with_info, RecordingWriter

TOPICS = ('joint_states', 'current_command', 'direction', 'reference', 'interaction_wrench',
          'motor_temperature')
RATE = 1000
TOOL = [sys.executable, '-m', 'friction_comp']


def publish(seconds, joints):
    """Publish all topics at 1 kHz for some seconds; what was late is caught up with."""
    from geometry_msgs.msg import WrenchStamped
    import rclpy
    from rclpy.duration import Duration
    from rclpy.qos import QoSProfile, ReliabilityPolicy
    from sensor_msgs.msg import JointState, Temperature
    from std_msgs.msg import Float64MultiArray, Int8MultiArray

    rclpy.init()
    node = rclpy.create_node('publisher')
    names = [f'joint_{k}' for k in range(joints)]
    values = array('d', [0.1] * joints)
    messages = dict(zip(TOPICS, (
        JointState(name=names, position=values, velocity=values, effort=values),
        Float64MultiArray(data=values), Int8MultiArray(data=[0] * joints),
        JointState(name=names, position=values, velocity=values), WrenchStamped(), Temperature())))
    messages['interaction_wrench'].header.frame_id = names[0]
    messages['motor_temperature'].header.frame_id = names[0]
    publishers = {topic: node.create_publisher(type(message), topic, QoSProfile(
        depth=10_000, reliability=ReliabilityPolicy.RELIABLE))
        for topic, message in messages.items()}
    while any(p.get_subscription_count() < 1 for p in publishers.values()):
        time.sleep(0.05)
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
    with leased_domain() as domain:
        alone = environment(ROS_LOG_DIR=str(folder / 'log'), ROS_DOMAIN_ID=str(domain),
                            ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
        recorder = subprocess.Popen(
            [*TOOL, 'recorder', '--ros-args', '-p', f'output:={folder / "load"}'],
            env=alone, stderr=subprocess.DEVNULL)
        try:
            subprocess.run([sys.executable, __file__, '--publish', str(seconds), str(joints)],
                           env=alone, check=True, timeout=seconds * 3 + 120)
        finally:
            published = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            recorder.send_signal(signal.SIGINT)
            recorder.wait(120)
    (_, info), = read_recording_with_info(folder / 'load', 'joint_0', others=False)
    cpu = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - published
    yield 'published of each', round(seconds * RATE)
    yield 'recorded', {topic: info.topics[f'/{topic}'][1] for topic in TOPICS}
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
        [*TOOL, 'evaluate', folder / 'hour', '--output', folder / 'out'],
        env=environment(OMP_NUM_THREADS='1', OPENBLAS_NUM_THREADS='1'), stdout=subprocess.DEVNULL)
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
    parser.add_argument('--publish', nargs=2, type=float, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.publish:
        publish(arguments.publish[0], int(arguments.publish[1]))
        return
    for row in arguments.rows:
        ask, seconds = ROWS[row]
        with tempfile.TemporaryDirectory() as folder:
            for key, value in ask(Path(folder), arguments.seconds or seconds, arguments.joints):
                print(f'{row:8} {key}: {value}', flush=True)


if __name__ == '__main__':
    main()
