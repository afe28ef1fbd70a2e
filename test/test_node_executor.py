# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The executor of all nodes: the order of messages, and changes while it runs."""

import subprocess
import sys
import time

from node_process import PATIENCE, Process
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from ros_system import own_domain, probe_node, RELIABLE, START
from std_msgs.msg import Int32
from std_srvs.srv import Trigger

from friction_comp.errors import InputError
from friction_comp.ros.node_main import StreamExecutor


class Listener(Node):
    """Notes what it hears, in order."""

    def __init__(self, context, batch_time):
        super().__init__('listener', context=context)
        self.heard, self.batch_time = [], batch_time
        for topic in ('first', 'second'):
            self.create_subscription(
                Int32, topic, lambda m, topic=topic: self.hear(topic, m), RELIABLE)
        self.create_service(Trigger, 'ask', self.answer)

    def hear(self, topic, message):
        self.heard.append((topic, message.data))

    def answer(self, _, response):
        response.message = 'heard'
        return response


@pytest.fixture
def room(request):
    with own_domain(), probe_node() as probe:
        context = Context()
        rclpy.init(context=context)
        node = Listener(context, getattr(request, 'param', 0.0))
        executor = StreamExecutor(node)
        probe.talk(Int32, 'first', RELIABLE)
        probe.talk(Int32, 'second', RELIABLE)
        for publisher in probe._published.values():
            probe.matched(publisher)
        try:
            yield probe, node, executor
        finally:
            executor.shutdown()
            node.destroy_node()
            rclpy.try_shutdown(context=context)


def until(executor, condition, meanwhile=lambda: None):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        meanwhile()
        executor.spin_once(0.01)


@pytest.mark.parametrize('room', [0.0, 0.005], ids=['at once', 'in handfuls'], indirect=True)
def test_messages_of_earlier_subscriptions_are_processed_first(room):
    probe, node, executor = room
    for k in range(20):
        node.heard.clear()
        for topic, number in (('second', k), ('first', k), ('first', k + 1)):
            probe._published[topic].publish(Int32(data=number))
        # All messages have arrived before the node processes any.
        assert all(one.wait_for_all_acked(rclpy.duration.Duration(seconds=PATIENCE))
                   for one in probe._published.values())
        until(executor, lambda: len(node.heard) == 3)
        assert node.heard == [('first', k), ('first', k + 1), ('second', k)]


def test_subscriptions_may_come_and_go_in_a_callback(room):
    probe, node, executor = room
    added = []

    def change(message):
        node.heard.append(('third', message.data))
        node.destroy_subscription(added.pop())
    third = probe.talk(Int32, 'third', RELIABLE)
    for k in range(3):
        added.append(node.create_subscription(Int32, 'third', change, RELIABLE))
        until(executor, lambda: third.get_subscription_count() == 1)
        third.publish(Int32(data=k))
        until(executor, lambda k=k: ('third', k) in node.heard)
        until(executor, lambda: third.get_subscription_count() == 0)
    probe._published['second'].publish(Int32(data=7))
    until(executor, lambda: ('second', 7) in node.heard)


def asked(room, name, meanwhile=lambda: None):
    """Return a node's answer to a service."""
    probe, _, executor = room
    client = probe.create_client(Trigger, name)
    probe.until(client.service_is_ready, 'the service')
    future = client.call_async(Trigger.Request())
    until(executor, future.done, lambda: (meanwhile(), probe.spin_for(0.002)))
    return future.result()


def test_services_and_callbacks_that_wait_go_on_beside_the_messages(room):
    probe, node, executor = room

    async def later(message):
        node.heard.append(('later', message.data))
    node.create_subscription(Int32, 'first', later, RELIABLE)
    first = probe._published['first']
    until(executor, lambda: first.get_subscription_count() == 2)
    assert asked(room, 'ask', lambda: first.publish(Int32(data=1))).message == 'heard'
    first.publish(Int32(data=-1))
    until(executor, lambda: {('first', -1), ('later', -1)} <= set(node.heard))


def test_what_raises_an_error_is_refused_and_the_next_is_processed(room):
    probe, node, executor = room
    hear = node.hear

    def fail(*_):
        raise ZeroDivisionError('as if')
    node.hear = lambda topic, message: hear(topic, message) if message.data else fail()
    node.create_service(Trigger, 'fail', fail)
    for number in (0, 1):
        probe._published['first'].publish(Int32(data=number))
    # Bytes that are no message of the type.
    probe._published['second'].publish(b'\x00\x01\x00\x00\x01')
    until(executor, lambda: node.heard == [('first', 1)])
    answer = asked(room, 'fail')
    assert not answer.success
    assert 'as if' in answer.message
    probe._published['second'].publish(Int32(data=2))
    until(executor, lambda: node.heard[-1] == ('second', 2))


def test_a_node_that_cannot_go_on_ends(room):
    """As a recorder whose disk is full."""
    probe, node, executor = room

    def fail(*_):
        raise InputError('the disk is full')
    node.hear = fail
    probe._published['first'].publish(Int32(data=1))
    with pytest.raises(InputError):
        until(executor, lambda: False)


@pytest.mark.parametrize('room', [0.0, 0.005], ids=['at once', 'in handfuls'], indirect=True)
def test_streams_go_on_beside_work_that_takes_long(room):
    probe, node, executor = room

    def work():
        until_heard = time.monotonic() + PATIENCE
        while not node.heard and time.monotonic() < until_heard:
            time.sleep(0.01)
        return len(node.heard)

    def fail():
        raise ZeroDivisionError('as if')
    probe._published['first'].publish(Int32(data=1))
    assert executor.do_beside(work, 'work') == 1
    with pytest.raises(InputError, match='as if'):
        executor.do_beside(fail, 'work')


WRITER = """
import time
from rclpy.duration import Duration
from std_msgs.msg import Int8MultiArray
from friction_comp.ros.joint_io import RELIABLE
from friction_comp.ros.ros_start import own_node
with own_node('planner') as node:
    publisher = node.create_publisher(Int8MultiArray, 'direction', RELIABLE)
    while not publisher.get_subscription_count():
        time.sleep(0.02)
    for _ in range(3):
        publisher.publish(Int8MultiArray())
        assert publisher.wait_for_all_acked(Duration(seconds=2.5))
"""


def test_a_publisher_soon_asks_whether_a_message_was_lost(tmp_path):
    """By default only every three seconds, and what follows a lost message waits until then."""
    with own_domain(), Process(tmp_path, 'compensator', START):
        subprocess.run([sys.executable, '-c', WRITER], check=True, timeout=PATIENCE)
