# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool `export`."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
import html
import json
from pathlib import Path
from typing import Any, TYPE_CHECKING

from friction_comp import __version__
from friction_comp.errors import errors_name, InputError
from friction_comp.files import plain, read_yaml, to_yaml, write_atomically
from friction_comp.terminal import in_own_units
from friction_comp.tools.common import Arguments

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.model.friction_numbers import SimulatorJoint


_FORMS = ('mujoco', 'urdf', 'sdf', 'csv', 'tanh', 'isaac', 'json')


def export(argv: list[str] | None = None) -> int:
    """Writes a model's friction in a form that simulators and controllers read.

    Coulomb and viscous friction, offset and inertia are those that refine prints. Every file states
    in a comment, or an entry, what its form misses of the model in the recorded motion.
    """
    parser = Arguments(export, (
        'output/refined/model.yaml --to mujoco --output output/elbow.xml',
        'output/refined/model.yaml --to isaac --joint elbow --output output/elbow.yaml',
        'output/refined/model.yaml --to csv --output output/friction.csv'))
    parser.add_argument('model', metavar='MODEL', type=Path, help='model file')
    parser.add_argument('--to', choices=_FORMS, required=True,
                        help='form of the file')
    parser.add_argument('--joint', metavar='NAME', help='joint of the model file of an '
                        'arm, and its name in the file that is written; by default that of the '
                        'model, else "joint"')
    parser.add_argument('--without-inertia', action='store_true',
                        help='leave out the inertia, which a simulator with links counts twice')
    parser.add_output('the file to write')
    arguments = parser.parse(argv)
    from friction_comp.model.friction_model import FrictionModel

    model = FrictionModel.load(arguments.model, arguments.joint)
    with errors_name(arguments.model):
        if arguments.to == 'csv':
            return _write_table(arguments, model)
        return _write_joint(arguments, model)


def _write_joint(arguments: Namespace, model: FrictionModel) -> int:
    from friction_comp.model.friction_numbers import simulator_joint

    form, joint = arguments.to, simulator_joint(model, arguments.to)
    if form not in ('tanh', 'json'):
        joint = joint.passive()
    if arguments.without_inertia:
        joint = replace(joint, inertia=None)
    name = arguments.joint or model.joint or 'joint'
    remarks = in_own_units(_remarks(joint, arguments, model), model.is_linear)
    write_atomically(arguments.output, document(form, name, joint, remarks))
    print(f'{arguments.output}: {name}')
    for line in remarks[1:]:
        print(f'  {line}')
    return 0


def _write_table(arguments: Namespace, model: FrictionModel) -> int:
    from friction_comp.model.friction_numbers import loss_of, simulator_joint
    from friction_comp.model.motor_check import cautions

    if arguments.without_inertia:
        raise InputError('--without-inertia does not go with --to csv, which has none')
    if arguments.joint and 'joints' not in read_yaml(arguments.model):
        raise InputError('--joint is the name of the joint in the file: a table has none')
    joint = simulator_joint(model, 'csv')
    names = in_own_units(('velocity (rad/s)', 'torque (N·m)'), model.is_linear)
    write_atomically(arguments.output, '\n'.join([
        ','.join(names), *(f'{v:.6g},{torque:.6g}' for v, torque in zip(*joint.table))]) + '\n')
    print(f'{arguments.output}: {len(joint.table[0])} rows')
    for line in [_missed(*loss_of(model, joint), joint),
                 *(f'Not in it: {line}' for line in joint.left_out), *cautions(model)]:
        print(f'  {in_own_units(line, model.is_linear)}')
    return 0


def _remarks(joint: SimulatorJoint, arguments: Namespace, model: FrictionModel) -> list[str]:
    """Return lines on origin, values, ranges and losses of a form, and what speaks against it."""
    from friction_comp.model.friction_numbers import inertia_holds, KEYS, loss_of
    from friction_comp.model.motor_check import cautions

    form, unit = arguments.to, joint.unit
    lines = [f'Friction of {arguments.model}, by friction_comp {__version__}',
             _missed(*loss_of(model, joint), joint),
             f'Coulomb {joint.coulomb:.4g} {unit}, viscous {joint.viscous:.4g} {unit}·s/rad']
    if 'inertia' in KEYS[form]:
        if joint.inertia:
            lines[-1] += f', inertia {joint.inertia:.4g} kg·m², of {inertia_holds(model)}'
        elif not arguments.without_inertia:
            lines.append('No inertia: the model has none')
    if form == 'isaac':
        lines.append(f'Static friction: {joint.static_is}')
    lines += [f'Range for randomisation: {key} {low:.4g} to {high:.4g}'
              for name, (low, high) in joint.ranges.items()
              if (key := KEYS[form].get(name)) and getattr(joint, name) is not None]
    if joint.ranges:
        lines.append('Ranges: 95 % intervals of the fit')
    lines += [*(f'Not in it: {line}' for line in joint.left_out), *cautions(model)]
    # A name may hold what would end a comment.
    return [' '.join(line.split()) for line in lines]


