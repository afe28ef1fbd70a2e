# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A ROS node within the tests that observes nodes in other processes, and feeds them."""

from array import array
from contextlib import contextmanager, ExitStack
import os
import random
import time

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.srv import ChangeState, GetState
from node_process import PATIENCE, Process, ROOT
import numpy as np
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import GetParameters, SetParameters
import rclpy
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int8MultiArray

from friction_comp.demo.processes import leased_domain
from friction_comp.ros.joint_io import UNASKED
from friction_comp.ros.ros_start import start_ros

CONFIG = ROOT / 'config'
MODELS = [str(CONFIG / f'armin_configuration_{k}.yaml') for k in (1, 2, 3)]
# Two joints under a compensator. What is not about time is not to fail for want of it.
JOINTS = ['elbow', 'shoulder']
START = {'joints': JOINTS, 'model_files': MODELS[:2], 'joint_state_timeout': 10.0,
         'direction_timeout': 60.0, 'law': 'paper', 'input_reliability': 'reliable'}
# What tests change of it while it runs; what `START` leaves out begins at the node's default.
CHANGED = {'breakaway_gain': 0.9, 'current_limit': 1000.0, 'accept_record_again': False,
           **{name: START[name] for name in ('law', 'direction_timeout', 'model_files')}}
ZERO = [0.0, 0.0]
RELIABLE = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)

os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
# Each process that runs tests has a domain that nobody else has, for as long as it lives.
_SESSION = ExitStack()
os.environ['ROS_DOMAIN_ID'] = str(_SESSION.enter_context(leased_domain()))


@contextmanager
def own_domain():
    """Isolate nodes that are started in the block, in a ROS domain of their own."""
    before = os.environ['ROS_DOMAIN_ID']
    with leased_domain() as number:
        os.environ['ROS_DOMAIN_ID'] = str(number)
        try:
            yield
        finally:
            os.environ['ROS_DOMAIN_ID'] = before


