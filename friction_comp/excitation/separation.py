# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Computes how well a motion separates effects, with refinement's columns and block sums.

An effect can be distinguished from another where a part of its columns is independent of those of
the other and of Eq. 6. `column_shares` gives that part; of some constants of both
effects, the smallest is taken.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from friction_comp.errors import InputError
from friction_comp.excitation.joint_limits import JointLimits
from friction_comp.model.effects import Coverage, Effect, EFFECTS
from friction_comp.refinement.block_sums import column_shares
from friction_comp.refinement.effect_columns import Table, Term
from friction_comp.refinement.prepare import in_motion, row_starts, Rows
from friction_comp.samples import Samples

Pair = tuple[str, str]
DEFAULT = ('gravity', 'spring', 'stribeck', 'viscous_shape', 'inner_load_friction')
# Signals that a joint's own motion cannot vary, or that are unknown in a plan.
_NOT_MOVED = {'load', 'temperature', 'rigid_body', 'coupling'}
# Constants of an effect that are compared, spread over its grid.
_CONSTANTS = 3
# Share of the top speed at which friction changes its sign, and below which the joint is at rest.
_TRANSITION, _SLOWEST = 0.02, 0.01
# An effect chosen by a smaller share of the repeated searches is uncertain.
_SURE = 0.9


def pairs_of(names: Iterable[str]) -> list[Pair]:
    """Return all pairs of two or more effects; InputError if motion alone cannot show one."""
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
        return f'is unknown; there are {", ".join(filter(_shown_by_motion, EFFECTS))}'
    missing = sorted(set(EFFECTS[name].needs) & _NOT_MOVED)
    if missing or name == 'other_joints':
        return f"cannot be shown by the joint's own motion: it needs {missing or 'other joints'}"
    if 'frequency' in EFFECTS[name].constants:
        return 'needs no plan: motion over many of its periods shows it, at whatever speeds'
    return ''


def _shown_by_motion(name: str) -> bool:
    return not _why_refused(name)


def pairs_in(report: Any, source: str) -> list[Pair]:
    """Return the pairs of effects that refinement's report.json, called `source`, leaves open.

    They are the ambiguous pairs, and those of each uncertain effect with the effects of `DEFAULT`:
    one that some repeated searches do not choose, or on whose variable the error still depends.
    Raises InputError if it is no such report, or leaves nothing open.
    """
    try:
        ambiguous = [sorted(map(str, entry['between'])) for entry in report['ambiguous']]
        uncertain = [one['name'] for one in report.get('effects', ()) if one['chosen'] < _SURE]
        unexplained = {one['variable'] for one in report.get('unexplained', ())}
    except (AttributeError, KeyError, TypeError) as error:
        raise InputError(f'{source}: is no report of refine: {error!r}') from None
    shown = [name for name in EFFECTS if _shown_by_motion(name)]
    pairs = [pair for pair in combinations(shown, 2)
             if sorted(EFFECTS[name].variable for name in pair) in ambiguous]
    uncertain += [name for name in DEFAULT if EFFECTS[name].variable in unexplained]
    for first in uncertain:
        if first in shown:
            pairs += [(first, second) for second in DEFAULT
                      if second != first and (second, first) not in pairs]
    if not pairs:
        raise InputError(f'{source}: refine left nothing open that motion alone can tell apart')
    return list(dict.fromkeys(pairs))


def coverage_within(limits: JointLimits, seconds: float) -> Coverage:
    """Return the coverage of motion that reaches all limits, for all plans within them."""
    return Coverage(
        transition=_TRANSITION * limits.velocity, speed=limits.velocity,
        slowest=_SLOWEST * limits.velocity, lowest=limits.lowest, highest=limits.highest,
        duration=seconds)


def terms_of(name: str, coverage: Coverage) -> list[Term]:
    """Return an effect with a few sets of constants, spread over its grid."""
    kind: type[Effect] = EFFECTS[name]
    grid = kind.points(coverage)
    if not grid:
        raise InputError(f'effect {name!r} cannot be seen in {coverage.duration:g} s within these '
                         'limits')
    # Assume a mass whose load on the teeth is largest where the limb is level.
    shares = [{'cosine': 1.0}] if kind.uses_inner_load else []
    chosen = dict.fromkeys(np.linspace(0, len(grid) - 1, _CONSTANTS).astype(int).tolist())
    return [Term(kind, kind.with_loads(grid[row], shares)) for row in chosen]


def separations(samples: Samples, pairs: Sequence[Pair], coverage: Coverage) -> dict[Pair, float]:
    """Return for each pair the share of one effect that is independent of the other, 0..1.

    The samples have velocity and acceleration, the coverage is of `coverage_within`. Zero if there
    is hardly any motion. Raises InputError if an effect cannot be seen with this coverage.
    """
    nothing = np.zeros(len(samples), dtype=bool)
    try:
        usable = in_motion(samples, nothing, coverage.slowest, None)
    except InputError:
        return dict.fromkeys(pairs, 0.0)
    start = row_starts(samples, usable, 1)
    table = Table(Rows(
        samples=samples, target=samples.current, usable=usable, clipped=nothing,
        coverage=coverage, start=start, length=1, block=np.zeros(len(start), dtype=int)),
        2.0 / coverage.transition)
    names = dict.fromkeys(name for pair in pairs for name in pair)
    keys = {name: table.add(terms_of(name, coverage)) for name in names}

    def least(first: str, second: str) -> float:
        shares = []
        for one in keys[first]:
            for other in keys[second]:
                columns = table.indices([one, other], derivatives=False)
                share = dict(zip(columns, column_shares(table.sums.part(columns).scaled(0.0))))
                shares += [max(share[column] for column in table.columns_of[key])
                           for key in (one, other)]
        return float(min(shares, default=0.0))
    return {(first, second): least(first, second) for first, second in pairs}
