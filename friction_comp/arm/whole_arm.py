# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Refines all joints of an arm: its rigid bodies first, then each joint."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from friction_comp.arm.fit import ArmFit, fit_arm
from friction_comp.arm.urdf import Chain
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.arm import Arm
from friction_comp.model.friction_model import FrictionModel
from friction_comp.parallel import one_thread
from friction_comp.refinement.prepare import clipped, load_coefficient
from friction_comp.refinement.refine import refine
from friction_comp.refinement.result import Origin, RefineResult
from friction_comp.samples import Samples

# Share of the work for the rigid bodies.
_BODIES = 0.2


@dataclass(frozen=True)
class ArmResult:
    """The result of refining an arm."""

    fit: ArmFit
    results: dict[str, RefineResult]  # by joint; the models include the arm where they need it
    notes: list[str]  # for the reader, such as joints left out or locked

    def report(self) -> dict[str, Any]:
        """Return the arm's part of report.json."""
        fit, tree, bounds = self.fit, self.fit.tree, self.fit.intervals

        def by_name(values: Any) -> dict[str, Any]:
            mass, *others = values
            return {'mass': mass, 'first_moment': others[:3], 'inertia': others[3:]}
        return {
            'joints': list(tree.joints), 'gravity': tree.gravity,
            'identifiable_parameters': fit.identifiable,
            'differentiation': dict(fit.differentiation), 'regularisation': fit.strength,
            'rigid_bodies': [{
                'joint': name, 'current_per_torque': fit.scales[k],
                'held_out_rmse_without': fit.without[k], 'held_out_rmse': fit.held_out[k],
                **by_name(tree.parameters[k].tolist()), 'mass_urdf': fit.start.parameters[k, 0],
                'intervals': {'current_per_torque': bounds.scales[k].tolist(),
                              **by_name([[end if np.isfinite(end) else None for end in ends]
                                         for ends in bounds.parameters[k].tolist()])},
                'told_by_recording': by_name(bounds.from_recording[k].tolist()),
            } for k, name in enumerate(tree.joints)],
            'notes': list(self.notes)}


@one_thread
def refine_arm(recorded: dict[str, list[Samples]], urdf: str | Path,
               drives: dict[str, Drive] | None = None,
               models: dict[str, FrictionModel] | None = None,
               declared: Collection[str] = (), only: Sequence[str] | None = None,
               progress: Callable[[float, str], None] | None = None,
               torques: bool = False, origins: Mapping[str, Origin] | None = None) -> ArmResult:
    """Fit an arm's rigid bodies to each joint's recordings with `arm`, then refine each joint.

    `drives` and `models`, the initial ones, are by joint; `declared` are the joints whose drive is
    known. If all are, masses are fitted to torques. With `torques`, all currents are torques in N·m
    unless the recordings contradict. All joints are refined unless `only` some are. `progress` is
    called with the share of the work done and the name of the step. Units of `origins` are those
    that `torques` says. Raises InputError if URDF or recordings cannot be used.
    """
    report = progress or (lambda share, word: None)
    drives, models = drives or {}, models or {}
    if torques:
        drives, declared = dict.fromkeys(recorded, Drive(1.0, 1.0)) | drives, list(recorded)
    chain, notes = _chain_of(urdf, list(recorded), only or ())
    names = list(chain.tree.joints)
    scales = None
    if set(names) <= set(declared):
        scales = np.array([1.0 / drives[name].torque_per_current for name in names])
    carried = {name: [_add_person_torque(samples, drives[name]) if name in declared else samples
                      for samples in recorded[name]] for name in names}
    fit = fit_arm(chain, _at_common_times(carried), scales,
                  lambda share: report(_BODIES * share, 'rigid bodies'), torques)
    if torques and not fit.declared:
        torques, declared = False, ()
        notes.append('the efforts are no torques in N·m of this URDF: taken as currents of unknown '
                     'torque constants (--unit A says so, --torque-constant and --gear-ratio say '
                     'more)')
    notes += _said_of_gravity(fit, chain)
    arm, refined = Arm(fit.tree, fit.differentiation), list(only or names)
    results: dict[str, RefineResult] = {}
    for index, name in enumerate(refined):
        def report_joint(share: float, word: str, index: int = index, name: str = name) -> None:
            report(_BODIES + (1.0 - _BODIES) * (index + share) / len(refined), f'{name}: {word}')
        drive = drives.get(name)
        origin = replace((origins or {}).get(name, Origin()), declared=name in declared,
                         unit='N·m' if torques else 'A' if drive else '')
        try:
            result = refine([_with_links(recorded[name], arm)], models.get(name), drive,
                            report_joint, origin=origin)
        except InputError as error:
            notes.append(f'joint {name!r}: {error}')
        else:
            results[name] = _with_arm(result, arm)
    if not results:
        raise InputError(notes[-1])
    return ArmResult(fit, results, notes)


