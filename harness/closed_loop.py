# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Plant, compensation law and person in one loop, without any middleware."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from friction_comp.simulation.joint import ReferenceHold

if TYPE_CHECKING:
    from friction_comp.compensation.law import CompensationLaw
    from friction_comp.direction.exercise import ReferenceMovement
    from friction_comp.simulation.joint import Plant

SIGNALS = ('position', 'velocity', 'current', 'interaction_torque', 'temperature')


def closed_loop(plant: Plant, law: CompensationLaw, movement: ReferenceMovement, duration: float
                ) -> dict[str, np.ndarray]:
    """Run a plant under a compensation law for `duration` s while a person follows a movement.

    Per sample, in this order: the law turns the plant's latest state into a command, then the plant
    holds that command over the sample. The nodes in lockstep do the same and give the same numbers.
    The movement is shown to the person in samples 10 ms apart; all joints follow it.
    Returns arrays by name: ``time`` (N,) and, of shape (N, J), `SIGNALS`, ``command``,
    ``direction`` and the reference: the state at each time and the command that it led to.
    """
    count = round(duration / plant.sample_time)
    every = max(1, round(0.01 / plant.sample_time))
    shape = (count, plant.joints)
    log: dict[str, np.ndarray] = {name: np.zeros(shape) for name in SIGNALS + (
        'command', 'direction', 'reference_position', 'reference_velocity')}
    log['time'] = np.zeros(count)
    hold = ReferenceHold()
    direction, end = np.zeros(plant.joints), np.full(plant.joints, np.nan)
    shown = np.transpose(movement.at(np.arange(0, count, every) * plant.sample_time))
    for k in range(count):
        state = plant.state
        if k % every == 0:
            position, velocity, d = shown[k // every]
            direction = np.full(plant.joints, float(d))
            end = np.full(plant.joints, movement.end(d))
            hold.update(state.time, np.full(plant.joints, position),
                        np.full(plant.joints, velocity))
        command = law.update(state.time, state.position, state.velocity, direction,
                             temperature=state.temperature, end=end)
        position, velocity = hold.at(state.time)
        log['time'][k] = state.time
        for name in SIGNALS:
            log[name][k] = getattr(state, name)
        log['command'][k] = command
        log['direction'][k] = direction
        log['reference_position'][k] = position
        log['reference_velocity'][k] = velocity
        plant.step(command, position, velocity)
    return log
