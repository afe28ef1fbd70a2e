# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Pages on several refinements, on a planned motion, and on friction at constant speeds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
import math
from typing import Any, TYPE_CHECKING

from matplotlib.figure import Figure
import numpy as np

from friction_comp.model.friction_model import FrictionModel
from friction_comp.reports.figures import COLOURS, curve, measured_and_predicted, panels, styled
from friction_comp.reports.html import Link, Report, value
from friction_comp.reports.refinement_page import (
    add_steps,
    effect_names,
    NAMES,
    number_rows,
    number_texts,
    Row,
)
from friction_comp.samples import Samples
from friction_comp.terminal import interval_text, number, quantity

if TYPE_CHECKING:
    from friction_comp.arm.fit import ArmResult
    from friction_comp.evaluation.fleet import ParameterSpread, Population
    from friction_comp.excitation.plan import JointPlan, Pair

_VERDICTS = ('trust', 'trust in part', 'record again')


def verdict(content: dict[str, Any]) -> str:
    """Return the result of all recordings as sentences; `content` is that of report.json."""
    rows, failed = content['recordings'], content['failed']
    kinds = Counter(row['verdict'] for row in rows)
    counts = ', '.join(f'{name}: {kinds[name]}' for name in _VERDICTS if kinds[name])
    text = f'**{len(rows)} of {len(rows) + len(failed)} refined** ({counts}).'
    if failed:
        text += f' **{len(failed)} could not be used**; the reasons are below.'
    return text


def each_page(content: dict[str, Any], populations: Sequence[Population] = ()) -> Report:
    """Return the page of report.json; `populations` compare the units of a fleet by joint."""
    rows = content['recordings']
    joints = list(dict.fromkeys(row['joint'] for row in rows))
    named = f'; joints: {", ".join(joints)}' * any(joints)
    page = Report('A fleet, unit by unit' if populations else 'Friction, recording by recording',
                  f'{len(rows)} refined separately{named}')
    page.verdict('\n\n'.join([*map(fleet_verdict, populations), verdict(content)]))
    for population in populations:
        _add_fleet(page, population)
    page.heading('Recordings')
    for unit in dict.fromkeys(row['unit'] for row in rows):
        own = [row for row in rows if row['unit'] == unit]
        page.table(
            ['recording', *['joint'] * (len(joints) > 1), 'verdict', f'before ({unit})',
             f'after ({unit})', 'found'],
            [[Link(row['folder'], f"{row['folder']}/report.html"),
              *[row['joint']] * (len(joints) > 1), row['verdict'], row['before'], row['after'],
              effect_names(effect['name'] for effect in row['effects'])
              + ''.join(f'; depends on {name}, too' for name in row['unexplained'])]
             for row in own],
            'RMS of measured minus predicted on parts that were not fitted: of the friction curve '
            'alone or the model given, and of the refined model.')
    page.table([*['joint'] * (len(joints) > 1), 'effect', 'depends on', 'found in'],
               [row[len(joints) < 2:] for row in _effect_rows(rows, joints)],
               'An effect that only some recordings show lacks a motion in the others, or is no '
               'property of the drive.')
    page.bullets(content['failed'], 'Not usable:')
    return page


def fleet_verdict(population: Population) -> str:
    """Return in one or two sentences which units are out and what varies most."""
    count, out = len(population.units), population.out
    joint = f' (joint {population.joint})' if population.joint else ''
    text = f'**None of {count} units is out**{joint}.'
    if out:
        text = f'**Look at {len(out)} of {count} units**{joint}: ' + '; '.join(
            f'{unit} is out in {", ".join(names)}' for unit, names in out.items()) + '.'
    varying = sorted((one for one in population.parameters if one.varies and
                      one.scale == 'logarithmic'), key=lambda one: -one.spread)
    if varying:
        text += ' From unit to unit vary most: ' + ', '.join(
            f'{one.name} ({_spread(one)})' for one in varying[:3]) + '.'
    return text


