# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A joint of a bag as samples: its joint states, and other topics at their times."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from friction_comp.errors import InputError
from friction_comp.facts.motion import at_times
from friction_comp.facts.recorded import check_plausible, moves, tidied, usable
from friction_comp.messages import NANO, TORQUE_UNIT
from friction_comp.recordings.scan import Scan, Track
from friction_comp.samples import JointStates, RecordingInfo, Samples
from friction_comp.statistics import gap_length
from friction_comp.tables.table_recording import TableRecording

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


def number_recordings(recordings: Iterable[tuple[Samples, RecordingInfo]]
                      ) -> list[tuple[Samples, RecordingInfo]]:
    """Return recordings with `recording` set to their index; InputError for several joints."""
    numbered: list[tuple[Samples, RecordingInfo]] = []
    for samples, info in recordings:
        first = numbered[0][1] if numbered else info
        if info.joint != first.joint:
            raise InputError(f'{info.path}: contains joint {info.joint!r}, but {first.path} '
                             f'contains {first.joint!r}: name one with --joint')
        numbered.append((samples.with_(recording=np.full(len(samples), len(numbered))), info))
    return numbered


def without_compensation(samples: Samples, info: RecordingInfo) -> Samples:
    """Return the samples during which no compensation law drove the motor; note what is left out.

    Under a law the current follows its model: without the load, it says nothing about friction.
    """
    begins = [begin for begin, _ in info.activity]
    active = np.array([False, *(activity.state == 'active' and activity.law not in ('', 'none')
                                for _, activity in info.activity)])
    compensated = active[np.searchsorted(begins, samples.time, 'right')]
    if not compensated.any():
        return samples
    info.notes.append(
        f'{100.0 * compensated.mean():.0f} % of the samples left out: a compensation law drove the '
        'motor, and without the load its current does not show the friction')
    return samples.take(~compensated)


def to_samples(recording: Scan | TableRecording, joint: str | None, torque_per_current: float
               ) -> tuple[Samples, RecordingInfo]:
    """Return one joint's signals at the times of its joint states, or of a table's rows.

    Raises InputError if the joint is missing or not named, or the values are impossible.
    """
    if isinstance(recording, TableRecording):
        return recording.samples(joint, torque_per_current)
    scan = recording
    if scan.effort_is_current:
        torque_per_current = 1.0
    track, key = scan.find(joint)
    joint, own = key or joint or '', track.values[key]
    info = RecordingInfo(scan.path, joint, scan.topics, notes=list(scan.notes), model=scan.model,
                         effort_is_current=scan.effort_is_current, linear=scan.linear)
    stamp = _message_times(track, info.notes)
    position, velocity, effort = own.T[:3]
    for name, signal in (('position', position), ('effort', effort)):
        if not np.isfinite(signal).any():
            raise InputError(f'{scan.path}: {track.topic} contains no finite {name} of joint '
                             f'{joint!r}')
    finite, velocity = usable(position, effort, velocity)
    order = _in_order(stamp, finite)
    if not len(order):
        raise InputError(f'{scan.path}: {track.topic} never has position and effort of joint '
                         f'{joint!r} together, with a stamp near the others')
    # Messages of other joints alone have no value of this one.
    expected = np.isfinite(own).any(axis=1) | (len(scan.joints) == 1)
    for reason, count in (
            ('not finite', np.count_nonzero(~finite & expected)),
            ('stamp far off, not later than those before, or after the clock was set back',
             np.count_nonzero(finite) - len(order))):
        info.notes += [f'{count} joint states left out: {reason}'] if count else []
    if lost := scan.custom.get('messages_lost', ''):
        info.notes.append(f'the recorder lost messages: {lost}')
    origin = int(stamp[order[0]])
    info.start = origin * 1e-9
    info.stamps = (stamp - origin) * 1e-9
    base = _TimeBase(stamp[order], track.receive[order], bool(track.stamp.any()), info.notes)
    info.activity = [(base.to_state_time(activity.time) - info.start, activity.of(joint))
                     for activity in scan.activity]
    samples, kept = tidied(Samples(
        time=info.stamps[order], position=position[order],
        current=effort[order] / torque_per_current,
        velocity=None if velocity is None else velocity[order], joint=joint), info.notes)
    info.rows = order[kept]
    base.stamp, base.receive = base.stamp[kept], base.receive[kept]
    samples = samples.with_(**_other_signals(scan, track, key, base, torque_per_current))
    alone = not any(moves(values[:, 0]) for other in scan.of('joint_states')
                    for values in other.values.values() if values is not own)
    check_plausible(samples, scan.path, alone)
    return samples, info


