# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Writes one page for each effect from the class itself: formula, picture, how to record for it."""

from __future__ import annotations

import inspect
from pathlib import Path

import numpy as np

from friction_comp.model.effect import Coverage
from friction_comp.model.effects import EFFECTS
from friction_comp.refinement.thresholds import table
from friction_comp.reports.figures import curve, panels, to_svg
from friction_comp.samples import Samples

# What a recording must contain so that effects of a variable can be found and distinguished.
RECORD = {
    'velocity': """\
Move at many speeds, slow ones included (below 0.05 rad/s for the Stribeck effect),
in both directions; constant velocities of a second and more show it best.""",
    'direction': 'Move with the same speeds in both directions over the same range.',
    'position': """\
Move slowly and steadily over the whole range, several times in both directions. A
ripple of n periods per turn needs ten samples per period and more.""",
    'acceleration': """\
Change speed briskly: a sine sweep, or starts and stops. Constant velocities show
nothing of it.""",
    'load': """\
Record `interaction_wrench`, and let the load change independently of the motion: hold
against the moving joint now and then.""",
    'temperature': """\
Record `motor_temperature` from cold to warm (20 minutes and more), and once from
warm to cold: in one warm-up alone, temperature and time cannot be told apart.""",
    'time': """\
Record for several times as long as the change takes, from a cold start, with the same
movement throughout. It describes this recording, and is not expected to hold on another day.""",
    'history': """\
Reverse often and rest for different times, with a fine encoder and 500 Hz and
more.""",
    'other joints': """\
Record the whole arm, move the other joints as well, and give `refine` the URDF:
`--urdf arm.urdf`.""",
}
_ROLES = {
    'resists': 'It resists: it takes energy from every motion, as friction does.',
    'carries': 'It carries: it pushes whatever the direction of motion, as gravity does.',
    'neither': 'It is no torque at the joint.'}
_INTRODUCTION = """The drive's current is the sigmoid of Eq. 6 plus a sum of these. Each page comes
from the class that computes the effect."""
# Periods per turn of the ripple that is drawn, and number of samples.
_PERIODS, _SIZE = 8.0, 800
_AXES = {'velocity': 'velocity (rad/s)', 'position': 'position (rad)', 'load': 'load (N·m)',
         'acceleration': 'acceleration (rad/s²)', 'temperature': 'temperature (°C)',
         'time': 'time (s)'}
_AXIS_OF = {'direction': 'velocity', 'history': 'position', 'other joints': 'position'}
COVERAGE = Coverage(transition=0.02, speed=1.0, slowest=0.01, lowest=-1.0, highest=1.0,
                    duration=60.0)


def write_pages(folder: Path) -> None:
    """Write the pages and their index into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for name, kind in EFFECTS.items():
        (folder / f'{name}.md').write_text(page_of(name, kind, folder), encoding='utf-8')
        rows.append(f'| [{name}]({name}.md) | {kind.variable} | {kind.role} '
                    f'| {"no" if kind.not_fed_back else "yes"} |')
    (folder / 'index.md').write_text('\n'.join([
        '# Effects', '', _INTRODUCTION, '', '| effect | depends on | role | fed back |',
        '|---|---|---|---|', *rows, '', ':::{toctree}', ':hidden:', '', *EFFECTS, ':::', '']),
        encoding='utf-8')


def page_of(name, kind, folder):
    """Return an effect's page; its picture goes into the folder."""
    text = inspect.getdoc(kind).replace('``', '`')
    lines = [f'# {name}', '', text, '', f'Depends on: **{kind.variable}**. {_ROLES[kind.role]}', '']
    if draw(name, kind, folder / f'{name}.svg'):
        lines += [f'![{name} over what it depends on]({name}.svg)', '',
                  'With constants from the middle of the search, a coefficient of 1 for the first '
                  'column, and 0 for the others.', '']
    lines += ['## How to record for it', '', RECORD[kind.variable], '']
    if kind.needs:
        lines += [f'It needs: {", ".join(f"`{need}`" for need in kind.needs)}.', '']
    lines += ['## In the model file', '', '| entry | meaning |', '|---|---|',
              '| `coefficients` | A, one for each column of the formula |']
    lines += [f'| `{constant}` | '
              + ('searched' if search is not None else 'shared by all effects, or found otherwise')
              + ' |' for constant, search in kind.constants.items()]
    lines += ['', f'A model may have {kind.max_count if kind.max_count > 1 else "one"} of it.', '',
              '## In the compensator', '',
              f'It is not fed back: {kind.not_fed_back}.' if kind.not_fed_back
              else 'It is fed back.']
    return '\n'.join(lines) + '\n'


def draw(name, kind, path):
    """Draw the first column over its variable and tell whether there was anything to draw."""
    grid = kind.points(COVERAGE)
    if not grid:
        return False
    axis = _AXIS_OF.get(kind.variable, kind.variable)
    samples = motion(axis)
    # The frequency of a ripple is found by a spectrum, not in the grid.
    constants = {**({'frequency': _PERIODS} if 'frequency' in kind.constants else {}),
                 **grid[len(grid) // 2]}
    column = kind.matrix(samples, constants)[:, 0]
    figure, (axes,) = panels(['current (A)'], _AXES[axis], 2.0)
    curve(axes, getattr(samples, axis), column, 'predicted')
    path.write_text(to_svg(figure), encoding='utf-8')
    return True


def motion(axis):
    """Return samples that sweep one variable, there and back where it is a position."""
    time = np.linspace(0.0, COVERAGE.duration, _SIZE)
    ramp = np.linspace(-1.0, 1.0, _SIZE)
    position = np.sin(4.0 * np.pi * time / COVERAGE.duration) if axis == 'position' else 0.3 * ramp
    velocity = {'velocity': ramp, 'position': np.gradient(position, time)}.get(axis, 0.5 + 0 * ramp)
    return Samples(
        time=time, position=position, current=0.0 * ramp, velocity=velocity,
        acceleration=ramp if axis == 'acceleration' else 0.0 * ramp,
        load=5.0 * ramp if axis == 'load' else ramp, temperature=35.0 + 10.0 * ramp,
        rigid_body=5.0 * ramp, coupling=ramp)


def write_thresholds(path: Path) -> None:
    """Write the table of what refinement asks for, from where refinement takes it."""
    lines = ['| name | value | unit | why |', '|---|---|---|---|']
    lines += [f'| `{name}` | {value:g} | {unit} | {why} |' for name, value, unit, why in table()]
    path.write_text('\n'.join(lines) + '\n', encoding='utf-8')