def _percent(share: float) -> str:
    """Return a share in per cent, with two digits and no power of ten."""
    return f'{100.0 * share:.2g} %' if share < 0.995 else f'{100.0 * share:.0f} %'


def _missed(torque: float, share: float, joint: SimulatorJoint) -> str:
    # Less is a rounding error.
    if share < 1e-6:
        return f'This form misses nothing of the model without the links, in {joint.motion}'
    return (f'This form misses the model by {torque:.3g} {joint.unit} RMS, '
            f'{_percent(share)} of its torque without the links, in {joint.motion}')


def document(form: str, name: str, joint: SimulatorJoint, remarks: list[str]) -> str:
    """Return the text of a file."""
    from friction_comp.model.friction_numbers import KEYS

    if form in ('mujoco', 'urdf', 'sdf'):
        return _xml(form, name, joint, remarks)
    numbers: dict[str, Any] = {key: value for number, key in KEYS[form].items()
                               if (value := getattr(joint, number)) is not None}
    if form == 'tanh':
        numbers['k'] = 1.0 / joint.transition
    ranges = {key: list(joint.ranges[number]) for number, key in KEYS[form].items()
              if number in joint.ranges and key in numbers}
    if form == 'json':
        return json.dumps(plain({
            'joint': name, 'unit': joint.unit, **numbers, 'range': ranges,
            'remarks': remarks}, not_finite=None),
            indent=2, ensure_ascii=False) + '\n'
    what = ('torque = Fc·tanh(k·v) + Fv·v + Fo, N·m, v in rad/s' if form == 'tanh' else
            'Isaac: static, dynamic and viscous friction of a joint, and its armature, SI units')
    what = in_own_units(what, joint.unit == 'N')
    comment = '\n'.join(f'# {line}' for line in [*remarks, what])
    return f'{comment}\n{to_yaml({name: {**numbers, "range": ranges}})}'


def _attributes(joint: SimulatorJoint) -> str:
    """Return the attributes of a joint in MJCF."""
    inertia = f' armature="{joint.inertia:.9g}"' if joint.inertia else ''
    spring = (f' stiffness="{joint.stiffness:.9g}" springref="{joint.rest:.9g}"'
              if joint.stiffness else '')
    return f'frictionloss="{joint.coulomb:.9g}" damping="{joint.viscous:.9g}"{inertia}{spring}'


def _xml(form: str, name: str, joint: SimulatorJoint, remarks: list[str]) -> str:
    quoted = f'"{html.escape(name)}"'
    # Two consecutive hyphens would end an XML comment.
    remark = '\n'.join(f'  {line}' for line in remarks).replace('--', '- -')
    friction, damping = f'{joint.coulomb:.9g}', f'{joint.viscous:.9g}'
    linear = joint.unit == 'N'
    kind = 'prismatic' if linear else 'revolute'
    if form == 'mujoco':
        slide = 'type="slide" ' if linear else ''
        body = (f'<mujoco>\n  <compiler angle="radian"/>\n  <default>\n    <default '
                f'class={quoted}>\n      <joint {slide}{_attributes(joint)}/>'
                '\n    </default>\n  </default>\n</mujoco>\n')
    elif form == 'urdf':
        body = (f'<robot name={quoted}>\n  <joint name={quoted} type="{kind}">'
                f'\n    <dynamics damping="{damping}" friction="{friction}"/>\n  </joint>\n'
                '</robot>\n')
    else:
        spring = (f'<spring_reference>{joint.rest:.9g}</spring_reference>'
                  f'<spring_stiffness>{joint.stiffness:.9g}</spring_stiffness>'
                  if joint.stiffness else '')
        body = (f'<sdf version="1.9">\n  <joint name={quoted} type="{kind}">\n    '
                f'<axis><dynamics><damping>{damping}</damping><friction>{friction}</friction>'
                f'{spring}</dynamics></axis>\n  </joint>\n</sdf>\n')
    return f'<?xml version="1.0"?>\n<!--\n{remark}\n-->\n{body}'
