# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Serves the goals of a node's actions, one at a time."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
import traceback
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse

from friction_comp.errors import InputError


class GoalServer:
    """One goal at a time, of whichever action; `last` and `refused` are for diagnostics."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self._busy = False
        self.last = self.refused = ''

    def serve(self, kind: Any, name: str, accept: Callable[[Any], object],
              run: Callable[[Any, Any], Awaitable[str]],
              cancel: Callable[[], object] = lambda: None) -> ActionServer:
        """Serve an action.

        `accept` gets a request and raises InputError to refuse it. `run` gets the handle and the
        result of a goal, fills the result and returns what it says; InputError says why it failed,
        or that it was cancelled. `cancel` is called when that is asked for.
        """
        def on_cancel(_: Any) -> CancelResponse:
            cancel()
            return CancelResponse.ACCEPT
        return ActionServer(
            self._node, kind, name, partial(self._execute, kind, run),
            goal_callback=partial(self._on_goal, accept), cancel_callback=on_cancel)

    def _on_goal(self, accept: Callable[[Any], object], request: Any) -> GoalResponse:
        try:
            if self._busy:
                raise InputError('another goal is running')
            accept(request)
        except InputError as error:
            self.refused = str(error)
            self._node.get_logger().warning(f'goal rejected: {error}')
            return GoalResponse.REJECT
        self.refused, self._busy = '', True
        return GoalResponse.ACCEPT

    async def _execute(self, kind: Any, run: Callable[[Any, Any], Awaitable[str]], handle: Any
                       ) -> Any:
        result = kind.Result()
        try:
            result.message = await run(handle, result)
            result.success = True
        except InputError as error:
            result.message = str(error)
        except Exception:
            self._node.get_logger().error(traceback.format_exc())
            result.message = 'an error in the node, see its log'
        finally:
            self._busy = False
        end, finish = (('done', handle.succeed) if result.success else
                       ('canceled', handle.canceled) if handle.is_cancel_requested else
                       ('aborted', handle.abort))
        self.last = f'{end}: {result.message}'
        self._node.get_logger().info(self.last)
        finish()
        return result
