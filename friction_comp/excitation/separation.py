# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Measures how well a motion separates effects, with refinement's columns and block sums.

An effect is told from another where part of its columns is repeated neither by the other nor by
Eq. 6. That share is asked of `BlockSums.own_share`, for the hardest of some constants of each.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from friction_comp.errors import InputError
from friction_comp.excitation.joint_limits import JointLimits
from friction_comp.model.effects import Effect, EFFECTS, Scene
from friction_comp.refinement.effect_columns import Table, Term
from friction_comp.refinement.prepare import Rows
from friction_comp.refinement.recorded_motion import blocks_of, in_motion, row_starts
from friction_comp.samples import Samples

Pair = tuple[str, str]
DEFAULT = ('gravity', 'spring', 'stribeck', 'viscous_shape', 'inner_load_friction')
# Signals that a joint's own motion cannot vary, or that are unknown in a plan.
_NOT_MOVED = {'load', 'temperature', 'rigid_body', 'coupling'}
# Constants of an effect that are compared, spread over its grid.
_CONSTANTS = 3
# Share of the top speed at which friction changes its sign, and below which the joint is at rest.
_TRANSITION, _SLOWEST = 0.02, 0.01
# An effect chosen by a smaller share of the repeated searches is open.
_SURE = 0.9


def pairs_of(names: Iterable[str]) -> list[Pair]:
    """Return each pair of some effects.

    Raises InputError if there are fewer than two, or motion alone cannot tell one of them.
    """
    names = list(dict.fromkeys(names))
    for name in names:
        why = _why_refused(name)
        if why:
            raise InputError(f'effect {name!r} {why}')
    if len(names) < 2:
        raise InputError('at least two effects are needed to tell them apart')
    return list(combinations(names, 2))


def _why_refused(name: str) -> str:
    if name not in EFFECTS:
        return f'is unknown; there are {", ".join(filter(_of_motion, EFFECTS))}'
    missing = sorted(set(EFFECTS[name].needs) & _NOT_MOVED)
    if missing or name == 'other_joints':
        return f"cannot be told by the joint's own motion: it needs {missing or 'other joints'}"
    if 'frequency' in EFFECTS[name].constants:
        return 'needs no plan: motion over many of its periods shows it, at whatever speeds'
    return ''


def _of_motion(name: str) -> bool:
    return not _why_refused(name)


def open_pairs(report: dict[str, Any]) -> list[Pair]:
    """Return the pairs of effects that refinement's report.json leaves open, none of them twice.

    Those that it calls ambiguous; of an effect that not nearly all searches chose, and of a
    variable that the remaining error depends on, those with the effects of `DEFAULT`.
    """
    pairs: dict[Pair, None] = {}
    for entry in report['ambiguous']:
        between = sorted(map(str, entry['between']))
        pairs.update(dict.fromkeys(
            pair for pair in combinations(filter(_of_motion, EFFECTS), 2)
            if sorted(EFFECTS[name].variable for name in pair) == between))
    barely = [one['name'] for one in report.get('effects', ()) if one['chosen'] < _SURE]
    left = {one['variable'] for one in report.get('unexplained', ())}
    barely += [name for name in DEFAULT if EFFECTS[name].variable in left]
    for first in filter(_of_motion, filter(EFFECTS.__contains__, barely)):
        pairs.update(dict.fromkeys((first, second) for second in DEFAULT if second != first
                                   and (second, first) not in pairs))
    return list(pairs)


def pairs_in(report: Any, source: str) -> list[Pair]:
    """Return the pairs of effects that a report, of a source, leaves open; see `open_pairs`.

    Raises InputError if it is no report of refinement, or motion alone answers none of its
    questions.
    """
    entries = report.get('ambiguous') if isinstance(report, dict) else None
    if not isinstance(entries, list):
        raise InputError(f"{source}: is no report of refine: it has no list 'ambiguous'")
    for entry in entries:
        between = entry.get('between') if isinstance(entry, dict) else None
        if not isinstance(between, list) or len(between) != 2:
            raise InputError(f"{source}: an entry of 'ambiguous' does not name two variables in "
                             "'between'")
    pairs = open_pairs(report)
    if not pairs:
        raise InputError(f'{source}: refine left nothing open that motion alone can tell apart')
    return pairs


def scene_within(limits: JointLimits, seconds: float, sample_time: float) -> Scene:
    """Return the scene of a motion that uses all of the limits, the same for every motion."""
    return Scene(transition=_TRANSITION * limits.velocity, speed=limits.velocity,
                 slowest=_SLOWEST * limits.velocity, lowest=limits.lowest, highest=limits.highest,
                 duration=seconds, sample_time=sample_time)


def terms_of(name: str, scene: Scene) -> list[Term]:
    """Return an effect with a few constants from all over its grid."""
    kind: type[Effect] = EFFECTS[name]
    grid = kind.grid(scene)
    if not grid:
        raise InputError(f'effect {name!r} cannot be seen in {scene.duration:g} s within these '
                         'limits')
    # A carried mass loads the teeth most where the limb is level.
    shares = [{'cosine': 1.0}] if kind.uses_inner_load else []
    chosen = dict.fromkeys(np.linspace(0, len(grid) - 1, _CONSTANTS).astype(int).tolist())
    return [Term(kind, kind.with_loads(grid[row], shares)) for row in chosen]


def separations(samples: Samples, pairs: Sequence[Pair], scene: Scene) -> dict[Pair, float]:
    """Return for each pair the share of an effect that the other one does not repeat, 0..1.

    The samples have velocity and acceleration; their current is not looked at. The scene is that of
    `scene_within`. Raises InputError if there is too little motion.
    """
    nothing = np.zeros(len(samples), dtype=bool)
    usable = in_motion(samples, nothing, scene.slowest, None)
    start = row_starts(samples, usable, 1)
    block = blocks_of(samples, start)
    table = Table(Rows(samples, samples.current, usable, nothing, scene, start, 1, block,
                       np.zeros_like(block)), 2.0 / scene.transition)
    names = dict.fromkeys(name for pair in pairs for name in pair)
    keys = {name: table.add(terms_of(name, scene)) for name in names}

    def least(first: str, second: str) -> float:
        shares = []
        for one in keys[first]:
            for other in keys[second]:
                columns = table.indices([one, other], derivatives=False)
                share = dict(zip(columns, table.sums.own_share(columns)))
                shares += [max(share[column] for column in table.columns_of[key])
                           for key in (one, other)]
        return float(min(shares, default=0.0))
    return {(first, second): least(first, second) for first, second in pairs}
