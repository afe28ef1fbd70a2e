# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the compensator adds to DDS: its round trip beside that of a bare rclpy node.

    python3 bench/round_trip.py [--seconds S] [--pairs N] [--joints J …]

A driver publishes joint states at 1 kHz and takes the time until the current that answers each;
the compensator and a bare node, which sends back the positions that it gets, take turns. The table
has the ratios of median, 99th percentile and processor time, each the median over the pairs, and
the longest pause of the compensator between two answers in the `SETTLING` seconds after the first,
in which whatever is done or loaded for the first time would show.
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
from ros_system import BEST_EFFORT, joint_state, MODELS, own_domain, probe_node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int8MultiArray

SETTLING = 3.0

ECHO = """
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
    command = ['-c', ECHO] if kind == 'echo' else ['-m', 'friction_comp', kind, *ros_arguments({
        'joints': joints, 'model_files': [MODELS[k % 3] for k in range(len(joints))]})]
    log = (Path(folder) / f'{kind}.log').open('ab')
    return subprocess.Popen([sys.executable, *command], env=environment(), stdout=log, stderr=log)


def measure(kind, count, seconds, folder):
    """Return median and 99th percentile of round trips, processor time per s, and the pause, s."""
    joints = [f'joint_{k}' for k in range(count)]
    with own_domain(), probe_node() as probe:
        states = probe.create_publisher(JointState, 'joint_states', BEST_EFFORT)
        directions = probe.create_publisher(Int8MultiArray, 'direction', BEST_EFFORT)
        arrived = []
        probe.create_subscription(
            Float64MultiArray, 'current_command',
            lambda _: arrived.append(time.perf_counter()), BEST_EFFORT)
        begin = time.perf_counter()
        process = start(kind, joints, folder)

        def send(position):
            states.publish(joint_state(
                time.time_ns(), joints, [position] * count, [0.3] * count))
            return time.perf_counter()

        def await_turn(k, began):
            due = began + 1e-3 * k
            while time.perf_counter() < due:
                probe._executor_.spin_once(timeout_sec=max(0.0, due - time.perf_counter()))
        try:
            while not arrived:
                send(0.0)
                probe.spin_for(0.005)
                assert time.perf_counter() - begin < 60.0, f'{kind} never answers'
            began = time.perf_counter()
            for k in range(round(1000 * SETTLING)):
                await_turn(k, began)
                send(0.0)
            pause = float(np.diff(arrived).max())
            trips, used, began = [], processor_time(process.pid), time.perf_counter()
            for k in range(round(1000 * seconds)):
                await_turn(k, began)
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
    return np.array([np.median(trips), np.percentile(trips, 99), share, pause])


def main():
    parser = table_parser(__doc__, seconds=8.0, pairs=5)
    parser.add_argument('--joints', type=int, nargs='+', default=[1, 7])
    arguments = parser.parse_args()
    print('joints   median   99th percentile   processor   median µs, longest pause ms')
    with tempfile.TemporaryDirectory() as folder:
        for count in arguments.joints:
            # Whichever was second before comes first.
            found = {kind: np.empty((arguments.pairs, 4)) for kind in ('echo', 'compensator')}
            for pair in range(arguments.pairs):
                for kind in list(found)[::1 if pair % 2 == 0 else -1]:
                    found[kind][pair] = measure(kind, count, arguments.seconds, folder)
            ours = found['compensator']
            ratios = np.median(ours / found['echo'], axis=0)
            print(f'{count:6d} {ratios[0]:8.2f} {ratios[1]:17.2f} {ratios[2]:11.2f}   '
                  f'{1e6 * np.median(ours[:, 0]):.0f}, {1e3 * np.median(ours[:, 3]):.1f}',
                  flush=True)


if __name__ == '__main__':
    main()
