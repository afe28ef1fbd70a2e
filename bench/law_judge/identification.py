# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identification on every gear, against the plant's own friction."""

import numpy as np

from friction_comp import Drive, IdentificationGoal, IdentificationRun
from law_judge.rows import DEGREE, Row
from world.person import nobody

# What is asked for: speeds in rad/s, the period of a current ramp in s, and ramps a direction.
SPEEDS = np.array([3, 10, 40, 90]) * DEGREE
PERIOD, CYCLES = 6.0, 8
# An identification that shakes the joint, or throws it, is no good whatever it finds.
SHAKING = 2.0  # times the fastest speed asked for
TRUTH_REPETITIONS = 64
COUNTS = 10.0   # of presliding, from which on it is to be known
LEAST_BACKLASH = 4.0    # counts, from which on it is to be said


def identify(bank):
    """Return result (None where refused), words, fastest speed and drive time in s of each."""
    return run_all(bank, [IdentificationRun(_goal(document), Drive(**document['drive']))
                          for document in bank.documents])


def identified_bank(bank):
    """Return the bank with the models that identification finds, and what it refused."""
    results, said, _, _ = identify(bank)
    kept, documents, refused = [], [], []
    for g, (result, document) in enumerate(zip(results, bank.documents)):
        if result is None:
            refused.append(f'{bank.kinds[g]} {g}: {said[g]}')
            continue
        found = result.model(Drive(**document['drive'])).to_dict()
        kept.append(g)
        documents.append({**found, 'effects': document['effects']})
    return bank.chosen(kept, documents), refused


def identification(bank, _law=None):
    """Identify each gear once and return rows.

    Breakaway is off by what is beyond two standard errors of both means. Kinetic friction is off
    by the RMS over the speeds, relative to the friction at each. Presliding, where identification
    gives it, is compared with the way at which a gear that is loaded slowly from rest, its teeth
    touching, has reached 95 % of its level; it is off by what is beyond the count by which an
    encoder cannot tell.
    """
    results, said, fastest, taken = identify(bank)
    truth = bank.world.breakaway_currents(bank.gears, bank.seed + 1000, TRUTH_REPETITIONS)
    found = [_judge(bank.world, gear, true, result)
             for gear, true, result in zip(bank.gears, truth, results)]
    table = {name: np.array([entry[name] for entry in found]) for name in found[0]}
    loose = (bank.gears['backlash'] if 'backlash' in bank.gears.dtype.names
             else np.zeros(len(bank.gears)))
    rows = [Row('identification: refused', sum(r is None for r in results), 1.0 / 3.0,
                joints=len(results), detail=said)]
    for name, which in (('', loose == 0.0), (' with backlash', loose > 0.0)):
        rows += _rows(f'identification: breakaway{name}', bank, table['breakaway'][which],
                      which, None, 5.0)
    rows += _rows('identification: kinetic', bank, table['kinetic'], None, None, 5.0)
    seen = table['way'] >= COUNTS * bank.gears['resolution']
    rows += _rows('identification: presliding, ≥ 10 counts', bank,
                  table['presliding'][seen], seen, 10.0, 25.0)
    rows.append(Row('identification: presliding, ≥ 10 counts: not given',
                    int(np.isnan(table['presliding'][seen]).sum()), 0.1, joints=int(seen.sum())))
    large = loose >= LEAST_BACKLASH * bank.gears['resolution']
    if large.any():
        off = np.abs(table['backlash'] / np.maximum(loose, 1e-12) - 1.0)
        rows += _rows('identification: backlash', bank, off[large], large, 25.0, None)
        unsaid = np.array([r is not None for r in results]) & np.isnan(table['backlash'])
        rows.append(Row('identification: backlash ≥ 4 counts, not said',
                        int(unsaid[large].sum()), 0.1, joints=int(large.sum())))
    if not loose.all():
        wrong = np.isfinite(table['backlash'])[loose == 0.0]
        rows.append(Row('identification: backlash said where there is none',
                        int(wrong.sum()), 0.0, joints=len(wrong)))
    rows.append(Row('identification: drive time, longest', float(taken.max()), None, ' s',
                    detail=np.round(taken, 1).tolist()))
    rows.append(Row('identification: faster than twice what was asked',
                    int((fastest > SHAKING * SPEEDS[-1]).sum()), 0.0,
                    joints=len(fastest)))
    return rows


