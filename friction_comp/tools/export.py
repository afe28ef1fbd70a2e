# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool `export`: a model's friction in the form of a simulator or controller.

A `SimulatorJoint` has the numbers as torques. What a form lacks of the model is listed with its
size, and its error is the torque that it misses in the recorded motion. Effects of the links
(weight, the rest of the arm) are left to the simulator's own bodies.
"""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass, field, replace
import html
import json
from pathlib import Path
from typing import Any

import numpy as np

from friction_comp import __version__
from friction_comp.errors import errors_name
from friction_comp.files import plain, to_yaml, write_atomically
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.friction_numbers import (
    friction_of,
    FrictionNumbers,
    inertia_holds,
    motion_in_words,
    near_standstill,
    OF_SPEED,
    speeds_of,
    states_of,
)
from friction_comp.model.motor_check import cautions
from friction_comp.samples import Samples
from friction_comp.statistics import rms
from friction_comp.terminal import in_own_units
from friction_comp.tools.common import Arguments

# Effects of the links and of what they touch.
_LINKS = ('gravity', 'rigid_body', 'other_joints', 'load_torque')
# Names of the numbers in each form; a form lacks those that it does not name.
_KEYS = {
    'mujoco': {'coulomb': 'frictionloss', 'viscous': 'damping', 'inertia': 'armature',
               'stiffness': 'stiffness', 'rest': 'springref'},
    'urdf': {'viscous': 'damping', 'coulomb': 'friction'},
    'sdf': {'viscous': 'damping', 'coulomb': 'friction', 'rest': 'spring_reference',
            'stiffness': 'spring_stiffness'},
    'tanh': {'coulomb': 'Fc', 'viscous': 'Fv', 'offset': 'Fo'},
    'isaac': {'static': 'static_friction', 'coulomb': 'dynamic_friction',
              'viscous': 'viscous_friction', 'inertia': 'armature'},
    'csv': {'offset': 'torque (N·m)'},
    'json': {name: name for name in ('coulomb', 'coulomb_with_load', 'viscous', 'offset', 'static',
                                     'transition', 'inertia', 'stiffness', 'rest')}}
# What the numbers stand in.
_XML = {
    'mujoco': """<mujoco>
  <compiler angle="radian"/>
  <default>
    <default class="{name}">
      <joint{slide}{numbers}/>
    </default>
  </default>
</mujoco>
""",
    'urdf': """<robot name="{name}">
  <joint name="{name}" type="{kind}">
    <dynamics{numbers}/>
  </joint>
</robot>
""",
    'sdf': """<sdf version="1.9">
  <joint name="{name}" type="{kind}">
    <axis><dynamics>{numbers}</dynamics></axis>
  </joint>
