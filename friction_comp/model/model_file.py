# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The schema of model files, of one joint or of a whole arm; msg_docs describes the sections.

A file of one joint holds the arguments of `FrictionModel`. That of an arm holds one of these for
each joint, and once what they share, the links. Beside friction it keeps what was measured at rest,
and of the recordings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
import math
from pathlib import Path
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import (
    check_document,
    check_interval,
    check_mapping,
    Checked,
    errors_name,
    InputError,
    listed,
    mapping,
    number,
    one_of,
    Reader,
    section,
    stated,
)
from friction_comp.files import plain, read_yaml, write_yaml
from friction_comp.model.differentiation import settings_of
from friction_comp.model.effect import Effect
from friction_comp.model.effects import EFFECTS
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples
from friction_comp.statistics import evenly_spread, rms

FORMAT, ARM_FORMAT, VERSION = 'friction_comp_model', 'friction_comp_arm', 1
# Sections of which any says that friction was measured: then Eq. 6 must not be missing.
_MEASURED = {'sigmoid', 'breakaway', 'presliding', 'effects', 'lookup_table', 'recorded', 'arm'}
_OF_BREAKAWAY = ('mean', 'std', 'position')
_SIDES = ('positive', 'negative')
_SIZE, _POSITIVE = number(least=0.0), number(above=0.0)


@dataclass(frozen=True)
class Breakaway(Checked):
    """Breakaway currents of Eq. 9 and 10, A, signed, and the positions where measured, rad."""

    positive_mean: float = stated(_SIZE)
    negative_mean: float = stated(number(most=0.0))
    positive_std: float = stated(_SIZE, 0.0)
    negative_std: float = stated(_SIZE, 0.0)
    positive_position: float | None = stated(number(), None)
    negative_position: float | None = stated(number(), None)

    @property
    def friction(self) -> float:
        """Friction at breakaway, A: half of what lies between the directions."""
        return 0.5 * (self.positive_mean - self.negative_mean)

    @property
    def held(self) -> float:
        """What acts in one direction at breakaway, as a weight or an offset does, A."""
        return 0.5 * (self.positive_mean + self.negative_mean)

    def times(self, factor: float) -> Breakaway:
        """Return them `factor` times as large; the same if their scatter is larger than that."""
        scatter = max(self.positive_std / max(self.positive_mean, 1e-9),
                      self.negative_std / max(-self.negative_mean, 1e-9))
        if abs(factor - 1.0) <= scatter:
            return self
        return replace(self, **{
            f'{side}_{what}': factor * getattr(self, f'{side}_{what}')
            for side in ('positive', 'negative') for what in ('mean', 'std')})


@dataclass(frozen=True)
class Presliding(Checked):
    """Displacement of the gear before it slides, from current ramps."""

    # rad, from rest without load until friction is at 95 % of breakaway
    distance: float = stated(_POSITIVE)
    std: float | None = stated(_POSITIVE, None)     # standard deviation between single rests, rad
    backlash: float | None = stated(_SIZE, None)    # rad, not part of distance; 0 if there is none


LARGER = 1.5
"""Factor of the expected error that is worth a note."""
LINE = ('offset', 'coulomb', 'viscous')
"""Parameters of the line, in A, A and A·s/rad."""
# Signals that have a range, with their unit and the change that is too small to matter.
_SIGNALS = {'speed': ('rad/s', 0.0), 'acceleration': ('rad/s²', 0.0), 'position': ('rad', 0.0),
            'load': ('N·m', 0.0), 'temperature': ('°C', 2.0), 'rigid_body': ('N·m', 0.0)}


