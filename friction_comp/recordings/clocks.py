# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Computes message times from stamps that are empty, stand still, jump, or are set back."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from friction_comp.recordings.scan import Track

_SECOND = 1_000_000_000
# A clock that starts at zero reaches its second stamp within this time; only then is a leading
# stamp of zero a time and not an empty field.
_ZERO_IS_A_TIME = _SECOND
# So many messages in a row behind what came before them are a clock set back; fewer have merely
# overtaken each other.
_SET_BACK = 20
# A stamp further than this from both its neighbours belongs to neither.
_FAR_OFF = _SECOND
# Steps of time that make a gap: so many usual ones, and at least so long.
_GAP_STEPS, _GAP = 5.0, 0.02
GAPS = ' gaps in the joint states'


@dataclass
class Shifts:
    """What is added to times from each message on, so that time never runs back.

    Attributes
    ----------
    at : list of int
        Number of the message (`Track.order`) from which on each shift holds.
    by : list of int
        ns.
    """

    at: list[int] = field(default_factory=list)
    by: list[int] = field(default_factory=list)

    def of(self, times: np.ndarray, order: np.ndarray) -> np.ndarray:
        """Return times in ns shifted, shape (N,)."""
        if not self.at:
            return times
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
    if filled[0] > 0 and not empty[filled[0]:].any() and stamp[filled[0]] < _ZERO_IS_A_TIME:
        return stamp
    # Stamps may follow another clock than the receiver's, so receive times are carried over.
    notes.append(f'{np.count_nonzero(empty)} stamps are zero: receive times are used for them')
    offset = stamp[filled] - receive[filled]
    nearest = np.searchsorted(filled, np.nonzero(empty)[0]).clip(0, len(filled) - 1)
    repaired = stamp.copy()
    repaired[empty] = receive[empty] + offset[nearest]
    return repaired


def far_off(times: np.ndarray) -> np.ndarray:
    """Return which times are far from those of their neighbours, shape (N,) of bool."""
    if len(times) < 5:
        return np.zeros(len(times), dtype=bool)
    since = (times - times[0]).astype(float)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(since, 2, mode='edge'), 5)
    off: np.ndarray = np.abs(since - np.median(around, axis=1)) > _FAR_OFF
    return off


def set_backs(times: np.ndarray, order: np.ndarray, receive: np.ndarray,
              notes: list[str]) -> Shifts:
    """Return what is to be added to times so that they go on where the clock was set back.

    What follows a set-back is put behind what came before, by the receive times where these went
    on, else by a gap.

    Parameters
    ----------
    times, order, receive : ndarray of int
        Times, number and receive time of the messages in the order of the file, shape (N,).
    notes : list of str
        Gets a line for each set-back.
    """
    shifts = Shifts()
    steps = np.diff(times)
    usual = int(np.median(steps[steps > 0])) if (steps > 0).any() else 0
    shift = 0
    for k in np.nonzero(steps < 0)[0] + 1:
        behind = times[k:k + _SET_BACK]
        if len(behind) < _SET_BACK or behind.max() >= times[k - 1] or (np.diff(behind) < 0).any():
            continue
        gone = int(receive[k] - receive[k - 1])
        gap = gone if gone > 0 else round(2 * _GAP_STEPS) * max(usual, 1)
        back = int(times[k - 1] - times[k])
        shift += back + gap
        shifts.at.append(int(order[k]))
        shifts.by.append(shift)
        notes.append(f'the clock was set back by {back / _SECOND:.3g} s after '
                     f'{(times[k - 1] - times[0]) / _SECOND:.3f} s: what follows is put behind')
    return shifts


def gap_length(steps: np.ndarray) -> float:
    """Return how long a step of time in s, shape (N,), is no usual one any more."""
    return max(_GAP_STEPS * float(np.median(steps)), _GAP)


def note_gaps(times: np.ndarray, notes: list[str]) -> None:
    """Say where joint states are missing; times in s, ascending, shape (N,)."""
    steps = np.diff(times)
    if not len(steps):
        return
    gaps = np.nonzero(steps > gap_length(steps))[0]
    if len(gaps):
        longest = gaps[np.argmax(steps[gaps])]
        notes.append(f'{len(gaps)}{GAPS}, the longest of {steps[longest]:.3g} s after '
                     f'{times[longest] - times[0]:.3f} s')
