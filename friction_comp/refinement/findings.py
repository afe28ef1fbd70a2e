# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a report can find: its text, how far it lowers the verdict, and what to record instead.

The verdict is the grade of the worst finding.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
import re
from typing import Any

from friction_comp.refinement.result import AGAIN, Finding, IN_PART, TRUST, Verdict

_FINDINGS = {
    'pushes': (
        AGAIN, 'Friction would have to push to explain the current: the current is a '
        "controller's response, something that was not recorded moves the joint, or the sign of "
        'effort or position is reversed.',
        'check the signs of effort and position, and that effort is measured; follow a trajectory '
        'with a softer or a position controller'),
    'turned': (
        AGAIN, 'The motor brakes the motion: only with its sign reversed is the current that of a '
        'drive with friction. Effort or position has the wrong sign, or another torque drives the '
        'joint.',
        'the same with the sign of effort reversed (--unit effort=-1Nm or '
        'current=-1A)'),
    'explains_nothing': (
        AGAIN, 'Where it was not fitted, the model may be {error:.2g} A off in motion, a constant '
        '{constant:.2g} A: the current depends on something that is not in the recording.',
        'record what loads the joint (torque sensor, other joints), or move it without load'),
    'explains_part': (
        IN_PART, '{error:.2g} A remain unexplained, of {constant:.2g} A beside a constant.',
        'record what loads the joint (torque sensor, other joints)'),
    'above_noise': (
        IN_PART, 'The error, {error:.2g} A, is {times:.0f} times the noise of the current: '
        'something acts on the joint that was not recorded, or that no effect describes.',
        'record what acts on the joint (load, temperature, other joints; a URDF)'),
    'no_friction': (
        AGAIN, 'No friction shows in this current: it is the torque behind the gear, a '
        "controller's request, or that of a motor whose joint is moved by hand.",
        'the current of the motor that moves the joint, or its torque before the gear (where it is '
        'in the table, --columns current=NAME,link_torque=NAME); of a joint moved by hand, the '
        "hand's torque as the load"),
    'load_reversed': (
        AGAIN, 'The current grows with the load, {coefficient:.3g} A per N·m: one of them has the '
        'wrong sign. The load is the torque that moves the joint from outside.',
        'the same with the sign of the load reversed (in a table, --unit load=-1Nm)'),
    'doubtful': (IN_PART, '{doubt}', 'record the same over a wider range, and other joints'),
    'extrapolates': (
        IN_PART, '{part} that was not fitted is predicted with {growth:.2g} times the error: the '
        'model is only supported where it was fitted.', 'record more values of {variable}'),
    'recordings_differ': (
        IN_PART, 'The recordings differ: fitted together, each is predicted with {ratio:.2g} times '
        'the error of a fit to itself. What differs most is {name}, {least:.3g} to {most:.3g} in '
        'fits to each.',
        'refine each recording alone (--each), or record what differs (temperature, load, unit)'),
    'counted': (
        IN_PART, 'The steps of the velocity are coarse: motion at changing speed is predicted with '
        '{growth:.2g} times the error.', 'a velocity with finer steps'),
    'other_turn': (
        IN_PART, 'No whole number of ripples is in a turn of 2π, but {numbers} if position is in '
        '{unit}: its unit, which is taken for rad, seems to be this.',
        'nothing: give the unit, --unit position={unit}'),
    'unexplained': (IN_PART, 'The remaining error depends on {variable}: {note}.', ''),
    'ambiguous': (IN_PART, '{variables}: {why}.', '{experiment}'),
    'other_joints': (
        IN_PART, 'Other joints moved too ({joints}), and no URDF gives the torques of their '
        'links: the model may not hold in other postures.',
        'move this joint alone, or give a URDF of the arm (--urdf)'),
    'one_posture': (
        TRUST, 'The other joints ({joints}) rested: weight and inertia are those of their posture.',
        ''),
    'moves_as_one': (
        AGAIN, 'The position of {joint} follows from those of the other joints: the recording '
        'cannot show on which of them the current depends, and other motion may be predicted much '
        'worse.', 'move the joints independently of each other, or leave out the columns of one '
        'that is on the same shaft'),
    'velocity': (
        IN_PART, '{fault}.', 'let one clock stamp position, velocity and current, and check the '
        'units of velocity'),
    'lost_rows': (
        IN_PART, 'Rows are missing: in {percent:.2g} % of them the position moves twice as far as '
        'around them, or farther, though times say otherwise. Speeds are uncertain, and inertia '
        'may be outside its interval.',
        'the time of each row, by the clock of who measures'),
    'coarse': (
        IN_PART, '{reason}', 'record the motor-side encoder, or move over a wider range'),
    'hardly_moved': (
        AGAIN, 'The joint hardly moved: over {steps:.0f} steps of its encoder, at {speed:.2g} '
        'rad/s at most. It may only have given way, and what is called friction may be elastic.',
        'move further and faster, until the joint slides'),
    'one_direction': (
        IN_PART, 'Motion was in one direction only: Coulomb friction cannot be distinguished from '
        'an offset.', 'move in both directions'),
    'passed_once': (
        AGAIN, 'The joint passed most places once: what depends on position, speed, direction or '
        'time cannot be told apart, and other motion may be predicted much worse.',
        'move to and fro over the same places several times, at several speeds'),
    'ceiling': (
        IN_PART, 'The current ends at a limit, {ends}, in {percent:.1f} % of the samples, which '
        'are left out.',
        'raise the limit of current or sensor, or use less acceleration and speed'),
    'not_told_apart': (
        TRUST, 'The motion hardly tells {names} from weight, a spring, friction at other speeds or '
        'a lag of the current: see the intervals. Several frequencies and amplitudes would tell.',
        ''),
    'unknown_friction': (
        IN_PART, 'Coulomb friction may be {low:.3g} to {high:.3g} A: the model predicts, but what '
        'of it is friction is not known.', 'record slow and fast motion in both directions'),
    'no_temperature': (
        TRUST, 'Motor temperature was not recorded: its effect can only show as drift over time.',
        ''),
    'helped_person': (
        AGAIN, 'A compensator helped a person, whose torque was not recorded: the current is what '
        'the motor gave, which is a part of friction.',
        "the person's torque (interaction_wrench), or a motion by the motor alone"),
    'may_have_helped': (
        IN_PART, 'The motor gave just what was commanded, and nothing that accelerates the joint: '
        'where a compensator commanded it and a person moved the joint, which this recording does '
        'not tell, the current is only a part of friction.',
        "the person's torque (interaction_wrench), /diagnostics, or a faster motion without the "
        'compensator'),
    'no_load': (
        TRUST, 'No load was recorded: effects of load, and an error of the torque constant, cannot '
        'be seen, and what a hand gives to the motion is missing from friction.', ''),
    'not_seen': (TRUST, '{reason}', ''),
    'one_load': (
        IN_PART, '{load} hardly varied, {low:.3g} to {high:.3g} N·m: friction and offset that '
        'depend on it cannot be told from those that do not, and hold at such loads only.',
        'record several loads, and none'),
    'impossible_friction': (
        AGAIN, 'Coulomb friction would be {value:.3g} A, where the largest current is '
        '{largest:.3g} A: other terms cancel it, and none of them is that of the drive.',
        'more speeds in both directions, with a joint that slides'),
    'negative_friction': (
        IN_PART, 'The straight line through friction has {name} below zero, {value:.3g}, '
        'which no drive has: neither its Coulomb nor its viscous friction is that of the drive.',
        'record more constant speeds, with a finer encoder or a stiffer controller'),
    'late_current': (
        TRUST, 'The recorded current follows the motion late, as after a filter of {lag:.3g} ms, '
        'which is undone: another lag would change the inertia by viscous friction times the '
        'difference.', ''),
    'no_presliding': (
        TRUST, '{what} not known, which a law needs at starts and turns: {why}. Ten slow reversals '
        '(a sine of 0.1 Hz) at 500 Hz or more show it.', ''),
    'breakaway_taken_along': (
        TRUST, 'Breakaway friction was not measured here: it is that of the given model, times '
        '{factor:.3g} as friction in sliding. Identification measures it.', ''),
    'short': (
        TRUST, 'The longest recording lasts {duration:.3g} s: warm-up takes minutes and cannot be '
        'seen in full.', ''),
    'written': (
        AGAIN, 'The model as written predicts with an error of {error:.3g} A, but its fit had '
        '{fitted:.3g} A.', '')}

