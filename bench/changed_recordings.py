# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Whether verdicts and stated errors hold where a recording was changed as loggers do.

Refines changed recordings of measured drives, and predicts others: as recorded, and changed alike.
The ratio is the true error over the one that the report expects (`elsewhere_rmse`). It counts

wrong      `trust` with a ratio above 1.5, `trust in part` with one above 2
unequal    verdict, effects or ratio of errors differ though only a sign, unit or origin changed

    python3 bench/changed_recordings.py [--data ../shared/data] [--more DIR] [--half tuning|kept]
                                        [--drives emps ...] [--changes 'third of the rate' ...]
                                        [--output FILE.json]

DIR has folders NAME/fit and NAME/score of tables. Every other drive, by name, is for tuning. With
--output, results of earlier runs are read from the file and not computed again.
"""

from collections import Counter
from dataclasses import replace
import json
from pathlib import Path

from bench_tools import ROOT, table_parser
from measured_table import by_hand_columns, FRICTION, Row, ROWS, score_error
import numpy as np
from scipy.signal import lfilter

from friction_comp import read_recording
from friction_comp.errors import InputError
from friction_comp.refinement.refine import refine

JOINTS = ('shoulder_lift_joint', 'elbow_joint', 'wrist_1_joint')
WRONG = {'trust': 1.5, 'trust in part': 2.0}
SAME = 0.01
_CHUNKS = 16


def thinned(count):
    """Keep every so many samples."""
    return lambda samples: samples.take(slice(None, None, count))


def averaged(count):
    """Average so many samples, as a logger with a filter does."""
    return lambda samples: samples.averaged(count)


def no_velocity(samples):
    """Leave out the velocity, of other joints, too."""
    arm = samples.arm and replace(samples.arm, velocity=None)
    return samples.with_(velocity=None, arm=arm)


def by_segment(samples, change):
    """Return the current with a change of each segment's time and current."""
    current = np.array(samples.current)
    for part in samples.segments():
        current[part] = change(samples.time[part], current[part])
    return samples.with_(current=current)


def low_passed(cutoff):
    """Filter the current by a first-order low pass, Hz."""
    def change(samples):
        pole = np.exp(-2.0 * np.pi * cutoff * samples.sample_time)
        return by_segment(samples, lambda time, values: values[0] + lfilter(
            (1.0 - pole,), (1.0, -pole), values - values[0]))
    return change


def delayed(delay):
    """Record the current late, s."""
    return lambda samples: by_segment(
        samples, lambda time, values: np.interp(time - delay, time, values))


def in_steps(values, count):
    """Round values to a share of their range, or to eight of their steps if these are larger."""
    step = max(np.ptp(values) / count, 8.0 * float(np.min(
        np.diff(np.unique(values)), initial=np.inf, where=np.diff(np.unique(values)) > 0.0))
        if len(np.unique(values)) < 0.05 * len(values) else 0.0)
    return step * np.round(values / step)


def coarse_current(samples):
    """Round the current to 7 bits."""
    return samples.with_(current=in_steps(samples.current, 128))


def coarse_position(samples):
    """Round the position to 11 bits of its range; velocity is not recorded."""
    return no_velocity(samples.with_(position=in_steps(samples.position, 2048)))


def jittered(samples):
    """Stamp samples up to a fifth of a period early or late."""
    wrong = np.random.default_rng(len(samples)).uniform(-0.2, 0.2, len(samples))
    return samples.with_(time=np.maximum.accumulate(samples.time + wrong * samples.sample_time))


def half(second):
    """Keep the first or the second half."""
    def change(samples):
        middle = len(samples) // 2
        return samples.take(slice(middle, None) if second else slice(0, middle))
    return change


