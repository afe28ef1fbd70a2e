# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``improve``: moves a joint until its model predicts motion that it has not seen.

Each round refines what was recorded so far, plans a motion for what that leaves open, has the node
`identification` play it, and records it. Robot (or plant) and identification must be running, and
no compensator; with --simulate they are started here. Results are written after each round.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import contextmanager, ExitStack
from dataclasses import replace
from itertools import count
import os
from pathlib import Path
from typing import TYPE_CHECKING

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.recorded_drive.given import drive_of, Given
from friction_comp.recorded_drive.refine_recordings import showing_friction
from friction_comp.results import output_folder, write_report
from friction_comp.tools.common import Arguments, positive, progress, whole_number
from friction_comp.tools.excite import add_limits, limits_of
from friction_comp.tools.processes import IN_LOCKSTEP, Nodes, only_user, plant_parameters
from friction_comp.tools.ros_domain import private_domain

if TYPE_CHECKING:
    from friction_comp.excitation.improve import Improvement
    from friction_comp.excitation.plan import JointPlan
    from friction_comp.ros.tool_client import ToolClient
    from friction_comp.samples import Samples

# Points of a trajectory a second, and s within which the other nodes must answer.
_RATE, _PATIENCE = 50.0, 20.0


def main(argv: list[str] | None = None) -> int:
    """Improve the model and write report.json, two pages and model.yaml; returns 0."""
    parser = Arguments('improve', __doc__, (
        '--joint elbow --position -1.2 1.0 --velocity 1.5 --acceleration 6 --model elbow.yaml '
        '--output output/improved',
        '--simulate config/armin_configuration_1.yaml --undeclared config/undeclared_example.yaml '
        '--position -1 1 --velocity 1.5 --acceleration 6 --output output/improved',
    )).add_drive().add_output()
    parser.add_argument('--joint', metavar='NAME', action='append', default=[],
                        help='the joint to move; that of --simulate by default')
    add_limits(parser)
    parser.add_argument('--model', metavar='FILE', type=Path,
                        help='model to start from, with the drive; without it, the sigmoid of Eq. '
                        '6 is fitted, and --torque-constant and --gear-ratio are needed')
    parser.add_argument('--recorded', metavar='RECORDING', type=Path, nargs='+', default=[],
                        help='earlier recordings of this joint, to start from')
    parser.add_argument('--seconds', metavar='S', type=positive, default=30.0,
                        help='duration of motion in each round (30)')
    parser.add_argument('--budget', metavar='S', type=positive, default=300.0,
                        help='duration of motion in all rounds (300)')
    parser.add_argument('--seed', metavar='N', type=whole_number(0), default=0,
                        help='seed of the plans and of --simulate (0)')
    parser.add_argument('--simulate', metavar='FILE', type=Path,
                        help='start a simulated joint of this model file, in lockstep')
    parser.add_argument('--undeclared', metavar='FILE', type=Path,
                        help='effects of the simulated joint that its model does not contain')
    arguments = parser.parse(argv)
    if arguments.undeclared and not arguments.simulate:
        raise InputError('--undeclared goes with --simulate')
    if not (arguments.model or arguments.simulate or (
            arguments.torque_constant and arguments.gear_ratio)):
        raise InputError('--model, or --torque-constant and --gear-ratio, must specify the drive')
    from friction_comp.model.friction_model import FrictionModel

    named = arguments.joint[0] if arguments.joint else None
    simulated = FrictionModel.load(arguments.simulate, named) if arguments.simulate else None
    if simulated and not arguments.joint:
        arguments.joint = [simulated.joint or arguments.simulate.stem]
    limits, *more = limits_of(arguments)
    if more:
        raise InputError('one joint is improved at a time: name it with --joint')
    model = FrictionModel.load(arguments.model, limits.joint) if arguments.model else None
    if model:
        model.check_joint(limits.joint, arguments.model)
    drive = simulated.drive if simulated and not model else drive_of(
        Given(torque_constant=arguments.torque_constant, gear_ratio=arguments.gear_ratio), model)
    from friction_comp.excitation.improve import improve, Schedule
    from friction_comp.recordings import read_recording_with_info

    schedule = Schedule(arguments.seconds, arguments.budget, arguments.seed)
    recordings = read_recording_with_info(
        arguments.recorded, limits.joint, drive.torque_per_current) if arguments.recorded else []
    recorded = [samples for samples, _ in showing_friction({limits.joint: recordings})[limits.joint]
                ] if recordings else []
    for note in (note for _, info in recordings for note in info.notes):
        print(f'note: {note}')
    names = [str(path) for path in arguments.recorded]
    with _system(arguments, limits.joint) as (ros, nodes), progress('improving') as show:
        improvement = improve(
            lambda plan: _play(arguments, names, plan, ros, nodes, drive, show), limits, drive,
            model=model, recorded=recorded, schedule=schedule, progress=show,
            done=lambda so_far: _write(arguments, names, so_far))
    for k, one in enumerate(improvement.rounds):
        words = '' if one.predicted_rmse != one.predicted_rmse else (
            f'predicted with {1e3 * one.predicted_rmse:.3g} mA, ')
        print(f'round {k + 1}: {words}held out {1e3 * one.held_out_rmse:.3g} mA; '
              f'{", ".join(one.effects) or "no effect"}; {one.verdict}')
    print(f'verdict: {improvement.verdict} after {improvement.seconds:g} s of motion: '
          f'{improvement.ended}')
    for reason in improvement.rounds[-1].reasons:
        print(f'  {reason}')
    print(arguments.output / 'report.html')
    return 0


