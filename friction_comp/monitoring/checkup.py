# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Checks a running system: connections, rates, clocks, values, and the models of its joints."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from friction_comp.facts import current, motion
from friction_comp.facts.resolution import encoder_fault
from friction_comp.facts.timing import rhythm
from friction_comp.model.friction_model import FrictionModel
from friction_comp.monitoring.live_residual import LiveResidual
from friction_comp.monitoring.network import NO_PEER
from friction_comp.monitoring.observation import (
    Endpoint,
    Finding,
    NOTE,
    Observation,
    OK,
    PROBLEM,
    StatesSeen,
    WARNING,
)
from friction_comp.samples import beyond, LIMITS
from friction_comp.topics import TOPICS

_LEVELS = {1: WARNING, 2: PROBLEM, 3: PROBLEM}
# The compensator's defaults, s.
_STATE_TIMEOUT, _DIRECTION_TIMEOUT = 0.05, 0.5
# Joint state rate below which friction cannot be fed forward well, Hz.
_SLOW = 200.0
# Nodes that subscribe to commands without driving a motor.
_OBSERVERS = ('recorder', 'refinement', 'doctor')
# Fewest samples in motion, and of each direction in a part of the range of position.
_FEWEST_SAMPLES, _PER_BIN = 50, 5
# Commands below this share of the drive's limit are smaller than the measurement noise.
_SMALL = 0.01
# Correlation below which measured and commanded current are unrelated.
_LEAST_CORRELATION = 0.5


def check_system(seen: Observation) -> list[Finding]:
    """Return the findings about a running system."""
    if not seen.nodes:
        return [Finding(NOTE, 'discovery', f'no node was found within {seen.seconds:g} s',
                        f'start one, or {NO_PEER}')]
    findings = [Finding(OK, 'discovery', f'{len(seen.nodes)} nodes: {", ".join(seen.nodes)}')]
    for check in (_quality, _states, _commands, _driver, _direction, _clocks, _diagnostics):
        findings += check(seen)
    return findings


def _quality(seen: Observation) -> Iterator[Finding]:
    for name, publisher, subscriber in (
            (name, publisher, subscriber) for name, topic in seen.topics.items()
            for subscriber in topic.subscribers for publisher in topic.publishers):
        what = ''
        if publisher.kind and subscriber.kind and publisher.kind != subscriber.kind:
            yield Finding(
                PROBLEM, 'types', f'{subscriber.node} reads {name} as {subscriber.kind}, but '
                f'{publisher.node} publishes {publisher.kind}: nothing arrives',
                'publish the type that is read')
        elif subscriber.reliable and not publisher.reliable:
            what = 'reliable, but it is published best effort'
        elif subscriber.lasting and not publisher.lasting:
            what = 'transient local, but it is published volatile'
        if what:
            yield Finding(
                PROBLEM, 'QoS', f'{subscriber.node} requests {name} {what} by {publisher.node}: '
                'nothing arrives', 'set input_reliability:=best_effort there, or publish reliably')


def _states(seen: Observation) -> Iterator[Finding]:
    topic, states = seen.topic('joint_states'), seen.states
    if len(topic.publishers) > 1:
        yield Finding(WARNING, 'joint_states', f'{len(topic.publishers)} publishers: '
                      + _names(topic.publishers),
                      'let one publish, or make sure that each publishes different joints')
    if states is None or len(states.received) < 2:
        level, what = (PROBLEM, 'published, but nothing arrives') if topic.publishers else (
            WARNING, _describe_missing(seen, 'joint_states'))
        yield Finding(level, 'joint_states', what,
                      'start the driver, or remap: -r joint_states:=/its/name')
        return
    if states.twice:
        yield Finding(PROBLEM, 'joint_states', f'{", ".join(states.twice)} is named twice',
                      'let the driver name each joint once: its value is ambiguous')
    yield _rate(seen, states)
    yield from _stamps(states, seen.clock)
    for joint in states.joints:
        yield from _values(states.of_joint(joint), joint)


def _names(ends: Iterable[Endpoint]) -> str:
    return ', '.join(end.node for end in ends)


def _describe_missing(seen: Observation, name: str) -> str:
    full_name = seen.names.get(name, name)
    others = [topic for topic, topic_seen in seen.topics.items()
              if TOPICS[name] in topic_seen.types and topic != full_name]
    return f'nobody publishes {full_name}' + (
        f'; {", ".join(others)} has that type' if others else '')


