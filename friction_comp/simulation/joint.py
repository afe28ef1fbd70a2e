# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated joints with encoder, current sensor, torque sensor S2 and a person.

The plant node, `Plant` in a loop and the parallel runs of `reproduce` all call `joint_sample`.
Records of a joint's parameters, state and measured values are read by compiled code by name;
`joint_parameters` makes the parameters of a model file.

**Level**: ``g(ω) = max(|f̂(ω)|, g0 + (P - g0)·(1 - e)) + (g_b - g0)·e  with  e = exp(-|ω|/ω_s)``
with f̂ of Eq. 6 and its plateau P, the breakaway level g_b, which is drawn again whenever the joint
comes to stick, and ``g0 = min(mean g_b, P)``. The note's sigmoid passes through zero near
standstill, but true friction starts at the breakaway level, and follows the sigmoid with the note's
coefficients (Eq. 11) only beyond the transition.

**The person** is a spring and a damper between reference and joint, with a reaction time. If the
joint has not arrived when the reference movement ends, the person's torque increases until it does.

**The joint**: ``J·dω/dt = k_t·n·i + τ_human + τ_load - F`` with friction of an elastic bristle of
stiffness σ0 and damping σ1, ``F = clamp(σ0·z + σ1·ω, -g, +g)``. Below this level there is no drift,
however long or often the joint is pushed: unlike Dahl's and LuGre's models, it has true stiction
(elasto-plastic friction: Dupont, Hayward, Armstrong and Altpeter, IEEE Trans. Automatic Control
47(5), 2002, with its plastic range shrunk to a point).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
import math
from typing import Any

from numba import njit
import numpy as np
from numpy.typing import ArrayLike

from friction_comp.errors import check_mapping, check_number, InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import kinetic_current
from friction_comp.simulation.undeclared import COLUMNS, Undeclared, undeclared_torque, warmed_up

Record = Any
"""A record of one of the types below."""


def _record(floats: str, integers: str, arrays: dict[str, int]) -> np.dtype[np.void]:
    return np.dtype([(name, float) for name in floats.split()]
                    + [(name, np.int64) for name in integers.split()]
                    + [(name, float, (size,)) for name, size in arrays.items()], align=True)


JOINT = _record(
    # kg·m²; N·m/A; encoder count, rad; A; standard deviation, A.
    'inertia torque_per_current resolution limit current_noise '
    # Friction: Eq. 6, with steepness in s/rad, shift in rad/s and viscous in N·m·s/rad; levels at
    # rest, N·m; Stribeck velocity, rad/s.
    'upper lower steepness shift viscous floor_positive floor_negative break_positive '
    'break_negative std_positive std_negative stribeck_velocity '
    # Presliding, N·m/rad and N·m·s/rad; lag between current and torque, s.
    'bristle_stiffness bristle_damping actuation_lag '
    # The person: N·m/rad, N·m·s/rad, s, s.
    'human_stiffness human_damping human_response human_integral_time',
    '', {'thermal': 4})
"""Parameters of one joint; `thermal` is that of `undeclared.warmed_up`."""

FRICTION = ('upper', 'lower', 'viscous', 'floor_positive', 'floor_negative', 'break_positive',
            'break_negative', 'std_positive', 'std_negative')
"""The parameters to scale for a joint with more or less friction."""

JOINT_STATE = _record(
    # rad and rad/s; of the bristle, rad.
    'position velocity bristle '
    # The breakaway levels of the present rest, N·m; time since the joint began to stick, s;
    # distance slid, rad.
    'level_positive level_negative rest slid '
    # Current, and after the actuation lag, A; the person's torque, and its part that grows while
    # the joint is short of its target, N·m; degrees Celsius; rad as the encoder counts; 1.
    'current late_current human integral_torque temperature counted samples',
    'sliding arrived', {})
"""State of one joint; `start_joint` sets it."""

MEASURED = np.dtype([(name, float) for name in (
    'position', 'velocity', 'current', 'interaction_torque', 'temperature')], align=True)
"""Measured values of one joint: rad, rad/s, A, N·m, degrees Celsius."""


