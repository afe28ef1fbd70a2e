# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""When the rows of a log were really measured.

A logger may write faster than values arrive: rows then repeat the last value, and the true rate is
that of the changes. Where these values were interpolated before they were saved, rows repeat the
slope instead. Or a logger may round times: several different rows then share one time.
"""

from __future__ import annotations

import re

import numpy as np

from friction_comp.errors import InputError
from friction_comp.facts.timing import held_rows
from friction_comp.recordings.table_base import Table
from friction_comp.statistics import smallest_step

# Changes of position above which steps are compared with the resolution: fewer say nothing.
_FEWEST_CHANGES = 50
# Share of earlier times than the one before above which rows are in no order.
_SHUFFLED = 0.1
# A bend of this share of the large ones, as half of all bending is made of, is one; the share of
# motion that must be straight, and of bends that may be none of lines between measured values; and
# the longest time between two such values, s: two turns of a motion in straight lines are farther.
_BENT, _STRAIGHT, _ODD, _SLOWEST = 0.1, 0.3, 0.05, 0.25
# Share of velocities that may differ from zero where positions are held, of those where one is new.
_FEW = 0.1

# Parts of the reading of a clock: how names of columns end, their length in s, and how many make
# one of the next larger part, or of a second.
_CLOCK = (('n(ano)?s(ec(ond)?)?', 1e-9, 1e9), ('(u|µ|micro)s(ec(ond)?)?', 1e-6, 1e6),
          ('m(illi)?s(ec(ond)?)?', 1e-3, 1e3), ('s(ec(ond)?)?', 1.0, 60),
          ('min(ute)?', 60.0, 60), ('h(r|our)?', 3600.0, 24))


def clock_parts(table: Table, seconds: str) -> dict[str, float]:
    """Return the other columns of a clock whose column of seconds is given, and their units, s.

    These are named alike, and hold whole numbers: ``hour, minute, second, msec``, or ``sec`` and
    ``nanosec`` of a stamp of ROS. What is more than a second counts only if seconds end at 60.
    """
    named = {_clock_part(name): name for name in table.names}
    stem, own = _clock_part(seconds)
    others = {size: named[stem, size] for _, size, _ in _CLOCK
              if size != 1.0 and (stem, size) in named}
    if own != 1.0 or not others:
        return {}
    # Rows may lack a value.
    read, *rest = (values[np.isfinite(values)]
                   for values in table.first_rows(seconds, *others.values()))
    values = dict(zip(others, rest))
    whole, ends = bool((read % 1.0 == 0.0).all()), bool(read.max(initial=0.0) < 60.0)
    parts: dict[str, float] = {}
    for _, size, count in _CLOCK:
        held = size in others and (whole if size < 1.0 else ends) and bool((
            (values[size] % 1.0 == 0.0) & (values[size] >= 0.0) & (values[size] < count)).all())
        if held:
            parts[others[size]] = size
        elif size > 1.0:
            # Hours without minutes are of something else.
            break
    return parts


def _clock_part(name: str) -> tuple[str, float]:
    """Return what a name begins with, and the part of a clock's reading it is, s; 0 if none."""
    found = [(match[1], size) for words, size, _ in _CLOCK
             if (match := re.fullmatch(f'(.*?)({words})s?', name, re.IGNORECASE))]
    # `minutes` also ends like a second.
    return min(found, key=lambda entry: len(entry[0]), default=(name, 0.0))


def spread_rounded(stamp: np.ndarray, position: np.ndarray, notes: list[str]) -> np.ndarray:
    """Return ascending stamps in ns, with rows that share one by rounding spread evenly.

    They do if most rows in motion have the stamp of the row before.
    """
    # Infinite values are no positions, and have no difference.
    change = np.diff(np.where(np.isfinite(position), position, np.nan))
    step = np.diff(stamp)
    moved = np.isfinite(change) & (change != 0.0)
    if (step < 0).any():
        return stamp    # the clock was set back, or rows are out of order
    if np.count_nonzero(moved) < _FEWEST_CHANGES or np.mean(step[moved] == 0) < 0.5:
        return stamp
    first = np.concatenate(([0], np.flatnonzero(step > 0) + 1))
    if len(first) < 3:
        return stamp
    rounding = float(np.median(np.diff(stamp[first])))
    spread = np.empty(len(stamp))
    origin = stamp[0]
    # Only between gaps rows are evenly spaced.
    gaps = np.flatnonzero(step > 2.5 * rounding) + 1
    for begin, end in zip([0, *gaps], [*gaps, len(stamp)]):
        index = np.arange(begin, end, dtype=float)
        values = (stamp[begin:end] - origin).astype(float)
        knots = first[(first > begin) & (first < end)]
        if len(knots) < 2:
            spread[begin:end] = values + (index - begin)
            continue
        slope, offset = np.polyfit(knots.astype(float), (stamp[knots] - origin).astype(float), 1)
        line = slope * index + offset
        uneven = np.abs(line[knots - begin] - (stamp[knots] - origin)).max() > rounding
        spread[begin:end] = np.interp(index, knots, (stamp[knots] - origin).astype(float)) \
            if uneven else line
    notes.append(f'times are rounded to {1e-9 * rounding:.3g} s: rows are spread evenly between '
                 'them')
    return origin + np.round(np.maximum.accumulate(spread)).astype(np.int64)


def in_no_order(times: np.ndarray) -> bool:
    """Return whether times, shape (N,), are in no order: no clock is set back as often."""
    return len(times) > 1 and bool(np.mean(np.diff(times) < 0) > _SHUFFLED)


