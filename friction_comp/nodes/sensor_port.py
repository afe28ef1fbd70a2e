# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes what a cheap sensor of the simulated person measures, with faults on request."""

from __future__ import annotations

from array import array
import math
from typing import Any

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from std_msgs.msg import Float64MultiArray

from friction_comp.errors import InputError
from friction_comp.ros.joint_io import RELIABLE
from friction_comp.ros.parameters import declare, declare_choice
from friction_comp.simulation.cheap_sensors import CheapForce, FAULTS

NONE = 'none'
# The sensors are simulated in steps of a millisecond; so many at least go into one message.
_STEP, _BATCH = 1e-3, 10
_FAULTS = ' or '.join((NONE, *FAULTS))


def _check_fault(parameters: Any) -> SetParametersResult:
    known = all(one.value in (NONE, *FAULTS) for one in parameters if one.name == 'sensor_fault')
    return SetParametersResult(
        successful=known, reason='' if known else f'parameter sensor_fault: must be {_FAULTS}')


class SensorPort:
    """A cheap sensor of the person's force on every joint of a plant."""

    def __init__(self, node: Any, models: Any, seed: int, sample_time: float) -> None:
        self._node = node
        kind = declare_choice(
            node, 'sensor', (NONE, 'force'), 'cheap sensor of the person, published on `sensor`')
        declare(node, 'sensor_fault', NONE, 'fault of each sensor',
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
        self._sensor = CheapForce(breakaway, [seed, 7], 100.0)
        self._rows: list[np.ndarray] = []
        self._publisher = node.create_publisher(Float64MultiArray, 'sensor', RELIABLE)

    def feel(self, torque: Any) -> None:
        """Measure the torques of the person in a sample, N·m, shape (J,)."""
        self._rows += [np.array(torque, dtype=float)] * self._steps
        if len(self._rows) >= _BATCH:
            self._publish()

    def _publish(self) -> None:
        fault = self._node.get_parameter('sensor_fault').value
        self._sensor.faults = {} if fault == NONE else dict.fromkeys(
            range(self._rows[0].size), fault)
        values = self._sensor.sample(np.array(self._rows))
        self._rows = []
        # A silent sensor sends nothing.
        if len(values) and np.isfinite(values).all():
            self._publisher.publish(Float64MultiArray(data=array('d', values.ravel())))