SIMULATION_ENTRIES = {
    'inertia', 'presliding_stiffness', 'presliding_damping', 'stribeck_velocity', 'current_noise',
    'human', 'movement', 'sources'}
HUMAN_ENTRIES = {'stiffness', 'damping', 'response_time', 'integral_time'}

# Of the breakaway torque, rad.
DEFAULT_PRESLIDING = 5e-4
DEFAULT_DAMPING_RATIO = 0.5
DEFAULT_STRIBECK_VELOCITY = math.radians(3.0)


def joint_parameters(model: FrictionModel, undeclared: Undeclared | None = None) -> np.void:
    """Return the parameters of one joint, a record of `JOINT`, from its model.

    They follow from its sigmoid, its breakaway with scatter, and its section `simulation` (see
    msg_docs/README.md). Raises InputError if an entry is unknown, not a number or out of range.
    """
    undeclared = Undeclared() if undeclared is None else undeclared
    section = model.simulation
    check_mapping(section, 'simulation', SIMULATION_ENTRIES)
    p: np.void = np.zeros(1, JOINT)[0]
    scale = model.drive.torque_per_current
    p['torque_per_current'] = scale * undeclared.torque_constant_factor
    p['resolution'] = model.drive.position_resolution or 0.0
    p['limit'] = model.drive.current_limit
    p['current_noise'] = _entry(section, 'current_noise', 2e-3, least=0.0)
    p['actuation_lag'] = undeclared.actuation_lag
    p['thermal'] = undeclared.thermal
    typical = _set_friction(p, model)
    # By default, the breakaway torque accelerates the joint at 10 rad/s².
    inertia = undeclared.inertia + _entry(section, 'inertia', typical / 10.0, least=1e-9)
    p['inertia'] = inertia
    stiffness = p['bristle_stiffness'] = _entry(
        section, 'presliding_stiffness', typical / DEFAULT_PRESLIDING, least=1e-9)
    p['bristle_damping'] = _entry(
        section, 'presliding_damping',
        2.0 * DEFAULT_DAMPING_RATIO * math.sqrt(stiffness * inertia), least=0.0)
    _set_human(p, section, typical, inertia)
    return p


def _set_friction(p: np.void, model: FrictionModel) -> float:
    """Set Eq. 6 and the levels at rest; return the mean of the breakaway levels, N·m."""
    sigmoid, scale = model.sigmoid, model.drive.torque_per_current
    plateaus = np.maximum([sigmoid.upper, -sigmoid.lower], 1e-6) * scale
    if model.breakaway is None:
        levels, scatter = plateaus, np.zeros(2)
    else:
        both = model.breakaway
        levels = np.maximum([both.positive_mean, -both.negative_mean], 1e-6) * scale
        scatter = np.array([both.positive_std, both.negative_std]) * scale
    for name in ('upper', 'lower', 'viscous'):
        p[name] = getattr(sigmoid, name) * scale
    p['steepness'], p['shift'] = sigmoid.steepness, sigmoid.shift
    p['floor_positive'], p['floor_negative'] = np.minimum(levels, plateaus)
    p['break_positive'], p['break_negative'] = levels
    p['std_positive'], p['std_negative'] = scatter
    p['stribeck_velocity'] = _entry(
        model.simulation, 'stribeck_velocity', DEFAULT_STRIBECK_VELOCITY, least=1e-9)
    return float(np.mean(levels))


def _set_human(p: np.void, section: dict[str, Any], typical: float, inertia: float) -> None:
    human = check_mapping(section.get('human') or {}, 'simulation.human', HUMAN_ENTRIES)

    def entry(name: str, default: float) -> float:
        return _entry(human, name, default, 'simulation.human', least=0.0)
    # At a lag of 0.1 rad the person pushes with the breakaway torque.
    p['human_stiffness'] = entry('stiffness', typical / 0.1)
    p['human_damping'] = entry('damping', 2.0 * math.sqrt(p['human_stiffness'] * inertia))
    p['human_response'] = entry('response_time', 0.04)
    # A joint that stops short of its target is pushed twice as hard after this time, s. The note's
    # peaks hardly depend on it (a quarter of it: 1.5 %), but with half of it, a joint with
    # compensated sliding friction overshoots the target.
    p['human_integral_time'] = entry('integral_time', 0.5)