def _add_fleet(page: Report, population: Population) -> None:
    joint = f': {population.joint}' if population.joint else ''
    page.heading(f'Unit by unit{joint}')
    out = [(parameter, unit) for parameter in population.parameters
           for unit in parameter.units if unit.out]
    if out:
        page.table(
            ['unit', 'parameter', 'value', '95 % of units'],
            [[unit.unit, one.name, f'{number(unit.value)} {one.unit}', interval_text(one.range)]
             for one, unit in sorted(out, key=lambda entry: entry[1].unit)],
            'Units that are out, and by what.')
    page.table(
        ['parameter', 'mean', 'spread', '95 % of units'],
        [[one.name, f'{number(one.mean)} {one.unit}',
          _spread(one) if one.varies else 'not\u00a0seen', interval_text(one.range)]
         for one in population.parameters],
        'The population, without the units that are out. The spread is the standard deviation '
        'between units, without what errors of measurement explain.')
    repeated = population.recordings > len(population.units)
    page.text(
        f'{population.recordings} recordings of {len(population.units)} units. ' + (
            'What differs between recordings of one unit counts as error of its value. ' if repeated
            else 'With one recording of each unit, what differs from day to day counts as a '
            'difference between units: record some units twice to tell these apart. ')
        + 'In a fleet without an odd unit, one is called out on 5 of 100 pages like this one.')
    page.text('`fleet.json` holds all of this and the values of each unit.')


def _spread(one: ParameterSpread) -> str:
    """Return the spread, in per cent of what is positive."""
    if one.scale == 'logarithmic':
        return f'{number(100.0 * math.expm1(one.spread), 2)} %'
    return f'{number(one.spread, 2)} {one.unit}'


def _effect_rows(rows: list[dict[str, Any]], joints: list[str]) -> list[list[str]]:
    table: list[list[str]] = []
    for joint in joints:
        own = [row for row in rows if row['joint'] == joint]
        counts = Counter((effect['name'], effect['variable']) for row in own
                         for effect in {e['name']: e for e in row['effects']}.values())
        table.extend([joint, name.replace('_', ' '), variable, f'{count} of {len(own)}']
                     for (name, variable), count in counts.most_common())
    return table or [['', 'none', '', '']]


def arm_page(result: ArmResult, names: list[str], folders: dict[str, str]) -> Report:
    """Return the page; `names` are the recordings, `folders` those with each joint's page."""
    page = Report('Friction of the joints of an arm', ', '.join(names))
    reports = {name: joint_result.report for name, joint_result in result.results.items()}
    unit = next(iter(reports.values())).unit
    page.verdict('; '.join(f'{name}: **{report.verdict}**' for name, report in reports.items()))
    page.table(
        ['joint', 'verdict', 'before', 'after', 'found'],
        [[Link(name, f'{folders[name]}/report.html'), report.verdict,
          quantity(report.before.held_out_rmse, unit), quantity(report.after.held_out_rmse, unit),
          effect_names(effect.name for effect in report.effects)]
         for name, report in reports.items()],
        'RMS of measured minus predicted on parts that were not fitted, by the initial model and '
        'by the refined one; each name links to the page on that joint.')
    for name, report in reports.items():
        if report.verdict != 'trust':
            page.bullets(report.reasons, f'Limits the verdict on {name}:')
    _add_links(page, result, unit)
    return page


def _add_links(page: Report, result: ArmResult, unit: str) -> None:
    arm = result.report()
    page.heading('Weight and inertia of the links')
    page.text(
        'Only sums along the arm are certain: an error of one mass may be compensated by that of '
        'a neighbouring link, or by the current per torque where torque constants were not given.')
    page.table(
        ['link after joint', 'mass (kg)', 'URDF (kg)', 'from the recording', f'{unit} per N·m'],
        [[row['joint'], _with_interval(row, 'mass'), number(row['mass_urdf']),
          f"{100.0 * row['told_by_recording']['mass']:.0f} %",
          _with_interval(row, 'current_per_torque')] for row in arm['rigid_bodies']],
        'With 95 % intervals. "From the recording" is the share by which the recording reduces the '
        'uncertainty; below one half the value is that of the URDF and has no interval. All ten '
        'parameters of each link are in report.json.')
    page.bullets(arm['notes'])


def _with_interval(row: dict[str, Any], name: str) -> str:
    return f"{number(row[name])} ({interval_text(row['intervals'][name])})"


