# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool `predict`."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from friction_comp.errors import errors_name, InputError, one_of
from friction_comp.files import read_yaml, write_atomically
from friction_comp.tables.table_files import to_csv
from friction_comp.terminal import in_own_units, progress
from friction_comp.tools.common import Arguments, layout_of

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.model.model_file import Recorded
    from friction_comp.samples import RecordingInfo, Samples


def predict(argv: list[str] | None = None) -> int:
    """Writes the current that a model predicts, next to the measured one.

    The measured current is that of the motor. If the load was recorded, the current that
    corresponds to it is added, unless the model has an effect of the load. Of a plan (a table of
    time and position without effort, of one joint or an arm, or a JointTrajectory), it writes the
    torque that the motion needs, as feed-forward.
    """
    parser = Arguments(predict, (
        'examples/elbow/with_direction.mcap.zstd --model config/armin_configuration_2.yaml '
        '--output output/current.csv',
        'plan.csv --model output/refined/model.yaml --output torque.csv',
        'log.csv --columns effort=tau_2 --model output/refined/model.yaml --output current.csv')
    ).add_recordings(several=False)
    parser.add_argument('--model', metavar='FILE', type=Path, required=True,
                        help='model file that refine or identification wrote')
    parser.add_output('CSV file with the columns time, measured, predicted; of a plan time, '
                           'torque')
    arguments = parser.parse(argv)
    from friction_comp.tables.table_recording import read_plan

    plan = read_plan(arguments.recording, layout_of(arguments))
    if plan is not None:
        return predict_plan(arguments, plan)
    # A plan needs none of these.
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.recordings.reader import (
        find_recording,
        read_recording_with_info,
        recorded_joints,
        without_topic,
    )

    path, layout = find_recording(arguments.recording), layout_of(arguments)
    model = FrictionModel.load(arguments.model, without_topic(path, arguments.joint))
    with progress('reading') as report:
        joint = arguments.joint
        if not joint and model.joint and model.joint in recorded_joints(path, layout):
            joint = model.joint
        (samples, info), = read_recording_with_info(
            path, joint, model.drive.torque_per_current, report, layout)
        model.check_joint(info.joint, arguments.model)
        report(1.0, 'predicting')
        with errors_name(arguments.recording):
            predicted = model.predict(samples)
    measured = model.measured(samples)
    text = table(samples, info, measured, predicted)
    write_atomically(arguments.output, text)
    left_out = [effect.name for effect in model.effects if not effect.holds_on_another_day]
    if left_out:
        print(f"left out, since it belongs to the recording it was found in: {', '.join(left_out)}")
    if measured is not samples.current:
        print('a load was recorded: the current that it replaces is added to the measured current')
    errors, remarks = compared(model, samples, measured, predicted)
    print(f'{arguments.output}: {len(text.splitlines()) - 1} rows, RMS of measured minus predicted '
          + ', '.join(errors))
    for note in (*remarks, *info.notes):
        print(f'note: {note}')
    return 0


def compared(model: FrictionModel, samples: Samples, measured: np.ndarray,
             predicted: np.ndarray) -> tuple[list[str], list[str]]:
    """Return the errors in words, and remarks on where the model cannot be believed."""
    from friction_comp.model.model_file import LARGER
    from friction_comp.refinement.prepare import moving
    from friction_comp.statistics import rms

    residual, unit = measured - predicted, model.unit
    errors, remarks = [f'{rms(residual):.4g} {unit}'], list[str]()
    known, moved = model.recorded, model.differentiated(model.with_arm(samples))
    # At standstill friction balances any torque up to breakaway: an error there says little.
    try:
        moves = moving(samples, model)
    except InputError:
        moves = np.ones(len(samples), dtype=bool)
        remarks.append('too little motion to tell the error from that of a constant, or from the '
                       'one that refine expected')
    else:
        # The friction that motor and person overcome together, in which no motion changes anything.
        both = measured if samples.load is None or measured is not samples.current else (
            measured + np.nan_to_num(samples.load) / model.drive.torque_per_current)
        error, constant = rms(residual[moves]), float(both[moves].std())
        errors = [f'{error:.4g} {unit} where the joint moves', f'{errors[0]} with standstill']
        if error > constant:
            remarks.append(f'where the joint moves, a constant is only {constant:.4g} {unit} off: '
                           'the model does not hold for this recording')
        if known is not None and known.error and (
                error := _as_fitted(samples, residual, moves, known)) > LARGER * known.error:
            remarks.append(f'where the joint moves, the error is {error / known.error:.2g} '
                           f'times the {known.error:.4g} {unit} that refine expected in other '
                           'movements: the model does not describe all of this recording')
    if known is not None:
        remarks += [in_own_units(note, model.is_linear) for note in known.beyond(
            moved.take(moves), model.effects, model.is_linear, model.drive.torque_per_current)]
    return errors, remarks


