# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Loads models in a separate thread while the control loop runs, and services that wait."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
import threading
import time
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService

from friction_comp.errors import InputError
from friction_comp.ros.executor import yield_to_executor

# Timeout of reading and validating files, s; a thread that still does is then abandoned.
_PATIENCE = 10.0


class Loading:
    """Models that are being loaded: the result of `load` for some files."""

    def __init__(self, files: Sequence[str], load: Callable[[Sequence[str]], Any]) -> None:
        self.files = tuple(files)
        self._load, self._deadline = load, time.monotonic() + _PATIENCE
        self._future: Future[Any] = Future()
        # A daemon thread, unlike those of an executor, does not block the exit of the node.
        threading.Thread(target=self._run, name='model loading', daemon=True).start()

    def _run(self) -> None:
        try:
            self._future.set_result(self._load(self.files))
        except Exception as error:
            self._future.set_exception(error if isinstance(error, InputError) else InputError(
                f'{", ".join(self.files)}: {error!r}'))

    @property
    def done(self) -> bool:
        """Whether `result` has an answer."""
        return self._future.done() or time.monotonic() > self._deadline

    def result(self) -> Any:
        """Return the models; raise InputError if loading failed or timed out."""
        if not self._future.done():
            raise InputError(f'{", ".join(self.files)}: not read within {_PATIENCE:g} s')
        return self._future.result()


class PatientParameterService(ParameterService):
    """Parameter services that wait for models to be loaded without blocking the node.

    The node's method `prepare` is called with the parameters that are about to be set and returns a
    Loading, or None if there is nothing to load: its attribute `loaded` while they are set, since
    several requests may wait at the same time.
    """

    def __init__(self, node: Any) -> None:
        before = set(node.services)
        super().__init__(node)
        # In the node's default group, a waiting service would block all other callbacks.
        self._group = ReentrantCallbackGroup()
        for service in set(node.services) - before:
            service.callback_group = self._group
            self._group.add_entity(service)

    async def _set_parameters_callback(self, request: Any, response: Any) -> Any:
        await self._prepare(request)
        return super()._set_parameters_callback(request, response)

    async def _set_parameters_atomically_callback(self, request: Any, response: Any) -> Any:
        await self._prepare(request)
        return super()._set_parameters_atomically_callback(request, response)

    async def _prepare(self, request: Any) -> None:
        node = self._get_node()
        loading = node.prepare(
            [Parameter.from_parameter_msg(message) for message in request.parameters])
        while loading is not None and not loading.done:
            await yield_to_executor()
        node.loaded = loading
