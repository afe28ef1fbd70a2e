# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What `refine` makes of tables of means at constant speeds, idle motors and lengths; and turns."""

import json
import math
import re

import numpy as np
import pytest
from table_maker import swing, write

from friction_comp import Samples
from friction_comp.__main__ import main
from friction_comp.drive import Drive
from friction_comp.identification.curves import fit_steady_states
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement.judge import other_turn
from friction_comp.refinement.result import FoundEffect

TURN = 2.0 * math.pi


def sliding(speed, coulomb=0.57, viscous=0.52, offset=0.0, height=0.0, speed_s=0.1):
    return (offset + viscous * speed + np.sign(speed) * (
        coulomb + height * np.exp(-np.abs(speed) / speed_s)))


SPEEDS = np.array([0.02, 0.04, 0.07, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1.6])


def test_a_table_of_steady_states_gives_the_friction_with_intervals():
    speeds = np.concatenate((-SPEEDS, SPEEDS))
    inside = total = 0
    for seed in range(1, 40, 2):
        noise = 0.005 * np.random.default_rng(seed).normal(size=len(speeds))
        fit = fit_steady_states(speeds, sliding(speeds, offset=0.05) + noise, Drive(1.0, 1.0))
        for name, truth in (('coulomb', 0.57), ('viscous', 0.52), ('offset', 0.05)):
            total += 1
            inside += fit.intervals[name][0] <= truth <= fit.intervals[name][1]
    assert inside >= 0.85 * total       # 95 % less what choosing among curves costs
    fit = fit_steady_states(speeds, sliding(speeds, height=0.3) + noise, Drive(1.0, 1.0))
    assert fit.values['stribeck'] == pytest.approx(0.3, abs=0.05)
    assert fit.values['stribeck_speed'] == pytest.approx(0.1, rel=0.2)
    assert fit.left_out_rmse < 0.5 * fit.plain_rmse
    curve = fit.model.current(Samples(speeds, speeds, speeds, velocity=speeds))
    assert curve == pytest.approx(sliding(speeds, height=0.3), abs=0.02)
    skewed = sliding(speeds) + 0.1 * np.abs(speeds) + noise
    assert fit_steady_states(speeds, skewed, Drive(1.0, 1.0)).values['viscous_asymmetry'] == \
        pytest.approx(0.1, abs=0.02)


def test_refine_reads_a_table_of_steady_states(tmp_path, capsys):
    speeds = np.concatenate((-SPEEDS, SPEEDS))
    path = write(tmp_path / 'table.csv', velocity=1e3 * speeds, torque=sliding(speeds))
    output = tmp_path / 'out'
    assert main(['refine', str(path), '--unit', 'velocity=mm/s,effort=N', '--output',
                 str(output)]) == 0
    said = capsys.readouterr().out
    assert '0.5700 N ' in said
    assert '0.5200 N·s/m' in said
    assert 'rad' not in said
    page = (output / 'report.html').read_text()
    assert '0.5700 N<' in page
    assert 'N·m' not in page
    report = json.loads((output / 'report.json').read_text())
    assert report['friction']['coulomb'] == pytest.approx(0.57, abs=1e-6)
    model = FrictionModel.load(output / 'model.yaml')
    assert model.lookup_table['currents'] == pytest.approx(sliding(np.sort(speeds)).tolist())
    # One direction cannot tell Coulomb friction from an offset; too few rows are refused.
    write(path, velocity=SPEEDS, torque=sliding(SPEEDS))
    assert main(['refine', str(path), '--output', str(output)]) == 0
    assert 'in one direction only' in capsys.readouterr().out
    write(path, velocity=SPEEDS[:3], torque=sliding(SPEEDS[:3]))
    assert main(['refine', str(path), '--output', str(output)]) == 2


@pytest.mark.slow
def test_an_idle_motor_moved_by_hand_shows_friction_in_torque(tmp_path, capsys):
    time = 0.005 * np.arange(6000)
    position = 0.8 * np.sin(time) * np.sin(0.23 * time)
    velocity = np.gradient(position, time)
    load = 1.4 * np.tanh(velocity / 0.01) + 0.9 * velocity
    load += 0.02 * np.random.default_rng(1).normal(size=len(time))
    path = write(tmp_path / 'log.csv', time=time, q=position, dq=velocity,
                 motor_current=0.0 * time, sensor_torque=load)
    assert main(['refine', str(path), '--output', str(tmp_path / 'out')]) == 0
    assert 'the motor was idle' in capsys.readouterr().out
    report = json.loads((tmp_path / 'out' / 'report.json').read_text())
    assert report['unit'] == 'N·m'
    assert report['friction']['coulomb'] == pytest.approx(1.4, rel=0.03)
    assert report['friction']['viscous'] == pytest.approx(0.9, rel=0.05)


