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
from pathlib import Path
import signal
import tempfile
import time
from typing import NamedTuple

from bench_tools import table_parser
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
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
            go_on()
            if rig.current == 0.0:
                delay = delay if delay is not None else time.monotonic() - begin
            elif delay is not None:
                return False, 0.0
        return delay is not None and delay <= fault.within, delay or 0.0


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


def deactivated(rig):
    """Ask for the transition while there is a current."""
    client = rig.probe.create_client(ChangeState, '/compensator/change_state')
    rig.probe.until(client.service_is_ready, 'the service', 10.0)
    rig.drive()
    client.call_async(ChangeState.Request(
        transition=Transition(id=Transition.TRANSITION_DEACTIVATE)))
    return rig.send


class Fault(NamedTuple):
    """A fault: the current must be zero `within` s. Where `led`, d comes from a leader."""

    name: str
    begin: Callable
    within: float = TIMEOUT + SLACK
    simulated: bool = False
    led: bool = False


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
    Fault('deactivated', deactivated, 0.5),
    Fault('leader falls silent', lambda rig: rig.send, LED, led=True),
    Fault('leader is not a number', lambda rig: partial(rig.lead, float('nan')), LED, led=True),
    Fault('leader stands still', lambda rig: partial(rig.lead, leader_place()), LED, led=True),
    *(Fault(f'{name} to direction', signalled(name, 'source', 'lead'), within + SLACK, led=True)
      for name, within in {'SIGTERM': TIMEOUT, 'SIGKILL': 0.5, 'SIGSTOP': 0.5}.items()),
)


if __name__ == '__main__':
    main()
