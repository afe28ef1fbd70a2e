# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What refinement names on the recording of one evaluation, which holds six like movements.

    python3 bench/little_motion.py [--seed N] [--draws N] [--jobs N] [--laws none kinetic ...]

A person moves a joint of the note to and fro, three times over 30 to 60 degrees, under a law with
the sigmoid of the joint. Beside inertia the joint has one or two effects, or none, that the model
lacks. Even seeds are for tuning, odd ones for reports. Columns:

named     effects of the joint, inertia among them, that are named
open      of these, those for which the report says what else it may be
false     effects named that it does not have
certain   of these, those said without another that it may be
calm      recordings in which nothing false is named
error     on a longer movement of the same joint without compensation, over the noise; the median
start     the same of the sigmoid fitted to the recording
"""

from bench_tools import processes, table_parser
import numpy as np
from refine_table import moving

from friction_comp.compensation.law import CompensationLaw
from friction_comp.exercise.reference_movement import ReferenceMovement
from friction_comp.model.friction_model import FrictionModel
from friction_comp.package_files import package_file
from friction_comp.refinement import refine
from friction_comp.samples import Samples
from friction_comp.simulation.joint import Plant
from friction_comp.simulation.undeclared import Undeclared
from simulated_recordings.cases import CASES
from simulated_recordings.closed_loop import closed_loop

LAWS = ('none', 'kinetic', 'continuous')
HIDDEN = ('gravity', 'friction_ripple', 'cogging', 'bump', 'direction')
# What effects of refinement they are.
TRUE = {'gravity': 'gravity', 'friction_ripple': 'friction_ripple', 'cogging': 'cogging',
        'bump': 'bump', 'direction': 'direction_asymmetry'}


def joint_of(seed):
    """Return a joint's model, its hidden effects by name, and what the plant needs of them."""
    rng = np.random.default_rng([seed, 21])
    model = FrictionModel.load(package_file(
        'config', f'armin_configuration_{rng.choice([1, 2])}.yaml'))
    model.simulation['current_noise'] = 0.002 * float(rng.uniform(0.5, 2.0))
    names = [str(name) for name in rng.choice(HIDDEN, rng.integers(0, 3), replace=False)]
    level = 0.5 * (model.sigmoid.upper - model.sigmoid.lower) * model.drive.torque_per_current
    effects = [effect for name in names for effect in CASES[name].draw(rng, level)]
    for effect in effects:
        parameters = effect['parameters']
        # Waves and bumps that the movement passes.
        if 'frequency' in parameters:
            parameters['frequency'] = float(np.exp(rng.uniform(np.log(12.0), np.log(80.0))))
        if 'position' in parameters:
            parameters['position'] = float(rng.uniform(0.1, 0.5))
    return model, {TRUE[name] for name in names}, Undeclared.from_effects(effects)


def evaluation(seed, law, amplitude, speed, repetitions=3):
    """Return the samples of a person who moves a joint to and fro."""
    model, _, undeclared = joint_of(seed)
    movement = ReferenceMovement(
        amplitude=amplitude, speed=speed, standstill=1.2, repetitions=repetitions,
        compensated=law == 'continuous')
    log = closed_loop(Plant([model], seed=seed, undeclared=[undeclared]),
                      CompensationLaw([model], law=law), movement, movement.duration)
    return Samples(time=log['time'], position=log['position'][:, 0],
                   velocity=log['velocity'][:, 0], current=log['current'][:, 0],
                   load=log['interaction_torque'][:, 0], temperature=log['temperature'][:, 0])


def own(effect, model):
    """Return whether an effect is the load, which is recorded, or the joint's own presliding."""
    near_rest = 3.0 * model.simulation['stribeck_velocity']
    presliding = 3.0 * model.sigmoid.upper * model.drive.torque_per_current / (
        model.simulation['presliding_stiffness'])
    return (effect.name == 'load_torque'
            or (effect.name == 'stribeck' and effect.parameters['coefficients'][0] > 0.0
            and effect.parameters['velocity'] < near_rest)
            or (effect.name == 'hysteresis' and effect.parameters['distance'] < presliding))


def error(model, samples):
    """Return the error where the joint moves, A."""
    wrong = (model.measured(samples) - model.predict(samples))[moving(samples)]
    return float(np.sqrt(np.mean(wrong ** 2)))


def judged(seed, law):
    """Return what is named on one recording, and how well its model does on another one."""
    rng = np.random.default_rng([seed, 22])
    amplitude, speed = np.radians((rng.uniform(30.0, 60.0), rng.uniform(20.0, 40.0)))
    return judged_on(seed, law, evaluation(seed, law, amplitude, speed),
                     evaluation(seed, 'none', 1.2 * amplitude, 0.7 * speed, 2))


def judged_on(seed, law, samples, other):
    """Return the same for recordings at hand."""
    model, hidden, _ = joint_of(seed)
    result = refine([samples], drive=model.drive)
    found = [effect for effect in result.report.effects if not own(effect, model)]
    noise = model.simulation['current_noise']
    return {'seed': seed, 'law': law, 'wanted': hidden | {'inertia'},
            'named': [effect.name for effect in found],
            'open': [effect.name for effect in found if effect.instead],
            'words': [effect.in_words for effect in result.report.effects],
            'error': error(result.model, other) / noise,
            'start': error(result.start, other) / noise}


def table(draws):
    """Return the table in Markdown, a row for each law."""
    lines = ['| law | recordings | named | open | false | certain | calm | error | start |',
             '|---|---|---|---|---|---|---|---|---|']
    for law in dict.fromkeys(draw['law'] for draw in draws):
        own = [draw for draw in draws if draw['law'] == law]
        false = [sum(name not in draw['wanted'] for name in draw['named']) for draw in own]
        right = sum(len(draw['wanted'] & set(draw['named'])) for draw in own)
        wanted = sum(len(draw['wanted']) for draw in own)
        doubted, doubts = (sum((name in draw['wanted']) == true for draw in own
                               for name in draw['open']) for true in (True, False))
        errors, starts = ([draw[key] for draw in own] for key in ('error', 'start'))
        lines.append(f'| {law} | {len(own)} | {right} of {wanted} | {doubted} '
                     f'| {sum(false)} | {sum(false) - doubts} '
                     f'| {sum(not one for one in false)} | {np.median(errors):.2f} '
                     f'| {np.median(starts):.2f} |')
    return '\n'.join(lines)


def main():
    """Judge each joint under each law."""
    parser = table_parser(__doc__, seed=0, draws=10, jobs=1)
    parser.add_argument('--laws', nargs='+', choices=LAWS, default=LAWS)
    arguments = parser.parse_args()
    seeds = range(arguments.seed, arguments.seed + 2 * arguments.draws, 2)
    tasks = [(seed, law) for law in arguments.laws for seed in seeds]
    with processes(arguments.jobs) as pool:
        draws = list(pool.map(judged, *zip(*tasks)))
    print(table(draws))
    for draw in draws:
        false = sorted(name for name in draw['named'] if name not in draw['wanted'])
        print(f"- seed {draw['seed']}, {draw['law']}: {', '.join(draw['named']) or 'nothing'}; "
              f"missed {', '.join(sorted(draw['wanted'] - set(draw['named']))) or 'nothing'}; "
              f"false {', '.join(false) or 'nothing'}; error {draw['error']:.2f}")


if __name__ == '__main__':
    main()