def by_speed(fast):
    """Keep the pieces of the recording in which the joint is faster, or slower, than in others."""
    def change(samples):
        pieces = np.array_split(np.arange(len(samples)), _CHUNKS)
        way = [np.abs(np.diff(samples.position[piece])).sum() / len(piece) for piece in pieces]
        order = np.argsort(way, kind='stable')
        kept = order[_CHUNKS // 2:] if fast else order[:_CHUNKS // 2]
        return samples.take(np.concatenate([pieces[k] for k in sorted(kept)]))
    return change


def moved_position(samples):
    """Add a constant to the position."""
    return samples.with_(position=samples.position + 0.7)


def flipped(samples):
    """Turn the direction of motion, current and load round."""
    signals = {name: -getattr(samples, name) for name in ('position', 'velocity', 'load')
               if getattr(samples, name) is not None}
    return samples.with_(current=-samples.current, **signals)


def in_thousandths(samples):
    """Give current and load in thousandths."""
    load = None if samples.load is None else 1e3 * samples.load
    return samples.with_(current=1e3 * samples.current, load=load)


def by_clock(samples):
    """Count time from 1970."""
    return samples.with_(time=samples.time + 1.7e9)


# Name: change, and whether the prediction is of a recording changed alike.
CHANGES = {
    'none': (lambda samples: samples, False),
    'half of the rate': (thinned(2), False), 'third of the rate': (thinned(3), False),
    'tenth of the rate': (thinned(10), False),
    'half, averaged': (averaged(2), True), 'third, averaged': (averaged(3), True),
    'tenth, averaged': (averaged(10), True),
    'no velocity': (no_velocity, False),
    'current at 15 Hz': (low_passed(15.0), True), 'current at 5 Hz': (low_passed(5.0), True),
    'coarse current': (coarse_current, True), 'coarse position': (coarse_position, True),
    'stamps off': (jittered, True),
    'current 5 ms late': (delayed(0.005), True), 'current 20 ms late': (delayed(0.02), True),
    'first half': (half(False), False), 'second half': (half(True), False),
    'fast part': (by_speed(True), False), 'slow part': (by_speed(False), False),
    'position moved': (moved_position, True), 'flipped': (flipped, True),
    'thousandths': (in_thousandths, True), 'clock': (by_clock, True)}
PURE = ('position moved', 'flipped', 'thousandths', 'clock')


def drives_of(data, more):
    """Return by name the paths of fit and score, the joint, and how errors are taken."""
    drives = {}
    for row in ROWS:
        if (data / row.data / 'fit').exists() and (not row.joint or row.joint in JOINTS):
            drives[row.name] = (*([data / row.data / part] for part in ('fit', 'score')),
                                row.joint, row.error)
    for folder in sorted(more.iterdir()) if more else ():
        drives[folder.name] = (*(sorted((folder / part).iterdir()) for part in ('fit', 'score')),
                               None, 'all')
    return dict(sorted(drives.items()))


def error_on(model, recordings, how):
    """Return the error of a model's predictions of recordings."""
    return score_error(how, np.concatenate([np.column_stack(
        [part.time, part.current, model.predict(part)]) for part in recordings]))


def plain_error(fit, score, how):
    """Return the error of Coulomb and viscous friction, fitted to the same."""
    row = Row('')
    columns, new = (np.vstack([by_hand_columns(part, row, FRICTION, np.inf) for part in parts])
                    for parts in (fit, score))
    current = np.concatenate([part.current for part in fit])
    constants = np.linalg.lstsq(columns, current, rcond=1e-9)[0]
    table = np.column_stack([np.concatenate([part.time for part in score]),
                             np.concatenate([part.current for part in score]), new @ constants])
    return score_error(how, table)


def judged(fit, score, how, change, alike):
    """Return what refinement makes of a changed recording, and the true errors."""
    changed, predicted = [change(part) for part in fit], [change(part) for part in score]
    try:
        result = refine(changed)
    except InputError as error:
        return {'verdict': 'refused', 'why': str(error)}
    report = result.report
    errors = {'as recorded': error_on(result.model, score, how) if not alike else None,
              'alike': error_on(result.model, predicted, how)}
    return {
        'verdict': report.verdict, 'expected': report.after.elsewhere_rmse,
        'held_out': report.after.held_out_rmse, 'errors': errors,
        'error': errors['alike' if alike else 'as recorded'],
        'plain': plain_error(changed, predicted if alike else score, how),
        'effects': [effect.name for effect in report.effects], 'settings': dict(
            result.model.settings), 'thirds': report.thirds,
        'codes': [one.code for one in report.findings if one.grade != 'trust']}


def show(results):
    """Print a line for each result, and the counts."""
    wrong, verdicts, ratios, gains = Counter(), Counter(), [], []
    for (drive, change), one in results.items():
        base = results.get((drive, 'none'))
        if one['verdict'] == 'refused' or base is None:
            print(f"{drive:24} {change:18} refused: {one.get('why', '')[:60]}")
            continue
        ratio, faults = one['error'] / one['expected'], []
        if ratio > WRONG.get(one['verdict'], np.inf):
            faults.append('WRONG')
            wrong[one['verdict']] += 1
        if change in PURE and 'expected' in base:
            scale = 1e3 if change == 'thousandths' else 1.0
            off = max(abs(np.log(one[name] / scale / base[name])) for name in (
                'error', 'expected', 'held_out'))
            if off > SAME or one['verdict'] != base['verdict'] or (
                    sorted(one['effects']) != sorted(base['effects'])):
                faults.append(f'UNEQUAL {100.0 * off:.1f} %')
                wrong['unequal'] += 1
        verdicts[one['verdict']] += 1
        if change not in PURE:
            ratios.append((one['verdict'], ratio))
            gains.append(one['error'] / one['plain'])
        print(f"{drive:24} {change:18} {one['verdict']:13} {one['error']:9.4g} / "
              f"{one['expected']:9.4g} = {ratio:5.2f}  C+V {one['plain']:9.4g}  "
              f"{' '.join(faults)} {' '.join(one['codes'])}")
    print(f'\n{dict(verdicts)}; faults {dict(wrong)}; geometric mean of the error over '
          f'that of C + V {np.exp(np.mean(np.log(gains))):.3f}')
    for verdict in dict.fromkeys(verdict for verdict, _ in ratios):
        own = np.array([ratio for name, ratio in ratios if name == verdict])
        print(f'{verdict}: {len(own)}, ratio: median {np.median(own):.2f}, 90 % below '
              f'{np.quantile(own, 0.9):.2f}, largest {own.max():.2f}; below 0.5: '
              f'{np.sum(own < 0.5)}')


def main():
    """Judge all changes of all drives."""
    parser = table_parser(__doc__)
    parser.add_argument('--data', type=Path, default=ROOT.parent / 'shared' / 'data')
    parser.add_argument('--more', type=Path, help='folder of further drives')
    parser.add_argument('--half', choices=('tuning', 'kept'))
    parser.add_argument('--drives', nargs='*')
    parser.add_argument('--changes', nargs='*', default=list(CHANGES), choices=CHANGES)
    parser.add_argument('--output', type=Path, help='JSON file of the results')
    arguments = parser.parse_args()
    known = {}
    if arguments.output and arguments.output.exists():
        known = json.loads(arguments.output.read_text())
    results = {}
    drives = drives_of(arguments.data, arguments.more)
    for index, (name, (*paths, joint, how)) in enumerate(drives.items()):
        wanted = not arguments.half or index % 2 == (arguments.half == 'kept')
        if not wanted or (arguments.drives and name not in arguments.drives):
            continue
        fit, score = (read_recording(path, joint=joint) for path in paths)
        for change in arguments.changes:
            key = f'{name} | {change}'
            if key not in known:
                known[key] = judged(fit, score, how, *CHANGES[change])
                if arguments.output:
                    arguments.output.write_text(json.dumps(known, indent=1, default=float))
            results[name, change] = known[key]
    show(results)


if __name__ == '__main__':
    main()
