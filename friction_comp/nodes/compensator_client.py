# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads and sets the compensator's model files by its parameters."""

from __future__ import annotations

from collections.abc import Generator
import time
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python

from friction_comp.errors import InputError

# s that an answer may take; a compensator checks a new model before it answers.
_PATIENCE = 20.0


class _Turn:
    """Awaited, gives the executor its turn."""

    def __await__(self) -> Generator[None, None, None]:
        yield


async def turn() -> None:
    """Let the executor do something else."""
    await _Turn()


class CompensatorClient:
    """A running compensator, and the model files of its joints.

    Parameters
    ----------
    node : rclpy.node.Node
    name : str
        Of its node.
    """

    def __init__(self, node: Node, name: str) -> None:
        self.name = name
        # How often models were exchanged: what was asked before the last time is out of date.
        self.exchanges = 0
        self._get = node.create_client(GetParameters, f'{name}/get_parameters')
        self._set = node.create_client(SetParameters, f'{name}/set_parameters')

    @property
    def there(self) -> bool:
        """Whether a compensator answers."""
        return self._get.service_is_ready() and self._set.service_is_ready()

    async def files(self) -> dict[str, str]:
        """Return the model file of each joint; empty where no compensator is running.

        Raises
        ------
        InputError
            If it does not answer.
        """
        if not self.there:
            return {}
        reply = await self._answer(self._get.call_async(
            GetParameters.Request(names=['joints', 'model_files'])))
        joints, files = (parameter_value_to_python(value) for value in reply.values)
        return dict(zip(joints or (), files or ()))

    async def load(self, joint: str, path: str) -> str:
        """Have the compensator take a model over for one joint, and return the file it had.

        Raises
        ------
        InputError
            If there is no compensator of the joint, or it refuses.
        """
        files = await self.files()
        if joint not in files:
            raise InputError(f'no compensator of {joint} is running as {self.name}')
        before, files[joint] = files[joint], path
        reply = await self._answer(self._set.call_async(SetParameters.Request(parameters=[
            ParameterMessage(name='model_files', value=Parameter(
                'model_files', value=list(files.values())).get_parameter_value())])))
        result = reply.results[0]
        if not result.successful:
            raise InputError(f'{self.name} refuses the model: {result.reason}')
        self.exchanges += 1
        return before

    async def _answer(self, future: Any) -> Any:
        end = time.monotonic() + _PATIENCE
        while not future.done():
            if time.monotonic() > end:
                raise InputError(f'{self.name} does not answer')
            await turn()
        return future.result()
