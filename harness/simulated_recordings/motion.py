# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Motions that excite what a drive's friction may depend on: speeds, positions, rests."""

from __future__ import annotations

import math

import numpy as np


def stroke(start, goal, speed, step, ramp_time):
    """Return positions, rad, after each time step of a movement at constant speed with smooth ends.

    The velocity rises and falls along a half cosine of `ramp_time` s, so the acceleration is
    continuous. `speed`: rad/s, positive; lowered where the way is too short for it.
    """
    way = abs(goal - start)
    speed = min(speed, way / ramp_time)
    if speed <= 0:
        return np.zeros(0)
    duration = way / speed + ramp_time
    t = np.arange(1, round(duration / step) + 1) * step
    rise = 0.5 - 0.5 * np.cos(np.pi * np.clip(t / ramp_time, 0.0, 1.0))
    fall = 0.5 - 0.5 * np.cos(np.pi * np.clip((duration - t) / ramp_time, 0.0, 1.0))
    velocity = speed * np.minimum(rise, fall)
    return start + math.copysign(1.0, goal - start) * np.cumsum(velocity) * step


def multisine(start, duration, amplitude, step, rng):
    """Return positions of a sum of four sines, faded in and out at the start position.

    `amplitude`: largest distance from the start in rad. The frequencies, 0.08 to 0.9 Hz, are drawn
    on a logarithmic scale.
    """
    t = np.arange(1, round(duration / step) + 1) * step
    total = np.zeros_like(t)
    for _ in range(4):
        frequency = math.exp(rng.uniform(math.log(0.08), math.log(0.9)))
        phase = rng.uniform(0.0, 2.0 * math.pi)
        # Equal speed in each tone: slow tones go further.
        total += np.sin(2.0 * math.pi * frequency * t + phase) / frequency
    fade = np.minimum(1.0, np.minimum(t, duration - t) / min(2.0, 0.25 * duration))
    total *= np.sin(0.5 * math.pi * np.clip(fade, 0.0, 1.0)) ** 2
    return start + amplitude * total / max(np.abs(total).max(), 1e-9)


def mixed_motion(duration, step, rng, position_range=4.0, speed=1.2, rests=True):
    """Return the positions of strokes at many speeds, multisines and rests, in random order.

    It begins with a sweep through the whole range, so that no recording leaves a part of it out.
    `position_range`: rad; the motion stays within half of it on either side of zero. `speed`: the
    highest in rad/s; the lowest is a fortieth of it. `rests`: whether the joint rests, 0.2 to 5 s,
    between some movements.
    """
    half = 0.5 * position_range
    speeds = np.geomspace(speed / 40.0, speed, 14)
    wanted = round(duration / step)
    side = half * rng.choice([-1.0, 1.0])
    pieces = [stroke(0.0, side, rng.uniform(0.5, 0.8) * speed, step, 0.4),
              stroke(side, -side, rng.uniform(0.5, 0.8) * speed, step, 0.4)]
    size = sum(len(part) for part in pieces)
    here, forwards, deck = -side, side > 0, []
    while size < wanted:
        if not deck:
            deck = list(rng.permutation(len(speeds) + 3))
        card = int(deck.pop())
        if card < len(speeds):
            chosen = speeds[card]
            ramp = min(0.4, half / speed)
            # As far as five seconds lead, and never beyond the range.
            reach = chosen * rng.uniform(2.0, 5.0)
            room = half - here if forwards else half + here
            if room < min(reach, 0.3 * half):
                forwards = not forwards
                room = half - here if forwards else half + here
            goal = here + (1.0 if forwards else -1.0) * min(reach, room)
            piece = stroke(here, goal, chosen, step, ramp)
            if rng.random() < 0.5:
                forwards = not forwards
        else:
            amplitude = rng.uniform(0.4, 1.0) * half
            centre = float(np.clip(here, -half + amplitude, half - amplitude))
            lead = stroke(here, centre, 0.5 * speed, step, 0.4)
            piece = multisine(centre, rng.uniform(6.0, 12.0), amplitude, step, rng)
            peak = np.abs(np.diff(piece)).max() / step
            if peak > speed:
                piece = centre + (piece - centre) * speed / peak
            piece = np.concatenate((lead, piece))
        if piece.size:
            pieces.append(piece)
            here = float(piece[-1])
        if rests and rng.random() < 0.5:
            pause = round(math.exp(rng.uniform(math.log(0.2), math.log(5.0))) / step)
            pieces.append(np.full(pause, here))
        size = sum(len(part) for part in pieces)
    return np.concatenate(pieces)[:wanted]


def smooth_noise(size, step, rng, bandwidth=0.5):
    """Return noise of unit variance with little power above the bandwidth in Hz, shape (size,)."""
    frequency = np.fft.rfftfreq(size, step)
    spectrum = rng.standard_normal(frequency.size) + 1j * rng.standard_normal(frequency.size)
    spectrum *= np.exp(-0.5 * (frequency / bandwidth) ** 2)
    spectrum[0] = 0.0
    signal = np.fft.irfft(spectrum, size)
    return signal / max(float(signal.std()), 1e-12)
