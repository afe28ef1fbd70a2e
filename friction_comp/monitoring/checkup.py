# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the doctor says of a system that was observed for some seconds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from friction_comp.errors import InputError
from friction_comp.facts import current, motion
from friction_comp.facts.recorded import rhythm
from friction_comp.messages import TOPICS
from friction_comp.model.friction_model import FrictionModel

OK, NOTE, WARNING, PROBLEM = 'ok', 'note', 'warning', 'problem'
_LEVELS = {1: WARNING, 2: PROBLEM, 3: PROBLEM}    # of diagnostics
# Joint state rate below which friction cannot be fed forward well, Hz; and age in s of a state that
# shows that clocks differ, also the default of joint_state_timeout.
_SLOW, _OLD = 200.0, 0.05


class Finding(NamedTuple):
    """Result of one check: level, subject, observation, and advice, if any."""

    level: str
    about: str
    what: str
    do: str = ''


class Endpoint(NamedTuple):
    """A publisher or subscription, with its message type and whether it is reliable."""

    node: str
    kind: str
    reliable: bool = True


@dataclass
class Observation:
    """A running system, observed for some seconds."""

    seconds: float
    nodes: list[str] = field(default_factory=list)    # full names
    # Publishers and subscriptions by full name of a topic, and the full names of the package's.
    topics: dict[str, tuple[list[Endpoint], list[Endpoint]]] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    # By joint, rows of arrival, stamp (s), position, velocity, effort; NaN where there is no value.
    states: dict[str, np.ndarray] = field(default_factory=dict)
    # Rows of arrival and a value for each joint of a node, in N·m or else in A.
    commands: np.ndarray = field(default_factory=lambda: np.empty((0, 1)))
    in_torque: bool = False
    # By node, if it answers; then the last level and message by status name; whether /clock ticks.
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    diagnostics: dict[str, tuple[int, str]] = field(default_factory=dict)
    clock: bool = False

    def ends(self, name: str) -> tuple[list[Endpoint], list[Endpoint]]:
        """Return publishers and subscriptions of a topic of the package."""
        return self.topics.get(self.names.get(name, name), ([], []))


def check_system(seen: Observation) -> Iterator[Finding]:
    """Yield the findings about a running system."""
    if not seen.nodes:
        yield Finding(NOTE, 'discovery', f'no node was found within {seen.seconds:g} s',
                      'start one, or compare ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE and '
                      'RMW_IMPLEMENTATION of both sides; UDP multicast must pass the firewall')
        return
    yield Finding(OK, 'discovery', f'{len(seen.nodes)} nodes: {", ".join(seen.nodes)}')
    for check in (_connections, _states, _currents):
        yield from check(seen)
    for name, (level, message) in seen.diagnostics.items():
        if level in _LEVELS:
            yield Finding(_LEVELS[level], name, message, 'see its log; a latched fault is cleared '
                          f'by /{name.partition(":")[0]}/reset_faults')


def _names(ends: list[Endpoint]) -> str:
    return ', '.join(sorted({end.node for end in ends}))


def _connections(seen: Observation) -> Iterator[Finding]:
    for name, (publishers, subscribers) in seen.topics.items():
        for publisher, subscriber in ((p, s) for s in subscribers for p in publishers):
            if publisher.kind != subscriber.kind or subscriber.reliable > publisher.reliable:
                forms = [end.kind + ', reliable' * end.reliable for end in (publisher, subscriber)]
                yield Finding(PROBLEM, 'QoS', f'{publisher.node} publishes {name} as {forms[0]}; '
                              f'{subscriber.node} reads it as {forms[1]}: nothing arrives',
                              'use one type; publish reliably, or set input_reliability')
    for name in ('joint_states', 'direction', 'current_command'):
        publishers, subscribers = seen.ends(name)
        others = [topic for topic, (ends, _) in seen.topics.items()
                  if any(end.kind == TOPICS[name] for end in ends)]
        if len(publishers) > 1:
            yield Finding(WARNING, name, f'several nodes publish it: {_names(publishers)}',
                          'let one of them publish')
        elif bool(publishers) != bool(subscribers) and not (
                name == 'direction' and seen.ends('direction_stamped')[0]):
            lonely, what = (publishers, 'reads') if publishers else (subscribers, 'publishes')
            yield Finding(
                PROBLEM if publishers and name == 'current_command' else NOTE, name,
                f'nobody {what} {seen.names.get(name, name)} of {_names(lonely)}'
                + f'; {", ".join(others)} has that type' * bool(others and not publishers),
                f'start who does, or remap: -r {name}:=/its/name')
    for end in seen.ends('current_command')[1]:
        if not any('command_timeout' in name for name in seen.parameters.get(end.node, ())) and (
                not any(word in end.node for word in ('recorder', 'refinement'))):
            yield Finding(NOTE, 'driver', f'{end.node} has no parameter for a command timeout',
                          'make sure that it switches to zero current by itself: kill the '
                          'compensator with SIGKILL in a safe setting and watch the current')


