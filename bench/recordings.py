# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Whether all is recorded.

    python3 bench/recordings.py [--seconds N] [--joints J]

Recorder and a publisher of six topics at 1 kHz in processes of their own, for N seconds: messages
of each topic published and recorded, losses the recorder counted, its CPU.
"""

from array import array
from pathlib import Path
import resource
import tempfile
import time

from bench_tools import table_parser
from geometry_msgs.msg import WrenchStamped
from node_process import Process
from rclpy.duration import Duration
from ros_system import joint_state, own_domain, probe_node
from sensor_msgs.msg import Temperature
from std_msgs.msg import Float64MultiArray, Int8MultiArray

from friction_comp.recordings.reader import read_recording_with_info
from friction_comp.recordings.scan import Scan

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
    (_, info), = read_recording_with_info(folder / 'load', 'joint_0')
    yield 'published of each', round(seconds * RATE)
    yield 'recorded', dict(Scan(folder / 'load').counts)
    yield 'recorder says', next((n for n in info.notes if 'lost' in n), 'none lost')
    yield 'recorder user CPU / time', f'{cpu / seconds:.2f}'


def main():
    """Print what was published and recorded."""
    arguments = table_parser(__doc__, joints=7, seconds=60.0).parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for key, value in record(Path(folder), arguments.seconds, arguments.joints):
            print(f'{key}: {value}', flush=True)


if __name__ == '__main__':
    main()
