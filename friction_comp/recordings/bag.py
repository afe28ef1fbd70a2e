# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A bag as samples: the states of one joint, and other topics at their times."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
import math
from pathlib import Path
from typing import Any

import numpy as np

from friction_comp.errors import InputError, one_of
from friction_comp.facts.motion import at_times
from friction_comp.facts.recorded import checked, usable
from friction_comp.messages import NANO, TOPICS, TORQUE_UNIT
from friction_comp.recordings.scan import Scan, Track
from friction_comp.samples import HOLE, RecordingInfo, Samples
from friction_comp.statistics import gap_length
from friction_comp.tables.columns import STATES, Unit

# Distance of a stamp from its neighbours above which it is far off, and of the clocks of two topics
# above which they are different ones, since no message is as late, ns.
_FAR_OFF = NANO
# With so many successive messages of earlier stamps, the clock was set back; fewer are out of
# order.
_SET_BACK = 20
# Signals of topics that are interpolated.
_INTERPOLATED = {
    'reference': ('reference_position', 'reference_velocity'),
    'interaction_wrench': ('load',), 'motor_temperature': ('temperature',)}


class Bag(Scan):
    """The joints of a bag; arguments are those of `Scan`, and the units of joint states."""

    def __init__(self, path: Path, joint: str | None = None,
                 units: Mapping[str, Unit] | None = None, first: float = math.inf) -> None:
        super().__init__(path, joint, first)
        units = units or {}
        self._factors = [units[signal].factor if signal in units else 1.0 for signal in STATES]
        dimensions = {unit.dimension for unit in units.values()}
        self.in_ampere = self.in_ampere or 'current' in dimensions
        self.linear = bool(dimensions & {'length', 'length/time', 'force'})

    @property
    def joints(self) -> list[str]:
        """Names of the joints, '' for one without; /TOPIC/NAME where several topics hold it."""
        return [*self._joints]

    choices = joints

    @property
    def _joints(self) -> dict[str, tuple[Track, str]]:
        """Track of each joint, and its name there."""
        found = [(track, name) for track in self._of('joint_states') for name in track.values]
        count = Counter(name for _, name in found)
        return {f'{track.topic}/{name}' if count[name] > 1 else name: (track, name)
                for track, name in found}

    def _of(self, signal: str, topic: str = '') -> list[Track]:
        """Return the tracks of a signal: those of topics with exactly its name, otherwise all.

        Those in the namespace of a `topic` go before another robot's.
        """
        tracks = [track for track in self.tracks if track.signal == signal]
        exact = [t for t in tracks if t.topic.rsplit('/', 1)[-1] == signal]
        namespace = topic.rpartition('/')[0] + '/'
        return sorted(exact or tracks, key=lambda track: not track.topic.startswith(namespace))

    def find(self, joint: str | None) -> tuple[Track, str]:
        """Return the track of a joint, the only one by default, and its name there.

        Raises InputError with the choices if it is not clear.
        """
        joints, wanted = self._joints, TOPICS['joint_states']
        if not joints:
            own = ', '.join(topic for topic, kind in self.kinds.items() if kind == wanted)
            raise InputError(f'{self.path}: no joint_states of type {wanted} in it, or no joint in '
                             'them ' + (f'(of that type are {own}: name one, with its joint, as '
                                        '--joint /TOPIC/NAME)' if own else
                                        f'(topics: {", ".join(self.kinds) or "none"})'))
        # A single joint may have no name in the recording; any may be named with its topic.
        if [*joints] == ['']:
            return joints['']
        whole = {f'{track.topic}/{name}': (track, name) for track, name in joints.values()}
        return {**whole, **joints}[joint if joint in whole else one_of(
            [*joints], joint, self.path)]

    def siblings(self, joint: str | None) -> list[str]:
        """Return the joints of an arm: of a joint's topic, and of others with other names."""
        own, _ = self.find(joint)
        return [name for name, (track, plain) in self._joints.items()
                if track is own or plain not in own.values]

    def samples(self, joint: str | None = None, torque_per_current: float = 1.0
                ) -> tuple[Samples, RecordingInfo]:
        """Return one joint's signals at the times of its states; `torque_per_current` in N·m/A.

        Raises InputError if the joint is missing or not named, or the values are impossible.
        """
        per_current = 1.0 if self.in_ampere else torque_per_current
        track, key = self.find(joint)
        joint, own = key or joint or '', track.values[key]
        # The active model: that in the metadata, else the one reported last.
        models = [report.model for report in self.activity if report.model]
        info = RecordingInfo(
            self.path, joint, notes=list(self.notes), linear=self.linear,
            model=self.custom.get('model_file') or (models[-1] if models else None),
            effort_is_current=self.in_ampere)
        stamp = track.stamp
        if 2 * np.count_nonzero(stamp) < len(stamp):
            info.notes.append('stamps are zero: receive times are used')
            stamp = track.receive
        position, velocity, effort = (own[:, :3] * self._factors).T
        finite, velocity = usable(position, effort, velocity)
        order = _in_order(stamp, finite)
        if not len(order):
            missing = [name for name, signal in (('position', position), ('effort', effort))
                       if not np.isfinite(signal).any()]
            raise InputError(f'{self.path}: {track.topic} contains no finite '
                             + (' and '.join(missing) or 'position and effort at one time')
                             + f' of joint {joint!r}')
        # Messages of other joints alone have no value of this one.
        expected = np.isfinite(own).any(axis=1) | (len(self.joints) == 1)
        for reason, count in (
                ('not finite', np.count_nonzero(~finite & expected)),
                ('stamp far off, not later than those before, or after the clock was set back',
                 np.count_nonzero(finite) - len(order))):
            info.notes += [f'{count} joint states left out: {reason}'] if count else []
        if lost := self.custom.get('messages_lost', ''):
            info.notes.append(f'the recorder lost messages: {lost}')
        origin = int(stamp[order[0]])
        info.start, info.stamps = origin * 1e-9, (stamp - origin) * 1e-9
        base = _States(stamp[order], track.receive[order], bool(track.stamp.any()), info.notes)
        info.activity = [(float(base.clock(report.time) - origin) * 1e-9, report.of(joint))
                         for report in self.activity]
        samples, kept = checked(Samples(
            info.stamps[order], position[order], effort[order] / per_current,
            velocity=None if velocity is None else velocity[order], joint=joint,
            **self._other_signals(track, key, base, per_current)), info.notes, self.path, (
                values[:, 0] for other in self._of('joint_states')
                for values in other.values.values() if values is not own))
        info.rows = order[kept]
        return samples, info

    def _other_signals(self, states: Track, key: str, base: _States, torque_per_current: float
                       ) -> dict[str, Any]:
        """Return the signals of other topics, each shape (N,), by their names in `Samples`.

        `key` is the joint's name in its `states`; `torque_per_current` in N·m/A is at the joint.
        """
        signals: dict[str, Any] = {}
        for topic, names in _INTERPOLATED.items():
            found = _of_joint(self._of(topic, states.topic), states, key, base.notes)
            for column, name in enumerate(names if found else ()):
                assert found is not None
                track, values = found[0], found[1][:, column]
                if not np.isfinite(values).any() and len(names) > 1:
                    continue
                # Across a hole, nothing is known of the torque of a person.
                signals[name] = base.interpolate(
                    track, values, HOLE if name == 'load' else np.inf,
                    2.0 * np.pi if name == 'reference_position' else 0.0)
                unknown = np.count_nonzero(np.isnan(signals[name]))
                if few := bool(2 * unknown > len(base.stamp)):
                    signals[name] = None
                # Before and after an exercise there is no reference.
                if few or (unknown and topic != 'reference'):
                    base.notes.append(
                        f'{track.topic}: has gaps, begins later or ends earlier than the joint '
                        f'states: {name} is not known at {unknown} of them'
                        + ', and not used' * few)
        # Arrays have no joint names: their order is what the node that commands reports, else that
        # of the reference, else that of the joint states.
        orders = [*(report.joints.split(', ') for report in self.activity if report.joints),
                  *([*track.values] for track in self._of('reference', states.topic)),
                  [*states.values]]
        command, plain = (
            _of_array(self._of(topic, states.topic), key, orders, base.notes, unit)
            for topic, unit in (('current_command', torque_per_current), ('direction', 1.0)))
        if command:
            signals['command'], _ = base.hold(*command)
            # A compensator answers every joint state.
            if self.activity:
                signals['command'][base.silent(*command)] = np.nan
        # Like the compensator, take any other value as 0.
        directions = [(plain[0], np.where(np.isin(plain[1], (-1.0, 1.0)), plain[1], 0.0))
                      ] if plain else []
        if stamped := _of_joint(self._of('direction_stamped', states.topic), states, key,
                                base.notes):
            directions.append((stamped[0], np.sign(stamped[1][:, 1])))
        if directions:
            # The topics may have different clocks, so ages are compared instead of times.
            latest, ages = zip(*(base.hold(*one) for one in directions))
            signals['direction'] = np.where(
                np.argmin(ages, axis=0) == 0, latest[0], latest[-1]).astype(int)
        return signals


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