def _rate(seen: Observation, states: StatesSeen) -> Finding:
    rate, _, worst, _ = rhythm(states.received)
    text = f'{rate:.4g} Hz, longest gap {1e3 * worst:.3g} ms'
    timeout = _parameter(seen, 'joint_state_timeout', _STATE_TIMEOUT)
    if worst > timeout:
        return Finding(PROBLEM, 'rate', f'{text}; joint_state_timeout is {1e3 * timeout:g} ms, so '
                       'the current was zero meanwhile', 'find out what delayed the driver, '
                       'give it real-time priority, or raise joint_state_timeout')
    if rate < _SLOW:
        return Finding(WARNING, 'rate', text, f'let the driver publish at {_SLOW:g} Hz or more: '
                       'breakaway lasts some milliseconds, and identification needs a rate and a '
                       'delay that docs/identification.md states')
    return Finding(OK, 'rate', text)


def _stamps(states: StatesSeen, ticking: bool) -> Iterator[Finding]:
    late = float(np.median(states.received - states.stamp))
    if not states.stamp.any():
        yield Finding(WARNING, 'clocks', 'joint_states have no stamp, so receive times are used',
                      'let the driver stamp its measurements')
    elif any((np.diff(states.stamp[named]) < 0).any() for named in states.named.T):
        yield Finding(PROBLEM, 'clocks', 'stamps of joint_states go backwards',
                      'use one publisher with a monotonic clock')
    elif not ticking and abs(late) > _STATE_TIMEOUT:
        yield Finding(PROBLEM, 'clocks', f'joint_states are {late:.3g} s old when they arrive',
                      'synchronise the clocks of both machines (chrony, PTP), or set '
                      'use_sim_time alike everywhere')
    elif not ticking:
        yield Finding(OK, 'clocks', f'joint_states are {1e3 * late:.2g} ms old')


def _values(states: StatesSeen, joint: str) -> Iterator[Finding]:
    """Check the values of the messages that name a joint."""
    for name, do in (('position', 'friction cannot be compensated without it'),
                     ('effort', 'let the driver report k_t · n · current; identification and '
                                'refinement need it')):
        missing = ~np.isfinite(getattr(states, name))
        if missing.all():
            yield Finding(PROBLEM, joint, f'joint_states hold no {name}', do)
        elif missing.any():
            yield Finding(WARNING, joint, f'{missing.sum()} of {len(missing)} joint_states hold no '
                          f'finite {name}', do)
    for name in ('position', 'velocity'):
        values = getattr(states, name)
        if (impossible := beyond(name, values)).any():
            yield Finding(PROBLEM, joint, f'a {name} of {values[impossible][0]:.3g} '
                          f'{LIMITS[name][1]} is impossible', 'check how the '
                          'driver converts its sensor values, and how it reports a failed sensor')
    if not np.isfinite(states.velocity).any():
        yield Finding(NOTE, joint, 'joint_states hold no velocity; position is differentiated')
        return
    time = states.stamp if states.stamp.any() else states.received
    agreement = motion.velocity_agreement(time, states.position[:, 0], states.velocity[:, 0])
    if agreement.blocks < motion.FEWEST_BLOCKS:
        yield Finding(NOTE, joint, 'it hardly moved: signs and units could not be checked',
                      'run doctor again while it is moved')
    elif agreement.fault:
        yield Finding(PROBLEM, joint, agreement.fault, 'let the driver give both in rad and rad/s '
                      'at the joint, with one sign; velocity may be left empty')
    else:
        yield Finding(OK, joint, 'velocity and position agree')
    if fast := motion.hardly_in_radians(time, states.position[:, 0]):
        yield Finding(WARNING, joint, fast, 'let the driver give position in rad at the joint')


def _commands(seen: Observation) -> Iterator[Finding]:
    topic = seen.topic('current_command')
    names = _names(topic.publishers)
    if not topic.publishers:
        yield Finding(NOTE, 'current_command', 'nobody commands the drive')
        return
    if len(topic.publishers) > 1:
        yield Finding(WARNING, 'current_command', f'{len(topic.publishers)} nodes may command: '
                      f'{names}', 'only one may command: stop the others, and deactivate the '
                      'compensator while identification runs')
    if not topic.subscribers:
        yield Finding(PROBLEM, 'current_command', f'{names} commands, but nobody subscribes',
                      'remap: -r current_command:=/its_controller/commands')
        return
    largest = float(np.abs(seen.commands).max()) if seen.commands.size else 0.0
    yield Finding(OK, 'current_command', f'{names} to {_names(topic.subscribers)}: '
                  f'{len(seen.commands) / seen.seconds:.4g} Hz, '
                  f'up to {largest:.3g} {seen.command_unit}')
    # If several drivers publish states, one command answers a state of each.
    states = 0 if seen.states is None else int(seen.states.named.sum(axis=0).max(initial=0))
    if len(seen.commands) < 0.5 * states and 'compensator' in names:
        yield Finding(WARNING, 'current_command', f'{len(seen.commands)} commands for {states} '
                      'joint_states', 'the compensator commands once for each usable one: '
                      'see its diagnostics')
    if not np.isfinite(seen.commands).all():
        yield Finding(PROBLEM, 'current_command', 'values that are not finite are commanded',
                      f'stop {names}')


