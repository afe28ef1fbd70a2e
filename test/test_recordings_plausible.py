# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Impossible values give one line that names them, whichever tool reads them."""

import numpy as np
import pytest
from recording_maker import DATA, needs_data

from friction_comp.errors import InputError
from friction_comp.package_files import package_file
from friction_comp.recordings import find_recordings, read_recording, recorded_joints, write_samples
from friction_comp.recordings.plausible import check_plausible
from friction_comp.samples import Samples

MODEL = package_file('config', 'armin_configuration_1.yaml')


def strokes(seed=0, **changes):
    """Make a joint that a motor drives to and fro against friction, gravity and its inertia."""
    time = np.arange(0.0, 20.0, 2e-3)
    position = 0.6 * np.sin(1.3 * time)
    velocity = 0.78 * np.cos(1.3 * time)
    current = (0.3 * np.tanh(velocity / 0.02) + 0.2 * velocity + 0.4 * np.sin(position)
               - 0.05 * 1.3 * position
               + 0.02 * np.random.default_rng(seed).normal(size=len(time)))
    return Samples(time=time, position=position, velocity=velocity, current=current,
                   joint='elbow').with_(**changes)


def spoiled(signal, value, at=4321):
    values = getattr(strokes(), signal).copy()
    values[at] = value
    return strokes(**{signal: values})


def register(current, step=0.01, bit=1024):
    """Return a current as servos report it: amounts in single precision, their sign as a bit."""
    amount = np.minimum(np.round(np.abs(current) / step), bit - 1)
    return (step * (amount + bit * (current > 0.0))).astype(np.float32).astype(float)


CASES = [
    (lambda: spoiled('position', 1e300), r'position of 1e\+300 rad at 8\.642 s is impossible'),
    (lambda: spoiled('current', -1e150),
     r'current of -[0-9.]+e\+1\d\d A at 8\.642 s is impossible'),
    (lambda: spoiled('velocity', 1e12), r'velocity of 1e\+12 rad/s at 8\.642 s'),
    (lambda: spoiled('position', 300.0), r'position jumps from .* to 300 rad within 0\.002 s'),
    (lambda: strokes(current=-strokes().current), 'effort has the wrong sign'),
    (lambda: strokes(current=-strokes().current, command=strokes().current),
     'wrong sign'),
    (lambda: strokes(current=np.abs(strokes().current)), 'an amount without a sign'),
    (lambda: strokes(current=register(strokes().current)), 'From values of 10.24 or more subtract'),
    (lambda: strokes(velocity=-strokes().velocity),
     'velocity is -1 times the rate of position: one of the two has the wrong sign'),
    (lambda: strokes(velocity=np.degrees(strokes().velocity)),
     r'velocity is 57\.3 times the rate of position: velocity is in deg/s, not rad/s'),
]


@pytest.mark.parametrize(('make', 'words'), CASES)
def test_impossible_values_are_refused_by_name(make, words):
    with pytest.raises(InputError, match=words) as refused:
        check_plausible(make(), 'odd')
    assert str(refused.value).startswith("odd: joint 'elbow'")


@pytest.mark.parametrize('tool', ['refine', 'predict', 'evaluate'])
def test_no_tool_succeeds_with_impossible_values(tmp_path, refuses, tool):
    write_samples(tmp_path / 'odd', spoiled('position', 1e300, at=21).take(slice(0, 100)))
    refuses("odd: joint 'elbow': position of 1e+300 rad at 0.042 s is impossible", tool,
            tmp_path / 'odd', *(['--model', MODEL] if tool == 'predict' else []))
    assert [path.name for path in tmp_path.iterdir()] == ['odd']


@pytest.mark.parametrize('changes', [
    {},
    {'velocity': None},
    # A person drives the joint, or the motor brakes as it was told to.
    {'current': -strokes().current, 'load': 2.0 * strokes().current},
    {'current': -strokes().current, 'command': -strokes().current},
    {'current': np.zeros(10_000)},
    # Velocities that were logged at other times than the positions: too large and too small.
    {'velocity': strokes().velocity * np.repeat(np.resize([5.0, 0.1, 5.0, 0.1, 1.0], 200), 50)},
    # A weight so heavy that the motor holds back on the way down.
    {'current': strokes().current + 5.0 * np.cos(strokes().position)},
    {'position': strokes().position + 1e3},
    # One that is never negative, but shows its friction; and an amount that is no motor's.
    {'current': strokes().current - strokes().current.min()},
    {'current': np.abs(strokes().current), 'load': 2.0 * strokes().current},
])
def test_plausible_recordings_are_accepted(changes):
    check_plausible(strokes(**changes), 'trial')


@pytest.mark.parametrize('beside_moves', [False, True])
def test_a_joint_whose_weight_depends_on_others_is_not_considered_reversed(tmp_path, beside_moves):
    elbow = strokes()
    phase = 1.3 * elbow.time if beside_moves else 0.0 * elbow.time
    # As the shoulder goes, it lifts the elbow's weight on the way there and lowers it on the way
    # back: at one place the elbow's motor holds more going down than going up.
    weight = 3.0 * np.cos(phase + np.pi)
    shoulder = elbow.with_(joint='shoulder', position=phase, velocity=np.gradient(
        phase, elbow.time), current=weight)
    sign = 1.0 if beside_moves else -1.0
    every = slice(None, None, 5)
    write_samples(tmp_path / 'arm', [
        elbow.with_(current=sign * elbow.current + weight).take(every), shoulder.take(every)])
    if beside_moves:
        read_recording(tmp_path / 'arm', 'elbow')
    else:
        with pytest.raises(InputError, match='effort has the wrong sign'):
            read_recording(tmp_path / 'arm', 'elbow')


def test_noise_alone_is_no_contradiction():
    for seed in range(20):
        draw = np.random.default_rng(seed)
        check_plausible(strokes(current=draw.normal(size=10_000),
                                command=draw.normal(size=10_000)), 'trial')


@needs_data
def test_measured_recordings_pass_and_most_are_refused_reversed():
    refused = passed = 0
    for path in find_recordings(DATA):
        for joint in recorded_joints(path):
            samples, = read_recording(path, joint)
            if samples.load is not None:
                continue
            try:
                check_plausible(samples.with_(current=-samples.current), str(path))
                passed += 1
            except InputError:
                refused += 1
    # The rest never pass one position both ways, or a weight hides their friction.
    assert refused >= 2 * passed > 0
