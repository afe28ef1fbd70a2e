# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Many recordings on one process and on several: time, processor time and peak memory.

`refine --each` and `evaluate` over short recordings of simulated drives, the tools as a user
starts them. Memory is the largest sum of what all processes of a tool have to themselves (PSS).
`--beside` measures another checkout's `refine --each` on the same recordings too, first, so that
files and compiled code are read from the cache by both. `--hour` evaluates one hour (or --length s)
of seven joints at 1 kHz instead, in a stream, and prints its peak.

    python3 bench/many_recordings.py --recordings 200
    git worktree add ../other 8b6a994
    python3 bench/many_recordings.py --recordings 80 --jobs 1 2 4 --beside ../other
    python3 bench/many_recordings.py --hour
"""

from contextlib import suppress
import json
import os
from pathlib import Path
import resource
import subprocess
import sys
import tempfile
import time

from bench_tools import ROOT, table_parser
import numpy as np

from friction_comp.recordings import RecordingWriter, write_samples
from simulated_recordings.drives import excitation_for, random_drive, record

KINDS = ('gravity', 'friction_ripple', 'stribeck', 'inertia')
JOINTS = 7


def write_recordings(folder, count, seconds, rate):
    """Write recordings of four drives, each of which hides one effect."""
    for k in range(count):
        kind = KINDS[k % len(KINDS)]
        samples = record(random_drive(900 + k % len(KINDS), [kind]), 5000 + k, excitation_for(
            [kind], duration=seconds, rate=rate))[0].samples
        write_samples(folder / f'r{k:03d}', samples.with_(joint=f'{kind}_drive'))


def write_hour(path, seconds, rate=1000.0):
    """Write joints that move to and fro, minute by minute; all with an announced direction."""
    from rosbags.typesys import get_typestore, Stores

    store = get_typestore(Stores.ROS2_JAZZY)
    kinds = {'joint_states': 'sensor_msgs/msg/JointState',
             'direction': 'std_msgs/msg/Int8MultiArray'}
    names = [f'joint_{k + 1}' for k in range(JOINTS)]
    types = store.types
    with RecordingWriter(path) as recording:
        for k in range(round(seconds * rate)):
            t = k / rate
            phase = (t + 0.3 * np.arange(JOINTS)) % 8.0
            # 2 s of rest, 2 s there, 2 s of rest, 2 s back.
            s = np.clip(np.where(phase < 6.0, phase - 2.0, 0.0) / 2.0, 0.0, 1.0)
            back = np.clip((phase - 6.0) / 2.0, 0.0, 1.0)
            x = 0.5 * (np.sin(0.5 * np.pi * s) ** 2 - np.where(
                phase >= 6.0, np.sin(0.5 * np.pi * back) ** 2 - 1.0, 0.0))
            v = np.where((phase > 2) & (phase < 4), 1.0, np.where(phase > 6, -1.0, 0.0))
            when = round((t + 1.7e9) * 1e9)
            stamp = types['builtin_interfaces/msg/Time'](when // 10 ** 9, when % 10 ** 9)
            state = types[kinds['joint_states']](
                types['std_msgs/msg/Header'](stamp, ''), names, x, np.array([]), 0.2 * v)
            recording.write('/joint_states', kinds['joint_states'], when, bytes(
                store.serialize_cdr(state, kinds['joint_states'])))
            if k % 100 == 0:
                layout = types['std_msgs/msg/MultiArrayLayout']([], 0)
                message = types[kinds['direction']](layout, v.astype(np.int8))
                recording.write('/direction', kinds['direction'], when, bytes(
                    store.serialize_cdr(message, kinds['direction'])))


def tree(pid):
    """Return a process and all below it."""
    found = [pid]
    for task in Path(f'/proc/{pid}/task').glob('*/children'):
        for child in task.read_text().split():
            found.extend(tree(int(child)))
    return found


def memory(pid):
    """Return the memory in MB that a process and those below it have for themselves."""
    total = 0
    for one in tree(pid):
        try:
            text = Path(f'/proc/{one}/smaps_rollup').read_text()
        except OSError:
            continue
        total += int(next(line.split()[1] for line in text.splitlines()
                          if line.startswith('Pss:')))
    return total / 1024


def timed(arguments, root=ROOT):
    """Run a tool of a checkout; return its time, processor time in s and peak memory in MB."""
    environment = dict(os.environ, PYTHONPATH=str(root), OMP_NUM_THREADS='1',
                       OPENBLAS_NUM_THREADS='1')
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begin, peak = time.monotonic(), 0.0
    process = subprocess.Popen([sys.executable, '-m', 'friction_comp', *map(str, arguments)],
                               env=environment, cwd=root, stdout=subprocess.DEVNULL)
    while process.poll() is None:
        with suppress(OSError):
            peak = max(peak, memory(process.pid))
        time.sleep(0.5)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if process.returncode:
        raise SystemExit(f'{arguments[0]} ended with {process.returncode}')
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.monotonic() - begin, cpu, peak


def main():
    """Measure and print."""
    parser = table_parser(__doc__, recordings=20, seconds=20.0, rate=125.0, length=3600.0)
    parser.add_argument('--jobs', type=int, nargs='+', default=[1, 2])
    parser.add_argument('--beside', type=Path, help='another checkout to measure, too')
    parser.add_argument('--hour', action='store_true')
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        room = Path(name)
        if arguments.hour:
            evaluate_hour(room, arguments.length)
            return
        write_recordings(room / 'all', arguments.recordings, arguments.seconds, arguments.rate)
        if arguments.beside:
            measure(room, ['refine', '--each'], arguments, arguments.beside.resolve())
        for tool in (['refine', '--each'], ['evaluate']):
            measure(room, tool, arguments, ROOT)


def measure(room, tool, arguments, root):
    """Run a tool of a checkout with each number of processes, and print its time and memory."""
    what = f'{root.name}: {" ".join(tool)}'
    found, times = [], []
    for jobs in arguments.jobs:
        output = room / f'{root.name}_{tool[0]}_{jobs}'
        spent, cpu, peak = timed([*tool, room / 'all', '--output', output, '--jobs', jobs], root)
        report = json.loads((output / 'report.json').read_text())
        found.append([row['effects'] for row in report['recordings']]
                     if tool[0] == 'refine' else report['conditions'])
        times.append(spent)
        print(f'{what}, {arguments.recordings} recordings, {jobs} process{"es" * (jobs > 1)}: '
              f'{spent:.0f} s, {cpu:.0f} s of processor time, peak memory {peak:.0f} MB',
              flush=True)
    faster = ', '.join(f'{times[0] / spent:.2f} with {jobs}'
                       for jobs, spent in zip(arguments.jobs[1:], times[1:]))
    same = 'the same' if all(one == found[0] for one in found) else 'NOT the same'
    print(f'{what}: times as fast: {faster}; results {same}', flush=True)


def evaluate_hour(room, length):
    """Print what the evaluation of one long recording needs."""
    write_hour(room / 'hour', length)
    size = sum(p.stat().st_size for p in (room / 'hour').iterdir()) / 1e6
    spent, cpu, peak = timed(['evaluate', room / 'hour', '--output', room / 'out', '--jobs', 1])
    count = sum(1 for _ in (room / 'out' / 'repetitions.csv').open()) - 1
    print(f'{length:.0f} s of {JOINTS} joints at 1 kHz ({size:.0f} MB): {count} movements '
          f'evaluated in {spent:.0f} s ({cpu:.0f} s of processor time), peak memory {peak:.0f} MB')


if __name__ == '__main__':
    main()
