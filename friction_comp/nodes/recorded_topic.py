# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Subscribes to one topic without losing its first messages, and counts lost messages."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from friction_comp.recordings.writer import qos_profile

# Length of the queue: ten seconds at a kilohertz.
DEPTH = 10_000
# Messages remembered to detect duplicates, with several subscriptions and with one: a second one
# may receive earlier messages of a publisher.
_MAX_SEEN, _MAX_SEEN_SINGLE = 2 * DEPTH, 2_000

Offer = tuple[ReliabilityPolicy, DurabilityPolicy]
_BEST_EFFORT: Offer = (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE)
_RELIABLE: Offer = (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE)
_LASTING: Offer = (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)


class RecordedTopic:
    """Subscribes to a topic with the quality of service (QoS) of its publishers.

    Their QoS is known only after discovery, and messages may arrive earlier: the first subscription
    is reliable. If another QoS fits the publishers better, a second subscription is added, and
    duplicates are removed.

    Each publisher numbers its messages, but a message does not name its publisher: a number that
    continues no sequence belongs to a publisher that has not been heard, if there is one, and else
    follows lost messages.

    Parameters
    ----------
    node : rclpy.node.Node
    kind : type
        Message class.
    topic : str
    take : callable
        Called with the serialised message and the middleware's message info.
    sender : callable, optional
        Returns the sender of a serialised message, for topics with many publishers.

    Attributes
    ----------
    name : str
        Resolved name of the topic.
    lost : int
        Number of lost messages.
    """

    def __init__(self, node: Node, kind: Any, topic: str,
                 take: Callable[[bytes, dict[str, Any]], None],
                 sender: Callable[[bytes], str] | None = None) -> None:
        self.name = node.resolve_topic_name(topic)
        self.lost = 0
        self._node, self._kind, self._topic, self._take = node, kind, topic, take
        self._sender = sender
        self._subscriptions: dict[Offer, Any] = {}
        # In the order of arrival; only the keys are used.
        self._seen: dict[tuple[int, int], None] = {}
        # Numbers of the next messages, by sender.
        self._expected: defaultdict[str, set[int]] = defaultdict(set)
        self._publishers: frozenset[tuple[bytes, Offer]] = frozenset()
        self._subscribe(_RELIABLE)

    def _subscribe(self, offer: Offer) -> None:
        def take(message: bytes, info: dict[str, Any]) -> None:
            self._receive(message, info)
            # The executor takes one message per poll of all entities.
            self._drain(self._subscriptions[offer])
        self._subscriptions[offer] = self._node.create_subscription(
            self._kind, self._topic, take, QoSProfile(
                depth=DEPTH, reliability=offer[0], durability=offer[1]), raw=True)

    @property
    def publishers(self) -> int:
        """Number of connected publishers."""
        return max(subscription.get_publisher_count()
                   for subscription in self._subscriptions.values())

    def check_publishers(self) -> None:
        """Check the publishers, and subscribe with a QoS that fits them."""
        publishers = frozenset(
            (bytes(info.endpoint_gid),
             (info.qos_profile.reliability, info.qos_profile.durability))
            for info in self._node.get_publishers_info_by_topic(self.name))
        if publishers == self._publishers:
            return
        self._publishers = publishers
        # A publisher that came or went explains a gap.
        self._expected.clear()
        offers = {offer for _, offer in publishers}
        if any(reliability != ReliabilityPolicy.RELIABLE for reliability, _ in offers):
            best = _BEST_EFFORT
        else:
            best = _LASTING if offers == {_LASTING} else _RELIABLE
        if best not in self._subscriptions:
            self._subscribe(best)

    def offered(self) -> list[dict[str, Any]]:
        """Return the publishers' QoS for a recording; empty if unknown."""
        self.check_publishers()
        return [qos_profile(reliability.name.lower(), durability.name.lower())
                for reliability, durability in sorted({offer for _, offer in self._publishers})]

    def drain(self) -> None:
        """Process all messages that have arrived."""
        for subscription in list(self._subscriptions.values()):
            self._drain(subscription)

    def _drain(self, subscription: Any) -> None:
        with subscription.handle:
            for _ in range(DEPTH):
                message = subscription.handle.take_message(self._kind, True)
                if message is None:
                    return
                self._receive(*message)

    def _receive(self, message: bytes, info: dict[str, Any]) -> None:
        sequence = info['publication_sequence_number'] or 0
        key = info['source_timestamp'], sequence
        if key in self._seen:
            return
        self._seen[key] = None
        limit = _MAX_SEEN if len(self._subscriptions) > 1 else _MAX_SEEN_SINGLE
        while len(self._seen) > limit:
            del self._seen[next(iter(self._seen))]
        if sequence:
            self._count_lost(self._sender(message) if self._sender else '', sequence)
        self._take(message, info)

    def _count_lost(self, sender: str, sequence: int) -> None:
        if sequence not in self._expected[sender]:
            self.check_publishers()
        expected = self._expected[sender]
        if sequence in expected:
            expected.remove(sequence)
        elif len(expected) >= (1 if sender else len(self._publishers)):
            before = max((number for number in expected if number < sequence), default=None)
            if before is not None:
                self.lost += sequence - before
                expected.remove(before)
        expected.add(sequence + 1)
