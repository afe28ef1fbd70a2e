# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What tests of several rooms share: the note's drives, loops that drive them, short searches."""

from collections import deque
from contextlib import contextmanager
import copy
from dataclasses import replace
import functools
import math
import os
from pathlib import Path
import re
import subprocess
import sys
import textwrap
from types import SimpleNamespace

import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.files import package_file
from friction_comp.identification.goal import Carried, IdentificationError, IdentificationGoal
from friction_comp.identification.run import IdentificationRun
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import Breakaway, Presliding
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples
from friction_comp.simulation.joint import Plant
from friction_comp.simulation.undeclared import Undeclared

ROOT = Path(__file__).resolve().parent.parent
LEVEL = 0.1     # A
# Of the current ramps on the note's drives, A/s
SLOPES = {1: 0.05, 2: 0.06, 3: 0.12}
# Of a quick identification
GOAL = {'speeds': np.radians([20.0, 60.0, 100.0]).tolist(), 'breakaway_cycles': 2,
        'longest_cycle': 3.0, 'ramp_period': 6.0, 'ramp_slope': 0.08, 'motion_range': 0.8}


@functools.cache
def _note_model(number):
    return FrictionModel.load(package_file('config', f'armin_configuration_{number}.yaml'))


def note_model(number=1, **simulation):
    """Return the model of a drive of the note, with other entries for its simulation."""
    model = copy.deepcopy(_note_model(number))
    model.simulation.update(simulation)
    return model


def small_model(factor=1.0):
    """Return the model of a drive of `LEVEL`, sliding and breaking away."""
    return FrictionModel(
        drive=Drive(0.1, 100.0, 4000), sigmoid=Sigmoid(factor * LEVEL, -factor * LEVEL, 200.0),
        breakaway=Breakaway(factor * LEVEL, -factor * LEVEL), presliding=Presliding(3e-4))


def sines(time, waves):
    """Return position, velocity and acceleration of a sum of sines.

    Each is given by its amplitude in rad, its frequency in rad/s and its phase.
    """
    size, rate, phase = np.array(list(waves)).T
    angle = rate * time[:, None] + phase
    return ((size * np.sin(angle)).sum(axis=1), (size * rate * np.cos(angle)).sum(axis=1),
            -(size * rate ** 2 * np.sin(angle)).sum(axis=1))