def usable_joints(recording: Scan | TableRecording, names: Iterable[str],
                  torque_per_current: Callable[[str], float] = lambda joint: 1.0
                  ) -> dict[str, tuple[Samples, RecordingInfo]]:
    """Return the joints that are usable; the first one notes the others. InputError if none is."""
    read: dict[str, tuple[Samples, RecordingInfo]] = {}
    faults: list[InputError] = []
    wanted: list[str | None] = [*names] or [None]
    for name in wanted:
        try:
            entry = to_samples(recording, name, torque_per_current(name or ''))
        except InputError as error:
            # An arm is usable even if, for instance, its gripper has no effort.
            faults.append(error)
            continue
        if entry[1].joint in read:
            raise InputError(f'{recording.path}: joint {entry[1].joint!r} is in several topics: '
                             f'name one with --joint: {", ".join(recording.joints)}')
        read[entry[1].joint] = entry
    if not read:
        raise faults[-1]
    next(iter(read.values()))[1].notes[:0] = [f'left out: {fault}' for fault in faults]
    return read


def joint_states_at(samples: Samples, info: RecordingInfo,
                    joints: dict[str, tuple[Samples, RecordingInfo]]) -> JointStates:
    """Return the motion of all `joints`, interpolated to the times of one joint's `samples`."""
    positions, speeds = [], []
    for other, other_info in joints.values():
        # Topics may begin at different times.
        time = samples.time + (info.start - other_info.start)
        positions.append(np.interp(time, other.time, other.position))
        if other.velocity is not None:
            speeds.append(np.interp(time, other.time, other.velocity))
    return JointStates(tuple(joints), np.column_stack(positions),
                       np.column_stack(speeds) if len(speeds) == len(positions) else None)


# Times.

def _message_times(track: Track, notes: list[str]) -> np.ndarray:
    """Return the time of each message in ns: its stamp, or the receive time if most have none."""
    stamp = track.stamp
    if 2 * np.count_nonzero(stamp) < len(stamp):
        notes.append('stamps are zero: receive times are used')
        return track.receive
    if len(stamp) > 20 and len(np.unique(stamp)) < len(stamp) // 10:
        notes.append('stamps hardly change: receive times are used')
        return track.receive
    return stamp