def _driver(seen: Observation) -> Iterator[Finding]:
    for end in seen.topic('current_command').subscribers:
        timeouts = {name: value for name, value in seen.parameters.get(end.node, {}).items()
                    if 'timeout' in name and not name.startswith('reference')
                    and isinstance(value, (int, float))}
        for name, value in timeouts.items():
            level, do = (OK, '') if value > 0 else (
                WARNING, 'let the driver itself switch to zero current in less than 0.1 s')
            yield Finding(level, 'driver', f'{end.node}: {name} is {value:g}', do)
        if not timeouts and not any(word in end.node for word in _OBSERVERS):
            yield Finding(
                NOTE, 'driver', f'{end.node} has no parameter for a command timeout',
                'make sure that it switches to zero current by itself: kill the compensator '
                'with SIGKILL in a safe setting and watch the current')


def _direction(seen: Observation) -> Iterator[Finding]:
    topic = seen.topic('direction')
    planners = {end.node for name in ('direction', 'direction_stamped')
                for end in seen.topic(name).publishers}
    if not planners:
        if topic.subscribers:
            yield Finding(NOTE, 'direction', _describe_missing(seen, 'direction')
                          + ': no breakaway current is fed forward', 'start the exercise')
        return
    if len(planners) > 1 or len(topic.publishers) > 1:
        yield Finding(WARNING, 'direction', f'{", ".join(sorted(planners))} announce directions',
                      'let one announce: where they contradict each other, the compensator '
                      'counts the direction as 0')
    if not topic.publishers:
        # Messages with a stamp are not observed.
        return
    odd = sorted({value for one in seen.directions for value in one} - {-1, 0, 1})
    if odd:
        yield Finding(WARNING, 'direction', f'holds {odd}, which count as 0', 'send -1, 0 or +1')
    rate = len(seen.directions) / seen.seconds
    timeout = _parameter(seen, 'direction_timeout', _DIRECTION_TIMEOUT)
    if rate * timeout < 1.5:
        yield Finding(WARNING, 'direction', f'{rate:.3g} Hz, but it counts as 0 after {timeout:g} '
                      's of silence', 'repeat the direction at 10 Hz or more')
    else:
        yield Finding(OK, 'direction', f'{rate:.3g} Hz')


def _clocks(seen: Observation) -> Iterator[Finding]:
    simulated = {node: values['use_sim_time'] for node, values in sorted(seen.parameters.items())
                 if 'use_sim_time' in values}
    followers = [node for node, value in simulated.items() if value]
    real = [node for node, value in simulated.items() if not value and 'compensator' in node]
    if followers and not seen.clock:
        yield Finding(PROBLEM, 'clocks', f'{", ".join(followers)} waits for /clock, which does not '
                      'tick', 'start what publishes it, or set use_sim_time:=false')
    if followers and seen.clock and real:
        yield Finding(PROBLEM, 'clocks', f'/clock ticks, but {", ".join(real)} does not follow it',
                      'set use_sim_time:=true there')


def _diagnostics(seen: Observation) -> Iterator[Finding]:
    for name, (level, message) in seen.diagnostics.items():
        if level in _LEVELS:
            node = name.partition(':')[0]
            yield Finding(_LEVELS[level], name, message, (
                'after removing the cause: ros2 service call '
                f'/{node}/reset_faults std_srvs/srv/Trigger' if '(latched)' in message else
                'see its log and /diagnostics'))


def _parameter(seen: Observation, name: str, default: float) -> float:
    """Return a parameter of the compensator, its default where none runs."""
    return float(next((parameters[name] for node, parameters in seen.parameters.items()
                       if name in parameters and 'compensator' in node), default))


def check_joint(seen: Observation, joint: str, model: FrictionModel) -> list[Finding]:
    """Compare the observation of a joint with its model.

    Friction dissipates energy, so the current that overcomes it, of motor and person together, has
    the sign of the velocity. A weight that is lowered supplies energy, and is told from friction.
    """
    states = seen.states
    if states is None or joint not in states.joints:
        return [Finding(WARNING, joint, 'joint_states do not name it', 'compare the names')]
    states = states.of_joint(joint)
    if seen.effort_is_current:
        states = replace(states, effort=states.effort * model.drive.torque_per_current)
    return [*_check_encoder(states, joint, model), *_check_current(seen, states, joint, model),
            *_check_fit(seen, joint, model, states.rows(
                seen.load.get(joint), model.drive.torque_per_current))]


