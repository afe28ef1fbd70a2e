# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Random joints and persons of the third kind, and the models that their own friction gives.

Ranges: harmonic-drive joints of sizes 14 to 20 (catalogue stiffness 3 to 25 kN·m/rad, ratios 50 to
160), rotors and links of 0.03 to 0.4 kg·m², presliding of 0.08 to 1 mrad at the joint, damping of a
tenth to six tenths of critical, static friction 0.95 to 1.15 of sliding friction, encoders of 2000
to 8192 counts a motor turn. Even seeds are for tuning on, odd ones are kept.
"""

from dataclasses import replace
import math

import numpy as np

from friction_comp.compensation.law import CompensationLaw
from friction_comp.compensation.records import STATE as LAW_STATE
from friction_comp.drive import Drive
from friction_comp.identification.sigmoid_fit import fit_sigmoid
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import Breakaway, FrictionModel, Presliding
from friction_comp.model.sigmoid import Sigmoid
from third_gear.plant import COULOMB, DRAWS, ELEMENTS, JOINT, LOG, run, STATE, WAVES

DEGREE = math.pi / 180.0
SPEEDS = np.radians([2.0, 4.0, 8.0, 15.0, 25.0, 40.0, 60.0, 80.0, 100.0])
PERSONS = ('soft', 'firm', 'leaning', 'trembling')


class Gear:
    """A joint, its gear ratio and its true model."""

    def __init__(self, seed):
        self.seed, self.kind = seed, seed // 2 % 3
        self.joint, self.ratio = random_joint(seed, self.kind)
        counts = round(2.0 * math.pi / (self.joint['count'] * self.ratio))
        self.drive = Drive(self.joint['torque'] / self.ratio, float(self.ratio), counts)
        self.model = true_model(self)

    def gravity(self):
        """Return the effect of gravity, where there is any."""
        weight = [float(self.joint[name] / self.joint['torque'])
                  for name in ('gravity_cos', 'gravity_sin')]
        return [EFFECTS['gravity']({'coefficients': weight})] if any(weight) else []


def random_joint(seed, kind):
    """Return the record of a joint, and its gear ratio."""
    rng = np.random.default_rng([seed, kind, 77])
    g = np.zeros(1, JOINT)[0]

    def between(low, high):
        return math.exp(rng.uniform(math.log(low), math.log(high)))

    ratio = int(rng.choice([50, 80, 100, 120, 160]))
    g['kind'], g['presence'] = kind, 1.0
    level = g['level'] = between(0.6, 6.0)
    g['rotor'], g['link'] = between(0.03, 0.25), between(0.03, 0.4)
    g['stiffness'] = between(3e3, 2.5e4)
    g['hardening'] = g['stiffness'] * rng.uniform(0.0, 1.0) / 1.5e-3 ** 2
    g['damping'] = rng.uniform(0.02, 0.1) * 2.0 * math.sqrt(
        g['stiffness'] * g['rotor'] * g['link'] / (g['rotor'] + g['link']))
    g['static_ratio'] = rng.uniform(0.95, 1.15)
    g['stribeck_speed'], g['stribeck_power'] = between(0.004, 0.05), rng.uniform(0.7, 2.0)
    g['viscous_power'] = rng.uniform(0.6, 1.0)
    g['viscous'] = rng.uniform(0.1, 0.9) * level / SPEEDS[-1] ** g['viscous_power']
    g['link_share'] = rng.uniform(0.25, 0.6) if kind == COULOMB else rng.uniform(0.0, 0.25)
    presliding, own = between(8e-5, 1e-3), level * (1.0 - g['link_share'])
    g['bristle'] = own / presliding
    g['micro_damping'] = rng.uniform(0.1, 0.6) * 2.0 * math.sqrt(g['bristle'] * g['rotor'])
    g['stuck_share'] = rng.uniform(0.5, 0.85)
    shares = rng.dirichlet(np.full(ELEMENTS, 3.0))
    reach = presliding * np.linspace(0.15, 1.3, ELEMENTS) ** rng.uniform(0.8, 1.5)
    g['element_share'], g['element_stiffness'] = shares, own * shares / reach
    g['relaxation'] = between(0.002, 0.02)
    g['mesh_size'], g['mesh_waves'] = rng.uniform(0.0, 0.03), 2.0 * ratio
    g['slow_size'], g['slow_waves'] = rng.uniform(0.0, 0.03), rng.uniform(2.0, 12.0)
    g['mesh_phase'], g['slow_phase'] = rng.uniform(0.0, 2.0 * math.pi, 2)
    g['field_size'] = rng.uniform(0.0, 0.025) / math.sqrt(WAVES / 2.0)
    g['field_waves'] = 2.0 * math.pi / rng.uniform(3e-3, 3e-2, WAVES)
    g['field_phase'] = rng.uniform(0.0, 2.0 * math.pi, WAVES)
    g['rest_std'], g['dwell'] = rng.uniform(0.0, 0.02), rng.uniform(0.0, 0.05)
    g['load_share'] = rng.uniform(0.0, 0.05)
    g['heat_share'], g['heat_energy'] = rng.uniform(0.0, 0.04), between(30.0, 300.0)
    g['torque'] = level / rng.uniform(0.08, 0.35)
    g['lag'], g['delay'] = 1.0 / (2.0 * math.pi * between(150.0, 800.0)), rng.integers(0, 2)
    g['stall'], g['fastest'] = 3.0, rng.uniform(130.0, 260.0) * DEGREE
    g['count'] = 2.0 * math.pi / (ratio * rng.choice([2000, 4000, 8192]))
    g['cogging'] = rng.uniform(0.0, 0.015) * level
    g['velocity_filter'] = 1.0 / (2.0 * math.pi * between(20.0, 150.0))
    g['noise'] = rng.uniform(0.001, 0.005)
    if rng.uniform() < 1.0 / 3.0:
        angle, weight = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(0.5, 2.0) * level
        g['gravity_cos'], g['gravity_sin'] = weight * math.cos(angle), weight * math.sin(angle)
    g['draws'] = rng.standard_normal(DRAWS)
    return g, ratio


def with_person(gear, name):
    """Return the gear's joint with a person whose hand friction alone would bend by degrees."""
    rng = np.random.default_rng([gear.seed, PERSONS.index(name), 5])
    g = gear.joint.copy()
    bend = rng.uniform(3.0, 8.0) if name == 'firm' else rng.uniform(8.0, 25.0)
    g['arm'] = rng.uniform(0.1, 0.4)
    g['cuff'], g['hand_lag'] = rng.uniform(30.0, 200.0), rng.uniform(0.03, 0.06)
    g['cuff_damping'] = rng.uniform(0.2, 0.6) * math.sqrt(g['cuff'] * g['arm'])
    moved = g['arm'] + g['link'] + g['rotor']
    # No stiffer than an arm with this lag holds steadily.
    g['hand_stiffness'] = min(g['level'] / (bend * DEGREE), 0.15 * moved / g['hand_lag'] ** 2)
    damping = rng.uniform(0.7, 1.1) * 2.0 * math.sqrt(g['hand_stiffness'] * moved)
    g['hand_damping'] = min(damping, 0.5 * moved / g['hand_lag'])
    if name == 'leaning':
        g['lean'] = rng.uniform(0.2, 0.5) * g['level'] * rng.choice([-1.0, 1.0])
    if name == 'trembling':
        g['tremor'] = rng.uniform(0.04, 0.12) * g['level']
        g['tremor_speed'] = 2.0 * math.pi * rng.uniform(4.0, 8.0)
    return g


