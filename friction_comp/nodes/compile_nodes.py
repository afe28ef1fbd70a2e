# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compiles the nodes' kernels at installation, so that their first start is fast."""

from __future__ import annotations

from friction_comp.control.model_trial import load_compiled_code
from friction_comp.files import package_file
from friction_comp.model.friction_model import FrictionModel
from friction_comp.nodes.identification import compile_ahead
from friction_comp.simulation.joint import Plant


def compile_nodes() -> None:
    """Compile compensator, identification and plant into the cache beside their modules."""
    model = FrictionModel.load(package_file('config', 'armin_configuration_1.yaml'))
    load_compiled_code()
    compile_ahead(model.drive)
    Plant([model])


if __name__ == '__main__':
    compile_nodes()
