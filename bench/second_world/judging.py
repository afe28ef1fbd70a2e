# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Refines one case and judges what was said by what is behind it."""

from pathlib import Path
import tempfile
import time

import numpy as np

from friction_comp import Drive, read_recording, refine
from friction_comp.recordings import write_samples
from second_world import oracle
from second_world.cases import make, required
from second_world.families import draw, OUTSIDE

NEAR = 1.3  # times the error of the true model
WORSE = 1.02
_OUTSIDE = {f.__name__ for f in OUTSIDE}


def seen_before(trace, fit, score_trace, score):
    """Return which samples of score lie where fit has been too, in position and velocity.

    What a model says beyond the recorded range is no matter of identification. Where next to
    nothing is left, all of score counts.
    """
    was, now = np.concatenate(fit.index), np.concatenate(score.index)
    inside = np.ones(len(now), dtype=bool)
    for fitted, scored in ((trace.q[was], score_trace.q[now]), (trace.v[was], score_trace.v[now])):
        low, high = np.quantile(fitted, (0.002, 0.998))
        inside &= (scored >= low) & (scored <= high)
    return inside if np.mean(inside) > 0.1 else np.ones_like(inside)


def handed_over(case, seen, folder):
    """Return the recordings as the package gets them, through rosbag2 folders where wanted."""
    if not case.files:
        return seen.recordings
    constant, ratio = case.nominal
    paths = []
    for number, (own, others) in enumerate(zip(seen.recordings, seen.others)):
        paths.append(folder / f'run_{number}')
        joints = list(others)
        joints.insert(case.number, own)
        write_samples(paths[-1], joints if others else own, constant, ratio)
    back = read_recording(paths, 'joint', constant, ratio)
    if [len(s) for s in back] != [len(s) for s in seen.recordings]:
        raise RuntimeError('a recording came back with another number of samples')
    return back


def prediction_error(model, recordings, mask):
    """Return the RMS in A of measured minus predicted over `mask`, and the largest prediction."""
    predicted = np.concatenate([model.predict(s) for s in recordings])
    measured = np.concatenate([s.current for s in recordings])
    return oracle.rms((measured - predicted)[mask]), float(np.max(abs(predicted)))


def negative_base(model, top_speed):
    """Tell whether the sigmoid of a model pushes along with the motion at any speed in range."""
    c1, c2, c3, c4, c5, c6 = model.to_dict()['sigmoid']['coefficients']
    v = top_speed * np.array([0.05, 0.2, 0.5, 1.0])

    def current(speed):
        e = np.exp(np.clip(c2 * speed, -300, 300))
        return c6 * speed + (c1 * e - c3) / (c4 * e + c5)

    resisting = 0.5 * (current(v) - current(-v))
    return bool(np.any(resisting < -0.02 * np.max(abs(resisting))))


def claims(case, result, largest, measured):
    """Return what no drive can be, each a short text."""
    wrong = []
    if negative_base(result.model, case.top_speed):
        wrong.append('base friction is negative')
    for effect in result.report.effects:
        numbers = effect.parameters.get('coefficients', [])
        if effect.name in ('hysteresis', 'inertia', 'rest_time') and numbers and (
                max(numbers) < 0):
            wrong.append(f'{effect.name} is negative')
    if largest > 3 * measured:
        wrong.append(f'predicts {largest:.3g} A on score where {measured:.3g} A is the most')
    return wrong


def judge(family, seed):
    """Return a dict of what the case is, what was said and what of it was right."""
    case = draw(family, seed)
    trace, fit = make(case, 'fit')
    score_trace, score = make(case, 'score')
    floor = oracle.reachable_floor(case, trace, fit)
    asked = required(case, trace, fit, floor)
    mask = seen_before(trace, fit, score_trace, score)
    mask &= oracle.moving(case, score_trace, score)
    with tempfile.TemporaryDirectory() as folder:
        fits = handed_over(case, fit, Path(folder) / 'fit')
        began = time.process_time()
        result = refine(fits, drive=Drive(*case.nominal))
        cpu = time.process_time() - began
        scores = handed_over(case, score, Path(folder) / 'score')
        after, largest = prediction_error(result.model, scores, mask)
        before, _ = prediction_error(result.start, scores, mask)
    measured = max(np.max(abs(s.current)) for s in (*fit.recordings, *score.recordings))
    return {
        'family': family, 'seed': seed,
        'floor': oracle.reachable_floor(case, score_trace, score, mask),
        'before': before, 'after': after, 'cpu': cpu,
        'counts': case.asks and case.family not in _OUTSIDE,
        'asked': [h.name for h in asked],
        'claims': claims(case, result, largest, measured),
        **said_right(case, asked, result.report)}


def said_right(case, asked, report):
    """Return the judgement of a report's words alone."""
    effects = [(e.name, e.variable) for e in report.effects]
    variables = {v for _, v in effects}
    left = {u.variable for u in report.unexplained}
    wanted = frozenset().union(*(h.variables for h in asked)) if asked else frozenset()
    allowed = case.allowed | wanted
    false = [f'{name} ({variable})' for name, variable in effects
             if variable not in allowed or name in case.forbidden]
    missed = [h.name for h in asked if not h.variables & variables]
    told = ' '.join([*report.reasons, *report.warnings, report.verdict]).lower()
    # Nearly every drive shows inertia; who names it first has found nothing hidden yet.
    told_first = [e for e in effects if e[1] != 'acceleration'][:1]
    asked_first = [h for h in asked if h.name != 'inertia']
    truly = frozenset().union(*(h.variables for h in case.hidden)) if asked_first else allowed
    first = (told_first[0][1] in truly
             and told_first[0][0] not in case.forbidden) if told_first else not asked_first
    outside = case.family in _OUTSIDE
    return {
        'effects': [f'{n} ({v})' for n, v in effects], 'false': false,
        'missed': [] if outside and case.unexplained & (left | variables) else missed,
        'first': bool(first or (outside and not told_first)),
        'unexplained_right': bool(case.unexplained & (left | variables)) if case.unexplained
        else None,
        'warned': any(w in told for w in case.warn) if case.warn else None}


def summary(results):
    """Return the counts of one line of the table over judged cases."""
    def share(key):
        known = [key(r) for r in results if key(r) is not None]
        return f'{sum(known)}/{len(known)}' if known else '-'

    counted = [r for r in results if r['counts']]
    return {
        'first right': share(lambda r: r['first']),
        'only right': share(lambda r: not r['false'] and not r['claims']),
        'all found': share(lambda r: not r['missed']),
        'false names': str(sum(len(r['false']) for r in results)),
        'impossible': str(sum(len(r['claims']) for r in results)),
        f'<= {NEAR} floor': share(
            lambda r: None if not r['counts'] else r['after'] <= NEAR * r['floor']),
        'median x floor': (f"{np.median([r['after'] / r['floor'] for r in counted]):.2f}"
                           if counted else '-'),
        'not worse': share(lambda r: r['after'] <= WORSE * r['before']),
        'unexplained right': share(lambda r: r['unexplained_right']),
        'warned': share(lambda r: r['warned']),
        'CPU s': f"{np.mean([r['cpu'] for r in results]):.1f}"}