def _rows(floor, bank, values, which, median, worst):
    gears = np.arange(len(bank.gears)) if which is None else np.flatnonzero(which)
    finite = np.isfinite(values)
    detail = {f'{bank.kinds[g]} {g}': round(100.0 * float(v), 1) for g, v in zip(gears, values)}
    values = 100.0 * values[finite]
    if not len(values):
        return []
    return [Row(f'{floor} off, {name}', float(figure), floor_of, ' %', detail=detail)
            for name, figure, floor_of in (('median', np.median(values), median),
                                           ('worst', values.max(), worst))]


def _goal(document):
    level = document['breakaway']['positive']['mean']
    # twice the level at the end of the ramp, as in the note
    return IdentificationGoal(
        speeds=tuple(SPEEDS), motion_range=1.0, ramp_slope=2.0 * level / (0.4 * PERIOD),
        ramp_period=PERIOD, breakaway_cycles=CYCLES, longest_cycle=10.0)


def run_all(bank, runs):
    """Drive identifications side by side; return results, words, fastest speeds and times."""
    gears = bank.gears.copy()
    gears['gravity'] = 0.0      # held by the robot's own controller
    plant = bank.world.Plant(gears, nobody(len(runs)), bank.seed)
    command, said, fastest = np.zeros(len(runs)), {}, np.zeros(len(runs))
    waiting, taken = set(range(len(runs))), np.zeros(len(runs))
    while waiting and plant.time < 1200.0:
        position, velocity = plant.sample()
        for j in tuple(waiting):
            try:
                command[j] = runs[j].update(
                    plant.time, position[j], velocity[j], plant.states['current'][j])
            except Exception as error:
                said[j], command[j] = str(error), 0.0
            if j in said or runs[j].finished:
                waiting.discard(j)
                taken[j] = plant.time
        plant.advance(command)
        fastest = np.maximum(fastest, np.abs(plant.states['motor_velocity']))
    results = []
    for j, run in enumerate(runs):
        try:
            results.append(run.result())
            said.setdefault(j, '; '.join(results[-1].warnings))
        except Exception as error:
            said.setdefault(j, str(error))
            results.append(None)
    return results, said, fastest, taken


def _judge(world, gear, truth, result):
    way, _ = world.presliding(gear)
    if result is None:
        return {'way': way, **dict.fromkeys(
            ('breakaway', 'kinetic', 'presliding', 'backlash'), np.nan)}
    found = result.breakaway
    means = (found.positive_mean, -found.negative_mean)
    error = 2.0 * np.std(truth) * np.sqrt(1.0 / CYCLES + 2.0 / truth.size)
    off = [abs(mean - np.mean(side)) for mean, side in zip(means, (truth[::2], truth[1::2]))]
    kinetic = []
    for sign in (1, -1):
        curve = world.steady_friction(gear, SPEEDS, sign)
        kinetic.append((np.abs(result.sigmoid(sign * SPEEDS)) - curve) / curve)
    distance = result.presliding.distance if result.presliding else np.nan
    return {
        'way': way, 'breakaway': max(0.0, max(off) - error) / np.mean(truth),
        'kinetic': float(np.sqrt(np.mean(np.square(kinetic)))),
        'presliding': max(0.0, abs(distance - way) - gear['resolution']) / way
        if np.isfinite(distance) else np.nan,
        'backlash': np.nan if result.backlash is None else result.backlash}
