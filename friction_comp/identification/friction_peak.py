# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction along a current ramp: breakaway is its maximum before the joint slides.

Of the motor's current a part accelerates the joint, the rest is friction:

``f = i - a / (k_t·n/J) - c·ω``

with the viscous current c·ω left to Eq. 6. Within presliding, f rises with the current; once the
joint slides, f no longer rises and the excess current accelerates the joint (in the LuGre, Dahl,
Bouc-Wen and Maxwell-slip models alike: Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica
30(7), 1994). The peak of f is therefore the breakaway current, whatever the presliding is like. The
first motion, or the first motion faster than creep, comes 5 to 30 % too early on a gear with long
presliding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friction_comp.identification.inertia import local_parabolas
from friction_comp.statistics import noise_level

# rad/s above which a joint has left presliding; later samples are not breakaway.
_SLIDING_SPEED = 0.02
# s over which f is smoothed: shorter than a rotor needs to break free of presliding, and long
# enough to suppress the resonance on the gear's compliance.
_SHORTEST, _LONGEST = 0.024, 0.064
# Noise of f left after smoothing, as a share of the level.
_NOISE = 0.007
# Share of breakaway at which presliding has ended.
_GONE = 0.95


@dataclass(frozen=True)
class RampFriction:
    """What friction took along one ramp, in its direction, up to where the joint slides; (M,)."""

    time: np.ndarray        # s
    current: np.ndarray     # friction's part of the current, smoothed, A
    position: np.ndarray    # the way given since the ramp's begin, smoothed, rad
    measured: np.ndarray    # the way as the encoder shows it, rad
    peak: int               # index of the largest current of friction

    @property
    def breakaway(self) -> float:
        """Breakaway current in A, a magnitude."""
        return float(self.current[self.peak])

    def presliding(self, breakaway: float) -> float:
        """Return the displacement in rad at which friction reaches 95 % of breakaway.

        On this very ramp, since friction differs from place to place: a contact that takes 4 %
        less here than elsewhere would reach 95 % of the mean at the flat end of its curve.
        """
        k = int(np.argmax(self.current >= min(_GONE * breakaway, self.breakaway)))
        return float(self.position[k])


def ramp_friction(time: np.ndarray, position: np.ndarray, current: np.ndarray, sign: int,
                  resolution: float, acceleration_per_current: float,
                  viscous: float = 0.0) -> RampFriction | None:
    """Separate friction from what accelerates the joint, along one ramp.

    Parameters
    ----------
    time, position, current : ndarray, shape (N,)
        s, rad, A, from the ramp's begin at rest on.
    sign : int
        Direction of the ramp.
    resolution : float
        rad of an encoder count.
    acceleration_per_current : float
        k_t·n/J in rad/s² per A. At breakaway some percent of the current accelerate the joint, so
        that an error of 20 % of it is one of 1 % of breakaway.
    viscous : float
        c in A·s/rad.

    Returns None where the joint did not slide, or the ramp is too short.
    """
    step = float(np.median(np.diff(time)))
    even = time[0] + step * np.arange(int((time[-1] - time[0]) / step) + 1)
    way = np.interp(even, time, sign * (position - position[0]))
    driven = np.interp(even, time, sign * current)
    count = _window(step, driven, resolution, acceleration_per_current)
    half = count // 2
    if even.size < 3 * count:
        return None

    given, speed, acceleration = local_parabolas(way, count, step)
    smooth = np.convolve(driven, np.full(count, 1.0 / count), 'valid')
    # A joint that decelerates was stopped by friction, or by teeth in contact after backlash.
    inertia = np.maximum(acceleration, 0.0) / acceleration_per_current
    friction = smooth - inertia - viscous * speed
    # A rotor that slides through backlash is stopped by the link: the last slide is that of the
    # joint.
    slow = speed <= _SLIDING_SPEED
    end = even.size - count + 1 - int(np.argmax(slow[::-1]))
    if slow.all() or not slow.any():
        return None
    return RampFriction(
        time=even[half:half + end], current=friction[:end], position=given[:end],
        measured=way[half:half + end],
        peak=int(np.argmax(np.where(slow[:end], friction[:end], -np.inf))))


def _window(step: float, driven: np.ndarray, resolution: float, rate: float) -> int:
    """Samples to smooth over, odd: as few as counts and the current's noise allow."""
    allowed = _NOISE * max(float(np.max(driven)), 1e-9)
    # Variance of a parabola's second derivative over a window T: 720·σ²·step/T⁵.
    counts = (60.0 * resolution ** 2 * step / (allowed * rate) ** 2) ** 0.2
    noise = noise_level(driven)
    width = max(counts, step * (noise / allowed) ** 2, _SHORTEST)
    return max(round(min(width, _LONGEST) / step), 5) | 1
