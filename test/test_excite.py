# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A planned motion keeps its limits, is reproducible, and distinguishes effects."""

from argparse import Namespace
from dataclasses import replace
import json

from helpers import short_search, undocumented
from hypothesis import example, given, strategies as st
import numpy as np
import pytest
from scipy.stats import qmc
import yaml

from friction_comp.__main__ import run
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.excitation.plan import (
    coverage_within,
    from_urdf,
    JointLimits,
    JointPlan,
    moves_of_shape,
    pairs_in,
    pairs_of,
    peak_torque,
    plan_joint,
    separations,
    SHAPE,
    trajectory_of,
)
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples
from friction_comp.tools.motion import limits_of

ELBOW = JointLimits('elbow', -1.2, 1.0, 1.5, 6.0)
PLAIN = ['--joint', 'elbow', '--position', '-1.2', '1.0', '--velocity', '1.5', '--acceleration',
         '6']


# A last move that ends between the last sample and the end.
@example(seed=6813, bends=(0.25, 0.7890625, 0.007039780636904249, 0.47629448692292786, 0.0),
         lowest=0.0, span=5.212890625, velocity=3.435546875, acceleration=0.11,
         seconds=32.0388164004364)
@given(seed=st.integers(0, 2**32 - 1), bends=st.tuples(*[st.floats(0.0, 1.0)] * 5),
       lowest=st.floats(-3.0, 3.0), span=st.floats(0.05, 6.0), velocity=st.floats(0.05, 5.0),
       acceleration=st.floats(0.1, 50.0), seconds=st.floats(20.0, 60.0))
def test_no_plan_leaves_its_limits(seed, bends, lowest, span, velocity, acceleration, seconds):
    limits = JointLimits('j', lowest, lowest + span, velocity, acceleration)
    shape = [low + bend * (high - low) for bend, (low, high) in zip(bends, SHAPE)]
    points = qmc.Sobol(3, scramble=True, seed=seed).random(512)
    plan = JointPlan(limits, tuple(moves_of_shape(shape, limits, seconds, points)), seconds, {})
    q, v, a = (getattr(plan.samples(500.0), name)
               for name in ('position', 'velocity', 'acceleration'))
    assert lowest < q.min()
    assert q.max() < lowest + span
    assert np.abs(v).max() < velocity
    assert np.abs(a).max() < acceleration
    assert np.abs(np.diff(q)).max() * 500.0 < velocity
    assert np.abs(np.diff(q, 2)).max() * 500.0 ** 2 < acceleration * (1.0 + 1e-6) + 1e-6
    assert q[0] == limits.centre
    assert q[-1] == pytest.approx(limits.centre, abs=1e-9)
    assert v[-1] == 0.0


@pytest.fixture(scope='module')
def plan():
    with short_search():
        return plan_joint(ELBOW, pairs_of(['stribeck', 'viscous_shape']), 20.0, 3)


@short_search()
def test_the_same_seed_gives_the_same_plan_and_another_another(plan):
    pairs = pairs_of(['stribeck', 'viscous_shape'])
    again, other = (plan_joint(ELBOW, pairs, 20.0, seed) for seed in (3, 4))
    assert plan == again
    assert plan.moves != other.moves
    assert len({round(move.distance, 9) for move in plan.moves}) == len(plan.moves)


def sine(limits):
    """Return motion to and fro through the whole range, as fast as allowed."""
    half, time = 0.5 * (limits.highest - limits.lowest), np.arange(0.0, 40.0, 0.02)
    turn = limits.velocity / half
    wave, slope = np.sin(turn * time), np.cos(turn * time)
    return Samples(time=time, position=limits.centre + half * wave, current=0.0 * time,
                   velocity=half * turn * slope, acceleration=-half * turn ** 2 * wave)


@pytest.mark.parametrize('pair', [
    ('stribeck', 'viscous_shape'), ('hysteresis', 'rest_time')])
def test_a_plan_tells_more_apart_than_a_sine(pair):
    pairs = pairs_of(pair)
    coverage = coverage_within(ELBOW, 40.0)
    # After a few of its generations already.
    with short_search(3):
        planned = plan_joint(ELBOW, pairs, 40.0, 7).separation[pairs[0]]
    plain = separations(sine(ELBOW), pairs, coverage)
    assert planned > 1.1 * plain[pairs[0]]


def test_separation_sees_what_cannot_be_told_apart():
    narrow = JointLimits('j', -0.05, 0.05, 1.5, 6.0)
    pairs = pairs_of(['gravity', 'spring'])
    shares = [separations(sine(limits), pairs,
                          coverage_within(limits, 40.0))[pairs[0]]
              for limits in (ELBOW, narrow)]
    assert shares[1] < 0.1 * shares[0]


