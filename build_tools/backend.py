# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Setuptools' build backend, which asks for ROS 2 wheels only where no ROS 2 is sourced."""

import interfaces
from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403 - a backend is its module's functions


def get_requires_for_build_wheel(config_settings=None):
    """List what pip must place in the build's environment beside setuptools."""
    return build_meta.get_requires_for_build_wheel(config_settings) + interfaces.requirements()