def _chain_of(urdf: str | Path, recorded: list[str], only: Sequence[str]
              ) -> tuple[Chain, list[str]]:
    """Return the chain of the recorded joints, which `only` must be some of, and notes on it."""
    chain = Chain(urdf, recorded)
    for name in only:
        if name not in chain.tree.joints:
            raise InputError(f'{urdf}: joint {name!r} is not in the URDF')
    return chain, [
        *(f'joint {name!r} is not in the URDF: left out' for name in chain.unknown),
        *(f'joint {name!r} of the URDF is not recorded: assumed to stay at position zero'
          for name in chain.locked)]


def _said_of_gravity(fit: ArmFit, chain: Chain) -> list[str]:
    if (fit.tree.gravity == chain.tree.gravity).all():
        return []
    direction = ', '.join(f'{value:.2f}' for value in fit.tree.gravity / 9.81)
    return [f'the currents fit gravity along ({direction}) of the base far better than along its '
            '-z: the arm is assumed to be mounted that way']


def _with_links(recorded: list[Samples], arm: Arm) -> Samples:
    """Return a joint's recordings as one, with the torque of the links and all joints' motion."""
    samples = arm.with_signal(Samples.concatenate(recorded))
    # In the order along the arm, which that of a recording need not be.
    return samples.with_(arm=samples.arm and samples.arm.of(arm.joints))


def _with_arm(result: RefineResult, arm: Arm) -> RefineResult:
    """Return the result of a joint whose model has the arm, if it needs the arm's links."""
    # The model may be the given one, which stays as it is.
    own = result.model.arm
    if any('rigid_body' in effect.needs for effect in result.model.effects):
        own = replace(arm, friction=own if own and own.signal == 'coupling' else None)
    return replace(result, model=replace(result.model, arm=own))


def _add_person_torque(samples: Samples, drive: Drive) -> Samples:
    """Return samples with the torque of a person who carries the links added to the current."""
    share = load_coefficient(samples, clipped(samples.current), drive)
    if not share:
        return samples
    return samples.with_(load=None, current=(
        samples.current - share * np.nan_to_num(np.asarray(samples.load))))


def _at_common_times(recorded: dict[str, list[Samples]]) -> list[Samples]:
    parts: list[list[Samples]] = [[] for _ in recorded]
    for joint_samples in zip(*recorded.values()):
        common = joint_samples[0].time
        for samples in joint_samples[1:]:
            common = np.intersect1d(common, samples.time, assume_unique=True)
        if len(common) < 0.5 * min(map(len, joint_samples)):
            raise InputError('the joints are hardly ever recorded together: '
                             f'{len(common)} joint states hold all of them')
        for part, samples in zip(parts, joint_samples):
            part.append(samples.take(np.searchsorted(samples.time, common)))
    return [replace(Samples.concatenate(part), joint=name) for name, part in zip(recorded, parts)]
