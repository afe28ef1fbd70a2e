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
from friction_comp.errors import InputError
from friction_comp.model.friction_model import Breakaway, FrictionModel, Presliding
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.simulation.gear_kernel import CLAMP, ELEMENTS, GEAR, LUGRE, MAXWELL_SLIP

KINDS = {'clamp': CLAMP, 'lugre': LUGRE, 'maxwell_slip': MAXWELL_SLIP}


@dataclass(frozen=True)
class RandomGear:
    """A joint as it was drawn.

    Parameters
    ----------
    parameters : record of gear_kernel.GEAR
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

    Raises
    ------
    InputError
        If there is no such kind.
    """
    if kind not in KINDS:
        raise InputError(f'gear must be one of {", ".join(KINDS)}, not {kind!r}')
    rng = np.random.default_rng([seed, KINDS[kind], 77])

    def spread(low, high):
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
    p = gear_parameters(
        model, inertia=level / spread(5.0, 20.0), rotor_share=rng.uniform(0.5, 0.9),
        resonance=spread(15.0, 60.0), gear_damping=spread(0.02, 0.1))
    p['kind'] = KINDS[kind]
    p['stribeck_velocity'] = math.radians(spread(0.2, 3.0))
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


def gear_parameters(model: FrictionModel, inertia: float, rotor_share: float = 0.8,
                    resonance: float = 40.0, gear_damping: float = 0.05) -> np.void:
    """Return the parameters of a joint of two inertias for a model's drive and friction.

    Parameters
    ----------
    model : FrictionModel
        With breakaway currents.
    inertia : float
        Of rotor and link together, kg·m² at the joint.
    rotor_share : float
        The rotor's part of it.
    resonance : float
        Of rotor against link on the gear's compliance, Hz.
    gear_damping : float
        Share of critical damping of that.

    Returns
    -------
    record of gear_kernel.GEAR
        A stiff clamp; `set_presliding` and the fields `kind` and `delay` make others of it.
    """
    both, scale = model.breakaway, model.drive.torque_per_current
    if both is None:
        raise InputError('a simulated gear needs breakaway currents')
    p = np.zeros(1, GEAR)[0]
    p['torque_per_current'], p['limit'] = scale, model.drive.current_limit
    p['resolution'] = model.drive.position_resolution or 0.0
    p['motor_inertia'], p['link_inertia'] = rotor_share * inertia, (1.0 - rotor_share) * inertia
    reduced = rotor_share * (1.0 - rotor_share) * inertia
    p['stiffness'] = reduced * (2.0 * math.pi * resonance) ** 2
    p['damping'] = 2.0 * gear_damping * math.sqrt(p['stiffness'] * reduced)
    sigmoid = model.sigmoid
    for name in ('upper', 'lower', 'viscous'):
        p[name] = getattr(sigmoid, name) * scale
    p['steepness'], p['shift'] = sigmoid.steepness, sigmoid.shift
    p['break_positive'], p['std_positive'] = both.positive_mean * scale, both.positive_std * scale
    p['break_negative'], p['std_negative'] = -both.negative_mean * scale, both.negative_std * scale
    p['stribeck_velocity'], p['human_response'] = math.radians(1.0), 0.04
    p['friction_factor'] = 1.0
    p['current_noise'] = 0.01 * max(both.positive_mean, -both.negative_mean)
    set_presliding(p, 2e-4, np.ones(1), 0.5)
    return p


def set_presliding(p: np.void, distance: float, shares: np.ndarray, damping: float) -> None:
    """Set how the gear gives before it slides.

    Parameters
    ----------
    p : record of gear_kernel.GEAR
        Changed in place.
    distance : float
        rad; of the Maxwell-slip element that slips last, or g_b/σ0 of LuGre.
    shares : ndarray, shape (n,)
        Of the Maxwell-slip elements, whose distances lie evenly up to `distance`; they are scaled
        to a sum of 1.
    damping : float
        Share of critical damping of the rotor on the unslipped elements.
    """
    count = len(shares)
    shares = np.asarray(shares, dtype=float) / np.sum(shares)
    distances = distance * np.arange(1, count + 1) / count
    p['elements'] = count
    p['share'][:count], p['distance'][:count] = shares, distances
    level = 0.5 * (p['break_positive'] + p['break_negative'])
    p['bristle_stiffness'] = level / distance
    p['bristle_damping'] = 2.0 * damping * math.sqrt(
        level * float(np.sum(shares / distances)) * p['motor_inertia'])
