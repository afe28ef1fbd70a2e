# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The drive's current as a sum of effects, and the model file that holds it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
import math
from pathlib import Path
from typing import Any

import numpy as np

from friction_comp.checks import check_document, check_list, check_mapping, check_number
from friction_comp.drive import Drive
from friction_comp.errors import errors_name, InputError
from friction_comp.files import plain, read_yaml, write_yaml
from friction_comp.model.arm.arm import Arm
from friction_comp.model.arm_document import one_joint_of
from friction_comp.model.differentiation import DEFAULT_SETTINGS, differentiate
from friction_comp.model.effects import Effect, EFFECTS
from friction_comp.model.schema import check_keys, ENTRIES
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples

FORMAT = 'friction_comp_model'
VERSION = 1


@dataclass(frozen=True)
class Breakaway:
    """Breakaway currents of Eq. 9 and 10 in A; the negative direction's mean is negative.

    The positions in rad at which they were measured, where known, let effects of position be
    told from the breakaway friction itself.
    """

    positive_mean: float
    negative_mean: float
    positive_std: float = 0.0
    negative_std: float = 0.0
    positive_position: float | None = None
    negative_position: float | None = None

    def __post_init__(self) -> None:
        for name in ('positive_mean', 'negative_mean', 'positive_std', 'negative_std'):
            if not math.isfinite(getattr(self, name)):
                raise InputError(f'breakaway.{name} must be finite')
        for name in ('positive_position', 'negative_position'):
            if not math.isfinite(getattr(self, name) or 0.0):
                raise InputError(f'breakaway.{name} must be finite')
        if self.positive_mean < 0 or self.negative_mean > 0:
            raise InputError(
                'breakaway currents must have the sign of their direction, not '
                f'{self.positive_mean} and {self.negative_mean}')
        if self.positive_std < 0 or self.negative_std < 0:
            raise InputError('breakaway standard deviations must not be negative')


@dataclass(frozen=True)
class Presliding:
    """Displacement of the gear before it slides, from current ramps.

    Parameters
    ----------
    distance : float
        rad, from rest without load until friction is at 95 % of breakaway.
    stiffness : float, optional
        A/rad, of friction up to a third of breakaway.
    std : float, optional
        Standard deviation between single rests, rad. None if unknown.
    """

    distance: float
    stiffness: float | None = None
    std: float | None = None

    def __post_init__(self) -> None:
        for name in ('distance', 'stiffness', 'std'):
            value = getattr(self, name)
            if value is None and name != 'distance':
                continue
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f'presliding.{name} must be positive and finite, not {value!r}')


