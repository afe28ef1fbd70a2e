# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Breakaway currents from recorded current ramps (note, section 2.4, Eq. 8-10).

Applied literally, Eq. 9 detects breakaway at the first encoder count. A real joint flickers by a
count at rest, and creeps by tens of counts on its elastic contacts before it slides. Each ramp is
therefore evaluated backwards: first the run-away is found, a speed held over so many samples that
it is neither flicker nor creep, then the time at which it began, by fitting the position with a
smooth creep that changes into a slide at an unknown time. The current at that time is a local mean
of the measured current, corrected for the slope of the ramp.

This is all that a recording shows of a joint of unknown inertia. Identification knows the inertia,
and uses the peak of friction instead: `ramp_evaluation`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

import numpy as np

from friction_comp.errors import InputError
from friction_comp.identification.slide_begin import slide_begin
from friction_comp.model.friction_model import Breakaway
from friction_comp.samples import smallest_step
from friction_comp.statistics import noise_level

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

RUNAWAY_SPEED = 0.02
"""Speed in rad/s that no presliding creep reaches: ramp slope times k_t·n over a geared joint's
stiffness is a few mrad/s at most."""

_CURRENT_WINDOW = 0.1  # s each side over which the current is averaged


@dataclass(frozen=True)
class BreakawayRecords:
    """Every breakaway of a recording; arrays of shape (M,), in the order of time.

    Attributes
    ----------
    time : ndarray
        Instant t_s at which the motor breaks free, s.
    current : ndarray
        i_m at that instant in A, negative in the negative direction.
    direction : ndarray of int
        +1 or -1.
    position : ndarray
        Joint position at that instant in rad.
    rest_time : ndarray
        How long the joint had stood still when the ramp began, s.
    temperature : ndarray
        Motor temperature in degrees Celsius; NaN where it was not measured.
    slope : ndarray
        The ramp's gradient as measured, A/s, positive.
    cycle : ndarray of int
        Number of the cycle: a positive ramp and the negative one after it make one.
    unresolved : list of (float, int, float)
        Ramps without a breakaway: time of their begin, direction, largest current reached.
    """

    time: np.ndarray
    current: np.ndarray
    direction: np.ndarray
    position: np.ndarray
    rest_time: np.ndarray
    temperature: np.ndarray
    slope: np.ndarray
    cycle: np.ndarray
    unresolved: list[tuple[float, int, float]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.time)

    def currents(self, direction: int) -> np.ndarray:
        """Return the currents of one direction in A, signed."""
        return self.current[self.direction == direction]

    def statistics(self) -> Breakaway:
        """Return means, standard deviations and places over the cycles as a `Breakaway`.

        Raises
        ------
        InputError
            If a direction has no breakaway at all.
        """
        values = {}
        for name, direction in (('positive', 1), ('negative', -1)):
            currents = self.currents(direction)
            if currents.size == 0:
                raise InputError(f'no breakaway in the {name} direction')
            values[f'{name}_mean'] = float(np.mean(currents))
            values[f'{name}_std'] = float(np.std(currents, ddof=1)) if currents.size > 1 else 0.0
            values[f'{name}_position'] = float(np.mean(self.position[self.direction == direction]))
        return Breakaway(**values)

    def to_dict(self) -> dict[str, list[float | None]]:
        """Return the columns as lists, NaN as None, for reports and model files."""
        table = {}
        for item in fields(self):
            if item.name != 'unresolved':
                values = np.round(np.asarray(getattr(self, item.name), dtype=float), 6).tolist()
                table[item.name] = [None if value != value else value for value in values]
        return table

    @staticmethod
    def join(parts: Iterable[BreakawayRecords]) -> BreakawayRecords:
        """Join records; cycles are numbered on where a part's own numbers begin again."""
        parts = list(parts)
        names = [item.name for item in fields(BreakawayRecords) if item.name != 'unresolved']
        columns = {name: np.concatenate([getattr(part, name) for part in parts])
                   for name in names} if parts else {name: np.zeros(0) for name in names}
        return BreakawayRecords(
            **columns, unresolved=[item for part in parts for item in part.unresolved])


