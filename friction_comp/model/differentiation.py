# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Velocity and acceleration of recorded positions, without delay and with a stated bandwidth."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.errors import InputError

if TYPE_CHECKING:
    from friction_comp.samples import Samples

METHOD = 'zero-phase Butterworth'
# Used where a model does not say how it was fitted.
DEFAULT_SETTINGS = {'method': METHOD, 'source': 'position', 'bandwidth': 40.0}
_ORDER = 2
# Time steps that differ by a smaller share than this are uniform.
_EVEN = 1e-3
_MOTION = ('position', 'velocity', 'acceleration', 'load', 'temperature', 'rigid_body', 'coupling')


def differentiate(samples: Samples, settings: dict[str, Any]) -> Samples:
    """Return samples with velocity and acceleration by a zero-phase filter.

    The signal is filtered forwards and backwards by a second-order Butterworth low pass, and
    differentiated by central differences, stretch by stretch. Where the stamps are uneven they are
    filtered in the same way: the unevenness is then in both, and drops out of their ratio to first
    order, whether the samples or only their stamps came unevenly. Time is then from the start of
    each recording; position stays as recorded.

    Settings are ``source``, 'position' or 'velocity'; ``bandwidth``, Hz, the -3 dB point of one
    pass, None without filter; and ``lag``, s by which torque follows the recorded current: motion,
    load and temperature are those of the time t + lag then. Raises InputError if they are unknown,
    or the velocity that they ask for is not recorded.
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
        step = np.diff(time)
        if np.ptp(step) >= _EVEN * np.median(step):
            time = _increasing(_smooth(time, samples.sample_time, bandwidth))
        if source == 'position':
            speed = _derivative(
                _smooth(samples.position[part], samples.sample_time, bandwidth), time)
        else:
            speed = _smooth(measured[part], samples.sample_time, bandwidth)
        velocity[part] = speed
        acceleration[part] = _derivative(speed, time)
    return advance(samples.with_(
        time=elapsed(samples), velocity=velocity, acceleration=acceleration),
        settings.get('lag') or 0.0)


def elapsed(samples: Samples) -> np.ndarray:
    """Return the time in s since the start of each sample's own recording, shape (N,)."""
    time = np.array(samples.time, dtype=float)
    starts = np.nonzero(np.diff(samples.recording, prepend=samples.recording[:1] - 1))[0]
    for begin, end in zip(starts, [*starts[1:], len(time)]):
        time[begin:end] -= time[begin]
    return time


def advance(samples: Samples, lag: float) -> Samples:
    """Return samples whose motion, load and temperature are those of the time t + lag, s."""
    if not lag:
        return samples
    names = [name for name in _MOTION if getattr(samples, name) is not None]
    moved = earlier(np.array([getattr(samples, name) for name in names]).T, samples, lag)
    return samples.with_(**dict(zip(names, moved.T)))


def earlier(values: np.ndarray, samples: Samples, lag: float) -> np.ndarray:
    """Return values, shape (N,) or (N, M), as they will be at the time t + lag of their samples.

    Beyond the ends of a stretch the last values are held.
    """
    source = np.reshape(np.asarray(values, dtype=float), (len(values), -1)).T
    moved = np.empty_like(source)
    for part in samples.segments():
        time = samples.time[part]
        for column, result in zip(source, moved):
            result[part] = np.interp(time + lag, time, column[part])
    return moved.T.reshape(np.shape(values))


def _smooth(signal: np.ndarray, sample_time: float, bandwidth: float | None) -> np.ndarray:
    if bandwidth is None or sample_time <= 0 or 2.0 * bandwidth * sample_time >= 0.95:
        return signal
    from scipy.signal import butter, sosfiltfilt

    sections = butter(_ORDER, 2.0 * bandwidth * sample_time, output='sos')
    # Padding long enough for the slow transients of narrow filters, and short enough for short
    # parts.
    padding = min(len(signal) - 1, int(3.0 / (bandwidth * sample_time)))
    return sosfiltfilt(sections, signal, padtype='odd', padlen=padding)


def _derivative(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return the slope by central differences of second order, one-sided at both ends, (N,).

    Samples that were sent late arrive together, with next to no time between their stamps. What
    changed meanwhile took longer than that: no step counts as less than a quarter of the usual one.
    """
    step = np.diff(time)
    step = np.maximum(step, 0.25 * float(np.median(step)))
    return np.asarray(np.gradient(values, np.concatenate(([0.0], np.cumsum(step)))))


def _increasing(time: np.ndarray) -> np.ndarray:
    """Return times without equal neighbours, which repeated stamps would make."""
    step = np.diff(time)
    if np.all(step > 0):
        return time
    tiny = 1e-3 * float(np.median(step[step > 0])) if np.any(step > 0) else 1e-6
    return np.concatenate(([time[0]], time[0] + np.cumsum(np.maximum(step, tiny))))
