# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identification on every kind of gear, against the plant's own friction."""

import numpy as np

from independent_gear.first_curve import presliding_and_stiffness
from independent_gear.plant import Plant
from independent_gear.rows import DEGREE, figure_row, share_row
from independent_gear.state import CLAMP, nobody
from independent_gear.subject import Drive, IdentificationGoal, IdentificationRun
from independent_gear.truth import breakaway_currents, steady_friction

BREAKAWAY, KINETIC, PRESLIDING, STIFFNESS = 0.03, 0.03, 0.30, 0.30
# An identification that shakes the joint, or throws it, is no good whatever it finds.
SHAKING = 2.0  # times the fastest speed asked for
TRUTH_REPETITIONS = 64


def identification(bank, quick=False):
    """Identify each gear once and return rows for each kind.

    Breakaway is off by what is beyond two standard errors of both means. Kinetic friction is off
    by the RMS over the speeds, relative to the friction at each. Presliding, where identification
    gives it, is compared with the way at which a gear that is loaded slowly from rest has reached
    95 % of its level, and stiffness with the slope up to a third of it; the way is off by what is
    beyond the count by which an encoder cannot tell.
    """
    speeds = np.array([3, 10, 40, 90] if quick else [2, 5, 10, 20, 40, 60, 80, 100]) * DEGREE
    goals = [_goal(bank, g, speeds, quick) for g in range(len(bank.gears))]
    drives = [_drive(document) for document in bank.documents]
    results, errors, fastest = _run_all(bank, [IdentificationRun(goal, drive)
                                      for goal, drive in zip(goals, drives)])
    truth = breakaway_currents(bank.gears, bank.seed + 1000, TRUTH_REPETITIONS)
    figures = [_judge(bank.gears[g], truth[g], result, goals[g], speeds)
               for g, result in enumerate(results)]
    rows = [row for kind in dict.fromkeys(bank.kinds)
            for row in _rows(bank, kind, figures, errors)]
    for kind in dict.fromkeys(bank.kinds):
        here = bank.among(kind)
        rows.append(share_row('identification: faster than twice what was asked', kind,
                              'identification', fastest[here] > SHAKING * speeds[-1],
                              fastest=fastest[here] / DEGREE))
    return rows


def _goal(bank, g, speeds, quick):
    level = bank.documents[g]['breakaway']['positive']['mean']
    period = 6.0 if quick else 10.0
    # twice the level at the end of the ramp, as in the note
    return IdentificationGoal(
        speeds=tuple(speeds), motion_range=1.0, ramp_slope=2.0 * level / (0.4 * period),
        ramp_period=period, breakaway_cycles=8 if quick else 20, longest_cycle=10.0)


def _drive(document):
    return Drive(**document['drive'])


def _run_all(bank, runs):
    plant = Plant(bank.gears, nobody(len(runs)), bank.seed)
    command, failed, fastest = np.zeros(len(runs)), {}, np.zeros(len(runs))
    while plant.time < 1200.0:
        open_runs = [j for j, run in enumerate(runs) if not run.finished and j not in failed]
        if not open_runs:
            break
        for _ in range(100):
            position, velocity = plant.sample()
            for j in open_runs:
                try:
                    command[j] = runs[j].update(
                        plant.time, position[j], velocity[j], plant.states['current'][j])
                except Exception as error:
                    failed.setdefault(j, str(error))
                    command[j] = 0.0
            plant.advance(command)
            fastest = np.maximum(fastest, np.abs(plant.states['motor_velocity']))
    results = []
    for j, run in enumerate(runs):
        try:
            results.append(run.result())
        except Exception as error:
            failed.setdefault(j, str(error))
            results.append(None)
    return results, failed, fastest


def _judge(gear, truth, result, goal, speeds):
    if result is None:
        return {'breakaway': np.inf, 'kinetic': np.inf, 'presliding': np.inf,
                'stiffness': np.inf, 'speed': np.nan}
    found = result.breakaway
    means = (found.positive_mean, -found.negative_mean)
    scatter = np.std(truth)
    error = 2.0 * scatter * np.sqrt(1.0 / goal.breakaway_cycles + 2.0 / truth.size)
    off = [abs(mean - np.mean(side)) for mean, side in zip(means, (truth[::2], truth[1::2]))]
    kinetic = []
    for sign in (1, -1):
        curve = steady_friction(gear, speeds, sign)
        kinetic.append((np.abs(result.sigmoid(sign * speeds)) - curve) / curve)
    distance, slope = presliding_and_stiffness(gear)
    found, stiffness = presliding_of(result)
    return {
        'breakaway': max(0.0, max(off) - error) / np.mean(truth),
        'bias': (np.mean(means) - np.mean(truth)) / np.mean(truth),
        'speed': speeds[np.argmax(np.abs(kinetic).max(axis=0))] / DEGREE,
        'kinetic': float(np.sqrt(np.mean(np.square(kinetic)))),
        'presliding': max(0.0, abs(found - distance) - gear['resolution']) / distance,
        'stiffness': abs(stiffness / slope - 1.0)}


def presliding_of(result):
    """Return presliding distance in rad and stiffness in A/rad; NaN where none was found."""
    found = result.presliding
    if found is None:
        return np.nan, np.nan
    return found.distance, np.nan if found.stiffness is None else found.stiffness


def _rows(bank, kind, figures, errors):
    here = bank.among(kind)
    rows = []
    for what, most in (('breakaway', BREAKAWAY), ('kinetic', KINETIC), ('presliding', PRESLIDING),
                       ('stiffness', STIFFNESS)):
        values = np.array([figures[g][what] for g in here])
        unknown = what in ('presliding', 'stiffness') and np.isnan(values).all()
        clamps = all(bank.gears[g]['friction'] == CLAMP for g in here)
        # An encoder may be too coarse for a stiffness.
        if unknown and (what == 'stiffness' or clamps):
            continue
        worst = np.nan if unknown else np.nanmax(values)
        rows.append(figure_row(
            f'identification: {what} off by at most {100 * most:.0f} %', kind, 'identification',
            100 * worst, worst <= most, f'≤ {100 * most:.0f} %', ' %', each=100 * values,
            presliding=bank.gears['presliding'][here],
            bias=[100 * figures[g].get('bias', np.nan) for g in here],
            worst_speed=[figures[g]['speed'] for g in here],
            errors=[errors[g] for g in here if g in errors]))
    return rows