def breakaway_currents(time: ArrayLike, position: ArrayLike, current: ArrayLike,
                       command: ArrayLike | None = None, temperature: ArrayLike | None = None,
                       resolution: float | None = None,
                       runaway_speed: float = RUNAWAY_SPEED) -> BreakawayRecords:
    """Find every breakaway in a recording of current ramps.

    The ramps may go on after the joint broke free, as Eq. 8 does, or be cut; they may differ in
    slope, and anything may lie between them.

    Parameters
    ----------
    time, position, current : array_like, shape (N,)
        s, rad, and the measured motor current in A.
    command : array_like, shape (N,), optional
        Commanded current in A; delimits the ramps exactly. Without it they are found in the
        measured current.
    temperature : array_like, shape (N,), optional
        Degrees Celsius.
    resolution : float, optional
        Joint angle of an encoder count in rad; the smallest step seen when omitted.
    runaway_speed : float
        rad/s; a joint this fast is no longer creeping.

    Returns
    -------
    BreakawayRecords

    Raises
    ------
    InputError
        If the arrays do not match, are not finite, or hold no ramp.
    """
    time, position, current = (
        np.ascontiguousarray(a, dtype=float) for a in (time, position, current))
    if time.ndim != 1 or time.shape != position.shape or time.shape != current.shape:
        raise InputError('breakaway: time, position and current must have one length')
    if not (np.all(np.isfinite(time)) and np.all(np.isfinite(position))
            and np.all(np.isfinite(current))):
        raise InputError('breakaway: time, position and current must be finite')
    if time.size < 10 or np.any(np.diff(time) <= 0.0):
        raise InputError('breakaway: at least ten samples with increasing time are needed')
    if resolution is None:
        resolution = smallest_step(position)
    ramps = find_ramps(time, current if command is None else np.asarray(command, dtype=float),
                       exact=command is not None)
    if not ramps:
        raise InputError('breakaway: no current ramp in the recording')

    rows, unresolved = [], []
    cycle, previous = -1, -1
    for begin, end, sign in ramps:
        if sign > 0 or previous < 0:
            cycle += 1
        previous = sign
        instant, rest = slide_begin(time, position, begin, end, float(sign), resolution,
                                    runaway_speed)
        slope = _slope(time, current, begin, end, sign)
        if not np.isfinite(instant):
            unresolved.append((float(time[begin]), sign,
                               sign * float(np.max(sign * current[begin:end]))))
            continue
        index = int(np.searchsorted(time, instant))
        level = _current_at(time, current, instant, begin, end, sign * slope)
        warmth = np.nan if temperature is None else float(np.asarray(temperature)[index])
        rows.append((instant, level, sign, position[index], rest, warmth, slope, cycle))
    columns = np.array(rows, dtype=float).reshape(-1, 8).T
    return BreakawayRecords(
        time=columns[0], current=columns[1], direction=columns[2].astype(int),
        position=columns[3], rest_time=columns[4], temperature=columns[5], slope=columns[6],
        cycle=columns[7].astype(int), unresolved=unresolved)


def find_ramps(time: np.ndarray, current: np.ndarray,
               exact: bool = False) -> list[tuple[int, int, int]]:
    """Find the ramps of Eq. 8: stretches in which the current keeps a sign and grows.

    Parameters
    ----------
    time, current : ndarray, shape (N,)
    exact : bool
        Whether the current is free of noise, as a command is.

    Returns
    -------
    list of (int, int, int)
        First sample, the one after the largest current, and the direction.
    """
    signal = current
    if exact:
        threshold = 1e-9
    else:
        noise = noise_level(current)
        width = 1 + 2 * int(np.clip(0.025 / max(np.median(np.diff(time)), 1e-9), 0, 500))
        kernel = np.full(width, 1.0 / width)
        signal = np.convolve(np.pad(current, width // 2, mode='edge'), kernel, 'valid')
        threshold = max(5.0 * noise / np.sqrt(width), 0.03 * float(np.max(np.abs(signal))), 1e-9)
    state = np.where(np.abs(signal) > threshold, np.sign(signal), 0.0)
    edges = np.concatenate([[0], np.nonzero(np.diff(state))[0] + 1, [state.size]])
    ramps = []
    for begin, end in zip(edges[:-1], edges[1:]):
        sign = int(state[begin])
        if sign == 0 or time[end - 1] - time[begin] < 0.05:
            continue
        top = begin + int(np.argmax(sign * signal[begin:end])) + 1
        rise = sign * signal[top - 1] / max(time[top - 1] - time[begin], 1e-9)
        # The threshold cuts off the beginning of the ramp: go back to where it left zero.
        foot = time[begin] - sign * signal[begin] / max(rise, 1e-12)
        first = int(np.searchsorted(time, foot)) if not exact else int(begin)
        if top - first >= 20 and sign * signal[top - 1] > 2.0 * threshold:
            ramps.append((first, top, sign))
    return ramps


def _slope(time: np.ndarray, current: np.ndarray, begin: int, end: int, sign: int) -> float:
    """The ramp's gradient in A/s, positive, by least squares."""
    t = time[begin:end] - np.mean(time[begin:end])
    return float(sign * np.dot(t, current[begin:end]) / np.dot(t, t))


def _current_at(time: np.ndarray, current: np.ndarray, instant: float, begin: int, end: int,
                gradient: float) -> float:
    """The current in A at an instant on the ramp, its noise averaged out."""
    reach = min(_CURRENT_WINDOW, max(time[end - 1] - instant, 0.01))
    a, b = np.searchsorted(time, (instant - reach, instant + reach))
    a, b = max(int(a), begin), min(int(b) + 1, end)
    return float(np.mean(current[a:b] - gradient * (time[a:b] - instant)))
