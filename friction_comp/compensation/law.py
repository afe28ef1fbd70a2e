# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The note's friction compensation (section 2.5), as printed and as a passive law."""

from __future__ import annotations

from collections.abc import Callable, Iterable
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from friction_comp.compensation import law_kernel as kernel
from friction_comp.compensation.law_parameters import (
    CONTINUOUS,
    law_parameters,
    LAWS,
    NONE,
    PARAMETERS,
    set_breakaway,
    STATE,
)
from friction_comp.compensation.safety import BAD_TIME, TURN_TIME
from friction_comp.errors import InputError
from friction_comp.model.effect import CARRIES, Effect, LiveTerm
from friction_comp.model.friction_model import FrictionModel

__all__ = ['CompensationLaw', 'GRAVITY', 'law_parameters', 'LAWS']

GRAVITY = ('feed_forward', 'left_to_robot')
_ARM_SIGNALS = {'rigid_body', 'coupling'}


class CompensationLaw:
    """Currents that make geared joints easy to move in a direction known beforehand.

    Call `update` with every sample; `terms` has the parts of the last current, `guards` what
    limited it.

    Parameters
    ----------
    models : list of FrictionModel
        One per joint. Without breakaway currents nothing is applied at rest.
    law, breakaway_gain, current_limit, sample_time
        See `law_parameters`; the limit may be one for all joints or one for each.
    gravity : {'feed_forward', 'left_to_robot'}
        Whether the effects that support the limb's weight are applied, or left to the robot's
        controller.

    Attributes
    ----------
    parameters : ndarray of PARAMETERS, shape (J,)
        What compiled code knows of the joints.
    never_applied : list of (int, str, str)
        Joint, effect and reason for every effect of the models that cannot be applied.
    missing : list of (int, str, tuple of str)
        Joint, effect and missing signals of those that were not applied at the last sample; no
        signals if the effect's value was not finite.
    """

    def __init__(self, models: Iterable[FrictionModel], law: str = 'continuous',
                 breakaway_gain: float = 0.9, current_limit: ArrayLike | None = None,
                 sample_time: float = 1e-3, gravity: str = 'feed_forward') -> None:
        self.models = list(models)
        if not self.models:
            raise InputError('the compensation law needs at least one model')
        if gravity not in GRAVITY:
            raise InputError(f'gravity must be one of {", ".join(GRAVITY)}, not {gravity!r}')
        self._gravity, self._sample_time = gravity, sample_time
        self.joints = len(self.models)
        self.parameters = np.zeros(self.joints, PARAMETERS)
        self._states = np.zeros(self.joints, STATE)
        self._usable = np.zeros(self.joints, dtype=bool)
        self._effects = [EffectCurrents(model, self._why_left_out) for model in self.models]
        self._carried = np.zeros(self.joints)
        self.missing: list[tuple[int, str, tuple[str, ...]]] = []
        self.retune(law, breakaway_gain, current_limit)

    @property
    def terms(self) -> dict[str, np.ndarray]:
        """The parts of the last current, A, (J,): ``friction`` and ``effects`` that carry.

        Their sum is the current unless a limit is reached.
        """
        return {'friction': self._states['friction'].copy(), 'effects': self._carried}

    @property
    def limited(self) -> list[tuple[int, str, str]]:
        """Joint, effects and reason where the limit is below what carries at the last sample."""
        return [(j, ' and '.join(self._effects[j].carrying),
                 f'needs {carried:.3g} A, more than the limit of {limit:.3g} A')
                for j, (carried, limit) in enumerate(zip(self._carried, self.parameters['limit']))
                if abs(carried) > limit]

    @property
    def guards(self) -> dict[str, np.ndarray]:
        """What limits the current, per joint.

        ``share``: of friction that is fed forward; ``taken back``: share of that removed because
        the drive slipped under its preload, or went on beyond the identified speeds; ``samples
        dropped``: number of implausible ones; ``in doubt``: whether these cause zero current;
        ``beyond the end``: whether it has been beyond the announced end of its movement.
        """
        s = self._states
        return {
            'share': self.parameters['share'].copy(),
            'taken back': np.where(s['started'] == 1, 1.0 - s['trust'], 0.0),
            'samples dropped': s['dropped'].astype(int), 'in doubt': s['doubt'] > BAD_TIME,
            'beyond the end': s['beyond'] == 1}

    def update(self, time: float, position: ArrayLike, velocity: ArrayLike | None,
               direction: ArrayLike, temperature: ArrayLike | None = None,
               load: ArrayLike | None = None, end: ArrayLike | None = None,
               is_pushed: ArrayLike | None = None) -> np.ndarray:
        """Return the current for one sample.

        Parameters
        ----------
        time : float
            s, not decreasing; a sample with the time of the last one changes nothing.
        position : array_like, shape (J,)
            rad.
        velocity : array_like, shape (J,), or None
            rad/s; if None, it is computed from position. The continuous law always does so.
        direction : array_like, shape (J,)
            Direction d of the coming movement: -1, 0 or +1; other values count as 0.
        temperature, load : array_like, shape (J,), optional
            Degrees Celsius and N·m, for effects that need them.
        end : array_like, shape (J,), optional
            Position at which the announced movement ends, rad; None or NaN if that is not said.
        is_pushed : array_like of bool, shape (J,), optional
            Whether a sensor feels beyond doubt that a person pushes in this direction.

        Returns
        -------
        ndarray, shape (J,)
            Motor current in A; 0 for a joint whose sample is not finite.
        """
        position = self._row(position, 'position')
        kernel.observe_bank(
            self.parameters, self._states, float(time), position, self._row(velocity, 'velocity'),
            velocity is not None, self._usable)
        direction, end = self._row(direction, 'direction'), self._row(end, 'end')
        pushed = self._row(is_pushed, 'is_pushed')
        warmth, torque = self._row(temperature, 'temperature'), self._row(load, 'load')
        forward, backward, carried = np.zeros((3, self.joints))
        self.missing = []
        for j, effects in enumerate(self._effects):
            if not (effects.terms and self._usable[j]):
                continue
            p, s, model = self.parameters[j], self._states[j], self.models[j]
            if p['law'] == NONE:
                continue
            signals = {'temperature': _known(warmth[j]), 'load': _known(torque[j]),
                       **self._arm_signals(model, position)}
            (forward[j], backward[j], carried[j], *shifts), missing = effects.at(
                float(time), float(s['position']), float(s['speed']), signals,
                bool(p['law'] >= CONTINUOUS))
            self.missing += [(j, *entry) for entry in missing]
            if model.breakaway is not None:
                set_breakaway(p, model.breakaway, shifts)
        current = np.empty(self.joints)
        kernel.decide_bank(self.parameters, self._states, self._usable, direction, end,
                           pushed, forward, backward, carried, current)
        self._carried = carried
        return current

    def reset(self) -> None:
        """Forget the motion, as after a pause."""
        self._states[:] = np.zeros(1, STATE)
        for effects in self._effects:
            effects.reset()
        self.missing, self._carried = [], np.zeros(self.joints)

    def set_model(self, joint: int, model: FrictionModel) -> None:
        """Exchange a joint's model while the law runs.

        The current changes continuously to that of the new model, within a few hundredths of a
        second. What the drive did with the old model tells nothing of the new one, which is trusted
        anew; a joint at rest is led again, so that it shows whether it holds.
        """
        if not 0 <= joint < self.joints:
            raise InputError(f'there is no joint number {joint!r}')
        parameters = law_parameters(model, **self._options[joint])
        self._states[joint]['trust'] = self._states[joint]['trusted'] = 1.0
        if self._states[joint]['mode'] != kernel.FREE:
            self._states[joint]['mode'], self._states[joint]['z'] = kernel.FREE, 0.0
        self.models[joint] = model
        self._effects[joint] = EffectCurrents(model, self._why_left_out)
        self._take([joint], [parameters])

    def retune(self, law: str, breakaway_gain: float,
               current_limit: ArrayLike | None = None) -> None:
        """Change the law's options, as for the class, while it runs; its state is kept.

        The current changes continuously, as with `set_model`, except to a lower limit.
        """
        limits = self._row(math.inf if current_limit is None else current_limit, 'current_limit')
        options: list[dict[str, Any]] = [
            {'law': law, 'breakaway_gain': float(breakaway_gain), 'current_limit': limit,
             'sample_time': self._sample_time} for limit in limits.tolist()]
        parameters = [law_parameters(model, **new) for model, new in zip(self.models, options)]
        self._options = options
        self._take(range(self.joints), parameters)

    def _take(self, joints: Iterable[int], parameters: Iterable[np.ndarray]) -> None:
        for joint, new in zip(joints, parameters):
            self.parameters[joint] = new[0]
            self._states[joint]['blends'] = 2.0 * TURN_TIME * self._states[joint]['started']
        self.missing = []
        self.never_applied = [
            (j, effect.name, self._why_left_out(effect))
            for j, model in enumerate(self.models) for effect in model.effects
            if self._why_left_out(effect)]

    def _arm_signals(self, model: FrictionModel, positions: np.ndarray) -> dict[str, float | None]:
        """Return the arm's torque on a joint at rest, None if other joints are unknown."""
        signals = dict.fromkeys(_ARM_SIGNALS)
        known = {one.joint: position for position, one in zip(positions, self.models)}
        return signals if model.arm is None else {
            **signals, **model.arm.at_rest(known, model.joint)}

    def _why_left_out(self, effect: Effect) -> str:
        if effect.weight and self._gravity == 'left_to_robot':
            return "the limb's weight is left to the robot's controller"
        return effect.not_fed_back

    def _row(self, values: ArrayLike | None, name: str) -> np.ndarray:
        """Return a value for each joint; NaN where there is none."""
        row = np.asarray(math.nan if values is None else values, dtype=float)
        if not row.ndim:
            return np.full(self.joints, row)
        if row.shape != (self.joints,):
            raise InputError(
                f'{name} needs {self.joints} values, one a joint, not shape {row.shape}')
        return row


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


