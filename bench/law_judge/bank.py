# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Gears with their models, and the joints of an experiment made of them."""

from dataclasses import dataclass
import itertools
import math

import numpy as np

from law_judge.model import scaled, STD, true_models
from law_judge.refined import draw_refined


@dataclass
class Bank:
    """Gears of a world, shape (G,), their kinds' names and the documents of their models."""

    world: object
    kinds: list
    gears: np.ndarray
    documents: list
    seed: int

    @property
    def torque(self):
        """True friction at rest of every gear, N·m."""
        return self.gears['static'] + self.gears['link_coulomb']

    def chosen(self, gears, documents):
        """Return a bank of some of the gears, with other models."""
        return Bank(self.world, [self.kinds[g] for g in gears], self.gears[gears], documents,
                    self.seed)

    def seen_by(self, resolution):
        """Return a bank with other encoders, which the models know; rad at the joint, (G,)."""
        gears, documents = self.gears.copy(), []
        gears['resolution'] = resolution
        for gear, old in zip(gears, self.documents):
            drive = old['drive']
            counts = round(2.0 * math.pi / drive['gear_ratio'] / gear['resolution'])
            documents.append({**old, 'drive': {**drive, 'encoder_counts': counts}})
        return Bank(self.world, self.kinds, gears, documents, self.seed)

    def telling(self, known):
        """Return a bank whose models know their presliding distance, or do not.

        Of a gear without presliding there is nothing to know.
        """
        documents = []
        for gear, old in zip(self.gears, self.documents):
            new = {name: value for name, value in old.items() if name != 'presliding'}
            distance, scatter = self.world.presliding(gear)
            if known and 'presliding' in old:
                new['presliding'] = old['presliding']
            elif known and np.isfinite(distance):
                new['presliding'] = {
                    'distance': float(distance),
                    'std': math.hypot(STD * float(distance), scatter)}
            documents.append(new)
        return self.chosen(np.arange(len(self.gears)), documents)


def make_bank(world, kinds, draws, seed, repetitions=24, without=()):
    """Draw gears of several kinds and find their true models.

    `kinds`: sequence of str; of the world's ``KINDS`` or of `REFINED`. `draws`: gears of each kind.
    `seed`: even: for tuning; odd: kept for judging. `repetitions`: slow ramps a gear. `without`:
    sequence of str; properties that are taken from every gear: set to zero, before its model is
    found.
    """
    names, gears, documents = [], [], []
    for kind in kinds:
        if kind in world.KINDS:
            drawn = world.draw_gears(kind, draws, seed)
            for name in set(without) & set(drawn.dtype.names):
                drawn[name] = 0
            found = true_models(world, drawn, seed, repetitions)
        else:
            drawn, found = draw_refined(kind, draws, seed, repetitions)
        names += [kind] * draws
        gears.append(drawn)
        documents += found
    return Bank(world, names, np.concatenate(gears), documents, seed)


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
        self.gear = np.repeat(np.arange(len(bank.gears)), len(combinations))
        self.conditions = {
            name: np.array([c[k] for c in combinations] * len(bank.gears))
            for k, name in enumerate(conditions)}
        self.gears = bank.gears[self.gear]

    def __len__(self):
        return len(self.gear)

    def __getitem__(self, name):
        return self.conditions[name]

    def plant(self, persons, gears=None):
        """Return the world's joints with these persons."""
        return self.bank.world.Plant(self.gears if gears is None else gears, persons,
                                     self.bank.seed)

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

    @property
    def breakaway(self):
        """Mean breakaway current of every joint's model, A."""
        return np.array([
            self.bank.documents[g]['breakaway']['positive']['mean'] for g in self.gear])
