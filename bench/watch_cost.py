# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What `watch` costs the compensator: its processor time for each joint state, without and with.

    python3 bench/watch_cost.py [--pieces N]
    python3 bench/watch_cost.py --readers

Seven joints at 1 kHz under a driver that hears the commands, as every robot has one: DDS takes much
longer for the first reader of a topic than for the next. Pieces without the page take turns with
pieces with it and a client that opens it. It is processor time, not wall-clock time, over the
states that the compensator says it has taken; but processes that share caches and clock make each
other slower. --readers measures what is behind it, also on a busy machine: what publishing one
command takes with no reader, one and two, while readers come and go every two seconds.
"""

from array import array
from contextlib import ExitStack
import os
from pathlib import Path
import statistics
import subprocess
import sys
import tempfile
import time

from bench_tools import processor_time, ROOT, table_parser
from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from ros_system import joint_state, MODELS, own_domain, probe_node, Process, RELIABLE, value_of
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

JOINTS = [f'joint_{k}' for k in range(1, 8)]
SECONDS, RATE = 5.0, 1000.0
# Programs that read the commands and do nothing with them: for good, or every other two seconds.
READER = """
import time
import rclpy
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Float64MultiArray
rclpy.init()
node = rclpy.create_node('reader')
def read():
    node.create_subscription(
        Float64MultiArray, 'current_command', lambda _: None, qos_profile_sensor_data, raw=True)
read()
try:
    rclpy.spin(node)
except rclpy.executors.ExternalShutdownException:
    pass
"""
COMES_AND_GOES = READER.replace('    rclpy.spin(node)', """\
    while True:
        for found in list(node.subscriptions):
            node.destroy_subscription(found)
        time.sleep(2.0)
        read()
        end = time.monotonic() + 2.0
        while time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.1)""")


def drive(probe, publisher, seconds):
    """Publish joint states for a time; return how many a second were taken."""
    probe.spin_for(0.01)
    probe.heard['/diagnostics'].clear()
    begin, count = time.monotonic(), 0
    while (passed := time.monotonic() - begin) < seconds:
        if count < passed * RATE:
            x = 0.3 * np.sin(passed + np.arange(7))
            publisher.publish(joint_state(time.time_ns(), JOINTS, x, 0.3 * np.cos(passed + x)))
            count += 1
        else:
            time.sleep(2e-4)
    probe.spin_for(0.01)
    rates = [float(value_of(status, 'joint_states rate [Hz]'))
             for message in probe.heard['/diagnostics'] for status in message.status
             if status.name.startswith('compensator')]
    # The first second began before this piece.
    return float(np.mean(rates[1:] or rates or [np.nan]))


def start_page():
    """Start the page and a client that opens it; return both, the last to end first."""
    server = subprocess.Popen(
        [sys.executable, '-m', 'friction_comp', 'watch', '--port', '0', '--joint', *JOINTS],
        cwd=ROOT, stdout=subprocess.PIPE, text=True)
    address = server.stdout.readline().split()[0]
    client = subprocess.Popen([sys.executable, '-c', (
        'import time\nfrom bokeh.client import pull_session\n'
        f's = pull_session(url={address!r})\nwhile True:\n    s.force_roundtrip()\n'
        '    time.sleep(0.2)')])
    time.sleep(4.0)
    return [client, server]


def publishing(seconds=60.0):
    """Print what publishing a command takes of the processor, by the number of its readers."""
    with own_domain(), probe_node() as probe:
        port = probe.talk(Float64MultiArray, 'current_command', RELIABLE)
        message = Float64MultiArray(data=array('d', [0.1] * 7))
        took = {}
        for steady in ([], [READER]):
            started = [subprocess.Popen([sys.executable, '-c', text], stderr=subprocess.DEVNULL)
                       for text in (*steady, COMES_AND_GOES)]
            begin, count, readers = time.monotonic(), 0, 0
            while (passed := time.monotonic() - begin) < 0.5 * seconds:
                if count < passed * RATE:
                    if count % 100 == 0:
                        readers = port.get_subscription_count()
                    before = time.thread_time()
                    port.publish(message)
                    took.setdefault(readers, []).append(time.thread_time() - before)
                    count += 1
                else:
                    time.sleep(2e-4)
            for one in started:
                one.terminate()
                one.wait()
    for readers, times in sorted(took.items()):
        print(f'{readers} readers: publishing takes {1e6 * statistics.median(times):.0f} us of the '
              f'processor (median of {len(times)}; mean {1e6 * statistics.mean(times):.0f})')


def main():
    """Measure and print."""
    parser = table_parser(__doc__, pieces=5)
    parser.add_argument('--readers', action='store_true')
    arguments = parser.parse_args()
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    if arguments.readers:
        publishing()
        return
    costs, taken, shares = ([], []), ([], []), []
    with ExitStack() as stack:
        stack.enter_context(own_domain())
        room = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        probe = stack.enter_context(probe_node())
        compensator = stack.enter_context(Process(room, 'compensator', {
            'joints': JOINTS, 'model_files': [MODELS[0]] * 7, 'joint_state_timeout': 1.0}))
        driver = subprocess.Popen([sys.executable, '-c', READER])
        stack.callback(driver.wait)
        stack.callback(driver.terminate)
        probe.until(lambda: probe.count_subscribers('current_command'), 'a driver')
        publisher = probe.talk(JointState, 'joint_states')
        probe.matched(publisher)
        probe.listen(DiagnosticArray, '/diagnostics')
        drive(probe, publisher, 2.0)
        for piece in range(2 * arguments.pieces):
            company = start_page() if piece % 2 else []
            before = processor_time(compensator._process.pid)
            theirs = [processor_time(one.pid) for one in company]
            rate = drive(probe, publisher, SECONDS)
            costs[piece % 2].append(1e6 * (
                processor_time(compensator._process.pid) - before) / SECONDS / rate)
            taken[piece % 2].append(rate)
            shares += [(processor_time(one.pid) - since) / SECONDS
                       for one, since in zip(company, theirs)]
            for one in company:
                assert one.poll() is None, f'what was to run beside it ended: {one.args}'
                one.terminate()
                one.wait()
    plain, watched = (np.array(one) for one in costs)
    print(f'compensator, 7 joints: {np.median(plain):.0f} us of processor time a joint state, '
          f'{np.median(watched):.0f} us beside the page: ratio '
          f'{np.median(watched) / np.median(plain):.3f} '
          f'(pieces without {plain.min():.0f} to {plain.max():.0f}, with {watched.min():.0f} to '
          f'{watched.max():.0f}); {np.median(taken[0]):.0f} and {np.median(taken[1]):.0f} states a '
          f'second were taken; page and client took '
          f'{100 * sum(shares) / arguments.pieces:.0f} % of a processor')


if __name__ == '__main__':
    main()
