# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The worlds of the bench obey physics, so that they can judge the law and refinement."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from friction_comp import FrictionModel
from law_judge.bank import ASKED, identified_bank, make_bank
from second_world.families import draw, make
from second_world.judging import noise_floor
from world import gear as world
from world.gear import (
    breakaway_currents,
    draw_gears,
    FRICTIONS,
    KINDS,
    Plant,
    presliding,
    steady_friction,
)
from world.person import nobody

EVEN = 0


def plain_gears(seed=EVEN, draws=3):
    """Return gears without scatter, noise and what depends on place."""
    gears = np.concatenate([draw_gears(kind, draws, seed) for kind in KINDS])
    for name in ('scatter', 'cogging', 'current_noise', 'load_friction', 'asymmetry'):
        gears[name] = 0.0
    return gears


def push(plant, current, seconds, watch=('motor',)):
    """Apply ``current(time)`` and return what was watched, each of shape (N, J)."""
    rows = {name: [] for name in watch}
    for _ in range(round(seconds / plant.sample_time)):
        plant.advance(current(plant.time))
        for name in watch:
            rows[name].append(plant.states[name].copy())
    return {name: np.array(values) for name, values in rows.items()}


def level(gears):
    return (gears['static'] + gears['link_coulomb']) / gears['torque_per_current']


@pytest.mark.parametrize('kind', FRICTIONS)
def test_friction_always_dissipates_energy(kind):
    # free of motor and person, what the joint had is what friction and dampers took
    gears = plain_gears()
    gears = gears[gears['friction'] == FRICTIONS[kind]]
    random = np.random.default_rng(EVEN)
    plant = Plant(gears, nobody(len(gears)), EVEN)
    start = level(gears)
    phase, rate = random.uniform(0, 6, len(gears)), random.uniform(1, 40, len(gears))
    rows = push(plant, lambda t: start * np.sin(rate * t + phase) * (1.2 + np.sin(3.0 * t)), 3.0,
                ('friction_work',))
    work = rows['friction_work']
    # at any moment friction can give back what its springs hold, and no more
    stored = gears['static'] * np.maximum(gears['presliding'], 1e-6)
    given_back = np.maximum.accumulate(work, axis=0) - work
    assert np.all(given_back.max(axis=0) < stored)
    assert np.all(work[-1] > 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(('kind', 'seed', 'off'), [
    ('lugre', 6, 0.1), ('lugre', 25, 0.05), ('maxwell_slip', 2, 0.05)])
def test_identification_finds_what_a_gear_has(kind, seed, off):
    """The motion before the slide, a millimetre or more at the rim, is not taken for the slide.

    The first link is twenty times as heavy as its rotor, and does not rattle through it.
    """
    bank = make_bank(world, [kind], 1, seed)
    (gear,), (found, refused) = bank.gears, identified_bank(bank)
    assert not refused
    model = FrictionModel.from_dict(found.documents[0])
    truth = breakaway_currents(bank.gears, 1000, 16)[0]
    # Besides, two standard errors of the eight ramps.
    either = 0.7 * model.breakaway.positive_std + off * truth.mean()
    assert model.breakaway.positive_mean == pytest.approx(truth[::2].mean(), abs=either)
    assert -model.breakaway.negative_mean == pytest.approx(truth[1::2].mean(), abs=either)
    for side in (1, -1):
        curve = steady_friction(gear, ASKED, side)
        assert np.abs(model.sigmoid(side * ASKED)) == pytest.approx(curve, rel=0.05)
    known = model.presliding
    assert known.distance == pytest.approx(presliding(gear)[0], rel=0.35, abs=known.std)


def test_the_world_knows_nothing_of_the_package_but_its_samples_and_of_no_judge():
    """Its point is to be independent of what it judges."""
    for path in sorted(Path(world.__file__).parent.rglob('*.py')):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [
                f'{node.module}.{alias.name}' for alias in node.names
                ] if isinstance(node, ast.ImportFrom) else []
            for name in names:
                assert name.split('.')[0] not in {
                    'friction_comp', 'law_judge', 'second_world', 'simulated_recordings',
                    } or name == 'friction_comp.Samples', f'{path.name}: {name}'


@pytest.mark.parametrize('family', ['none', 'gravity', 'load', 'temperature', 'ripple', 'rest',
                                    'presliding', 'lag', 'product'])
def test_the_true_law_leaves_the_noise_of_current_and_no_more(family):
    case = draw(family, 0)
    case = replace(case, fit_sensors=replace(
        case.fit_sensors, noise_memory=0.0, current_quantum=0.0, jitter=0.0))
    trace, seen = make(case, 'fit')
    assert noise_floor(case, trace, seen) == pytest.approx(case.fit_sensors.noise, rel=0.2)
