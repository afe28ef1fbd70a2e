# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Computes the times of messages, and evaluates other topics at the times of the joint states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from friction_comp.facts.motion import turns_of
from friction_comp.facts.timing import gap_length, rhythm
from friction_comp.recordings.scan import Scan, Track
from friction_comp.stamps import NANO
from friction_comp.topics import TORQUE_UNIT

# Distance of a stamp from its neighbours above which it is far off, and of the clocks of two topics
# above which they are different ones, since no message is as late, ns.
_FAR_OFF = NANO
# With so many successive messages of earlier stamps, the clock was set back; fewer are out of
# order.
_SET_BACK = 20
# Time for which a person's torque or the motion may be interpolated, s; a driver does not keep the
# current of a command for longer (the plant's `command_timeout`).
HOLE = 0.1
# Topics that are interpolated, and the signals in their columns.
_INTERPOLATED = {
    'reference': ('reference_position', 'reference_velocity'),
    'interaction_wrench': ('load',), 'motor_temperature': ('temperature',),
}


def message_times(track: Track, notes: list[str]) -> np.ndarray:
    """Return the time of each message in ns: its stamp, or the receive time if most have none."""
    stamp = track.stamp
    if np.count_nonzero(stamp) < 0.5 * len(stamp):
        notes.append('stamps are zero: receive times are used')
        return track.receive
    if len(stamp) > 20 and len(np.unique(stamp)) < len(stamp) // 10:
        notes.append('stamps hardly change: receive times are used')
        return track.receive
    return stamp


def far_off(times: np.ndarray) -> np.ndarray:
    """Return which times in ns, shape (N,), are single ones far from their neighbours."""
    if len(times) < 5:
        return np.zeros(len(times), dtype=bool)
    elapsed = (times - times[0]).astype(float)
    neighbours = np.lib.stride_tricks.sliding_window_view(np.pad(elapsed, 2, mode='edge'), 5)
    return np.abs(elapsed - np.median(neighbours, axis=1)) > _FAR_OFF


def rising(times: np.ndarray) -> np.ndarray:
    """Return which times in ns, shape (N,), are later than all before; none after a set-back."""
    latest = np.maximum.accumulate(times)
    later = np.concatenate(([True], latest[1:] > latest[:-1]))[:len(times)]
    if len(times) >= _SET_BACK:
        back = np.convolve(times < latest, np.ones(_SET_BACK), 'valid') >= _SET_BACK
        later[int(np.argmax(back)) if back.any() else len(times):] = False
    return later


def at_times(times: np.ndarray, own: np.ndarray, values: np.ndarray, hole: float = 0.0,
             turn: float = 0.0) -> np.ndarray:
    """Return values, shape (N,), interpolated from their `own` times, rising, to others, s.

    They are NaN farther than a gap beyond the ends, and in gaps longer than `hole`, s. Those of an
    angle that may wrap around at a `turn` are continued over it.
    """
    if turn:
        values = values + turn * turns_of(own, values, turn)
    interpolated: np.ndarray = np.interp(times, own, values)
    if len(own) > 1:
        steps = np.diff(own)
        gap = gap_length(steps)
        beyond = np.maximum(own[0] - times, times - own[-1])
        following = np.searchsorted(own, times).clip(1, len(steps))
        within = (steps[following - 1] > max(gap, hole)) & ~np.isin(times, own)
        interpolated[(beyond > gap) | ((beyond <= 0.0) & within)] = np.nan
    return interpolated


def note_gaps(times: np.ndarray, notes: list[str]) -> None:
    """Note gaps in joint states; times in s, ascending, shape (N,)."""
    _, gaps, longest, before = rhythm(times)
    if gaps:
        notes.append(f'{gaps} gaps in the joint states, the longest of {longest:.3g} s after '
                     f'{before:.3f} s')