class _States:
    """Times of the joint states, ns, at which the values of all other topics are evaluated."""

    def __init__(self, stamp: np.ndarray, receive: np.ndarray, stamped: bool, notes: list[str]
                 ) -> None:
        self.stamp, self.receive, self.notes = stamp, receive, notes
        self._stamped = stamped     # whether the joint states have stamps

    def clock(self, receive: Any) -> Any:
        """Convert receive times to the clock of the joint states."""
        return receive + np.interp(receive, self.receive, self.stamp - self.receive)

    def pair(self, track: Track) -> tuple[np.ndarray, np.ndarray]:
        """Return times of the joint states and of another topic: stamps of one clock if any."""
        receive = track.receive
        if not self._stamped or not track.stamp.any():
            return self.receive, receive
        ahead = float(np.median(track.stamp - self.clock(receive)))
        if abs(ahead) <= _FAR_OFF:
            return self.stamp, track.stamp
        note = (f'{track.topic}: its stamps are {abs(ahead) / NANO:.2g} s off those of the joint '
                'states, of another clock: receive times are used')
        self.notes += [note] if note not in self.notes else []
        return self.receive, receive

    def hold(self, track: Track, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the latest value at each joint state, 0 before the first, and its age, ns."""
        times, own = self.pair(track)
        rows = _in_order(own, np.isfinite(values))
        latest = np.array([-1, *rows])[np.searchsorted(own[rows], times, side='right')]
        known = latest >= 0
        return np.where(known, values[latest], 0.0), np.where(known, times - own[latest], np.inf)

    def silent(self, track: Track, values: np.ndarray) -> np.ndarray:
        """Return at which joint states a topic's last value is too old to hold, bool, shape (N,).

        On their clock, since they and their answers stop together, as in a simulation that waits.
        """
        times = np.sort(self.clock(track.receive[np.isfinite(values)]))
        index = np.searchsorted(times, self.stamp, side='right') - 1
        if not len(times):
            return np.zeros(len(index), dtype=bool)
        age = self.stamp - times[index.clip(0)]
        return (index >= 0) & (1e-9 * age > max(HOLE, gap_length(1e-9 * np.diff(times))))

    def interpolate(self, track: Track, values: np.ndarray, hole: float, turn: float
                    ) -> np.ndarray:
        """Return the signal at each joint state, as `at_times`; a single value holds for all."""
        times, own = self.pair(track)
        rows = _in_order(own, np.isfinite(values))
        if not len(rows):
            return np.full(len(times), np.nan)
        return at_times((times - times[0]) / NANO, (own[rows] - times[0]) / NANO, values[rows],
                        hole, turn)


def _of_joint(tracks: list[Track], states: Track, key: str, notes: list[str]
              ) -> tuple[Track, np.ndarray] | None:
    """Return the track and the values of a joint, if any; notes say what is assumed."""
    for track in tracks:
        if key in track.values:
            return track, track.values[key]
    named = ', '.join(repr(name) for track in tracks[:1] for name in track.values)
    if len(tracks) == 1 and len(tracks[0].values) == len(states.values) == 1:
        # A single sensor belongs to a single joint, whatever its frame.
        notes += [f'{tracks[0].topic} of {named} is taken to be that of {key!r}'] * (named != "''")
        return tracks[0], next(iter(tracks[0].values.values()))
    notes += [f'{track.topic} is of {named}, not of joint {key!r}: its frame_id or names say of '
              'which joint it is' for track in tracks[:1]]
    return None


def _of_array(tracks: list[Track], key: str, orders: list[list[str]], notes: list[str],
              torque_per_current: float) -> tuple[Track, np.ndarray] | None:
    """Return the track with a joint's values, or None; commands in N·m as currents."""
    for track in tracks:
        width = 1 + max((int(name.removeprefix(TORQUE_UNIT)) for name in track.values), default=-1)
        for order in orders:
            if key in order and len(order) == width:
                place, missing = order.index(key), np.full((len(track.receive), 1), np.nan)
                amperes, torque = (track.values.get(f'{unit}{place}', missing)[:, 0]
                                   for unit in ('', TORQUE_UNIT))
                return track, np.where(np.isnan(amperes), torque / torque_per_current, amperes)
        notes.append(f'{track.topic} has {width} values, which fits no list of joints')
    return None
