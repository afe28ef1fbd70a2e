# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``watch``: shows a running system or a recording as a live page.

The page shows torque, current, velocity, direction and residual of each joint, with state and
faults. It publishes nothing, and is served on this machine only.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing, suppress
from pathlib import Path
import signal
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.errors import InputError, os_errors_name
from friction_comp.layout import Layout
from friction_comp.package_files import add_environment_to_ament_path
from friction_comp.tools.common import Arguments, progress, whole_number

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.recordings import RecordingInfo
    from friction_comp.samples import Samples

# Samples per second that are shown.
_RATE = 100.0


def main(argv: list[str] | None = None) -> int:
    """Serve the page until it is interrupted; returns 0."""
    parser = Arguments('watch', __doc__, ('', 'examples/elbow/with_direction.mcap.zstd'))
    parser.add_argument('recording', metavar='RECORDING', type=Path, nargs='?',
                        help='recording to play; by default the running system is shown')
    parser.add_argument('--model', metavar='FILE', type=Path, nargs='+', default=[],
                        help='model file of each joint, for current and residual; by default '
                        'those that the compensator uses or used')
    parser.add_argument('--joint', metavar='NAME', nargs='+', default=[],
                        help='joints to show; all by default')
    parser.add_effort_holds()
    parser.add_argument('--port', type=whole_number(0, 65535), default=5006,
                        help='port on localhost; 0 chooses a free one (%(default)s)')
    arguments = parser.parse(argv)
    try:
        from bokeh.server.server import Server

        from friction_comp.reports.live_page import live_page
    except ModuleNotFoundError as error:
        if (error.name or '').partition('.')[0] != 'bokeh':
            raise
        raise InputError('the page needs Bokeh: pip install "friction_comp[watch]", or '
                         'pip install bokeh') from None
    from friction_comp.model.friction_model import FrictionModel

    models = [FrictionModel.load(path) for path in arguments.model]
    in_ampere = arguments.effort_holds == 'current'
    if arguments.recording is not None:
        feed = recorded_feed(arguments.recording, arguments.joint, models, in_ampere)
        _serve(Server, live_page(feed), arguments.port)
        return 0
    add_environment_to_ament_path()
    from friction_comp.ros.live_feed import LiveFeed

    with closing(LiveFeed(arguments.joint, models, arguments.ros, in_ampere)) as running:
        _serve(Server, live_page(running), arguments.port)
    return 0


def _serve(server_class: Any, page: Any, port: int) -> None:
    with os_errors_name(f'--port {port}'):
        # Without further origins, only pages from localhost and this very port may connect.
        server = server_class({'/': page}, port=port, address='localhost')
    server.start()
    print(f'http://localhost:{server.port}/   (Ctrl+C ends it)', flush=True)

    def end(*_: Any) -> None:
        server.io_loop.add_callback_from_signal(server.io_loop.stop)
    for signum in (signal.SIGINT, signal.SIGTERM):
        signal.signal(signum, end)
    server.io_loop.start()
    with suppress(Exception):
        server.stop()


class RecordedFeed:
    """A recording, with the models of some joints, as a source of the live page."""

    def __init__(self, title: str, samples: dict[str, Samples],
                 models: dict[str, FrictionModel], notes: Sequence[str] = (),
                 in_ampere: bool = False):
        self.title, self.joints = title, list(samples)
        self._notes = notes
        self._columns = {joint: columns_of(one, models.get(joint), in_ampere)
                         for joint, one in samples.items()}
        self.duration = max(float(columns['time'][-1]) for columns in self._columns.values())

    def window(self, joint: str, end: float, length: float) -> dict[str, np.ndarray]:
        """Return the signals of the last `length` s before `end`."""
        columns = self._columns[joint]
        first, last = np.searchsorted(columns['time'], (end - length, end + 1e-9))
        return {name: values[first:last] for name, values in columns.items()}

    def status(self) -> list[tuple[str, str, str]]:
        """Return the state of the recording."""
        return [('note', 'recording', note) for note in self._notes] or [
            ('ok', 'recording', 'whole')]


