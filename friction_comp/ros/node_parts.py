# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What nodes have: parameters, as config/parameters.yaml describes them, diagnostics, and goals.

That file is the only place that knows defaults, meanings, ranges and choices. ROS passes over names
that nothing reads, so that a misspelt limit would leave the default in place: they are told.
"""

from __future__ import annotations

from array import array
from collections.abc import Awaitable, Callable, Iterator, Sequence
from functools import partial
import re
import time
import traceback
from typing import Any, NamedTuple, TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.action import ActionServer, CancelResponse, GoalResponse
import yaml

from friction_comp.errors import errors_name, InputError
from friction_comp.files import package_file
from friction_comp.ros.ros_start import steady_timer

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel

# `name: default  # meaning`, also where it is only given at a start, and the lines below it.
_ENTRY = re.compile(r' {4}(?:# )?(\w+): +(.*?) +# ?(.*)')
_MORE = re.compile(r' {8,}# (.*)')
# What may follow the meaning, in brackets.
_LIMITS = re.compile(r'(.*?) ?\[([^][]+)\]')
_CHANGES, _RANGE, _OR = 'may change', ' to ', ' | '
# Real s between reports.
PERIOD = 1.0
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class Described(NamedTuple):
    """A parameter as the file describes it; a range is empty, or has its ends."""

    name: str
    default: Any
    meaning: str
    range: tuple[float, ...] = ()
    choices: tuple[str, ...] = ()
    changes: bool = False    # while the node runs


def described(kind: str = '') -> Iterator[Described]:
    """Yield the parameters of a kind of node, such as 'compensator', or those of all."""
    text = package_file('config', 'parameters.yaml').read_text(encoding='utf-8')
    if kind:
        text = text.partition(f'/**/{kind}:\n')[2].partition('\n\n')[0]
    entries: list[list[str]] = []
    for line in text.splitlines():
        if match := _ENTRY.fullmatch(line):
            entries.append(list(match.groups()))
        elif match := _MORE.fullmatch(line):
            entries[-1][-1] += ' ' + match[1]
    for name, default, words in entries:
        match = _LIMITS.fullmatch(words)
        meaning, limits = (match[1], match[2].split('; ')) if match else (words, [])
        yield Described(
            name, yaml.safe_load(default), meaning,
            tuple(float(end) for one in limits if _RANGE in one for end in one.split(_RANGE)),
            tuple(choice for one in limits if _OR in one for choice in one.split(_OR)),
            _CHANGES in limits)


class Settings:
    """The parameters of a node, by name: ``settings['law']`` is its present value.

    Raises InputError if an initial value cannot be used; later ones that cannot are refused.
    """

    def __init__(self, node: Any, kind: str) -> None:
        self._node = node
        # What was given also holds what a file says of all nodes.
        given = getattr(node, '_parameter_overrides', {})
        self._choices = {one.name: one.choices for one in described(kind) if one.choices}
        for one in described(kind):
            if one.name in given and given[one.name].value is None:
                # ROS takes an empty list, which has no type, for no value.
                raise InputError(f'parameter {one.name}: has no value')
            try:
                node.declare_parameter(one.name, one.default, _descriptor(one))
            except Exception as error:
                # rclpy's errors for bad initial values have no common base class.
                raise InputError(f'parameter {one.name}: {error}') from None
        if why := self._unusable(node.get_parameters(list(self._choices))):
            raise InputError(why)
        node.add_on_set_parameters_callback(lambda parameters: SetParametersResult(
            successful=not (why := self._unusable(parameters)), reason=why))
        known = node.get_parameters_by_prefix('')
        for name in sorted(given):
            if name not in known and not name.startswith('qos_overrides.'):
                node.get_logger().warning(f'parameter {name} does not exist, and has no effect')

    def __getitem__(self, name: str) -> Any:
        return self._node.get_parameter(name).value

    def _unusable(self, parameters: Sequence[Any]) -> str:
        """Return what is wrong with values beside their types and ranges, which ROS 2 checks."""
        return next((f'parameter {one.name}: must be one of '
                     f'{", ".join(self._choices[one.name])}, not {one.value!r}'
                     for one in parameters if one.value not in self._choices.get(
                         one.name, (one.value,))), '')

    @property
    def joints(self) -> list[str]:
        """The names of the joints; raises InputError if one is empty or given twice."""
        joints = list(self['joints'])
        if not joints or not all(joints) or len(set(joints)) != len(joints):
            raise InputError(f'parameter joints: names must be given and differ, not {joints}')
        return joints


def _descriptor(one: Described) -> ParameterDescriptor:
    result = ParameterDescriptor(
        description=one.meaning, read_only=not one.changes,
        additional_constraints=' or '.join(one.choices))
    if one.range:
        whole = isinstance(one.default, int)
        kind, number = (IntegerRange, int) if whole else (FloatingPointRange, float)
        setattr(result, f'{"integer" if whole else "floating_point"}_range', [kind(
            from_value=number(one.range[0]), to_value=number(one.range[1]))])
    return result


def names_in(values: Sequence[str]) -> list[str]:
    """Return a string array without empty strings, which represent 'none' in ROS."""
    return [value for value in values if value]


def load_models(model_files: Sequence[str], joints: Sequence[str],
                for_motor: bool = False) -> list[FrictionModel]:
    """Load the model file of each joint, which may be that of an arm; stricter if `for_motor`."""
    # Imported here: nodes without a model start in half the time.
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.model.motor_check import check_for_motor

    files = names_in(model_files)
    if len(files) != len(joints):
        raise InputError(
            f'parameter model_files: one file per joint is needed, {len(joints)} for '
            f'{list(joints)}, not {len(files)}' + ('' if files else ' (the section of a '
            '--params-file must have the name of this node)'))
    models = [FrictionModel.load(path, joint) for path, joint in zip(files, joints)]
    for path, joint, model in zip(files, joints, models) if for_motor else ():
        with errors_name(path):
            check_for_motor(model, joint, joints)
    return models


class Diagnostics:
    """Publishes a node's state once per second of real time, and at once when it changes.

    The name is ``node: task``, as in diagnostic_updater, so that aggregators and plotting tools
    find it. `report` returns level, message and values by name; an array has a number for each of
    `hardware`, the joints of the node, and becomes a value ``joint: name`` for each.
    """

    def __init__(self, node: Any, report: Callable[[], tuple[Any, ...]], hardware: Sequence[str],
                 task: str) -> None:
        self._node, self._report, self._hardware = node, report, hardware
        self._status = DiagnosticStatus(
            name=f'{node.get_fully_qualified_name().lstrip("/")}: {task}',
            hardware_id=', '.join(hardware))
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        steady_timer(node, PERIOD, self.publish)

    def publish(self) -> None:
        """Publish the state now."""
        self._status.level, self._status.message, values = self._report()
        self._status.values = [
            KeyValue(key=key, value=f'{value:.6g}' if isinstance(value, float) else str(value))
            for key, value in self._singly(values)]
        message = DiagnosticArray(status=[self._status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def _singly(self, values: dict[str, Any]) -> Iterator[tuple[str, Any]]:
        for name, value in values.items():
            if isinstance(value, (list, array, np.ndarray)):
                yield from ((f'{joint}: {name}', float(one))
                            for joint, one in zip(self._hardware, value))
            else:
                yield name, value


def first_of(values: dict[str, Any], *cases: tuple[Any, Any, str]) -> tuple[Any, ...]:
    """Return what a node reports: level and text of the first case that applies, and values."""
    return (*next((level, text) for applies, level, text in cases if applies), values)


class Rate:
    """The rate of events, of which `count` is the number so far."""

    def __init__(self) -> None:
        self.count = 0
        self._last_call = (time.monotonic(), 0)

    def per_second(self) -> float:
        """Return the rate in Hz since the last call."""
        now, (before, count) = time.monotonic(), self._last_call
        self._last_call = (now, self.count)
        return (self.count - count) / max(now - before, 1e-3)


class GoalServer:
    """One goal at a time, of whichever action; `last` and `refused` are for diagnostics."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self._busy = False
        self.last = self.refused = ''

    def serve(self, kind: Any, name: str, accept: Callable[[Any], object],
              run: Callable[[Any, Any], Awaitable[str]],
              cancel: Callable[[], object] = lambda: None) -> ActionServer:
        """Serve an action.

        `accept` gets a request and raises InputError to refuse it. `run` gets the handle and the
        result of a goal, fills the result and returns what it says; InputError says why it failed,
        or that it was cancelled. `cancel` is called when that is asked for.
        """
        def on_cancel(_: Any) -> CancelResponse:
            cancel()
            return CancelResponse.ACCEPT
        return ActionServer(
            self._node, kind, name, partial(self._execute, kind, run),
            goal_callback=partial(self._on_goal, accept), cancel_callback=on_cancel)

    def _on_goal(self, accept: Callable[[Any], object], request: Any) -> GoalResponse:
        try:
            if self._busy:
                raise InputError('another goal is running')
            accept(request)
        except InputError as error:
            self.refused = str(error)
            self._node.get_logger().warning(f'goal rejected: {error}')
            return GoalResponse.REJECT
        self.refused, self._busy = '', True
        return GoalResponse.ACCEPT

    async def _execute(self, kind: Any, run: Callable[[Any, Any], Awaitable[str]], handle: Any
                       ) -> Any:
        result = kind.Result()
        try:
            result.message = await run(handle, result)
            result.success = True
        except InputError as error:
            result.message = str(error)
        except Exception:
            self._node.get_logger().error(traceback.format_exc())
            result.message = 'an error in the node, see its log'
        finally:
            self._busy = False
        end, finish = (('done', handle.succeed) if result.success else
                       ('canceled', handle.canceled) if handle.is_cancel_requested else
                       ('aborted', handle.abort))
        self.last = f'{end}: {result.message}'
        self._node.get_logger().info(self.last)
        finish()
        return result