def log_of(g, model, law, samples, places=None, speeds=None, directions=None, feed=None,
           every=1, fault=0, state=None):
    """Run a joint under a law; return what `plant.LOG` names, each of shape (samples,).

    A person is attached where `places` are given, in rad.
    """
    zeros = np.zeros(samples)
    log = np.zeros((len(LOG), samples))
    run(np.array([g], JOINT), np.zeros(1, STATE) if state is None else state,
        CompensationLaw([model], law).parameters, np.zeros(1, LAW_STATE),
        zeros if places is None else places, zeros if speeds is None else speeds,
        zeros if directions is None else np.asarray(directions, float),
        zeros if feed is None else feed, places is not None, every, fault, log)
    return dict(zip(LOG, log))


def true_model(gear, cycles=10):
    """Return the model of a joint: sliding friction by formula, the rest by ramps without noise."""
    g = gear.joint.copy()
    g['gravity_cos'] = g['gravity_sin'] = 0.0
    curve = g['level'] * (1.0 + (g['static_ratio'] - 1.0) * np.exp(
        -(SPEEDS / g['stribeck_speed']) ** g['stribeck_power']))
    curve = curve * (1.0 + g['load_share'] * g['link_share'])
    curve += g['viscous'] * SPEEDS * (SPEEDS ** 2 + 1e-4) ** (0.5 * g['viscous_power'] - 0.5)
    speeds = np.concatenate((-SPEEDS[::-1], SPEEDS))
    currents = np.concatenate((-curve[::-1], curve)) / g['torque']
    rng = np.random.default_rng([gear.seed, 3])
    found = {side: np.array([ramp(gear, g, side, 1 if cycle % 2 else -1, rng)
                             for cycle in range(cycles)]) for side in (1, -1)}
    levels = {side: values[:, 0] / g['torque'] for side, values in found.items()}
    return FrictionModel(
        drive=gear.drive, sigmoid=fit_sigmoid(speeds, currents)[0], effects=gear.gravity(),
        breakaway=Breakaway(levels[1].mean(), -levels[-1].mean(), levels[1].std(ddof=1),
                            levels[-1].std(ddof=1)),
        presliding=Presliding(max(1e-6, np.concatenate(list(found.values()))[:, 1].mean())),
        lookup_table={'speeds': speeds.tolist(), 'currents': currents.tolist()})


