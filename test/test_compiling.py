# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a robot loads: compiled code before a motor is driven, and nothing of the laboratory.

Compiled code gives the currents of plain Python.
"""

import textwrap

from helpers import printed_by
import numpy as np
import pytest

from friction_comp.compensation.law import CompensationLaw

LAW = """
    import numpy as np
    from friction_comp.compensation.law import CompensationLaw
    from friction_comp.model.friction_model import FrictionModel

    files = [f'config/armin_configuration_{k}.yaml' for k in (1, 2, 3)]
    models = [FrictionModel.load(path) for path in files]
    draw = np.random.default_rng(5)
    speeds = np.array([1.0, 2.0, 3.0])
    noise = draw.normal(0.0, 1e-4, (600, 3))
    noise[450, 1] = np.nan
    noise[510, 2] = 0.3
    directions = draw.integers(-1, 2, (10, 3)).astype(float)

    def currents(law):
        return np.array([law.update(
            1e-3 * k, np.sin(2e-3 * k * speeds) + noise[k], None if k % 200 > 150 else speeds,
            directions[k // 60]) for k in range(600)])
"""


def test_every_law_runs_without_compilation():
    plain = [float(word) for word in printed_by(LAW + """
    print(*(repr(float(value)) for name in ('continuous', 'paper', 'kinetic')
            for value in currents(CompensationLaw(models, name)).ravel()))
    """, NUMBA_DISABLE_JIT='1').split()]
    here = {}
    exec(textwrap.dedent(LAW), here)
    compiled = np.concatenate([here['currents'](CompensationLaw(here['models'], name)).ravel()
                               for name in ('continuous', 'paper', 'kinetic')])
    # The last bit of an exponential.
    assert plain == pytest.approx(compiled, abs=1e-12)
    assert max(compiled) > 0.1


def test_no_model_loads_code_or_modules_while_a_motor_is_driven():
    """What a first call loads would stop the process while the motor keeps its last current."""
    printed = printed_by("""
    import gc, sys
    from dataclasses import replace
    from numba.core.dispatcher import Dispatcher
    from friction_comp.control.model_trial import load_compiled_code, try_model
    load_compiled_code()

    def loaded():
        return {f'{one.__module__}.{one.__name__}{signature}' for one in gc.get_objects()
                if isinstance(one, Dispatcher) for signature in one.signatures} | set(sys.modules)

    before = loaded()
    """ + LAW + """
    from pathlib import Path
    from friction_comp.model.arm import Arm
    from friction_comp.model.arm import Tree
    from friction_comp.model.effects import EFFECTS
    for name in ('continuous', 'paper', 'kinetic', 'none'):
        law = CompensationLaw(models, name)
        currents(law)
        law.retune('paper', 0.5, 1.0)
        currents(law)
    effects = [kind({**dict.fromkeys(kind.constants, 2.0),
                     'coefficients': [0.01] * len(kind.coefficient_names)})
               for kind in EFFECTS.values()]
    try_model(replace(models[0], effects=effects), 'feed_forward', 'all effects')
    links = Tree(('one', 'two'), ('revolute', 'prismatic'), np.array([-1, 0]), [np.eye(3)] * 2,
                 np.zeros((2, 3)), np.eye(3)[:2], np.ones((2, 10)), [0.0, -9.81, 0.0])
    arms = [replace(model, joint=name, arm=Arm(links)) for model, name in zip(models, links.joints)]
    law = CompensationLaw(arms)
    law.update(0.0, [0.1, 0.2], None, 1, temperature=[20.0, np.nan])
    print(len(before), *(loaded() - before))
    """).split()
    assert int(printed[0]) > 100
    assert printed[1:] == []


NODE = """
    import sys
    import rclpy
    from friction_comp.nodes.{name} import {kind}
    from friction_comp.ros import node_main
    rclpy.init(args=['x', '--ros-args', {arguments}])
    node = {kind}()
    print(*(name for name in sys.modules if name.startswith(
        ('matplotlib', *{modules}, *(f'friction_comp.{{room}}' for room in {rooms})))))
    sys.stdout.flush()
    sys.modules['os']._exit(0)
"""
LABORATORY = ('refinement', 'reports', 'evaluation', 'fleet', 'excitation', 'simulation', 'note',
              'demo', 'recorded_drive', 'tools')
JOINT = ("'-p', 'joints:=[elbow]', '-p', "
         "'model_files:=[config/armin_configuration_1.yaml]'")


def test_the_law_and_what_it_needs_import_nothing_of_the_laboratory():
    assert printed_by(f"""
    import importlib, sys
    for name in ('model.friction_model', 'model.motor_check', 'compensation.law',
                 'control.compensation_loop', 'control.model_trial'):
        importlib.import_module(f'friction_comp.{{name}}')
    print(*(name for name in sys.modules if name.startswith(
        ('matplotlib', 'scipy.stats', 'rclpy', 'friction_comp.identification',
         *(f'friction_comp.{{room}}' for room in {LABORATORY})))))
    """).split() == []


@pytest.mark.processes
@pytest.mark.parametrize(('name', 'arguments'), [
    ('compensator', JOINT), ('identification', JOINT), ('direction', "'-p', 'joints:=[elbow]'"),
    ('exercise', "'-p', 'joints:=[elbow]'")])
def test_a_node_at_work_has_imported_nothing_of_the_laboratory(name, arguments):
    """The compensator is active; identification has loaded what a goal needs."""
    pytest.importorskip('rclpy', reason='ROS 2 is not in this environment')
    identifies = name == 'identification'
    # Filters of SciPy bring its statistics.
    modules = () if identifies else ('scipy.stats', 'friction_comp.identification')
    assert printed_by(NODE.format(
        name=name, kind=f'{name.capitalize()}Node', arguments=arguments, rooms=LABORATORY,
        modules=modules), ROS_AUTOMATIC_DISCOVERY_RANGE='OFF').split() == []
