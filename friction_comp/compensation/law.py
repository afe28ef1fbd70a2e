# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The note's friction compensation (section 2.5), as printed and without its gap at breakaway."""

from __future__ import annotations

import math

import numpy as np

from friction_comp.compensation import law_columns as columns, law_kernel as kernel
from friction_comp.compensation.rest_level import level_shifts, places_of, sliding_friction
from friction_comp.errors import InputError

LAWS = {'none': columns.NONE, 'kinetic': columns.KINETIC, 'paper': columns.PAPER,
        'continuous': columns.CONTINUOUS}

GRAVITY = ('feed_forward', 'left_to_robot')
# rad; where the encoder is unknown.
DEFAULT_RESOLUTION = 1e-5
# What the continuous law needs beyond the model. One encoder count a millisecond is 0.9 deg/s at
# a gear ratio of 100: the velocity is smoothed over a few milliseconds before it enters.
FILTER_TIME = 0.004
RISE_TIME = 0.2
STEEPEST = 2.0
BACK_SPEED = math.radians(3.0)
# The gain covers an error in the mean breakaway current; its scatter from one rest to the next
# comes on top: where the level cannot be probed it stays this many standard deviations lower.
SCATTER_MARGIN = 4.0
# Share of a push's deflection that the law answers; 1 would be unstable.
ASSIST = 0.8
# Below this speed the level follows what is known of the place, rad/s.
SLOW = 0.05
# A joint that goes farther while the level rises is not sticking, rad.
FARTHEST = math.radians(2.0)


def law_parameters(model, law='continuous', breakaway_gain=0.9, current_limit=None,
                   sample_time=1e-3):
    """Return the kernel's parameters of one joint.

    Parameters
    ----------
    model : FrictionModel
    law : {'continuous', 'paper', 'kinetic', 'none'}
        The last two never apply the breakaway term, or no current at all: the note's case 1, and
        the bare drive.
    breakaway_gain : float
        Share of the mean breakaway current that is applied; 0.9 in the note.
    current_limit : float, optional
        A; the drive's own when omitted or larger.
    sample_time : float
        Expected s between samples, used for the first one.

    Returns
    -------
    ndarray, shape (law_columns.PARAMETERS,)

    Raises
    ------
    InputError
        If an argument is out of range.
    """
    if law not in LAWS:
        raise InputError(f'law must be one of {", ".join(LAWS)}, not {law!r}')
    if not (math.isfinite(breakaway_gain) and 0.0 <= breakaway_gain <= 2.0):
        raise InputError(f'breakaway_gain must be between 0 and 2, not {breakaway_gain!r}')
    limit = model.drive.current_limit
    if current_limit is not None:
        if not (math.isfinite(current_limit) and current_limit >= 0.0):
            raise InputError(f'current_limit must not be negative, not {current_limit!r}')
        limit = min(limit, float(current_limit))
    if not (math.isfinite(sample_time) and sample_time > 0.0):
        raise InputError(f'sample_time must be positive, not {sample_time!r}')
    p = np.zeros(columns.PARAMETERS)
    p[columns.LAW] = LAWS[law]
    sigmoid = model.sigmoid
    p[columns.UPPER], p[columns.LOWER] = sigmoid.upper, sigmoid.lower
    p[columns.STEEPNESS], p[columns.SHIFT] = sigmoid.steepness, sigmoid.shift
    p[columns.VISCOUS] = sigmoid.viscous
    if model.breakaway is not None:
        set_levels(p, model.breakaway, breakaway_gain)
    p[columns.LIMIT] = limit
    p[columns.SAMPLE_TIME] = sample_time
    p[columns.FILTER_TIME] = FILTER_TIME
    p[columns.RISE_TIME] = RISE_TIME
    p[columns.BACK_SPEED] = BACK_SPEED
    p[columns.ASSIST], p[columns.FARTHEST] = ASSIST, FARTHEST
    p[columns.RESOLUTION] = model.drive.position_resolution or DEFAULT_RESOLUTION
    if law == 'continuous':
        # No steeper than the encoder can tell speeds apart within one sample: the current would
        # jump from count to count.
        count_speed = p[columns.RESOLUTION] / sample_time
        p[columns.STEEPNESS] = min(sigmoid.steepness, STEEPEST / count_speed)
    return p


def set_levels(p, breakaway, gain, shifts=(0.0, 0.0), sliding=None):
    """Set the breakaway levels in a joint's parameters.

    Parameters
    ----------
    p : ndarray, shape (law_columns.PARAMETERS,)
        Changed in place.
    breakaway : Breakaway
    gain : float
        Share of the mean breakaway current that is applied.
    shifts : tuple of float
        What to add to the magnitudes of the positive and negative mean, A.
    sliding : tuple of float, optional
        What effects add to the sigmoid's sliding friction here and now, A. A push may earn as
        much as sliding takes, where that is more than the breakaway current.
    """
    plateaus = (0.0, 0.0)
    if sliding is not None:
        plateaus = p[columns.UPPER] + sliding[0], -p[columns.LOWER] + sliding[1]
    for level, safe, most, mean, std, plateau in (
            (columns.BREAK_POSITIVE, columns.SAFE_POSITIVE, columns.MOST_POSITIVE,
             breakaway.positive_mean + shifts[0], breakaway.positive_std, plateaus[0]),
            (columns.BREAK_NEGATIVE, columns.SAFE_NEGATIVE, columns.MOST_NEGATIVE,
             -breakaway.negative_mean + shifts[1], breakaway.negative_std, plateaus[1])):
        mean = max(0.0, mean)
        p[level] = gain * mean
        p[safe] = max(0.0, gain * mean - SCATTER_MARGIN * std)
        p[most] = max(p[level], mean, plateau)


