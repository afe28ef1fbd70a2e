# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compiled code gives the currents of plain Python, and none is loaded while a motor is driven."""

import ast
import textwrap

from helpers import printed_by, ROOT
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
    from friction_comp.model.arm.arm import Arm
    from friction_comp.model.arm.tree import Tree
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


def compiled_functions(tree):
    """Return the functions of a module that are compiled, decorated or by a call."""
    by_call = {argument.id for node in ast.walk(tree) if isinstance(node, ast.Call)
               and 'njit(' in ast.unparse(node.func) for argument in node.args}
    return [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and (
        node.name in by_call or any('njit' in ast.unparse(one) for one in node.decorator_list))]


def test_compiled_code_uses_nothing_whose_change_would_leave_its_cache():
    """The Makefile deletes the cache after a change in a folder with compiled functions."""
    roots = [ROOT, ROOT / 'bench', ROOT / 'harness']
    trees = {path: ast.parse(path.read_text(encoding='utf-8'))
             for folder in ('friction_comp', 'bench', 'harness')
             for path in (ROOT / folder).rglob('*.py')
             if 'njit(cache' in path.read_text(encoding='utf-8')}
    folders = {path.parent for path in trees}
    for path, tree in trees.items():
        origins = {alias.asname or alias.name: node.module.replace('.', '/')
                   for node in tree.body if isinstance(node, ast.ImportFrom)
                   for alias in node.names}
        used = {name.id for function in compiled_functions(tree) for name in ast.walk(function)
                if isinstance(name, ast.Name)}
        assert used
        for name in used & set(origins):
            for file in (root / f'{origins[name]}.py' for root in roots):
                assert not file.exists() or file.parent in folders, (path, name)
