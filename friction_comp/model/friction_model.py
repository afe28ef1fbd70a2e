# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The drive's current as a sum: Eq. 6 and effects."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.files import write_yaml
from friction_comp.model import model_file
from friction_comp.model.differentiation import DEFAULT_SETTINGS, differentiate
from friction_comp.model.effect import Effect
from friction_comp.model.model_file import Breakaway, Presliding, Recorded
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples

if TYPE_CHECKING:
    from friction_comp.model.arm import Arm


@dataclass
class FrictionModel:
    """Sigmoid of Eq. 6, breakaway currents and further effects of one drive.

    Parameters
    ----------
    drive, sigmoid, breakaway, effects, joint, presliding
        The drive, its friction, and the name of its joint.
    position_limits : tuple of float, optional
        Ends of the joint's range in rad, beyond which the compensator does not push.
    uncertainty : float, optional
        Share by which sliding friction may differ from the model's, half of a 95 % interval.
    lookup_table : dict, optional
        ``speeds`` rad/s, ``currents`` and ``standard_deviations`` A, for the sigmoid.
    recorded : Recorded, optional
        Speeds and intervals of the recordings that refinement fitted.
    differentiation : dict
        How refinement derived velocity and acceleration from position; empty otherwise.
    arm : Arm, optional
        The rest of the arm, for effects of other joints.
    simulation, notes : dict
        For the simulated plant only; and the origin of the model.
    """

    drive: Drive
    sigmoid: Sigmoid
    breakaway: Breakaway | None = None
    effects: list[Effect] = field(default_factory=list)
    joint: str = ''
    presliding: Presliding | None = None
    position_limits: tuple[float, float] | None = None
    uncertainty: float | None = None
    lookup_table: dict[str, Any] | None = None
    recorded: Recorded | None = None
    differentiation: dict[str, Any] = field(default_factory=dict)
    arm: Arm | None = None
    simulation: dict[str, Any] = field(default_factory=dict)
    notes: dict[str, Any] = field(default_factory=dict)

    def predict(self, samples: Samples, same_recording: bool = False) -> np.ndarray:
        """Return the motor current in A, shape (N,), that the model expects for recorded samples.

        It is finite for every sample: at standstill the model's value for zero velocity, and zero
        where another signal that an effect needs is not finite. Effects that do not hold in other
        recordings, such as drift over time, are left out.

        Parameters
        ----------
        samples : Samples
            As recorded.
        same_recording : bool
            Whether it is the recording that the model was refined on, or began with the same drift.

        Raises
        ------
        InputError
            If a position is not finite, or an effect needs a signal that was not recorded.
        """
        if not np.isfinite(samples.position).all():
            first = samples.time[np.argmin(np.isfinite(samples.position))]
            raise InputError(f'the position at {first:g} s is not finite')
        model = self if same_recording else self.on_another_day()
        current = model.current(self.differentiated(self.with_arm(samples)))
        return np.nan_to_num(current, nan=0.0, posinf=0.0, neginf=0.0)

    def feed_forward(self, position: ArrayLike, velocity: ArrayLike,
                     acceleration: ArrayLike = 0.0) -> Any:
        """Return the torque at the joint, N·m, that a planned state of motion needs.

        For controllers of position or impedance (MIT mode) that add a torque to their own. At rest
        it is what carries the joint, without friction. Effects of load, temperature and time are
        left out; those with memory are as in steady sliding.

        Parameters
        ----------
        position, velocity, acceleration : float or array_like
            Of one sample, or of independent samples; rad, rad/s, rad/s².

        Raises
        ------
        InputError
            If the model's unit is not a torque and cannot be converted to one, a value is not
            finite, or an effect needs the motion of other joints.

        Examples
        --------
        >>> model = FrictionModel(Drive(1.0, 1.0), Sigmoid(0.5, -0.5, 100.0, viscous=0.2))
        >>> model.feed_forward(0.0, 1.0)
        0.7
        """
        gain = self.torque_per_unit()
        for effect in self.effects:
            if {'rigid_body', 'coupling'} & set(effect.needs):
                raise InputError(f"effect '{effect.name}' needs the motion of the whole arm: "
                                 'predict takes its plan')
        states = np.broadcast_arrays(*(np.asarray(values, dtype=float)
                                       for values in (position, velocity, acceleration)))
        if not np.isfinite(states).all():
            raise InputError('position, velocity and acceleration must be finite')
        q, v, a = (np.ravel(values) for values in states)
        motion = Samples(time=0.0 * q, position=q, current=0.0 * q, velocity=v, acceleration=a)
        torque = gain * self.of_plan()[0].current(motion, sliding=True).reshape(states[0].shape)
        return torque if np.ndim(torque) else float(torque)

    def of_plan(self) -> tuple[FrictionModel, list[str]]:
        """Return the model with the effects that a plan tells, and the names of the others."""
        kept = [effect for effect in self.effects
                if effect.holds_on_another_day
                and set(effect.needs) <= {'acceleration', 'rigid_body', 'coupling'}]
        others = [effect.name for effect in self.effects if effect not in kept]
        return replace(self, effects=kept), others

    def on_another_day(self) -> FrictionModel:
        """Return the model without effects of one recording, such as drift over time."""
        return replace(self, effects=[
            effect for effect in self.effects if effect.holds_on_another_day])

    @property
    def friction_known(self) -> bool:
        """Whether it has friction: the file of a drive that nothing has measured yet has none."""
        return any(self.sigmoid.line) or bool(self.effects)

    @property
    def friction_uncertainty(self) -> float | None:
        """Share by which sliding friction may differ from the model's; None if nothing tells.

        What identification measured, else half of the interval of Coulomb friction of a refinement.
        """
        ends = self.recorded.intervals.get('coulomb') if self.recorded else None
        if self.uncertainty is not None or ends is None:
            return self.uncertainty
        return abs((ends[1] - ends[0]) / (ends[1] + ends[0])) if ends[0] > 0.0 else 1.0

    @property
    def settings(self) -> dict[str, Any]:
        """How velocity and acceleration are derived: as in the fit, else as `DEFAULT_SETTINGS`."""
        return dict(self.differentiation or DEFAULT_SETTINGS)

    def differentiated(self, samples: Samples) -> Samples:
        """Return recorded samples with velocity and acceleration by these settings."""
        return differentiate(samples, self.settings)

    @property
    def is_linear(self) -> bool:
        """Whether the axis is linear: positions are in m and forces in N."""
        return self.unit == 'N' or 'position_unit' in self.notes

    @property
    def unit(self) -> str:
        """The unit of its current: that of the notes, else A, or N·m without constants."""
        default = 'N·m' if self.drive.torque_per_current == 1.0 else 'A'
        return str(self.notes.get('unit') or default)

    @property
    def gain(self) -> float | None:
        """The torque (or force) at the joint of one unit of its current; None if unknown.

        Constants of 1 and 1 mean that nobody gave torque constant and gear ratio.
        """
        gain = self.drive.torque_per_current
        if self.unit in ('N·m', 'N'):
            return 1.0
        return gain if self.unit == 'A' and gain != 1.0 else None

    def torque_per_unit(self) -> float:
        """Return the torque (or force) of one unit of its current; InputError if unknown."""
        if self.gain is None:
            raise InputError(f'its unit is {self.unit}, ' + (
                'and no torque constant and gear ratio are known: refine with --torque-constant '
                "and --gear-ratio, or write them into the model's section drive"
                if self.unit == 'A' else
                'which is no torque, force or current: what belongs to it is no friction of a '
                'joint alone. Refine a recording of the torque or of the current'))
        return self.gain

    def measured(self, samples: Samples) -> np.ndarray:
        """Return the measured current in A, shape (N,), with which `predict` is compared.

        Motor and person overcome friction together: a recorded load's share ``τ_b/(k_t·n)`` is
        added, beyond that in what was fitted, unless an effect of the load torque describes it.
        """
        if samples.load is None or any(effect.is_load for effect in self.effects):
            return samples.current
        load = samples.load - (self.recorded.load if self.recorded else 0.0)
        return samples.current + np.nan_to_num(load) / self.drive.torque_per_current

    def largest_speed(self, default: float) -> float:
        """Return the largest speed, rad/s, identified or recorded; a default if none is known."""
        known = [*(self.lookup_table or {}).get('speeds', ()),
                 *(self.recorded.speeds if self.recorded else ())]
        return max(map(abs, known), default=0.0) or default

    def with_arm(self, samples: Samples) -> Samples:
        """Return recorded samples with the torques of the rest of the arm on the joint."""
        return samples if self.arm is None else self.arm.with_signal(samples, self.joint)

    def current(self, samples: Samples, sliding: bool = False) -> np.ndarray:
        """Return the current in A, shape (N,), for samples with velocity and what effects need.

        If `sliding`, samples do not follow each other, and memory is that of steady sliding.
        """
        current = np.asarray(self.sigmoid(np.asarray(samples.velocity)), dtype=float)
        for effect in self.effects:
            current = current + effect.current(samples, sliding)
        return current

    def to_dict(self) -> dict[str, Any]:
        """Return the model as the plain values of its file."""
        return model_file.document_of(self)

    def save(self, path: Path | str) -> None:
        """Write the model file atomically."""
        write_yaml(path, self.to_dict())

    @classmethod
    def load(cls, path: str | Path, joint: str | None = None) -> FrictionModel:
        """Read a model file; of the file of a whole arm, the model of one joint.

        Raises InputError, which names the file and the reason, if it cannot be used.
        """
        return cls(**model_file.read_model(path, joint))

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> FrictionModel:
        """Make a model from the plain values of its file."""
        return cls(**model_file.arguments_of(document))

    def check_joint(self, joint: str | None, path: str | Path) -> None:
        """Raise InputError if the model of the file `path` is another joint's; no name fits any."""
        if self.joint and joint and self.joint != joint:
            raise InputError(f'{path}: is of joint {self.joint!r}, not {joint!r}')
