# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the motor gets with a model, compared with another model and with what the model says."""

from dataclasses import replace

from helpers import note_model
import numpy as np
import pytest

from friction_comp.compensation.feed_forward import CHANGED, feed_forward
from friction_comp.model.effects import EFFECTS


def scaled(model, factor):
    sigmoid, breakaway = model.sigmoid, model.breakaway
    return replace(
        model, sigmoid=replace(sigmoid, upper=factor * sigmoid.upper, viscous=(
            factor * sigmoid.viscous), lower=factor * sigmoid.lower),
        breakaway=replace(breakaway, positive_mean=factor * breakaway.positive_mean,
                          negative_mean=factor * breakaway.negative_mean))


@pytest.mark.parametrize('number', [1, 2, 3])
def test_the_notes_drives_get_nine_tenths_of_their_friction(number):
    model = note_model(number)
    feed = feed_forward(model)
    assert feed.rest == pytest.approx(0.9 * np.array([model.breakaway.positive_mean] * 2))
    speeds = np.array([feed.speed, -feed.speed])
    assert feed.friction == pytest.approx(np.abs(model.sigmoid(speeds)), rel=1e-3)
    assert feed.sliding == pytest.approx(0.9 * feed.friction, rel=0.04)
    assert not feed.lacking(model)


def test_a_model_that_gives_the_motor_less_is_told_with_both_figures():
    model = note_model(1)
    before, little, much = (feed_forward(scaled(model, k)) for k in (1.0, 1.05, 1.3))
    assert not little.compared(before)
    rest, sliding = much.compared(before)
    assert 'at rest, 0.116 A instead of 0.0896 A' in rest
    assert sliding.startswith('sliding')
    assert CHANGED < 0.3


def test_carried_torque_and_the_arm_do_not_count():
    model = note_model(1)
    heavy = replace(model, effects=[EFFECTS['gravity']({'coefficients': [1.0, 0.5]})])
    assert feed_forward(heavy).compared(feed_forward(model)) == []


def test_friction_written_as_hysteresis_is_fed_forward_alike_or_told():
    model = note_model(1)
    before, share = feed_forward(model), 0.08
    bristles = EFFECTS['hysteresis']({
        'coefficients': [share, 0.0], 'distance': 1.4e-3, 'exponent': 1.0, 'transition': 0.01})
    moved = replace(model, effects=[bristles], sigmoid=replace(
        model.sigmoid, upper=model.sigmoid.upper - share, lower=model.sigmoid.lower + share))
    feed = feed_forward(moved)
    assert feed.friction == pytest.approx(before.friction, rel=0.02)
    same = np.allclose(feed.rest, before.rest, rtol=CHANGED)
    assert any('at rest' in text for text in feed.compared(before)) != same
    assert any('at rest' in text for text in feed.lacking(moved)) != same
