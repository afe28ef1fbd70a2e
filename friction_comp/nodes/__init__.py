# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The programs of a ROS 2 graph: a node turns messages into calls of other rooms, and back."""


def compile_nodes() -> None:
    """Compile the code of nodes into the cache beside its modules: their first start is fast."""
    from friction_comp.control.model_trial import load_compiled_code
    from friction_comp.files import package_file
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.nodes.identification import compile_ahead
    from friction_comp.simulation.joint import Plant

    model = FrictionModel.load(package_file('config', 'armin_configuration_1.yaml'))
    load_compiled_code()
    compile_ahead(model.drive)
    Plant([model])
