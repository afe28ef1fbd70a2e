# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Computes message times from stamps that are empty, constant, jump, or are set back."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from friction_comp.recordings.tracks import Track

_SECOND = 1_000_000_000
# A leading stamp of zero is a time, not an empty field, if the next one is smaller than this.
_LARGEST_AFTER_ZERO = _SECOND
# Successive messages with earlier stamps that mean a clock set back; fewer are merely out of order.
_SET_BACK = 20
# Distance of a stamp from its neighbours above which it is an outlier.
_FAR_OFF = _SECOND
# Shortest gap, in median time steps and in s.
_GAP_STEPS, _GAP = 5.0, 0.02
GAPS = ' gaps in the joint states'


@dataclass
class Shifts:
    """Offsets in ns, each added from a message (by `Track.order`) on: time never decreases."""

    at: list[int] = field(default_factory=list)
    by: list[int] = field(default_factory=list)

    def of(self, times: np.ndarray, order: np.ndarray) -> np.ndarray:
        """Return shifted times in ns, shape (N,)."""
        index = np.searchsorted(self.at, order, side='right')
        shifted: np.ndarray = times + np.array([0, *self.by], dtype=np.int64)[index]
        return shifted


def message_times(track: Track, notes: list[str]) -> np.ndarray:
    """Return the time of each message in ns: its stamp, or the receive time where that is zero."""
    stamp, receive = track.stamp, track.receive
    empty = stamp == 0
    if empty.all():
        notes.append('stamps are zero: receive times are used')
        return receive
    if not empty.any():
        if len(stamp) > 20 and len(np.unique(stamp)) < len(stamp) // 10:
            notes.append('stamps hardly change: receive times are used')
            return receive
        return stamp
    filled = np.nonzero(~empty)[0]
    if filled[0] > 0 and not empty[filled[0]:].any() and stamp[filled[0]] < _LARGEST_AFTER_ZERO:
        return stamp
    # Receive times are converted to the clock of the stamps, which may be another.
    notes.append(f'{np.count_nonzero(empty)} stamps are zero: receive times are used for them')
    offset = stamp[filled] - receive[filled]
    nearest = np.searchsorted(filled, np.nonzero(empty)[0]).clip(0, len(filled) - 1)
    repaired = stamp.copy()
    repaired[empty] = receive[empty] + offset[nearest]
    return repaired


def far_off(times: np.ndarray) -> np.ndarray:
    """Return which times are outliers among their neighbours, bool, shape (N,)."""
    if len(times) < 5:
        return np.zeros(len(times), dtype=bool)
    since = (times - times[0]).astype(float)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(since, 2, mode='edge'), 5)
    off: np.ndarray = np.abs(since - np.median(around, axis=1)) > _FAR_OFF
    return off


def set_backs(times: np.ndarray, order: np.ndarray, receive: np.ndarray,
              notes: list[str]) -> Shifts:
    """Return the offsets that make times continue where the clock was set back, in ns.

    After a set-back, time continues by the difference of receive times where it is positive, else
    by a gap.
    """
    shifts = Shifts()
    steps = np.diff(times)
    usual_step = int(np.median(steps[steps > 0])) if (steps > 0).any() else 0
    shift = 0
    for k in np.nonzero(steps < 0)[0] + 1:
        following = times[k:k + _SET_BACK]
        if (len(following) < _SET_BACK or following.max() >= times[k - 1]
                or (np.diff(following) < 0).any()):
            continue
        elapsed = int(receive[k] - receive[k - 1])
        gap = elapsed if elapsed > 0 else round(2 * _GAP_STEPS) * max(usual_step, 1)
        back = int(times[k - 1] - times[k])
        shift += back + gap
        shifts.at.append(int(order[k]))
        shifts.by.append(shift)
        notes.append(f'the clock was set back by {back / _SECOND:.3g} s after '
                     f'{(times[k - 1] - times[0]) / _SECOND:.3f} s: later times are shifted')
    return shifts


def gap_length(steps: np.ndarray) -> float:
    """Return the smallest time step in s, of steps of shape (N,), that counts as a gap."""
    return max(_GAP_STEPS * float(np.median(steps)), _GAP)


def note_gaps(times: np.ndarray, notes: list[str]) -> None:
    """Note gaps in joint states; times in s, ascending, shape (N,)."""
    steps = np.diff(times)
    if not len(steps):
        return
    gaps = np.nonzero(steps > gap_length(steps))[0]
    if len(gaps):
        longest = gaps[np.argmax(steps[gaps])]
        notes.append(f'{len(gaps)}{GAPS}, the longest of {steps[longest]:.3g} s after '
                     f'{times[longest] - times[0]:.3f} s')
