# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The executor of all nodes: the order of messages, and work beside them."""

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

from friction_comp.errors import InputError
from friction_comp.ros.node_main import StreamExecutor


class Listener(Node):
    """Notes what it hears, in order."""

    def __init__(self, context, batch_time):
        super().__init__('listener', context=context)
        self.heard, self.batch_time = [], batch_time
        for topic in ('first', 'second'):
            self.create_subscription(Int32, topic, lambda message, topic=topic: self.heard.append(
                (topic, message.data)), RELIABLE)


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
        end = time.monotonic() + PATIENCE
        while len(node.heard) < 3 and time.monotonic() < end:
            executor.spin_once(0.01)
        assert node.heard == [('first', k), ('first', k + 1), ('second', k)]


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