# Effects.

class EffectCurrents:
    """The effects of one joint's model that are applied: `terms`, effects with their live term.

    `why_left_out` returns why an effect is not applied; empty where it is.
    """

    def __init__(self, model: FrictionModel, why_left_out: Callable[[Effect], str]) -> None:
        self.terms = [
            (effect, LiveTerm(effect)) for effect in model.effects if not why_left_out(effect)]
        self.carrying = [effect.name for effect, _ in self.terms if effect.role == CARRIES]
        # Where the positive and negative breakaway currents were measured, rad.
        both = model.breakaway
        places = (both.positive_position, both.negative_position) if both else (None, None)
        self._places = [place for place in places if place is not None and None not in places]

    def reset(self) -> None:
        """Forget the motion."""
        for _, term in self.terms:
            term.reset()

    def at(self, time: float, position: float, speed: float, signals: dict[str, float | None],
           by_direction: bool = True) -> tuple[list[float], list[tuple[str, tuple[str, ...]]]]:
        """Return the currents of the effects, A, and what is left out with the missing signals.

        Currents are friction's in the positive and the negative direction of sliding, what does not
        depend on the direction, and by how much more the magnitudes of the breakaway currents are
        at this position. No signals are missing of an effect whose value is not finite.
        `by_direction`: friction is given for both directions, as the continuous law needs it;
        otherwise for that of the speed, as what does not depend on it.
        """
        currents, missing = [0.0] * 5, []
        for effect, term in self.terms:
            unknown = tuple(name for name in term.needs if signals[name] is None)
            parts = (math.nan, math.nan, math.nan)
            if not unknown and by_direction and effect.role != CARRIES:
                parts = *term.both_sides(time, position, speed, **signals), 0.0
            elif not unknown:
                parts = 0.0, 0.0, term.update(time, position, speed, **signals)
            if not all(map(math.isfinite, parts)):
                missing.append((effect.name, unknown))
                continue
            shifts: list[float] = []
            # Terms with memory, and torques of the whole arm, cannot be evaluated elsewhere.
            if not (term.has_memory or _ARM_SIGNALS & set(term.needs)):
                shifts = [self._shift(effect, term, time, position, place, side, signals)
                          for side, place in enumerate(self._places)]
            for k, part in enumerate((*parts, *shifts)):
                currents[k] += part
        return currents, missing

    @staticmethod
    def _shift(effect: Effect, term: LiveTerm, time: float, position: float, place: float,
               side: int, signals: dict[str, float | None]) -> float:
        """Return by how much more current breaks the joint free here than where it was measured.

        In A, of the positive (0) or negative direction, by magnitude.
        """
        if effect.role == CARRIES:
            # It is applied at rest anyway, so it is removed from the level measured with it.
            value = (2.0 * side - 1.0) * term.update(time, place, 0.0, **signals)
        else:
            # Half of the difference of the sides resists; their mean acted there as well.
            here, there = (0.5 * (forward - backward) for forward, backward in (
                term.both_sides(time, x, 0.0, **signals) for x in (position, place)))
            value = here - there
        return value if math.isfinite(value) else 0.0