def signals_read(samples: Samples, effects: Iterable[Effect]) -> dict[str, np.ndarray]:
    """Return each signal, (N,), that a sum of the sigmoid and effects depends on, but time.

    Speed and acceleration are sizes: nothing is known of either sign alone. A load, a temperature
    and positions of other joints count even if no effect depends on them: where they hardly varied,
    nothing is known of that.
    """
    names = {'speed', 'load', 'temperature'}.union(*(effect.reads() for effect in effects))
    values = {name: getattr(samples, 'velocity' if name == 'speed' else name)
              for name in _SIGNALS if name in names and samples.velocity is not None}
    # Their torque counts, where a URDF tells it.
    if samples.rigid_body is None and samples.arm is not None:
        values |= {f'position of {joint}': one for joint, one in zip(
            samples.arm.joints, samples.arm.position.T) if joint != samples.joint}
    return {name: np.abs(one) if name in ('speed', 'acceleration') else one
            for name, one in values.items() if one is not None}


# What rows that a model keeps may hold.
SIGNALS_OF_ROWS = ('time', 'position', 'velocity', 'acceleration', 'load', 'temperature',
                   'rigid_body', 'coupling')


@dataclass(frozen=True)
class Recorded(Checked):
    """What a model file keeps of the recordings it was fitted to."""

    # Quantiles of the speed in motion, rad/s, the lowest first.
    speeds: tuple[float, ...] = stated(listed(_POSITIVE), ())
    # 95 % intervals by parameter, in the model's unit of current, of `LINE`, inertia, transition,
    # and Coulomb with Stribeck friction (static).
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict, metadata={
        'read': mapping(check_interval, (*LINE, 'inertia', 'static', 'transition'))})
    # Lowest and highest value in motion, of each of `signals_read`.
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict, metadata={
        'read': mapping(check_interval)})
    error: float | None = stated(_SIZE, None)   # to expect in motion of another recording, RMS, A
    load: float = stated(number(), 0.0)         # mean measured load in motion, N·m
    # The longest of the recordings, s: `error` is at this rate.
    sample_time: float | None = stated(_SIZE, None)
    # Some states of the recorded motion, evenly spread: `position`, `velocity` and what else the
    # effects read, by the names of `Samples`, each (R,); see `friction_numbers.states_of`.
    rows: dict[str, tuple[float, ...]] = field(default_factory=dict, metadata={
        'read': mapping(listed(number()), SIGNALS_OF_ROWS)})

    def __post_init__(self) -> None:
        super().__post_init__()
        rows = self.rows
        if rows and (not {'position', 'velocity'} <= rows.keys() or not rows['position']
                     or len(set(map(len, rows.values()))) > 1):
            raise InputError(
                'recorded.rows must have position and velocity, and all as many values')

    def with_ranges(self, samples: Samples, effects: Iterable[Effect]) -> Recorded:
        """Return it with ranges and rows of samples in motion, which effects were fitted to."""
        effects = list(effects)
        ranges = {}
        for name, values in signals_read(samples, effects).items():
            low, high = np.quantile(values, (0.01, 0.99))
            ranges[name] = (0.0 if name in ('speed', 'acceleration') else float(low), float(high))
        every = np.arange(128)
        index = np.unique((every + evenly_spread(every)) * len(samples) // 128).astype(int)
        names = {'position', 'velocity', *(name for effect in effects for name in effect.reads()),
                 *(['time'] if any(not one.holds_on_another_day for one in effects) else [])}
        rows = {name: tuple(float(f'{value:.6g}') for value in values[index])
                for name in SIGNALS_OF_ROWS if samples.velocity is not None and name in names
                and (values := getattr(samples, name)) is not None}
        return replace(self, ranges=ranges, rows=rows, load=(
            0.0 if samples.load is None else float(np.mean(samples.load))))

    def beyond(self, samples: Samples, effects: Iterable[Effect], linear: bool = False,
               torque_per_current: float = 1.0) -> list[str]:
        """Return a note on each signal of which much of a motion is beyond the recorded range.

        Like other effects, friction is believed for a quarter of the range beyond it, and a load
        for the error to expect. Of an angle, a turn is all there is.
        """
        notes = []
        for name, values in signals_read(samples, effects).items():
            low, high = self.ranges.get(name, (-math.inf, math.inf))
            # With the sine of another joint's position, the weight varies.
            unit, least = _SIGNALS.get(name, ('rad', 0.1))
            if name == 'load':
                least = (self.error or 0.0) * torque_per_current
            more = max(0.25 * (high - low), least)
            share = float(np.mean((values < low - more) | (values > high + more)))
            whole_turn = name.startswith('position') and not linear and high - low >= 2.0 * math.pi
            if share >= 0.1 and not whole_turn:
                notes.append(
                    f'{100.0 * share:.0f} % of this motion is more than a quarter beyond the '
                    f'{name.replace("rigid_body", "torque of the links")} that the model was '
                    f'fitted to, {low:.3g} to {high:.3g} {unit}: it is extrapolated, and the error '
                    'may be larger than the report expects')
        return notes

    def error_at(self, speed: np.ndarray) -> float:
        """Return the RMS error to expect of motion at some speeds, (N,), rad/s, in A.

        Where the slope of friction is uncertain, the error grows away from the recorded speeds.
        """
        low, high = self.intervals.get('viscous', (0.0, 0.0))
        away = rms(speed - np.median(self.speeds)) if self.speeds else 0.0
        return math.hypot(self.error or 0.0, 0.5 * (high - low) * away)

    def interval(self, name: str, value: float) -> tuple[float, float] | None:
        """Return a parameter's interval; None if it does not hold the value, as after a change."""
        low, high = self.intervals.get(name, (math.nan, math.nan))
        return (low, high) if low <= value <= high else None

    @property
    def in_both_directions(self) -> bool:
        """Whether a part of the rows is in each direction of motion."""
        forwards = np.mean(np.array(self.rows.get('velocity', (-1.0, 1.0))) > 0.0)
        return bool(0.02 < forwards < 0.98)


def read_model(path: str | Path, joint: str | None = None) -> dict[str, Any]:
    """Return the arguments of the `FrictionModel` in a file; of an arm's file that of one joint.

    Raises InputError, which names the file and the reason, if it cannot be used.
    """
    document = read_yaml(path)
    with errors_name(path):
        try:
            return arguments_of(one_joint_of(document, joint))
        except OverflowError:
            raise InputError('holds a number that is too large') from None


def arguments_of(document: Any) -> dict[str, Any]:
    """Return the arguments of the `FrictionModel` in a document; raises InputError."""
    check_document(document, 'a model file', FORMAT, VERSION, {'format', 'version', *_SECTIONS})
    given = {name: value for name, value in document.items() if value is not None}
    needed = {'drive', *(['sigmoid'] if given.keys() & _MEASURED else [])}
    return {'sigmoid': Sigmoid(0.0, 0.0, 1.0), **{
        name: read(given.get(name), name) for name, read in _SECTIONS.items()
        if name in given or name in needed}}


def document_of(model: Any) -> dict[str, Any]:
    """Return a `FrictionModel` as the plain values of its file."""
    values = {name: getattr(model, name) for name in _SECTIONS}
    return plain({'format': FORMAT, 'version': VERSION, **{
        name: _WRITTEN.get(name, lambda value: value)(value) for name, value in values.items()
        if name == 'effects' or (value is not None and value != {})}})


def write_arm(path: str | Path, models: Mapping[str, Any]) -> None:
    """Write the file of a whole arm, from the `FrictionModel` of each joint.

    Of an arm with links, only friction that turns with two joints is one joint's own.
    """
    documents = {name: document_of(model) for name, model in models.items()}
    document: dict[str, Any] = {'format': ARM_FORMAT, 'version': VERSION, 'joints': documents}
    for model in documents.values():
        links = model.get('arm', {})
        if 'links' in links:
            document['arm'] = {name: value for name, value in links.items() if name != 'friction'}
            model['arm'] = {'friction': links['friction']} if 'friction' in links else 'shared'
    write_yaml(path, document)


def joints_of(document: Any) -> list[str] | None:
    """Return the joints of a whole arm's document; None if it describes one joint."""
    if not isinstance(document, dict) or document.get('format') != ARM_FORMAT:
        return None
    check_document(document, 'a file of a whole arm', ARM_FORMAT, VERSION)
    return [str(name) for name in check_mapping(document.get('joints') or None, 'joints')]


def one_joint_of(document: Any, joint: str | None) -> Any:
    """Return the document of one joint; that of a single joint unchanged.

    Raises InputError if it lacks the joint, or has several and none is given.
    """
    names = joints_of(document)
    if names is None:
        return document
    model = document['joints'][one_of(names, joint)]
    own = model.get('arm') if isinstance(model, dict) else None
    if own == 'shared' or (isinstance(own, dict) and list(own) == ['friction']):
        model = {**model, 'arm': {**(document.get('arm') or {}),
                                  **(own if isinstance(own, dict) else {})}}
    return model


def _sigmoid(value: Any, name: str) -> Sigmoid:
    check_mapping(value, name, ('coefficients', 'velocity_unit'))
    return Sigmoid.from_coefficients(value.get('coefficients'), value.get('velocity_unit', 'rad/s'))


def _breakaway(value: Any, name: str) -> Breakaway:
    check_mapping(value, name, _SIDES)
    return section(Breakaway)({
        f'{side}_{what}': one for side in _SIDES for what, one in check_mapping(
            value.get(side), f'{name}.{side}', _OF_BREAKAWAY).items()}, name)


def _lookup_table(value: Any, name: str) -> dict[str, Any]:
    table = mapping(dict.fromkeys(('speeds', 'currents', 'standard_deviations'),
                                  listed(number())))(value, name)
    if len(table.get('speeds') or ()) != len(table.get('currents') or ()):
        raise InputError(f'{name}: speeds and currents must have the same length')
    return table


def _arm(value: Any, name: str) -> Any:
    # Few files have one.
    from friction_comp.model.arm import Arm

    return Arm.from_dict(check_mapping(value, name))


def _effect(entry: Any, _: str) -> Effect:
    if not isinstance(entry, dict) or 'name' not in entry:
        raise InputError(f'an effect needs a name: {entry!r}')
    name = f"effect '{entry['name']}'"
    kind = EFFECTS.get(str(entry['name']))
    if kind is None:
        raise InputError(f"unknown {name}; known: {', '.join(EFFECTS)}")
    check_mapping(entry, name, ('name', 'variable', 'parameters', 'valid_range'))
    parameters = check_mapping(entry.get('parameters') or {}, f'parameters of {name}')
    try:
        return kind(parameters, entry.get('valid_range'))
    except (InputError, OverflowError) as error:
        raise InputError(f'{name}: {error}') from None


_SECTIONS: dict[str, Reader] = {
    'joint': lambda value, _: str(value), 'drive': section(Drive), 'sigmoid': _sigmoid,
    'breakaway': _breakaway, 'presliding': section(Presliding),
    'position_limits': check_interval, 'uncertainty': number(least=0.0),
    'effects': lambda value, name: list(listed(_effect)(value, name)),
    'recorded': section(Recorded), 'lookup_table': _lookup_table, 'differentiation': settings_of,
    'simulation': check_mapping, 'notes': check_mapping, 'arm': _arm}
"""The sections of a model file, by the fields of `FrictionModel`, and how each is read."""


def _entries(section: Any) -> dict[str, Any]:
    return {name: value for name, value in vars(section).items()
            if value is not None and value != {}}


_WRITTEN: dict[str, Callable[[Any], Any]] = {
    'drive': _entries, 'presliding': _entries, 'recorded': _entries,
    'sigmoid': lambda curve: {'coefficients': curve.coefficients(), 'velocity_unit': 'rad/s'},
    'breakaway': lambda known: {side: {
        what: value for what in _OF_BREAKAWAY
        if (value := getattr(known, f'{side}_{what}')) is not None} for side in _SIDES},
    'effects': lambda effects: [effect.to_dict() for effect in effects],
    'arm': lambda arm: arm.to_dict()}
"""How sections are written that are no plain values."""
