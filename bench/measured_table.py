# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What `refine` makes of measured recordings, set by set.

Refines on each set's `fit`, predicts its `score` through the command line, as a user would, and
takes the error as the sets' README says. Beside it stands Coulomb and viscous friction, and what an
expert who knows the drive fits by least squares to the same motion. Sets that are not there are
skipped with a line.

    python3 bench/measured_table.py [--data ../shared/data] [--sets emps ...] [--output DIR]
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
import json
import os
from pathlib import Path
import subprocess
import sys
import tempfile

from bench_tools import ROOT, table_parser
import numpy as np
from scipy.signal import butter, filtfilt

from friction_comp import FrictionModel, read_recording

# What docs/generate.py stores of each row.
KEPT = ('set', 'unit', 'error', 'plain', 'terms', 'said', 'true', 'verdict')
FRICTION = ('coulomb', 'viscous', 'offset')
BANDWIDTHS = (5.0, 10.0, 20.0, 40.0, np.inf)  # Hz, of the expert's motion
UR10E = ('shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint', 'wrist_1_joint',
         'wrist_2_joint', 'wrist_3_joint')


@dataclass(frozen=True)
class Row:
    """One line of the table: a set, perhaps one joint of it, and how its error is taken."""

    data: str
    unit: str = 'A'
    joint: str | None = None
    error: str = 'all'
    urdf: str | None = None
    by_hand: tuple[str, ...] = ()  # terms of the expert's model, see `by_hand_columns`
    ripple: float = 0.0  # its periods per turn

    @property
    def name(self):
        return self.data + (f':{self.joint}' if self.joint else '')


