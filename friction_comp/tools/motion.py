# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tools `excite` and `play`: plan a motion, and move a robot by it."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
import math
from pathlib import Path
from typing import TYPE_CHECKING

from friction_comp import __version__
from friction_comp.errors import InputError
from friction_comp.files import read_json
from friction_comp.terminal import progress
from friction_comp.tools.common import Arguments, positive, whole_number, write_results

if TYPE_CHECKING:
    from friction_comp.excitation.plan import JointLimits
    from friction_comp.model.friction_model import FrictionModel


# Points of a trajectory per second: with a few, splines between them overshoot short moves.
_RATE = 50.0


def excite(argv: list[str] | None = None) -> int:
    """Plans a motion within limits that distinguishes effects of a drive.

    It writes trajectory.yaml (a trajectory_msgs/JointTrajectory), report.html (what the motion
    covers) and report.json. `play` first moves the robot to the first point; for any other player
    it must stand there.
    """
    parser = Arguments(excite, (
        '--joint elbow --position -1.2 1.0 --velocity 1.5 --acceleration 6 --output output/excite',
        '--urdf arm.urdf --acceleration 4 --seconds 90 --output output/excite')).add_output()
    parser.add_argument('--joint', metavar='NAME', action='append', default=[],
                        help='joint; may be repeated with --urdf, where the default is all joints')
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument('--position', metavar=('LOW', 'HIGH'), type=float, nargs=2,
                        help='limits of position of one joint, rad')
    source.add_argument('--urdf', metavar='FILE', type=Path,
                        help='URDF with the limits of the joints')
    parser.add_argument('--velocity', metavar='RAD/S', type=positive,
                        help='limit of velocity; lowers that of the URDF')
    parser.add_argument('--acceleration', metavar='RAD/S²', type=positive, required=True,
                        help='limit of acceleration')
    parser.add_argument('--model', metavar='FILE', type=Path,
                        help='model file of one joint, to keep the limit of effort')
    asked = parser.add_mutually_exclusive_group()
    asked.add_argument('--effects', metavar='NAME,…', help='effects to distinguish, two or more')
    asked.add_argument('--ambiguous', metavar='FILE', type=Path,
                       help='report.json of refine: distinguish the effects that it could not')
    parser.add_argument('--seconds', metavar='S', type=positive, default=60.0, help='duration (60)')
    parser.add_argument('--seed', metavar='N', type=whole_number(0), default=0,
                        help='the same seed gives the same plan (0)')
    arguments = parser.parse(argv)
    import numpy as np

    from friction_comp.excitation.plan import DEFAULT, pairs_in, pairs_of, plan_joint, trajectory_of
    from friction_comp.reports.other_pages import excitation_page

    pairs = pairs_in(read_json(arguments.ambiguous), str(arguments.ambiguous)) if (
        arguments.ambiguous) else pairs_of(
            arguments.effects.split(',') if arguments.effects else DEFAULT)
    limits = limits_of(arguments)
    model = _model(arguments, limits)
    seconds = arguments.seconds
    seeds = np.random.SeedSequence(arguments.seed).generate_state(len(limits)).tolist()
    plans = []
    with progress('planning') as show:
        for index, (own, seed) in enumerate(zip(limits, seeds)):
            plans.append(plan_joint(
                own, pairs, seconds, seed, model,
                lambda share, index=index: show(  # type: ignore[misc]
                    (index + share) / len(limits), f'planning {limits[index].joint}')))
    checked = 'effort limits are kept by the model' if model else 'effort is not checked'
    content = {'seconds': seconds, 'seed': arguments.seed,
               'effort_checked': model is not None, 'joints': [{
                   'joint': plan.limits.joint, 'start': plan.limits.centre,
                   'moves': len(plan.moves), 'pairs': [{
                       'between': list(pair), 'plan': share}
                       for pair, share in plan.separation.items()]} for plan in plans]}
    write_results(arguments, content, excitation_page(plans), files={
        'trajectory.yaml': trajectory_of(plans, _RATE).to_yaml(
            f'Planned by friction_comp {__version__}; {checked}')})
    lines = []
    for plan in plans:
        pair, share = min(plan.separation.items(), key=lambda entry: entry[1])
        lines.append(f'{plan.limits.joint}: {len(plan.moves)} moves; hardest to distinguish: '
                     f'{" and ".join(pair)}, {100 * share:.2g} % of the one is its own')
    print(*lines, f'{checked}; begins and ends at rest in the middle of each range',
          arguments.output / 'trajectory.yaml', sep='\n')
    return 0


def limits_of(arguments: Namespace) -> list[JointLimits]:
    """Return the joints' limits, by the arguments."""
    from friction_comp.excitation.plan import from_urdf, JointLimits

    if arguments.position:
        if len(arguments.joint) != 1 or arguments.velocity is None:
            raise InputError('with --position one --joint and --velocity are needed')
        low, high = arguments.position
        return [JointLimits(arguments.joint[0], low, high, arguments.velocity,
                            arguments.acceleration)]
    # An argument may only narrow a joint's own limit.
    return [replace(joint, velocity=min(joint.velocity, arguments.velocity or math.inf))
            for joint in from_urdf(arguments.urdf, arguments.acceleration, arguments.joint)]


def _model(arguments: Namespace, limits: list[JointLimits]) -> FrictionModel | None:
    if arguments.model is None:
        return None
    from friction_comp.model.friction_model import FrictionModel

    if len(limits) > 1:
        raise InputError('--model is that of one joint: name it with --joint')
    joint = limits[0].joint
    model = FrictionModel.load(arguments.model, joint)
    model.check_joint(joint, arguments.model)
    return model


def play(argv: list[str] | None = None) -> int:
    """Moves joints along a trajectory, such as one that `excite` planned.

    The node `identification` moves them, one after another, by motor currents and under its
    supervision.
    """
    parser = Arguments(play, ('output/excite/trajectory.yaml',))
    parser.add_argument('trajectory', metavar='FILE', type=Path,
                        help='trajectory_msgs/JointTrajectory as YAML')
    arguments = parser.parse(argv)
    from friction_comp.trajectory import Trajectory

    trajectory = Trajectory.load(arguments.trajectory)
    from friction_comp.ros.tool_client import ToolClient

    with ToolClient(patience=20.0) as ros, progress('playing') as show:
        for index, joint in enumerate(trajectory.joints):
            def report(share: float, phase: str, k: int = index, name: str = joint) -> None:
                show((k + share) / len(trajectory.joints), f'{name}: {phase}')
            ros.play(trajectory.of(joint), report)
    print(f'played {arguments.trajectory}: {", ".join(trajectory.joints)}')
    return 0
