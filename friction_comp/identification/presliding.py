# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction along current ramps: breakaway is its maximum, before it come presliding and backlash.

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

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np

from friction_comp.identification.kinetic import local_parabolas
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
# Standard deviations of presliding that the scatter does not include: of a distance that begins and
# ends within a count, and of the method, as a share (gears of `bench/law_table.py`, seeds 44 and
# 46: 0.09).
_SHARE_OF_COUNT, _METHOD = 0.4, 0.09
# Stiffness is computed up to this share of breakaway; and the counts that a joint must have given
# in that part, times the root of the ramps' number.
_EARLY, _COUNTS = 1.0 / 3.0, 4.0
# Threshold on the share of breakaway by which a ramp stays below its hull, and share of the ramps
# in each direction that must exceed it: not every ramp crosses backlash. Simulated gears without
# any stay below in one direction at least, those with visible backlash have 0.05 to 0.24 in both
# (`bench/law_table.py --floors identification`, seeds 42 to 48).
_DEPTH, _SHARE = 0.04, 0.2
_SURE = 3.0          # standard deviations of the current's noise that are no upturn
_SEEN_COUNTS = 3.0   # the least backlash that an encoder tells
_PLACES = 60         # of the curve
_NEAR = 0.75         # share of what a ramp crossed from which on its tangent at the touch is taken


@dataclass(frozen=True)
class RampFriction:
    """What friction took along one ramp, in its direction, up to where the joint slides; (M,)."""

    time: np.ndarray        # s
    current: np.ndarray     # friction's part of the current, smoothed, A
    position: np.ndarray    # the way given since the ramp's begin, smoothed, rad
    measured: np.ndarray    # the way as the encoder shows it, rad
    peak: int               # index of the largest current of friction
    half: int               # samples to either side over which it is smoothed
    noise: float            # standard deviation of the smoothed current, A

    @property
    def breakaway(self) -> float:
        """Breakaway current in A, a magnitude."""
        return float(self.current[self.peak])

    def presliding(self, breakaway: float, upturn: int = 0) -> float:
        """Return the displacement in rad at which friction reaches 95 % of breakaway.

        On this very ramp, since friction differs from place to place: a contact that takes 4 %
        less here than elsewhere would reach 95 % of the mean at the flat end of its curve.

        Teeth that touch at the index `upturn` add the link's part late by what was crossed: what
        exceeds the tangent there, since the rotor's own friction, being concave, stays below it.
        """
        way = np.maximum.accumulate(self.position)
        friction, crossed = self.current, way[upturn]
        if upturn > 0:
            before, touch = np.interp((_NEAR * crossed, crossed), way, self.current)
            slope = (touch - before) / ((1.0 - _NEAR) * crossed)
            added = np.maximum.accumulate(np.where(
                way > crossed, self.current - touch - slope * (way - crossed), 0.0))
            friction = friction + np.interp(way + crossed, way, added) - added
        k = int(np.argmax(friction >= min(_GONE * breakaway, self.breakaway)))
        return float(self.position[k])


def ramp_friction(time: np.ndarray, position: np.ndarray, current: np.ndarray, sign: int,
                  resolution: float, acceleration_per_current: float,
                  viscous: float = 0.0) -> RampFriction | None:
    """Separate friction from what accelerates the joint, along one ramp.

    Time in s, position in rad and current in A, shape (N,), are of a ramp in the direction `sign`,
    from its begin at rest on; `resolution` is the angle of an encoder count. Of k_t·n/J, an error
    of 20 % is one of 1 % of breakaway, since only some percent of the current accelerate the joint.
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
        measured=way[half:half + end], half=half,
        noise=float(np.std(driven[half:half + end] - smooth[:end]) / np.sqrt(count)),
        peak=int(np.argmax(np.where(slow[:end], friction[:end], -np.inf))))


def _window(step: float, driven: np.ndarray, resolution: float, rate: float) -> int:
    """Samples to smooth over, odd: as few as counts and the current's noise allow."""
    allowed = _NOISE * max(float(np.max(driven)), 1e-9)
    # Variance of a parabola's second derivative over a window T: 720·σ²·step/T⁵.
    counts = (60.0 * resolution ** 2 * step / (allowed * rate) ** 2) ** 0.2
    noise = noise_level(driven)
    width = max(counts, step * (noise / allowed) ** 2, _SHORTEST)
    return max(round(min(width, _LONGEST) / step), 5) | 1


def combined_presliding(ways: list[tuple[bool, float]]) -> float:
    """Return the presliding distance in rad from ramps after slides to either side.

    Of each: whether the previous slide had the same direction, and the displacement in rad. A
    contact of Maxwell-slip elements has a memory of sliding: a ramp in the direction of the slide
    before it yields less than the presliding distance, one against it yields more, and by Masing's
    rule (each branch of a hysteresis loop is the first curve at twice its size) the sum is twice
    the distance. Contacts without that memory (Dahl, LuGre) yield the same both times. The mean of
    both is the distance in either case.
    """
    sides = [[way for same, way in ways if same is side] for side in (True, False)]
    return float(np.mean([np.median(side) for side in sides if side])) if ways else 0.0


