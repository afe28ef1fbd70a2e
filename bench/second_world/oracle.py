# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What can be known: the error of the true model, and how much an effect shows.

Two floors: `noise_floor` is the error of the true model that knows the true motion, that is the
noise of current alone; `reachable_floor` that of the true model with true constants which has to
differentiate what was recorded itself, with the best of several bandwidths.
"""

import numpy as np
from scipy.signal import butter, filtfilt

from world.arm import torque_along
from world.drive import DT
from world.joint import resistance_along

BANDWIDTHS = (2.0, 4.0, 7.0, 12.0, 20.0, 40.0, 80.0, 150.0)
MOVING = 0.01  # share of the top speed below which a joint counts as at rest


def rms(values):
    """Return the root mean square, shape ()."""
    return float(np.sqrt(np.nanmean(np.square(values)))) if len(values) else 0.0


def true_current(case, trace):
    """Return what the true law asks for along the true motion, shape (N,) of the trace."""
    begins = np.zeros(len(trace.time), dtype=bool)
    begins[0] = True
    current = resistance_along(case.joint, trace.time, trace.q, trace.v, trace.load, trace.heat,
                               begins) + case.joint.inertia * trace.a
    return current + _linked(case, trace.others_q, trace.others_v, trace.others_a)


def _linked(case, q, v, a):
    if not len(case.chain.mass):
        return 0.0
    return torque_along(case.chain, case.number, np.ascontiguousarray(q), np.ascontiguousarray(v),
                        np.ascontiguousarray(a)) / case.controller.torque_per_current


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
    for samples, index, others in zip(seen.recordings, seen.index, seen.others):
        error = np.full(len(index), np.nan)  # pieces too short to differentiate stay out
        for piece in _pieces(samples):
            i, t = index[piece], samples.time[piece]
            q, v, a = smoothed(t, samples.position[piece], bandwidth)
            if source == 'velocity':
                v, a, _ = smoothed(t, samples.velocity[piece], bandwidth)
            begins = np.zeros(len(t), dtype=bool)
            begins[0] = True
            # Clocks count from the recording's beginning in both.
            law = resistance_along(case.joint, trace.time[i], q, v, trace.load[i],
                                   trace.heat[i], begins) + case.joint.inertia * a
            if others:
                columns = [smoothed(t, o.position[piece], bandwidth) for o in others]
                columns.insert(case.number, (q, v, a))
                law = law + _linked(case, *np.moveaxis(np.array(columns), (0, 1, 2), (2, 0, 1)))
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
    plain = case._replace_joint(without)
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
