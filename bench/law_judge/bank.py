# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Gears with their models, and the joints of an experiment made of them.

A model is what a perfect identification would write: Eq. 6 is fitted to the world's own steady
friction, breakaway is what its own slow ramps find. Or it is what identification finds.
"""

from dataclasses import dataclass
import itertools
import math

import numpy as np
from scipy.optimize import minimize

from friction_comp import Drive, FrictionModel, IdentificationGoal, IdentificationRun
from world.person import nobody

DEGREE = math.pi / 180.0
SPEEDS = np.array([1, 2, 3, 5, 7.5, 10, 15, 20, 30, 40, 50, 60, 70, 80, 90, 100]) * DEGREE
# A model's transition cannot be sharper than the slowest speed of identification shows.
STEEPEST = 4.0 / SPEEDS[0]
# How sure a model says that its presliding is, as a share; what identification is off by.
STD = 0.1
SEEN = 3.0      # the least backlash that a model knows, counts
RATIO = 100.0   # only products with the ratio matter to a law
# What identification is asked for: speeds in rad/s, the period of a current ramp in s, and ramps a
# direction.
ASKED = np.array([3, 10, 40, 90]) * DEGREE
PERIOD, CYCLES = 6.0, 8


@dataclass
class Bank:
    """Gears of a world, shape (G,), their kinds' names and the documents of their models.

    `part`: the share of each gear's conditions that experiments try, drawn at random.
    """

    world: object
    kinds: list
    gears: np.ndarray
    documents: list
    seed: int
    part: float = 1.0

    @property
    def torque(self):
        """True friction at rest of every gear, N·m."""
        return self.gears['static'] + self.gears['link_coulomb']

    def chosen(self, gears, documents):
        """Return a bank of some of the gears, with other models."""
        return Bank(self.world, [self.kinds[g] for g in gears], self.gears[gears], documents,
                    self.seed, self.part)

    def seen_by(self, resolution):
        """Return a bank with other encoders, which the models know; rad at the joint, (G,)."""
        gears, documents = self.gears.copy(), []
        gears['resolution'] = resolution
        for gear, old in zip(gears, self.documents):
            counts = round(2.0 * math.pi / old['drive']['gear_ratio'] / gear['resolution'])
            documents.append({**old, 'drive': {**old['drive'], 'encoder_counts': max(1, counts)}})
        return Bank(self.world, self.kinds, gears, documents, self.seed, self.part)

    def telling(self, known):
        """Return a bank whose models know their presliding distance, or do not.

        Of a gear without presliding there is nothing to know.
        """
        documents = []
        for gear, old in zip(self.gears, self.documents):
            new = {name: value for name, value in old.items() if name != 'presliding'}
            if known:
                new.update({'presliding': old['presliding']} if 'presliding' in old
                           else told_presliding(self.world, gear))
            documents.append(new)
        return self.chosen(np.arange(len(self.gears)), documents)


def make_bank(world, kinds, draws, seed, change=None, part=1.0):
    """Draw gears of several of the world's kinds and find their true models.

    `draws`: gears of each kind. `seed`: even: for tuning; odd: kept for judging. `change`:
    callable, optional; what changes the gears in place, before their models are found. `part`: as
    for `Bank`.
    """
    names = [kind for kind in kinds for _ in range(draws)]
    gears = np.concatenate([world.draw_gears(kind, draws, seed) for kind in kinds])
    if change is not None:
        change(gears)
    return Bank(world, names, gears, true_models(world, gears, seed), seed, part)


class Joints:
    """Every gear of a bank under every combination of conditions.

    `conditions`: dict of str to sequence; ``factor`` scales the model's friction,
    ``breakaway_factor`` its breakaway current where that is another; what else there is belongs to
    the experiment. `gear`: ndarray of int, shape (J,); index into the bank. `gears`, `models`: as
    in the bank, one a joint.
    """

    def __init__(self, bank, **conditions):
        self.bank = bank
        combinations = list(itertools.product(*conditions.values()))
        number = max(1, round(bank.part * len(combinations)))
        self.gear = np.repeat(np.arange(len(bank.gears)), number)
        random = np.random.default_rng([bank.seed, 11])
        chosen = np.sort([random.permutation(len(combinations))[:number] for _ in bank.gears])
        self.conditions = {name: np.array([combination[k] for combination in combinations])[
            chosen.ravel()] for k, name in enumerate(conditions)}
        self.gears = bank.gears[self.gear]

    def __len__(self):
        return len(self.gear)

    def __getitem__(self, name):
        return self.conditions[name]

    def plant(self, persons, gears=None):
        """Return the world's joints with these persons."""
        return self.bank.world.Plant(self.gears if gears is None else gears, persons,
                                     self.bank.seed)

    def each(self, values):
        """Return the mean over the joints of each gear."""
        return np.bincount(self.gear, values) / np.bincount(self.gear)

    @property
    def sides(self):
        """+1 and -1 in turn."""
        return np.where(np.arange(len(self)) % 2 == 0, 1.0, -1.0)

    @property
    def models(self):
        """FrictionModel of every joint."""
        factor = self.conditions.get('factor', np.ones(len(self)))
        breakaway = self.conditions.get('breakaway_factor', factor)
        made, models = {}, []
        for key in zip(self.gear.tolist(), factor.tolist(), breakaway.tolist()):
            if key not in made:
                made[key] = scaled(self.bank.documents[key[0]], key[1], key[2])
            models.append(made[key])
        return models

    @property
    def torque(self):
        """True friction at rest of every joint, N·m."""
        return self.bank.torque[self.gear]