class Probe(Node):
    """A node that publishes and subscribes for a test."""

    def __init__(self, context):
        super().__init__(f'probe_{random.randrange(10**9)}', context=context)
        self._executor_ = SingleThreadedExecutor(context=context)
        self._executor_.add_node(self)
        self.heard = {}
        self.subscribers = {}
        self._published = {}
        self._servers = {}

    def listen(self, kind, topic, qos=RELIABLE):
        self.heard.setdefault(topic, [])
        self.subscribers[topic] = self.create_subscription(
            kind, topic, self.heard[topic].append, qos)
        return self.heard[topic]

    def talk(self, kind, topic, qos=RELIABLE):
        self._published[topic] = self.create_publisher(kind, topic, qos)
        return self._published[topic]

    def until(self, condition, what, timeout=PATIENCE):
        """Spin until the condition holds; fail after the timeout."""
        end = time.monotonic() + timeout
        while not condition():
            assert time.monotonic() < end, f'not within {timeout} s: {what}'
            self._executor_.spin_once(timeout_sec=0.05)

    def spin_for(self, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._executor_.spin_once(timeout_sec=max(0.0, end - time.monotonic()))

    def matched(self, publisher):
        self.until(publisher.get_subscription_count,
                   f'{publisher.topic_name} finds its subscription')

    def complete(self, future, what):
        self.until(future.done, what)
        return future.result()

    def answered(self, send, what, each=5.0, timeout=PATIENCE):
        """Return the response to a request that may be sent repeatedly.

        A response is lost if it is sent before both ends have discovered each other.
        """
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            future, again = send(), min(end, time.monotonic() + each)
            while not future.done() and time.monotonic() < again:
                self._executor_.spin_once(timeout_sec=0.05)
            if future.done():
                return future.result()
        raise AssertionError(f'not within {timeout} s: {what}')

    def _client(self, kind, name):
        """Return a client that has found its server; there is one for each service."""
        if name not in self._servers:
            self._servers[name] = self.create_client(kind, name)
        self.until(self._servers[name].service_is_ready, f'service {name}')
        return self._servers[name]

    def call(self, kind, name, request):
        """Call a service that may be called repeatedly, and return its response."""
        client = self._client(kind, name)
        return self.answered(lambda: client.call_async(request), f'answer of {name}')

    def set_parameter(self, node, name, value):
        """Return None if the value was accepted, otherwise the reason."""
        request = SetParameters.Request(parameters=[ParameterMessage(
            name=name, value=Parameter(name, value=value).get_parameter_value())])
        result = self.call(SetParameters, f'/{node}/set_parameters', request).results[0]
        return None if result.successful else result.reason

    def get_parameters_of(self, node, names):
        reply = self.call(
            GetParameters, f'/{node}/get_parameters', GetParameters.Request(names=names))
        return [rclpy.parameter.parameter_value_to_python(value) for value in reply.values]

    def get_parameter_of(self, node, name):
        return self.get_parameters_of(node, [name])[0]

    def begin_transition(self, node, label):
        """Ask a node for a transition, once; return the future of its answer."""
        name = f'/{node}/change_state'

        def ask(what):
            request = ChangeState.Request()
            request.transition.label = what
            return self._client(ChangeState, name).call_async(request)
        # What is refused shows first that answers arrive.
        self.answered(lambda: ask('nothing'), f'answer of {name}')
        return ask(label)

    def transition(self, node, label):
        return self.complete(self.begin_transition(node, label), f'{label} {node}').success

    def state_of(self, node):
        return self.call(GetState, f'/{node}/get_state', GetState.Request()).current_state.label

    def status_of(self, node, condition=lambda status: True):
        """Wait for a diagnostic status of the node that meets the condition, and return it."""
        messages = self.heard.get('/diagnostics')
        if messages is None:
            messages = self.listen(DiagnosticArray, '/diagnostics')
        found = []

        def look():
            for message in messages:
                found.extend(s for s in message.status
                             if s.name.partition(':')[0] == node and condition(s))
            messages.clear()
            return found
        self.until(look, f'diagnostics of {node}')
        return found[-1]

    def all_heard(self, topic):
        """Wait until nobody publishes on a topic any more; return all messages heard there."""
        self.until(lambda: not self.subscribers[topic].get_publisher_count(), f'the end of {topic}')
        count = -1
        while count != len(self.heard[topic]):
            count = len(self.heard[topic])
            self.spin_for(0.2)
        return self.heard[topic]

    def close(self):
        self._executor_.shutdown()
        self.destroy_node()


@contextmanager
def probe_node():
    context = Context()
    start_ros('probe', (), context)
    node = Probe(context)
    try:
        yield node
    finally:
        node.close()
        rclpy.try_shutdown(context=context)


def joint_state(stamp_ns, names, position, velocity=None, effort=None):
    message = JointState(name=list(names), position=array('d', position))
    message.velocity = array('d', [0.0] * len(names) if velocity is None else velocity)
    message.effort = array('d', [0.0] * len(names) if effort is None else effort)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(int(stamp_ns), 10**9)
    return message


def tick(stamp_ns):
    """Return a message of /clock."""
    message = Clock()
    message.clock.sec, message.clock.nanosec = divmod(stamp_ns, 10**9)
    return message


class Goals:
    """An action client that waits with patience, and keeps the feedback of its last goal."""

    def __init__(self, probe, kind, name, refused):
        self.probe, self.feedback, self._kind = probe, [], kind
        self._client = ActionClient(probe, kind, name)
        probe.until(self._client.server_is_ready, f'the server of {name}')
        # The answer to a goal that is refused shows that both ends are connected.
        handle = probe.answered(lambda: self.send(**refused), 'answer to the first goal')
        assert not handle.accepted

    def send(self, **goal):
        """Send a goal and return the future of its handle."""
        self.feedback.clear()
        return self._client.send_goal_async(
            self._kind.Goal(**goal), lambda message: self.feedback.append(message.feedback))

    def ask(self, **goal):
        """Send a goal once and return its handle."""
        return self.probe.complete(self.send(**goal), 'answer to the goal')

    def begin(self, meanwhile=lambda: None, **goal):
        """Send a goal until it is accepted: the server must have found the joint first."""
        sent = [self.send(**goal)]

        def accepted():
            meanwhile()
            if sent[-1].done() and not sent[-1].result().accepted:
                sent.append(self.send(**goal))
            return sent[-1].done() and sent[-1].result().accepted
        self.probe.until(accepted, 'an accepted goal')
        return sent[-1].result()

    def result(self, handle, timeout=PATIENCE):
        return self.probe.answered(handle.get_result_async, 'the result', 20.0, timeout)

    def cancel(self, handle):
        """Cancel a goal and return its result."""
        answer = self.probe.complete(handle.cancel_goal_async(), 'answer to the cancellation')
        assert len(answer.goals_canceling) == 1
        return self.result(handle)

    def close(self):
        self._client.destroy()


class FakeDriver:
    """Replaces plant and exercise for a compensator: the test publishes states and directions.

    Every new joint state is answered by one command, in order. Zeros that the commander sends
    without a state are received, too, but are not answers.
    """

    def __init__(self, probe, joints, qos=RELIABLE):
        self.probe, self.joints = probe, joints
        self.states = probe.talk(JointState, 'joint_states', qos)
        self.directions = probe.talk(Int8MultiArray, 'direction', qos)
        self.commands = probe.listen(Float64MultiArray, 'current_command')

    @property
    def answers(self):
        return self._answers_from(0)

    def _answers_from(self, number):
        """Return the answers among the commands from index `number` on."""
        return [message for message in self.commands[number:] if not unasked(message)]

    def find(self, stamp=time.time_ns, direction=None):
        """Stream states until commands come or, with a direction, until they are large.

        Only then both ends have discovered each other.
        """
        self.probe.matched(self.states)
        self.probe.matched(self.directions)
        zeros = [0.0] * len(self.joints)

        def streamed():
            if direction:
                self.announce(direction)
            self.states.publish(joint_state(stamp(), self.joints, zeros))
            self.probe.spin_for(0.02)
            return self.commands and (
                direction is None or min(np.abs(self.commands[-1].data)) > 0.05)
        self.probe.until(streamed, 'a command')

    def rest(self):
        """Deactivate the node and wait for its zero command, and until its publisher is gone."""
        if self.probe.state_of('compensator') == 'active':
            assert self.probe.transition('compensator', 'deactivate')
            self.probe.until(lambda: self.commands and unasked(self.commands[-1])
                             and not self.commanders, 'a last command')
            assert not any(self.commands[-1].data)
        self.probe.until(lambda: not self.commanders, 'no publisher of current_command')

    @property
    def commanders(self):
        """Number of commanders to which this node is connected."""
        return self.probe.subscribers['current_command'].get_publisher_count()

    def activate(self):
        """Activate the node and wait until its commands can be received."""
        assert self.probe.transition('compensator', 'activate')
        self.probe.until(lambda: self.commanders == 1, 'a publisher of current_command')

    def begin_anew(self):
        """Restart the node without history; from then on each state has its answer."""
        self.rest()
        self.activate()
        self.commands.clear()

    def restore(self):
        """Reset the node, which was started with `START`, whatever a test has done with it."""
        self.probe.heard.get('/diagnostics', []).clear()
        if self.probe.state_of('compensator') == 'unconfigured':
            assert self.probe.transition('compensator', 'configure')
        now = self.probe.get_parameters_of('compensator', list(CHANGED))
        for (name, value), changed in zip(CHANGED.items(), now):
            if changed != value:
                assert self.probe.set_parameter('compensator', name, value) is None
        self.begin_anew()

    def announce(self, values):
        # Ahead of the states that follow: one process's messages arrive in order.
        self.directions.publish(Int8MultiArray(data=array('b', values)))

    def ask(self, position, velocity=None, stamp=None, names=None):
        """Publish one joint state and return the command that answers it."""
        before = len(self.commands)
        stamp = time.time_ns() if stamp is None else stamp
        self.states.publish(joint_state(stamp, names or self.joints, position, velocity))
        self.probe.until(lambda: self._answers_from(before), 'a command for the joint state')
        return list(self._answers_from(before)[0].data)


@contextmanager
def compensator(folder, direction=None, **parameters):
    """Start a compensator of two joints, and yield the replacement of its driver."""
    with own_domain(), probe_node() as probe, Process(
            folder, 'compensator', {**START, **parameters}) as process:
        driver = FakeDriver(probe, JOINTS)
        driver.process = process
        driver.find(direction=direction)
        yield driver


def value_of(status, key):
    """Return a diagnostic status's value of a key, or None."""
    return next((item.value for item in status.values if item.key == key), None)


def unasked(command):
    """Return whether a command does not answer a joint state."""
    return any(part.label == UNASKED for part in command.layout.dim)
