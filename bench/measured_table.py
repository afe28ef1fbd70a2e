# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What `refine` makes of measured recordings, set by set, beside the floors that are wanted.

Refines on each set's `fit`, predicts its `score` through the command line, as a user would, and
takes the error as the sets' README says. Sets that are not there are skipped with a line.

    python bench/measured_table.py [--data ../shared/data] [--sets emps ...] [--output DIR]
"""

from __future__ import annotations

import argparse
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
import json
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time

import numpy as np
from scipy.signal import butter, filtfilt

ROOT = Path(__file__).resolve().parents[1]
# The package beside this file, and not one that happens to be installed.
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]
UR10E = ('shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint', 'wrist_1_joint',
         'wrist_2_joint', 'wrist_3_joint')


@dataclass(frozen=True)
class Row:
    """One line of the table: a set, perhaps one joint of it, and what is asked of it."""

    data: str
    floor: str
    unit: str = 'A'
    joint: str | None = None
    error: str = 'all'
    urdf: str | None = None

    @property
    def name(self):
        return self.data + (f':{self.joint}' if self.joint else '')


ROWS = (
    Row('ur10e_joint1', '0.168'),
    Row('emps', '1.98', 'N', error='low pass'),
    Row('kinova_gen3_joint7', '0.0036 by hand', error='medians'),
    Row('kuka_kr300_axis1', '0.81', 'N.m'),
    Row('ur10e_joint2', '0.175, load friction, no bump'),
    Row('bam_xl330', '1.12, gravity-like and inertia first', 'V'),
    Row('ak80_load', '0.417'),
    Row('ak80_no_load', "the start's, load as what is missing"),
    Row('bldc_under_speed_control', 'warned as controller'),
    *(Row('ur10e_all_joints', floor, joint=joint, urdf='ur10e.urdf')
      for joint, floor in zip(UR10E, ('0.29', '0.80', '0.22', '0.056', '0.094', '0.066'))),
)


def low_passed(error, rate, cutoff=40.0):
    """Return the error after a zero-phase second-order low pass, as the EMPS figures are taken."""
    return filtfilt(*butter(2, cutoff / (rate / 2)), error)


def stretches(time_, largest=20.0):
    """Return slices between gaps longer than `largest` median steps."""
    step = np.diff(time_)
    edges = [0, *(np.nonzero(step > largest * np.median(step))[0] + 1), len(time_)]
    return [slice(a, b) for a, b in zip(edges[:-1], edges[1:])]


def score_error(how, table):
    """Return the error on score, shape (), of a CSV table time, measured, predicted."""
    time_, measured, predicted = table.T
    error = measured - predicted
    if how == 'low pass':
        error = np.concatenate([low_passed(error[s], 1 / np.median(np.diff(time_[s])))
                                for s in stretches(time_) if s.stop - s.start > 100])
    elif how == 'medians':
        # Each run holds one speed; its first half second is the start of motion.
        error = np.array([np.median(measured[s][settled]) - np.median(predicted[s][settled])
                          for s in stretches(time_)
                          for settled in [time_[s] > time_[s][0] + 0.5]])
    return float(np.sqrt(np.mean(error ** 2)))


def run(arguments):
    """Run a tool of the package; return its standard error and CPU seconds."""
    with tempfile.TemporaryFile() as heard:
        child = subprocess.Popen([sys.executable, '-m', 'friction_comp', *map(str, arguments)],
                                 cwd=ROOT, stdout=subprocess.DEVNULL, stderr=heard)
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        heard.seek(0)
        message = heard.read().decode(errors='replace').strip()
    return child.returncode, message, usage.ru_utime + usage.ru_stime


def takes_urdf():
    """Tell whether this version of `refine` can be given a robot description."""
    helped = subprocess.run([sys.executable, '-m', 'friction_comp', 'refine', '--help'],
                            cwd=ROOT, capture_output=True, text=True, check=False).stdout
    return '--urdf' in helped


def plain_error(row, folder):
    """Return the error on score of Coulomb + viscous + offset, fitted by plain least squares.

    It says what a result must not be worse than; None where the recording cannot be read.
    """
    from second_world.package import read_recording

    def columns(part):
        samples = read_recording([folder / part], joint=row.joint)[0]
        speed = np.concatenate([np.gradient(samples.position[s], samples.time[s])
                                if s.stop - s.start > 2 else np.zeros(s.stop - s.start)
                                for s in samples.segments()])
        if samples.velocity is not None:
            speed = samples.velocity
        scale = 0.02 * np.quantile(abs(speed), 0.95)
        return np.column_stack([np.tanh(speed / scale), speed, np.ones_like(speed)]), samples

    known, fit = columns('fit')
    constants = np.linalg.lstsq(known, fit.current, rcond=None)[0]
    known, score = columns('score')
    return score_error(row.error,
                       np.column_stack([score.time, score.current, known @ constants]))


def measure(row, data, output, with_urdf):
    """Refine and predict one row; return a dict for the table."""
    folder = data / row.data
    if not (folder / 'fit').exists():
        return {'set': row.name, 'skipped': f'{folder} is not there'}
    where = output / row.name.replace(':', '_')
    joint = ['--joint', row.joint] if row.joint else []
    urdf = ['--urdf', folder / row.urdf] if row.urdf and with_urdf else []
    began = time.monotonic()
    code, message, cpu = run(['refine', folder / 'fit', '--output', where, *joint, *urdf])
    wall = time.monotonic() - began
    if code:
        return {'set': row.name, 'skipped': f'refine ended with {code}: {message[-300:]}'}
    code, message, _ = run(['predict', folder / 'score', '--model', where / 'model.yaml',
                            '--output', where / 'score.csv', *joint])
    if code:
        return {'set': row.name, 'skipped': f'predict ended with {code}: {message[-300:]}'}
    report = json.loads((where / 'report.json').read_text(encoding='utf-8'))
    table = np.loadtxt(where / 'score.csv', delimiter=',', skiprows=1)
    return {
        'set': row.name, 'unit': row.unit, 'error': score_error(row.error, table),
        'plain': plain_error(row, folder), 'floor': row.floor, 'urdf': bool(urdf),
        'effects': [f"{e['name']} ({e['variable']})" for e in report['effects']],
        'in_words': [e.get('in_words', '') for e in report['effects']],
        'before': report['before']['held_out_rmse'], 'after': report['after']['held_out_rmse'],
        'verdict': report.get('verdict'), 'warnings': report.get('warnings', []),
        'unexplained': [u['variable'] for u in report['unexplained']],
        'samples': report['samples'], 'cpu': cpu, 'wall': wall}


def show(result):
    """Print one result as a few lines."""
    if 'skipped' in result:
        print(f"{result['set']}: skipped, {result['skipped']}", flush=True)
        return
    print(f"{result['set']}: {result['error']:.4g} {result['unit']} on score "
          f"(C + V {result['plain']:.4g}, wanted {result['floor']}); held out "
          f"{result['before']:.4g} -> {result['after']:.4g}; {result['samples']} samples, "
          f"CPU {result['cpu']:.0f} s{', URDF' if result['urdf'] else ''}")
    for text in result['in_words']:
        print(f'    + {text}')
    print(f"    unexplained: {', '.join(result['unexplained']) or 'nothing'}; "
          f"verdict: {result['verdict']}")
    for text in result['warnings']:
        print(f'    ! {text}')
    sys.stdout.flush()


def main():
    """Print the table and write it as JSON where asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--data', type=Path, default=ROOT.parent / 'shared' / 'data')
    parser.add_argument('--sets', nargs='*', help='names of sets; all by default')
    parser.add_argument('--output', type=Path, help='folder for reports and measured_table.json')
    parser.add_argument('--jobs', type=int, default=1)
    arguments = parser.parse_args()
    rows = [r for r in ROWS if not arguments.sets or r.data in arguments.sets]
    with_urdf = takes_urdf()
    if not with_urdf:
        print('this version takes no --urdf: joints of ur10e_all_joints one by one')
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(arguments.jobs) as pool:
        output = (arguments.output or Path(scratch)).resolve()
        output.mkdir(parents=True, exist_ok=True)
        results = []
        for result in pool.map(
                lambda row: measure(row, arguments.data.resolve(), output, with_urdf), rows):
            show(result)
            results.append(result)
        if arguments.output:
            (output / 'measured_table.json').write_text(json.dumps(results, indent=1))
    print('\n| set | error on score | C + V | wanted | effects in order | CPU s |\n'
          '|---|---|---|---|---|---|')
    for r in results:
        if 'skipped' not in r:
            print(f"| {r['set']} | {r['error']:.4g} {r['unit']} | {r['plain']:.4g} | {r['floor']} "
                  f"| {', '.join(r['effects']) or 'none'} | {r['cpu']:.0f} |")


if __name__ == '__main__':
    main()
