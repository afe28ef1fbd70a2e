# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Builds the model of the named effects, with its error on parts that were not fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from friction_comp.drive import Drive
from friction_comp.model.arm.arm import Arm
from friction_comp.model.arm.coupling import Coupling
from friction_comp.model.effects import Effect, EFFECTS
from friction_comp.model.effects.edges import with_range
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement.attempt import Fit
from friction_comp.refinement.constants import adjust_constants
from friction_comp.refinement.effect_columns import (
    base_columns,
    DERIVATIVES,
    Key,
    MOST_SHIFT,
    Table,
)
from friction_comp.refinement.prepare import Rows
from friction_comp.refinement.recorded_motion import settings_for_arm

# Fits whose squared errors in motion differ by less are equivalent.
_EQUIVALENT = 1.02
_STEEPNESSES = 16
_MOST_SAMPLES = 30_000


def refit(fit: Fit, keys: Sequence[Key]) -> Fit:
    """Fit the named terms alone, with the transition that predicts all samples best."""
    table = fit.table
    keys = adjust_constants(table, keys, 5)
    table.fit_transition(keys)
    table = _fit_transition_to_all_samples(table, keys)
    return replace(fit, table=table, keys=keys)


def _fit_transition_to_all_samples(table: Table, keys: Sequence[Key]) -> Table:
    """Set the transition of Eq. 6 that predicts all samples best; return the table.

    Samples near standstill are not used to choose effects, since the current of a joint that
    sticks is not friction. But only they show how steeply friction changes its sign: of all
    transitions that explain the motion equally well, the one that best predicts all samples,
    with starts, stops and reversals, is used.
    """
    rows = table.rows
    speed, index = rows.scene.speed, _subsample(rows)
    start = table.steepness, table.shift
    grid = [start, (table.steepness, 0.0)] + [
        (2.0 / (width * speed), shift) for width in np.geomspace(3e-4, 0.25, _STEEPNESSES)
        for shift in dict.fromkeys((table.shift, 0.0))]
    others = np.column_stack([table.terms[key].columns(rows) for key in keys]
                             or [np.empty((len(rows.samples), 0))])[index]
    trials = []
    for steepness, shift in grid:
        limit = MOST_SHIFT / steepness
        table.set_transition(steepness, float(np.clip(shift, -limit, limit)))
        columns = table.indices(keys, derivatives=False)
        error = float(table.left_out(columns).sum())
        base = np.delete(base_columns(rows, steepness, table.shift), DERIVATIVES, axis=1)[index]
        residual = rows.target[index] - np.column_stack((base, others)) @ table.sums.fit(columns)
        # Limit the influence of outliers.
        size = np.abs(residual)
        size = np.minimum(size, np.quantile(size, 0.999))
        trials.append((error, float(size @ size), steepness, table.shift))
    least = min(error for error, *_ in trials)
    *_, steepness, shift = min((trial for trial in trials if trial[0] <= _EQUIVALENT * least),
                               key=lambda trial: trial[1])
    table.set_transition(steepness, shift)
    return table


def _subsample(rows: Rows) -> np.ndarray:
    return np.arange(0, len(rows.samples), max(1, len(rows.samples) // _MOST_SAMPLES))


def model_of(fit: Fit, drive: Drive, before: FrictionModel | None, joint: str
             ) -> FrictionModel:
    """Return the model of a fit."""
    table, rows, settings = fit.table, fit.rows, fit.settings
    coefficients = table.coefficients(fit.keys)
    offset, coulomb, viscous = coefficients[0], coefficients[1], coefficients[2]
    sigmoid = Sigmoid(upper=offset + coulomb, lower=offset - coulomb, steepness=table.steepness,
                      shift=table.shift, viscous=viscous)
    moving = rows.samples.take(rows.usable)
    effects: list[Effect] = []
    groups, gains = [], []
    for key in fit.keys:
        term = table.terms[key]
        values = tuple(coefficients[column] for column in table.columns_of(key))
        if term.group is None:
            effects.append(with_range(
                term.kind({**term.constants, 'coefficients': list(values)}), moving))
        else:
            groups.append(term.group)
            gains.append(values)
    arm = before.arm if before else None
    if groups:
        effects.append(EFFECTS['other_joints']({'coefficients': [1.0]}))
        arm = Arm(coupling=Coupling(tuple(groups), tuple(gains)),
                  # The model applies the lag to these torques, as to all others.
                  differentiation=settings_for_arm(rows.samples, {**settings, 'lag': 0.0}))
    if rows.load_by_mechanics:
        effects.append(EFFECTS['load_torque']({'coefficients': [rows.load_by_mechanics]}))
    return FrictionModel(
        drive=drive, sigmoid=sigmoid, effects=effects, differentiation=dict(settings), arm=arm,
        joint=joint, breakaway=before.breakaway if before else None,
        presliding=before.presliding if before else None,
        position_limits=before.position_limits if before else None,
        lookup_table=before.lookup_table if before else None,
        simulation=dict(before.simulation) if before else {},
        notes=dict(before.notes) if before else {})