@short_search(0)
def test_a_plan_keeps_to_the_effort_limit_or_is_refused(plan, monkeypatch):
    monkeypatch.setattr('friction_comp.excitation.plan._POPULATION', 1)
    model = FrictionModel(drive=Drive(0.1, 100.0, 4000), joint='elbow',
                          sigmoid=Sigmoid(0.2, -0.2, 400.0, viscous=0.5))
    pairs = pairs_of(['stribeck', 'viscous_shape'])
    limits = JointLimits('elbow', -1.2, 1.0, 1.5, 6.0, effort=6.0)
    assert peak_torque(model, plan.samples(500.0)) > 6.0
    assert peak_torque(model, plan_joint(limits, pairs, 20.0, 3, model).samples(500.0)) < 6.0
    slow = JointLimits('elbow', -1.2, 1.0, 1e-4, 6.0)
    with pytest.raises(InputError, match='too short for motion within'):
        plan_joint(slow, pairs, 20.0, 1)
    with pytest.raises(InputError, match='effort limit of 1 N·m'):
        plan_joint(JointLimits('elbow', -1.2, 1.0, 1.5, 6.0, 1.0), pairs, 20.0, 1, model)


def test_the_trajectory_is_the_message(plan):
    message = pytest.importorskip('trajectory_msgs.msg').JointTrajectory
    point = pytest.importorskip('trajectory_msgs.msg').JointTrajectoryPoint
    document = yaml.safe_load(trajectory_of([plan], 20.0).to_yaml('a\nb'))
    assert set(document) == set(message.get_fields_and_field_types())
    assert all(set(one) == set(point.get_fields_and_field_types()) for one in document['points'])
    assert document['joint_names'] == ['elbow']
    assert document['points'][-1]['time_from_start'] == {'sec': 20, 'nanosec': 0}
    assert all(isinstance(one['positions'][0], float) for one in document['points'])


LIMIT = '<limit lower="-1.2" upper="1" velocity="2" effort="9"/>'
URDF = (f'<robot name="r"><joint name="elbow" type="revolute">{LIMIT}</joint><joint name="b" '
        f'type="revolute">{LIMIT}<mimic joint="elbow"/></joint><joint name="c" type="fixed"/>'
        '</robot>')
STATED = JointLimits('elbow', -1.2, 1.0, 2.0, 3.0, 9.0)


def test_limits_come_from_a_urdf_and_an_option_lowers_them(tmp_path):
    urdf = tmp_path / 'arm.urdf'
    urdf.write_text(URDF, encoding='utf-8')
    assert from_urdf(urdf, 3.0) == [STATED]
    for joint, words in (('b', "'b' mimics another"), ('c', "no revolute joint 'c'")):
        with pytest.raises(InputError, match=words):
            from_urdf(urdf, 3.0, [joint])
    for velocity, least in ((None, 2.0), (0.5, 0.5), (5.0, 2.0)):
        assert limits_of(Namespace(urdf=urdf, position=None, joint=[], velocity=velocity,
                                   acceleration=3.0)) == [replace(STATED, velocity=least)]


def test_a_report_of_refine_says_what_to_tell_apart():
    found = pairs_in({'ambiguous': [{'between': ['time', 'velocity']}]}, 'r')
    assert ('stribeck', 'warm_up') in found
    assert ('gravity', 'spring') not in found
    with pytest.raises(InputError, match='nothing open that motion alone'):
        pairs_in({'ambiguous': [{'between': ['time', 'temperature']}]}, 'r')


@short_search()
def test_the_tool_writes_plan_page_and_report(tmp_path, capsys):
    output = tmp_path / 'o'
    assert run('excite', [*PLAIN, '--effects', 'stribeck,viscous_shape', '--seconds', '20',
                          '--output', str(output)]) == 0
    assert 'effort is not checked' in capsys.readouterr().out
    report = json.loads((output / 'report.json').read_text(encoding='utf-8'))
    assert undocumented(report) == set()
    assert report['joints'][0]['pairs'][0]['between'] == ['stribeck', 'viscous_shape']
    assert {one.name for one in output.iterdir()} == {
        'report.html', 'report.json', 'trajectory.yaml'}


@pytest.mark.parametrize('wrong, words', [
    (['--effects', 'load_friction,stribeck'], "cannot be shown by the joint's own motion"),
    (['--effects', 'cogging,stribeck'], 'needs no plan'),
    (['--effects', 'nonsense,stribeck'], "effect 'nonsense' is unknown"),
    (['--effects', 'stribeck'], 'at least two effects'),
    (['--seconds', '5'], 'too short for a plan'),
    (['--seconds', '1e9'], 'too long for a plan'),
    (['--ambiguous', 'missing.json'], 'cannot be read'),
])
def test_wrong_input_is_one_line(wrong, words, refuses):
    refuses(words, 'excite', *PLAIN, *wrong)