ROWS = (
    Row('ur10e_joint1', by_hand=(*FRICTION, 'sublinear', 'inertia', 'ripple'), ripple=202.0),
    Row('emps', 'N', error='low pass', by_hand=(*FRICTION, 'asymmetry', 'inertia')),
    Row('kinova_gen3_joint7', error='medians', by_hand=(*FRICTION, 'stribeck')),
    Row('kuka_kr300_axis1', 'N.m', by_hand=(*FRICTION, 'inertia')),
    Row('ur10e_joint2', by_hand=(*FRICTION, 'inertia', 'gravity', 'carried')),
    Row('bam_xl330', 'V', by_hand=(*FRICTION, 'inertia', 'gravity', 'carried')),
    Row('ak80_load', by_hand=(*FRICTION, 'inertia', 'load')),
    Row('ak80_no_load', by_hand=(*FRICTION, 'inertia')),
    Row('bldc_under_speed_control', by_hand=(*FRICTION, 'inertia')),
    *(Row('ur10e_all_joints', joint=joint, urdf='ur10e.urdf') for joint in UR10E),
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


def moving_error(model, parts, how='all'):
    """Return the RMS error of a model in motion of recordings; `how` as for `score_error`."""
    errors = []
    for part in parts:
        speed = np.abs(model.differentiated(part).velocity)
        error = part.current - model.predict(part)
        if how == 'low pass':
            # What pushes at a higher frequency, as in EMPS's other recording, was not recorded.
            error = low_passed(error, 1.0 / part.sample_time)
        errors.append(error[speed > 0.02 * np.quantile(speed, 0.95)])
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def run(arguments):
    """Run a tool of the package; return its exit code, standard error and CPU seconds."""
    with tempfile.TemporaryFile() as heard:
        child = subprocess.Popen([sys.executable, '-m', 'friction_comp', *map(str, arguments)],
                                 cwd=ROOT, stdout=subprocess.DEVNULL, stderr=heard)
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        heard.seek(0)
        message = heard.read().decode(errors='replace').strip()
    return child.returncode, message, usage.ru_utime + usage.ru_stime


def smooth(signal, rate, bandwidth):
    """Return a signal, low-passed if it is long enough and the bandwidth in Hz below its rate."""
    if len(signal) <= 20 or 2.0 * bandwidth >= rate:
        return signal
    return filtfilt(*butter(2, bandwidth / (rate / 2)), signal)


def motion_of(samples, bandwidth):
    """Return position, velocity, acceleration, each (N,); low-passed below `bandwidth` Hz.

    Velocity is the recorded one where there is one.
    """
    parts = []
    for part in samples.segments():
        time_, q = samples.time[part], samples.position[part]
        if len(q) < 3:
            parts.append((q, np.zeros_like(q), np.zeros_like(q)))
            continue
        rate = 1.0 / np.median(np.diff(time_))
        q = smooth(q, rate, bandwidth)
        v = (np.gradient(q, time_) if samples.velocity is None
             else smooth(samples.velocity[part], rate, bandwidth))
        parts.append((q, v, np.gradient(v, time_)))
    return [np.concatenate(one) for one in zip(*parts)]


def by_hand_columns(samples, row, terms, bandwidth):
    """Return the columns of an expert's model for samples, (N, M)."""
    q, v, a = motion_of(samples, bandwidth)
    top = np.quantile(abs(v), 0.95)
    side = np.tanh(v / (0.02 * top))
    wave = np.array([np.cos(row.ripple * q), np.sin(row.ripple * q)])
    columns = {
        'coulomb': [side], 'viscous': [v], 'offset': [np.ones_like(v)], 'inertia': [a],
        'sublinear': [side * np.sqrt(abs(v))], 'asymmetry': [abs(v)],
        'stribeck': [side * np.exp(-abs(v) / (0.1 * top))], 'ripple': [*wave, *(v * wave)],
        'gravity': [np.sin(q), np.cos(q)],
        'load': [] if samples.load is None else [samples.load, abs(samples.load) * side]}
    return np.column_stack([column for term in terms for column in columns[term]])


def hand_error(row, folder, terms, bandwidths=BANDWIDTHS):
    """Return the error on score of an expert's model, fitted by plain least squares.

    Of the bandwidths it is that with the least error on `fit`.
    """
    def fitted(bandwidth):
        fit, score = (read_recording([folder / part], joint=row.joint)[0]
                      for part in ('fit', 'score'))
        plain = [term for term in terms if term != 'carried']
        known, new = (by_hand_columns(part, row, plain, bandwidth) for part in (fit, score))
        constants = np.linalg.lstsq(known, fit.current, rcond=1e-9)[0]
        if 'carried' in terms:
            # Friction in proportion to the gravity that the first fit finds.
            first = plain.index('gravity')
            carried = [abs(each[:, first:first + 2] @ constants[first:first + 2]) * each[:, 0]
                       for each in (known, new)]
            known, new = (np.column_stack(pair) for pair in zip((known, new), carried))
            constants = np.linalg.lstsq(known, fit.current, rcond=1e-9)[0]
        return (float(np.mean((fit.current - known @ constants)**2)),
                np.column_stack([score.time, score.current, new @ constants]))
    return score_error(row.error, min(map(fitted, bandwidths), key=lambda pair: pair[0])[1])


def measure(row, data, output):
    """Refine and predict one row; return a dict for the table."""
    folder = data / row.data
    if not (folder / 'fit').exists():
        return {'set': row.name, 'skipped': f'{folder} is not there'}
    where = output / row.name.replace(':', '_')
    joint = ['--joint', row.joint] if row.joint else []
    # Its effort holds current.
    urdf = ['--urdf', folder / row.urdf, '--unit', 'A'] if row.urdf else []
    code, message, cpu = run(['refine', folder / 'fit', '--output', where, *joint, *urdf])
    if code:
        return {'set': row.name, 'skipped': f'refine ended with {code}: {message[-300:]}'}
    code, message, _ = run(['predict', folder / 'score', '--model', where / 'model.yaml',
                            '--output', where / 'score.csv', *joint])
    if code:
        return {'set': row.name, 'skipped': f'predict ended with {code}: {message[-300:]}'}
    own = where / row.joint if row.urdf else where
    report = json.loads((own / 'report.json').read_text(encoding='utf-8'))
    table = np.loadtxt(where / 'score.csv', delimiter=',', skiprows=1)
    model = FrictionModel.load(where / 'model.yaml')
    return {
        'set': row.name, 'unit': row.unit, 'error': score_error(row.error, table),
        'said': report['after']['elsewhere_motion_rmse'], 'terms': len(report['effects']),
        'true': moving_error(
            model, read_recording(folder / 'score', joint=row.joint), row.error),
        'plain': hand_error(row, folder, FRICTION, (np.inf,)),
        'by_hand': hand_error(row, folder, row.by_hand) if row.by_hand else float('nan'),
        'effects': [f"{e['name']} ({e['variable']})" for e in report['effects']],
        'in_words': [e.get('in_words', '') for e in report['effects']],
        'before': report['before']['held_out_rmse'], 'after': report['after']['held_out_rmse'],
        'verdict': report.get('verdict'), 'warnings': report.get('warnings', []),
        'unexplained': [u['variable'] for u in report['unexplained']],
        'samples': report['samples'], 'cpu': cpu}


def show(result):
    """Print one result as a few lines."""
    if 'skipped' in result:
        print(f"{result['set']}: skipped, {result['skipped']}", flush=True)
        return
    print(f"{result['set']}: {result['error']:.4g} {result['unit']} on score "
          f"(C + V {result['plain']:.4g}, by hand {result['by_hand']:.4g}); held out "
          f"{result['before']:.4g} -> {result['after']:.4g}; {result['samples']} samples, "
          f"CPU {result['cpu']:.0f} s")
    for text in result['in_words']:
        print(f'    + {text}')
    print(f"    unexplained: {', '.join(result['unexplained']) or 'nothing'}; "
          f"verdict: {result['verdict']}")
    for text in result['warnings']:
        print(f'    ! {text}')
    sys.stdout.flush()


def main():
    """Print the table."""
    parser = table_parser(__doc__, jobs=1)
    parser.add_argument('--data', type=Path, default=ROOT.parent / 'shared' / 'data')
    parser.add_argument('--sets', nargs='*', help='names of sets; all by default')
    parser.add_argument('--output', type=Path, help='folder for the reports')
    arguments = parser.parse_args()
    rows = [r for r in ROWS if not arguments.sets or r.data in arguments.sets]
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(arguments.jobs) as pool:
        output = (arguments.output or Path(scratch)).resolve()
        output.mkdir(parents=True, exist_ok=True)
        results = []
        for result in pool.map(
                lambda row: measure(row, arguments.data.resolve(), output), rows):
            show(result)
            results.append(result)
        (output / 'said.json').write_text(json.dumps([{
            **{name: r[name] for name in KEPT},
            'by_hand': r['by_hand'] if r['by_hand'] == r['by_hand'] else None}
            for r in results if 'skipped' not in r], indent=1))
    print('\n| set | error on score | C + V | by hand | effects in order | CPU s |'
          '\n|---|---|---|---|---|---|')
    for r in results:
        if 'skipped' not in r:
            print(f"| {r['set']} | {r['error']:.4g} {r['unit']} | {r['plain']:.4g} "
                  f"| {r['by_hand']:.4g} | {', '.join(r['effects']) or 'none'} | {r['cpu']:.0f} |")


if __name__ == '__main__':
    main()
