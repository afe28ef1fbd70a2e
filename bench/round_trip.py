# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the compensator adds to DDS: its round trip and its start beside a bare rclpy node's.

    python3 bench/round_trip.py [--seconds S] [--pairs N] [--joints J …]

A driver publishes joint states at 1 kHz and takes the time until the current that answers each;
the compensator and a bare node, which sends back the positions that it gets, take turns. The table
has the ratios of median, 99th percentile, and processor time, each the median over the pairs, and
the ratio of the times from a process's start to its first answer, and of the processor time that
it took, which depends less on what else the machine does. The longest pause is the longest time
between two answers in the SETTLING seconds after the first, in which whatever is done or loaded
for the first time would show.
"""

from array import array
from pathlib import Path
import subprocess
import sys
import tempfile
import time

from bench_tools import processor_time, table_parser
from node_process import environment, ros_arguments
import numpy as np
from ros_system import BEST_EFFORT, MODELS, own_domain, probe_node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int8MultiArray

SETTLING = 3.0

ECHO = """
import sys
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
rclpy.init()
node = Node('echo')
commands = node.create_publisher(Float64MultiArray, 'current_command', 10)
answer = Float64MultiArray()


def on_states(message):
    answer.data = message.position
    commands.publish(answer)


node.create_subscription(JointState, 'joint_states', on_states, QoSProfile(
    depth=10, reliability=ReliabilityPolicy.BEST_EFFORT))
rclpy.spin(node)
"""


def start(kind, joints, folder):
    if kind == 'echo':
        command = [sys.executable, '-c', ECHO]
    else:
        command = [sys.executable, '-m', 'friction_comp', 'compensator', *ros_arguments({
            'joints': joints, 'model_files': [MODELS[k % 3] for k in range(len(joints))]})]
    log = (Path(folder) / f'{kind}.log').open('ab')
    return subprocess.Popen(command, env=environment(), stdout=log, stderr=log)


def measure(kind, count, seconds, folder):
    """Return s: round trips (N,), processor time per s, first answer, longest pause after it.

    And what it took of the processor until that answer.
    """
    joints = [f'joint_{k}' for k in range(count)]
    with own_domain(), probe_node() as probe:
        states = probe.create_publisher(JointState, 'joint_states', BEST_EFFORT)
        directions = probe.create_publisher(Int8MultiArray, 'direction', BEST_EFFORT)
        arrived = []
        probe.create_subscription(
            Float64MultiArray, 'current_command',
            lambda _: arrived.append(time.perf_counter()), BEST_EFFORT)
        message = JointState(name=joints)
        begin = time.perf_counter()
        process = start(kind, joints, folder)
        try:
            def send(position):
                now = time.time_ns()
                message.header.stamp.sec, message.header.stamp.nanosec = divmod(now, 10**9)
                message.position = array('d', [position] * count)
                message.velocity = array('d', [0.3] * count)
                message.effort = array('d', [0.0] * count)
                states.publish(message)
                return time.perf_counter()

            while not arrived:
                send(0.0)
                probe.spin_for(0.005)
                assert time.perf_counter() - begin < 60.0, f'{kind} never answers'
            first, spent = arrived[0] - begin, processor_time(process.pid)
            after = settle(probe, send, arrived)
            pause = float(np.diff(after).max())
            trips, used, began = [], processor_time(process.pid), time.perf_counter()
            for k in range(round(1000 * seconds)):
                due = began + 1e-3 * k
                while time.perf_counter() < due:
                    probe._executor_.spin_once(timeout_sec=max(0.0, due - time.perf_counter()))
                if k % 10 == 0:
                    directions.publish(Int8MultiArray(data=array('b', [1] * count)))
                arrived.clear()
                sent = send(3e-4 * k)
                probe._executor_.spin_once(timeout_sec=1e-3)
                if arrived:
                    trips.append(arrived[0] - sent)
            share = (processor_time(process.pid) - used) / (time.perf_counter() - began)
        finally:
            process.terminate()
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()      # A bare rclpy node sometimes hangs on its way out.
                process.wait()
    return np.array(trips), share, first, pause, spent


def settle(probe, send, arrived):
    """Send states at 1 kHz while the process settles, and return when answers came, s."""
    began = time.perf_counter()
    for k in range(round(1000 * SETTLING)):
        due = began + 1e-3 * k
        while time.perf_counter() < due:
            probe._executor_.spin_once(timeout_sec=max(0.0, due - time.perf_counter()))
        send(0.0)
    probe.spin_for(0.01)
    return list(arrived)


def main():
    parser = table_parser(__doc__, seconds=8.0, pairs=5)
    parser.add_argument('--joints', type=int, nargs='+', default=[1, 7])
    arguments = parser.parse_args()
    print('joints   median   99th percentile   processor   first answer   its processor   '
          'compensator / echo: '
          'median µs, first answer s, longest pause ms')
    with tempfile.TemporaryDirectory() as folder:
        for count in arguments.joints:
            rows, times = [], []
            for pair in range(arguments.pairs):
                found = {kind: measure(kind, count, arguments.seconds, folder)
                         for kind in (('echo', 'compensator'), ('compensator', 'echo'))[pair % 2]}
                ours, cost, first, pause, spent = found['compensator']
                bare, least, soon, rest, little = found['echo']
                rows.append([np.median(ours) / np.median(bare),
                             np.percentile(ours, 99) / np.percentile(bare, 99), cost / least,
                             first / soon, spent / little])
                times.append([1e6 * np.median(ours), 1e6 * np.median(bare), first, soon,
                              1e3 * pause, 1e3 * rest])
            ratios, sizes = np.median(rows, axis=0), np.median(times, axis=0)
            print(f'{count:6d} {ratios[0]:8.2f} {ratios[1]:17.2f} {ratios[2]:11.2f} '
                  f'{ratios[3]:14.2f} {ratios[4]:15.2f}   {sizes[0]:.0f} / {sizes[1]:.0f}, '
                  f'{sizes[2]:.2f} / {sizes[3]:.2f}, {sizes[4]:.1f} / {sizes[5]:.1f}', flush=True)


if __name__ == '__main__':
    main()
