# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Subscribes to one topic without losing its first messages, and counts lost messages."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from friction_comp.nodes.losses import Losses
from friction_comp.recordings.writer import qos_profile

# Length of the queue: ten seconds at a kilohertz.
DEPTH = 10_000
# Messages remembered to detect duplicates.
_MAX_SEEN = 2 * DEPTH
# The same with one subscription: a second one may receive earlier messages of a publisher.
_MAX_SEEN_SINGLE = 2_000
# Checks after which a message of one subscription must have arrived at the other.
_CONFIRMING_CHECKS = 5

Offer = tuple[ReliabilityPolicy, DurabilityPolicy]
_BEST_EFFORT: Offer = (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE)
_RELIABLE: Offer = (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE)
_LASTING: Offer = (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)
_ONLY = {offer: frozenset((offer,)) for offer in (_BEST_EFFORT, _RELIABLE, _LASTING)}


class RecordedTopic:
    """Subscribes to a topic with the quality of service (QoS) of its publishers.

    Their QoS is known only after discovery, and messages may arrive earlier: the first subscription
    is reliable. If another QoS fits the publishers better, a second subscription is created, and
    duplicates are removed. Since publishers may discover the second subscription much later, the
    first one is destroyed only when the second has received all messages for a while.

    Parameters
    ----------
    node : rclpy.node.Node
    kind : type
        Message class.
    topic : str
    take : callable
        Called with the serialised message and the middleware's message info.
    sender : callable, optional
        Returns the sender of a serialised message, for topics with several slow publishers, which
        sequence numbers cannot distinguish; rclpy does not provide it.

    Attributes
    ----------
    name : str
        Resolved name of the topic.
    """

    def __init__(self, node: Node, kind: Any, topic: str,
                 take: Callable[[bytes, dict[str, Any]], None],
                 sender: Callable[[bytes], str] | None = None) -> None:
        self.name = node.resolve_topic_name(topic)
        self._node, self._kind, self._topic, self._take = node, kind, topic, take
        self._subscriptions: dict[Offer, Any] = {}
        self._seen: dict[tuple[int, int], frozenset[Offer]] = {}
        self._checks = 0
        self._received_at: deque[tuple[int, tuple[int, int]]] = deque(maxlen=_MAX_SEEN)
        self._sender = sender
        self._losses: defaultdict[str, Losses] = defaultdict(Losses)
        self._publishers: frozenset[tuple[bytes, Offer]] = frozenset()
        self._subscribe(_RELIABLE)

    def _subscribe(self, offer: Offer) -> None:
        profile = QoSProfile(depth=DEPTH, reliability=offer[0], durability=offer[1])
        self._subscriptions[offer] = self._node.create_subscription(
            self._kind, self._topic, partial(self._on_message, offer), profile, raw=True)

    @property
    def lost(self) -> int:
        """Number of lost messages."""
        return sum(losses.count for losses in self._losses.values())

    @property
    def publishers(self) -> int:
        """Number of connected publishers."""
        return max(subscription.get_publisher_count()
                   for subscription in self._subscriptions.values())

    def check_publishers(self) -> None:
        """Check the publishers, and subscribe with a QoS that fits them."""
        self._checks += 1
        publishers = frozenset(
            (bytes(info.endpoint_gid),
             (info.qos_profile.reliability, info.qos_profile.durability))
            for info in self._node.get_publishers_info_by_topic(self.name))
        for losses in self._losses.values():
            losses.check(publishers != self._publishers)
        if publishers and publishers != self._publishers:
            best = self._best(publishers)
            if best not in self._subscriptions:
                self._subscribe(best)
        self._publishers = publishers
        if publishers and len(self._subscriptions) > 1:
            self._drop_redundant()

    def _best(self, publishers: frozenset[tuple[bytes, Offer]]) -> Offer:
        offers = [offer for _, offer in publishers]
        if any(reliability != ReliabilityPolicy.RELIABLE for reliability, _ in offers):
            return _BEST_EFFORT
        lasting = all(durability == DurabilityPolicy.TRANSIENT_LOCAL for _, durability in offers)
        return _LASTING if lasting else _RELIABLE

    def _drop_redundant(self) -> None:
        """End the other subscriptions when the best one receives all their messages."""
        best = self._best(self._publishers)
        if self._subscriptions[best].get_publisher_count() < len(self._publishers):
            return
        due = []
        while self._received_at and self._received_at[0][0] <= self._checks - _CONFIRMING_CHECKS:
            due.append(self._received_at.popleft()[1])
        if not due or not all(best in self._seen.get(key, ()) for key in due):
            return
        for offer in [offer for offer in self._subscriptions if offer != best]:
            self._drain(offer)
            self._node.destroy_subscription(self._subscriptions.pop(offer))
        self._received_at.clear()

    def offered(self) -> list[dict[str, Any]]:
        """Return the publishers' QoS for a recording; empty if unknown."""
        offers = {offer for _, offer in self._publishers} or {
            (info.qos_profile.reliability, info.qos_profile.durability)
            for info in self._node.get_publishers_info_by_topic(self.name)}
        return [qos_profile(reliability.name.lower(), durability.name.lower())
                for reliability, durability in sorted(offers)]

    def _on_message(self, offer: Offer, message: bytes, info: dict[str, Any]) -> None:
        self._receive(offer, message, info)
        # The executor takes one message per poll of all entities.
        self._drain(offer)

    def drain(self) -> None:
        """Process all messages that have arrived."""
        for offer in list(self._subscriptions):
            self._drain(offer)

    def _drain(self, offer: Offer) -> None:
        subscription = self._subscriptions.get(offer)
        if subscription is None:
            return
        with subscription.handle:
            for _ in range(DEPTH):
                message = subscription.handle.take_message(self._kind, True)
                if message is None:
                    return
                self._receive(offer, *message)

    def _receive(self, offer: Offer, message: bytes, info: dict[str, Any]) -> None:
        sequence = info['publication_sequence_number'] or 0
        key = info['source_timestamp'], sequence
        known = self._seen.get(key)
        if known is not None:
            self._seen[key] = known | {offer}
            return
        self._seen[key] = _ONLY[offer]
        several = len(self._subscriptions) > 1
        if several:
            self._received_at.append((self._checks, key))
        while len(self._seen) > (_MAX_SEEN if several else _MAX_SEEN_SINGLE):
            self._seen.pop(next(iter(self._seen)))
        if sequence:
            self._losses[self._sender(message) if self._sender else ''].add(sequence)
        self._take(message, info)
