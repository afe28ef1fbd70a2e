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
    """Result of one check: its level, subject, what was found, and what to do, if anything."""

    level: str
    about: str
    what: str
    do: str = ''


@dataclass(frozen=True)
class Endpoint:
    """A publisher or subscription with its quality of service."""

    node: str
    reliable: bool = True
    lasting: bool = False


@dataclass
class TopicSeen:
    """A topic with its types, publishers and subscriptions."""

    types: list[str] = field(default_factory=list)
    publishers: list[Endpoint] = field(default_factory=list)
    subscribers: list[Endpoint] = field(default_factory=list)


@dataclass
class StatesSeen:
    """Received joint states.

    Parameters
    ----------
    joints : list of str
    received, stamp : ndarray, shape (N,)
        System time and header stamp, s; a stamp of zero is an empty field.
    position, velocity, effort : ndarray, shape (N, J)
        NaN where there is no value.
    twice : list of str
        Joints named more than once in a message.
    """

    joints: list[str]
    received: np.ndarray
    stamp: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    twice: list[str] = field(default_factory=list)


@dataclass
class Observation:
    """A running system, observed for some seconds.

    Parameters
    ----------
    seconds : float
        Duration.
    nodes : list of str
        Full names.
    topics : dict of str to TopicSeen
        By full name.
    names : dict of str to str
        Relative to full name of the package's topics.
    states : StatesSeen, optional
    commands, commanded : ndarray, shape (M, J) and (M,)
        In the unit `command_unit`, 'A' or 'N·m', and their system times, s.
    directions : list of list of int
    load : dict of str to ndarray, shape (K, 2)
        By joint: system time in s and torque in N·m.
    parameters : dict of str to dict
        By node.
    diagnostics : dict of str to (int, str)
        Last level and message by status name.
    clock : bool
        Whether /clock ticks.
    """

    seconds: float
    nodes: list[str] = field(default_factory=list)
    topics: dict[str, TopicSeen] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    states: StatesSeen | None = None
    commands: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    commanded: np.ndarray = field(default_factory=lambda: np.empty(0))
    command_unit: str = 'A'
    directions: list[list[int]] = field(default_factory=list)
    load: dict[str, np.ndarray] = field(default_factory=dict)
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    diagnostics: dict[str, tuple[int, str]] = field(default_factory=dict)
    clock: bool = False

    def topic(self, name: str) -> TopicSeen:
        """Return a topic of the package by its relative name; empty if it does not exist."""
        return self.topics.get(self.names.get(name, name), TopicSeen())
