# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A case: a joint with hidden effects, how it is moved and recorded, and what may be said."""

from dataclasses import dataclass, field, replace
import zlib

import numpy as np

from second_world import oracle
from world.arm import Chain
from world.drive import Controller, DT, simulate
from world.joint import Joint
from world.motion import KINDS
from world.sensing import record, Sensors


@dataclass(frozen=True)
class Hidden:
    """An effect of the truth: which variables name it rightly, and the joint without it."""

    name: str
    variables: frozenset
    without: dict | None  # fields of `Joint`; None: never judged by how much it shows


@dataclass(frozen=True)
class Case:
    """Everything that makes recordings and judges what is said about them."""

    family: str
    seed: int
    joint: Joint
    controller: Controller
    half_range: float  # rad
    top_speed: float  # rad/s
    motions: tuple  # kinds for fit and for score
    seconds: tuple
    fit_sensors: Sensors  # of both recordings
    chain: Chain = field(default_factory=Chain)
    number: int = 0
    hidden: tuple = ()
    allowed: frozenset = frozenset({'acceleration'})  # no false names though not asked for
    # Names of effects that are wrong here though their variable might pass.
    forbidden: frozenset = frozenset()
    # Of what no library effect describes; one must be named, as effect or residual.
    unexplained: frozenset = frozenset()
    warn: tuple = ()  # one of these word stems must stand in a warning
    load_torque: float = 0.0  # N.m from outside, in both recordings
    heating: float = 0.0  # K of warming, in both recordings
    open_loop: float = 0.0
    nominal: tuple = (0.1, 100.0)  # k_t in N.m/A and n as the user believes them to be
    asks: bool = True  # False where too little can be known to ask for anything
    files: bool = False  # goes through a rosbag2 folder

    def _replace_joint(self, changes):
        return replace(self, joint=self.joint._replace(**changes))


def generator(*keys):
    """Return a random generator of its own for any words and numbers."""
    return np.random.default_rng([k if isinstance(k, int) else zlib.crc32(k.encode())
                                  for k in keys])


def slow_waves(rng, size, fastest):
    """Return a random signal of RMS 1, shape (size,), with waves up to `fastest` Hz."""
    t = np.arange(size) * DT
    out = sum(rng.normal() * np.sin(2 * np.pi * f * t + rng.uniform(0, 2 * np.pi))
              for f in rng.uniform(0.05, fastest, 7))
    return out / oracle.rms(out)


def make(case, part):
    """Return the trace and what is seen of it, for part 'fit' or 'score'."""
    which = ('fit', 'score').index(part)
    rng = generator(case.family, case.seed, part)
    seconds = case.seconds[which]
    reference = KINDS[case.motions[which]](rng, seconds, case.half_range, case.top_speed)
    size = len(reference)
    load = case.load_torque * slow_waves(rng, size, 1.5) if case.load_torque else None
    heat = None
    if case.heating:
        t, start = np.arange(size) * DT, (0.0, 0.4 * case.heating)[which]
        heat = start + (case.heating - start) * (1 - np.exp(-t / (0.4 * seconds)))
    open_loop = case.open_loop * slow_waves(rng, size, 1.0) if case.open_loop else None
    others = None
    count = len(case.chain.mass)
    if count:
        paths = [KINDS['multi_sine'](rng, seconds, case.half_range, case.top_speed)
                 for _ in range(count)]
        q = np.column_stack(paths)
        v = np.gradient(q, DT, axis=0)
        others = np.array([q, v, np.gradient(v, DT, axis=0)])
    trace = simulate(case.joint, case.controller, case.chain, case.number, reference, open_loop,
                     load, heat, others)
    return trace, record(rng, case.fit_sensors, trace, case.number)


def required(case, trace, seen, floor):
    """Return the hidden effects that show enough in the recording to be asked for.

    Enough is 0.4 of the error of the true model, 14 % of what that leaves; with the hundreds of
    samples and more that every case has, an expert with the true model in hand cannot miss it.
    Inertia counts from 0.7 on, since a plain drive's constants take over some of it.
    """
    if not case.asks:
        return []
    asked = [one for one in case.hidden
             if one.without is None
             or oracle.shown(case, trace, seen, one.without) > 0.4 * floor]
    i = np.concatenate(seen.index)[oracle.moving(case, trace, seen)]
    if case.joint.inertia * oracle.rms(trace.a[i]) > 0.7 * floor:
        asked.append(Hidden('inertia', frozenset({'acceleration'}), {'inertia': 0.0}))
    return asked
