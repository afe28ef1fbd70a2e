# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What `watch` costs the compensator: its processor time for each joint state, without and with.

    python3 bench/watch_cost.py [--beside KIND] [--pieces N] [--without-driver]
    python3 bench/watch_cost.py --readers

Seven joints at 1 kHz under a driver that hears the commands, as every robot has one: DDS takes much
longer for the first reader of a topic than for the next (--without-driver shows it). Pieces without
company take turns with pieces with it. The company is the page with a client that opens it; or, to
see where its cost comes from, one reader of a topic that does nothing with it
(--beside current_command), or a process that only computes (--beside work). It is
processor time, not wall-clock time, over the states that the compensator says it has taken; but
processes that share caches and clock make each other slower, which `work` shows. --readers measures
what is behind it, also on a busy machine: what publishing one command takes with no reader, one and
two, while readers come and go every two seconds.
"""

import argparse
from contextlib import ExitStack
import os
from pathlib import Path
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]
JOINTS = [f'joint_{k}' for k in range(1, 8)]
SECONDS, RATE = 5.0, 1000.0
READER = """
from importlib import import_module
import sys
import rclpy
from rclpy.qos import qos_profile_sensor_data
rclpy.init()
node = rclpy.create_node('reader')
room, _, name = sys.argv[2].partition('/')
node.create_subscription(getattr(import_module(f'{room}.msg'), name), sys.argv[1], lambda _: None,
                         qos_profile_sensor_data, raw=True)
try:
    rclpy.spin(node)
except rclpy.executors.ExternalShutdownException:
    pass
"""
COMES_AND_GOES = READER.replace('try:\n    rclpy.spin(node)', """import time
try:
    while True:
        for found in list(node.subscriptions):
            node.destroy_subscription(found)
        time.sleep(2.0)
        node.create_subscription(getattr(import_module(f'{room}.msg'), name), sys.argv[1],
                                 lambda _: None, qos_profile_sensor_data, raw=True)
        end = time.monotonic() + 2.0
        while time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.1)""")
KINDS = {'current_command': 'std_msgs/Float64MultiArray',
         'joint_states': 'sensor_msgs/JointState',
         '/diagnostics': 'diagnostic_msgs/DiagnosticArray'}


def processor_time(pid):
    """Return the processor time of a process in s."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def drive(probe, publisher, seconds):
    """Publish joint states for a time; return how many a second were taken."""
    from ros_system import joint_state, value_of

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


def beside(kind, patience=4.0):
    """Start the company of a kind and wait some s; return its processes, the last to end first."""
    if kind == 'page':
        server = subprocess.Popen(
            [sys.executable, '-m', 'friction_comp', 'watch', '--port', '0', '--joint', *JOINTS],
            cwd=ROOT, stdout=subprocess.PIPE, text=True)
        address = server.stdout.readline().split()[0]
        started = [subprocess.Popen([sys.executable, '-c', (
            'import time\nfrom bokeh.client import pull_session\n'
            f's = pull_session(url={address!r})\nwhile True:\n    s.force_roundtrip()\n'
            '    time.sleep(0.2)')]), server]
    elif kind == 'work':
        # As much as the page and its client do: a tenth of the time each.
        work = ('import time\nwhile True:\n    end = time.process_time() + 0.01\n'
                '    while time.process_time() < end:\n        sum(range(1000))\n'
                '    time.sleep(0.04)')
        started = [subprocess.Popen([sys.executable, '-c', work])]
    else:
        started = [subprocess.Popen([sys.executable, '-c', READER, kind, KINDS[kind]])]
    time.sleep(patience)
    return started


def publishing(seconds=60.0):
    """Print what publishing a command takes of the processor, by the number of its readers."""
    from array import array

    from ros_system import own_domain, probe_node, RELIABLE
    from std_msgs.msg import Float64MultiArray

    with own_domain(), probe_node() as probe:
        port = probe.talk(Float64MultiArray, 'current_command', RELIABLE)
        message = Float64MultiArray(data=array('d', [0.1] * 7))
        took = {}
        for steady in ([], [READER]):
            started = [subprocess.Popen([
                sys.executable, '-c', text, 'current_command', KINDS['current_command']],
                stderr=subprocess.DEVNULL) for text in (*steady, COMES_AND_GOES)]
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
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--beside', choices=['page', 'work', *KINDS], default='page')
    parser.add_argument('--pieces', type=int, default=5)
    parser.add_argument('--without-driver', action='store_true')
    parser.add_argument('--readers', action='store_true')
    arguments = parser.parse_args()
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    if arguments.readers:
        publishing()
        return
    from diagnostic_msgs.msg import DiagnosticArray
    from ros_system import MODELS, own_domain, probe_node, Process
    from sensor_msgs.msg import JointState

    costs, taken, shares = ([], []), ([], []), []
    with ExitStack() as stack:
        stack.enter_context(own_domain())
        room = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        probe = stack.enter_context(probe_node())
        compensator = stack.enter_context(Process(room, 'compensator', {
            'joints': JOINTS, 'model_files': [MODELS[0]] * 7, 'joint_state_timeout': 1.0}))
        if not arguments.without_driver:
            driver, = beside('current_command', patience=0.0)
            stack.callback(driver.wait)
            stack.callback(driver.terminate)
            probe.until(lambda: probe.count_subscribers('current_command'), 'a driver')
        publisher = probe.talk(JointState, 'joint_states')
        probe.matched(publisher)
        probe.listen(DiagnosticArray, '/diagnostics')
        drive(probe, publisher, 2.0)
        for piece in range(2 * arguments.pieces):
            company = beside(arguments.beside) if piece % 2 else []
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
          f'{np.median(watched):.0f} us beside {arguments.beside}: ratio '
          f'{np.median(watched) / np.median(plain):.3f} '
          f'(pieces without {plain.min():.0f} to {plain.max():.0f}, with {watched.min():.0f} to '
          f'{watched.max():.0f}); {np.median(taken[0]):.0f} and {np.median(taken[1]):.0f} states a '
          f'second were taken; its company took '
          f'{100 * sum(shares) / arguments.pieces:.0f} % of a processor')


if __name__ == '__main__':
    main()