@dataclass
class FrictionModel:
    """Sigmoid of Eq. 6, breakaway currents and further effects of one drive.

    Parameters
    ----------
    drive : Drive
    sigmoid : Sigmoid
    breakaway : Breakaway, optional
    effects : list of Effect
    presliding : Presliding, optional
    position_limits : tuple of float, optional
        Ends of the joint's range in rad; the compensator lets no friction push beyond them.
    joint : str
    lookup_table : dict, optional
        ``speeds`` rad/s, ``currents`` A, ``standard_deviations`` A: the table the sigmoid was
        fitted to (note, section 2.3).
    arm : Arm, optional
        The rest of the arm, for effects of other joints.
    differentiation : dict
        How velocity and acceleration are derived from position when the model is applied to a
        recording; written by refinement, empty otherwise.
    simulation : dict
        What only the simulated plant reads; never used by identification or compensation.
    notes : dict
        Where the model comes from.
    """

    drive: Drive
    sigmoid: Sigmoid
    breakaway: Breakaway | None = None
    effects: list[Effect] = field(default_factory=list)
    joint: str = ''
    presliding: Presliding | None = None
    position_limits: tuple[float, float] | None = None
    lookup_table: dict[str, Any] | None = None
    differentiation: dict[str, Any] = field(default_factory=dict)
    arm: Arm | None = None
    simulation: dict[str, Any] = field(default_factory=dict)
    notes: dict[str, Any] = field(default_factory=dict)

    def predict(self, samples: Samples, same_recording: bool = False) -> np.ndarray:
        """Return the motor current in A, shape (N,), that the model expects for recorded samples.

        Velocity and acceleration are computed the way the model was fitted. There is a finite
        value for every sample, also at standstill, where it is the model's value for no motion.
        Effects that belong to the recording they were found in (what drifted by the clock) are
        left out of any other one.

        Parameters
        ----------
        samples : Samples
            As recorded.
        same_recording : bool
            Whether it is the recording that the model was refined on, or one begun in the same
            state of the drive, so that what drifted in the one drifts in the other.

        Raises
        ------
        InputError
            If an effect needs a signal that was not recorded.
        """
        settings = self.differentiation or DEFAULT_SETTINGS
        known = self if same_recording else self.for_other_recordings()
        current = known.current(differentiate(self.with_arm(samples), settings))
        return np.nan_to_num(current, nan=0.0, posinf=0.0, neginf=0.0)

    def measured(self, samples: Samples) -> np.ndarray:
        """Return the measured current in A, shape (N,), with which `predict` is compared.

        Friction is overcome by the motor and the person together. Where the load was recorded, the
        person's share ``τ_b/(k_t·n)`` is therefore added to the motor current, unless the model has
        an effect of the load torque, which already describes that share.

        Parameters
        ----------
        samples : Samples
            As recorded.
        """
        if samples.load is None or any(
                effect.by_mechanics(self.drive) is not None for effect in self.effects):
            return samples.current
        return samples.current + np.nan_to_num(samples.load) / self.drive.torque_per_current

    def for_other_recordings(self) -> FrictionModel:
        """Return the model without the effects that do not hold in another recording."""
        lasting = [effect for effect in self.effects if effect.holds_on_another_day]
        return self if len(lasting) == len(self.effects) else replace(self, effects=lasting)

    def with_arm(self, samples: Samples) -> Samples:
        """Return recorded samples with the torques of the rest of the arm on the joint."""
        known = samples.rigid_body is not None or samples.coupling is not None
        return samples if known or self.arm is None else self.arm.on(samples, self.joint)

    def current(self, samples: Samples) -> np.ndarray:
        """Return the motor current in A, shape (N,), for samples that are differentiated already.

        Parameters
        ----------
        samples : Samples
            With velocity, and with what the effects ask for.
        """
        current = np.asarray(self.sigmoid(np.asarray(samples.velocity)), dtype=float)
        for effect in self.effects:
            current = current + effect.current(samples)
        return current

    def to_dict(self) -> dict[str, Any]:
        """Return the model as the plain values of its file."""
        document = {'format': FORMAT, 'version': VERSION, 'joint': self.joint}
        drive = {
            'torque_constant': self.drive.torque_constant,
            'gear_ratio': self.drive.gear_ratio,
            'current_limit': self.drive.current_limit,
        }
        if self.drive.encoder_counts is not None:
            drive['encoder_counts'] = self.drive.encoder_counts
        document['drive'] = drive
        document['sigmoid'] = {
            'coefficients': list(self.sigmoid.coefficients()), 'velocity_unit': 'rad/s'}
        if self.breakaway is not None:
            document['breakaway'] = {
                side: {what: getattr(self.breakaway, f'{side}_{what}')
                       for what in ('mean', 'std', 'position')
                       if getattr(self.breakaway, f'{side}_{what}') is not None}
                for side in ('positive', 'negative')}
        if self.presliding is not None:
            document['presliding'] = {
                name: value for name, value in vars(self.presliding).items() if value is not None}
        if self.position_limits is not None:
            document['position_limits'] = list(self.position_limits)
        document['effects'] = [effect.to_dict() for effect in self.effects]
        for name in ('lookup_table', 'differentiation', 'simulation', 'notes'):
            if getattr(self, name):
                document[name] = getattr(self, name)
        if self.arm is not None:
            document['arm'] = self.arm.to_dict()
        return plain(document)

    def save(self, path: Path | str) -> None:
        """Write the model file; the old file stays whole until the new one is complete."""
        write_yaml(path, self.to_dict())

    @classmethod
    def load(cls, path: str | Path, joint: str | None = None) -> FrictionModel:
        """Read a model file.

        Parameters
        ----------
        path : path-like
        joint : str, optional
            Which model is wanted of a file that holds those of a whole arm.

        Raises
        ------
        InputError
            Naming the file and what is wrong with it.
        """
        document = read_yaml(path)
        with errors_name(path):
            try:
                return cls.from_dict(one_joint_of(document, joint))
            except OverflowError:
                raise InputError('holds a number that is too large') from None

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> FrictionModel:
        """Make a model of the plain values of its file."""
        check_document(document, 'a model file', FORMAT, VERSION, ENTRIES)
        check_keys(document)
        sigmoid = _section(document, 'sigmoid')
        if 'coefficients' not in sigmoid or not isinstance(sigmoid['coefficients'], list):
            raise InputError('sigmoid.coefficients is missing or not a list')
        optional: dict[str, Any] = {}
        if document.get('presliding') is not None:
            optional['presliding'] = _presliding(_section(document, 'presliding'))
        if document.get('position_limits') is not None:
            optional['position_limits'] = _range(_list(document, 'position_limits'))
        for name in ('lookup_table', 'simulation', 'notes'):
            if document.get(name) is not None:
                optional[name] = _section(document, name)
        if document.get('arm') is not None:
            optional['arm'] = Arm.from_dict(_section(document, 'arm'))
        return cls(
            drive=_drive(_section(document, 'drive')),
            sigmoid=Sigmoid.from_coefficients(
                sigmoid['coefficients'], sigmoid.get('velocity_unit', 'rad/s')),
            breakaway=_breakaway(document),
            effects=[_effect(entry) for entry in _list(document, 'effects')],
            differentiation=_differentiation(document),
            joint=str(document.get('joint') or ''), **optional)