def _in_order(times: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """Return indices of the usable times, ns, (N,), that are later than all usable ones before.

    Single ones far from their neighbours, and those after a clock was set back, are left out.
    """
    far = np.zeros(len(times), dtype=bool)
    if len(times) >= 5:
        elapsed = (times - times[0]).astype(float)
        around = np.lib.stride_tricks.sliding_window_view(np.pad(elapsed, 2, mode='edge'), 5)
        far = np.abs(elapsed - np.median(around, axis=1)) > _FAR_OFF
    rows = np.flatnonzero(usable & ~far)
    latest = np.maximum.accumulate(times[rows])
    later = np.concatenate(([True], latest[1:] > latest[:-1]))[:len(rows)]
    if len(rows) >= _SET_BACK:
        back = np.convolve(times[rows] < latest, np.ones(_SET_BACK), 'valid') >= _SET_BACK
        later[int(np.argmax(back)) if back.any() else len(rows):] = False
    return rows[later]


@dataclass
class _TimeBase:
    """Times of the joint states in ns, at which all other signals are evaluated."""

    stamp: np.ndarray
    receive: np.ndarray
    stamped: bool  # whether the joint states have stamps
    notes: list[str]

    def pair(self, track: Track) -> tuple[np.ndarray, np.ndarray]:
        """Return times of the joint states and of another topic, ns: stamps of one clock if any."""
        receive = track.receive
        if not self.stamped or not track.stamp.any():
            return self.receive, receive
        ahead = track.stamp - receive - np.interp(receive, self.receive, self.stamp - self.receive)
        together = (receive >= self.receive[0]) & (receive <= self.receive[-1])
        low, middle, high = np.quantile(
            ahead[together] if together.any() else 0.0, (0.1, 0.5, 0.9))
        # Without times of receipt, this varies as much as the times.
        if abs(middle) <= _FAR_OFF or high - low > _FAR_OFF:
            return self.stamp, track.stamp
        note = (f'{track.topic}: its stamps are {abs(middle) / NANO:.2g} s off those of the joint '
                'states, of another clock: receive times are used')
        self.notes += [note] if note not in self.notes else []
        return self.receive, receive

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
        times, own = self.pair(track)
        rows = _in_order(own, np.isfinite(values))
        index = np.searchsorted(own[rows], times, side='right') - 1
        return np.where(index >= 0, values[rows][index.clip(0)] if len(rows) else before, before)

    def interpolate(self, track: Track, values: np.ndarray, hole: float, turn: float
                    ) -> np.ndarray | None:
        """Return the signal at each joint state, as `at_times`; None if it covers less than half.

        A single value holds for all.
        """
        times, own = self.pair(track)
        rows = _in_order(own, np.isfinite(values))
        own = own[rows]
        if not len(rows) or (len(rows) > 1 and np.mean(
                (times >= own[0]) & (times <= own[-1])) < 0.5):
            return None
        return at_times((times - times[0]) / NANO, (own - times[0]) / NANO, values[rows], hole,
                        turn)


# Other topics.

def _other_signals(scan: Scan, states: Track, key: str, base: _TimeBase, torque_per_current: float
                   ) -> dict[str, Any]:
    """Return the signals of other topics, each shape (N,), by their names in `Samples`.

    `key` is the joint's name in its `states`; `torque_per_current` in N·m/A is at the joint.
    """
    signals: dict[str, Any] = {}
    for topic, names in _INTERPOLATED.items():
        track = _with_joint(scan.of(topic, states.topic), states, key, base.notes)
        if track is None:
            continue
        for column, name in enumerate(names):
            values = _of_joint(track, key)[:, column]
            if not np.isfinite(values).any() and len(names) > 1:
                continue
            # Across a hole, nothing is known of the torque of a person.
            signals[name] = base.interpolate(
                track, values, HOLE if name == 'load' else np.inf,
                2.0 * np.pi if name == 'reference_position' else 0.0)
            if signals[name] is None:
                base.notes.append(f'{track.topic}: its {np.count_nonzero(np.isfinite(values))} '
                                  'values cover less than half of the recording: not used')
            # Before and after an exercise there is no reference.
            elif topic != 'reference' and np.isnan(signals[name]).any():
                base.notes.append(
                    f'{track.topic}: has gaps, begins later or ends earlier than the joint states: '
                    f'{name} is not known at {np.count_nonzero(np.isnan(signals[name]))} of them')
    # Arrays have no joint names: their order is what the node that commands reports, else that of
    # the reference, else that of the joint states.
    orders = [*(report.joints.split(', ') for report in scan.activity if report.joints),
              *(track.names for track in scan.of('reference', states.topic)), states.names]
    command = _of_array(scan.of('current_command', states.topic), key, orders, base.notes,
                        torque_per_current)
    if command is not None:
        signals['command'] = base.hold(*command)
        # A compensator answers every joint state; a table may hold commands only where they change.
        if scan.activity:
            signals['command'][base.silent(*command)] = np.nan
    return {**signals, 'direction': _direction(scan, states, key, orders, base)}


def _direction(scan: Scan, states: Track, key: str, orders: list[list[str]], base: _TimeBase
               ) -> np.ndarray | None:
    """Return the announced direction; of the two topics, the later message is valid."""
    directions = []
    plain = _of_array(scan.of('direction', states.topic), key, orders, base.notes)
    if plain is not None:
        # Like the compensator, take any other value as 0.
        directions.append((plain[0], np.where(np.isin(plain[1], (-1.0, 1.0)), plain[1], 0.0)))
    stamped = _with_joint(scan.of('direction_stamped', states.topic), states, key, base.notes)
    if stamped is not None:
        directions.append((stamped, np.sign(_of_joint(stamped, key)[:, 1])))
    if not directions:
        return None
    latest, ages = [], []
    for track, values in directions:
        # The topics may have different clocks, so ages are compared instead of times.
        state_times, times = base.pair(track)
        latest.append(base.hold(track, values))
        ages.append(state_times - base.hold(track, times.astype(float), before=-1.0))
    return np.where(np.argmin(ages, axis=0) == 0, latest[0], latest[-1]).astype(int)


def _with_joint(tracks: list[Track], states: Track, key: str, notes: list[str]) -> Track | None:
    """Return the track with values of a joint, if any; notes say what is assumed."""
    for track in tracks:
        if key in track.values:
            return track
    if len(tracks) == 1 and len(tracks[0].names) == len(states.names) == 1:
        # A single sensor belongs to a single joint, whatever its frame.
        if name := tracks[0].names[0]:
            notes.append(f'{tracks[0].topic} of {name!r} is taken to be that of {key!r}')
        return tracks[0]
    if tracks:
        named = ', '.join(repr(name) for name in tracks[0].values)
        notes.append(f'{tracks[0].topic} is of {named}, not of joint {key!r}: its frame_id or '
                     'names say of which joint it is')
    return None


def _of_joint(track: Track, key: str) -> np.ndarray:
    return track.values[key if key in track.values else track.names[0]]


def _of_array(tracks: list[Track], key: str, orders: list[list[str]], notes: list[str],
              torque_per_current: float = 1.0) -> tuple[Track, np.ndarray] | None:
    """Return the track with a joint's values, or None; commands in N·m as currents."""
    for track in tracks:
        places = {name: int(name.removeprefix(TORQUE_UNIT)) for name in track.names}
        width = max(places.values(), default=-1) + 1
        for order in orders:
            if key in order and len(order) == width:
                column = np.full(len(track.receive), np.nan)
                for name, place in places.items():
                    if order[place] == key:
                        own = track.values[name][:, 0]
                        column = np.where(np.isnan(own), column, own / (
                            torque_per_current if TORQUE_UNIT in name else 1.0))
                return track, column
        notes.append(f'{track.topic} has {width} values, which fits no list of joints')
    return None