def _entry(section: dict[str, Any], name: str, default: float, where: str = 'simulation',
           **bounds: float) -> float:
    return check_number(section.get(name, default), f'{where}.{name}', **bounds)


# The motion over a sample.

compiled_kinetic_current = njit(cache=True)(kinetic_current)
LEAST_LEVEL = 0.05
"""Smallest friction that undeclared effects may leave, as a share of the declared level."""
ARRIVED = 0.1
"""Largest distance from the end of the reference at which a joint has arrived, rad. In the note,
joints with compensation end at most 0.083 rad short of it, those without it at least 0.18 rad; with
half of this the person would finish movements under the continuous law, too."""
SUBSTEPS = 8
SETTLING = 0.0005
"""Time without slip after which a joint sticks again, s."""


@njit(cache=True)
def low_pass_weight(step: float, time_constant: float) -> float:
    """Return the weight of the input in one step of a first-order low pass; times in s."""
    return 1.0 - math.exp(-step / time_constant) if time_constant > 0.0 else 1.0


@njit(cache=True)
def uniform(random: np.ndarray) -> float:
    """Return the next number in (0, 1) of a splitmix64 sequence, shape (1,) uint64."""
    random[0] += np.uint64(0x9E3779B97F4A7C15)
    z = random[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return (float(z >> np.uint64(11)) + 0.5) / 9007199254740992.0


@njit(cache=True)
def normal(random: np.ndarray) -> float:
    """Return a standard normal number (Box and Muller)."""
    return math.sqrt(-2.0 * math.log(uniform(random))) * math.cos(2.0 * math.pi * uniform(random))


@njit(cache=True)
def draw_levels(p: Record, s: Record, random: np.ndarray) -> None:
    """Draw the breakaway levels that are valid until the joint sticks again."""
    scatter = min(4.0, max(-4.0, normal(random)))
    s.level_positive = max(0.1 * p.break_positive, p.break_positive + p.std_positive * scatter)
    scatter = min(4.0, max(-4.0, normal(random)))
    s.level_negative = max(0.1 * p.break_negative, p.break_negative + p.std_negative * scatter)


@njit(cache=True)
def friction_level(p: Record, s: Record, speed: float, positive: bool) -> float:
    """Return g in N·m at a speed (rad/s, not negative) for one direction of sliding."""
    fade = math.exp(-speed / p.stribeck_velocity)
    if positive:
        sign, plateau, floor, level = 1.0, p.upper, p.floor_positive, s.level_positive
    else:
        sign, plateau, floor, level = -1.0, -p.lower, p.floor_negative, s.level_negative
    kinetic = sign * compiled_kinetic_current(
        sign * speed, p.upper, p.lower, p.steepness, p.shift, p.viscous)
    return max(kinetic, plateau - (plateau - floor) * fade) + (level - floor) * fade


@njit(cache=True)
def follow_reference(p: Record, s: Record, h: float, reaction_weight: float, active: bool,
                     reference_position: float, reference_velocity: float, position: float,
                     velocity: float) -> None:
    """Advance the person's torque `s.human`, N·m, by one substep of h s.

    `reaction_weight` is that of the low pass, `active` whether the person holds the joint.
    """
    if not active:
        s.human = s.integral_torque = 0.0
        return
    lag = reference_position - position
    if reference_velocity != 0.0:
        s.arrived = 0
    elif abs(lag) <= ARRIVED:
        # Remembered, so that the person does not push again if the joint recoils.
        s.arrived = 1
    if reference_velocity != 0.0 or s.arrived == 1 or p.human_integral_time <= 0.0:
        s.integral_torque = 0.0
    else:
        s.integral_torque += p.human_stiffness * lag * h / p.human_integral_time
    wanted = (p.human_stiffness * lag + p.human_damping * (reference_velocity - velocity)
              + s.integral_torque)
    s.human += (wanted - s.human) * reaction_weight


@njit(cache=True)
def clamped_friction(p: Record, s: Record, stuck: float, extra: float, speed: float, h: float
                     ) -> tuple[float, bool]:
    """Return friction in N·m, and whether the bristle slips; `stuck` is its speed if not.

    `speed` determines the level of friction, to which undeclared effects add `extra` N·m.
    """
    force = p.bristle_stiffness * (s.bristle + h * stuck) + p.bristle_damping * stuck
    base = friction_level(p, s, speed, force > 0.0)
    level = max(base + extra, LEAST_LEVEL * base)
    if abs(force) <= level:
        return force, False
    return math.copysign(level, force), True


@njit(cache=True)
def move_bristle(p: Record, s: Record, random: np.ndarray, v: float, friction: float, slips: bool,
                 h: float) -> None:
    """Advance the bristle by a substep of h s at speed v; draw new levels when the joint sticks."""
    s.bristle += h * v
    if not slips:
        s.rest += h
        if s.sliding == 1 and s.rest > SETTLING:
            s.sliding = 0
            s.slid = 0.0
            draw_levels(p, s, random)
        return
    limit = abs(friction) / p.bristle_stiffness
    s.bristle = min(limit, max(-limit, s.bristle))
    s.rest = 0.0
    s.sliding = 1
    s.slid += h * abs(v)
    # Far enough for new breakaway levels.
    if s.slid > 3.0 * limit:
        s.slid = 0.0
        draw_levels(p, s, random)


@njit(cache=True)
def move_joint(p: Record, s: Record, random: np.ndarray, table: np.ndarray, memory: np.ndarray,
               sample_time: float, command: float, reference_position: float,
               reference_velocity: float, active: bool) -> None:
    """Simulate the joint over one sample; parameters as for `joint_sample`."""
    h = sample_time / SUBSTEPS
    # The current follows its command at once; an undeclared lag acts between current and torque.
    s.current = command
    follow = low_pass_weight(h, p.actuation_lag)
    reaction_weight = low_pass_weight(h, p.human_response)
    start = s.samples * sample_time
    sigma0, sigma1, over_inertia = p.bristle_stiffness, p.bristle_damping, h / p.inertia
    implicit = 1.0 / (1.0 + over_inertia * (sigma1 + h * sigma0))
    for k in range(SUBSTEPS):
        s.late_current += (command - s.late_current) * follow
        x, v = s.position, s.velocity
        follow_reference(p, s, h, reaction_weight, active,
                         reference_position + reference_velocity * k * h, reference_velocity, x, v)
        torque = p.torque_per_current * s.late_current + s.human
        # Speed without slip, by an implicit step; its direction determines the level.
        stuck = (v + over_inertia * (torque - sigma0 * s.bristle)) * implicit
        extra = 0.0
        if table.shape[0] > 0 and table[0, 0] >= 0.0:
            base = friction_level(p, s, abs(v), sigma0 * s.bristle + sigma1 * stuck > 0.0)
            load, extra = undeclared_torque(table, memory, start + k * h, x, v, s.human,
                                            s.temperature, s.rest, base)
            torque += load
            stuck = (v + over_inertia * (torque - sigma0 * s.bristle)) * implicit
        friction, slips = clamped_friction(p, s, stuck, extra, abs(v), h)
        v = v + over_inertia * (torque - friction) if slips else stuck
        move_bristle(p, s, random, v, friction, slips, h)
        s.position, s.velocity = x + h * v, v


# Samples, and joints that are stepped.

@njit(cache=True)
def start_joint(p: Record, s: Record, random: np.ndarray) -> None:
    """Set the state to rest at position 0, and draw the first breakaway levels."""
    s.position = s.velocity = s.bristle = s.slid = 0.0
    s.current = s.late_current = s.human = s.integral_torque = s.counted = s.samples = 0.0
    s.rest, s.temperature, s.sliding = 1.0, p.thermal[1], 0
    s.arrived = 0
    draw_levels(p, s, random)


@njit(cache=True)
def measure(p: Record, s: Record, random: np.ndarray, sample_time: float, out: Record) -> None:
    """Write the measured values of the state into the record `out`."""
    counted = s.position
    if p.resolution > 0.0:
        counted = math.floor(s.position / p.resolution + 0.5) * p.resolution
    out.position = counted
    out.velocity = (counted - s.counted) / sample_time
    s.counted = counted
    out.current = s.current
    if p.current_noise > 0.0:
        out.current += p.current_noise * normal(random)
    out.interaction_torque = s.human
    out.temperature = s.temperature


@njit(cache=True)
def joint_sample(p: Record, s: Record, random: np.ndarray, table: np.ndarray, memory: np.ndarray,
                 sample_time: float, command: float, reference_position: float,
                 reference_velocity: float, active: bool, out: Record) -> None:
    """Simulate one joint over one sample, and write the measured values at its end into `out`.

    `p`, `s` and `out` are records of JOINT, JOINT_STATE and MEASURED, `random`, `table` and
    `memory` the run's own. `command`, A, is constant over the sample. If `active`, the person holds
    the joint and sees the reference of the sample's beginning, rad and rad/s.
    """
    move_joint(p, s, random, table, memory, sample_time, limited(p, command), reference_position,
               reference_velocity, active)
    end_sample(p, s, random, sample_time, out)


@njit(cache=True)
def limited(p: Record, command: float) -> float:
    """Return a command in A within the drive's limit; 0 for one that is not finite."""
    return min(p.limit, max(-p.limit, command)) if math.isfinite(command) else 0.0


@njit(cache=True)
def end_sample(p: Record, s: Record, random: np.ndarray, sample_time: float, out: Record) -> None:
    """Update the motor temperature at the end of a sample, and measure."""
    s.temperature = warmed_up(s.temperature, s.current, sample_time, p.thermal)
    s.samples += 1.0
    measure(p, s, random, sample_time, out)


@njit(cache=True)
def bank_sample(p: np.ndarray, s: np.ndarray, random: np.ndarray, tables: np.ndarray,
                memories: np.ndarray, sample_time: float, command: np.ndarray,
                reference_position: np.ndarray, reference_velocity: np.ndarray,
                active: np.ndarray, out: np.ndarray) -> None:
    """Simulate all joints over one sample, a row each; nobody holds one without a reference."""
    for j in range(p.shape[0]):
        held = active[j] and math.isfinite(reference_position[j]) and math.isfinite(
            reference_velocity[j])
        joint_sample(p[j], s[j], random[j], tables[j], memories[j], sample_time, command[j],
                     reference_position[j], reference_velocity[j], held, out[j])


@dataclass(frozen=True)
class PlantState:
    """Measured values of a plant at one instant; arrays of shape (J,)."""

    time: float                     # s since the start
    position: np.ndarray            # rad, in whole encoder counts
    velocity: np.ndarray            # difference of successive positions, rad/s
    current: np.ndarray             # measured motor current, A
    interaction_torque: np.ndarray  # τ_b at sensor S2, N·m, positive: the person pushes forward
    temperature: np.ndarray         # of the motor, degrees Celsius


def random_states(seed: int | Sequence[int], runs: int) -> np.ndarray:
    """Return initial states of `runs` independent random sequences, shape (runs, 1) uint64."""
    return np.random.SeedSequence(seed).generate_state(runs, np.uint64).reshape(runs, 1)


class ReferenceHold:
    """Extrapolates the last reference with its velocity until the next one, or a timeout in s."""

    def __init__(self, timeout: float = 0.5) -> None:
        self.timeout = float(timeout)
        self._reference: tuple[float, np.ndarray, np.ndarray] | None = None

    def update(self, time: float, position: ArrayLike, velocity: ArrayLike) -> None:
        """Set a new reference: s, rad, rad/s; arrays of shape (J,)."""
        self._reference = (float(time), np.array(position, dtype=float),
                           np.array(velocity, dtype=float))

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray] | tuple[None, None]:
        """Return position and velocity of shape (J,) at a time in s, or None and None."""
        if self._reference is None or not time - self._reference[0] <= self.timeout:
            return None, None
        since, position, velocity = self._reference
        return position + velocity * (time - since), velocity


