# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Whatever happens to a compensator, in whatever order: the motor's current is never in doubt.

The compensator's loop as the node has it, with its law, its port and its watchdog, on clocks that
the test moves; what the motor would see is held against rules that know nothing of the loop.
"""

from array import array
from types import SimpleNamespace

from hypothesis import HealthCheck, settings, strategies as st
from hypothesis.stateful import (
    initialize,
    invariant,
    precondition,
    rule,
    RuleBasedStateMachine,
    run_state_machine_as_test,
)
import numpy as np
from ros_system import joint_state, MODELS

from friction_comp.compensation.law import CompensationLaw
from friction_comp.control.compensation_loop import CompensationLoop
from friction_comp.control.faults import Faults
from friction_comp.model.friction_model import FrictionModel
from friction_comp.ros.joint_io import CommandPort

JOINTS = ['elbow', 'shoulder']
MODEL = [FrictionModel.load(path) for path in MODELS]
TIMEOUT = 50_000_000
NANO = 1_000_000_000
SILENT = SimpleNamespace(**dict.fromkeys(('info', 'warning', 'error'), lambda text: None))
ODD = st.sampled_from([float('nan'), float('inf'), -float('inf'), 1e300, -1e300, 5e-324])


class Surroundings:
    """What a port asks of its node, and the motor at the other end."""

    def __init__(self):
        self.context = SimpleNamespace(ok=lambda: True)
        self.others, self.motor, self.sent = 0, [0.0, 0.0], 0
        self.publisher = None
        self.limits = lambda: [1e9, 1e9]

    def resolve_topic_name(self, name):
        return name

    def create_publisher(self, *_):
        self.publisher = SimpleNamespace(
            publish=self._publish, get_subscription_count=lambda: 1,
            wait_for_all_acked=lambda _: True)
        return self.publisher

    def destroy_publisher(self, publisher):
        assert publisher is self.publisher
        self.publisher = None

    def _publish(self, message):
        assert self.publisher is not None
        assert isinstance(message.data, array)
        assert len(message.data) == len(JOINTS)
        self.motor, self.sent = list(message.data), self.sent + 1
        for value, limit in zip(self.motor, self.limits()):
            assert np.isfinite(value)
            assert abs(value) <= limit
            assert value == 0.0 or abs(value) > 1e-15, 'no denormal numbers'

    def count_subscribers(self, _):
        return 1


class Motor(RuleBasedStateMachine):
    """Events at a compensator, and what must hold after each."""

    def __init__(self):
        super().__init__()
        self.steady = 100.0
        self.ros = 1_000 * NANO
        self.clock_runs = True
        self.active = self.gone = self.latched = False
        self.newest, self.heard = None, None
        self.stamp = self.ros
        self.usable = [False, False]
        self.limit = 1000.0
        self.ends = []
        self.alone = 0.0

    @initialize(law=st.sampled_from(['continuous', 'paper']))
    def begin(self, law):
        self.around = Surroundings()
        self.law = CompensationLaw(MODEL[:2], law)
        self.port = CommandPort(self.around, [0.0, 0.0], [1.0, 1.0])
        self.loop = CompensationLoop(
            JOINTS, self.law, self.port, Faults(SILENT, clock=self.now), TIMEOUT, 0.5,
            clock=self.now)
        self.inputs = self.loop.inputs
        self.around.limits = lambda: self.port.limits
        self.change_limit(1000.0)
        self.activate()

    def now(self):
        return self.steady

    def pass_time(self, seconds):
        """Let time go by; the watchdog's thread wakes when it asked to."""
        end = self.steady + seconds
        while True:
            left = self.inputs.watchdog.check()
            if left is None or self.steady + left > end:
                break
            self.steady += max(left, 1e-6)
        if self.clock_runs:
            self.ros += round((end - self.steady) * NANO) if end > self.steady else 0
        self.steady = max(self.steady, end)
        self.inputs.watchdog.check()

    # Lifecycle transitions.

    @precondition(lambda self: not self.active and not self.gone)
    @rule()
    def activate(self):
        self.loop.activate(['/somebody'] if self.around.others else [])
        self.port.open()
        self.port._discovered = True
        self.active, self.latched, self.newest, self.heard = True, False, None, None
        self.alone = None

    @precondition(lambda self: self.active)
    @rule()
    def deactivate(self):
        self.loop.stop()
        self.port.close()
        self.active = False

    @rule(chance=st.integers(0, 7), speed=st.floats(0.1, 2.0))
    def end_by_signal(self, chance, speed):
        # Rarely: nothing can happen after it.
        if chance == 7:
            self.port.zero(permanent=True)
            self.gone = True
            self.stream(3, speed, True)

    @rule(seconds=st.sampled_from([0.0005, 0.001, 0.004, 0.02, 0.049, 0.051, 0.2, 1.5, 4.0]))
    def wait(self, seconds):
        self.pass_time(seconds)

    @rule(runs=st.booleans())
    def stop_or_start_the_clock(self, runs):
        self.clock_runs = runs

    @rule(seconds=st.sampled_from([-3600.0, -0.06, -0.01, 0.01, 0.06, 3600.0]))
    def set_the_clock(self, seconds):
        self.ros = max(NANO, self.ros + round(seconds * NANO))

    # Messages.

    def send(self, stamp, names, position, velocity):
        self.loop.take(
            joint_state(stamp, names, position, velocity, []), self.ros, self.ros, self.ros)

    @rule(count=st.integers(1, 30), speed=st.floats(-2.0, 2.0), moves=st.booleans())
    def stream(self, count, speed, moves):
        """A driver as it should be."""
        for _ in range(count):
            self.pass_time(0.001)
            self.stamp = self.ros if self.clock_runs else self.stamp + 1_000_000
            x = 0.001 * speed * self.ros * 1e-6 if moves else 0.0
            self.deliver(self.stamp, JOINTS, [x, -x], [speed, -speed] if moves else [0.0, 0.0])

    def deliver(self, stamp, names, position, velocity):
        before = self.newest
        fresh = abs(self.ros - stamp) <= TIMEOUT
        later = before is None or stamp > before or before - stamp > TIMEOUT
        lengths = len(position) == len(names) and len(velocity) in (0, len(names))
        # One that waits until it is alone takes no note of states.
        attends = self.active and not self.loop.yields
        if attends and fresh and lengths and (later or stamp == 0):
            self.newest = stamp if names == JOINTS else before
            self.heard = self.steady
            values = dict(zip(names, position))
            self.usable = [np.isfinite(values.get(joint, np.nan)) or names != JOINTS
                           for joint in JOINTS]
        self.send(stamp, names, position, velocity)

    @rule(age=st.sampled_from([-3600.0, -0.1, -0.04, -0.001, 0.0, 0.001, 0.003, 0.04, 0.06, 5.0]))
    def state_of_another_time(self, age):
        self.deliver(max(1, self.ros - round(age * NANO)), JOINTS, [0.1, 0.1], [0.0, 0.0])

    @precondition(lambda self: self.newest)
    @rule(count=st.integers(1, 20))
    def the_same_state_again(self, count):
        for _ in range(count):
            self.pass_time(0.004)
            self.send(self.newest, JOINTS, [0.1, 0.1], [0.0, 0.0])

    @rule(position=st.lists(ODD | st.just(0.2), min_size=2, max_size=2),
          velocity=st.lists(ODD | st.just(0.2), min_size=2, max_size=2))
    def odd_numbers(self, position, velocity):
        self.pass_time(0.001)
        self.deliver(self.ros, JOINTS, position, velocity)

    @rule(count=st.integers(0, 4), other=st.integers(0, 4))
    def odd_lengths(self, count, other):
        self.pass_time(0.001)
        self.deliver(self.ros, JOINTS, [0.1] * count, [0.1] * other)

    @rule(names=st.sampled_from([['elbow'], ['shoulder'], ['wrist'], [], ['wrist', 'elbow']]))
    def some_joints(self, names):
        self.pass_time(0.001)
        self.deliver(self.ros, names, [0.1] * len(names), [0.0] * len(names))

    @rule(values=st.lists(st.integers(-128, 127) | st.sampled_from([-1, 0, 1]), max_size=3))
    def direction(self, values):
        self.inputs.take_direction(array('b', values), self.ros)

    @rule(values=st.lists(ODD | st.sampled_from([-1.0, 0.0, 1.0]), min_size=2, max_size=2),
          age=st.sampled_from([-10.0, 0.0, 0.1, 10.0]))
    def stamped_direction(self, values, age):
        self.inputs.take_stamped_direction(
            JOINTS, values, max(0, self.ros - round(age * NANO)), self.ros)

    # Parameters, models, faults.

    @rule(law=st.sampled_from(['continuous', 'paper', 'kinetic', 'none']),
          gain=st.floats(0.0, 1.0))
    def tune(self, law, gain):
        self.loop.retune(law, gain, self.limit)

    @rule(limit=st.sampled_from([0.0, 0.02, 0.05, 1000.0]))
    def change_limit(self, limit):
        self.limit = limit
        self.loop.retune('continuous', 0.9, limit)
        assert self.port.limits == [min(m.drive.current_limit, limit) for m in self.law.models]

    @rule(joint=st.integers(0, 1), number=st.integers(0, 2))
    def change_model(self, joint, number):
        models = list(self.law.models)
        models[joint] = MODEL[number]
        self.loop.set_models(models)

    @rule(kind=st.sampled_from(['raises', 'nan', 'huge', 'slow']))
    def law_fails(self, kind):
        """For one state."""
        law, good = self.law, self.law.update

        def bad(*arguments):
            if kind == 'raises':
                raise FloatingPointError('as if')
            values = np.array(good(*arguments))
            if kind == 'slow':
                self.pass_time(0.3)
                return values
            return values * np.nan if kind == 'nan' else values + 1e6
        law.update = bad
        before = self.around.sent
        try:
            # In motion, where the law commands a current.
            self.pass_time(0.001)
            self.deliver(self.ros, JOINTS, [0.1, 0.1], [0.5, 0.5])
        finally:
            del law.update
        if kind in ('raises', 'nan') and self.heard == self.steady and self.active \
                and not self.gone and not self.loop.yields and self.around.sent > before:
            self.latched = True

    @rule()
    def reset_faults(self):
        if self.loop.reset_faults():
            # After a fault, a commander that appears is waited for first, as at the start.
            self.alone = None
        self.latched = False

    @rule(there=st.booleans(), seconds=st.sampled_from([0.1, 3.5]))
    def another_commander(self, there, seconds):
        self.pass_time(seconds)
        self.around.others = int(there)
        if self.active:
            self.loop.supervise(['/somebody'] if there else [])
            if there and self.alone is not None and self.steady - self.alone > 3.0:
                self.latched = True
            self.alone = None if there else (self.alone or self.steady)

    # Invariants.

    @invariant()
    def zero_when_nobody_stands_behind_it(self):
        motor = getattr(self, 'around', None) and self.around.motor
        if not motor:
            return
        silent = self.heard is None or self.steady - self.heard > TIMEOUT / NANO
        if not self.active or self.gone or silent or self.latched or self.loop.yields:
            assert motor == [0.0, 0.0]
        for value, usable in zip(motor, self.usable):
            assert usable or value == 0.0
        if self.active and self.around.others:
            assert motor == [0.0, 0.0]

    def teardown(self):
        if hasattr(self, 'loop'):
            self.pass_time(1.0)
            assert self.around.motor == [0.0, 0.0]


def test_the_current_is_zero_or_that_of_the_law_after_any_events():
    """Some thousands of events."""
    run_state_machine_as_test(Motor, settings=settings(
        max_examples=60, stateful_step_count=100, suppress_health_check=list(HealthCheck)))
