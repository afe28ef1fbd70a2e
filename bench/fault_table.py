# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What happens to the motor's current when something goes wrong, with real nodes over DDS.

    python3 bench/fault_table.py [--times N] [--only WORD]

For each fault a compensator in a process of its own drives a joint with more than 50 mA; then the
fault comes. It is held when the last command is zero within the time given for it (the
compensator's joint_state_timeout, and 60 ms for two processes on a machine that does something
else), and stays zero while the fault lasts. Counts: tried, held, lost. What no process can help
stands at the end, with what the driver must do.
"""

import argparse
from array import array
import os
from pathlib import Path
import signal
import tempfile
import time

from bench_tools import ROOT
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter as ParameterMessage
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
    total = [sum(column) for column in zip(*table)]
    print(f'{"all":42s} {total[0]:5d} {total[1]:5d} {total[2]:5d}')


class Rig:
    """A driver by hand before a compensator, and an eye on the current."""

    def __init__(self, probe, process, simulated):
        self.probe, self.process, self.simulated = probe, process, simulated
        self.driver = FakeDriver(probe, ['elbow'], BEST_EFFORT)
        self.ticks = probe.talk(Clock, '/clock', RELIABLE) if simulated else None
        self.ahead = 0
        self.stopped_clock = False

    def tick(self):
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(time.time_ns(), 10**9)
        self.ticks.publish(message)

    def send(self, stamp=None, position=(0.0,), velocity=(0.0,), names=('elbow',)):
        if self.simulated and not self.stopped_clock:
            self.tick()
        stamp = time.time_ns() + self.ahead if stamp is None else stamp
        self.driver.states.publish(joint_state(stamp, names, position, velocity))
        self.probe.spin_for(0.002)

    def drive(self):
        """Stream states until the motor has a current."""
        end = time.monotonic() + 60.0
        while time.monotonic() < end:
            self.driver.announce([1])
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
    simulated = getattr(make, 'simulated', False)
    with own_domain(), probe_node() as probe, Process(folder, 'compensator', {
            'joints': ['elbow'], 'model_files': MODELS[:1], 'law': 'paper',
            'joint_state_timeout': TIMEOUT, 'use_sim_time': simulated}) as process:
        rig = Rig(probe, process, simulated)
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
        allowed = make.within if hasattr(make, 'within') else TIMEOUT + SLACK
        return delay is not None and delay <= allowed, delay or 0.0


class BrokeOffError(Exception):
    """The current ended where it should have gone on."""


# The faults: each is done once, and returns what goes on while it lasts.

FAULTS = {}


def fault(name, **options):
    def register(function):
        for key, value in options.items():
            setattr(function, key, value)
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


@fault('/clock and states stop', simulated=True)
def _(rig):
    return listening(rig)


@fault('position not a number')
def _(rig):
    return lambda: rig.send(position=[float('nan')])


@fault('velocity infinite')
def _(rig):
    return lambda: rig.send(velocity=[float('inf')])


@fault('position of 1e300 rad')
def _(rig):
    return lambda: rig.send(position=[1e300])


@fault('joint named twice')
def _(rig):
    return lambda: rig.send(names=['elbow', 'elbow'], position=[0.0, 0.1], velocity=[0.0, 0.0])


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


@fault('arrays of different lengths')
def _(rig):
    return lambda: rig.send(position=[0.0, 0.0])


@fault('joint no more in the states')
def _(rig):
    return lambda: rig.send(names=['wrist'])


@fault('another commander')
def _(rig):
    # Alone for long enough that the other is a newcomer.
    end = time.monotonic() + 3.5
    while time.monotonic() < end:
        rig.driver.announce([1])
        rig.send()
    rig.probe.create_publisher(Float64MultiArray, 'current_command', RELIABLE)
    return rig.send


FAULTS['another commander'].within = 0.5


def signals():
    for name in ('SIGINT', 'SIGTERM', 'SIGHUP', 'SIGQUIT', 'SIGABRT', 'SIGUSR1', 'SIGUSR2',
                 'SIGALRM'):
        def end(rig, name=name):
            rig.process.send(getattr(signal, name))
            return rig.send
        fault(f'{name} to the compensator')(end)


signals()


@fault('deactivated', within=0.5)
def _(rig):
    request = ChangeState.Request()
    request.transition.label = 'deactivate'
    client = rig.probe.create_client(ChangeState, '/compensator/change_state')
    rig.probe.until(client.service_is_ready, 'the service', 10.0)
    client.call_async(request)
    return rig.send


def model_fault(name, write):
    def load(rig):
        path = Path(tempfile.mkdtemp()) / 'model.yaml'
        write(path)
        client = rig.probe.create_client(SetParameters, '/compensator/set_parameters')
        rig.probe.until(client.service_is_ready, 'the service', 10.0)
        rig.drive()
        client.call_async(SetParameters.Request(parameters=[ParameterMessage(
            name='model_files',
            value=Parameter('x', value=[str(path)]).get_parameter_value())]))
        return goes_on(rig)
    # Here the current must not break off: the old model goes on, and so does the loop.
    load.within = 1.0
    FAULTS[name] = load


def goes_on(rig):
    """Stream on, with a current throughout, and end in silence."""
    begin = time.monotonic()
    sent, calm = [begin], [0]

    def step():
        now = time.monotonic()
        if now - begin > 0.7:
            rig.probe.spin_for(0.002)
            return
        # Where this process itself was held up, the watchdog was right.
        calm[0] = 0 if now - sent[0] > TIMEOUT / 3 else calm[0] + 1
        sent[0] = now
        rig.driver.announce([1])
        rig.send()
        if calm[0] > 20 and rig.current < 0.05:
            raise BrokeOffError
    return step


def model_faults():
    text = (ROOT / 'config' / 'armin_configuration_1.yaml').read_text(encoding='utf-8')
    model_fault('model file is a pipe', lambda path: os.mkfifo(path))
    model_fault('model file of 1.8 MB', lambda path: path.write_text(
        text + 'notes:\n' + ''.join(f'  n{k}: {"x" * 80}\n' for k in range(20_000))))
    model_fault('model file of 0.9 MB', lambda path: path.write_text(
        text + 'notes:\n' + ''.join(f'  n{k}: {"x" * 80}\n' for k in range(10_000))))
    model_fault('model with 99.5 A of breakaway', lambda path: path.write_text(
        text.replace('mean: 0.0995', 'mean: 99.5')))


model_faults()


if __name__ == '__main__':
    main()
