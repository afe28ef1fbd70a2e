# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a controller does to the friction read from a recording that does not hold its reference.

    python3 bench/unseen_controller.py

A joint of known Coulomb and viscous friction and inertia, with a ripple that nobody expects, is
moved by controllers that read a coarse or a fine encoder. What plain least squares of current over
the motion finds is printed as a share of the truth, and whether refinement says that friction would
have to push, by which it tells a controller.
"""

import bench_tools  # noqa: F401
from numba import njit
import numpy as np

from friction_comp.drive import Drive
from friction_comp.model.differentiation import differentiate
from friction_comp.refinement.judge import friction_would_push
from friction_comp.refinement.prepare import prepare
from friction_comp.samples import Samples

STEP, INERTIA, COULOMB, VISCOUS, RIPPLE = 1e-3, 0.05, 0.3, 0.1, 0.1
TIME = np.arange(0.0, 40.0, STEP)
# Position, speed and integral gain.
CONTROLLERS = {'stiff position': (60.0, 2.0, 0.0), 'soft position': (6.0, 0.5, 0.0),
               'stiff speed': (0.0, 2.0, 0.0), 'speed with integral': (0.0, 1.0, 20.0),
               'soft speed': (0.0, 0.6, 0.0)}


@njit
def driven(reference, speed, gains, count):
    """Return the encoder's positions and the current of a joint under a controller."""
    place, velocity, integral, slope, last = reference[0], speed[0], 0.0, 0.0, reference[0]
    asked = np.zeros(len(reference) + 2)
    seen = np.empty(len(reference))
    for k in range(len(reference)):
        seen[k] = np.round(place / count) * count
        slope += 0.3 * ((seen[k] - last) / STEP - slope)
        last = seen[k]
        integral += gains[2] * (speed[k] - slope) * STEP
        asked[k + 2] = (gains[0] * (reference[k] - seen[k]) + gains[1] * (speed[k] - slope)
                        + integral)
        for _ in range(10):
            friction = (COULOMB * np.tanh(velocity / 0.005) + VISCOUS * velocity
                        + RIPPLE * np.sin(60.0 * place))
            velocity += (asked[k] - friction) / INERTIA * STEP / 10
            place += velocity * STEP / 10
    # Two samples late, as it is recorded: what acts at a sample was asked for before.
    return seen, asked[:len(reference)]


def motions():
    """Return reference position and speed of motion that varies and of constant speeds."""
    turns = 2.0 * np.pi * np.array([0.11, 0.23, 0.41, 0.83])
    sizes, phases = np.array([0.6, 0.3, 0.2, 0.08]), np.arange(4.0)
    angles = np.outer(TIME, turns) + phases
    varied = np.sin(angles) @ sizes, np.cos(angles) @ (sizes * turns)
    speeds = np.repeat([0.05, -0.1, 0.2, -0.4, 0.6, -0.6, 0.3, -0.2, 0.1, -0.05], 4000)
    return {'sines': varied, 'constant speeds': (np.cumsum(speeds) * STEP, speeds)}


def main():
    """Print one line for each motion, controller and encoder."""
    print('| motion | controller | counts a turn | Coulomb | viscous | inertia | ripple '
          '| told as a controller |\n|' + '---|' * 8)
    rng = np.random.default_rng(1)
    for motion, (reference, speed) in motions().items():
        for name, gains in CONTROLLERS.items():
            for counts in (500_000, 20_000):
                position, current = driven(reference, speed, gains, 2.0 * np.pi / counts)
                current = current + 0.003 * rng.standard_normal(len(current))
                recorded = Samples(time=TIME, position=position, current=current)
                smooth = differentiate(recorded, {'source': 'position', 'bandwidth': 40.0})
                rows = np.abs(smooth.velocity) > 0.02
                columns = np.column_stack((
                    np.tanh(smooth.velocity / 0.005), smooth.velocity, smooth.acceleration,
                    np.sin(60.0 * position), np.cos(60.0 * position)))[rows]
                found = np.linalg.lstsq(columns, current[rows], rcond=None)[0]
                said = friction_would_push(prepare(recorded, Drive(1.0, 1.0))[0]) or 'no'
                print(f'| {motion} | {name} | {counts} | {found[0] / COULOMB:.2f} '
                      f'| {found[1] / VISCOUS:.2f} | {found[2] / INERTIA:.2f} '
                      f'| {np.hypot(*found[3:]) / RIPPLE:.2f} | {said} |')


if __name__ == '__main__':
    main()
