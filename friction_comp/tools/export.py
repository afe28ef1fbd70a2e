# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``export``: writes a model's friction in a form that simulators and controllers read.

Coulomb and viscous friction, offset and inertia are those that refine prints. Every file states in
a comment, or an entry, what its form misses of the model in the recording's own motion, and how far
a joint of MuJoCo with these numbers strays from the recording (if MuJoCo is installed).
"""

from __future__ import annotations

from argparse import Namespace
import json
import math
from pathlib import Path
from typing import Any, TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np

from friction_comp import __version__
from friction_comp.errors import errors_name, InputError
from friction_comp.files import plain, read_yaml, to_yaml, write_atomically
from friction_comp.tools.common import Arguments, keep_inputs, positive, progress
from friction_comp.tools.refine_arguments import layout_of, OF_TABLE
from friction_comp.units import in_own_units

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.model.simulator_joint import Loss, SimulatorJoint
    from friction_comp.samples import Samples

_FORMS = ('mujoco', 'urdf', 'sdf', 'csv', 'tanh', 'isaac', 'json')
# Largest load of a table by default, N·m.
_LOAD = 10.0
# Share of the torque below which what is missed is a rounding error.
_NOTHING = 1e-6
# Names of the numbers in each form; a form lacks those that it does not name.
_KEYS = {
    'mujoco': {'coulomb': 'frictionloss', 'viscous': 'damping', 'inertia': 'armature'},
    'urdf': {'coulomb': 'friction', 'viscous': 'damping'},
    'sdf': {'coulomb': 'friction', 'viscous': 'damping'},
    'tanh': {'coulomb': 'Fc', 'viscous': 'Fv', 'offset': 'Fo'},
    'isaac': {'static': 'static_friction', 'coulomb': 'dynamic_friction',
              'viscous': 'viscous_friction', 'inertia': 'armature'},
    'json': {name: name for name in ('coulomb', 'viscous', 'offset', 'static', 'transition',
                                     'inertia', 'stiffness', 'rest')}}


def main(argv: list[str] | None = None) -> int:
    """Write the file; returns 0."""
    parser = Arguments('export', __doc__, (
        'output/refined/model.yaml --to mujoco --output output/elbow.xml',
        'unit1/model.yaml unit2/model.yaml --to isaac --output output/elbow.yaml',
        'output/refined/model.yaml --to csv --output output/friction.csv'))
    parser.add_argument('models', metavar='MODEL', type=Path, nargs='+',
                        help='model file; that of a population (refine --each) has ranges of '
                        'further units; of several models, the means and the range over them')
    parser.add_argument('--to', choices=_FORMS, required=True,
                        help='mujoco, urdf, sdf: attributes of one joint; tanh: Fc, k, Fv, Fo; '
                        'isaac: static, dynamic and viscous friction, armature; json: all numbers '
                        'with ranges; csv: a table over speed, position and load')
    parser.add_argument('--joint', metavar='NAME', help='joint of the model file of an '
                        'arm, and its name in the file that is written; by default that of the '
                        'model, else "joint"')
    parser.add_argument('--without-inertia', action='store_true',
                        help='leave out the inertia: it holds all links that moved, which a '
                        'simulator that has the links would count twice')
    parser.add_argument('--top-speed', metavar='RAD/S', type=positive,
                        help='speed up to which friction is a straight line; by default those of '
                        'the recording, else the largest that identification measured, else 1')
    parser.add_argument('--load', metavar='N·M', type=positive,
                        help='largest load of the table, if friction depends on it (10)')
    parser.add_argument('--recording', metavar='FILE', type=Path,
                        help='recording whose motion is played; by default the first that the '
                        'model was refined from, if it is still there')
    parser.add_argument('--columns', metavar='SIGNAL=COLUMN,…', help='columns of that recording, '
                        'if it is a table; by default as refine read them')
    parser.add_argument('--unit', metavar='SIGNAL=UNIT,…', help='units of its signals')
    parser.add_output_file('the file to write')
    arguments = parser.parse(argv)
    keep_inputs(arguments.output, *arguments.models)
    from friction_comp.model.arm_file import joints_of
    from friction_comp.model.friction_model import FrictionModel

    models = [FrictionModel.load(path, arguments.joint) for path in arguments.models]
    if arguments.to == 'csv':
        if arguments.joint and joints_of(read_yaml(arguments.models[0])) is None:
            raise InputError('--joint is the name of the joint in the file: a table has none')
        if len(models) > 1 or arguments.without_inertia:
            raise InputError('--to csv takes one model, without --without-inertia')
        return _write_table(arguments, models[0])
    if arguments.load:
        raise InputError('--load goes with --to csv: the other forms have no effect of the load')
    joint = joint_of(arguments, models)
    if arguments.to not in ('tanh', 'json'):
        joint = joint.passive()
    name = arguments.joint or models[0].joint or 'joint'
    with progress('playing'):
        remarks = in_own_units(remarks_on(joint, arguments, models), joint.unit == 'N')
    write_atomically(arguments.output, document(
        arguments.to, name, joint, remarks, not arguments.without_inertia))
    print(f'{arguments.output}: {name}')
    for line in remarks[1:]:
        print(f'  {line}')
    if joint.inertia and 'inertia' in _KEYS[arguments.to] and not arguments.without_inertia:
        print('  --without-inertia leaves out the inertia')
    return 0


def _write_table(arguments: Namespace, model: FrictionModel) -> int:
    from friction_comp.model.simulator_joint import (
        cautions_of,
        FrictionTable,
        joint_friction_only,
        loss_of,
        simulator_joint,
    )

    with errors_name(arguments.models[0]):
        unit = simulator_joint(model).unit
    load = arguments.load or _LOAD
    table = FrictionTable.of(model, np.linspace(-load, load, 9), arguments.top_speed)
    lines = [','.join(in_own_units(table.names, model.is_linear)), *(
        ','.join(f'{value:.6g}' for value in row) for row in table.rows)]
    motion, _, why_not = recorded_motion(arguments, model)
    write_atomically(arguments.output, '\n'.join(lines) + '\n')
    print(f'{arguments.output}: {len(table.rows)} rows')
    for line in [_missed(loss_of(model, table, 'csv', motion), unit), *why_not]:
        print(f'  {line}')
    lines = [f'Not in it: {line}'
             for line in joint_friction_only(model, ('acceleration', 'load'))[1]]
    for line in [*lines, *cautions_of([model])]:
        print(f'  {in_own_units(line, model.is_linear)}')
    return 0


def joint_of(arguments: Namespace, models: list[FrictionModel]) -> SimulatorJoint:
    """Return the numbers of one model, or of several with the ranges over them."""
    from friction_comp.model.simulator_joint import of_several, simulator_joint

    joints = []
    for path, model in zip(arguments.models, models):
        with errors_name(path):
            joints.append(simulator_joint(model, arguments.top_speed))
    return of_several(joints)


def remarks_on(joint: SimulatorJoint, arguments: Namespace, models: list[FrictionModel]
               ) -> list[str]:
    """Return lines on origin, values, ranges and losses of a form, and what speaks against it."""
    from friction_comp.model.friction_numbers import inertia_holds
    from friction_comp.model.simulator_joint import cautions_of, loss_of

    form, unit, model = arguments.to, joint.unit, models[0]
    lines = [f'Friction of {", ".join(map(str, arguments.models))}, by friction_comp {__version__}',
             f'Coulomb {joint.coulomb:.6g} {unit}, viscous {joint.viscous:.6g} '
             f'{"N·s/m" if unit == "N" else "N·m·s/rad"}']
    has_inertia = 'inertia' in _KEYS[form]
    if has_inertia and joint.inertia and not arguments.without_inertia:
        lines[-1] += f", inertia {joint.inertia:.6g} {'kg' if unit == 'N' else 'kg·m²'}"
        lines.append(f'The inertia is of {inertia_holds(model)}')
    elif has_inertia and not arguments.without_inertia:
        lines.append('No inertia: the model has none')
    if form == 'isaac':
        lines.append(f'Static friction: {joint.static_is}')
    for name, (low, high) in joint.ranges.items():
        if key := _KEYS[form].get(name):
            lines.append(f'Range for randomisation: {key} {low:.4g} to {high:.4g}')
    if joint.ranges_are:
        lines.append(f'Ranges: {joint.ranges_are}')
    motion, torque, why_not = recorded_motion(arguments, model)
    loss = loss_of(model, joint, form, motion)
    lines += [_missed(loss, unit), *_played(joint, form, model, motion, torque), *why_not]
    lines += [f'Not in it: {line}' for line in [*_lacking(joint, form), *joint.left_out]]
    return lines + cautions_of(models)


def _percent(share: float) -> str:
    """Return a share in per cent, with two digits and no power of ten."""
    return f'{100.0 * share:.2g} %' if share < 0.995 else f'{100.0 * share:.0f} %'


def _missed(loss: Loss, unit: str) -> str:
    if loss.share < _NOTHING:
        return f'This form misses nothing of the model without the links, in {loss.motion}'
    return (f'This form misses the model by {loss.torque:.3g} {unit} RMS, {_percent(loss.share)} '
            f'of its torque without the links, in {loss.motion}')


def _lacking(joint: SimulatorJoint, form: str) -> list[str]:
    lines = []
    if form not in ('tanh', 'json') and abs(joint.offset) > 0.02 * abs(joint.coulomb):
        lines.append(f'offset {joint.offset:.3g} {joint.unit}: no place for it in this form')
    if form in ('urdf', 'sdf', 'tanh') and joint.inertia:
        lines.append(f'inertia {joint.inertia:.6g} kg·m²: ' + (
            'not in its formula' if form == 'tanh' else 'belongs to the links of this form'))
    if form in ('urdf', 'isaac', 'tanh') and joint.stiffness:
        lines.append(f'spring {joint.stiffness:.4g} {joint.unit}/rad at {joint.rest:.4g} rad')
    return lines


def _played(joint: SimulatorJoint, form: str, model: FrictionModel, motion: Samples | None,
            torque: np.ndarray | None) -> list[str]:
    """Return a line on how far a joint of MuJoCo strays from the recording, else from a swing."""
    from friction_comp.model.simulator_play import play, swing

    if form == 'tanh':
        return []
    what = 'recorded'
    if motion is None or torque is None:
        motion, torque, what = *swing(model), "model's"
    played = play(joint, motion, torque)
    if played is None:
        return ['Not played in MuJoCo: it needs MuJoCo (pip install mujoco) and an inertia']
    small = 'mm' if joint.unit == 'N' else 'mrad'
    return [f'Played in MuJoCo with the {what} torque, the joint strays {1e3 * played.error:.3g} '
            f'{small} RMS from its motion, {_percent(played.share)} of it; without friction '
            f'{1e3 * played.frictionless:.3g} {small}']


def recorded_motion(arguments: Namespace, model: FrictionModel
                    ) -> tuple[Samples | None, np.ndarray | None, list[str]]:
    """Return a recording's motion, the torque of its motor without links, and why there is none.

    The recording is the one named, else the first that the model was refined from.
    """
    from friction_comp.model.simulator_joint import LINKS
    from friction_comp.recordings import find_recordings, read_recording_with_info

    named = arguments.recording
    paths = [named] if named else [Path(path) for path in model.notes.get('refined_from', ())]
    if not paths or not (named or paths[0].exists()):
        return None, None, ['No recording is at hand: --recording plays one']
    for name in OF_TABLE:
        if getattr(arguments, name, None) is None:
            setattr(arguments, name, None if named else model.notes.get(f'{name}_of_table'))
    try:
        (samples, _), = read_recording_with_info(
            find_recordings(paths[:1])[0], model.joint or None, model.drive.torque_per_current,
            layout=layout_of(arguments), others=model.arm is not None)
        measured = model.measured(samples)
        motion = model.differentiated(model.with_arm(samples))
        for effect in model.effects:
            # `model.measured` has added what the effect `load_torque` subtracts.
            if effect.name in LINKS and (effect.name != 'load_torque' or samples.load is not None):
                measured = measured - effect.current(motion)
    except InputError as error:
        if named:
            raise
        return None, None, [f'The recording was not played: {error}']
    gain = model.torque_per(model.unit) or math.nan
    return motion, gain * np.nan_to_num(measured), []


def document(form: str, name: str, joint: SimulatorJoint, remarks: list[str],
             with_inertia: bool = True) -> str:
    """Return the text of a file."""
    if form in ('mujoco', 'urdf', 'sdf'):
        return _xml(form, name, joint, remarks, with_inertia)
    keys = {number: key for number, key in _KEYS[form].items()
            if with_inertia or number != 'inertia'}
    numbers: dict[str, Any] = {key: value for number, key in keys.items()
                               if (value := getattr(joint, number)) is not None}
    if form == 'tanh':
        numbers['k'] = 1.0 / joint.transition
    ranges = {key: list(joint.ranges[number]) for number, key in keys.items()
              if number in joint.ranges}
    if form == 'json':
        return json.dumps(plain({
            'joint': name, 'unit': joint.unit, **numbers, 'range': ranges,
            'range_is': joint.ranges_are, 'remarks': remarks}, not_finite=None),
            indent=2, ensure_ascii=False) + '\n'
    what = ('torque = Fc·tanh(k·v) + Fv·v + Fo, N·m, v in rad/s' if form == 'tanh' else
            'Isaac: static, dynamic and viscous friction of a joint, and its armature, SI units')
    what = in_own_units(what, joint.unit == 'N')
    comment = '\n'.join(f'# {line}' for line in [*remarks, what])
    return f'{comment}\n{to_yaml({name: {**numbers, "range": ranges}})}'


def _xml(form: str, name: str, joint: SimulatorJoint, remarks: list[str],
         with_inertia: bool) -> str:
    from friction_comp.model.simulator_play import attributes

    # Two consecutive hyphens would end an XML comment.
    remark = '\n'.join(f'  {line}' for line in remarks).replace('--', '- -')
    friction, damping = f'{joint.coulomb:.9g}', f'{joint.viscous:.9g}'
    linear = joint.unit == 'N'
    kind = 'prismatic' if linear else 'revolute'
    if form == 'mujoco':
        slide = 'type="slide" ' if linear else ''
        body = (f'<mujoco>\n  <compiler angle="radian"/>\n  <default>\n    <default '
                f'class={quoteattr(name)}>\n      <joint {slide}{attributes(joint, with_inertia)}/>'
                '\n    </default>\n  </default>\n</mujoco>\n')
    elif form == 'urdf':
        body = (f'<robot name={quoteattr(name)}>\n  <joint name={quoteattr(name)} type="{kind}">'
                f'\n    <dynamics damping="{damping}" friction="{friction}"/>\n  </joint>\n'
                '</robot>\n')
    else:
        spring = (f'<spring_reference>{joint.rest:.9g}</spring_reference>'
                  f'<spring_stiffness>{joint.stiffness:.9g}</spring_stiffness>'
                  if joint.stiffness else '')
        body = (f'<sdf version="1.9">\n  <joint name={quoteattr(name)} type="{kind}">\n    '
                f'<axis><dynamics><damping>{damping}</damping><friction>{friction}</friction>'
                f'{spring}</dynamics></axis>\n  </joint>\n</sdf>\n')
    return f'<?xml version="1.0"?>\n<!--\n{remark}\n-->\n{body}'
