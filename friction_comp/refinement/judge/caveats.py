# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the recordings cannot tell: variables that hardly varied, and effects that look alike."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.model.effects import EFFECTS, Scene
from friction_comp.refinement.judge.residual_dependence import rank_correlation
from friction_comp.refinement.search.candidate_fit import Step
from friction_comp.samples import Samples

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


def warnings(samples: Samples, scene: Scene) -> list[str]:
    """Return one sentence for everything that the recordings cannot show.

    What an effect says cannot be seen is not named either, so that no warning stands beside the
    very effect that it refers to.

    Parameters
    ----------
    samples : Samples
    scene : Scene
    """
    found = []
    if samples.temperature is None:
        found.append('Motor temperature was not recorded: its effect can only show as drift over '
                     'time.')
    if samples.load is None:
        found.append('No load was recorded: effects of load, and an error of the torque '
                     'constant, cannot be seen.')
    for kind in EFFECTS.values():
        why = kind.hard_to_tell(scene)
        if why and all(getattr(samples, signal) is not None for signal in kind.needs):
            found.append(why)
    if scene.duration < 60.0 and not any('warm-up' in line for line in found):
        found.append(f'The longest recording lasts {scene.duration:.3g} s: warm-up takes minutes '
                     'and cannot be seen in full.')
    return list(dict.fromkeys(found))


def ambiguities(samples: Samples, usable: np.ndarray, steps: list[Step]) -> list[dict[str, Any]]:
    """Return entries of report.json's `ambiguous`.

    Parameters
    ----------
    samples : Samples
    usable : ndarray of bool, shape (N,)
    steps : list of Step
        The effects that were added, with their rivals.
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
    return found