# True models.

def true_models(world, gears, seed, repetitions=24):
    """Return the documents of the model files of gears, shape (J,), as `scaled` takes them.

    Every other one knows its presliding distance, and its backlash if the encoder shows it.
    `repetitions`: slow ramps a gear.
    """
    currents = world.breakaway_currents(gears, seed, repetitions)
    documents = []
    for k, (gear, measured) in enumerate(zip(gears, currents)):
        tables = [world.steady_friction(gear, SPEEDS, side) for side in (1.0, -1.0)]
        level, steepness, viscous = fit_sigmoid(SPEEDS, np.mean(tables, axis=0))
        more = float(np.mean(tables[0] - tables[1])) / 2.0
        documents.append({
            'format': 'friction_comp_model', 'version': 1, 'joint': 'judged',
            'drive': {'torque_constant': float(gear['torque_per_current'] / RATIO),
                      'gear_ratio': RATIO,
                      'encoder_counts': round(2.0 * math.pi / gear['resolution'] / RATIO),
                      'current_limit': float(gear['current_limit'])},
            'sigmoid': {'velocity_unit': 'rad/s', 'coefficients': [
                float(c) for c in (level + more, steepness, level - more, 1.0, 1.0, viscous)]},
            'breakaway': {
                name: {'mean': sign * float(np.mean(found)), 'std': float(np.std(found, ddof=1))}
                for name, sign, found in (('positive', 1.0, measured[::2]),
                                          ('negative', -1.0, measured[1::2]))},
            'effects': [],
            'lookup_table': {
                'speeds': [*(-SPEEDS[::-1]).tolist(), *SPEEDS.tolist()],
                'currents': [*(-tables[1][::-1]).tolist(), *tables[0].tolist()],
                'standard_deviations': [0.01 * float(np.mean(measured))] * (2 * len(SPEEDS))},
            **(told_presliding(world, gear) if k % 2 == 1 else {})})
    return documents


def fit_sigmoid(speeds, currents):
    """Return level, steepness and viscous slope of Eq. 6 by Eq. 7, the same both ways."""
    def error(x):
        level, steepness, viscous = np.exp(x)
        steepness = min(steepness, STEEPEST)
        return np.sum(np.abs(level * np.tanh(0.5 * steepness * speeds) + viscous * speeds
                             - currents))
    slope, level = np.polyfit(speeds[3:], currents[3:], 1)
    start = np.log([max(level, 1e-6), 0.8 * STEEPEST, max(slope, 1e-4 * level)])
    found = minimize(error, start, method='Nelder-Mead',
                     options={'xatol': 1e-5, 'fatol': 1e-9, 'maxiter': 2000}).x
    level, steepness, viscous = np.exp(found)
    return level, min(steepness, STEEPEST), viscous


def told_presliding(world, gear):
    """Return what a model file says of the gear's presliding, as a part of its document."""
    distance, scatter = world.presliding(gear)
    if not np.isfinite(distance):
        return {}
    told = {'distance': float(distance), 'std': math.hypot(STD * float(distance), scatter)}
    if gear['backlash'] >= SEEN * gear['resolution']:
        told['backlash'] = float(gear['backlash'])
    return {'presliding': told}


def scaled(document, sliding=1.0, breakaway=1.0):
    """Return the model with its friction times factors, as an error of identification."""
    new = dict(document)
    c = list(document['sigmoid']['coefficients'])
    for k in (0, 2, 5):
        c[k] *= sliding
    new['sigmoid'] = {**document['sigmoid'], 'coefficients': c}
    new['breakaway'] = {
        side: {'mean': entry['mean'] * breakaway, 'std': entry['std']}
        for side, entry in document['breakaway'].items()}
    table = document['lookup_table']
    new['lookup_table'] = {**table, 'currents': [sliding * i for i in table['currents']]}
    return FrictionModel.from_dict(new)


# Identified models.

def identified_bank(bank):
    """Return the bank with the models that identification finds, and what it refused."""
    runs = []
    for document in bank.documents:
        level = document['breakaway']['positive']['mean']
        # Twice the level at the end of the ramp, as in the note.
        runs.append(IdentificationRun(IdentificationGoal(
            speeds=tuple(ASKED), motion_range=1.0, ramp_slope=2.0 * level / (0.4 * PERIOD),
            ramp_period=PERIOD, breakaway_cycles=CYCLES, longest_cycle=10.0),
            Drive(**document['drive'])))
    plant = bank.world.Plant(bank.gears, nobody(len(runs)), bank.seed)
    command, refused = np.zeros(len(runs)), {}
    waiting = set(range(len(runs)))
    while waiting and plant.time < 1200.0:
        position, velocity = plant.sample()
        for j in tuple(waiting):
            try:
                command[j] = runs[j].update(
                    plant.time, position[j], velocity[j], plant.states['current'][j])
            except Exception as error:
                refused[j], command[j] = str(error), 0.0
            if j in refused or runs[j].finished:
                waiting.discard(j)
        plant.advance(command)
    kept, documents = [], []
    for j, (run, document) in enumerate(zip(runs, bank.documents)):
        try:
            found = run.result().model(Drive(**document['drive'])).to_dict()
        except Exception as error:
            refused.setdefault(j, str(error))
            continue
        kept.append(j)
        documents.append({**found, 'effects': []})
    return bank.chosen(kept, documents), [
        f'{bank.kinds[j]} {j}: {why}' for j, why in refused.items()]
