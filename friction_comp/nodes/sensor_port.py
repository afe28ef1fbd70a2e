# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes what a cheap sensor of the simulated person measures, with faults on request."""

from __future__ import annotations

from array import array
from collections import deque
import math
from typing import Any

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from std_msgs.msg import Float64MultiArray

from friction_comp.direction import KINDS
from friction_comp.errors import InputError
from friction_comp.ros.joint_io import RELIABLE
from friction_comp.ros.parameters import declare, declare_choice
from friction_comp.simulation.cheap_sensors import CheapForce, CheapMuscles, FAULTS

NONE = 'none'
# The sensors are simulated in steps of a millisecond; so many at least go into one message.
_STEP, _BATCH = 1e-3, 10
_FAULTS = ' or '.join((NONE, *FAULTS))


def _check_fault(parameters: Any) -> SetParametersResult:
    known = all(one.value in (NONE, *FAULTS) for one in parameters if one.name == 'sensor_fault')
    return SetParametersResult(
        successful=known, reason='' if known else f'parameter sensor_fault: must be {_FAULTS}')


class SensorPort:
    """A cheap sensor on every joint of a plant.

    Muscles act before their force: the person follows the reference later, by this delay, so that
    the sensor knows of nothing that is still to come.
    """

    def __init__(self, node: Any, models: Any, seed: int, sample_time: float) -> None:
        self._node = node
        kind = declare_choice(
            node, 'sensor', (NONE, *KINDS), 'cheap sensor of the person, published on `sensor`')
        declare(node, 'sensor_fault', NONE, 'fault of the first channel of each sensor',
                changes=True, constraints=_FAULTS)
        node.add_on_set_parameters_callback(_check_fault)
        self.used = kind != NONE
        if not self.used:
            return
        self._steps = round(sample_time / _STEP)
        if not self._steps or not math.isclose(sample_time, self._steps * _STEP):
            raise InputError('parameter sensor: needs a sample_time that is a whole multiple of '
                             f'{_STEP:g} s')
        if missing := [model.joint or str(k) for k, model in enumerate(models)
                       if model.breakaway is None]:
            raise InputError('parameter sensor: its range follows from breakaway friction, which '
                             f'the model of {", ".join(missing)} lacks')
        breakaway = np.array([model.breakaway.positive_mean * model.drive.torque_per_current
                              for model in models])
        human = [model.simulation.get('human', {}) for model in models]
        self._stiffness = np.array([one.get('stiffness', 20.0) for one in human])
        self._damping = np.array([one.get('damping', 1.0) for one in human])
        self._joints = np.arange(len(models))
        self._sensor: Any = CheapForce(breakaway, [seed, 7], 100.0)
        self._delay = np.zeros(len(models), dtype=int)
        if kind != 'force':
            self._sensor = CheapMuscles(breakaway, [seed, 7], kind == 'muscle_envelope')
            self._delay = np.rint(self._sensor.delay / sample_time).astype(int)
        kept = int(self._delay.max()) + 1
        self._wishes = deque([np.full((2, len(models)), np.nan)] * kept, maxlen=kept)
        self._rows: list[np.ndarray] = []
        self._publisher = node.create_publisher(Float64MultiArray, 'sensor', RELIABLE)

    def felt(self, position: Any, velocity: Any, state: Any) -> tuple[np.ndarray, np.ndarray]:
        """Measure for a sample; return the reference that the person's force follows now.

        `position` and `velocity` are those of the reference, rad and rad/s, shape (J,), NaN or None
        where there is none; `state` is the plant's.
        """
        missing = np.full(len(self._joints), np.nan)
        wish = np.array([missing if position is None else position,
                         missing if velocity is None else velocity], dtype=float)
        self._wishes.append(wish)
        torque = state.interaction_torque
        if self._delay.any():
            torque = np.nan_to_num(self._stiffness * (wish[0] - state.position)
                                   + self._damping * (wish[1] - state.velocity))
        self._rows += [np.array(torque, dtype=float)] * self._steps
        if len(self._rows) >= _BATCH:
            self._publish()
        past = np.array(self._wishes)[len(self._wishes) - 1 - self._delay, :, self._joints]
        return past[:, 0], past[:, 1]

    def _publish(self) -> None:
        fault = self._node.get_parameter('sensor_fault').value
        first = [(j, 0) if self._delay.any() else j for j in self._joints.tolist()]
        self._sensor.faults = {} if fault == NONE else dict.fromkeys(first, fault)
        values = self._sensor.sample(np.array(self._rows))
        self._rows = []
        # A silent sensor sends nothing.
        if len(values) and np.isfinite(values).all():
            self._publisher.publish(Float64MultiArray(data=array('d', values.ravel())))
