# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Checks sign, size and shape of a measured current against the model of its joint."""

from __future__ import annotations

import numpy as np

from friction_comp.model.friction_model import FrictionModel
from friction_comp.monitoring.live_residual import LiveResidual
from friction_comp.monitoring.observation import Finding, NOTE, Observation, OK, PROBLEM, WARNING
from friction_comp.signal_checks import current_answer, current_fault

# rad/s below which nothing is told of friction, and share of a load that makes it worth knowing.
_SLOW, _FEWEST = 0.02, 50
# A command as small as this share of the drive's limit is lost in the noise of what is measured.
_SMALL = 0.01
# Between these ratios of measured and commanded current, a drive does what it is told; a gain or a
# torque constant that is off by less shows in the model's error. Below the correlation the one has
# nothing to do with the other.
_LIKE, _RELATED = (0.8, 1.25), 0.5


def check_joint(seen: Observation, joint: str, model: FrictionModel) -> list[Finding]:
    """Compare what was seen of a joint with its model.

    Friction takes energy out of every motion, so the current that goes with it, carried by motor
    and person together, has the sign of the velocity.

    Parameters
    ----------
    seen : Observation
    joint : str
    model : FrictionModel
    """
    states = seen.states
    if states is None or joint not in states.joints:
        return [Finding(WARNING, joint, 'joint_states do not name it', 'compare the names')]
    rows = measured_rows(seen, joint, model)
    return [*follows(seen, joint, model), *_fits(seen, joint, model, rows)]


def follows(seen: Observation, joint: str, model: FrictionModel) -> list[Finding]:
    """Compare the measured current with the commanded one, as far as one was.

    Parameters
    ----------
    seen : Observation
    joint : str
    model : FrictionModel
    """
    states = seen.states
    order: list[str] = next((values['joints'] for values in seen.parameters.values()
                  if joint in (values.get('joints') or ()) and 'model_files' in values), [])
    if states is None or not order or seen.commands.shape[-1:] != (len(order),):
        return []
    measured = states.effort[:, states.joints.index(joint)] / model.drive.torque_per_current
    unit = model.drive.torque_per_current if seen.command_unit == 'N·m' else 1.0
    command = np.interp(
        states.received, seen.commanded, seen.commands[:, order.index(joint)] / unit)
    good = np.isfinite(measured) & np.isfinite(command)
    measured, command = measured[good], command[good]
    power = float(command @ command)
    if good.sum() < _FEWEST or power < good.sum() * (_SMALL * model.drive.current_limit) ** 2:
        return []
    answer = current_answer(command, measured)
    if abs(answer.likeness) < _RELATED:
        return [Finding(WARNING, joint, 'the measured current does not follow the commanded one',
                        "look at the driver's mode and limits, and who else commands")]
    if answer.gain < 0.0:
        return [Finding(PROBLEM, joint, 'the measured current is the commanded one with the sign '
                        'turned round', 'stop compensating; turn the sign of effort round in the '
                        'driver, or that of the command, whichever is wrong: a positive current '
                        'has to push the joint towards larger positions')]
    if not _LIKE[0] < answer.gain < _LIKE[1]:
        why = current_fault(answer.gain, model.drive)
        return [Finding(WARNING, joint, f'the measured current is {answer.gain:.3g} times the '
                        'commanded one' + (f': {why}' if why else ''),
                        'effort is k_t · n · current in N·m: compare torque constant and gear '
                        'ratio of driver and model file')]
    return [Finding(OK, joint, 'the measured current follows the commanded one')]


def _fits(seen: Observation, joint: str, model: FrictionModel, rows: np.ndarray) -> list[Finding]:
    speed = np.abs(rows[:, 2])
    moving = (speed > _SLOW) & np.isfinite(rows[:, 3])
    if moving.sum() < _FEWEST:
        return [Finding(NOTE, joint, 'too little motion to compare it with its model',
                        'run doctor again while it is moved')]
    loaded = np.isfinite(rows[:, 4]).all()
    commanded = any('compensator' in end.node
                    for end in seen.topic('current_command').publishers)
    if commanded and not loaded:
        return [Finding(NOTE, joint, 'the compensator feeds the model itself forward and no load '
                        'is measured: nothing is told about the model',
                        'publish interaction_wrench, or look while the motor alone moves it')]
    current = rows[moving, 3]
    if loaded:
        current = current + rows[moving, 4] / model.drive.torque_per_current
    power = float(np.mean(current * np.sign(rows[moving, 2])))
    if power < 0.0:
        return [Finding(PROBLEM, joint, f'the current works against the motion ({power:.3g} A on '
                        'average): friction would give energy', 'turn the sign of effort, or that '
                        'of position and velocity, round in the driver; do not compensate before')]
    findings = [Finding(OK, joint, 'current and motion have one sign')]
    residual = LiveResidual(model)
    residual.take(rows)
    verdict = residual.verdict()
    if not verdict.known:
        findings.append(Finding(NOTE, joint, residual.blind or verdict.words,
                             'look for longer: --seconds 60'))
    else:
        findings.append(Finding(
            OK if verdict.fits else WARNING, joint, verdict.words,
            '' if verdict.fits else 'check torque constant and gear ratio, then refine the model'))
    return findings


def measured_rows(seen: Observation, joint: str, model: FrictionModel) -> np.ndarray:
    """Return the rows that `LiveResidual` takes, shape (N, 6)."""
    states = seen.states
    if states is None:
        return np.empty((0, 6))
    index = states.joints.index(joint)
    time = states.stamp if states.stamp.any() else states.received
    load = np.full(len(time), np.nan)
    heard = seen.load.get(joint)
    if heard is not None and len(heard) > 1:
        load = np.interp(states.received, heard[:, 0], heard[:, 1])
    velocity = states.velocity[:, index]
    if not np.isfinite(velocity).all():
        velocity = np.gradient(states.position[:, index], time)
    order = np.argsort(time, kind='stable')
    return np.column_stack((
        time, states.position[:, index], velocity,
        states.effort[:, index] / model.drive.torque_per_current, load,
        np.full(len(time), np.nan)))[order]