def excitation_page(plans: Sequence[JointPlan]) -> Report:
    """Return the page on a planned motion."""
    seconds = plans[0].seconds
    page = Report('Planned motion', f'{len(plans)} joint{"s" * (len(plans) > 1)}, {seconds:g} s')
    worst = min((share, pair, plan.limits.joint) for plan in plans
                for pair, share in plan.separation.items())
    page.verdict('**Check the motion for collisions, then play `trajectory.yaml`.** Hardest to '
                 f'distinguish: {_pair_text(worst[1])} of joint {worst[2]}; {100 * worst[0]:.2g} % '
                 'of one is independent of the other and of the friction curve.')
    for plan in plans:
        page.heading(f'Joint {plan.limits.joint}')
        page.figure(_plan_figure(plan), 'Position and velocity over time, and velocity over '
                    'position; broken: the limits.')
        page.table(
            ['effects', 'apart'],
            [[_pair_text(pair), f'{100 * share:.2g} %'] for pair, share in plan.separation.items()])
    page.text('The percentage is the part of one effect that is independent of the other: the '
              "smallest for several values of the effects' constants. It depends on the motion "
              'alone; whether `refine` finds an effect also depends on noise and on its size.')
    return page


def _pair_text(pair: Pair) -> str:
    return ' and '.join(pair).replace('_', ' ')


@styled
def _plan_figure(plan: JointPlan) -> Figure:
    motion, limits = plan.samples(50.0), plan.limits
    figure, (place, speed, both) = panels(
        ['position (rad)', 'velocity (rad/s)', 'velocity (rad/s)'],
        ['', 'time (s)', 'position (rad)'], (1.3, 1.3, 1.8))
    curve(place, motion.time, motion.position, 'predicted')
    curve(speed, motion.time, motion.velocity, 'predicted', linewidth=0.9)
    curve(both, motion.position, motion.velocity, 'predicted', style='.', markersize=2.5)
    for end in (limits.lowest, limits.highest):
        place.axhline(end, color=COLOURS['faint'], linestyle='--', linewidth=0.9)
        both.axvline(end, color=COLOURS['faint'], linestyle='--', linewidth=0.9)
    for end in (-limits.velocity, limits.velocity):
        for axes in (speed, both):
            axes.axhline(end, color=COLOURS['faint'], linestyle='--', linewidth=0.9)
    return figure


def steady_state_rows(report: dict[str, Any]) -> list[Row]:
    """Return a row for each number."""
    friction = report['friction']
    return [Row(key, name, *number_texts(
        friction[key], friction['intervals'][key], unit.replace('A', report['unit'], 1)), '')
        for key, (name, unit) in NAMES.items() if friction.get(key) is not None]


def steady_state_page(report: dict[str, Any], model: FrictionModel, speeds: np.ndarray,
                      currents: np.ndarray, name: str, steps: Sequence[tuple[str, str]]) -> Report:
    """Return the page on a table of steady states; `report` is the content of report.json."""
    page = Report(f'Friction of {f"joint {model.joint}" if model.joint else "the joint"} at '
                  'constant speeds', f'{name}: {len(speeds)} speeds', model.is_linear)
    unit = report['unit']
    page.verdict(f'**{report["verdict"][0].upper()}{report["verdict"][1:]}**: '
                 f'{report["reasons"][0]}')
    page.numbers([
        (value('error', quantity(report['after']['held_out_rmse'], unit)),
         'error of each row, predicted by a fit to all others'),
        (value('before', quantity(report['before']['held_out_rmse'], unit)),
         'Coulomb and viscous friction alone')])
    page.bullets(report['reasons'][1:], 'Also:')
    page.table(['friction', 'value', '95 % interval'], number_rows(steady_state_rows(report)))
    add_steps(page, steps)
    page.figure(_steady_figure(model, speeds, currents, unit), 'Dots: the rows of the table; '
                'line: the fitted curve. Below: the difference.')
    page.text('Inertia, weight and breakaway do not show in such a table, and the sign change of '
              'friction is assumed to be faster than the slowest speed.')
    return page


@styled
def _steady_figure(model: FrictionModel, speeds: np.ndarray, currents: np.ndarray, unit: str
                   ) -> Figure:
    def fitted(velocity: np.ndarray) -> np.ndarray:
        return model.current(Samples(np.arange(float(len(velocity))), velocity, velocity,
                                     velocity=velocity))
    top = float(np.max(np.abs(speeds)))
    grid = np.linspace(-top if speeds.min() < 0 else 0.0, top if speeds.max() > 0 else 0.0, 1001)
    return measured_and_predicted(
        (f'friction ({unit})', f'error ({unit})'), 'velocity (rad/s)', (grid, fitted(grid)), 'fit',
        (speeds, currents), currents - fitted(speeds))[0]