def test_means_in_per_cent_stay_so(tmp_path, capsys):
    speed = np.array([-2.0, -1.0, -0.5, -0.2, 0.2, 0.5, 1.0, 2.0] * 2)
    path = write(tmp_path / 'means.csv', **{
        'speed [rad/s]': speed, 'Torque [%]': 8.0 * np.sign(speed) + 3.0 * speed})
    assert main(['refine', str(path), '--output', str(tmp_path / 'out')]) == 0
    assert ' 8.000 % ' in capsys.readouterr().out


def test_steady_states_of_another_form_are_not_simply_trusted():
    speeds, alarms = np.concatenate((-SPEEDS, SPEEDS)), 0
    for seed in range(15):
        noise = 0.01 * np.random.default_rng(seed).normal(size=len(speeds))
        alarms += fit_steady_states(speeds, sliding(speeds) + noise, Drive(1.0, 1.0)).is_curved
        # Viscous friction of a lubricant that thins with the speed.
        thinning = 0.57 * np.sign(speeds) + 0.3 * np.arcsinh(speeds / 0.1)
        assert fit_steady_states(speeds, thinning + noise, Drive(1.0, 1.0)).is_curved
    assert alarms <= 2


def bench(path, sign=1.0, **others):
    """Write means of a gear on a test bench, whose motor turns nine times as fast as its output."""
    speed = np.concatenate((-np.linspace(0.2, 3.0, 6), np.linspace(0.2, 3.0, 6)))
    return write(path, motor_speed=9.0 * speed, motor_torque=sign * (
        0.3 * np.sign(speed) + 0.01 * speed), **others)


@pytest.mark.parametrize(('sign', 'verdict'), [(1.0, 'TRUST: '), (-1.0, 'RECORD AGAIN: ')])
def test_friction_that_would_push_is_not_trusted_in_means_either(tmp_path, capsys, sign, verdict):
    assert main(['refine', str(bench(tmp_path / 'means.csv', sign)), '--output', str(
        tmp_path / 'out')]) == 0
    said = capsys.readouterr().out
    assert verdict in said
    assert ('would have to push' in said) == (sign < 0.0)


def test_a_length_is_not_so_many_turns(tmp_path, capsys):
    time, position, velocity = swing()
    noise = 0.05 * np.random.default_rng(2).normal(size=len(time))
    path = write(tmp_path / 'log.csv', **{'elapsed': time, 'x [mm]': 100.0 * position,
                                          'force [N]': np.sign(velocity) + noise})
    assert main(['refine', str(path), '--columns', 'position=x [mm]',
                 '--output', str(tmp_path / 'out')]) == 0
    assert re.search(r'elapsed in s \(position covers \S+ m; rows', capsys.readouterr().out)


def ripple(low, high):
    return FoundEffect('cogging', 'position', 1.0, 1.0, {}, {'frequency': [low, high]}, None, '',
                       '')


@pytest.mark.parametrize(('waves', 'said'), [
    # As of a public winch, whose positions are turns: 14 and 12 times 2π.
    ([(87.909, 87.980), (75.350, 75.424)], '14, 12 if position is in turn'),
    ([(0.2440, 0.2445), (0.7329, 0.7332)], '14, 42 if position is in deg'),
    ([(13.99, 14.02), (75.350, 75.424)], ''),         # one is no whole number in turns
    ([(87.96, 88.02), (37.68, 38.01)], ''),           # whole in rad, too
    ([(87.7, 87.98)], ''),                            # by chance
    ([], '')])
def test_ripples_tell_in_which_unit_a_turn_is_one(waves, said):
    found = list(other_turn([ripple(*ends) for ends in waves]))
    assert said in found[0].text if said else not found


def test_ripples_of_any_gear_seldom_tell_another_unit():
    rng = np.random.default_rng(5)
    first = rng.uniform(5.0, 200.0, (2000, 1)) * rng.integers(1, 4, (2000, 2))
    alarms = sum(len(list(other_turn([ripple(k - 0.03, k + 0.03) for k in waves])))
                 for waves in first)
    assert alarms <= 20
    assert sum(len(list(other_turn([ripple(k - 0.03, k + 0.03) for k in TURN * np.round(waves)])))
               for waves in first) > 1900
