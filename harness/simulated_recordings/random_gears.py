# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Random geared joints with LuGre, Maxwell-slip or clamp friction, from plausible ranges.

Many of them run under their laws: let go, left alone, or pushed. And the smallest model that the
law compensates.

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
from friction_comp.simulation.batch import closed_loops
from friction_comp.simulation.joint import (
    ELEMENTS,
    GEARS,
    joint_parameters,
    random_states,
    set_presliding,
)

LEVEL = 0.1     # A
# rad, rad/s, N·m, A.
LOGGED = ('rotor', 'rotor_speed', 'link_speed', 'interaction_torque', 'command')
SAMPLE_TIME = 1e-3


@dataclass(frozen=True)
class RandomGear:
    """A joint's parameters as drawn, and what a perfect identification would say of it."""

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
    """Draw a joint of a kind of `GEARS`."""
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


def run_gears(parameters, laws, reference, seed=0, released=0, speed=0.0):
    """Run R geared joints under their laws at 1 kHz; return what is `LOGGED`, and the laws' states.

    `reference`, shape (3, N): position and velocity that the person follows, and the direction
    announced. The person lets go at the sample `released`, 0: nobody ever holds the joint; `speed`
    is that at the beginning, rad/s.
    """
    log, _, states = closed_loops(
        np.array(list(parameters)), random_states(seed, len(parameters)),
        np.concatenate(list(laws)), reference, sample_time=SAMPLE_TIME, released=released,
        speed=speed, logged=LOGGED)
    return log, states


def push(acceleration_time, speed, begin, end, announced):
    """Return the reference of a person who sets a joint in motion, shape (3, N).

    The movement begins, the run ends and the direction is announced at these times, s.
    """
    time = np.arange(round(end / SAMPLE_TIME)) * SAMPLE_TIME
    velocity = speed * np.clip((time - begin) / acceleration_time, 0.0, 1.0)
    direction = np.where(time >= announced, math.copysign(1.0, speed), 0.0)
    return np.stack((np.cumsum(velocity) * SAMPLE_TIME, velocity, direction))


def small_model(factor=1.0):
    """Return the model of a drive of 0.1 A, sliding and breaking away."""
    return FrictionModel(
        drive=Drive(0.1, 100.0, 4000), sigmoid=Sigmoid(factor * LEVEL, -factor * LEVEL, 200.0),
        breakaway=Breakaway(factor * LEVEL, -factor * LEVEL), presliding=Presliding(3e-4))