_EXPERIMENTS = {
    ('temperature', 'time'):
        'record the motor once warm from the start, or cool it while it keeps moving',
    ('acceleration', 'history'):
        'record movements of the same speed with several different accelerations, and reversals',
    ('acceleration', 'position'):
        'record the same positions at several accelerations, such as two different tempos',
    ('position', 'velocity'):
        'record the same positions at several speeds and in both directions',
    ('position', 'position'):
        'move over a wider range, at a slow constant speed and in both directions',
    ('history', 'velocity'):
        'record slow constant speeds that last, and reversals without a rest',
    ('velocity', 'velocity'): 'record more constant speeds, slow ones among them',
    ('position', 'time'): 'record the same positions early and late, several times over',
    ('time', 'velocity'): 'record the same speeds early and late, in another order',
    ('acceleration', 'time'): 'record the same tempos early and late, in another order',
    ('temperature', 'velocity'): 'record the same speeds cold and warm',
    ('direction', 'velocity'): 'record the same speeds in both directions'}


def finding(code: str, **values: Any) -> Finding:
    """Return a finding with values inserted into its text."""
    grade, text, record = _FINDINGS[code]
    return Finding(code, text.format(**values), grade, record.format(**values))


def grades() -> dict[str, str]:
    """Return the codes of all findings, each with the best verdict that it allows."""
    return {code: grade for code, (grade, _, _) in _FINDINGS.items()}


def experiment(first: str, second: str) -> str:
    """Return the recording that would distinguish two variables."""
    known = _EXPERIMENTS.get((min(first, second), max(first, second)))
    if first == second:
        return known or f'record a wider range of {first}'
    return known or (f'record motion in which {first} changes while {second} does not, and the '
                     'other way round')


def verdict_of(findings: Iterable[Finding], unit: str = 'A') -> Verdict:
    """Return what follows from findings on a model in a unit."""
    found = [replace(finding, text=in_unit(finding.text, unit)) for finding in findings]
    bad = sorted((finding for finding in found if finding.grade != TRUST),
                 key=lambda finding: (AGAIN, IN_PART).index(finding.grade))
    reasons = [finding.text for finding in bad] or [
        'The model predicts long parts of the recording that were not fitted about as well as '
        'those that were, and no variable explains a large part of the remaining error.']
    return Verdict(
        bad[0].grade if bad else TRUST, reasons,
        list(dict.fromkeys(finding.record for finding in bad if finding.record)),
        [finding.text for finding in found if finding.grade == TRUST], found)


def in_unit(text: str, unit: str) -> str:
    """Return a sentence about currents in A with the unit of the recording in its place."""
    return text if unit == 'A' else re.sub(r'(?<=\d) A\b', f' {unit}', text)
