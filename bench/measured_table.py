# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What `refine` makes of measured recordings, set by set.

Refines on each set's `fit`, predicts its `score` through the command line, as a user would, and
takes the error as the sets' README says. Beside it stand Coulomb and viscous friction, what an
expert who knows the drive fits by least squares to the same motion, a first try on block sums where
its file is given, and an earlier version, whose said.json this file writes from its checkout. In a
folder without the README's sets, each with a `fit` and a `score` of a joint `studied` is a row.

    python3 bench/measured_table.py [--data ../shared/data] [--sets emps ...] [--output DIR]
        [--sums ../shared/tools/block_sums.py] [--earlier said.json] [--picture said.svg]
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
import importlib
import json
import os
from pathlib import Path
import subprocess
import sys
import tempfile

from bench_tools import ROOT, table_parser
import numpy as np
from scipy.signal import butter, filtfilt

from friction_comp import FrictionModel, read_recording, Samples

# What docs/generate.py stores of each row.
KEPT = ('set', 'unit', 'error', 'plain', 'by_hand', 'sums', 'earlier', 'terms', 'said', 'true',
        'verdict')
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


def rows_of(folder):
    """Return the rows of a folder of sets."""
    known = [row for row in ROWS if (folder / row.data / 'fit').exists()]
    return known or [Row(one.name, '', 'studied', by_hand=(*FRICTION, 'inertia', 'gravity', 'load'))
                     for one in sorted(folder.iterdir()) if (one / 'fit').exists()]


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
        fit, score = (Samples.concatenate(read_recording(folder / part, joint=row.joint))
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


def sums_error(row, folder, file):
    """Return the error on score of block sums, a file with `refine` and `rebuild`."""
    if str(file.parent) not in sys.path:
        sys.path.append(str(file.parent))
    sums = importlib.import_module(file.stem)
    fit, score = (read_recording(folder / part, joint=row.joint) for part in ('fit', 'score'))
    model = sums.refine(fit)
    data, predicted = sums.rebuild(model, score, model['D'])
    return score_error(row.error, np.concatenate([np.column_stack([
        part.time, part.current, np.interp(part.time, data.t[own], predicted[own])])
        for number, part in enumerate(score) for own in [data.rec == number]]))


def measure(row, folder, output, options):
    """Refine and predict one row; return a dict for the table, or None."""
    where = output / row.name.replace(':', '_')
    joint = ['--joint', row.joint] if row.joint else []
    # Its effort holds current.
    urdf = ['--urdf', folder / row.urdf, '--unit', 'A'] if row.urdf else []
    for arguments in (['refine', folder / 'fit', '--output', where, *joint, *urdf],
                      ['predict', folder / 'score', '--model', where / 'model.yaml',
                       '--output', where / 'score.csv', *joint]):
        code, message, cpu = run(arguments)
        if code:
            print(f'{row.name}: {arguments[0]} ended with {code}: {message[-300:]}')
            return None
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
        'by_hand': hand_error(row, folder, row.by_hand) if row.by_hand else None,
        'sums': sums_error(row, folder, options.sums) if options.sums else None,
        'effects': [f"{e['name']} ({e['variable']})" for e in report['effects']],
        'verdict': report['verdict'], 'cpu': cpu}


def picture(path, rows):
    """Draw the true error over the one said, of all rows, each with a line from an earlier one."""
    from matplotlib.figure import Figure

    figure = Figure((6.0, 0.2 * len(rows) + 1.0), layout='constrained')
    axes = figure.subplots()
    for place, row in enumerate(rows):
        now = row['true'] / row['said']
        if row['earlier']:
            before = row['earlier']['true'] / row['earlier']['said']
            axes.plot([before, now], [place, place], color='0.7')
            axes.plot(before, place, 'o', color='0.7')
        axes.plot(now, place, 'o', color={'trust': 'C2', 'trust in part': 'C1'}.get(
            row['verdict'], 'C3'))
    axes.axvline(1.0, color='0.5', linewidth=0.5)
    axes.set(xscale='log', xlabel='true error over the one said, earlier (grey) and now',
             yticks=range(len(rows)), yticklabels=[row['set'] for row in rows])
    figure.savefig(path)


def main():
    """Print the table."""
    parser = table_parser(__doc__, jobs=1)
    parser.add_argument('--data', type=Path, default=ROOT.parent / 'shared' / 'data')
    parser.add_argument('--sets', nargs='*', help='names of sets; all by default')
    for name in ('output', 'sums', 'earlier', 'picture'):
        parser.add_argument(f'--{name}', type=Path)
    options = parser.parse_args()
    rows = [r for r in rows_of(options.data) if not options.sets or r.data in options.sets]
    earlier = {row['set']: row for row in json.loads(options.earlier.read_text())
               } if options.earlier else {}
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(options.jobs) as pool:
        output = (options.output or Path(scratch)).resolve()
        output.mkdir(parents=True, exist_ok=True)
        results = [{**one, 'earlier': earlier.get(one['set'])} for one in pool.map(
            lambda row: measure(row, (options.data / row.data).resolve(), output, options), rows)
            if one]
        (output / 'said.json').write_text(json.dumps(
            [{name: one[name] for name in KEPT} for one in results], indent=1))
    print('| set | error on score | C + V | by hand | sums | earlier | said | true | verdict '
          '| effects in order | CPU s |\n' + '|---' * 11 + '|')
    for r in results:
        print(f"| {r['set']} | {r['error']:.4g} {r['unit']} | " + ' | '.join(
            '' if value is None else f'{value:.4g}' for value in (
                r['plain'], r['by_hand'], r['sums'], r['earlier'] and r['earlier']['error'],
                r['said'], r['true'])) + f" | {r['verdict']} "
              f"| {', '.join(r['effects']) or 'none'} | {r['cpu']:.0f} |")
    if options.picture:
        picture(options.picture, results)


if __name__ == '__main__':
    main()