def _check_encoder(states: StatesSeen, joint: str, model: FrictionModel) -> Iterator[Finding]:
    if fault := encoder_fault(model.drive, states.position[:, 0]):
        yield Finding(WARNING, joint, fault, 'set drive.encoder_counts in the model file to what '
                      'the position shows: it decides how fast the compensator follows')


def _check_current(seen: Observation, states: StatesSeen, joint: str, model: FrictionModel
                   ) -> list[Finding]:
    """Compare measured and commanded current; the commands are in the order of a node's joints."""
    order: list[str] = next((values['joints'] for values in seen.parameters.values()
                  if joint in (values.get('joints') or ()) and 'model_files' in values), [])
    if not order or seen.commands.shape[-1:] != (len(order),):
        return []
    measured = states.effort[:, 0] / model.drive.torque_per_current
    unit = model.drive.torque_per_current if seen.command_unit == 'N·m' else 1.0
    command = np.interp(
        states.received, seen.commanded, seen.commands[:, order.index(joint)] / unit)
    finite = np.isfinite(measured) & np.isfinite(command)
    measured, command = measured[finite], command[finite]
    smallest = _SMALL * model.drive.current_limit
    if len(command) < _FEWEST_SAMPLES or np.mean(command ** 2) < smallest ** 2:
        return []
    gain, correlation = current.current_answer(command, measured)
    if abs(correlation) < _LEAST_CORRELATION:
        return [Finding(WARNING, joint, 'the measured current does not follow the commanded one',
                        "check the driver's mode and limits, and whether another node commands")]
    if gain < 0.0:
        return [Finding(PROBLEM, joint, 'the measured current has the opposite sign of the '
                        'commanded one', 'stop compensating; reverse the sign of effort in the '
                        'driver, or that of the command, whichever is wrong: a positive current '
                        'must push the joint towards larger positions')]
    if why := current.gain_fault(gain, model.drive):
        return [Finding(WARNING, joint, f'the measured current is {gain:.3g} times the '
                        f'commanded one: {why}',
                        'effort is k_t · n · current in N·m: compare torque constant and gear '
                        'ratio of driver and model file')]
    return [Finding(OK, joint, 'the measured current follows the commanded one')]


def _check_fit(seen: Observation, joint: str, model: FrictionModel, rows: np.ndarray
               ) -> list[Finding]:
    """Compare a joint's model with rows for `LiveResidual`."""
    position, velocity, own, load = rows.T[1:5]
    moving = (np.abs(velocity) > motion.STANDSTILL) & np.isfinite(own)
    if moving.sum() < _FEWEST_SAMPLES:
        return [Finding(NOTE, joint, 'too little motion to compare it with its model',
                        'run doctor again while it is moved')]
    loaded = np.isfinite(load).all()
    commanded = any('compensator' in end.node for end in seen.topic('current_command').publishers)
    if commanded and not loaded:
        return [Finding(NOTE, joint, 'the compensator feeds the model itself forward and no load '
                        'is measured: the model cannot be checked',
                        'publish interaction_wrench, or run doctor while the motor alone moves it')]
    if loaded:
        own = own + load / model.drive.torque_per_current
    overcomes = current.pushes(position[moving], velocity[moving], own[moving], _PER_BIN)
    if overcomes is False:
        return [Finding(PROBLEM, joint, 'the current opposes the motion: at the same positions it '
                        'is larger backwards than forwards, so that friction would supply energy',
                        'reverse the sign of effort, or that of position and velocity, in the '
                        'driver before compensating')]
    sign = (Finding(OK, joint, 'current and motion have the same sign') if overcomes else
            Finding(NOTE, joint, 'the sign of effort could not be checked: it hardly passed the '
                    'same positions in both directions', 'run doctor again while it moves to and '
                    'fro'))
    residual = LiveResidual(model)
    residual.add(rows)
    verdict = residual.verdict()
    level, do = WARNING, 'check torque constant and gear ratio, then refine the model'
    if residual.blind:
        level, do = NOTE, ''
    elif not verdict.known:
        level, do = NOTE, 'observe for longer: --seconds 60'
    elif verdict.fits:
        level, do = OK, ''
    return [sign, Finding(level, joint, residual.blind or verdict.text, do)]