def _states(seen: Observation) -> Iterator[Finding]:
    if not seen.states and seen.ends('joint_states')[0]:
        yield Finding(PROBLEM, 'joint_states', 'published, but nothing arrives', 'look at its type')
    for joint, rows in seen.states.items():
        rate, _, longest, _ = rhythm(rows[:, 0])
        text = f'{rate:.4g} Hz, longest gap {1e3 * longest:.3g} ms'
        timeout = next((float(values['joint_state_timeout']) for node, values in
                        seen.parameters.items() if 'compensator' in node), _OLD)
        if longest > timeout:
            yield Finding(PROBLEM, joint, f'{text}: longer than joint_state_timeout, the current '
                          'was zero meanwhile', 'give the driver real-time priority')
        else:
            yield Finding(WARNING if rate < _SLOW else OK, joint, text,
                          f'publish {_SLOW:g} states a second or more' * (rate < _SLOW))
        late = float(np.median(rows[:, 0] - rows[:, 1]))
        if (np.diff(rows[:, 1]) < 0.0).any() or (abs(late) > _OLD and not seen.clock):
            yield Finding(PROBLEM, 'clocks', f'states of {joint} are {late:.3g} s old when they '
                          'arrive, or their stamps go backwards or are zero',
                          'synchronise the clocks of both machines, or set use_sim_time alike')
        yield from _values(joint, rows)


def _values(joint: str, rows: np.ndarray) -> Iterator[Finding]:
    position, velocity, effort = rows[:, 2:].T
    for name, values in (('position', position), ('effort', effort)):
        if (missing := ~np.isfinite(values)).any():
            yield Finding(PROBLEM, joint, f'{missing.sum()} of {len(rows)} states have no {name}',
                          'let the driver report it: effort is k_t · n · current, in N·m')
    agreement = motion.velocity_agreement(rows[:, 1], position, velocity)
    if agreement.fault:
        yield Finding(PROBLEM, joint, agreement.fault, 'let the driver give both in rad and rad/s '
                      'at the joint, with one sign; velocity may be left empty')
    elif np.isfinite(velocity).any() and agreement.blocks < motion.FEWEST_BLOCKS:
        yield Finding(NOTE, joint, 'it hardly moved: signs and units could not be checked',
                      'run doctor again while it is moved')
    if wrong := motion.not_in_radians(position, float(np.ptp(rows[:, 1]))):
        yield Finding(WARNING, joint, f'position {wrong}', 'let the driver give it in rad')


def _currents(seen: Observation) -> Iterator[Finding]:
    """Compare measured and commanded currents of nodes whose models are on this machine."""
    in_ampere = any(one.get('effort_holds') == 'current' for one in seen.parameters.values())
    for values in seen.parameters.values():
        joints, files = list(values.get('joints') or ()), list(values.get('model_files') or ())
        for k, (joint, path) in enumerate(zip(joints, files)):
            rows = seen.states.get(joint)
            if rows is None or seen.commands.shape != (len(seen.commands), 1 + len(joints)):
                continue
            try:
                drive = FrictionModel.load(path, joint).drive
            except InputError as error:
                yield Finding(NOTE, joint, str(error), 'look whether the file is here, too')
                continue
            torque = drive.torque_per_current
            command = np.interp(rows[:, 0], seen.commands[:, 0], seen.commands[:, 1 + k]) / (
                torque if seen.in_torque else 1.0)
            measured = rows[:, 4] / (1.0 if in_ampere else torque)
            known = np.isfinite(measured)
            # Smaller commands are below the measurement noise.
            if np.mean(command ** 2) > (0.01 * drive.current_limit) ** 2 and known.any():
                gain, _ = current.current_answer(command[known], measured[known])
                fault = current.gain_fault(gain, drive)
                yield Finding(PROBLEM, joint, f'the measured current is {gain:.3g} times the '
                              f'commanded one: {fault}', 'stop compensating; a positive current '
                              'must push towards larger positions') if fault else Finding(
                    OK, joint, 'the measured current follows the commanded one')
