# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The scene ``follow`` of the tool ``demo``: a follower under a soft MIT-mode controller.

A loop in this process: the drive's frames are no ROS 2 messages.
"""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import numpy as np

from friction_comp.compensation.law import CompensationLaw
from friction_comp.direction.desired_motion import DesiredMotion
from friction_comp.model.friction_model import FrictionModel
from friction_comp.package_files import package_file
from friction_comp.reports.direction_scenes import follow_report
from friction_comp.results import write_report
from friction_comp.simulation.joint import Plant
from friction_comp.simulation.mit_drive import MitDrive, PERIOD
from friction_comp.statistics import rms
from friction_comp.tools.common import progress

STEP = 1e-3
# Stiffness of the follower's controller, as Coulomb friction over rad; kd as a share of it, s.
_LAG, _DAMPING = 0.03, 0.04
_BEND = 0.02  # rad/s at which the hyperbolic tangents bend
_SPEEDS = (0.01, 0.02, 0.05, 0.1, 0.2)
WAYS = ('without', '0.9·tanh of the measured speed', '0.9·tanh of the desired speed', 'the law')


def _follow(way: str, speed: float, seed: int) -> dict[str, Any]:
    model = FrictionModel.load(package_file('config', 'armin_configuration_1.yaml'))
    plant = Plant([model], seed)
    per, coulomb = model.drive.torque_per_current, model.sigmoid.upper
    kp = np.array([coulomb * per / _LAG])
    drive = MitDrive(kp, _DAMPING * kp, np.array([10.0 * coulomb * per]))
    law, leader = CompensationLaw([model], 'desired', sample_time=PERIOD), DesiredMotion()
    points = (0.0, 1.0, 6.0, 7.0, 12.0, 13.0), (0.0, 0.0, 5.0 * speed, 5.0 * speed, 0.0, 0.0)
    current, rows, direction = np.zeros(1), [], 0.0
    for k in range(round(points[0][-1] / STEP)):
        time = k * STEP
        wanted = float(np.interp(time, *points))
        pace = (float(np.interp(time + STEP, *points)) - wanted) / STEP
        if k % round(PERIOD / STEP) == 0:
            state = plant.state
            seen, velocity = drive.reported(state.position, state.velocity)
            if k % 10 == 0:
                leader.motion.add(time, float(seen[0]))
                leader.take(time, wanted)
                direction = float(leader.at(time, float(seen[0])).direction)
            added = {
                'without': np.zeros(1),
                WAYS[1]: 0.9 * coulomb * np.tanh(velocity / _BEND),
                WAYS[2]: 0.9 * coulomb * np.tanh(np.array([pace]) / _BEND)}.get(way)
            if added is None:
                added = law.update(time, seen, None, [direction])
            drive.command(time, np.array([wanted]), np.array([pace]), added * per)
            current = drive.torque(time, seen, velocity) / per
        state = plant.step(current)
        rows.append((time, wanted, float(state.position[0])))
    time_, desired, angle = np.array(rows).T
    error = desired - angle
    ramps = ((time_ > 1.0) & (time_ < 6.0)) | ((time_ > 7.0) & (time_ < 12.0))
    late = [(time_ > begin) & (time_ < begin + 2.5) for begin in (3.5, 9.5)]
    return {'time': time_, 'desired': desired, 'position': angle,
            'rms': rms(error[ramps]),
            'stairs': max(float(np.ptp(error[part])) for part in late)}


def play_follow(arguments: Namespace) -> None:
    """Compare a follower on slow references without and with compensation."""
    runs: dict[str, dict[float, dict[str, Any]]] = {way: {} for way in WAYS}
    with progress('a joint follows slow references') as report:
        for k, way in enumerate(WAYS):
            for j, speed in enumerate(_SPEEDS):
                runs[way][speed] = _follow(way, speed, arguments.seed)
                report((k + (j + 1) / len(_SPEEDS)) / len(WAYS))
    content = {way: [{'speed': speed, 'rms': one['rms'], 'stairs': one['stairs']}
                     for speed, one in own.items()] for way, own in runs.items()}
    arguments.output.mkdir(parents=True, exist_ok=True)
    write_report(arguments.output, content, follow_report(runs), arguments.command)
    for way, own in runs.items():
        print(f'{way}: RMS error ' + ', '.join(
            f'{1e3 * one["rms"]:.1f} mrad at {speed:g} rad/s' for speed, one in own.items()))
    print(f'report: {arguments.output / "report.html"}')
