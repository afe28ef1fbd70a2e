# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The scene of the demo in which a hand moves a joint to and fro."""

from __future__ import annotations

from dataclasses import replace

from friction_comp.demo.exercises import PERSON
from friction_comp.demo.loop import JOINT, recorded, TRUE_MODEL
from friction_comp.demo.pages import HandTrial, to_and_fro_page
from friction_comp.demo.processes import SAMPLE_TIME
from friction_comp.demo.system import DemoSystem
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.package_files import package_file

# Folder, title, law, and whether the exercise announces the direction.
WAYS = (('none', 'no help', 'none', False),
        ('tanh', '0.9 · Coulomb · tanh', 'kinetic', False),
        ('unknown', 'continuous, d = 0', 'continuous', False),
        ('announced', 'continuous, announced', 'continuous', True))


def play_to_and_fro(system: DemoSystem) -> None:
    """Lead a joint to and fro without help, with a hyperbolic tangent, and with the law."""
    system.log('starts a simulated joint with a firm hand, and the compensator')
    model, tanh = (system.output / 'models' / f'{name}.yaml' for name in (JOINT, 'tanh'))
    own = FrictionModel.load(TRUE_MODEL)
    own = replace(own, simulation={**own.simulation, 'human': PERSON})
    own.save(model)
    level = 0.45 * (own.sigmoid.upper - own.sigmoid.lower)
    # Eq. 6 is a hyperbolic tangent, which bends at 0.03 rad/s; the printed law adds nothing to it.
    replace(own, sigmoid=Sigmoid(level, -level, 2.0 / 0.03)).save(tanh)
    system.start_plant([JOINT], [model], wrench_period=SAMPLE_TIME, clock_period=2.0 * SAMPLE_TIME)
    system.start('compensator', model, law='continuous')
    for name, title, law, announced in WAYS:
        system.ros.set_parameter('compensator', 'model_files', [
            str(tanh if name == 'tanh' else model)])
        system.ros.set_parameter('compensator', 'law', law)
        system.record(name, title, announce_direction=announced,
                      exercise_file=package_file('config', 'exercises', 'to_and_fro.yaml'))
    system.nodes.stop('compensator', 'plant')

    trials = {name: HandTrial(title, recorded(system.recording(name)))
              for name, title, *_ in WAYS}
    inertia = trials['none'].inertial_rms(own.simulation['inertia'])
    shares = {name: trial.removed(trials['none'], inertia) for name, trial in trials.items()}
    system.finish(
        to_and_fro_page(trials, inertia),
        {'to_and_fro': [{'name': name, 'rms_torque': trial.rms, 'removed': shares[name]}
                        for name, trial in trials.items()], 'inertia_rms': inertia},
        *(f'{trial.title}: the hand gives {trial.rms:.2f} N·m RMS; {100.0 * shares[name]:.0f} % of '
          'friction removed' for name, trial in trials.items()))
