# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Loads and validates models in a thread of their own while the control loop runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
import math
import threading
import time
from typing import Any

import numpy as np
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService

from friction_comp.compensation.law import CompensationLaw
from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.nodes.compensator_client import yield_to_executor

# s that files may take to be read and checked.
PATIENCE = 10.0
# Samples for which a model is run before it is activated.
_TRIAL = 300


class Loading:
    """Models that are being loaded.

    Parameters
    ----------
    files : sequence of str
    load : callable
        Takes the files, returns what they hold, raises InputError.
    patience : float
        s until they are given up. The thread is then left to itself: it hangs on a file system,
        and nobody waits for it.
    """

    def __init__(self, files: Sequence[str], load: Callable[[Sequence[str]], Any],
                 patience: float = PATIENCE) -> None:
        self.files = tuple(files)
        self._load, self._end = load, time.monotonic() + patience
        self._patience = patience
        self._loaded: Future[Any] = Future()
        # A daemon, unlike an executor's threads: one that hangs does not keep the node from ending.
        threading.Thread(target=self._run, name='model loading', daemon=True).start()

    def _run(self) -> None:
        try:
            self._loaded.set_result(self._load(self.files))
        except InputError as error:
            self._loaded.set_exception(error)
        except Exception as error:
            self._loaded.set_exception(InputError(f'{", ".join(self.files)}: {error!r}'))

    @property
    def done(self) -> bool:
        """Whether `result` has an answer."""
        return self._loaded.done() or time.monotonic() > self._end

    def result(self) -> Any:
        """Return what was loaded.

        Raises
        ------
        InputError
            If it could not be, or not in time.
        """
        if not self._loaded.done():
            raise InputError(
                f'{", ".join(self.files)}: not read within {self._patience:g} s')
        return self._loaded.result()


def try_model(model: FrictionModel, gravity: str, path: str) -> None:
    """Run a model in a separate law for a movement to and fro.

    Raises
    ------
    InputError
        If that ends in anything but currents.
    """
    try:
        law = CompensationLaw([model], gravity=gravity)
        for k in range(_TRIAL):
            angle = 0.02 * k
            current = law.update(
                1e-3 * k, [math.sin(angle)], [20.0 * math.cos(angle)], [1.0 - k % 3],
                temperature=[25.0])
            if not np.isfinite(current).all():
                raise InputError('its currents are not finite')
    except InputError as error:
        raise InputError(f'{path}: {error}') from None
    except Exception as error:
        raise InputError(f'{path}: the law cannot use it: {error!r}') from None


def warm_up(law: CompensationLaw, joints: int) -> None:
    """Have everything compiled before the first sample."""
    zeros = np.zeros(joints)
    law.update(0.0, zeros, zeros, zeros)
    law.update(0.0, zeros, None, zeros)
    law.reset()


class PatientParameterService(ParameterService):
    """The parameter services of a node that wait for models to be loaded, and the node does not.

    Parameters
    ----------
    node : rclpy.node.Node
        Its method `prepare` takes the parameters that are about to be set and returns a Loading,
        or None where there is nothing to load.
    """

    def __init__(self, node: Any) -> None:
        before = set(node.services)
        super().__init__(node)
        # Of the node's own group nothing else would run while a service waits.
        group = ReentrantCallbackGroup()
        for service in set(node.services) - before:
            service.callback_group = group
            group.add_entity(service)
        self._group = group

    async def _set_parameters_callback(self, request: Any, response: Any) -> Any:
        await self._prepared(request)
        return super()._set_parameters_callback(request, response)

    async def _set_parameters_atomically_callback(self, request: Any, response: Any) -> Any:
        await self._prepared(request)
        return super()._set_parameters_atomically_callback(request, response)

    async def _prepared(self, request: Any) -> None:
        loading = self._get_node().prepare(
            [Parameter.from_parameter_msg(message) for message in request.parameters])
        while loading is not None and not loading.done:
            await yield_to_executor()
