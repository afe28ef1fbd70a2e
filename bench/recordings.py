# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Whether all is recorded, and what damage to a recording costs.

    python3 bench/recordings.py [--seconds N] [--joints J]

record   recorder and a publisher of six topics at 1 kHz in processes of their own, for N seconds:
         messages of each topic published and recorded, losses the recorder counted, its CPU
damage   zeroed blocks of 4096 bytes at random places of the first file: recovered, and told
"""

import argparse
from array import array
from pathlib import Path
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time

from bench_tools import table_parser
from node_process import environment

from friction_comp.demo.ros_domain import leased_domain
from friction_comp.errors import InputError
from friction_comp.recordings import read_recording_with_info

TOPICS = ('joint_states', 'current_command', 'direction', 'reference', 'interaction_wrench',
          'motor_temperature')
RATE, DAMAGES = 1000, 40


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


def record(folder, seconds, joints, domain):
    """Return what was published and recorded of each topic, losses counted, and CPU in s."""
    alone = environment(ROS_LOG_DIR=str(folder / 'log'), ROS_DOMAIN_ID=str(domain),
                        ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
    recorder = subprocess.Popen(
        [sys.executable, '-m', 'friction_comp', 'recorder', '--ros-args', '-p',
         f'output:={folder / "load"}'],
        env=alone, stderr=subprocess.DEVNULL)
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    try:
        subprocess.run([sys.executable, __file__, '--publish', str(seconds), str(joints)],
                       env=alone, check=True, timeout=seconds * 3 + 120)
    finally:
        published = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        recorder.send_signal(signal.SIGINT)
        recorder.wait(120)
    (_, info), = read_recording_with_info(folder / 'load', 'joint_0', others=False)
    recorded = {topic: info.topics[f'/{topic}'][1] for topic in TOPICS}
    cpu = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before - published
    return {'published of each': round(seconds * RATE), 'recorded': recorded,
            'recorder says': next((n for n in info.notes if 'lost' in n), 'none lost'),
            'recorder user CPU / time': cpu / seconds}


def damage(file, room):
    """Return how many damaged copies were read, refused, and said nothing."""
    content = file.read_bytes()
    draw = random.Random(1)
    told = refused = silent = 0
    for _ in range(DAMAGES):
        at = draw.randrange(len(content) - 4096)
        copy = room / 'damaged.mcap'
        copy.write_bytes(content[:at] + bytes(4096) + content[at + 4096:])
        try:
            (_, info), = read_recording_with_info(copy, 'joint_0')
        except InputError:
            refused += 1
        else:
            words = [note for note in info.notes if 'says nothing' not in note and
                     'gaps' not in note]
            told, silent = told + bool(words), silent + (not words)
    return {'zeroed blocks': DAMAGES, 'read and told': told, 'refused': refused,
            'silent': silent}


def main():
    """Run all and print a table."""
    parser = table_parser(__doc__, seconds=60.0, joints=7)
    parser.add_argument('--publish', nargs=2, type=float, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.publish:
        publish(arguments.publish[0], int(arguments.publish[1]))
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with leased_domain() as domain:
            found = {'record': record(folder, arguments.seconds, arguments.joints, domain)}
        found['damage'] = damage(folder / 'load' / 'load_0.mcap', folder)
    for title, values in found.items():
        for key, value in values.items():
            text = f'{value:.2f}' if isinstance(value, float) else value
            print(f'{title:8} {key}: {text}')


if __name__ == '__main__':
    main()