def check_resolution(stamp: np.ndarray, where: str) -> None:
    """Raise InputError if stamps, ns, shape (N,), do not tell rows apart."""
    different = len(np.unique(stamp))
    if len(stamp) >= _FEWEST_CHANGES and different < max(3, len(stamp) / 1000):
        raise InputError(
            f'{where}: {len(stamp)} rows have {different} different time{"s" * (different > 1)} '
            '(a date in 32 bits is as coarse): give the rows per second with --rate')


def fresh_rows(time: np.ndarray, position: np.ndarray, notes: list[str]) -> np.ndarray:
    """Return the indices of the rows that hold a new position, or all if none are repeated.

    During rests rows are kept at the same rate.
    """
    everything = np.arange(len(position))
    if (held := held_rows(position)) < 2:
        return everything
    begin = np.concatenate(([0], np.flatnonzero(np.diff(position)) + 1))
    since = everything - begin[np.searchsorted(begin, everything, side='right') - 1]
    rows = np.flatnonzero(since % held == 0)
    duration = float(time[-1] - time[0])
    notes.append(f'position is held over {held} rows: {len(rows)} of {len(position)} rows are '
                 f'used, {len(rows) / max(duration, 1e-9):.3g} Hz is the rate at which it is '
                 'measured')
    return rows


def measured_rows(time: np.ndarray, position: np.ndarray, effort: np.ndarray, notes: list[str]
                  ) -> np.ndarray:
    """Return the indices of the rows at which position and effort were measured.

    It is `fresh_rows`, or the rows at which lines between measured values bend: what is between was
    interpolated, and tells no more. Signals have shape (N,), times ascend.
    """
    rows = fresh_rows(time, position, notes)
    if len(rows) < len(time):
        return rows
    for name, values in (('position', position), ('effort', effort)):
        # Times may be rounded, and values interpolated over evenly spaced ones.
        for axis in (time, np.linspace(time[0], time[-1], len(time))):
            bends, apart = _bends_of_lines(axis, values)
            if len(bends):
                # A straight motion does not bend at each of them.
                rows = np.unique(np.concatenate([
                    np.round(np.linspace(begin, end, max(round((end - begin) / apart), 1) + 1))
                    for begin, end in zip([0, *bends], [*bends, len(time) - 1])])).astype(int)
                notes.append(
                    f'{name} was interpolated, in straight lines over {apart:.3g} rows: {len(rows)}'
                    f' of {len(time)} rows are used, those near the measured values, '
                    f'{len(rows) / max(float(time[-1] - time[0]), 1e-9):.3g} Hz')
                return rows
    return rows


def _bends_of_lines(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the rows at which straight lines bend, and how many rows these are apart.

    Without such lines there are none. A line bends in one row, or in the two beside a value between
    them, then to the same side. Noise and steps of an encoder bend to and fro in each row, and
    smooth motion bends everywhere.
    """
    none = np.empty(0, dtype=int), 0.0
    if len(values) < _FEWEST_CHANGES:
        return none
    slope = np.diff(values) / np.diff(time)
    bend = np.diff(slope)
    size = np.sort(np.abs(bend))[::-1]
    total = np.cumsum(size)
    bent = np.abs(bend) > _BENT * size[min(np.searchsorted(total, 0.5 * total[-1]), len(size) - 1)]
    moves = (slope[1:] != 0.0) | (slope[:-1] != 0.0)
    if not bent.any() or np.mean(bent[moves]) > 1.0 - _STRAIGHT:
        return none
    after = bent[:-1] & bent[1:]
    odd = np.count_nonzero(after & ((bend[:-1] < 0.0) != (bend[1:] < 0.0))) + np.count_nonzero(
        after[:-1] & after[1:])
    first = np.flatnonzero(bent & ~np.concatenate(([False], after)))
    if len(first) < _FEWEST_CHANGES or odd > _ODD * len(first):
        return none
    between = np.diff(first)
    usual = np.quantile(between, 0.25)
    apart = float(np.mean(between[between <= 1.5 * usual]))
    step = float(np.median(np.diff(time)))
    # A steady acceleration in steps of an encoder bends by one, at no regular distance.
    coarse = np.mean(step * np.abs(bend[first]) < 1.5 * smallest_step(values)) > 0.5
    if apart < 2.0 or apart * step > _SLOWEST or (
            coarse and np.mean(between % round(apart) == 0) < 1.0 - _ODD):
        return none
    # A value between two rows bends the nearer one more.
    later = np.append(np.abs(bend[1:]) > np.abs(bend[:-1]), False) & np.append(after, False)
    return first + 1 + later[first], apart


def fresh_velocity(velocity: np.ndarray | None, order: np.ndarray, fresh: np.ndarray,
                   notes: list[str]) -> tuple[np.ndarray | None, bool]:
    """Return the velocity, shape (N,), right at the `fresh` of the rows in `order`.

    Also return whether it was measured. One that was computed from each row to the next is zero
    where the position is held, and too large at fresh rows: all of the motion since the last one,
    divided by the time of one row. That is undone; it tells no more than the position.
    """
    if velocity is None or len(fresh) == len(order):
        return velocity, True
    ordered = velocity[order]
    held = np.count_nonzero(np.delete(ordered, fresh))
    if held >= _FEW * np.count_nonzero(ordered[fresh]):
        return velocity, True
    notes.append('velocity was computed from row to row, and is zero where the position is held: '
                 'only compared with the position')
    result = velocity.copy()
    result[order[fresh]] = np.diff(np.cumsum(ordered)[fresh], prepend=0.0) / np.diff(
        fresh, prepend=-1)
    return result, False
