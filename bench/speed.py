# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How fast the package is, as ratios of two ways that run side by side.

    python3 bench/speed.py [--pairs N] [--refine-pairs N]

Times depend on the machine and on what else it does, ratios hardly: the two ways of each line
take turns, whichever was second before comes first, and every pair gives one ratio. The table
shows the median of the ratios with their quartiles, and the median times.

law step     one sample of the continuous law on a moving joint: plain Python over compiled
plant step   one sample of the simulated joint with its person: plain Python over compiled
closed loop  a movement under the law, per sample: loop in Python, joint and law compiled each,
             over many joints at once in one compiled loop, per joint and sample
refine       80 000 samples over every fourth of them, 20 000; 4 is proportional
"""

from concurrent.futures import ProcessPoolExecutor
from functools import partial
import math
import multiprocessing
import os
import time

from bench_tools import ROOT, table_parser

CONFIG = ROOT / 'config' / 'armin_configuration_2.yaml'


class Steps:
    """The step functions, compiled or plain, as this process was started."""

    def __init__(self):
        import numpy as np

        from friction_comp.compensation import law_kernel
        from friction_comp.compensation.law import law_parameters
        from friction_comp.compensation.law_fields import STATE
        from friction_comp.model.friction_model import FrictionModel
        from friction_comp.simulation import joint as kernel
        from friction_comp.simulation.joint_parameters import (
            joint_parameters,
            JOINT_STATE,
            MEASURED,
        )
        from friction_comp.simulation.random_sequence import random_states
        from friction_comp.simulation.undeclared import COLUMNS

        # The plain random numbers wrap around as meant, with a warning each.
        np.seterr(over='ignore')
        model = FrictionModel.load(CONFIG)
        self._law, self._kernel = law_kernel, kernel
        # As records that plain Python reads by name too.
        self._law_parameters = law_parameters(model).view(np.recarray)[0]
        self._law_state = np.zeros(1, STATE).view(np.recarray)[0]
        self._joint_parameters = np.array([joint_parameters(model)]).view(np.recarray)[0]
        self._joint_state = np.zeros(1, JOINT_STATE).view(np.recarray)[0]
        self._random = random_states(1, 1)[0]
        self._out = np.zeros(1, MEASURED).view(np.recarray)[0]
        self._table = np.zeros((0, COLUMNS))
        self._memory = np.zeros(1)
        kernel.start_joint(self._joint_parameters, self._joint_state, self._random)

    def law(self, count):
        """Return s a sample."""
        parameters, state = self._law_parameters, self._law_state
        begin = time.perf_counter()
        for k in range(count):
            self._law.observe(parameters, state, 1e-3 * k, 3e-4 * k, 0.3, True)
            self._law.decide(parameters, state, 1.0, math.nan, False, 0.0, 0.0, 0.0)
        return (time.perf_counter() - begin) / count

    def plant(self, count):
        """Return s a sample."""
        step = self._kernel.joint_sample
        begin = time.perf_counter()
        for k in range(count):
            step(self._joint_parameters, self._joint_state, self._random, self._table,
                 self._memory, 1e-3, 0.1, 3e-4 * k, 0.3, True, self._out)
        return (time.perf_counter() - begin) / count


steps = None


def begin(compiled):
    """Prepare a process whose steps are compiled or plain Python."""
    global steps
    os.environ['NUMBA_DISABLE_JIT'] = '0' if compiled else '1'
    steps = Steps()


def step_time(what, count):
    """Return s a sample in a process that `begin` has prepared."""
    return getattr(steps, what)(count)


def loops(joints=40):
    """Return two functions: s a sample of the loop in Python, and of the compiled one."""
    import numpy as np

    from friction_comp.compensation.law import CompensationLaw, law_parameters
    from friction_comp.exercise.reference_movement import ReferenceMovement
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.simulation.batch import closed_loops
    from friction_comp.simulation.joint import Plant
    from friction_comp.simulation.joint_parameters import joint_parameters
    from friction_comp.simulation.random_sequence import random_states
    from simulated_recordings.closed_loop import closed_loop

    model = FrictionModel.load(CONFIG)
    movement = ReferenceMovement(repetitions=1, standstill=0.5, announcement=0.5, amplitude=0.2)
    count = round(movement.duration * 1000)
    reference = movement.at(np.arange(count) * 1e-3)
    parameters = np.tile(joint_parameters(model), joints)
    law = np.tile(law_parameters(model), joints)

    def python():
        plant, own = Plant([model], seed=1), CompensationLaw([model])
        begin = time.perf_counter()
        closed_loop(plant, own, movement, movement.duration)
        return (time.perf_counter() - begin) / count

    def compiled():
        begin = time.perf_counter()
        closed_loops(parameters, random_states(1, joints), law, reference)
        return (time.perf_counter() - begin) / (count * joints)
    return python, compiled


def refinements():
    """Return two functions: s to refine 80 000 samples, and to refine every fourth of them."""
    from friction_comp.refinement import refine
    from friction_comp.samples import Samples
    from simulated_recordings.drives import excitation_for, random_drive, record

    cases = ('friction_ripple',)
    drive = random_drive(7, cases)
    samples = record(drive, 1, excitation_for(cases, duration=160.0, rate=500.0))[0].samples
    fourth = Samples(time=samples.time[::4], position=samples.position[::4],
                     current=samples.current[::4], joint=samples.joint)
    samples = Samples(time=samples.time, position=samples.position, current=samples.current,
                      joint=samples.joint)

    def timed(part):
        begin = time.perf_counter()
        refine([part], model=drive.model)
        return time.perf_counter() - begin
    return lambda: timed(samples), lambda: timed(fourth)


def side_by_side(slow, fast, pairs):
    """Return times and ratios of functions that take turns, after one turn for warming up."""
    import numpy as np

    slow(), fast()
    times = np.empty((pairs, 2))
    for k in range(pairs):
        for side in ((0, 1), (1, 0))[k % 2]:
            times[k, side] = (slow, fast)[side]()
    low, median, high = np.percentile(times[:, 0] / times[:, 1], [25, 50, 75])
    return {'ratio': float(median), 'quartiles': [float(low), float(high)], 'pairs': pairs,
            'slow': float(np.median(times[:, 0])), 'fast': float(np.median(times[:, 1]))}


def show(name, result):
    low, high = result['quartiles']
    times = ' / '.join(f'{t:9.3g} s' if t > 0.01 else f'{1e6 * t:9.3g} µs'
                       for t in (result['slow'], result['fast']))
    print(f'{name:12s} {result["ratio"]:8.1f}   {low:7.1f} to {high:<7.1f} {times}   '
          f'{result["pairs"]:3d} pairs', flush=True)


def main():
    parser = table_parser(__doc__, pairs=15, refine_pairs=3)
    arguments = parser.parse_args()
    print('                ratio   quartiles                slow /      fast')
    fresh = partial(ProcessPoolExecutor, 1, multiprocessing.get_context('spawn'), begin)
    with fresh((True,)) as compiled, fresh((False,)) as plain:
        for name, what, counts in (
                ('law step', 'law', (2000, 20000)), ('plant step', 'plant', (300, 20000))):
            show(name, side_by_side(
                lambda what=what, counts=counts: plain.submit(step_time, what, counts[0]).result(),
                lambda what=what, counts=counts: compiled.submit(
                    step_time, what, counts[1]).result(), arguments.pairs))
    for name, make, pairs in (('closed loop', loops, arguments.pairs),
                              ('refine', refinements, arguments.refine_pairs)):
        if pairs > 0:
            show(name, side_by_side(*make(), pairs))


if __name__ == '__main__':
    main()