def ramp(gear, g, side, before, rng):
    """Return breakaway friction in N·m and the way to 95 % of it in rad, after a slide `before`.

    Breakaway is the most that friction takes while the rotor is slower than 4 mrad/s.
    """
    state = np.zeros(1, STATE)
    state['rotor'] = state['link'] = rng.uniform(-0.4, 0.4)
    state['rotor_speed'] = state['link_speed'] = 0.15 * before
    state['rests'] = rng.integers(DRAWS)
    time = np.arange(5000) * 1e-3
    top = 1.6 * g['level'] * g['static_ratio'] / g['torque']
    idle = FrictionModel(drive=gear.drive, sigmoid=Sigmoid(0.1, -0.1, 200.0))
    log = log_of(g, idle, 'none', 5000, feed=side * top * np.maximum(0.0, time - 1.0) / 4.0,
                 state=state)
    way = side * (log['rotor'] - log['rotor'][999])
    fast = np.flatnonzero((time > 1.0) & ((side * log['rotor_speed'] > 0.004) | (way > 0.02)))
    end = fast[0] if len(fast) else len(time) - 1
    taken = np.convolve(side * log['friction'][999:end], np.full(5, 0.2), 'valid')
    return taken.max(), way[1001 + int(np.argmax(taken >= 0.95 * taken.max()))]


def wrong_by(model, factor):
    """Return the model with all its friction times a factor."""
    s, b = model.sigmoid, model.breakaway
    table = dict(model.lookup_table)
    table['currents'] = [factor * value for value in table['currents']]
    return replace(
        model, lookup_table=table,
        sigmoid=replace(s, upper=factor * s.upper, lower=factor * s.lower,
                        viscous=factor * s.viscous),
        breakaway=replace(b, **{name: factor * getattr(b, name) for name in (
            'positive_mean', 'negative_mean', 'positive_std', 'negative_std')}))
