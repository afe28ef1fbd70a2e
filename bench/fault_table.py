# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What happens to the motor's current when something goes wrong, with real nodes over DDS.

    python3 bench/fault_table.py [--times N] [--only WORD]

For each fault a compensator in a process of its own drives a joint with more than 50 mA; then the
fault comes. It is held when the last command is zero within the time given for it (the
compensator's joint_state_timeout, and 60 ms for two processes on a machine that does something
else), and stays zero while the fault lasts.
"""

from array import array
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
import math
import os
from pathlib import Path
import signal
import tempfile
import time
from typing import NamedTuple

from bench_tools import ROOT, table_parser
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
    tick,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int8MultiArray

TIMEOUT = 0.1
SLACK = 0.06


def main():
    parser = table_parser(__doc__, times=3)
    parser.add_argument('--only', default='')
    arguments = parser.parse_args()
    tried = held = 0
    print('fault                                      tried  held   zero after, ms (largest)')
    with tempfile.TemporaryDirectory() as folder:
        for fault in (one for one in FAULTS if arguments.only in one.name):
            rows = [try_once(Path(folder) / f'{tried}_{k}', fault) for k in range(arguments.times)]
            delays = [delay for was_held, delay in rows if was_held]
            tried, held = tried + len(rows), held + len(delays)
            print(f'{fault.name:42s} {len(rows):5d} {len(delays):5d} '
                  f'{1e3 * max(delays, default=math.nan):8.0f}', flush=True)
    print(f'{"all":42s} {tried:5d} {held:5d}')


def leader_place():
    return 0.1 * (time.monotonic() % 1000.0)


class Rig:
    """A driver by hand before a compensator, and an eye on the current."""

    def __init__(self, probe, process, simulated, source=None):
        self.probe, self.process, self.source = probe, process, source
        self.leader = probe.talk(JointState, 'reference', BEST_EFFORT) if source else None
        self.driver = FakeDriver(probe, ['elbow'], BEST_EFFORT)
        self.ticks = probe.talk(Clock, '/clock', RELIABLE) if simulated else None

    def send(self, stamp=None, position=(0.0,), velocity=(0.0,), names=('elbow',), ahead=0,
             ticks=True):
        if self.ticks and ticks:
            self.ticks.publish(tick(time.time_ns()))
        stamp = time.time_ns() + ahead if stamp is None else stamp
        self.driver.states.publish(joint_state(stamp, names, position, velocity))
        self.probe.spin_for(0.002)

    def lead(self, position=None):
        """Send the state of a leader, who moves away by 0.1 rad/s."""
        position = leader_place() if position is None else position
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

    def ask(self, kind, service, request):
        """Call a service of the compensator while there is a current."""
        client = self.probe.create_client(kind, f'/compensator/{service}')
        self.probe.until(client.service_is_ready, 'the service', 10.0)
        self.drive()
        client.call_async(request)

    @property
    def current(self):
        commands = self.driver.commands
        return abs(commands[-1].data[0]) if commands else 0.0


def try_once(folder, fault):
    """Return whether a fault was held, and after how many s the current was zero."""
    with ExitStack() as stack:
        stack.enter_context(own_domain())
        probe = stack.enter_context(probe_node())
        process = stack.enter_context(Process(folder, 'compensator', {
            'joints': ['elbow'], 'model_files': MODELS[:1], 'law': 'paper',
            'joint_state_timeout': TIMEOUT, 'use_sim_time': fault.simulated}))
        source = stack.enter_context(Process(folder / 'leader', 'direction', {
            'joints': ['elbow'], 'source': 'reference'})) if fault.led else None
        rig = Rig(probe, process, fault.simulated, source)
        rig.drive()
        # What was sent before the fault is answered before it.
        probe.spin_for(0.02)
        go_on = fault.begin(rig)
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
        return delay is not None and delay <= fault.within, delay or 0.0


class BrokeOffError(Exception):
    """The current ended where it should have gone on."""


# What begins a fault; each returns what is done again and again while the fault lasts.

def silence(rig):
    return partial(rig.probe.spin_for, 0.002)


def sending(**state):
    return lambda rig: partial(rig.send, **state)


def with_rival(kind, topic, message):
    """Let another publisher contradict the first."""
    def begin(rig):
        rival = rig.probe.create_publisher(kind, topic, BEST_EFFORT)
        rig.probe.until(rival.get_subscription_count, 'a second publisher')

        def both():
            rig.driver.announce([1])
            rig.send()
            rival.publish(message())
            rig.send()
        return both
    return begin


def in_degrees(rig):
    begin = time.monotonic()

    def move():
        rig.driver.announce([1])
        rig.send(position=[0.5 * (time.monotonic() - begin)], velocity=[0.5 * 57.3])
    return move


def with_commander(rig):
    # Alone for long enough that the other is a newcomer.
    end = time.monotonic() + 3.5
    while time.monotonic() < end:
        rig.driver.announce([1])
        rig.send()
    rig.probe.create_publisher(Float64MultiArray, 'current_command', RELIABLE)
    return rig.send


def signalled(name, process='process', then='send'):
    def begin(rig):
        getattr(rig, process).send(getattr(signal, name))
        return getattr(rig, then)
    return begin


def asked(number, then=lambda rig: rig.send):
    """Ask for a transition."""
    def begin(rig):
        rig.ask(ChangeState, 'change_state',
                ChangeState.Request(transition=Transition(id=number)))
        return then(rig)
    return begin


# Where the current must not break off: the old model goes on, and so does the loop.

def with_parameter(name, value):
    """Set a parameter to what a function gives."""
    def begin(rig):
        rig.ask(SetParameters, 'set_parameters', SetParameters.Request(
            parameters=[ParameterMessage(name=name, value=value())]))
        return goes_on(rig)
    return begin


def with_model(write):
    """Name a model file that a function writes to a path."""
    def value():
        path = Path(tempfile.mkdtemp()) / 'model.yaml'
        write(path)
        return Parameter('x', value=[str(path)]).get_parameter_value()
    return with_parameter('model_files', value)


def clock_before_zero(rig):
    rig.ticks.publish(tick(-5 * 10**9))
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


class Fault(NamedTuple):
    """A fault: the current must be zero `within` s. Where `led`, d comes from a leader."""

    name: str
    begin: Callable
    within: float = TIMEOUT + SLACK
    simulated: bool = False
    led: bool = False


MODEL = (ROOT / 'config' / 'armin_configuration_1.yaml').read_text(encoding='utf-8')
ENDING = ('SIGINT', 'SIGTERM', 'SIGHUP', 'SIGQUIT', 'SIGABRT', 'SIGUSR1', 'SIGUSR2', 'SIGALRM',
          'SIGTSTP', 'SIGTTIN')
# The node direction knows the silence of a leader after 0.25 s, that of a planner after 0.5 s.
LED = 0.25 + SLACK
FAULTS = (
    Fault('driver falls silent', silence),
    Fault('stamp repeated for good', lambda rig: partial(rig.send, time.time_ns())),
    Fault('stamps run 10 s ahead', sending(ahead=10 * 10**9)),
    Fault('stamps lag by 10 s', sending(ahead=-10 * 10**9)),
    Fault('/clock stops under use_sim_time', sending(ticks=False), simulated=True),
    Fault('/clock and states stop', silence, simulated=True),
    Fault('position not a number', sending(position=[float('nan')])),
    Fault('velocity infinite', sending(velocity=[float('inf')])),
    Fault('position of 1e300 rad', sending(position=[1e300])),
    Fault('joint named twice', sending(
        names=['elbow', 'elbow'], position=[0.0, 0.1], velocity=[0.0, 0.0])),
    Fault('arrays of different lengths', sending(position=[0.0, 0.0])),
    Fault('joint no more in the states', sending(names=['wrist'])),
    # The next three are seen from what comes over a while, so that no true signal is taken for one.
    Fault('two publishers of the joint', with_rival(
        JointState, 'joint_states', lambda: joint_state(time.time_ns(), ['elbow'], [0.3])), 0.3),
    Fault('two planners, one +1 and one -1', with_rival(
        Int8MultiArray, 'direction', lambda: Int8MultiArray(data=array('b', [-1]))), 0.3),
    Fault('velocity in deg/s', in_degrees, 0.7),
    Fault('another commander', with_commander, 0.5),
    *(Fault(f'{name} to the compensator', signalled(name)) for name in ENDING),
    Fault('deactivated', asked(Transition.TRANSITION_DEACTIVATE), 0.5),
    Fault('leader falls silent', lambda rig: rig.send, LED, led=True),
    Fault('leader is not a number', lambda rig: partial(rig.lead, float('nan')), LED, led=True),
    Fault('leader stands still', lambda rig: partial(rig.lead, leader_place()), LED, led=True),
    *(Fault(f'{name} to direction', signalled(name, 'source', 'lead'), within + SLACK, led=True)
      for name, within in {'SIGTERM': TIMEOUT, 'SIGKILL': 0.5, 'SIGSTOP': 0.5}.items()),
    *(Fault(f'{name} while active', asked(number, goes_on), 1.0)
      for name, number in {'configure': 1, 'cleanup': 2, 'activate': 3}.items()),
    Fault('parameter of unknown type', with_parameter('law', lambda: ParameterValue(type=77)), 1.0),
    Fault('/clock before zero', clock_before_zero, 1.0, simulated=True),
    Fault('model file is a pipe', with_model(os.mkfifo), 1.0),
    Fault('model file of 1.8 MB', with_model(lambda path: path.write_text(
        MODEL + 'notes:\n' + ''.join(f'  n{k}: {80 * "x"}\n' for k in range(20_000)))), 1.0),
    Fault('model with 99.5 A of breakaway', with_model(
        lambda path: path.write_text(MODEL.replace('mean: 0.0995', 'mean: 99.5'))), 1.0),
)


if __name__ == '__main__':
    main()
