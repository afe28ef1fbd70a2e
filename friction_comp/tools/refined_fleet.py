# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compares the units of a fleet whose recordings were refined: the second half of --each.

Each recording is read once more, where it was refined, and only its sums come back.
"""

from __future__ import annotations

from argparse import Namespace
from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any

from friction_comp.evaluation.sessions import Piece
from friction_comp.fleet.common_model import CommonModel
from friction_comp.fleet.population import Population, population_of
from friction_comp.fleet.spread import FEWEST_UNITS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.parallel import attempt, Failure, Runner
from friction_comp.recorded_drive.given import Given
from friction_comp.recorded_drive.refine_recordings import showing_friction
from friction_comp.recordings.condense import read_condensed
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.tools.refine_arguments import given_of


@dataclass(frozen=True)
class RefinedPiece:
    """One joint of one recording that was refined."""

    piece: Piece
    unit: str  # the robot
    row: dict[str, Any]
    model: dict[str, Any]


@dataclass(frozen=True)
class _Summed:
    group: tuple[str, str]  # joint, and unit of the figures
    robot: str
    piece: Piece
    model: FrictionModel
    common: CommonModel

    def __str__(self) -> str:
        return str(self.piece)


def fleet_of(arguments: Namespace, refined: Sequence[RefinedPiece], run: Runner,
             show: Callable[[int, int], None]) -> list[Population]:
    """Return the population of each joint that enough units have; `show` gets done and all.

    Recordings without a signal of the common model are left out.
    """
    groups: dict[tuple[str, str], list[RefinedPiece]] = defaultdict(list)
    for one in refined:
        groups[one.row['joint'], one.row['unit']].append(one)
    groups = {key: group for key, group in groups.items()
              if len({one.unit for one in group}) >= FEWEST_UNITS}
    if not groups:
        return []
    models = {key: [FrictionModel.from_dict(one.model) for one in group]
              for key, group in groups.items()}
    items = []
    for key, group in groups.items():
        common = CommonModel.of(models[key])
        items += [_Summed(key, one.unit, one.piece, model, common)
                  for one, model in zip(group, models[key])]
    sums: dict[int, BlockSums] = {}
    work = partial(attempt, partial(_sums_of_one, given_of(arguments)))
    with closing(run(work, items)) as outcomes:
        for done, (index, outcome) in enumerate(outcomes, 1):
            if not isinstance(outcome, Failure):
                sums[index] = outcome
            show(done, len(items))
    populations = []
    for key in groups:
        own = [(items[index], sums[index]) for index in sorted(sums)
               if items[index].group == key]
        if len({item.robot for item, _ in own}) >= FEWEST_UNITS:
            populations.append(population_of(
                [(item.robot, sums_of_one) for item, sums_of_one in own], own[0][0].common,
                models[key][0], key[1], len(groups)))
    return populations


def _sums_of_one(given: Given, item: _Summed) -> BlockSums:
    drive = item.model.drive
    recordings = read_condensed([item.piece.path], item.piece.joint, drive.torque_constant,
                                drive.gear_ratio, layout=given.layout)
    usable, = showing_friction({item.piece.joint or '': recordings}).values()
    declared = bool(given.model or given.torque_constant or given.gear_ratio
                    or item.model.notes.get('unit') == 'N·m')
    return item.common.sums([samples for samples, _ in usable], item.model, declared)
