# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Velocity and acceleration of recorded positions, without delay and with a stated bandwidth."""

from __future__ import annotations

import math
from typing import Any, TypeGuard

import numpy as np

from friction_comp.errors import InputError, mapping, number, Reader
from friction_comp.samples import Samples
from friction_comp.statistics import median

METHOD = 'zero-phase Butterworth'
# Used if a model does not say how it was fitted.
DEFAULT_SETTINGS = {'method': METHOD, 'source': 'position', 'bandwidth': 40.0}
# Measured signals that a model may depend on, beside those of motion.
MEASURED = ('load', 'temperature')
_MOTION = ('position', 'velocity', 'acceleration', 'load', 'temperature', 'rigid_body', 'coupling')


def _one_of(*words: str) -> Reader:
    def read(value: Any, name: str) -> str:
        if value not in words:
            raise InputError(f'{name} must be {" or ".join(map(repr, words))}, not {value!r}')
        return str(value)
    return read


settings_of = mapping({
    'method': _one_of(METHOD), 'source': _one_of('position', 'velocity'), 'lag': number(),
    'bandwidth': number(above=0.0),
    'signals': mapping(mapping({'bandwidth': number(above=0.0)}), MEASURED)})
"""Reads the differentiation settings of a section of a model file; see `differentiate`."""


def differentiate(samples: Samples, settings: dict[str, Any]) -> Samples:
    """Return samples with velocity and acceleration by a zero-phase filter.

    The signal is filtered forwards and backwards by a second-order Butterworth low pass, and
    differentiated by central differences, segment by segment; a measured velocity that is not in
    whole counts by a cubic spline, which shows more of fast motion. Stamps that are not
    uniform are filtered as well: jitter is then in both signals, and cancels in their ratio to
    first order. The returned time begins at zero in each recording; position stays as recorded.

    Settings are ``source``, 'position' or 'velocity'; ``bandwidth``, Hz, the -3 dB point of one
    pass, None without filter; ``lag``, s by which torque follows the recorded current: motion, load
    and temperature are then those of the time t + lag; and ``signals``, how each of `MEASURED` is
    prepared before, see `prepared_signal`. Raises InputError if the velocity is needed and not
    recorded.
    """
    source, bandwidth = settings.get('source', 'position'), settings.get('bandwidth')
    if source == 'velocity' and samples.velocity is None:
        raise InputError('the model needs the recorded velocity, but the recording has none')
    velocity = np.zeros(len(samples))
    acceleration = np.zeros(len(samples))
    measured = np.asarray(samples.velocity)
    for part in samples.segments():
        time = samples.time[part]
        if len(time) < 3:
            continue
        step = np.diff(time)
        if np.ptp(step) >= 1e-3 * median(step):
            time = _increasing(_smooth(
                _times_of(_increasing(time), samples.position[part]), samples.sample_time,
                bandwidth))
        if source == 'position':
            speed = _derivative(
                _smooth(samples.position[part], samples.sample_time, bandwidth), time)
        else:
            speed = _smooth(measured[part], samples.sample_time, bandwidth)
        velocity[part] = speed
        acceleration[part] = _derivative(
            speed, time, smooth=source == 'velocity' and not _in_counts(measured[part]))
    return with_signals(samples.with_(
        time=time_in_recording(samples), velocity=velocity, acceleration=acceleration), settings)


def with_signals(samples: Samples, settings: dict[str, Any]) -> Samples:
    """Return samples of known motion with signals and lag by settings of `differentiate`."""
    prepared = {name: prepared_signal(samples, getattr(samples, name), **own)
                for name, own in (settings.get('signals') or {}).items()
                if getattr(samples, name) is not None}
    return advance(samples.with_(**prepared), settings.get('lag') or 0.0)


def prepared_signal(samples: Samples, values: np.ndarray, bandwidth: float | None = None
                    ) -> np.ndarray:
    """Return a measured signal without noise above a bandwidth, Hz, as for motion, (N,).

    Noise lowers its coefficient in a fit. Values that are held over several samples are
    interpolated, those that are not finite stay.
    """
    finite = np.isfinite(values)
    result = np.array(values, dtype=float)
    for part in samples.segments():
        known = finite[part]
        if np.count_nonzero(known) < 3:
            continue
        time = samples.time[part]
        own = np.interp(time, time[known], result[part][known])
        result[part] = _smooth(_between_held(time, own), samples.sample_time, bandwidth)
    return np.where(finite, result, values)