class Plant:
    """Simulated joints that are stepped one sample at a time; a seed gives the same numbers.

    Each joint has a model (see `joint_parameters`) and an `Undeclared` or None.
    """

    def __init__(self, models: Iterable[FrictionModel], seed: int | Sequence[int] = 0,
                 undeclared: Sequence[Undeclared | None] | None = None,
                 sample_time: float = 1e-3) -> None:
        models = list(models)
        if undeclared is None:
            undeclared = [None] * len(models)
        if not models or len(undeclared) != len(models):
            raise InputError('the plant needs one model and one undeclared file or None per joint')
        if not 0.0 < sample_time <= 0.01:
            raise InputError(f'sample_time must be in (0, 0.01] s, not {sample_time!r}')
        self.sample_time = float(sample_time)
        self.joints = len(models)
        extras = [Undeclared() if extra is None else extra for extra in undeclared]
        self._random = random_states(seed, self.joints)
        self._parameters = np.array(
            [joint_parameters(model, extra) for model, extra in zip(models, extras)])
        self._tables = np.full((self.joints, max(len(e.table) for e in extras), COLUMNS), -1.0)
        for table, extra in zip(self._tables, extras):
            table[:len(extra.table)] = extra.table
        self._memories = np.zeros((self.joints, max(1, max(e.memory_size for e in extras))))
        self._states = np.zeros(self.joints, JOINT_STATE)
        self._out = np.zeros(self.joints, MEASURED)
        # Views and constants that are created once: each would take as long as a step, about 1 µs.
        self._samples = self._states['samples']
        self._shown = self._out.view(float).reshape(self.joints, -1).T
        self._zeros, self._nobody = np.zeros(self.joints), np.zeros(self.joints, dtype=bool)
        self._everybody = ~self._nobody
        for p, s, random, out in zip(self._parameters, self._states, self._random, self._out):
            start_joint(p, s, random)
            measure(p, s, random, self.sample_time, out)
        # Compile the step, or load it from the cache, before the first call.
        none = np.zeros(0)
        bank_sample(self._parameters[:0], self._states[:0], self._random[:0], self._tables[:0],
                    self._memories[:0], self.sample_time, none, none, none, none.astype(bool),
                    self._out[:0])
        self.state = self._measured()

    def step(self, command: ArrayLike, reference_position: ArrayLike | None = None,
             reference_velocity: ArrayLike | None = None,
             human_active: ArrayLike | None = None) -> PlantState:
        """Apply a constant current over one sample and return the measured values at its end.

        All arrays have the shape (J,). Currents in A that are not finite count as 0, others are
        clipped to the limit. The person follows the reference, rad and rad/s at the present time,
        on the joints where `human_active`, by default all that have one.
        """
        if human_active is None:
            active = self._nobody if reference_position is None else self._everybody
        else:
            active = self._row(human_active, bool)
        position = self._zeros if reference_position is None else self._row(reference_position)
        velocity = self._zeros if reference_velocity is None else self._row(reference_velocity)
        self._advance(self._row(command), position, velocity, active)
        self.state = self._measured()
        return self.state

    def _advance(self, command: np.ndarray, position: np.ndarray, velocity: np.ndarray,
                 active: np.ndarray) -> None:
        """Simulate all joints over one sample; each array has shape (J,)."""
        bank_sample(
            self._parameters, self._states, self._random, self._tables, self._memories,
            self.sample_time, command, position, velocity, active, self._out)

    def _row(self, values: ArrayLike, kind: type = float) -> np.ndarray:
        # Broadcasting takes longer than a step: arrays with one value per joint do without it.
        row: np.ndarray = np.asarray(values, dtype=kind, order='C')
        if row.shape == (self.joints,):
            return row
        if row.ndim:
            raise InputError(f'expected {self.joints} values, one per joint, not shape {row.shape}')
        return np.full(self.joints, row)

    def _measured(self) -> PlantState:
        # `MEASURED` has the names and the order of `PlantState`'s arrays.
        return PlantState(float(self._samples[0]) * self.sample_time, *self._shown.copy())
