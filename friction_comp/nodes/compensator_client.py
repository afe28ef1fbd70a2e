# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads and sets the compensator's model files through its parameters."""

from __future__ import annotations

from collections.abc import Generator
import time
import types
from typing import Any

from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python

from friction_comp.errors import InputError

# Timeout of an answer, s; a compensator validates a new model before it answers.
_TIMEOUT = 20.0


@types.coroutine
def yield_to_executor() -> Generator[None, None, None]:
    """Return control to the executor once."""
    yield


class CompensatorClient:
    """The running compensator with a node name, and the model files of its joints."""

    def __init__(self, node: Node, name: str) -> None:
        self.name = name
        # Number of model changes: answers to earlier requests are outdated.
        self.model_changes = 0
        self._get = node.create_client(GetParameters, f'{name}/get_parameters')
        self._set = node.create_client(SetParameters, f'{name}/set_parameters')

    async def files(self) -> dict[str, str]:
        """Return the model file of each joint; empty if no compensator is running."""
        if not self._get.service_is_ready() or not self._set.service_is_ready():
            return {}
        reply = await self._wait_for(self._get.call_async(
            GetParameters.Request(names=['joints', 'model_files'])))
        joints, files = (parameter_value_to_python(value) for value in reply.values)
        return dict(zip(joints or (), files or ()))

    async def load(self, joint: str, path: str) -> None:
        """Load a model for one joint; raise InputError if the compensator is missing or refuses."""
        files = await self.files()
        if joint not in files:
            raise InputError(f'no compensator of {joint} is running as {self.name}')
        files[joint] = path
        reply = await self._wait_for(self._set.call_async(SetParameters.Request(parameters=[
            Parameter('model_files', value=list(files.values())).to_parameter_msg()])))
        result = reply.results[0]
        if not result.successful:
            raise InputError(f'{self.name} refuses the model: {result.reason}')
        self.model_changes += 1

    async def _wait_for(self, future: Any) -> Any:
        end = time.monotonic() + _TIMEOUT
        while not future.done():
            if time.monotonic() > end:
                raise InputError(f'{self.name} does not answer')
            await yield_to_executor()
        return future.result()
