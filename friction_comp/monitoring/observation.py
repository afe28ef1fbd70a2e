# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Observations of a machine and of a running system, as plain data."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

OK, NOTE, WARNING, PROBLEM = 'ok', 'note', 'warning', 'problem'


@dataclass(frozen=True)
class Finding:
    """Result of one check: level, subject, observation, and advice, if any."""

    level: str
    about: str
    what: str
    do: str = ''


@dataclass(frozen=True)
class Endpoint:
    """A publisher or subscription with its quality of service and message type, '' if unknown."""

    node: str
    reliable: bool = True
    lasting: bool = False
    kind: str = ''


@dataclass
class TopicSeen:
    """A topic with its types, publishers and subscriptions."""

    types: list[str] = field(default_factory=list)
    publishers: list[Endpoint] = field(default_factory=list)
    subscribers: list[Endpoint] = field(default_factory=list)


@dataclass
class StatesSeen:
    """N received joint states of J joints; NaN where there is no value."""

    joints: list[str]
    # System time and header stamp, s, shape (N,); a stamp of zero is an empty field.
    received: np.ndarray
    stamp: np.ndarray
    # Shape (N, J).
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    # Joints named more than once in a message.
    twice: list[str] = field(default_factory=list)
    # Which joints each message names, shape (N, J), where drivers publish some each; or all.
    named: np.ndarray = field(default_factory=lambda: np.empty((0, 0), dtype=bool))

    def __post_init__(self) -> None:
        if not self.named.size:
            self.named = np.ones(self.position.shape, dtype=bool)

    def of_joint(self, joint: str) -> StatesSeen:
        """Return the messages that name a joint, with that joint only."""
        index = self.joints.index(joint)
        rows, column = self.named[:, index], slice(index, index + 1)
        return StatesSeen(
            [joint], self.received[rows], self.stamp[rows], self.position[rows, column],
            self.velocity[rows, column], self.effort[rows, column], self.twice)

    def rows(self, measured_load: np.ndarray | None, torque_per_current: float) -> np.ndarray:
        """Return the measurements of the first joint as rows for `LiveResidual`, shape (N, 6)."""
        time = self.stamp if self.stamp.any() else self.received
        load = temperature = np.full(len(time), np.nan)
        if measured_load is not None and len(measured_load) > 1:
            load = np.interp(self.received, measured_load[:, 0], measured_load[:, 1])
        position, velocity = self.position[:, 0], self.velocity[:, 0]
        if not np.isfinite(velocity).all():
            velocity = np.gradient(position, time)
        order = np.argsort(time, kind='stable')
        return np.column_stack((time, position, velocity, self.effort[:, 0] / torque_per_current,
                                load, temperature))[order]


@dataclass
class Observation:
    """A running system, observed for some seconds."""

    seconds: float
    # Full names.
    nodes: list[str] = field(default_factory=list)
    # By full name; `names` has the full name of each of the package's topics.
    topics: dict[str, TopicSeen] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    states: StatesSeen | None = None
    effort_is_current: bool = False     # whether its efforts are in A, not N·m
    # Commands in the unit `command_unit` ('A' or 'N·m'), shape (M, J), and their system times, s.
    commands: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    commanded: np.ndarray = field(default_factory=lambda: np.empty(0))
    command_unit: str = 'A'
    directions: list[list[int]] = field(default_factory=list)
    # By joint: system time in s and torque in N·m, shape (K, 2).
    load: dict[str, np.ndarray] = field(default_factory=dict)
    # By node, if it answers.
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    # Last level and message by status name.
    diagnostics: dict[str, tuple[int, str]] = field(default_factory=dict)
    # Whether /clock ticks.
    clock: bool = False

    def topic(self, name: str) -> TopicSeen:
        """Return a topic of the package by its relative name; empty if it does not exist."""
        return self.topics.get(self.names.get(name, name), TopicSeen())
