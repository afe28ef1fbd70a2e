# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identifies, explains and compensates the friction of geared robot drives.

A drive's current is a sum of effects, and the same sum predicts, explains and compensates. The
rooms from the ground up: :mod:`friction_comp.drive` and :mod:`friction_comp.samples`;
:mod:`friction_comp.model`; :mod:`friction_comp.identification`, :mod:`friction_comp.compensation`,
:mod:`friction_comp.refinement` and :mod:`friction_comp.recordings`, none of which knows another;
:mod:`friction_comp.simulation`; :mod:`friction_comp.evaluation`, :mod:`friction_comp.reports` and
:mod:`friction_comp.note`; at the edges :mod:`friction_comp.nodes` and :mod:`friction_comp.tools`.
"""

import os
import sys

__version__ = '0.1.0'


def _name_this_environment():
    """Let ROS 2 find what is installed in this Python environment.

    A sourced workspace names itself in AMENT_PREFIX_PATH; a virtual environment that holds ROS 2
    wheels does not. It comes last, so that sourced workspaces keep their precedence.
    """
    if not os.path.isdir(os.path.join(sys.prefix, 'share', 'ament_index')):
        return
    prefixes = [p for p in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if p]
    if sys.prefix not in prefixes:
        os.environ['AMENT_PREFIX_PATH'] = os.pathsep.join([*prefixes, sys.prefix])


_name_this_environment()