class CompensationLaw:
    """Current that makes geared joints easy to move in a direction known beforehand.

    Call `update` with every sample; the terms of the last one are open to inspection in `terms`.

    Parameters
    ----------
    models : list of FrictionModel
        One per joint. Without breakaway currents only the kinetic term is applied.
    law : {'continuous', 'paper', 'kinetic', 'none'}
        See `law_parameters`.
    breakaway_gain : float
        Share of the mean breakaway current.
    current_limit : float or array_like of shape (J,), optional
        A.
    sample_time : float
        s.
    gravity : {'feed_forward', 'left_to_robot'}
        Whether effects that hold the limb up are applied, or left to the robot's own controller.

    Attributes
    ----------
    terms : dict of str to ndarray, shape (J,)
        ``kinetic``, ``breakaway`` and ``effects`` of the last sample in A.
    never_applied : list of (int, str, str)
        Joint, effect and reason for every effect of the models that cannot be fed back.
    missing : list of (int, str, tuple of str)
        Joint, effect and unknown signals for every effect that the last sample could not feed
        back; without signals where its value was not finite.
    left_out : list of (int, str, str)
        Joint, effect and reason: both of them.

    Raises
    ------
    InputError
        If an argument is out of range.
    """

    def __init__(self, models, law='continuous', breakaway_gain=0.9, current_limit=None,
                 sample_time=1e-3, gravity='feed_forward'):
        self.models = list(models)
        if not self.models:
            raise InputError('the compensation law needs at least one model')
        if gravity not in GRAVITY:
            raise InputError(f'gravity must be one of {", ".join(GRAVITY)}, not {gravity!r}')
        self._gravity = gravity
        self.joints = len(self.models)
        limits = [None] * self.joints
        if current_limit is not None:
            limits = np.broadcast_to(np.asarray(current_limit, dtype=float), self.joints)
        self._options = [
            {'law': law, 'breakaway_gain': float(breakaway_gain), 'sample_time': sample_time,
             'current_limit': None if limit is None else float(limit)} for limit in limits]
        self._parameters = np.array([
            law_parameters(model, **options)
            for model, options in zip(self.models, self._options)])
        self._states = np.zeros((self.joints, columns.STATES))
        self._usable = np.zeros(self.joints, dtype=bool)
        self._effects = [self._live_terms(model) for model in self.models]
        self._places = [places_of(*pair) for pair in zip(self.models, self._effects)]
        self._missing = [None] * self.joints
        self._collect_never_applied()
        self._clear_terms()

    @property
    def missing(self):
        """Effects that the last sample could not feed back."""
        return [(j, *entry) for j, entries in enumerate(self._missing) for entry in entries or ()]

    @property
    def left_out(self):
        """All effects that are not applied, with the reasons."""
        return self.never_applied + [
            (j, name, f'{" and ".join(signals)} unknown' if signals else 'value is not finite')
            for j, name, signals in self.missing]

    def update(self, time, position, velocity, direction, temperature=None, load=None):
        """Return the current for one sample.

        Parameters
        ----------
        time : float
            s, not decreasing.
        position : array_like, shape (J,)
            rad.
        velocity : array_like, shape (J,), or None
            rad/s; None has the position differentiated.
        direction : array_like, shape (J,)
            d of the coming movement: -1, 0 or +1. Anything else counts as 0.
        temperature, load : array_like, shape (J,), optional
            Degrees Celsius and N·m, for effects that need them.

        Returns
        -------
        ndarray, shape (J,)
            Motor current in A; 0 for a joint whose sample is not finite.
        """
        position = self._row(position, 'position')
        known = velocity is not None
        velocity = self._row(velocity if known else 0.0, 'velocity')
        direction = self._row(direction, 'direction')
        kernel.observe_bank(self._parameters, self._states, float(time), position, velocity,
                            known, self._usable)
        effects, friction = np.zeros(self.joints), np.zeros(self.joints)
        for j, terms in enumerate(self._effects):
            if terms and self._usable[j] and self._parameters[j, columns.LAW] != columns.NONE:
                effects[j], friction[j] = self._apply(
                    terms, j, time, position,
                    {'temperature': _entry(temperature, j), 'load': _entry(load, j)})
        current = np.empty(self.joints)
        kernel.decide_bank(self._parameters, self._states, self._usable, direction, effects,
                           friction, current)
        self.terms = {
            'kinetic': self._states[:, columns.KINETIC_TERM].copy(),
            'breakaway': self._states[:, columns.BREAKAWAY_TERM].copy(),
            'effects': effects}
        return current

    def reset(self):
        """Forget all history, as after a pause."""
        self._states[:] = 0.0
        self._effects = [self._live_terms(model) for model in self.models]
        self._missing = [None] * self.joints
        self._clear_terms()

    def set_model(self, joint, model):
        """Exchange a joint's model while the law runs.

        The current does not jump: the difference between the old and the new model's current
        fades within a few 0.05 s.

        Parameters
        ----------
        joint : int
        model : FrictionModel
        """
        if not 0 <= joint < self.joints:
            raise InputError(f'there is no joint number {joint!r}')
        parameters = law_parameters(model, **self._options[joint])
        effects = self._live_terms(model)
        self.models[joint] = model
        self._parameters[joint] = parameters
        self._effects[joint] = effects
        self._places[joint] = places_of(model, effects)
        self._states[joint, columns.CHANGED] = self._states[joint, columns.STARTED]
        self._missing[joint] = None
        self._collect_never_applied()

    def retune(self, law, breakaway_gain, current_limit=None):
        """Exchange what the law was made with while it runs; history and probe go on.

        The current does not jump but to a lower limit, as with `set_model`.

        Parameters
        ----------
        law, breakaway_gain, current_limit
            As for the class.
        """
        limits = [None] * self.joints
        if current_limit is not None:
            limits = np.broadcast_to(np.asarray(current_limit, dtype=float), self.joints)
        options = [{**old, 'law': law, 'breakaway_gain': float(breakaway_gain),
                    'current_limit': None if limit is None else float(limit)}
                   for old, limit in zip(self._options, limits)]
        for model, new in zip(self.models, options):
            law_parameters(model, **new)
        self._options = options
        for joint, model in enumerate(self.models):
            self.set_model(joint, model)

    def _apply(self, terms, joint, time, positions, signals):
        """Return the sum of the joint's effects, and of those that are friction, in A."""
        position = positions[joint]
        signals.update(self._of_arm(joint, positions))
        speed = float(self._states[joint, columns.SPEED])
        total = friction = 0.0
        missing = []
        for effect, term in terms:
            unknown = tuple(name for name in term.needs if signals[name] is None)
            value = math.nan if unknown else float(
                term.update(float(time), float(position), speed, **signals))
            if not math.isfinite(value):
                missing.append((effect.name, unknown))
                continue
            total += value
            if effect.variable in ('velocity', 'direction'):
                friction += value
        if missing != self._missing[joint]:
            # An effect that comes or goes does so without a jump, as a new model does.
            if self._missing[joint] is not None:
                self._states[joint, columns.CHANGED] = self._states[joint, columns.STARTED]
            self._missing[joint] = missing
        # While the joint moves the level has no say.
        if self.models[joint].breakaway is not None and abs(speed) < SLOW:
            here = terms, float(time), float(position), signals
            shifts = (0.0, 0.0)
            if self._places[joint]:
                shifts = level_shifts(terms, self._places[joint], *here[1:])
            set_levels(self._parameters[joint], self.models[joint].breakaway,
                       self._options[joint]['breakaway_gain'], shifts, sliding_friction(*here))
        return total, friction

    def _of_arm(self, joint, positions):
        """Return what the arm asks of a joint at rest, None where other joints are not known."""
        signals = {'rigid_body': None, 'coupling': None}
        arm = self.models[joint].arm
        if arm is None:
            return signals
        known = {model.joint: place for place, model in zip(positions, self.models)}
        if all(name in known for name in arm.joints):
            value = arm.at_rest([known[name] for name in arm.joints], self.models[joint].joint)
            signals['coupling' if arm.tree is None else 'rigid_body'] = value
        return signals

    def _why_left_out(self, effect):
        if effect.weight and self._gravity == 'left_to_robot':
            return "holding the limb is left to the robot's own controller"
        return effect.why_left_out()

    def _live_terms(self, model):
        pairs = [(effect, effect.live()) for effect in model.effects
                 if not self._why_left_out(effect)]
        return [(effect, term) for effect, term in pairs if term is not None]

    def _collect_never_applied(self):
        self.never_applied = [
            (j, effect.name, self._why_left_out(effect))
            for j, model in enumerate(self.models) for effect in model.effects
            if self._why_left_out(effect)]

    def _clear_terms(self):
        self.terms = {
            name: np.zeros(self.joints) for name in ('kinetic', 'breakaway', 'effects')}

    def _row(self, values, name):
        row = np.asarray(values, dtype=float)
        if row.ndim and row.shape != (self.joints,):
            raise InputError(
                f'{name} needs {self.joints} values, one a joint, not shape {row.shape}')
        return np.broadcast_to(row, self.joints).astype(float)


def _entry(values, joint):
    """Return one joint's finite value of an optional signal, else None."""
    if values is None:
        return None
    value = float(np.broadcast_to(np.asarray(values, dtype=float), joint + 1)[joint]
                  if np.ndim(values) == 0 else np.asarray(values, dtype=float)[joint])
    return value if math.isfinite(value) else None
