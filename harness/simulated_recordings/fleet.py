# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated fleets: units of one type whose friction scatters, some of them odd.

Every unit is drawn from its own seed around one drive of the type; nothing of what is drawn is
written into the recordings.
"""

from __future__ import annotations

from dataclasses import replace
import math

import numpy as np

from friction_comp.model.sigmoid import Sigmoid
from friction_comp.recordings import write_samples
from simulated_recordings.drives import Excitation, random_drive, record

# Scatter of a type's units (logarithmic, except for the offset): that of Coulomb and viscous
# friction of equal servo drives is 5 to 15 %, that of masses and of their mounting less.
SCATTER = {'coulomb': 0.08, 'viscous': 0.12, 'offset': 0.02, 'steepness': 0.1, 'inertia': 0.03,
           'gravity': 0.04, 'ripple': 0.15}
# What may be wrong with a unit, and the factor or share of friction by which it is.
FAULTS = {'coulomb': 1.6, 'viscous': 2.2, 'ripple': 3.0, 'inertia': 1.3, 'bump': 0.8,
          'offset': 0.25}


def fleet_drive(seed, unit, fault=None):
    """Return the `SimulatedDrive` of a unit of the type `seed`, perhaps with one of `FAULTS`."""
    base = random_drive(seed)
    level = 0.5 * (base.model.sigmoid.upper - base.model.sigmoid.lower)
    rng = np.random.default_rng([seed, unit, 7])
    factor = {name: math.exp(scatter * rng.standard_normal())
              for name, scatter in SCATTER.items() if name != 'offset'}
    offset = level * SCATTER['offset'] * float(rng.standard_normal())
    if fault in factor:
        factor[fault] *= FAULTS[fault]
    offset += level * FAULTS['offset'] if fault == 'offset' else 0.0
    sigmoid, torque = base.model.sigmoid, level * base.model.drive.torque_per_current
    friction = level * factor['coulomb']
    own = Sigmoid(friction + offset, offset - friction, sigmoid.steepness * factor['steepness'],
                  0.0, sigmoid.viscous * factor['viscous'])
    effects = [
        {'name': 'inertia', 'parameters': {'inertia': 0.2 * torque * factor['inertia']}},
        {'name': 'gravity', 'parameters': {
            'amplitude': 0.5 * torque * factor['gravity'],
            'phase': 0.3 + 0.03 * float(rng.standard_normal())}},
        # Where the ripple begins depends on how the encoder was mounted.
        {'name': 'friction_ripple', 'parameters': {
            'amplitude': 0.15 * torque * factor['ripple'], 'frequency': 24.0,
            'phase': float(rng.uniform(-math.pi, math.pi))}}]
    if fault == 'bump':
        effects.append({'name': 'bump', 'parameters': {
            'amplitude': FAULTS['bump'] * torque, 'position': float(rng.uniform(-0.8, 0.8)),
            'width': 0.1}})
    return replace(base, model=replace(base.model, sigmoid=own), effects=effects)


def write_fleet(folder, seed, units, faults):
    """Write a recording of each unit; return the names of the odd units and their faults.

    The faults are spread over the units at random.
    """
    rng = np.random.default_rng([seed, 8])
    odd = dict(zip(rng.permutation(units)[:len(faults)].tolist(), faults))
    for unit in range(units):
        samples = record(fleet_drive(seed, unit, odd.get(unit)), 100_000 * seed + 100 * unit,
                         Excitation(duration=20.0, rate=125.0))[0].samples
        write_samples(folder / f'unit_{unit:04d}' / 'day_0', samples)
    return {f'unit_{unit:04d}': fault for unit, fault in sorted(odd.items())}
