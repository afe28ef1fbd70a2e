# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``export``: writes a model's friction in a form that simulators read.

Simulators support Coulomb and viscous friction, an inertia and a spring of a joint. The tool
computes the error of that simplified form, prints it and writes it into the file.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from friction_comp import __version__
from friction_comp.errors import InputError
from friction_comp.files import read_yaml, write_atomically
from friction_comp.tools.common import Arguments, keep_inputs, positive

if TYPE_CHECKING:
    from friction_comp.model.simulator_joint import SimulatorJoint

_FORMS = ('mujoco', 'urdf', 'sdf', 'csv')
# Largest load of a table by default, N·m.
_LOAD = 10.0


def main(argv: list[str] | None = None) -> int:
    """Write the file; returns 0."""
    parser = Arguments('export', __doc__, (
        'config/armin_configuration_2.yaml --to mujoco --output output/elbow.xml',
        'output/refined/model.yaml --to csv --output output/friction.csv'))
    parser.add_argument('model', metavar='MODEL', type=Path, help='model file')
    parser.add_argument('--to', choices=_FORMS, required=True,
                        help='mujoco, urdf, sdf: attributes of one joint; csv: a table over '
                        'speed, position and load')
    parser.add_argument('--joint', metavar='NAME', help='joint of the model file of an '
                        'arm, and its name in the file that is written; by default that of the '
                        'model, else "joint"')
    parser.add_argument('--top-speed', metavar='RAD/S', type=positive,
                        help='speed up to which the form is fitted; by default the largest that '
                        'identification measured, or 1 without one')
    parser.add_argument('--load', metavar='N·M', type=positive,
                        help='largest load of the table, if friction depends on it (10)')
    parser.add_output_file('the file to write')
    arguments = parser.parse(argv)
    keep_inputs(arguments.output, arguments.model)
    import numpy as np

    from friction_comp.model.friction_model import FrictionModel, joints_of
    from friction_comp.model.simulator_joint import friction_table, simulator_joint

    model = FrictionModel.load(arguments.model, arguments.joint)
    if arguments.to == 'csv':
        if arguments.joint and joints_of(read_yaml(arguments.model)) is None:
            raise InputError('--joint is the name of the joint in the file: a table has none')
        load = arguments.load or _LOAD
        names, rows = friction_table(model, np.linspace(-load, load, 9), arguments.top_speed)
        lines = [','.join(names), *(','.join(f'{value:.6g}' for value in row) for row in rows)]
        write_atomically(arguments.output, '\n'.join(lines) + '\n')
        print(f'{arguments.output}: {len(rows)} rows')
        return 0
    if arguments.load:
        raise InputError('--load goes with --to csv: the other forms have no effect of the load')
    joint = simulator_joint(model, arguments.top_speed)
    name = arguments.joint or model.joint or 'joint'
    remarks = remarks_on(joint, str(arguments.model))
    write_atomically(arguments.output, document(arguments.to, name, joint, remarks))
    print(f'{arguments.output}: {name}')
    for line in remarks[1:]:
        print(f'  {line}')
    return 0


def remarks_on(joint: SimulatorJoint, model: str) -> list[str]:
    """Return lines on origin, values and error of the simplified form, as a comment."""
    return [
        f'Friction of {model}, by friction_comp {__version__}',
        f'Coulomb {joint.friction:.6g} N·m, viscous {joint.damping:.6g} N·m·s/rad, inertia of the '
        f'drive {joint.inertia:.6g} kg·m²',
        f'This form misses the model by {joint.error:.3g} N·m RMS, '
        f'{100 * joint.relative_error:.2g} % of its friction, in sweeps at constant speeds up to '
        f'{joint.top_speed:.3g} rad/s',
        *(f'Not in it: {line}' for line in joint.left_out)]


def document(form: str, name: str, joint: SimulatorJoint, remarks: list[str]) -> str:
    """Return the text of a file for 'mujoco', 'urdf' or 'sdf'."""
    # Two consecutive hyphens would end an XML comment.
    remark = '\n'.join(f'  {line}' for line in remarks).replace('--', '- -')
    friction, damping = f'{joint.friction:.9g}', f'{joint.damping:.9g}'
    if form == 'mujoco':
        spring = (f' stiffness="{joint.stiffness:.9g}" springref="{joint.rest:.9g}"'
                  if joint.stiffness > 0.0 else '')
        body = (f'<mujoco>\n  <compiler angle="radian"/>\n  <default>\n    <default '
                f'class={quoteattr(name)}>\n      <joint frictionloss="{friction}" '
                f'damping="{damping}" armature="{joint.inertia:.9g}"{spring}/>\n    </default>\n'
                '  </default>\n</mujoco>\n')
    elif form == 'urdf':
        body = (f'<robot name={quoteattr(name)}>\n  <joint name={quoteattr(name)} type="revolute">'
                f'\n    <dynamics damping="{damping}" friction="{friction}"/>\n  </joint>\n'
                '</robot>\n')
    else:
        spring = (f'<spring_reference>{joint.rest:.9g}</spring_reference>'
                  f'<spring_stiffness>{joint.stiffness:.9g}</spring_stiffness>'
                  if joint.stiffness > 0.0 else '')
        body = (f'<sdf version="1.9">\n  <joint name={quoteattr(name)} type="revolute">\n    '
                f'<axis><dynamics><damping>{damping}</damping><friction>{friction}</friction>'
                f'{spring}</dynamics></axis>\n  </joint>\n</sdf>\n')
    return f'<?xml version="1.0"?>\n<!--\n{remark}\n-->\n{body}'
