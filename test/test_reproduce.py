# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The note's experiments with few repetitions."""

from concurrent.futures import ThreadPoolExecutor
import json
from pathlib import Path

from helpers import undocumented
import pytest

from friction_comp.__main__ import run
from friction_comp.note import experiments
from friction_comp.note.experiments import EXPERIMENTS

QUOTED = json.loads((Path(__file__).resolve().parent.parent / 'docs' / 'figures'
                     / 'reproduce.json').read_text(encoding='utf-8'))


@pytest.mark.slow
def test_whole_tool(tmp_path, monkeypatch):
    """Every floor holds, and the numbers are there."""
    # Two minutes instead of an hour, few samples, and no process: that one is the next
    # test's.
    monkeypatch.setattr(experiments, 'STANDSTILLS', 12)
    monkeypatch.setattr(experiments, 'IDENTIFIED_EVERY', 8e-3)
    monkeypatch.setattr(experiments, 'child_process', lambda: ThreadPoolExecutor(1))
    assert run('reproduce', ['--cycles', '30', '--output', str(tmp_path / 'out')]) == 0
    results = json.loads((tmp_path / 'out' / 'results.json').read_text(encoding='utf-8'))
    assert undocumented(results) == set()
    for experiment in EXPERIMENTS:
        found = results['configurations'][str(experiment.number)]
        peaks, reductions = found['peak_torque'], found['peak_reduction']
        breakaway = found['breakaway']
        assert breakaway['cycles'] == 30
        for side, sign in (('positive', 1.0), ('negative', -1.0)):
            assert sign * breakaway[f'{side}_mean'] == pytest.approx(experiment.breakaway, rel=0.03)
            assert breakaway[f'{side}_std'] == pytest.approx(experiment.breakaway_std, rel=0.5)
        assert len(found['sigmoid']) == 6
        assert len(found['speeds']) == len(found['currents']) == 2 * len(experiment.speeds)
        assert peaks['kinetic'] == pytest.approx(experiment.peak_kinetic, rel=0.05)
        assert abs(reductions['paper'] - experiment.reduction) < 0.15
        friction = peaks['none'] - peaks['inertia']
        assert peaks['none'] - peaks['continuous'] >= 0.8 * friction
        assert peaks['inertia'] < peaks['continuous'] < peaks['kinetic']
        assert peaks['paper'] < peaks['kinetic']
        assert peaks['kinetic'] < peaks['none']
        assert found['false_starts'] == {'paper': 0, 'continuous': 0}
        # What docs/results.md quotes is still so: docs/generate.py stores it anew.
        quoted = QUOTED['configurations'][str(experiment.number)]
        for name, value in quoted['peak_torque'].items():
            # What a law leaves is a small difference: 0.5 % of friction is 7 % of it.
            assert peaks[name] == pytest.approx(
                value, rel=0.05, abs=max(0.02, 0.01 * peaks['none'])), name
        for name, value in quoted['peak_reduction'].items():
            assert reductions[name] == pytest.approx(value, abs=0.03), name