</sdf>
"""}
# Speeds of a table over which friction changes its sign, in units of the transition.
_TURNING = np.array([0.2, 0.4, 0.6, 0.8, 1.0, 1.3, 1.7, 2.2, 3.0])


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
    parser.add_argument('--to', choices=tuple(_KEYS), required=True,
                        help='form of the file')
    parser.add_argument('--joint', metavar='NAME', help='joint of the model file of an '
                        'arm, and its name in the file that is written; by default that of the '
                        'model, else "joint"')
    parser.add_output('the file to write')
    arguments = parser.parse(argv)
    model = FrictionModel.load(arguments.model, arguments.joint)
    name = arguments.joint or model.joint or 'joint'
    with errors_name(arguments.model):
        joint = simulator_joint(model, arguments.to)
        if arguments.to not in ('tanh', 'json', 'csv'):
            joint = joint.passive()
        remarks = in_own_units(_remarks(joint, arguments, model), model.is_linear)
    write_atomically(arguments.output, document(arguments.to, name, joint, remarks))
    print(f'{arguments.output}: {name}', *(f'  {line}' for line in remarks[1:]), sep='\n')
    return 0


def _remarks(joint: SimulatorJoint, arguments: Namespace, model: FrictionModel) -> list[str]:
    """Return lines on origin, values, ranges and losses of a form, and what speaks against it."""
    form, unit = arguments.to, joint.unit
    lines = [f'Friction of {arguments.model}, by friction_comp {__version__}',
             _missed(*loss_of(model, joint), joint),
             f'Coulomb {joint.coulomb:.4g} {unit}, viscous {joint.viscous:.4g} {unit}·s/rad']
    if 'inertia' in _KEYS[form]:
        if joint.inertia:
            lines[-1] += f', inertia {joint.inertia:.4g} kg·m², of {inertia_holds(model)}'
        else:
            lines.append('No inertia: the model has none')
    if form == 'isaac':
        lines.append(f'Static friction: {joint.static_is}')
    lines += [f'Range for randomisation: {key} {low:.4g} to {high:.4g}'
              for name, (low, high) in joint.ranges.items()
              if (key := _KEYS[form].get(name)) and getattr(joint, name) is not None]
    if joint.ranges:
        lines.append('Ranges: 95 % intervals of the fit')
    lines += [*(f'Not in it: {line}' for line in joint.left_out), *cautions(model)]
    # A name may hold what would end a comment.
    return [' '.join(line.split()) for line in lines]


def _missed(torque: float, share: float, joint: SimulatorJoint) -> str:
    # Less is a rounding error.
    if share < 1e-6:
        return f'This form misses nothing of the model without the links, in {joint.motion}'
    # With two digits and no power of ten.
    percent = f'{100.0 * share:.2g}' if share < 0.995 else f'{100.0 * share:.0f}'
    return (f'This form misses the model by {torque:.3g} {joint.unit} RMS, {percent} % of its '
            f'torque without the links, in {joint.motion}')


def document(form: str, name: str, joint: SimulatorJoint, remarks: list[str]) -> str:
    """Return the text of a file."""
    if form == 'csv':
        return '\n'.join([in_own_units('velocity (rad/s),torque (N·m)', joint.unit == 'N'), *(
            f'{speed:.6g},{torque:.6g}' for speed, torque in zip(*joint.table))]) + '\n'
    springs = () if joint.stiffness else ('stiffness', 'rest')
    numbers: dict[str, Any] = {
        key: value for number, key in _KEYS[form].items()
        if (value := getattr(joint, number)) is not None and number not in springs}
    if form in _XML:
        filling = ''.join(
            f'<{key}>{value:.9g}</{key}>' if form == 'sdf' else f' {key}="{value:.9g}"'
            for key, value in numbers.items())
        # Two consecutive hyphens would end an XML comment.
        remark = '\n'.join(f'  {line}' for line in remarks).replace('--', '- -')
        slides = joint.unit == 'N'
        body = _XML[form].format(
            name=html.escape(name), numbers=filling, slide=' type="slide"' * slides,
            kind='prismatic' if slides else 'revolute')
        return f'<?xml version="1.0"?>\n<!--\n{remark}\n-->\n{body}'
    if form == 'tanh':
        numbers['k'] = 1.0 / joint.transition
    ranges = {key: list(joint.ranges[number]) for number, key in _KEYS[form].items()
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


@dataclass(frozen=True)
class SimulatorJoint:
    """The numbers of a joint as torques in `unit`."""

    form: str
    coulomb: float          # N·m, without load
    viscous: float          # N·m·s/rad
    offset: float           # N·m
    static: float           # N·m, at breakaway if known, else near standstill
    transition: float       # rad/s over which friction changes sign
    inertia: float | None   # kg·m²
    stiffness: float        # of a spring, N·m/rad
    rest: float             # its rest position, rad
    coulomb_with_load: float | None     # N·m, the mean in the recorded motion
    unit: str               # N·m, or N of a linear axis
    motion: str             # in which sizes and losses hold
    static_is: str          # where the static friction is from
    left_out: list[str]     # what the form lacks, with its size or the reason
    table: tuple[np.ndarray, np.ndarray]    # speeds, ascending, and friction at each, N·m
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)    # 95 % intervals

    def torque(self, motion: Samples) -> np.ndarray:
        """Return the torque of the form in a motion, N·m, shape (N,), with its inertia."""
        keys, speed = _KEYS[self.form], np.asarray(motion.velocity)
        if self.form == 'csv':
            return np.interp(speed, *self.table)
        sign = np.tanh(speed / self.transition) if self.form in ('tanh', 'json') else np.sign(speed)
        torque = self.coulomb * sign + self.viscous * speed + self.offset * ('offset' in keys)
        if self.inertia and 'inertia' in keys and motion.acceleration is not None:
            torque = torque + self.inertia * motion.acceleration
        return torque + self.stiffness * ('stiffness' in keys) * (motion.position - self.rest)

    def passive(self) -> SimulatorJoint:
        """Return the joint without negative numbers, which no simulator takes; `left_out` says so.

        Viscous friction is negative where friction falls with the speed.
        """
        least = {name: 0.0 for name in ('coulomb', 'viscous', 'stiffness')
                 if getattr(self, name) < 0.0}
        return replace(self, **least, left_out=[*self.left_out, *(  # type: ignore[arg-type]
            f'{name} {getattr(self, name):.4g}: simulators take none below zero, so it is 0 here'
            for name in least)], ranges={
                # One that draws from a range would drive the joint with less.
                name: (max(low, 0.0), high) for name, (low, high) in self.ranges.items()
                if high > 0.0 and name not in least})


def simulator_joint(model: FrictionModel, form: str) -> SimulatorJoint:
    """Return the numbers of a model for a form; raises InputError without a torque."""
    gain, numbers = model.torque_per_unit(), friction_of(model)
    spring = next((effect for effect in model.effects if effect.name == 'spring'), None)
    static, static_is, ends = _static(model, numbers.coulomb)
    ranges = {**numbers.intervals, **({'static': ends} if ends else {})}
    found = {'coulomb': numbers.coulomb, 'viscous': numbers.viscous, 'static': static,
             'offset': numbers.offset or 0.0, 'inertia': numbers.inertia,
             'stiffness': spring.coefficients[0] if spring else 0.0,
             'coulomb_with_load': numbers.coulomb_with_load}
    torques = {name: None if value is None else gain * value for name, value in found.items()}
    return SimulatorJoint(
        form, **torques,  # type: ignore[arg-type]
        transition=numbers.transition, rest=spring.values['position'] if spring else 0.0,
        motion=motion_in_words(model), unit='N' if model.is_linear else 'N·m', static_is=static_is,
        left_out=_left_out(model, numbers, form), table=_table(model, gain),
        ranges={name: (gain * low, gain * high) for name, (low, high) in ranges.items()})


def _table(model: FrictionModel, gain: float) -> tuple[np.ndarray, np.ndarray]:
    """Return speeds in both directions, rad/s, ascending, and friction at each, N·m."""
    slow = _TURNING * 2.0 / model.sigmoid.steepness
    speeds = np.union1d(speeds_of(model), slow[slow < speeds_of(model).max()])
    v = np.concatenate((-speeds[::-1], speeds))
    kept = [effect for effect in model.effects if effect.variable in OF_SPEED
            and not effect.needs and not (effect.has_memory and effect.fades_in_sliding)]
    states = Samples(time=0.0 * v, position=0.0 * v, current=0.0 * v, velocity=v)
    return v, gain * replace(model, effects=kept, arm=None).current(states, sliding=True)


def _left_out(model: FrictionModel, numbers: FrictionNumbers, form: str) -> list[str]:
    """Return what a form lacks of a model."""
    keys, gain, lines = _KEYS[form], model.torque_per_unit(), []
    unit = 'N' if model.is_linear else 'N·m'
    held = {effect.name for effect in model.effects if effect.variable in OF_SPEED
            } if form == 'csv' else {'spring'} if 'stiffness' in keys else set()
    if numbers.coulomb_with_load is not None:
        lines.append('friction by load: Coulomb friction here is without load; its mean with load '
                     f'is {gain * numbers.coulomb_with_load:.4g} {unit} in '
                     f'{motion_in_words(model)}')
    if 'offset' not in keys and numbers.offset:
        lines.append(f'offset {gain * numbers.offset:.3g} {unit}: no place for it in this form')
    if 'inertia' not in keys and numbers.inertia:
        lines.append(f'inertia {gain * numbers.inertia:.6g} kg·m²: ' + (
            'not in its formula' if form == 'tanh' else 'belongs to the links of this form'))
    return lines + [one.name.replace('_', ' ') + (
        '' if one.size is None else f' {one.size:.3g} s' if one.unit == 's' else
        f' {gain * one.size:.3g} {unit} RMS') + (
        ': belongs to the links and what they touch' if one.name in _LINKS else '')
        for one in (*numbers.beside, *numbers.left_out) if one.name not in held]


def _static(model: FrictionModel, coulomb: float
            ) -> tuple[float, str, tuple[float, float] | None]:
    """Return the friction at breakaway or near standstill, A, where it is from, and its range."""
    if model.breakaway is not None:
        breakaway = model.breakaway.friction
        # Simulators refuse a static friction below the dynamic one.
        return (breakaway, 'measured breakaway', None) if breakaway >= coulomb else (
            coulomb, 'Coulomb friction: the measured breakaway is lower', None)
    value = near_standstill(model, coulomb)
    if value is None:
        return coulomb, 'Coulomb friction: breakaway was not measured', None
    ends = model.recorded.interval('static', value) if model.recorded is not None else None
    own = ends and (max(ends[0], coulomb), max(ends[1], coulomb))
    if ends and ends[0] <= coulomb:
        return coulomb, ('Coulomb friction: how much higher friction is near standstill, the '
                         'recording hardly tells'), own
    return max(value, coulomb), 'Coulomb with Stribeck friction', own


def loss_of(model: FrictionModel, joint: SimulatorJoint) -> tuple[float, float]:
    """Return what a form misses of the model's torque without links, where the joint slides.

    It is the RMS torque, N·m, and its share of the RMS of the model's torque.
    """
    motion = states_of(model)
    kept = [effect for effect in model.effects if effect.name not in _LINKS
            and (effect.name != 'inertia' or joint.form not in ('tanh', 'csv'))
            and effect.holds_on_another_day
            and all(getattr(motion, name) is not None for name in effect.needs)]
    torque = model.torque_per_unit() * replace(model, arm=None, effects=kept).current(
        motion, sliding=True)
    size, error = rms(torque), rms(torque - joint.torque(motion))
    return error, error / size if size else 0.0