def _differentiation(document: dict[str, Any]) -> dict[str, Any]:
    """Return how motion is computed."""
    if document.get('differentiation') is None:
        return {}
    section = dict(_section(document, 'differentiation'))
    for name in ('bandwidth', 'lag'):
        if section.get(name) is not None:
            section[name] = _number(section, name, 'differentiation')
    return section


def _presliding(section: dict[str, Any]) -> Presliding:
    values = {name: _number(section, name, 'presliding') for name in section}
    if 'distance' not in values:
        raise InputError('presliding.distance is missing')
    return Presliding(**values)


def _range(values: list[Any]) -> tuple[float, float]:
    if len(values) != 2:
        raise InputError('position_limits must be two positions, the lower one first')
    lowest, highest = (_number({'': value}, '', 'position_limits') for value in values)
    if not (math.isfinite(lowest) and math.isfinite(highest) and lowest < highest):
        raise InputError(f'position_limits must be two positions, the lower one first, '
                         f'not {values!r}')
    return lowest, highest


def _drive(section: dict[str, Any]) -> Drive:
    for name in ('torque_constant', 'gear_ratio'):
        if name not in section:
            raise InputError(f'drive.{name} is missing')
    return Drive(**section)


def _breakaway(document: dict[str, Any]) -> Breakaway | None:
    if document.get('breakaway') is None:
        return None
    section = _section(document, 'breakaway')
    values = {}
    for side in ('positive', 'negative'):
        entry = _section(section, side)
        values[f'{side}_mean'] = _number(entry, 'mean', f'breakaway.{side}')
        values[f'{side}_std'] = _number(entry, 'std', f'breakaway.{side}', 0.0)
        if entry.get('position') is not None:
            values[f'{side}_position'] = _number(entry, 'position', f'breakaway.{side}')
    return Breakaway(**values)


def _effect(entry: dict[str, Any]) -> Effect:
    if not isinstance(entry, dict) or 'name' not in entry:
        raise InputError(f'an effect needs a name: {entry!r}')
    kind = EFFECTS.get(str(entry['name']))
    if kind is None:
        raise InputError(f"unknown effect '{entry['name']}'; known: {', '.join(EFFECTS)}")
    parameters = entry.get('parameters') or {}
    if not isinstance(parameters, dict):
        raise InputError(f"parameters of effect '{entry['name']}' are not a mapping")
    try:
        ranges = entry.get('valid_range')
        return kind(parameters, ranges) if ranges is not None else kind(parameters)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"effect '{entry['name']}': {error}") from None


def _section(document: dict[str, Any], name: str) -> dict[str, Any]:
    return check_mapping(document.get(name), name)


def _list(document: dict[str, Any], name: str) -> list[Any]:
    return check_list(document.get(name) or None, name)


def _number(entry: dict[str, Any], name: str, where: str, default: float | None = None) -> float:
    return check_number(entry.get(name, default), f'{where}.{name}')
