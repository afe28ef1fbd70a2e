# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What happens to the motor's current when something goes wrong, with real nodes over DDS.

    python3 bench/fault_table.py [--times N] [--only WORD]

For each fault a compensator in a process of its own drives a joint with more than 50 mA; then the
fault comes. It is held when the last command is zero within the time given for it (the
compensator's joint_state_timeout, and 60 ms for two processes on a machine that does something
else), and stays zero while the fault lasts. Counts: tried, held, lost.
"""

import argparse
from array import array
from contextlib import ExitStack
from functools import partial
import os
from pathlib import Path
import signal
import tempfile
import time

from bench_tools import ROOT
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from ros_system import (
    BEST_EFFORT,
    FakeDriver,
    joint_state,
    MODELS,
    own_domain,
    probe_node,
    Process,
    RELIABLE,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int8MultiArray

TIMEOUT = 0.1
SLACK = 0.06


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--times', type=int, default=3)
    parser.add_argument('--only', default='')
    arguments = parser.parse_args()
    table = []
    print('fault                                      tried  held  lost   zero after, ms (largest)')
    with tempfile.TemporaryDirectory() as folder:
        for name, make in FAULTS.items():
            if arguments.only not in name:
                continue
            rows = [try_once(Path(folder) / f'{len(table)}_{k}', make)
                    for k in range(arguments.times)]
            delays = [delay for held, delay in rows if held]
            held = len(delays)
            table.append((len(rows), held, len(rows) - held))
            longest = f'{1e3 * max(delays):8.0f}' if delays else '       -'
            print(f'{name:42s} {len(rows):5d} {held:5d} {len(rows) - held:5d} {longest}',
                  flush=True)
    total = [sum(row[k] for row in table) for k in range(3)]
    print(f'{"all":42s} {total[0]:5d} {total[1]:5d} {total[2]:5d}')


class Rig:
    """A driver by hand before a compensator, and an eye on the current."""

    def __init__(self, probe, process, simulated, source=None):
        self.probe, self.process, self.source = probe, process, source
        self.leader = probe.talk(JointState, 'reference', BEST_EFFORT) if source else None
        self.driver = FakeDriver(probe, ['elbow'], BEST_EFFORT)
        self.ticks = probe.talk(Clock, '/clock', RELIABLE) if simulated else None
        self.ahead = 0
        self.stopped_clock = False

    def send(self, stamp=None, position=(0.0,), velocity=(0.0,), names=('elbow',)):
        if self.ticks and not self.stopped_clock:
            now = Clock()
            now.clock.sec, now.clock.nanosec = divmod(time.time_ns(), 10**9)
            self.ticks.publish(now)
        stamp = time.time_ns() + self.ahead if stamp is None else stamp
        self.driver.states.publish(joint_state(stamp, names, position, velocity))
        self.probe.spin_for(0.002)

    def lead(self, position=None):
        """Send the state of a leader, who moves away by 0.1 rad/s."""
        position = 0.1 * (time.monotonic() % 1000.0) if position is None else position
        self.leader.publish(joint_state(time.time_ns(), ['elbow'], [position]))
        self.send()

    def drive(self):
        """Stream states until the motor has a current."""
        end = time.monotonic() + 60.0
        while time.monotonic() < end:
            if self.leader is None:
                self.driver.announce([1])
            else:
                self.lead()
            for _ in range(10):
                self.send()
            if self.current > 0.05:
                return
        raise AssertionError(f'no current: {self.process.text}')

    @property
    def current(self):
        commands = self.driver.commands
        return abs(commands[-1].data[0]) if commands else 0.0


def try_once(folder, make):
    """Return whether a fault was held, and after how many s the current was zero."""
    with ExitStack() as stack:
        stack.enter_context(own_domain())
        probe = stack.enter_context(probe_node())
        process = stack.enter_context(Process(folder, 'compensator', {
            'joints': ['elbow'], 'model_files': MODELS[:1], 'law': 'paper',
            'joint_state_timeout': TIMEOUT, 'use_sim_time': make.simulated}))
        source = stack.enter_context(Process(folder / 'leader', 'direction', {
            'joints': ['elbow'], 'source': 'reference'})) if make.led else None
        rig = Rig(probe, process, make.simulated, source)
        rig.drive()
        # What was sent before the fault is answered before it.
        probe.spin_for(0.02)
        go_on = make(rig)
        begin = time.monotonic()
        delay = None
        while time.monotonic() - begin < 1.0:
            try:
                go_on()
            except BrokeOffError:
                return False, 0.0
            if rig.current == 0.0:
                delay = delay if delay is not None else time.monotonic() - begin
            elif delay is not None:
                return False, 0.0
        return delay is not None and delay <= make.within, delay or 0.0


class BrokeOffError(Exception):
    """The current ended where it should have gone on."""


# The faults: each is called once, and returns what is done again and again while it lasts.

FAULTS = {}


def fault(name, simulated=False, within=TIMEOUT + SLACK, led=False):
    """Register a fault; the current must be zero `within` s. Where `led`, d comes from a leader."""
    def register(function):
        function.simulated, function.within, function.led = simulated, within, led
        FAULTS[name] = function
        return function
    return register


def listening(rig):
    return lambda: rig.probe.spin_for(0.002)


fault('driver falls silent')(listening)


@fault('stamp repeated for good')
def _(rig):
    stamp = time.time_ns()
    rig.send(stamp)
    return lambda: rig.send(stamp)


@fault('stamps run 10 s ahead')
def _(rig):
    rig.ahead = 10 * 10**9
    return rig.send


@fault('stamps lag by 10 s')
def _(rig):
    rig.ahead = -10 * 10**9
    return rig.send


@fault('/clock stops under use_sim_time', simulated=True)
def _(rig):
    rig.stopped_clock = True
    return rig.send


fault('/clock and states stop', simulated=True)(lambda rig: listening(rig))

for name, state in {
        'position not a number': {'position': [float('nan')]},
        'velocity infinite': {'velocity': [float('inf')]},
        'position of 1e300 rad': {'position': [1e300]},
        'joint named twice': {'names': ['elbow', 'elbow'], 'position': [0.0, 0.1],
                              'velocity': [0.0, 0.0]},
        'arrays of different lengths': {'position': [0.0, 0.0]},
        'joint no more in the states': {'names': ['wrist']}}.items():
    fault(name)(lambda rig, state=state: partial(rig.send, **state))


# The next three are seen from what comes over a while, so that no true signal is taken for one.
@fault('two publishers of the joint', within=0.3)
def _(rig):
    rival = rig.probe.create_publisher(JointState, 'joint_states', BEST_EFFORT)
    rig.probe.until(lambda: rival.get_subscription_count(), 'a second publisher')

    def both():
        rig.driver.announce([1])
        rig.send()
        rival.publish(joint_state(time.time_ns(), ['elbow'], [0.3]))
    return both


@fault('two planners, one +1 and one -1', within=0.3)
def _(rig):
    rival = rig.probe.create_publisher(Int8MultiArray, 'direction', BEST_EFFORT)
    rig.probe.until(lambda: rival.get_subscription_count(), 'a second planner')

    def both():
        rig.driver.announce([1])
        rig.send()
        rival.publish(Int8MultiArray(data=array('b', [-1])))
        rig.send()
    return both


@fault('velocity in deg/s', within=0.7)
def _(rig):
    begin = time.monotonic()

    def move():
        rig.driver.announce([1])
        rig.send(position=[0.5 * (time.monotonic() - begin)], velocity=[0.5 * 57.3])
    return move


@fault('another commander', within=0.5)
def _(rig):
    # Alone for long enough that the other is a newcomer.
    end = time.monotonic() + 3.5
    while time.monotonic() < end:
        rig.driver.announce([1])
        rig.send()
    rig.probe.create_publisher(Float64MultiArray, 'current_command', RELIABLE)
    return rig.send


for name in ('SIGINT', 'SIGTERM', 'SIGHUP', 'SIGQUIT', 'SIGABRT', 'SIGUSR1', 'SIGUSR2',
             'SIGALRM'):
    @fault(f'{name} to the compensator')
    def _(rig, name=name):
        rig.process.send(getattr(signal, name))
        return rig.send


@fault('deactivated', within=0.5)
def _(rig):
    request = ChangeState.Request()
    request.transition.label = 'deactivate'
    client = rig.probe.create_client(ChangeState, '/compensator/change_state')
    rig.probe.until(client.service_is_ready, 'the service', 10.0)
    client.call_async(request)
    return rig.send




# The node direction: silence of a leader is known after 0.25 s, that of a planner after 0.5 s.
@fault('leader falls silent', within=0.25 + SLACK, led=True)
def _(rig):
    return rig.send


@fault('leader is not a number', within=0.25 + SLACK, led=True)
def _(rig):
    return partial(rig.lead, float('nan'))


@fault('leader stands still', within=0.25 + SLACK, led=True)
def _(rig):
    return partial(rig.lead, 0.1 * (time.monotonic() % 1000.0))


for name, seconds in {'SIGTERM': TIMEOUT, 'SIGKILL': 0.5, 'SIGSTOP': 0.5}.items():
    @fault(f'{name} to direction', within=seconds + SLACK, led=True)
    def _(rig, name=name):
        rig.source.send(getattr(signal, name))
        return rig.lead


for name in ('SIGTSTP', 'SIGTTIN', 'SIGTTOU'):
    @fault(f'{name}, then SIGCONT and what waited')
    def _(rig, name=name):
        rig.process.send(getattr(signal, name))
        begin, continued = time.monotonic(), []

        def wait():
            if time.monotonic() - begin > 0.4 and not continued:
                continued.append(rig.process.send(signal.SIGCONT))
            elif not continued:
                # Without a stamp, they count from when they are read.
                rig.driver.announce([1])
                rig.send(stamp=0)
            rig.probe.spin_for(0.002)
        return wait


for name, number in {'configure': 1, 'cleanup': 2, 'activate': 3}.items():
    @fault(f'{name} while active', within=1.0)
    def _(rig, number=number):
        client = rig.probe.create_client(ChangeState, '/compensator/change_state')
        rig.probe.until(client.service_is_ready, 'the service', 10.0)
        rig.drive()
        client.call_async(ChangeState.Request(transition=Transition(id=number)))
        return goes_on(rig)


@fault('parameter of unknown type', within=1.0)
def _(rig):
    client = rig.probe.create_client(SetParameters, '/compensator/set_parameters')
    rig.probe.until(client.service_is_ready, 'the service', 10.0)
    rig.drive()
    client.call_async(SetParameters.Request(parameters=[ParameterMessage(
        name='law', value=ParameterValue(type=77))]))
    return goes_on(rig)


@fault('/clock before zero', simulated=True, within=1.0)
def _(rig):
    tick = Clock()
    tick.clock.sec = -5
    rig.ticks.publish(tick)
    return goes_on(rig)


MODEL = (ROOT / 'config' / 'armin_configuration_1.yaml').read_text(encoding='utf-8')
NOTE = '  n{}: ' + 80 * 'x' + '\n'
for name, write in {
        'model file is a pipe': os.mkfifo,
        'model file of 1.8 MB': lambda path: path.write_text(
            MODEL + 'notes:\n' + ''.join(map(NOTE.format, range(20_000)))),
        'model file of 0.9 MB': lambda path: path.write_text(
            MODEL + 'notes:\n' + ''.join(map(NOTE.format, range(10_000)))),
        'model with 99.5 A of breakaway': lambda path: path.write_text(
            MODEL.replace('mean: 0.0995', 'mean: 99.5'))}.items():
    # Here the current must not break off: the old model goes on, and so does the loop.
    @fault(name, within=1.0)
    def _(rig, write=write):
        path = Path(tempfile.mkdtemp()) / 'model.yaml'
        write(path)
        client = rig.probe.create_client(SetParameters, '/compensator/set_parameters')
        rig.probe.until(client.service_is_ready, 'the service', 10.0)
        rig.drive()
        client.call_async(SetParameters.Request(parameters=[ParameterMessage(
            name='model_files',
            value=Parameter('x', value=[str(path)]).get_parameter_value())]))
        return goes_on(rig)


def goes_on(rig):
    """Stream on, with a current throughout, and end in silence."""
    begin = sent = time.monotonic()
    calm = 0

    def step():
        nonlocal sent, calm
        now = time.monotonic()
        if now - begin > 0.7:
            rig.probe.spin_for(0.002)
            return
        # Where this process itself was held up, the watchdog was right.
        calm = 0 if now - sent > TIMEOUT / 3 else calm + 1
        sent = now
        rig.driver.announce([1])
        rig.send()
        if calm > 20 and rig.current < 0.05:
            raise BrokeOffError
    return step


if __name__ == '__main__':
    main()
