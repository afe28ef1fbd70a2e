# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What ``import friction_comp`` offers, and that it and ``--help`` are fast."""

import ast
from pathlib import Path
import subprocess
import sys

from helpers import printed_by, ROOT
import pytest

import friction_comp
from friction_comp.__main__ import NODES, TOOLS

# All modules are imported, those that need Bokeh, too.
LIVE_PAGES = True
SLOW = ('numba', 'scipy', 'matplotlib', 'rosbags', 'rclpy', 'rich')


def test_every_public_name_is_what_it_says():
    for name in friction_comp.__all__:
        assert getattr(friction_comp, name).__name__ == name
        assert name in dir(friction_comp)
    with pytest.raises(AttributeError, match='nonsense'):
        _ = friction_comp.nonsense
    with pytest.raises(ImportError):
        exec('from friction_comp import nonsense')


def test_type_checkers_see_the_same_names_from_the_same_places():
    tree = ast.parse(Path(friction_comp.__file__).read_text(encoding='utf-8'))
    seen = {alias.name: node.module for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and (node.module or '').startswith('friction_comp')
            for alias in node.names}
    assert seen == friction_comp._HOMES
    assert sorted(seen) == sorted(friction_comp.__all__)


def test_import_of_the_package_loads_nothing_slow():
    """Nor NumPy: the command line sets the number of its threads first."""
    loaded = printed_by('import sys, friction_comp.__main__; print(*sys.modules)').split()
    assert not {'numpy', *SLOW} & set(loaded)


def test_help_and_mistakes_are_answered_before_anything_slow_is_loaded():
    code = f"""
import contextlib, io, sys
from friction_comp.__main__ import main
for name in {[*NODES, *TOOLS]}:
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown), contextlib.suppress(SystemExit):
        main([name, '--help'])
    assert shown.getvalue().startswith('usage: python3 -m friction_comp ' + name), name
    assert '``' not in shown.getvalue(), name
for name in {[*TOOLS]}:
    with contextlib.redirect_stderr(shown), contextlib.suppress(SystemExit):
        main([name, '--no-such-argument'])
print(*sys.modules)
"""
    assert not set(SLOW) & set(printed_by(code).split())


def test_bash_completes_names_and_options(tmp_path):
    script = tmp_path / 'try.sh'
    script.write_text(f"""
friction_comp() {{ {sys.executable} -m friction_comp "$@"; }}
eval "$(friction_comp --completion)"
complete_it() {{ COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=()
  _friction_comp friction_comp; echo "${{COMPREPLY[@]}}"; }}
complete_it friction_comp re
complete_it friction_comp refine --ea
""", encoding='utf-8')
    done = subprocess.run(['bash', str(script)], cwd=ROOT, capture_output=True, text=True,
                          check=False)
    assert done.stdout.splitlines() == ['recorder refinement reproduce refine', '--each']


@pytest.mark.slow
def test_imports_compile_nothing_and_leave_the_look_of_figures_to_other_programs(tmp_path):
    rooms = [path for path in (ROOT / 'friction_comp').rglob('*.py')
             if path.stem != '__main__' and 'nodes' not in path.parts]
    names = ['.'.join(path.relative_to(ROOT).with_suffix('').parts).removesuffix('.__init__')
             for path in rooms]
    code = f"""
import importlib
import matplotlib
from numba.core import event
before = dict(matplotlib.rcParams)
with event.install_recorder('numba:compile') as recorder:
    for name in {names}:
        importlib.import_module(name)
from friction_comp.reports.figures import panels, to_svg
to_svg(panels([''])[0])
print(len(recorder.buffer), matplotlib.rcParams == before)
"""
    assert printed_by(code, NUMBA_CACHE_DIR=str(tmp_path)) == '0 True\n'
