# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Declares the parameters of a node as config/parameters.yaml describes them.

That file is the only place that knows defaults, meanings, ranges and choices. ROS passes over names
that nothing reads, so that a misspelt limit would leave the default in place: they are told.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import re
from typing import Any, NamedTuple, TYPE_CHECKING

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
import yaml

from friction_comp.errors import errors_name, InputError
from friction_comp.package_files import package_file

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel

# `name: default  # meaning`, also where it is only given at a start, and the lines below it.
_ENTRY = re.compile(r' {4}(?:# )?(\w+): +(.*?) +# ?(.*)')
_MORE = re.compile(r' {8,}# (.*)')
# What may follow the meaning, in brackets.
_LIMITS = re.compile(r'(.*?) ?\[([^][]+)\]')
_CHANGES, _RANGE, _OR = 'may change', ' to ', ' | '


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
        self._choices = {one.name: one.choices for one in described(kind) if one.choices}
        for one in described(kind):
            _declare(node, one)
            self._check(one.name, self[one.name])
        node.add_on_set_parameters_callback(self._check_all)
        for text in self._unknown():
            node.get_logger().warning(text)

    def __getitem__(self, name: str) -> Any:
        return self._node.get_parameter(name).value

    def _check(self, name: str, value: Any) -> None:
        choices = self._choices.get(name)
        if choices and value not in choices:
            raise InputError(
                f'parameter {name}: must be one of {", ".join(choices)}, not {value!r}')

    def _check_all(self, parameters: Sequence[Any]) -> SetParametersResult:
        try:
            for parameter in parameters:
                self._check(parameter.name, parameter.value)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _unknown(self) -> list[str]:
        """Return what to say of each parameter that the node was given and does not have."""
        # Also holds what a file says of all nodes.
        given = getattr(self._node, '_parameter_overrides', {})
        known = self._node.get_parameters_by_prefix('')
        return [f'parameter {name} does not exist, and has no effect' for name in sorted(given)
                if name not in known and not name.startswith('qos_overrides.')]

    @property
    def joints(self) -> list[str]:
        """The names of the joints; raises InputError if one is empty or given twice."""
        joints = list(self['joints'])
        if not joints or not all(joints) or len(set(joints)) != len(joints):
            raise InputError(f'parameter joints: names must be given and differ, not {joints}')
        return joints


def _declare(node: Any, one: Described) -> None:
    descriptor = ParameterDescriptor(
        description=one.meaning, read_only=not one.changes,
        additional_constraints=' or '.join(one.choices))
    if one.range and isinstance(one.default, int):
        descriptor.integer_range = [IntegerRange(
            from_value=int(one.range[0]), to_value=int(one.range[1]))]
    elif one.range:
        descriptor.floating_point_range = [FloatingPointRange(
            from_value=one.range[0], to_value=one.range[1])]
    given = getattr(node, '_parameter_overrides', {}).get(one.name)
    if given is not None and given.value is None:
        # ROS takes an empty list, which has no type, for no value.
        raise InputError(f'parameter {one.name}: has no value')
    try:
        node.declare_parameter(one.name, one.default, descriptor)
    except Exception as error:
        # rclpy's errors for bad initial values have no common base class.
        raise InputError(f'parameter {one.name}: {error}') from None


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
    if not files:
        raise InputError('parameter model_files: not given, one file per joint is needed (the '
                         'section of a --params-file must have the name of this node)')
    if len(files) != len(joints):
        raise InputError(
            f'parameter model_files: one file per joint is needed, {len(joints)} for '
            f'{list(joints)}, not {len(files)}')
    models = [FrictionModel.load(path, joint) for path, joint in zip(files, joints)]
    for path, joint, model in zip(files, joints, models) if for_motor else ():
        with errors_name(path):
            check_for_motor(model, joint, joints)
    return models
