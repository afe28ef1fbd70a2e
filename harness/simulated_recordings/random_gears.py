# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Random geared joints with LuGre, Maxwell-slip or clamp friction, from plausible ranges.

Where the ranges come from:

- friction level, ratio, inertia, encoder: Harmonic Drive's catalogue of HFUC units (sizes 14 to
  32: starting torques and inertias) behind motors of 20 to 200 W; a joint's breakaway torque
  accelerates it at 5 to 20 rad/s²
- resonance on the gear's compliance, 15 to 60 Hz: the catalogue's stiffness K1 to K3 (3 to
  50 kN·m/rad) with such inertias
- presliding 0.1 to 1 mrad at the joint: rolling contacts give by micrometres, gears of ratio 100
  turn round within a degree to ten of the motor (Al-Bender and Swevers, IEEE Control Systems 28(6),
  2008)
- breakaway over sliding friction 0.85 to 1.25 and its scatter of 2 to 5 %: section 3 of the note
  and the drives of Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30(7), 1994, who
  also have the Stribeck velocity and a frictional lag of some milliseconds
"""

from __future__ import annotations

from dataclasses import dataclass, replace
import math

import numpy as np

from friction_comp.drive import Drive
from friction_comp.model.friction_model import Breakaway, FrictionModel, Presliding
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.simulation.joint_parameters import (
    ELEMENTS,
    GEARS,
    joint_parameters,
    set_presliding,
)


@dataclass(frozen=True)
class RandomGear:
    """A joint as it was drawn.

    Parameters
    ----------
    parameters : record of joint_parameters.JOINT
    model : FrictionModel
        What a perfect identification would say of it.
    """

    parameters: np.void
    model: FrictionModel

    def held_by(self, lag: float) -> np.void:
        """Return the parameters with a person who leans with friction when it lags, rad."""
        p = self.parameters.copy()
        p['human_stiffness'] = p['upper'] / lag
        p['human_damping'] = 1.4 * math.sqrt(
            p['human_stiffness'] * (p['motor_inertia'] + p['link_inertia']))
        return p

    def wrong_by(self, factor: float) -> FrictionModel:
        """Return the model with all friction too large by a factor."""
        m, both = self.model, self.model.breakaway
        assert both is not None
        return replace(m, sigmoid=replace(
            m.sigmoid, upper=factor * m.sigmoid.upper, lower=factor * m.sigmoid.lower,
            viscous=factor * m.sigmoid.viscous), breakaway=replace(
                both, positive_mean=factor * both.positive_mean,
                negative_mean=factor * both.negative_mean))


def random_gear(seed: int, kind: str) -> RandomGear:
    """Draw a joint.

    Parameters
    ----------
    seed : int
    kind : {'clamp', 'lugre', 'maxwell_slip'}
    """
    rng = np.random.default_rng([seed, GEARS[kind], 77])

    def spread(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))

    level, constant = spread(0.8, 20.0), spread(0.03, 0.12)
    ratio = float(rng.choice([50, 100, 160]))
    counts = int(rng.choice([2000, 4000, 8192, 16384]))
    drive = Drive(constant, ratio, counts, current_limit=20.0 * level / (constant * ratio))
    asymmetry, breakaway = rng.uniform(-0.08, 0.08), rng.uniform(0.85, 1.25)
    scatter, presliding = rng.uniform(0.02, 0.05), spread(1e-4, 1e-3)
    upper, lower = level * (1.0 + asymmetry), -level * (1.0 - asymmetry)
    scale = drive.torque_per_current
    model = FrictionModel(
        drive=drive, sigmoid=Sigmoid(upper / scale, lower / scale, spread(30.0, 250.0), 0.0,
                                     level / scale * rng.uniform(0.05, 0.6)),
        breakaway=Breakaway(
            breakaway * upper / scale, breakaway * lower / scale,
            scatter * breakaway * upper / scale, -scatter * breakaway * lower / scale),
        presliding=Presliding(3.0 * presliding if kind == 'lugre' else presliding),
        joint=f'{kind}_{seed}')
    both = model.breakaway
    assert both is not None
    p = joint_parameters(replace(model, simulation={
        'gear': kind, 'inertia': level / spread(5.0, 20.0), 'rotor_share': rng.uniform(0.5, 0.9),
        'gear_resonance': spread(15.0, 60.0), 'gear_damping': spread(0.02, 0.1),
        'stribeck_velocity': math.radians(spread(0.2, 3.0)),
        'current_noise': 0.01 * max(both.positive_mean, -both.negative_mean)}))
    shares = rng.uniform(0.5, 1.5, ELEMENTS)
    set_presliding(p, presliding, shares if kind == 'maxwell_slip' else np.ones(1),
                   rng.uniform(0.2, 0.7))
    p['level_lag'], p['current_lag'] = spread(0.5e-3, 5e-3), spread(0.2e-3, 1.5e-3)
    p['delay'] = int(rng.integers(0, 3))
    # A supply that reaches three times the note's fastest speed, less the back-EMF.
    p['back_emf'] = constant * ratio
    p['voltage'] = p['back_emf'] * math.radians(300.0)
    p['resistance'] = p['voltage'] / (8.0 * level / scale)
    return RandomGear(p, model)
