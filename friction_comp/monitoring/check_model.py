# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compares the measured current of a joint with the commanded one and with its model."""

from __future__ import annotations

import numpy as np

from friction_comp.model.friction_model import FrictionModel
from friction_comp.monitoring.live_residual import LiveResidual
from friction_comp.monitoring.observation import (
    Finding,
    NOTE,
    Observation,
    OK,
    PROBLEM,
    StatesSeen,
    WARNING,
)
from friction_comp.signal_checks import current_answer, current_fault

# Speed below which samples are not used, rad/s, and fewest samples.
_SLOW, _FEWEST = 0.02, 50
# Commands below this share of the drive's limit are smaller than the measurement noise.
_SMALL = 0.01
# Accepted range of measured over commanded current; smaller errors of a gain or torque constant
# show in the model's error. Below the correlation, the currents are unrelated.
_GAINS, _LEAST_CORRELATION = (0.8, 1.25), 0.5


def check_joint(seen: Observation, joint: str, model: FrictionModel) -> list[Finding]:
    """Compare the observation of a joint with its model.

    Friction dissipates energy, so the current that overcomes it, of motor and person together, has
    the sign of the velocity.
    """
    states = seen.states
    if states is None or joint not in states.joints:
        return [Finding(WARNING, joint, 'joint_states do not name it', 'compare the names')]
    return [*_check_current(seen, states, joint, model), *_check_fit(
        seen, joint, model, _rows(states, seen.load.get(joint), joint, model))]


def _check_current(seen: Observation, states: StatesSeen, joint: str, model: FrictionModel
                   ) -> list[Finding]:
    """Compare the measured current with the commanded one, if there is one."""
    order: list[str] = next((values['joints'] for values in seen.parameters.values()
                  if joint in (values.get('joints') or ()) and 'model_files' in values), [])
    if not order or seen.commands.shape[-1:] != (len(order),):
        return []
    measured = states.effort[:, states.joints.index(joint)] / model.drive.torque_per_current
    unit = model.drive.torque_per_current if seen.command_unit == 'N·m' else 1.0
    command = np.interp(
        states.received, seen.commanded, seen.commands[:, order.index(joint)] / unit)
    finite = np.isfinite(measured) & np.isfinite(command)
    measured, command = measured[finite], command[finite]
    power = float(command @ command)
    if finite.sum() < _FEWEST or power < finite.sum() * (_SMALL * model.drive.current_limit) ** 2:
        return []
    answer = current_answer(command, measured)
    if abs(answer.likeness) < _LEAST_CORRELATION:
        return [Finding(WARNING, joint, 'the measured current does not follow the commanded one',
                        "check the driver's mode and limits, and whether another node commands")]
    if answer.gain < 0.0:
        return [Finding(PROBLEM, joint, 'the measured current has the opposite sign of the '
                        'commanded one', 'stop compensating; reverse the sign of effort in the '
                        'driver, or that of the command, whichever is wrong: a positive current '
                        'must push the joint towards larger positions')]
    if not _GAINS[0] < answer.gain < _GAINS[1]:
        why = current_fault(answer.gain, model.drive)
        return [Finding(WARNING, joint, f'the measured current is {answer.gain:.3g} times the '
                        'commanded one' + (f': {why}' if why else ''),
                        'effort is k_t · n · current in N·m: compare torque constant and gear '
                        'ratio of driver and model file')]
    return [Finding(OK, joint, 'the measured current follows the commanded one')]


def _check_fit(seen: Observation, joint: str, model: FrictionModel, rows: np.ndarray
               ) -> list[Finding]:
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
                        'is measured: the model cannot be checked',
                        'publish interaction_wrench, or run doctor while the motor alone moves it')]
    current = rows[moving, 3]
    if loaded:
        current = current + rows[moving, 4] / model.drive.torque_per_current
    power = float(np.mean(current * np.sign(rows[moving, 2])))
    if power < 0.0:
        return [Finding(PROBLEM, joint, f'the current opposes the motion ({power:.3g} A on '
                        'average): friction would supply energy', 'reverse the sign of effort, or '
                        'that of position and velocity, in the driver before compensating')]
    findings = [Finding(OK, joint, 'current and motion have the same sign')]
    residual = LiveResidual(model)
    residual.take(rows)
    verdict = residual.verdict()
    if not verdict.known:
        level, do = NOTE, 'observe for longer: --seconds 60'
    elif verdict.fits:
        level, do = OK, ''
    else:
        level, do = WARNING, 'check torque constant and gear ratio, then refine the model'
    return [*findings, Finding(level, joint, residual.blind or verdict.words, do)]


def _rows(states: StatesSeen, measured_load: np.ndarray | None, joint: str, model: FrictionModel
          ) -> np.ndarray:
    """Return measurements as rows for `LiveResidual`, shape (N, 6)."""
    index = states.joints.index(joint)
    time = states.stamp if states.stamp.any() else states.received
    load = temperature = np.full(len(time), np.nan)
    if measured_load is not None and len(measured_load) > 1:
        load = np.interp(states.received, measured_load[:, 0], measured_load[:, 1])
    velocity = states.velocity[:, index]
    if not np.isfinite(velocity).all():
        velocity = np.gradient(states.position[:, index], time)
    order = np.argsort(time, kind='stable')
    return np.column_stack((
        time, states.position[:, index], velocity,
        states.effort[:, index] / model.drive.torque_per_current, load, temperature))[order]