def _as_fitted(samples: Samples, residual: np.ndarray, moves: np.ndarray, known: Recorded) -> float:
    """Return the RMS residual in motion, of averages as long as the samples that were fitted.

    The error to expect of a slower recording, or of averages, holds less noise.
    """
    from friction_comp.statistics import rms

    length = round((known.sample_time or 0.0) / max(samples.sample_time, 1e-9))
    averages = samples.with_(current=np.where(moves, residual, np.nan)).averaged(max(length, 1))
    found = averages.current[np.isfinite(averages.current)]
    return rms(found if len(found) else residual[moves])


def table(samples: Samples, info: RecordingInfo, measured: np.ndarray,
          predicted: np.ndarray) -> str:
    """Return the CSV text: one row for every joint state, unusable ones as those before them."""
    received, rows = np.asarray(info.stamps, dtype=float), np.asarray(info.rows, dtype=int)
    last = np.full(len(received), -1)
    last[rows] = np.arange(len(rows))
    last = np.maximum(np.maximum.accumulate(last), 0)
    stamps = np.where(np.isfinite(received), received, samples.time[last]) + info.start
    return to_csv({'time': stamps, 'measured': measured[last], 'predicted': predicted[last]}, 9)


def predict_plan(arguments: Namespace, plan: dict[str, Samples]) -> int:
    """Write a row for each time of a plan, with the torque of each of its joints; returns 0."""
    from friction_comp.model.motor_check import cautions

    models = _models(arguments, plan)
    columns = {'time': next(iter(plan.values())).time}
    left_out: list[str] = []
    units: dict[str, str] = {}
    beyond: list[str] = []
    for name, model in models.items():
        prefix = f'{name}.' if len(models) > 1 else ''
        told, others = model.of_plan()
        left_out += [other for other in others if other not in left_out]
        with errors_name(arguments.recording):
            current, moved = _current(told, plan[name if name in plan else ''])
        unit, speed = model.unit, np.abs(np.asarray(moved.velocity))
        if model.recorded is not None:
            # Below 5 % of its top speed, a plan stands still.
            beyond += [(f'{name}: ' if len(models) > 1 else '') + in_own_units(
                note, model.is_linear) for note in model.recorded.beyond(
                    moved.take(speed > 0.05 * speed.max()), told.effects, model.is_linear)]
        gain = model.gain
        if gain is not None:
            columns[f'{prefix}torque'], units['torque'] = gain * current, in_own_units(
                'N·m', model.is_linear)
        if unit == 'A' or gain is None:
            what = 'current' if unit == 'A' else 'effort'
            columns[f'{prefix}{what}'], units[what] = current, unit
    write_atomically(arguments.output, to_csv(columns, 9))
    print(f'{arguments.recording}: has no effort, so it is taken as a plan')
    if left_out:
        print(f"left out, since a plan does not tell their signals: {', '.join(left_out)}")
    print(f'{arguments.output}: {len(columns["time"])} rows, '
          + ', '.join(f'{what} in {unit}' for what, unit in units.items()))
    for line in dict.fromkeys((*beyond, *(
            line for model in models.values() for line in cautions(model)))):
        print(f'note: {line}')
    return 0


def _models(arguments: Namespace, plan: dict[str, Samples]) -> dict[str, FrictionModel]:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.model.model_file import joints_of

    path: Path = arguments.model
    names = joints_of(read_yaml(path))
    if names is None or arguments.joint:
        model = FrictionModel.load(path, arguments.joint)
        wanted = arguments.joint or model.joint
        if list(plan) != ['']:
            wanted = one_of(list(plan), wanted, arguments.recording)
        model.check_joint(arguments.joint, path)
        return {wanted: model}
    known = [name for name in plan if name in names]
    if not known:
        raise InputError(f'{arguments.recording}: none of its joints '
                         f'({", ".join(map(repr, plan))}) is in {path}, which has '
                         f'{", ".join(map(repr, names))}')
    return {name: FrictionModel.load(path, name) for name in known}


def _current(model: FrictionModel, samples: Samples) -> tuple[np.ndarray, Samples]:
    """Return the current of a plan, (N,), which leads by `lag`, and the plan with all signals."""
    from friction_comp.model.differentiation import differentiate

    settings = model.settings
    if samples.acceleration is not None and model.arm is None:
        return model.current(samples), samples
    settings['source'] = 'position' if samples.velocity is None else 'velocity'
    settings['lag'] = max(settings.get('lag') or 0.0, 0.0)
    moved = differentiate(model.with_arm(samples), settings)
    return model.current(moved), moved