def swings(seed, duration=40.0, step=0.01, frequencies=(0.09, 0.23, 0.41), size=None, coulomb=0.5,
           viscous=0.2, inertia=0.0, width=0.01, noise=0.02):
    """Return samples of a joint that swings, with a plain drive's current and some noise.

    Its position is a sum of sines, Hz, each of 0.4 rad or of `size` rad/s over its frequency.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, step)
    q, v, a = sines(time, ((0.4 if size is None else size / frequency, 2.0 * np.pi * frequency,
                            rng.uniform(0.0, 2.0 * np.pi)) for frequency in frequencies))
    current = coulomb * np.tanh(v / width) + viscous * v + inertia * a
    return Samples(time=time, position=q, velocity=v, acceleration=a,
                   current=current + noise * rng.standard_normal(time.size))


def undocumented(report):
    """Return the entries of a report that the page on reports does not name."""
    page = (ROOT / 'docs' / 'reports.md').read_text(encoding='utf-8')
    return set(report) - set(re.findall(r'`(\w+)`', page)) - {'version'}


def printed_by(code, **environment):
    """Return what code prints in a process of its own, in which nothing is loaded yet."""
    done = subprocess.run(
        [sys.executable, '-c', textwrap.dedent(code)], cwd=ROOT, text=True, capture_output=True,
        check=False, timeout=300, env={**os.environ, **environment})
    assert done.returncode == 0, done.stderr
    return done.stdout


def drive_along(law, places, direction=1, begin=0, velocity=None, is_pushed=False):
    """Return a law's currents for a joint that goes from place to place, rad, every millisecond.

    The direction announced, and whether a push is felt, is one for all samples or one for each.
    """
    directions, pushes = np.broadcast_to(direction, len(places)), np.broadcast_to(
        is_pushed, len(places))
    return np.array([
        law.update(1e-3 * (begin + k), [x], None if velocity is None else [velocity], [d],
                   is_pushed=[felt])[0]
        for k, (x, d, felt) in enumerate(zip(places, directions, pushes))])


class Bench:
    """A simulated joint whose sensors, or whose surroundings, may be wrong.

    `alter` changes a sample, or returns None for one that is lost; `torque` acts from outside;
    commands are `late` by some samples, and limited to `most`; `carried` returns the current that
    holds the joint.
    """

    def __init__(self, alter=lambda run, sample: sample, torque=lambda run, state: 0.0, seed=3,
                 late=0, step=4e-3, drive=None, model=None, plant=None, most=math.inf, run=None,
                 carried=lambda position: 0.0, **goal):
        self.model = model or note_model()
        self.alter, self.torque, self.carried = alter, torque, carried
        self.plant = plant or Plant([self.model], seed=seed, sample_time=step)
        self.run = run or IdentificationRun(
            IdentificationGoal(**{**GOAL, **goal}), drive or self.model.drive)
        self.largest = self.fastest = self.farthest = command = 0.0
        self.marks, self.rows, self.waiting, self.most = [], [], deque([command] * late), most

    def finish(self, longest=400.0):
        run, state, command = self.run, self.plant.state, 0.0
        while not run.finished and state.time < longest:
            self.farthest = max(self.farthest, abs(state.position[0]))
            self.fastest = max(self.fastest, abs(state.velocity[0]))
            sample = self.alter(run, [
                state.time, state.position[0], state.velocity[0], state.current[0]])
            if sample is not None:
                command = run.update(*sample, self.carried(sample[1]))
            self.marks.append((state.time, run.progress, run.remaining, run.phase))
            self.rows.append((state.time, state.position[0], command))
            self.largest = max(self.largest, abs(command))
            # A torque from outside acts on the joint as a current does, but is not measured.
            push = self.torque(run, state) / self.model.drive.torque_per_current
            self.waiting.append(max(-self.most, min(self.most, command)))
            state = self.plant.step([self.waiting.popleft() + push])
            state.current[0] -= push
        return run.result() if isinstance(run, IdentificationRun) else None

    def refused(self, words):
        with pytest.raises(IdentificationError, match=words) as caught:
            self.finish()
        assert self.run.phase == 'failed'
        assert self.run.error == str(caught.value)
        return self.run.error


def under_weight(model, weight, phase):
    """Return a plant whose joint carries a weight, A, and the current that its model carries."""
    amplitude = weight * model.drive.torque_per_current
    plant = Plant([model], seed=5, sample_time=4e-3, undeclared=[Undeclared.from_effects([
        {'name': 'gravity', 'parameters': {'amplitude': amplitude, 'phase': phase}}])])
    gravity = EFFECTS['gravity']({'coefficients': [
        weight * np.sin(phase), weight * np.cos(phase)]})
    carried = Carried(['joint'], [replace(model, effects=[gravity])])
    return plant, carried, lambda position: float(carried.at(np.array([position]))[0])


@contextmanager
def short_search(generations=2):
    """Search for plans for a few generations only: how good they are does not matter."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr('friction_comp.excitation.plan._GENERATIONS', generations)
        yield


def joint_state(stamp, names, position, velocity=None):
    """Return a sensor_msgs/JointState without ROS; the stamp is in ns, velocity by default zero."""
    sec, nanosec = divmod(int(stamp), 10**9)
    return SimpleNamespace(
        header=SimpleNamespace(stamp=SimpleNamespace(sec=sec, nanosec=nanosec)), name=list(names),
        position=list(position), effort=[0.0] * len(names),
        velocity=[0.0] * len(names) if velocity is None else list(velocity))


def swing(count=2000, step=0.001):
    """Return time, position and velocity of a joint that swings."""
    time = step * np.arange(count)
    return time, 0.4 * np.sin(2.0 * time), 0.8 * np.cos(2.0 * time)


def write(path, separator=',', **columns):
    """Write a table of columns by name; return its path."""
    np.savetxt(path, np.column_stack(list(columns.values())), '%.16g', separator,
               header=separator.join(columns), comments='')
    return path
