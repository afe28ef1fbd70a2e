# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Velocity and acceleration of recorded positions, without delay and with a stated bandwidth."""

from __future__ import annotations

import math
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.errors import InputError

if TYPE_CHECKING:
    from friction_comp.samples import Samples

METHOD = 'zero-phase Butterworth'
# Where a model does not say how it was fitted.
DEFAULT_SETTINGS = {'method': METHOD, 'source': 'position', 'bandwidth': 40.0}
_ORDER = 2
_MOTION = ('position', 'velocity', 'acceleration', 'load', 'temperature', 'rigid_body', 'coupling')


def differentiate(samples: Samples, settings: dict[str, Any]) -> Samples:
    """Return samples with velocity and acceleration by a zero-phase filter.

    The signal is filtered forwards and backwards by a second-order Butterworth low pass, which
    delays nothing, and differentiated by central differences, stretch by stretch.

    Parameters
    ----------
    samples : Samples
    settings : dict
        ``source``: 'position' or 'velocity'; ``bandwidth``: Hz, the -3 dB point of one pass;
        None leaves the signal unfiltered.

    Returns
    -------
    Samples
        With `velocity` in rad/s and `acceleration` in rad/s²; `position` as recorded, `time` from
        the start of each recording.

    Raises
    ------
    InputError
        If the settings are unknown or the velocity they ask for is not recorded.
    """
    source, bandwidth = settings.get('source', 'position'), settings.get('bandwidth')
    if source not in ('position', 'velocity'):
        raise InputError(f"differentiation.source must be 'position' or 'velocity', not {source!r}")
    if source == 'velocity' and samples.velocity is None:
        raise InputError('the model wants the recorded velocity, but the recording has none')
    velocity = np.zeros(len(samples))
    acceleration = np.zeros(len(samples))
    measured = np.asarray(samples.velocity)
    for part in samples.segments():
        time = samples.time[part]
        if len(time) < 3:
            continue
        time = _increasing(time)
        if source == 'position':
            speed = np.gradient(_smooth(samples.position[part], samples.sample_time, bandwidth),
                                time)
        else:
            speed = _smooth(measured[part], samples.sample_time, bandwidth)
        velocity[part] = speed
        acceleration[part] = np.gradient(speed, time)
    return samples.with_(
        time=elapsed(samples), velocity=velocity, acceleration=acceleration)


def elapsed(samples: Samples) -> np.ndarray:
    """Return the time in s since the start of each sample's own recording, shape (N,)."""
    time = np.array(samples.time, dtype=float)
    starts = np.nonzero(np.diff(samples.recording, prepend=samples.recording[:1] - 1))[0]
    for begin, end in zip(starts, [*starts[1:], len(time)]):
        time[begin:end] -= time[begin]
    return time


def advance(samples: Samples, lag: float) -> Samples:
    """Return samples whose motion, load and temperature are those of the time t + lag.

    Parameters
    ----------
    samples : Samples
    lag : float
        s. Beyond the ends of a stretch the last values are held.
    """
    if not lag:
        return samples
    return samples.with_(**{
        name: earlier(getattr(samples, name), samples, lag)
        for name in _MOTION if getattr(samples, name) is not None})


def earlier(values: np.ndarray, samples: Samples, lag: float) -> np.ndarray:
    """Return values as they will be at the time t + lag, stretch by stretch.

    Parameters
    ----------
    values : ndarray, shape (N,) or (N, M)
    samples : Samples
        Of the same time base.
    lag : float
        s.
    """
    result = np.array(values, dtype=float)
    flat, source = result.reshape(len(result), -1), np.reshape(values, (len(result), -1))
    for part in samples.segments():
        time = samples.time[part]
        for column in range(flat.shape[1]):
            flat[part, column] = np.interp(time + lag, time, source[part, column])
    return result


def delayed(values: np.ndarray, samples: Samples, time_constant: float) -> np.ndarray:
    """Return values behind a first-order low pass, as a filter in the sensor makes them.

    A negative time constant undoes such a low pass: what a current was before an actuator made
    torque of it.

    Parameters
    ----------
    values : ndarray, shape (N,) or (N, M)
    samples : Samples
        Of the same time base.
    time_constant : float
        s; values are returned as they are for zero.
    """
    if not time_constant:
        return values
    result = np.array(values, dtype=float)
    if time_constant < 0.0:
        for part in samples.segments():
            if part.stop - part.start > 1:
                result[part] -= time_constant * np.gradient(
                    result[part], max(samples.sample_time, 1e-9), axis=0)
        return result
    # Here, since scipy's filters take a second to import, and few who load a model use them.
    from scipy.signal import lfilter

    keep = math.exp(-max(samples.sample_time, 1e-9) / time_constant)
    for part in samples.segments():
        stretch = result[part]
        result[part] = lfilter(
            [1.0 - keep], [1.0, -keep], stretch, axis=0, zi=keep * stretch[:1])[0]
    return result


def _smooth(signal: np.ndarray, sample_time: float, bandwidth: float | None) -> np.ndarray:
    if bandwidth is None or sample_time <= 0 or 2.0 * bandwidth * sample_time >= 0.95:
        return signal
    from scipy.signal import butter, sosfiltfilt

    sections = butter(_ORDER, 2.0 * bandwidth * sample_time, output='sos')
    # Long enough padding for the slow start of narrow filters, short enough for short stretches.
    padding = min(len(signal) - 1, int(3.0 / (bandwidth * sample_time)))
    return sosfiltfilt(sections, signal, padtype='odd', padlen=padding)


def _increasing(time: np.ndarray) -> np.ndarray:
    """Return times without equal neighbours, which repeated stamps would make."""
    step = np.diff(time)
    if np.all(step > 0):
        return time
    tiny = 1e-3 * float(np.median(step[step > 0])) if np.any(step > 0) else 1e-6
    return np.concatenate(([time[0]], time[0] + np.cumsum(np.maximum(step, tiny))))
