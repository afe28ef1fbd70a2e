# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Refines one case and judges what was said by what is behind it.

What can be known: two floors of the error, and how much an effect shows. `noise_floor` is the error
of the true model that knows the true motion, that is the noise of current alone; `reachable_floor`
that of the true model with true constants which has to differentiate what was recorded itself, with
the best of several bandwidths.
"""

from dataclasses import replace
import time

import numpy as np
from scipy.signal import butter, filtfilt

from friction_comp import Drive, refine
from second_world.families import draw, Hidden, make, OUTSIDE
from world.joint import DT, resistance_along

BANDWIDTHS = (2.0, 4.0, 7.0, 12.0, 20.0, 40.0, 80.0, 150.0)
MOVING = 0.01  # share of the top speed below which a joint counts as at rest
NEAR = 1.3  # times the error of the true model
WORSE = 1.02
_OUTSIDE = {f.__name__ for f in OUTSIDE}


# What can be known.

def rms(values):
    """Return the root mean square, shape ()."""
    return float(np.sqrt(np.nanmean(np.square(values)))) if len(values) else 0.0


def true_current(case, trace):
    """Return what the true law asks for along the true motion, shape (N,) of the trace."""
    return resistance_along(case.joint, trace.time, trace.q, trace.v, trace.load,
                            trace.heat) + case.joint.inertia * trace.a


def smoothed(time, values, bandwidth):
    """Return values and two derivatives after a zero-phase low pass, each shape (N,).

    Irregular samples are interpolated to an even grid and back.
    """
    step = np.median(np.diff(time))
    grid = np.arange(time[0], time[-1] + step / 2, step)
    even = np.interp(grid, time, values)
    if bandwidth < 0.45 / step and len(grid) > 30:
        b, a = butter(2, bandwidth * 2 * step)
        even = filtfilt(b, a, even, padlen=min(len(grid) - 2, int(2 / bandwidth / step) + 9))
    rate = np.gradient(even, step)
    return tuple(np.interp(time, grid, x) for x in (even, rate, np.gradient(rate, step)))


def moving(case, trace, seen):
    """Return which recorded samples are of a joint in motion, shape (N,) of bool.

    At rest, stiction holds whatever the controller happens to ask for, so errors are taken over
    these samples alone.
    """
    return abs(trace.v[np.concatenate(seen.index)]) > MOVING * case.top_speed


def _pieces(samples):
    gap = np.diff(samples.time) > 5 * np.median(np.diff(samples.time))
    edges = [0, *(np.nonzero(gap)[0] + 1), len(samples.time)]
    return [slice(a, b) for a, b in zip(edges[:-1], edges[1:]) if b - a > 10]


def noise_floor(case, trace, seen):
    """Return the error in A of the true law along the true motion on what was recorded."""
    expected = _expected(case, trace, true_current(case, trace))
    errors = []
    for samples, index in zip(seen.recordings, seen.index):
        errors.append(samples.current - expected[index])
    return rms(np.concatenate(errors)[moving(case, trace, seen)])


def _expected(case, trace, torque):
    """Return the recorded current that belongs to a torque: before delay and low pass.

    NaN where the recording ends before the current arrives.
    """
    current = torque
    if case.joint.low_pass > 0:
        before = np.concatenate((torque[:1], torque[:-1]))
        current = before + (torque - before) * case.joint.low_pass / DT
    late = int(case.joint.delay / DT)
    current = np.concatenate((current[late:], np.full(late, np.nan)))
    return np.clip(current, -case.fit_sensors.current_ceiling, case.fit_sensors.current_ceiling)


def reachable_floor(case, trace, seen, mask=None):
    """Return the error in A of the true law that differentiates the recording.

    Velocity comes from the position or, where the driver recorded one, from that. The error is
    taken over `mask`, shape (N,) of bool, or else over all samples in motion.
    """
    mask = moving(case, trace, seen) if mask is None else mask
    sources = ('position', 'velocity')[:2 if case.fit_sensors.velocity != 'none' else 1]
    return min(rms(np.concatenate(_reached(case, trace, seen, bandwidth, source))[mask])
               for bandwidth in BANDWIDTHS for source in sources)


def _reached(case, trace, seen, bandwidth, source):
    errors = []
    for samples, index in zip(seen.recordings, seen.index):
        error = np.full(len(index), np.nan)  # pieces too short to differentiate stay out
        for piece in _pieces(samples):
            i, t = index[piece], samples.time[piece]
            q, v, a = smoothed(t, samples.position[piece], bandwidth)
            if source == 'velocity':
                v, a, _ = smoothed(t, samples.velocity[piece], bandwidth)
            # Clocks count from the recording's beginning in both.
            law = resistance_along(case.joint, trace.time[i], q, v, trace.load[i],
                                   trace.heat[i]) + case.joint.inertia * a
            if case.joint.delay > 0 or case.joint.low_pass > 0:
                ahead = np.interp(t + case.joint.delay, t, law)
                law = ahead + case.joint.low_pass * np.gradient(ahead, t)
            ceiling = case.fit_sensors.current_ceiling
            error[piece] = samples.current[piece] - np.clip(law, -ceiling, ceiling)
        errors.append(error)
    return errors


def shown(case, trace, seen, without):
    """Return how much in A an effect shows beyond what a plain drive can take over.

    The difference that the effect makes along the true motion, less the best fit of sigmoid,
    viscous friction, offset and inertia to it.
    """
    plain = replace(case, joint=case.joint._replace(**without))
    difference = _expected(case, trace, true_current(case, trace)) - _expected(
        plain, trace, true_current(plain, trace))
    i = np.concatenate(seen.index)[moving(case, trace, seen)]
    i = i[np.isfinite(difference[i])]
    v, a = trace.v[i], trace.a[i]
    fastest = np.quantile(abs(v), 0.95) + 1e-9
    left = []
    for scale in (0.003, 0.03, 0.1, 0.3, 0.8):
        known = np.column_stack([np.tanh(v / (scale * fastest)), v, np.ones_like(v), a])
        best = np.linalg.lstsq(known, difference[i], rcond=None)[0]
        left.append(rms(difference[i] - known @ best))
    return min(left)


def required(case, trace, seen, floor):
    """Return the hidden effects that show enough in the recording to be asked for.

    Enough is 0.4 of the error of the true model, 14 % of what that leaves; with the hundreds of
    samples and more that every case has, an expert with the true model in hand cannot miss it.
    Inertia counts from 0.7 on, since a plain drive's constants take over some of it.
    """
    if not case.asks:
        return []
    asked = [one for one in case.hidden
             if one.without is None
             or shown(case, trace, seen, one.without) > 0.4 * floor]
    i = np.concatenate(seen.index)[moving(case, trace, seen)]
    if case.joint.inertia * rms(trace.a[i]) > 0.7 * floor:
        asked.append(Hidden('inertia', frozenset({'acceleration'}), {'inertia': 0.0}))
    return asked


# What was said.

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


def prediction_error(model, recordings, mask):
    """Return the RMS in A of measured minus predicted over `mask`, and the largest prediction."""
    predicted = np.concatenate([model.predict(s) for s in recordings])
    measured = np.concatenate([s.current for s in recordings])
    return rms((measured - predicted)[mask]), float(np.max(abs(predicted)))


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
    floor = reachable_floor(case, trace, fit)
    asked = required(case, trace, fit, floor)
    mask = seen_before(trace, fit, score_trace, score)
    mask &= moving(case, score_trace, score)
    began = time.process_time()
    result = refine(fit.recordings, drive=Drive(*case.nominal))
    cpu = time.process_time() - began
    after, largest = prediction_error(result.model, score.recordings, mask)
    before, _ = prediction_error(result.start, score.recordings, mask)
    measured = max(np.max(abs(s.current)) for s in (*fit.recordings, *score.recordings))
    return {
        'family': family, 'seed': seed,
        'floor': reachable_floor(case, score_trace, score, mask),
        'before': before, 'after': after, 'cpu': cpu,
        'said': result.report.after.elsewhere_motion_rmse,
        'codes': sorted({one.code for one in result.report.findings if one.grade != 'trust'}),
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
