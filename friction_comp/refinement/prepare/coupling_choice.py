# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of several joints, where no URDF says how they are connected."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from friction_comp.arm.find_coupling import find_coupling
from friction_comp.model.arm.arm import Arm
from friction_comp.model.arm.coupling import Coupling
from friction_comp.model.arm.states import moving_states
from friction_comp.refinement.judge.verdict import AGAIN, IN_PART, lower_report
from friction_comp.refinement.prepare.differentiation_choice import excerpt
from friction_comp.refinement.prepare.fit_data import bandwidths
from friction_comp.refinement.thresholds import AS_ONE, ELSEWHERE
from friction_comp.samples import Samples

# Share of its usual top speed below which the joint counts as at rest.
_STILL = 0.01
# A joint that moves less than this is not looked at, rad.
_LEAST = 1e-3
# Motion comes again where positions differ by less than this share of how much they vary.
_AGAIN, _ANEW, _ROWS = 0.01, 0.3, 1500
# Another bandwidth is taken where it leaves less than this share of the error.
_CLEARLY = 0.97


@dataclass(frozen=True)
class Beside:
    """A recording with what other joints add to the current, where it shows any.

    Parameters
    ----------
    samples : Samples
        With `coupling`, or as recorded.
    arm : Arm or None
        What a model needs to compute it.
    settings : dict
        How velocity and acceleration are derived from position.
    """

    samples: Samples
    arm: Arm | None
    settings: dict[str, Any]


def with_other_joints(samples: Samples, usable: np.ndarray, settings: dict[str, Any],
                      elsewhere: bool) -> list[Beside]:
    """Return a recording with what other joints add to the current, where it shows any.

    What is left of one joint's own motion says little of how smooth acceleration has to be where
    others ask for most of the current.

    Parameters
    ----------
    samples : Samples
        As recorded.
    usable : ndarray of bool, shape (N,)
        Samples that may be fitted.
    settings : dict
        How velocity and acceleration are derived from position.
    elsewhere : bool
        Whether other bandwidths are looked at.

    Returns
    -------
    list of Beside
        With these settings, and with those at which others explain clearly more, if there are any.
    """
    beside = moved_beside(samples)
    if not beside:
        return [Beside(samples, None, settings)]
    names = [name for name in samples.arm.joints if name in beside or name == samples.joint]
    few, allowed = excerpt(samples, usable)
    # The same samples for all, told from rest by the velocity chosen without the others.
    _, velocity, _ = moving_states(few, names, for_all(samples, settings))
    speed = np.abs(velocity[:, names.index(samples.joint)])
    rows = allowed & (speed > _STILL * np.percentile(speed, 95))

    def found_at(choice: dict[str, Any]) -> Coupling | None:
        return find_coupling(
            few.current, names, samples.joint, moving_states(few, names, for_all(samples, choice)),
            few.recording, rows)

    def error(found: Coupling | None) -> float:
        return found.errors[1] if found else np.inf
    first = found_at(settings)
    ways = [(first, settings)]
    best = min(((found_at(choice), choice) for choice in bandwidths(samples)
                if elsewhere and choice['source'] == settings['source'] and choice != settings),
               key=lambda way: error(way[0]), default=ways[0])
    if error(best[0]) < _CLEARLY * error(first):
        ways.append(best)
    return [_beside(samples, names, found, choice) for found, choice in ways]


def _beside(samples: Samples, names: list[str], found: Coupling | None,
            settings: dict[str, Any]) -> Beside:
    """Return a recording with a coupling that was found with some settings, if one was."""
    if found is None:
        return Beside(samples, None, settings)
    own = for_all(samples, settings)
    return Beside(samples.with_(coupling=found.current(names, *moving_states(samples, names, own))),
                  Arm(coupling=found, differentiation=own), settings)


def for_all(samples: Samples, settings: dict[str, Any]) -> dict[str, Any]:
    """Return settings for the motion of all joints, whose velocity may not be recorded."""
    if samples.arm is not None and samples.arm.velocity is None:
        return {**settings, 'source': 'position'}
    return dict(settings)


