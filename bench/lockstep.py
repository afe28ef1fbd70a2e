# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How fast the simulated loop runs over ROS 2: plant in lockstep, compensator, recorder, exercise.

    python3 bench/lockstep.py [--seconds S] [--joints N]

A movement to and fro is repeated for S seconds of the joint's time at 1 kHz. Printed are the
joint's time over real time, from the first diagnostics of the movement to the last, and what each
process takes of the processor for one sample, in µs.
"""

from pathlib import Path
import tempfile
import time

from bench_tools import processor_time, table_parser
from ros_system import MODELS, own_domain, probe_node, Process, value_of

MOVEMENT = {'amplitude': 0.7, 'speed': 0.5, 'acceleration_time': 0.5, 'standstill': 1.0,
            'announcement': 0.7, 'repetitions': 1000}
RATE = 1000.0


def measure(seconds, count, folder):
    """Return the joint's s over real s, and µs of processor time a sample by process."""
    joints = [f'joint_{k}' for k in range(count)]
    models = {'joints': joints, 'model_files': [MODELS[k % 3] for k in range(count)]}
    follower = {'use_sim_time': True, 'input_reliability': 'reliable'}
    with own_domain(), probe_node() as probe, \
            Process(folder, 'plant', {
                **models, 'clock': 'lockstep', 'wait_for_reference': True, 'wrench_period': 0.004,
                'wait_for_listeners': 3}) as plant, \
            Process(folder, 'compensator', {
                **models, **follower, 'joint_state_timeout': 10.0}) as compensator, \
            Process(folder, 'exercise', {
                'joints': joints, **follower, **MOVEMENT, 'clock': 'ticks',
                'wait_for_listeners': 2}) as exercise, \
            Process(folder, 'recorder', {
                **follower, 'output': str(folder / 'recording')}) as recorder:
        nodes = {'plant': plant, 'compensator': compensator, 'exercise': exercise,
                 'recorder': recorder}
        marks = []
        while not marks or marks[-1][0] - marks[0][0] < seconds:
            status = probe.status_of(
                'exercise', lambda one: float(value_of(one, 'time [s]') or 0.0) > 1.0)
            # The first second has what happens once.
            marks.append((float(value_of(status, 'time [s]')), time.perf_counter(),
                          {name: processor_time(node._process.pid)
                           for name, node in nodes.items()}))
    first, last = marks[0], marks[-1]
    simulated = last[0] - first[0]
    cost = {name: 1e6 * (last[2][name] - first[2][name]) / (RATE * simulated) for name in nodes}
    return simulated / (last[1] - first[1]), cost


def main():
    parser = table_parser(__doc__, seconds=20.0, joints=1)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        speed, cost = measure(arguments.seconds, arguments.joints, Path(folder))
    print(f"the joint's time over real time: {speed:.2f}")
    print('processor, µs a sample: ' + ', '.join(
        f'{name} {value:.0f}' for name, value in cost.items())
        + f'; together {sum(cost.values()):.0f}')


if __name__ == '__main__':
    main()
