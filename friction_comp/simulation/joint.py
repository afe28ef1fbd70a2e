# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated geared joints with encoder, current sensor, torque sensor S2 and a person."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
import math
from typing import TYPE_CHECKING

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.simulation.joint_kernel import bank_sample, start_bank
from friction_comp.simulation.joint_parameters import joint_parameters
from friction_comp.simulation.joint_records import JOINT_STATE, MEASURED
from friction_comp.simulation.random_sequence import random_states
from friction_comp.simulation.undeclared import COLUMNS, Undeclared

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True)
class PlantState:
    """What a plant's sensors show at one instant; arrays of shape (J,).

    Attributes
    ----------
    time : float
        s since the start.
    position, velocity : ndarray
        rad, whole encoder counts, and their first difference, rad/s.
    current : ndarray
        Measured motor current in A.
    interaction_torque : ndarray
        τ_b at the torque sensor S2 in N·m, positive where the person pushes forward.
    temperature : ndarray
        Motor temperature in degrees Celsius.
    """

    time: float
    position: np.ndarray
    velocity: np.ndarray
    current: np.ndarray
    interaction_torque: np.ndarray
    temperature: np.ndarray


class Plant:
    """Simulated joints that are stepped one sample at a time.

    Parameters
    ----------
    models : list of FrictionModel
        One per joint: see `joint_parameters`.
    seed : int
        Of all noise and scatter; the same seed and commands give the same numbers.
    undeclared : list of Undeclared or None, optional
        One per joint.
    sample_time : float
        s.
    """

    def __init__(self, models: Iterable[FrictionModel], seed: int | Sequence[int] = 0,
                 undeclared: Sequence[Undeclared | None] | None = None,
                 sample_time: float = 1e-3) -> None:
        models = list(models)
        given: list[Undeclared | None] = (
            [None] * len(models) if undeclared is None else list(undeclared))
        if not models or len(given) != len(models):
            raise InputError('the plant needs one model, and one undeclared file or none, a joint')
        if not (math.isfinite(sample_time) and 0.0 < sample_time <= 0.01):
            raise InputError(f'sample_time must be in (0, 0.01] s, not {sample_time!r}')
        self.sample_time = float(sample_time)
        self.joints = len(models)
        extras = [Undeclared() if extra is None else extra for extra in given]
        self._random = random_states(seed, self.joints)
        self._parameters = np.array(
            [joint_parameters(model, extra) for model, extra in zip(models, extras)])
        self._tables = np.full((self.joints, max(len(e.table) for e in extras), COLUMNS), -1.0)
        for table, extra in zip(self._tables, extras):
            table[:len(extra.table)] = extra.table
        self._memories = np.zeros((self.joints, max(1, max(e.memory_size for e in extras))))
        self._states = np.zeros(self.joints, JOINT_STATE)
        self._out = np.zeros(self.joints, MEASURED)
        # Views and constants, created once: a step takes a microsecond, and so would each of them.
        self._samples = self._states['samples']
        self._shown = self._out.view(float).reshape(self.joints, -1).T
        self._zeros, self._nobody = np.zeros(self.joints), np.zeros(self.joints, dtype=bool)
        self._everybody = ~self._nobody
        start_bank(self._parameters, self._states, self._random, self.sample_time, self._out)
        # Have the step compiled, or read from its cache, before anybody waits for it.
        none = np.zeros(0)
        bank_sample(self._parameters[:0], self._states[:0], self._random[:0], self._tables[:0],
                    self._memories[:0], self.sample_time, none, none, none, none.astype(bool),
                    self._out[:0])
        self.state = self._measured()

    def step(self, command: ArrayLike, reference_position: ArrayLike | None = None,
             reference_velocity: ArrayLike | None = None,
             human_active: ArrayLike | None = None) -> PlantState:
        """Hold a current over one sample and return what the sensors show at its end.

        Parameters
        ----------
        command : array_like, shape (J,)
            Motor current in A; not finite counts as 0, larger than the limit is clipped.
        reference_position, reference_velocity : array_like, shape (J,), optional
            The movement that the person follows, at the state's time: rad, rad/s.
        human_active : array_like of bool, shape (J,), optional
            Which joints the person holds; all that have a reference when omitted.
        """
        if human_active is None:
            active = self._nobody if reference_position is None else self._everybody
        else:
            active = self._row(human_active, bool)
        position = self._zeros if reference_position is None else self._row(reference_position)
        velocity = self._zeros if reference_velocity is None else self._row(reference_velocity)
        self._advance(self._row(command), position, velocity, active)
        self.state = self._measured()
        return self.state

    def _advance(self, command: np.ndarray, position: np.ndarray, velocity: np.ndarray,
                 active: np.ndarray) -> None:
        """Take every joint through one sample; each array has shape (J,)."""
        bank_sample(
            self._parameters, self._states, self._random, self._tables, self._memories,
            self.sample_time, command, position, velocity, active, self._out)

    def _row(self, values: ArrayLike, kind: type = float) -> np.ndarray:
        # Broadcasting takes longer than a step, so arrays with one value per joint are used as they
        # are.
        row: np.ndarray = np.asarray(values, dtype=kind, order='C')
        if row.shape == (self.joints,):
            return row
        if row.ndim:
            raise InputError(f'expected {self.joints} values, one a joint, not shape {row.shape}')
        return np.full(self.joints, row)

    def _measured(self) -> PlantState:
        # `MEASURED` has the names and the order of `PlantState`'s arrays.
        return PlantState(float(self._samples[0]) * self.sample_time, *self._shown.copy())