def moved_beside(samples: Samples) -> list[str]:
    """Return the other joints that moved, where no links say what they ask of this one.

    Parameters
    ----------
    samples : Samples
        As recorded.
    """
    known = samples.rigid_body is not None or samples.coupling is not None
    if samples.arm is None or known or samples.joint not in samples.arm.joints:
        return []
    span = np.ptp(samples.arm.position, axis=0)
    return [name for name, moved in zip(samples.arm.joints, span)
            if moved > _LEAST and name != samples.joint]


def repeats_after(samples: Samples) -> float | None:
    """Return the time in s after which the motion of all joints comes again, None where it is new.

    What is held out of such motion was driven before, so that it says little of other motion.

    Parameters
    ----------
    samples : Samples
        As recorded, with `arm`.
    """
    every = max(1, len(samples) // _ROWS)
    position = samples.arm.position[::every]
    position = position[:, np.ptp(position, axis=0) > _LEAST]
    if not position.size:
        return None
    position = (position - position.mean(axis=0)) / position.std(axis=0)
    apart = np.array([0.5 * np.mean((position[lag:] - position[:-lag]) ** 2)
                      for lag in range(1, 2 * len(position) // 3)])
    if not (apart > _ANEW).any():
        return None
    first = int(np.argmax(apart > _ANEW))
    again = np.nonzero(apart[first:] < _AGAIN)[0]
    if not again.size:
        return None
    return float((first + again[0] + 1) * every * samples.sample_time)


def moves_as_one(samples: Samples) -> float:
    """Return the share of a joint's motion that follows from the other joints' positions.

    Parameters
    ----------
    samples : Samples
        As recorded, with `arm`.
    """
    position = samples.arm.position - samples.arm.position.mean(axis=0)
    place = samples.arm.joints.index(samples.joint)
    own, others = position[:, place], np.delete(position, place, axis=1)
    left = own - others @ np.linalg.lstsq(others, own, rcond=None)[0]
    return 1.0 - float(np.mean(left ** 2) / np.mean(own ** 2))


def say_so(report: dict[str, Any], arm: Arm, samples: Samples) -> None:
    """Name other joints in a report that has an effect of theirs."""
    groups = [group.describe() for group in arm.coupling.groups]
    for entry in report['effects']:
        if entry['name'] == 'other_joints':
            entry['in_words'] = f"Other joints: {'; '.join(groups)}"
            entry['parameters'] = {**entry['parameters'], **arm.coupling.to_dict()}
    report['warnings'].append(
        f'The current depends on other joints ({", ".join(arm.coupling.joints)}). The terms found '
        'hold for postures like the recorded ones; with a URDF of the arm (--urdf) its weight and '
        'inertia follow from mechanics.')
    again = repeats_after(samples)
    if again:
        repeats = (f'All joints repeat their motion every {again:.3g} s, so that what is held out '
                   'was driven before: on other motion expect a larger error than the held-out '
                   'one. To judge the model, record another motion of all joints.')
        report['warnings'].append(repeats)
        lower_report(report, IN_PART, repeats, 'record another motion of all joints, and refine '
                     'on both')
    share = moves_as_one(samples)
    if share >= AS_ONE:
        lower_report(
            report, AGAIN, f"{100 * share:.4g} % of the joint's motion follow from where the other "
            'joints are: which of them asks for what is not told, and other motion may show that '
            'it was another.', 'move the joints so that none follows from the others, each with '
            'frequencies of its own')
    if len(arm.coupling.errors) > 2:
        times, postures = arm.coupling.errors[2:]
        if postures >= ELSEWHERE * times:
            lower_report(
                report, AGAIN, f'What other joints ask is told {postures / times:.2g} times as '
                'badly in postures that were not fitted as at times that were not: it does not '
                'hold beyond the recorded postures.', 'record motion that comes by each posture '
                'with several others, over the range that will be used')
