# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""From what happened to what a driver would have recorded."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from friction_comp import Samples
from world.joint import DT

AMBIENT = 22.0  # degrees Celsius


@dataclass(frozen=True)
class Sensors:
    """How a drive is recorded: times in s, rad, A."""

    step: float = 0.002
    jitter: float = 0.0  # share of a step by which samples come early or late
    stamps_jitter: bool = False  # the stamps say so wrongly; samples are taken in time
    quantum: float = 1e-5
    noise: float = 0.01
    noise_memory: float = 0.0  # s, time constant of coloured noise
    current_quantum: float = 0.0
    current_ceiling: float = np.inf  # of the current sensor only
    velocity: str = 'none'  # none, exact, filtered
    gaps: int = 0
    pieces: int = 1  # runs with pauses between, each a recording of its own
    load: bool = False
    heat: bool = False
    reference: bool = False


@dataclass(frozen=True)
class Seen:
    """A recording and what lies behind each of its samples."""

    recordings: list
    index: list  # per recording, indices into the trace


def _noise(rng, sensors, times):
    white = rng.normal(size=len(times)) * sensors.noise
    if sensors.noise_memory <= 0 or len(times) < 2:
        return white
    keep = np.exp(-np.median(np.diff(times)) / sensors.noise_memory)
    white[1:] *= np.sqrt(1 - keep ** 2)
    return lfilter([1.0], [1.0, -keep], white)


def quantised(values, quantum):
    """Return values rounded to multiples of `quantum`; 0 leaves them as they are."""
    return np.round(values / quantum) * quantum if quantum > 0 else values


def _velocity(rng, sensors, trace):
    """Return the driver's velocity along the whole trace, or None."""
    if sensors.velocity == 'none':
        return None
    if sensors.velocity == 'exact':
        return trace.v + rng.normal(size=len(trace.v)) * 0.002 * np.std(trace.v)
    # A driver differences its own encoder each ms and smooths with a first-order low pass.
    own = quantised(trace.q[::4], min(sensors.quantum, 2e-4))
    weight = 4 * DT / (0.006 + 4 * DT)
    out = lfilter([weight], [1.0, weight - 1.0], np.diff(own, prepend=own[0]) / (4 * DT))
    return np.repeat(out, 4)[:len(trace.q)]


def _instants(rng, sensors, size):
    """Return indices into the trace and the stamps that are written for them."""
    nominal = np.arange(int((size - 2) * DT / sensors.step)) * sensors.step
    late = rng.uniform(-0.5, 0.5, len(nominal)) * sensors.jitter * sensors.step
    taken = nominal if sensors.stamps_jitter else nominal + late
    index = np.clip(np.round(taken / DT).astype(int), 0, size - 1)
    stamps = nominal + late - min(late.min(initial=0.0), 0.0) if sensors.stamps_jitter else (
        index * DT)
    keep = np.ones(len(index), dtype=bool)
    for _ in range(sensors.gaps):
        length = int(rng.uniform(0.01, 0.04) * len(index))
        start = rng.integers(0, max(len(index) - length, 1))
        keep[start:start + length] = False
    return index[keep], stamps[keep]


def record(rng, sensors, trace):
    """Return what is recorded of a trace, as `Seen`."""
    index, stamps = _instants(rng, sensors, len(trace.time))
    velocity = _velocity(rng, sensors, trace)
    cuts = np.array_split(np.arange(len(index)), sensors.pieces)
    recordings, indices = [], []
    for cut in cuts:
        # Between short runs the joint goes on unrecorded for a while.
        cut = cut[:max(int(0.9 * len(cut)), 20)] if sensors.pieces > 1 else cut
        i, t = index[cut], stamps[cut]
        current = np.clip(trace.current[i], -sensors.current_ceiling, sensors.current_ceiling)
        signals = {}
        if velocity is not None:
            signals['velocity'] = velocity[i]
        if sensors.load:
            signals['load'] = trace.load[i] + rng.normal(size=len(i)) * 0.01
        if sensors.heat:
            signals['temperature'] = quantised(AMBIENT + trace.heat[i], 0.1)
        if sensors.reference:
            signals['reference_position'] = trace.reference[i]
            signals['reference_velocity'] = trace.reference_speed[i]
        current = quantised(current + _noise(rng, sensors, t), sensors.current_quantum)
        recordings.append(Samples(
            time=t.astype(float), position=quantised(trace.q[i], sensors.quantum),
            current=current, joint='joint', **signals))
        indices.append(i)
    return Seen(recordings, indices)