def columns_of(samples: Samples, model: FrictionModel | None, in_ampere: bool = False
               ) -> dict[str, np.ndarray]:
    """Return the signals that the page shows, for one joint, NaN where not recorded."""
    from friction_comp.model.differentiation import DEFAULT_SETTINGS, differentiate

    none = np.full(len(samples), np.nan)
    if samples.velocity is None:
        samples = differentiate(samples, DEFAULT_SETTINGS)
    columns = {name: none if getattr(samples, name) is None else np.asarray(
        getattr(samples, name), dtype=float) for name in (
            'time', 'position', 'velocity', 'reference_velocity', 'direction', 'current',
            'command', 'load')}
    columns['predicted'] = columns['residual'] = none
    if model is None and in_ampere:
        columns['torque'] = none
    elif model is None:
        # Torque constant and gear ratio are unknown: effort was read as it is.
        columns['torque'], columns['current'] = columns['current'], none
    else:
        columns['torque'] = columns['current'] * model.drive.torque_per_current
        with suppress(InputError):
            columns['predicted'] = model.predict(samples)
            columns['residual'] = model.measured(samples) - columns['predicted']
    every = max(1, round(1.0 / (_RATE * max(samples.sample_time, 1e-9))))
    return {name: values[::every] for name, values in columns.items()}


def recorded_model(info: RecordingInfo, joint: str, notes: list[str]) -> FrictionModel | None:
    """Return the compensator's first model of a joint by a recording, None if not readable."""
    from friction_comp.model.friction_model import FrictionModel

    reported = [activity.of(joint).model for _, activity in info.activity]
    paths = list(dict.fromkeys(filter(None, (*reported, info.model))))
    for path in paths:
        # A model file on another machine cannot be shown here.
        with suppress(InputError):
            model = FrictionModel.load(path, joint)
            others = ', '.join(other for other in paths if other != path)
            if others:
                notes.append(f'{joint}: predicted by {path} throughout, although {others} was '
                             'active as well: choose with --model')
            return model
    return None


def recorded_feed(path: Path, joints: list[str], models: Sequence[FrictionModel],
                  in_ampere: bool = False) -> RecordedFeed:
    """Read a recording for the page."""
    from friction_comp.recordings import find_recording, read_recording_with_info, recorded_joints

    with progress('reading') as report:
        path = find_recording(path)
        wanted = joints or recorded_joints(path)
        if not wanted:
            raise InputError(f'{path}: joint_states name no joint')
        if models and len(models) != len(wanted):
            raise InputError(f'--model: one file per joint is needed, {len(wanted)} for '
                             f'{", ".join(wanted)}')
        samples, notes = {}, []
        layout = Layout(units={'effort': 'A'} if in_ampere else {})
        chosen = dict(zip(wanted, models))
        for index, joint in enumerate(wanted):
            gain = chosen[joint].drive.torque_per_current if joint in chosen else 1.0
            try:
                (samples[joint], info), = read_recording_with_info(
                    path, joint, gain, layout=layout)
            except InputError as error:
                # One without effort, such as a gripper, unless it was asked for.
                if joints or (not samples and index == len(wanted) - 1):
                    raise
                notes.append(f'left out: {error}')
                continue
            notes += [note for note in info.notes if note not in notes]
            model = None if joint in chosen else recorded_model(info, joint, notes)
            if model is not None:
                chosen[joint] = model
                if not in_ampere:
                    # Read without a drive, it holds the torque.
                    samples[joint] = samples[joint].with_(
                        current=samples[joint].current / model.drive.torque_per_current)
            report((index + 1) / len(wanted))
    return RecordedFeed(path.name, samples, chosen, notes, in_ampere)
