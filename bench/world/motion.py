# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How a joint is moved: references in rad every DT, shape (N,), within a range about zero.

Each function takes a random generator, seconds, half the range in rad and a top speed in rad/s.
"""

import numpy as np
from scipy.ndimage import uniform_filter1d

from world.joint import DT


def _time(seconds):
    return np.arange(int(seconds / DT)) * DT


def _fade(path, seconds=0.3):
    """Begin at rest."""
    t = np.arange(len(path)) * DT
    return path * np.clip(t / seconds, 0, 1) ** 2 * (3 - 2 * np.clip(t / seconds, 0, 1))


def _scaled(path, half_range, top_speed):
    """Shrink a motion into range and top speed."""
    path = path / max(np.max(abs(path)), 1e-9)
    fastest = np.max(abs(np.gradient(path, DT)))
    return path * min(half_range, top_speed / max(fastest, 1e-9))


def multi_sine(rng, seconds, half_range, top_speed):
    """A Fourier series with 5 to 15 harmonics (Swevers et al. 1997), repeated as it comes."""
    count = rng.integers(5, 16)
    # The base frequency at which a typical series meets range and top speed at once.
    base = top_speed / half_range / (2 * np.pi) / (0.45 * count) * rng.uniform(0.7, 1.2)
    base = max(base, 1.0 / seconds)
    t = _time(seconds)
    path = np.zeros_like(t)
    for k in range(1, count + 1):
        path += rng.normal() / np.sqrt(k) * np.sin(2 * np.pi * base * k * t
                                                   + rng.uniform(0, 2 * np.pi))
    return _fade(_scaled(path - path.mean(), half_range, top_speed))


def joystick(rng, seconds, half_range, top_speed):
    """Minimum-jerk reaches (Flash and Hogan 1985), holds, reversals on the way, dithering."""
    t = _time(seconds)
    path = np.zeros_like(t)
    here, at = 0.0, int(0.3 / DT)
    while at < len(t):
        what = rng.random()
        if what < 0.22:
            took = int(rng.uniform(0.2, 1.8) / DT)
            piece = np.full(took, here)
        elif what < 0.35:
            took = int(rng.uniform(0.8, 2.5) / DT)
            x = np.arange(took) * DT
            width = rng.uniform(0.02, 0.12) * half_range
            wave = width * np.sin(2 * np.pi * rng.uniform(0.7, 2.0) * x)
            piece = here + wave * np.sin(np.pi * x / x[-1]) ** 2
        else:
            there = rng.uniform(-1, 1) * half_range
            speed = top_speed * rng.uniform(0.25, 1.0)
            took = max(int(1.875 * abs(there - here) / speed / DT), int(0.15 / DT))
            s = np.arange(took) / took
            piece = here + (there - here) * s ** 3 * (10 - 15 * s + 6 * s * s)
        stop = min(at + len(piece), len(t))
        path[at:stop] = piece[:stop - at]
        here, at = piece[-1], stop
    return uniform_filter1d(path, int(0.04 / DT), mode='nearest')


def production(rng, seconds, half_range, top_speed):
    """Trapezoids and S-curves between a few stations, with dwells."""
    stations = rng.uniform(-1, 1, rng.integers(3, 7)) * half_range
    stations[:2] = -half_range, half_range
    t = _time(seconds)
    path = np.full(len(t), stations[0])
    here, at, k = stations[0], int(0.3 / DT), 0
    speed_up = rng.uniform(0.12, 0.4)
    while at < len(t):
        k = (k + rng.integers(1, len(stations))) % len(stations)
        speed = top_speed * rng.choice([0.3, 0.6, 1.0])
        duration = max(abs(stations[k] - here) / speed, 0.05)
        dwell = rng.choice([0.0, 0.1, 0.6])
        move = np.clip(np.arange(int((duration + dwell + speed_up) / DT)) * DT / duration, 0, 1)
        piece = here + (stations[k] - here) * move
        stop = min(at + len(piece), len(t))
        path[at:stop] = piece[:stop - at]
        path[stop:] = piece[-1]
        here, at = piece[-1], stop
    # Running means of a path with constant speeds give limited acceleration and jerk.
    for part in (0.7, 0.3):
        path = uniform_filter1d(path, max(int(part * speed_up / DT), 1), mode='nearest')
    return path


def staircase(rng, seconds, half_range, top_speed, one_way=False):
    """Constant speeds from slow to fast; to and fro within the range, or on and on one way."""
    steps = rng.integers(5, 10)
    speeds = top_speed * np.geomspace(rng.uniform(0.02, 0.08), 1.0, steps)
    t = _time(seconds)
    speed = speeds[np.minimum((t / seconds * steps).astype(int), steps - 1)]
    speed = np.where(t < 0.3, 0.0, speed)
    way = np.cumsum(speed) * DT
    if not one_way:
        # A triangle wave over the way covered turns round at the ends of the range.
        way = half_range * (2 / np.pi) * np.arcsin(np.sin(way * np.pi / 2 / half_range))
    return uniform_filter1d(uniform_filter1d(way, int(0.08 / DT), mode='nearest'),
                            int(0.04 / DT), mode='nearest')


def one_way(rng, seconds, half_range, top_speed):
    """Constant speeds in one direction only."""
    return staircase(rng, seconds, half_range, top_speed, one_way=True)


def steady(rng, seconds, half_range, top_speed):
    """Hardly varies: one speed to and fro over one and the same way."""
    period = 4 * half_range / (top_speed * rng.uniform(0.4, 0.8))
    t = _time(seconds)
    going = np.maximum(t - 0.3 - 0.1 * period, 0)
    way = half_range * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * going / period))
    return uniform_filter1d(way, int(0.1 * period / DT) + 1, mode='nearest')


def slow_sine(rng, seconds, half_range, top_speed):
    """Small and slow reversals, as they show presliding, with larger strokes between."""
    t = _time(seconds)
    swell = 0.5 - 0.48 * np.cos(2 * np.pi * t / seconds * rng.integers(1, 4))
    rate = top_speed / half_range * rng.uniform(0.3, 0.5)
    return _fade(half_range * swell * np.sin(rate * t))


KINDS = {'multi_sine': multi_sine, 'joystick': joystick, 'production': production,
         'staircase': staircase, 'one_way': one_way, 'steady': steady, 'slow_sine': slow_sine}
