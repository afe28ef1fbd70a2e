# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An angle that wraps around is continued before its values are interpolated to other times."""

import numpy as np
import pytest

from friction_comp.facts.motion import at_times, turns_of
from friction_comp.recordings import read_recording_with_info

WRAPS = {'position [rad]': (1.0, -np.pi), 'angle_rad': (1.0, 0.0), 'position [deg]': (
    180.0 / np.pi, -np.pi)}


def turning(time):
    """Give a joint that turns several times each way."""
    return 9.0 * np.sin(0.2 * time) + 0.3 * np.sin(1.3 * time)


def wrapped(angle, low):
    return low + np.mod(angle - low, 2.0 * np.pi)


@pytest.mark.parametrize('name', WRAPS)
@pytest.mark.parametrize('rate', [20.0, 100.0])
def test_positions_between_the_rows_of_an_effort_are_no_means_across_a_wrap(tmp_path, name, rate):
    factor, low = WRAPS[name]
    slow = np.arange(0.0, 60.0, 1.0 / rate)
    lines = [(t, f'{t:.5f},{factor * q:.6f},') for t, q in zip(slow, wrapped(turning(slow), low))]
    fast = slow[:-1] + 0.37 / rate
    noise = np.random.default_rng(1).standard_normal(len(fast))
    effort = np.sign(np.cos(0.2 * fast)) + 0.01 * noise
    lines += [(t, f'{t:.5f},,{tau:.5f}') for t, tau in zip(fast, effort)]
    (tmp_path / 'log.csv').write_text('\n'.join(
        [f'time [s],{name},effort [Nm]', *(text for _, text in sorted(lines))]), encoding='utf-8')
    (samples, info), = read_recording_with_info(tmp_path / 'log.csv')
    off = samples.position - turning(samples.time + info.start)
    assert np.ptp(off) < 0.01
    # Whole turns, as of where it began.
    turns = float(np.mean(off)) / (2.0 * np.pi)
    assert turns == pytest.approx(round(turns), abs=0.01)


def test_turns_are_added_within_usual_steps_and_for_slow_joints_only():
    time = np.arange(0.0, 20.0, 0.05)
    angle = wrapped(turning(time), -np.pi)
    np.testing.assert_allclose(angle + 2.0 * np.pi * turns_of(time, angle), turning(time))
    degrees = np.degrees(angle)
    np.testing.assert_allclose(degrees + 360.0 * turns_of(time, degrees, 360.0),
                               np.degrees(turning(time)))
    between = time[:-1] + 0.02
    np.testing.assert_allclose(
        at_times(between, time, angle, turn=2.0 * np.pi), turning(between), atol=2e-3)
    # A joint may have been anywhere after a gap, and one that jumps all the time is no angle.
    assert not turns_of(np.array([0.0, 0.05, 0.1, 2.0]), np.array([3.1, 3.1, 3.1, -3.1])).any()
    assert not turns_of(time, np.pi * np.sign(np.sin(40.0 * time))).any()
    assert not turns_of(time, 0.1 * angle).any()