def presliding_std(ways: list[tuple[bool, float]], distance: float, resolution: float) -> float:
    """Return by how much presliding of one rest differs from `combined_presliding`, rad.

    A standard deviation: how the ramps scatter, the count within which a way begins and ends, and
    what the method itself is off by on gears that scatter little.
    """
    sides = [np.array([way for same, way in ways if same is side]) for side in (True, False)]
    # Width of the middle half of the distances, since single ones may be far off.
    scatter = [float(np.subtract(*np.quantile(side, (0.75, 0.25)))) / 1.35
               if len(side) > 2 else 0.3 * distance for side in sides if len(side)]
    return math.hypot(float(np.sqrt(np.mean(np.square(scatter)))), _SHARE_OF_COUNT * resolution,
                      _METHOD * distance)


def common_stiffness(ramps: Sequence[RampFriction], breakaway: float,
                     resolution: float) -> float | None:
    """Return the slope of friction over displacement up to a third of breakaway, A/rad.

    The ramps are those in the direction of the slide before them: then every contact sticks at
    the begin, as in a gear that is loaded for the first time; against it some slip at once. None
    where the encoder is too coarse to tell.
    """
    together = squares = given = 0.0
    for ramp in ramps:
        last = int(np.argmax(ramp.current > _EARLY * breakaway))
        if last < 3:
            return None
        # Where within a count a ramp began is unknown, so deviations from the mean are used.
        rise = ramp.current[:last] - np.mean(ramp.current[:last])
        together += float(np.dot(rise, ramp.position[:last]))
        squares += float(np.dot(rise, rise))
        given += float(ramp.position[last] - ramp.position[0]) / len(ramps)
    if given * math.sqrt(len(ramps)) < _COUNTS * resolution or not together > 0.0:
        return None
    return squares / together


def _upturn(ramp: RampFriction, resolution: float) -> tuple[float, int]:
    """Return how far a ramp's curve stays below its hull, a share, and where most, an index."""
    width = max(resolution, float(np.max(ramp.measured)) / _PLACES)
    place = np.maximum.accumulate(np.maximum(0, np.rint(ramp.measured / width).astype(int)))
    count = np.bincount(place)
    # Where within a count the ramp began is unknown, so the first count is not used.
    x = np.flatnonzero(count)[1:]
    if len(x) < 4:
        return 0.0, 0
    y = np.bincount(place, ramp.current)[x] / count[x]
    top = int(np.argmax(y))     # What falls from there on is the slide.
    corners = [0]
    for k in range(1, top + 1):
        while len(corners) > 1:
            i, j = corners[-2:]
            if (y[j] - y[i]) * (x[k] - x[j]) > (y[k] - y[j]) * (x[j] - x[i]):
                break
            corners.pop()
        corners.append(k)
    below = np.interp(x[:top + 1], x[corners], y[corners]) - y[:top + 1]
    # Samples within the window of smoothing share their noise.
    windows = np.maximum(1.0, count[x[:top + 1]] / (2 * ramp.half + 1))
    below -= _SURE * ramp.noise / np.sqrt(windows)
    return float(np.max(below) / y[top]), int(np.searchsorted(place, x[np.argmax(below)]))


def crossed_backlash(ramps: Sequence[RampFriction], directions: Sequence[int],
                     resolution: float) -> tuple[float, list[int]]:
    """Return the backlash of a gear, rad, and each ramp's index at which teeth touch; 0 if none.

    The friction of a gear's contacts rises more and more slowly with displacement: every contact
    that begins to slide leaves fewer that still hold (in the Dahl, LuGre, Bouc-Wen and Maxwell-slip
    models alike). Along a ramp it is therefore a concave function of displacement. While teeth are
    apart, only the motor's own friction acts; where they touch, that of the link is added and the
    curve bends upwards. The distance of the curve below its concave hull indicates backlash, and
    the lowest point is the touch: so far the ramp went since the rest in which the teeth were left.
    """
    depths = [_upturn(ramp, resolution) for ramp in ramps]
    upturns = [at if depth > _DEPTH and ramp.position[at] >= _SEEN_COUNTS * resolution else 0
               for ramp, (depth, at) in zip(ramps, depths)]
    shares = [np.mean([at > 0 for at, other in zip(upturns, directions) if other == sign])
              for sign in set(directions)]
    # A contact that is stiffer on one side also curves upwards, but in one direction only.
    if len(shares) < 2 or min(shares) < _SHARE:
        return 0.0, [0] * len(ramps)
    # Smoothing shows an impact half a window before it happens.
    met = [ramp.position[min(at + ramp.half, len(ramp.position) - 1)]
           for ramp, at in zip(ramps, upturns) if at > 0]
    return float(np.median(met)), upturns