@dataclass
class TimeBase:
    """Times of the joint states in ns, at which all other signals are evaluated."""

    stamp: np.ndarray
    receive: np.ndarray
    stamped: bool  # whether the joint states have stamps
    notes: list[str]

    def pair(self, track: Track) -> tuple[np.ndarray, np.ndarray]:
        """Return times of the joint states and of another topic, ns: stamps of one clock if any."""
        if not self.stamped or not track.stamp.any():
            return self.receive, track.receive
        receive = track.receive
        ahead = track.stamp - receive - np.interp(receive, self.receive, self.stamp - self.receive)
        together = (receive >= self.receive[0]) & (receive <= self.receive[-1])
        low, middle, high = np.quantile(
            ahead[together] if together.any() else 0.0, (0.1, 0.5, 0.9))
        # Without times of receipt, this varies as much as the times.
        if not abs(middle) > _FAR_OFF or high - low > _FAR_OFF:
            return self.stamp, track.stamp
        note = (f'{track.topic}: its stamps are {abs(middle) / NANO:.2g} s off those of the joint '
                'states, of another clock: receive times are used')
        if note not in self.notes:
            self.notes.append(note)
        return self.receive, receive

    def _finite_values(self, track: Track, values: np.ndarray
                       ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the times of `pair`, the other topic's where they rise, and finite values."""
        times, other_times = self.pair(track)
        finite = np.isfinite(values)
        finite &= ~far_off(other_times)
        later = rising(other_times[finite])
        return times, other_times[finite][later], values[finite][later]

    def to_state_time(self, receive: Any) -> Any:
        """Convert receive times in ns to the clock of the joint states, s."""
        ahead = np.interp(receive, self.receive, self.stamp - self.receive)
        return (receive + ahead) * 1e-9

    def silent(self, track: Track, values: np.ndarray) -> np.ndarray:
        """Return at which joint states a topic's last value is too old to hold, bool, shape (N,).

        On their clock, since they and their answers stop together, as in a simulation that waits.
        """
        times = np.sort(self.to_state_time(track.receive[np.isfinite(values)]))
        index = np.searchsorted(times, 1e-9 * self.stamp, side='right') - 1
        if not len(times):
            return np.zeros(len(index), dtype=bool)
        age = 1e-9 * self.stamp - times[index.clip(0)]
        return (index >= 0) & (age > max(HOLE, gap_length(np.diff(times))))

    def hold(self, track: Track, values: np.ndarray, before: float = 0.0) -> np.ndarray:
        """Return the latest value at each joint state (zero-order hold); `before` if none yet."""
        times, other_times, values = self._finite_values(track, values)
        index = np.searchsorted(other_times, times, side='right') - 1
        return np.where(index >= 0, values[index.clip(0)] if len(values) else before, before)

    def interpolate(self, track: Track, values: np.ndarray, hole: float = np.inf,
                    turn: float = 0.0) -> np.ndarray | None:
        """Return the signal at each joint state, or None if it covers less than half of them.

        It is NaN where it ends earlier, or begins later, than at a gap from the joint states, and
        in gaps longer than `hole`, s; see `at_times`.
        """
        times, other_times, values = self._finite_values(track, values)
        if not len(values):
            return None
        origin = times[0]
        covered = (times >= other_times[0]) & (times <= other_times[-1])
        if len(other_times) > 1 and covered.mean() < 0.5:
            return None
        return at_times((times - origin) / NANO, (other_times - origin) / NANO, values, hole, turn)


def other_signals(scan: Scan, joint: str, joints: list[str], base: TimeBase,
                  torque_per_current: float, notes: list[str]) -> dict[str, Any]:
    """Return the signals of other topics, each shape (N,), by their names in `Samples`.

    `joints` are all of the joint states, in order; `torque_per_current` in N·m/A is at the joint.
    """
    signals: dict[str, Any] = {}
    for topic, names in _INTERPOLATED.items():
        track_and_values = _find_joint(scan.of(topic), joint, joints, notes)
        if track_and_values is None:
            continue
        track, values = track_and_values
        for column, name in zip(values.T, names):
            if np.isfinite(column).any() or len(names) == 1:
                # Across a hole, nothing is known of the torque of a person.
                signals[name] = base.interpolate(
                    track, column, HOLE if name == 'load' else np.inf,
                    2.0 * np.pi if name == 'reference_position' else 0.0)
                if signals[name] is None:
                    notes.append(f'{track.topic}: its '
                                 f'{np.count_nonzero(np.isfinite(column))} values cover less than '
                                 'half of the recording: not used')
                # Before and after an exercise there is no reference.
                elif topic != 'reference' and np.isnan(signals[name]).any():
                    notes.append(f'{track.topic}: has gaps, begins later or ends earlier than the '
                                 f'joint states: {name} is not known at '
                                 f'{np.count_nonzero(np.isnan(signals[name]))} of them')
    # Arrays have no joint names: their order is what the node that commands reports, else that of
    # the reference, else that of the joint states.
    order = [*(report.joints.split(', ') for report in scan.activity if report.joints),
             *(track.names for track in scan.of('reference')), joints]
    command = _find_array(scan.of('current_command'), joint, order, notes, torque_per_current)
    if command is not None:
        signals['command'] = base.hold(*command)
        # A compensator answers every joint state; a table may hold commands only where they change.
        if scan.activity:
            signals['command'][base.silent(*command)] = np.nan
    return {**signals, 'direction': _direction(scan, joint, joints, order, base, notes)}


def _direction(scan: Scan, joint: str, joints: list[str], order: list[list[str]],
               base: TimeBase, notes: list[str]) -> np.ndarray | None:
    """Return the announced direction; of the two topics, the later message is valid."""
    directions = []
    plain = _find_array(scan.of('direction'), joint, order, notes)
    if plain is not None:
        # Like the compensator, take any other value as 0.
        directions.append((plain[0], np.where(np.isin(plain[1], (-1.0, 1.0)), plain[1], 0.0)))
    stamped = _find_joint(scan.of('direction_stamped'), joint, joints, notes)
    if stamped is not None:
        directions.append((stamped[0], np.sign(stamped[1][:, 1])))
    if not directions:
        return None
    latest, ages = [], []
    for track, values in directions:
        # The topics may have different clocks, so ages are compared instead of times.
        state_times, times = base.pair(track)
        latest.append(base.hold(track, values))
        ages.append(state_times - base.hold(track, times.astype(float), before=-1.0))
    return np.where(np.argmin(ages, axis=0) == 0, latest[0], latest[-1]).astype(int)


def _find_joint(tracks: list[Track], joint: str, joints: list[str],
                notes: list[str]) -> tuple[Track, np.ndarray] | None:
    """Return track and values of a joint's signal, if any; notes say what is assumed."""
    for track in tracks:
        if joint in track.values:
            return track, track.values[joint]
    if len(tracks) == 1 and len(tracks[0].values) == len(tracks[0].names) == len(joints) == 1:
        # A single sensor belongs to a single joint, whatever its frame.
        (name, values), = tracks[0].values.items()
        if name:
            notes.append(f'{tracks[0].topic} of {name!r} is taken to be that of {joint!r}')
        return tracks[0], values
    if tracks:
        named = ', '.join(repr(name) for name in tracks[0].values)
        notes.append(f'{tracks[0].topic} is of {named}, not of joint {joint!r}: its frame_id or '
                     'names say of which joint it is')
    return None


def _find_array(tracks: list[Track], joint: str, orders: list[list[str]], notes: list[str],
                torque_per_current: float = 1.0) -> tuple[Track, np.ndarray] | None:
    """Return the track with a joint's values, or None; commands in N·m as currents."""
    for track in tracks:
        width = max(values.shape[1] for values in track.values.values())
        for order in orders:
            if joint in order and len(order) == width:
                column = np.full(len(track.receive), np.nan)
                for unit, values in track.values.items():
                    if order.index(joint) < values.shape[1]:
                        own = values[:, order.index(joint)]
                        scale = torque_per_current if unit == TORQUE_UNIT else 1.0
                        column = np.where(np.isnan(own), column, own / scale)
                return track, column
        notes.append(f'{track.topic} has {width} values, which fits no list of joints')
    return None
