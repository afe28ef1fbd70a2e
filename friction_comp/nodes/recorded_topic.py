# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Subscribes to one topic without losing its first messages, and counts what is lost."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from friction_comp.nodes.losses import Losses
from friction_comp.recordings.writer import qos_profile

# Seconds of a topic at a kilohertz that may wait to be taken.
DEPTH = 10_000
# Messages remembered to know what came twice.
_REMEMBERED = 2 * DEPTH
# The same while there is one subscription: a second one may bring what a new publisher has said
# before it was found.
_RECENT = 2_000
# Looks after which what one subscription received must have come by the other.
_CONFIRMED = 5

Offer = tuple[ReliabilityPolicy, DurabilityPolicy]
_BEST_EFFORT: Offer = (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE)
_RELIABLE: Offer = (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE)
_LASTING: Offer = (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)
_ONLY = {offer: frozenset((offer,)) for offer in (_BEST_EFFORT, _RELIABLE, _LASTING)}


class RecordedTopic:
    """Hears a topic with the quality of service that its publishers offer.

    What they offer is known only after they are found, and messages may come before: until then
    the topic is heard reliably. Where its publishers are heard better otherwise, a second
    subscription is made, and each message counts once. A publisher may serve the one long before
    it has found the other: the first is given up only when all that is heard for a while comes by
    the second.

    Parameters
    ----------
    node : rclpy.node.Node
    kind : type
        Message class.
    topic : str
    take : callable
        Called with the serialised message and the middleware's information on it.
    sender : callable, optional
        Tells from a serialised message who sent it, where several publishers that speak seldom
        share a topic: rclpy does not say, and numbers alone cannot tell them apart.

    Attributes
    ----------
    name : str
        Topic as it is called on the wire.
    """

    def __init__(self, node: Node, kind: Any, topic: str,
                 take: Callable[[bytes, dict[str, Any]], None],
                 sender: Callable[[bytes], str] | None = None) -> None:
        self.name = node.resolve_topic_name(topic)
        self._node, self._kind, self._topic, self._take = node, kind, topic, take
        self._subscriptions: dict[Offer, Any] = {}
        self._seen: dict[tuple[int, int], frozenset[Offer]] = {}
        self._looks = 0
        self._received_at: deque[tuple[int, tuple[int, int]]] = deque(maxlen=_REMEMBERED)
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
        """Messages that were published and never arrived."""
        return sum(one.count for one in self._losses.values())

    @property
    def publishers(self) -> int:
        """Number of publishers that are received."""
        return max(one.get_publisher_count() for one in self._subscriptions.values())

    def look(self) -> None:
        """Look who publishes, and subscribe with the quality of service that fits them."""
        self._looks += 1
        publishers = frozenset(
            (bytes(info.endpoint_gid),
             (info.qos_profile.reliability, info.qos_profile.durability))
            for info in self._node.get_publishers_info_by_topic(self.name))
        for losses in self._losses.values():
            losses.look(publishers != self._publishers)
        if publishers and publishers != self._publishers:
            best = self._best(publishers)
            if best not in self._subscriptions:
                self._subscribe(best)
        self._publishers = publishers
        if publishers and len(self._subscriptions) > 1:
            self._settle()

    def _best(self, publishers: frozenset[tuple[bytes, Offer]]) -> Offer:
        offers = [offer for _, offer in publishers]
        if any(reliability != ReliabilityPolicy.RELIABLE for reliability, _ in offers):
            return _BEST_EFFORT
        lasting = all(durability == DurabilityPolicy.TRANSIENT_LOCAL for _, durability in offers)
        return _LASTING if lasting else _RELIABLE

    def _settle(self) -> None:
        """End the other subscriptions once the best one receives all that they do."""
        best = self._best(self._publishers)
        if self._subscriptions[best].get_publisher_count() < len(self._publishers):
            return
        due = []
        while self._received_at and self._received_at[0][0] <= self._looks - _CONFIRMED:
            due.append(self._received_at.popleft()[1])
        if not due or not all(best in self._seen.get(key, ()) for key in due):
            return
        for offer in [offer for offer in self._subscriptions if offer != best]:
            self._drain(offer)
            self._node.destroy_subscription(self._subscriptions.pop(offer))
        self._received_at.clear()

    def offered(self) -> list[dict[str, Any]]:
        """Return the publishers' quality of service as a recording notes it, if known."""
        offers = {offer for _, offer in self._publishers} or {
            (info.qos_profile.reliability, info.qos_profile.durability)
            for info in self._node.get_publishers_info_by_topic(self.name)}
        return [qos_profile(reliability.name.lower(), durability.name.lower())
                for reliability, durability in sorted(offers)]

    def _on_message(self, offer: Offer, message: bytes, info: dict[str, Any]) -> None:
        self._receive(offer, message, info)
        # The executor gives one message at a time, at the price of a look at everything.
        self._drain(offer)

    def drain(self) -> None:
        """Take all that has arrived."""
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
            self._received_at.append((self._looks, key))
        while len(self._seen) > (_REMEMBERED if several else _RECENT):
            self._seen.pop(next(iter(self._seen)))
        if sequence:
            self._losses[self._sender(message) if self._sender else ''].see(sequence)
        self._take(message, info)
