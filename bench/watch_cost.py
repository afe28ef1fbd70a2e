# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What `watch` costs the compensator: its processor time for each joint state, without and with.

Seven joints at 1 kHz, five pieces without the page in turn with five with it; a client opens the
page. Processor time, not wall-clock time: other processes on the machine matter little.
"""

from contextlib import ExitStack
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]
JOINTS = [f'joint_{k}' for k in range(1, 8)]
PIECES, SECONDS, RATE = 5, 4.0, 1000.0


def processor_time(pid):
    """Return the processor time of a process in s."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def drive(probe, publisher, seconds):
    """Publish joint states for a time and return how many there were."""
    from ros_system import joint_state

    begin, count = time.monotonic(), 0
    while (passed := time.monotonic() - begin) < seconds:
        if count < passed * RATE:
            x = 0.3 * np.sin(passed + np.arange(7))
            publisher.publish(joint_state(time.time_ns(), JOINTS, x, 0.3 * np.cos(passed + x)))
            count += 1
        else:
            time.sleep(2e-4)
    return count


def open_page():
    """Start the page and a client of it; return what ends them."""
    server = subprocess.Popen(
        [sys.executable, '-m', 'friction_comp', 'watch', '--port', '0', '--joint', *JOINTS],
        cwd=ROOT, stdout=subprocess.PIPE, text=True)
    address = server.stdout.readline().split()[0]
    client = subprocess.Popen([sys.executable, '-c', (
        'import time\nfrom bokeh.client import pull_session\n'
        f's = pull_session(url={address!r})\nwhile True:\n    s.force_roundtrip()\n'
        '    time.sleep(0.2)')])
    time.sleep(4.0)

    def close():
        for process in (client, server):
            process.terminate()
            process.wait()
    return close


def main():
    """Measure and print."""
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    from ros_system import MODELS, own_domain, probe_node, Process
    from sensor_msgs.msg import JointState

    costs = {False: [], True: []}
    with ExitStack() as stack:
        stack.enter_context(own_domain())
        room = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        probe = stack.enter_context(probe_node())
        compensator = stack.enter_context(Process(room, 'compensator', {
            'joints': JOINTS, 'model_files': [MODELS[0]] * 7, 'joint_state_timeout': 1.0}))
        publisher = probe.talk(JointState, 'joint_states')
        probe.matched(publisher)
        drive(probe, publisher, 2.0)
        for piece in range(2 * PIECES):
            watched = bool(piece % 2)
            close = open_page() if watched else None
            before = processor_time(compensator._process.pid)
            count = drive(probe, publisher, SECONDS)
            costs[watched].append(1e6 * (processor_time(compensator._process.pid) - before) / count)
            if close:
                close()
    plain, watched = (np.array(costs[key]) for key in (False, True))
    print(f'compensator, 7 joints: {np.median(plain):.0f} us of processor time a joint state, '
          f'{np.median(watched):.0f} us while watched: ratio '
          f'{np.median(watched) / np.median(plain):.3f} '
          f'(pieces without {plain.min():.0f} to {plain.max():.0f}, with {watched.min():.0f} to '
          f'{watched.max():.0f})')


if __name__ == '__main__':
    main()
