# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Declares node parameters with description and range, and refuses bad values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TYPE_CHECKING

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException

from friction_comp.errors import errors_name, InputError

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel

# Upper end of ranges that have no natural one.
LARGE = 1e6


def declare(node: Any, name: str, default: Any, description: str, low: float | None = None,
            high: float | None = None, changes: bool = False, constraints: str = '') -> Any:
    """Declare a parameter and return its value; InputError if its initial value cannot be used.

    The default determines the type; an empty list is one of strings. Numbers are limited to `low`
    to `high`, if `low` is given. The parameter is read-only unless it `changes` while the node
    runs. `constraints` is a text.
    """
    descriptor = ParameterDescriptor(
        description=description, read_only=not changes, additional_constraints=constraints)
    if low is not None and isinstance(default, int):
        descriptor.integer_range = [IntegerRange(
            from_value=int(low), to_value=int(high or 2**31 - 1))]
    elif low is not None:
        descriptor.floating_point_range = [FloatingPointRange(
            from_value=float(low), to_value=float(high or LARGE))]
    # An empty list has no type, and ROS takes it for no value.
    given = getattr(node, '_parameter_overrides', {}).get(name)
    empty = given is not None and given.value is None
    if default == [] or (empty and isinstance(default, list) and isinstance(default[0], str)):
        default = ['']
    elif empty:
        raise InputError(f'parameter {name}: has no value (it is {_form(default)})')
    try:
        return node.declare_parameter(name, default, descriptor, ignore_override=empty).value
    except InvalidParameterTypeException as error:
        raise InputError(f'parameter {name}: {error} (it is {_form(default)})') from None
    except Exception as error:
        # rclpy's errors for bad initial values have no common base class.
        raise InputError(f'parameter {name}: {error}') from None


def _form(default: Any) -> str:
    """Return how a parameter is written whose default this is."""
    if isinstance(default, list):
        return f'a list, such as {default if default not in ([], [""]) else ["elbow"]}'
    return {bool: 'true or false', int: 'a whole number',
            float: 'a number with a point, such as 1.0'}.get(type(default), 'a text')


def declare_choice(node: Any, name: str, choices: Sequence[str], description: str) -> str:
    """Declare a read-only parameter with one of a few values, by default the first; return it."""
    listed = ' or '.join(choices)
    value = declare(node, name, choices[0], description, constraints=listed)
    if value not in choices:
        raise InputError(f'parameter {name}: must be {listed}, not {value!r}')
    return str(value)


def names_in(values: Sequence[str]) -> list[str]:
    """Return a string array without empty strings, which represent 'none' in ROS."""
    return [value for value in values if value]


def declare_joints(node: Any) -> list[str]:
    """Declare `joints` and return them; raise InputError if a name is empty or duplicate."""
    joints = declare(
        node, 'joints', ['joint'],
        'names of the joints, in the order of all arrays on topics')
    if not joints or not all(joints) or len(set(joints)) != len(joints):
        raise InputError(f'parameter joints: names must be given and differ, not {list(joints)}')
    return list(joints)


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