@contextmanager
def _system(arguments: Namespace, joint: str) -> Iterator[tuple[ToolClient, Nodes]]:
    """Yield a ROS 2 client and the nodes of the tool, with --simulate plant and identification."""
    output = arguments.output.absolute()
    with ExitStack() as stack:
        stack.enter_context(only_user(output))
        if arguments.simulate:
            stack.enter_context(private_domain())
        os.environ.setdefault('ROS_LOG_DIR', str(output / 'logs' / 'ros'))
        from friction_comp.ros.tool_client import ToolClient

        nodes = stack.enter_context(Nodes(output / 'logs'))
        ros = stack.enter_context(ToolClient(nodes.check, _PATIENCE))
        if arguments.simulate:
            nodes.start('plant', {**plant_parameters(
                [joint], [arguments.simulate], arguments.undeclared, arguments.seed),
                'wait_for_listeners': 2})
            nodes.start('identification', {
                'joints': [joint], 'model_files': [arguments.simulate], **IN_LOCKSTEP,
                'output_folder': output})
        yield ros, nodes


def _play(arguments: Namespace, names: list[str], plan: JointPlan, ros: ToolClient,
          nodes: Nodes, drive: Drive, show: Callable[..., None]) -> Samples:
    """Play and record a plan, add the recording to the names, and return its samples."""
    from friction_comp.excitation.plan import trajectory_of
    from friction_comp.recordings import read_recording

    folder = arguments.output.absolute() / 'recordings'
    folder.mkdir(parents=True, exist_ok=True)
    index = next(k for k in count(1) if not (folder / f'round_{k}').exists())
    path = folder / f'round_{index}'
    nodes.start('recorder', {'output': str(path), 'use_sim_time': bool(arguments.simulate)})
    # Once it receives one state, it receives all. An earlier recorder would name another folder.
    ros.wait_until(lambda: ros.value('recorder', 'hardware_id') == str(path)
                   and int(ros.value('recorder', 'joint_states') or 0) > 0,
                   'joint_states at the recorder')

    def report(share: float, word: str) -> None:
        show(None, f'round {index}: {word}, {100.0 * share:.0f} %')
    try:
        ros.play(trajectory_of([plan], _RATE), report)
    finally:
        nodes.stop('recorder')
    names.append(str(arguments.output / 'recordings' / path.name))
    samples, = read_recording(path, plan.limits.joint, drive.torque_constant, drive.gear_ratio)
    return samples


def _write(arguments: Namespace, names: list[str], improvement: Improvement) -> None:
    from friction_comp.reports.excitation_report import improvement_report
    from friction_comp.reports.refinement_report import refinement_report

    model = improvement.result.model
    model = replace(model, notes={**model.notes, 'refined_from': list(names), 'unit': 'A'})
    with output_folder(arguments.output) as folder:
        write_report(folder, improvement.report(), improvement_report(improvement, names),
                     arguments.command)
        page = refinement_report(improvement.result, names)
        page.made_by(arguments.command)
        page.save(folder / 'refinement.html')
        model.save(folder / 'model.yaml')
