# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The same recordings for five ways of modelling friction, scored on recordings not fitted to.

    pip install -r bench/requirements.txt
    python3 bench/compare_peers.py [--data DIR] [--simulated N]

- least squares on Coulomb, viscous friction and offset
- the same and inertia
- the note's sigmoid, Eq. 6 by Eq. 7
- sparse regression: pysindy's STLSQ on a generic dictionary of the measured signals, its
  threshold chosen on a held-out quarter
- friction_comp refine

Measured sets are scored as their README says: ur10e on all samples; emps behind a zero-phase low
pass of 40 Hz; kinova on the median current of each of the ten constant speeds. Simulated drives
are scored where the joint moves, in parts of the noise that no model can predict.
"""

import argparse
import json
import os
from pathlib import Path
import sys

for variable in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS'):
    os.environ.setdefault(variable, '2')
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402
from refine_table import moving  # noqa: E402
from scipy.signal import butter, filtfilt  # noqa: E402

from friction_comp.drive import Drive  # noqa: E402
from friction_comp.identification.sigmoid_fit import fit_sigmoid  # noqa: E402
from friction_comp.recordings import read_recording  # noqa: E402
from friction_comp.refinement import refine  # noqa: E402
from friction_comp.samples import Samples  # noqa: E402
from simulated_recordings.drives import excitation_for, random_drive, record  # noqa: E402

SIMULATED = [
    (), ('stribeck',), ('gravity',), ('friction_ripple',), ('inertia',), ('temperature',),
    ('hysteresis',), ('sub_linear', 'cogging'), ('bump', 'direction'), ('warm_up', 'gravity')]
# A temperature that stays put would only be confused with the constant.
LEAST_VARIATION = {'temperature': 0.5}
THRESHOLDS = (0.003, 0.01, 0.02, 0.05, 0.1, 0.2)


def prepared(parts):
    """Return the samples of all parts with velocity and acceleration of zero phase.

    The position is low-passed at 80 Hz, or at a fifth of the sampling rate where that is less,
    and differenced twice: the same for all three peers.
    """
    done = []
    for samples in parts:
        for piece in (samples.take(index) for index in samples.segments()):
            rate = 1.0 / piece.sample_time
            if len(piece) < 40:
                continue
            b, a = butter(2, min(80.0, 0.2 * rate), fs=rate)
            velocity = np.gradient(filtfilt(b, a, piece.position), 1.0 / rate)
            done.append(piece.with_(
                velocity=velocity, acceleration=np.gradient(velocity, 1.0 / rate),
                time=piece.time - samples.time[0]))
    return Samples.concatenate(done)


class CoulombViscous:
    """Coulomb, viscous and offset by least squares."""

    @staticmethod
    def columns(samples):
        return np.column_stack((np.sign(samples.velocity), samples.velocity,
                                np.ones(len(samples))))

    def __init__(self, samples):
        slides = np.abs(samples.velocity) > 0.02 * np.abs(samples.velocity).max()
        self.gains = np.linalg.lstsq(
            self.columns(samples)[slides], samples.current[slides], rcond=None)[0]

    def __call__(self, samples):
        return self.columns(samples) @ self.gains


class RigidBody(CoulombViscous):
    """The same and inertia."""

    @staticmethod
    def columns(samples):
        return np.column_stack((CoulombViscous.columns(samples), samples.acceleration))


class NoteSigmoid:
    """Eq. 6 fitted to the moving samples by Eq. 7."""

    def __init__(self, samples):
        slides = np.nonzero(
            np.abs(samples.velocity) > 0.002 * np.abs(samples.velocity).max())[0]
        chosen = slides[::max(1, len(slides) // 1000)]
        self.sigmoid = fit_sigmoid(samples.velocity[chosen], samples.current[chosen])[0]

    def __call__(self, samples):
        return self.sigmoid(samples.velocity)


class SparseRegression:
    """STLSQ on a generic dictionary, as one would use it without knowing friction's laws."""

    def columns(self, samples):
        v, x, sign = samples.velocity, samples.position, np.sign(samples.velocity)
        table = [np.ones_like(v), sign, v, v * np.abs(v), v ** 3, sign * np.sqrt(np.abs(v)),
                 samples.acceleration, x, x * v, x * sign]
        for k in (1, 2, 3, 4, 8, 16):
            table += [np.sin(k * x), np.cos(k * x), sign * np.sin(k * x), sign * np.cos(k * x)]
        extra = {'time': samples.time, 'load': samples.load, 'temperature': samples.temperature}
        for name in self.extra:
            table += [extra[name], sign * extra[name]]
        if 'load' in self.extra:
            table.append(sign * np.abs(samples.load))
        return np.column_stack(table)

    def __init__(self, samples):
        from pysindy.optimizers import STLSQ

        self.extra = [name for name in ('time', 'load', 'temperature')
                      if getattr(samples, name) is not None
                      and np.std(getattr(samples, name)) > LEAST_VARIATION.get(name, 0.0)]
        samples = samples.take(slice(None, None, max(1, len(samples) // 15000)))
        columns = self.columns(samples)
        scale = np.sqrt(np.mean(columns ** 2, axis=0)) + 1e-12
        unit = np.sqrt(np.mean(samples.current ** 2))
        # The held-out quarter is every fourth of 40 blocks.
        held_out = (np.arange(len(samples)) * 40 // len(samples)) % 4 == 3
        best = np.inf
        for threshold in THRESHOLDS:
            optimizer = STLSQ(threshold=threshold, alpha=1e-3 * len(samples))
            optimizer.fit((columns / scale)[~held_out], samples.current[~held_out, None] / unit)
            gains = optimizer.coef_[0] * unit / scale
            loss = np.mean((columns[held_out] @ gains - samples.current[held_out]) ** 2)
            if loss < best:
                best, self.gains = loss, gains

    def __call__(self, samples):
        return self.columns(samples) @ self.gains


def all_samples(samples, predicted):
    """Return the RMS error over all samples."""
    return float(np.sqrt(np.mean((predicted - samples.current) ** 2)))


def low_passed(samples, predicted):
    """Return the RMS error behind the zero-phase low pass of 40 Hz."""
    b, a = butter(2, 40.0, fs=1.0 / samples.sample_time)
    return float(np.sqrt(np.mean(filtfilt(b, a, predicted - samples.current) ** 2)))


def medians(samples, predicted):
    """Return the RMS error of the median over each run, less its first second."""
    errors = []
    for run in samples.segments():
        late = samples.time[run] > samples.time[run.start] + 1.0
        errors.append(np.median(predicted[run][late]) - np.median(samples.current[run][late]))
    return float(np.sqrt(np.mean(np.square(errors))))


MEASURED = {
    'ur10e_joint1': (all_samples, 'A'),
    'emps': (low_passed, 'N'),
    'kinova_gen3_joint7': (medians, 'A'),
}


def compare(fit, score, measure, drive):
    """Return the error of each way on the recordings `score`, and what ours found."""
    samples, fresh = prepared(fit), prepared(score)
    errors = {}
    for name, kind in (('Coulomb + viscous', CoulombViscous), ('+ inertia', RigidBody),
                       ("note's sigmoid", NoteSigmoid),
                       ('STLSQ', SparseRegression)):
        errors[name] = measure(fresh, kind(samples)(fresh))
    result = refine(fit, model=None, drive=drive)
    joined = Samples.concatenate(score)
    errors['ours'] = measure(
        joined, np.concatenate([result.model.predict(part, same_recording=True) for part in score]))
    return errors, [effect['name'] for effect in result.report['effects']]


def main(argv=None):
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--data', type=Path, default=Path(
        os.environ.get('FRICTION_COMP_DATA', ROOT.parent / 'shared' / 'data')))
    parser.add_argument('--simulated', type=int, default=len(SIMULATED))
    parser.add_argument('--seed', type=int, default=500)
    parser.add_argument('--output', type=Path, help='JSON file with the figures')
    options = parser.parse_args(argv)
    rows = []
    for name, (measure, unit) in MEASURED.items():
        if not (options.data / name).is_dir():
            print(f'{name}: no recordings in {options.data}, left out', file=sys.stderr)
            continue
        fit, score = (read_recording([options.data / name / part]) for part in ('fit', 'score'))
        rows.append((f'{name} [{unit}]', *compare(fit, score, measure, Drive(1.0, 1.0))))
    for k, cases in enumerate(SIMULATED[:options.simulated]):
        drive = random_drive(options.seed + k, cases)
        fit, score = ([trial.samples for trial in record(
            drive, seed, excitation_for(cases))] for seed in (options.seed + k, k + 1))

        def measure(samples, predicted, floor=drive.noise_floor):
            where = moving(samples)
            return all_samples(samples.take(where), predicted[where]) / floor

        rows.append((f"simulated: {' + '.join(cases) or 'nothing undeclared'}",
                     *compare(fit, score, measure, drive.model.drive)))
    names = list(rows[0][1]) if rows else []
    print('| recording | ' + ' | '.join(names) + ' | effects found |')
    print('|---|' + '---|' * (len(names) + 1))
    for title, errors, effects in rows:
        best = min(errors.values())
        cells = [f'**{value:.4g}**' if value == best else f'{value:.4g}'
                 for value in errors.values()]
        print(f"| {title} | {' | '.join(cells)} | {', '.join(effects) or 'none'} |")
    if options.output:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(json.dumps(
            [{'recording': title, 'errors': errors, 'effects': effects}
             for title, errors, effects in rows], indent=1))
    return 0


if __name__ == '__main__':
    sys.exit(main())
