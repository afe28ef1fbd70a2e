# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Plant, compensation law and person in one loop, without any middleware."""

import numpy as np

from friction_comp.simulation.joint import ReferenceHold

SIGNALS = ('position', 'velocity', 'current', 'interaction_torque', 'temperature')


def closed_loop(plant, law, movement, duration):
    """Run a plant under a compensation law for `duration` s while a person follows a movement.

    Per sample, in this order: the law turns the plant's latest state into a command, then the plant
    holds that command over the sample. The nodes in lockstep do the same and give the same numbers.
    The movement is shown to the person in samples 10 ms apart; all joints follow it.
    Returns arrays by name: ``time`` (N,) and, of shape (N, J), `SIGNALS`, ``command``,
    ``direction`` and the reference: the state at each time and the command that it led to.
    """
    every = max(1, round(0.01 / plant.sample_time))
    count = round(duration / plant.sample_time)
    hold, rows, each = ReferenceHold(), [], np.ones(plant.joints)
    shown = np.transpose(movement.at(np.arange(0, count, every) * plant.sample_time))
    for k in range(count):
        state = plant.state
        if k % every == 0:
            position, velocity, d = shown[k // every]
            direction, end = d * each, movement.end(d) * each
            hold.update(state.time, position * each, velocity * each)
        command = law.update(state.time, state.position, state.velocity, direction,
                             temperature=state.temperature, end=end)
        position, velocity = hold.at(state.time)
        rows.append([np.copy(values) for values in (
            state.time, *(getattr(state, name) for name in SIGNALS), command, direction,
            position, velocity)])
        plant.step(command, position, velocity)
    return dict(zip(('time', *SIGNALS, 'command', 'direction', 'reference_position',
                     'reference_velocity'), map(np.array, zip(*rows))))
