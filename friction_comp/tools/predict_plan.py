# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``predict`` on a plan: the torque that a planned motion needs."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

import numpy as np

from friction_comp.checks import one_of
from friction_comp.column_values import to_csv
from friction_comp.errors import errors_name, InputError
from friction_comp.files import read_yaml, write_atomically
from friction_comp.model.differentiation import as_recorded, differentiate
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import joints_of
from friction_comp.model.motor_check import cautions
from friction_comp.samples import Samples
from friction_comp.units import in_own_units

# Share of its top speed below which a plan stands still.
_STILL = 0.05


def predict_plan(arguments: Namespace, plan: dict[str, Samples]) -> int:
    """Write a row for each time of a plan, with the torque of each of its joints; returns 0."""
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
            beyond += [(f'{name}: ' if len(models) > 1 else '') + in_own_units(
                note, model.is_linear) for note in model.recorded.beyond(
                    moved.take(speed > _STILL * speed.max()), told.effects, model.is_linear)]
        gain = model.torque_per(unit)
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
    """Return the current of a plan, (N,), which leads its motion, and the plan with all signals.

    It leads by `lag` and `time_constant`.
    """
    settings = model.settings
    slow = max(settings.get('time_constant') or 0.0, 0.0)
    if samples.acceleration is not None and model.arm is None:
        assert samples.velocity is not None     # a plan with an acceleration has one
        return as_recorded(model.current(samples), samples, slow), samples
    settings['source'] = 'position' if samples.velocity is None else 'velocity'
    if settings.get('lag', 0.0) is None or settings.get('lag', 0.0) < 0.0:
        settings.pop('lag', None)
    moved = differentiate(model.with_arm(samples), settings)
    return as_recorded(model.current(moved), moved, slow), moved