def _between_held(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values, shape (N,), interpolated between those that were new."""
    new = np.concatenate(([0], np.flatnonzero(np.diff(values)) + 1))
    runs = np.diff(new)
    usual = float(np.median(runs)) if len(runs) > 2 else 1.0
    if usual < 2.0:
        return values
    # A signal that rests has longer runs of equal values, each measured: the last is kept as well.
    last = (new[1:] - round(usual))[runs > 1.5 * usual]
    knots = np.union1d(new, last)
    return np.interp(time, time[knots], values[knots])


def time_in_recording(samples: Samples) -> np.ndarray:
    """Return the time in s since the start of each sample's recording, shape (N,)."""
    starts = np.flatnonzero(np.diff(samples.recording, prepend=samples.recording[:1] - 1))
    return np.asarray(samples.time - np.repeat(
        samples.time[starts], np.diff(starts, append=len(samples))))


def advance(samples: Samples, lag: float) -> Samples:
    """Return samples with motion, load and temperature of the time t + lag, s."""
    if not lag:
        return samples
    names = [name for name in _MOTION if getattr(samples, name) is not None]
    moved = shifted_in_time(np.array([getattr(samples, name) for name in names]).T, samples, lag)
    return samples.with_(**dict(zip(names, moved.T)))


def shifted_in_time(values: np.ndarray, samples: Samples, lag: float) -> np.ndarray:
    """Return the values at t + lag, (N,) or (N, M); beyond the ends of a segment the last ones."""
    source = np.reshape(np.asarray(values, dtype=float), (len(values), -1))
    shifted = source.copy()
    for part in samples.segments():
        time, own = samples.time[part], source[part]
        if len(time) > 1:
            # The sample before each time, and the share of the step to it.
            place = np.interp(time + lag, time, np.arange(len(time)))
            index = np.minimum(place.astype(int), len(time) - 2)
            before = own[index]
            shifted[part] = before + (place - index)[:, None] * (own[index + 1] - before)
    return shifted.reshape(np.shape(values))


def filters(bandwidth: float | None, sample_time: float) -> TypeGuard[float]:
    """Return whether a bandwidth, Hz, is so far below half of the sample rate that it filters."""
    return bandwidth is not None and 0.0 < 2.0 * bandwidth * sample_time < 0.95


def _smooth(signal: np.ndarray, sample_time: float, bandwidth: float | None) -> np.ndarray:
    """Return a signal, (N, ...), behind a zero-phase low pass of a bandwidth, Hz, if it filters.

    It is the response of a second-order Butterworth filter that is run forwards and backwards, on
    the signal continued with odd symmetry about both ends. A straight line passes unchanged.
    """
    if not filters(bandwidth, sample_time) or len(signal) < 3:
        return signal
    values = np.asarray(signal, dtype=float)
    last = len(values) - 1
    place = np.arange(len(values)) / last
    line = values[0] + np.multiply.outer(place, values[-1] - values[0])
    odd = values - line
    period = np.concatenate((odd[:-1], -odd[:0:-1]))
    cutoff = math.tan(math.pi * bandwidth * sample_time)
    response = 1.0 / (1.0 + (np.tan(0.5 * math.pi * place) / cutoff) ** 4)
    spectrum = np.fft.rfft(period, axis=0)
    spectrum *= response.reshape((-1,) + (1,) * (values.ndim - 1))
    return np.asarray(line + np.fft.irfft(spectrum, 2 * last, axis=0)[:len(values)])


def _derivative(values: np.ndarray, time: np.ndarray, smooth: bool = False) -> np.ndarray:
    """Return the slope by central differences of second order, one-sided at both ends, (N, ...).

    That of `smooth` values is the slope of a cubic spline: at a fifth of the rate, central
    differences show three quarters of it.
    Delayed samples may arrive together: a step is a quarter of the median step at least.
    """
    step = np.diff(time)
    step = np.maximum(step, 0.25 * median(step))
    even = np.concatenate(([0.0], np.cumsum(step)))
    slope = np.asarray(np.gradient(values, even, axis=0))
    return _spline_slope(values, np.diff(even), slope) if smooth and len(values) > 3 else slope


def _spline_slope(values: np.ndarray, step: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Return the slope of the cubic spline through values, (N,), with that of `slope` at its ends.

    Its equations are solved by Jacobi's method, each round of which halves the error at least, to a
    millionth.
    """
    secant, own, after = np.diff(values) / step, step[:-1], step[1:]
    right, both = 3.0 * (after * secant[:-1] + own * secant[1:]), 2.0 * (own + after)
    result = slope.copy()
    for _ in range(20):
        result[1:-1] = (right - after * result[:-2] - own * result[2:]) / both
    return result


def _in_counts(velocity: np.ndarray) -> bool:
    """Return whether a velocity, shape (N,), is in counts: a tenth repeats the one before."""
    return bool(np.mean((np.diff(velocity) == 0.0) & (velocity[1:] != 0.0)) > 0.1)


def _times_of(stamps: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return the times of samples: their stamps, or even ones if motion is smoother by these.

    A reader that is late now and then stamps samples late that were taken in time. Where samples
    were lost, even times have gaps, too.
    """
    step = np.diff(stamps)
    usual = median(step)
    # A shorter step is an early and a late stamp, a longer one has lost a sample.
    run = np.concatenate(([0], np.cumsum(step > 1.75 * usual)))
    # A straight line through the stamps of each run, about their means.
    count, place = np.bincount(run), np.arange(len(stamps))
    from_middle = place - (np.bincount(run, place) / count)[run]
    begin = stamps[np.searchsorted(run, run)]
    middle = begin + (np.bincount(run, stamps - begin) / count)[run]
    # The lower limit is the spread of two stamps; a single one has 0.
    spread = np.maximum(np.bincount(run, from_middle ** 2), 0.5)
    slope = np.bincount(run, from_middle * (stamps - middle)) / spread
    even = middle + slope[run] * from_middle
    rough = [np.abs(np.diff(np.diff(position) / np.diff(time))).sum() for time in (stamps, even)]
    late = rough[1] < rough[0] and np.abs(even - stamps).max() < usual
    return even if late else stamps


def _increasing(time: np.ndarray) -> np.ndarray:
    """Return strictly increasing times: repeated stamps are a thousandth of a step apart."""
    step = np.diff(time)
    if np.all(step > 0):
        return time
    tiny = 1e-3 * median(step[step > 0]) if np.any(step > 0) else 1e-6
    return np.concatenate(([time[0]], time[0] + np.cumsum(np.maximum(step, tiny))))
