# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Errors a user can do something about."""


class InputError(ValueError):
    """Input that cannot be used: a file, an argument, a message or a parameter.

    The text is one line that names the thing and the reason. Command-line tools print it to
    standard error and exit with status 2; nodes refuse the parameter, goal or message.
    """
