# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the recordings cannot tell: variables that hardly varied, and effects that look alike."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.refinement.judge.residual_dependence import rank_correlation

if TYPE_CHECKING:
    from friction_comp.model.effects.scene import Scene
    from friction_comp.refinement.search.candidate_fit import Step
    from friction_comp.samples import Samples

# Two explanations that go together this closely are one as far as the recording can tell.
ALIKE = 0.95

_EXPERIMENTS = {
    frozenset(('time', 'temperature')):
        'record the motor once warm from the start, or cool it while it goes on moving',
    frozenset(('acceleration', 'history')):
        'record movements of the same speed with several different accelerations, and reversals',
    frozenset(('position', 'acceleration')):
        'record the same positions at several accelerations, such as two different tempos',
    frozenset(('position', 'velocity')):
        'record the same positions at several speeds and in both directions',
    frozenset(('position', 'time')):
        'record the same positions early and late, several times over',
    frozenset(('velocity', 'time')):
        'record the same speeds early and late, in another order',
    frozenset(('velocity', 'temperature')):
        'record the same speeds cold and warm',
    frozenset(('velocity', 'direction')):
        'record the same speeds in both directions',
}


def experiment(first: Any, second: Any) -> Any:
    """Return the recording that would tell two variables apart."""
    known = _EXPERIMENTS.get(frozenset((first, second)))
    return known or (f'record motion in which {first} changes while {second} does not, '
                     'and the other way round')


def warnings(samples: Samples, usable: np.ndarray, scene: Scene) -> list[str]:
    """Return one sentence for each variable that hardly varied.

    An effect of such a variable is invisible: that none was found is no evidence against it.
    """
    moving = samples.take(usable)
    found = []
    v = moving.velocity
    positive = float(np.mean(v > 0))
    if min(positive, 1 - positive) < 0.05:
        side = 'positive' if positive > 0.5 else 'negative'
        found.append(f'Motion was in the {side} direction only: differences between directions, '
                     'constant offsets and reversals cannot be seen.')
    low, high = np.percentile(np.abs(v), (5, 95))
    if high < 1.5 * low:
        found.append(f'Speed hardly varied ({low:.3g} to {high:.3g} rad/s): effects of velocity '
                     'cannot be seen.')
    span = scene.highest - scene.lowest
    if span < 0.5:
        found.append(f'Position covered {span:.3g} rad only: gravity cannot be told from an '
                     'offset or a spring, and slow ripple cannot be seen.')
    if moving.temperature is None:
        found.append('Motor temperature was not recorded: its effect can only show as drift over '
                     'time.')
    elif np.ptp(np.percentile(moving.temperature, (1, 99))) < 2.0:
        found.append('Motor temperature varied by less than 2 °C: its effect cannot be seen.')
    if moving.load is None:
        found.append('No load was recorded: effects of load, and an error of the torque '
                     'constant, cannot be seen.')
    if scene.duration < 60.0:
        found.append(f'The longest recording lasts {scene.duration:.3g} s: warm-up takes minutes '
                     'and cannot be seen in full.')
    rested = np.abs(samples.velocity) < scene.slowest
    if rested.mean() * len(samples) * samples.sample_time < 1.0:
        found.append('The joint hardly ever rested: stiction that grows with the time at rest '
                     'cannot be seen.')
    return found


def ambiguities(samples: Samples, usable: np.ndarray, steps: list[Step], scene: Scene) -> list[Any]:
    """Return entries of report.json's `ambiguous`.

    Parameters
    ----------
    samples : Samples
    usable : ndarray of bool, shape (N,)
    steps : list of Step
        The effects that were added, with their rivals.
    scene : Scene
    """
    found, seen = [], set()

    def add(first: Any, second: Any, why: Any) -> None:
        pair = frozenset((first, second))
        if first != second and pair not in seen:
            seen.add(pair)
            found.append({'between': [first, second], 'why': why,
                          'experiment': experiment(first, second)})
    for step in steps:
        for rival, correlation in step.rivals:
            add(step.kind.variable, rival.variable,
                f"'{step.kind.name}' and '{rival.name}' lower the held-out error equally and "
                f'their currents are alike (correlation {correlation:.2f})')
    variables = {step.kind.variable for step in steps}
    moving = samples.take(usable)
    if moving.temperature is not None and variables & {'time', 'temperature'}:
        alike = rank_correlation(moving.time, moving.temperature)
        if alike > ALIKE:
            add('time', 'temperature', 'temperature and time rose together in the recordings '
                f'(correlation {alike:.3f})')
    elif 'time' in variables and moving.temperature is None:
        add('time', 'temperature', 'the drift over time may be the motor warming up, and its '
            'temperature was not recorded')
    alike = rank_correlation(moving.time, np.abs(moving.velocity))
    if alike > 0.9 and len(np.unique(moving.recording)) == 1:
        # A staircase of speeds, each driven once: what drifts looks like what speed does.
        add('velocity', 'time', 'speed rose or fell with time all through the recording (rank '
            f'correlation {alike:.2f}): drift over time, which may be as large on another day, '
            'cannot be told from the dependence on velocity')
    for kind in {step.kind for step in steps}:
        why = kind.hard_to_tell(scene)
        if why:
            found.append({'between': [kind.variable, kind.variable], 'why': why,
                          'experiment': 'record motion over at least a third of a turn'})
    return found
