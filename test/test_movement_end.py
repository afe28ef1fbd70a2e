# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Beyond the announced end of a movement nothing pushes on."""

from dataclasses import replace
import math

from helpers import LEVEL, note_model, small_model
import numpy as np
import pytest

from friction_comp.compensation.law import CompensationLaw
from friction_comp.compensation.law_kernel import LATE
from friction_comp.compensation.law_parameters import SHARE
from friction_comp.compensation.safety import END_BRAKE, END_MARGIN
from friction_comp.simulation.joint import Plant

DEGREE = math.pi / 180.0
HELP = SHARE - 0.5 * LATE     # some is withheld of a way that has lasted


class Path:
    """A law whose joint is led along a path."""

    def __init__(self, law='continuous'):
        self.law = CompensationLaw([small_model()], law=law)
        self.place, self.time = 0.0, 0.0

    def to(self, place, direction, end=math.nan, speed=0.2):
        """Go there in a straight line, or rest for half a second; return the last current, A."""
        count = round(abs(place - self.place) / speed * 1e3) or 500
        for where in np.linspace(self.place, place, count + 1)[1:]:
            self.time += 1e-3
            current = self.law.update(self.time, [where], None, [direction], end=[end])[0]
        self.place = place
        return current

    @property
    def beyond(self):
        return bool(self.law.guards['beyond the end'][0])


def test_outside_the_announced_movement_help_is_inwards_only():
    path = Path()
    assert path.to(0.3, 1, 0.5) == pytest.approx(HELP * LEVEL, rel=0.03)
    # As the direction ceases where a movement decelerates, its end remains.
    within = path.to(0.51, 0)
    assert within == pytest.approx(HELP * LEVEL * (1.0 - 0.01 / END_MARGIN), rel=0.03)
    assert path.to(0.5 + 1.1 * END_MARGIN, 0) == 0.0
    assert path.beyond
    assert path.to(0.4, 0) == pytest.approx(-HELP * LEVEL, rel=0.03)
    # A movement without an end has none.
    assert path.to(0.6, 1) == pytest.approx(HELP * LEVEL, rel=0.03)
    assert path.to(0.8, 0) == pytest.approx(HELP * LEVEL, rel=0.03)


def test_who_brakes_gently_to_the_end_keeps_all_help_and_who_runs_to_it_does_not():
    path, endless, brake = Path(), Path(), 0.9 * END_BRAKE
    for left in np.arange(0.45, 0.04, -1e-3):
        place, speed = 1.0 - 0.5 * brake * left**2, brake * left
        assert path.to(place, 1, 1.0, speed) == endless.to(place, 1, speed=speed) > 0.5 * LEVEL
    # At such a speed as far before the place where all help ends, half of it is enough.
    speed = 2.0 * END_BRAKE * 0.4
    path = Path()
    path.to(0.0, 1, 1.0)
    place = 1.0 + END_MARGIN - 0.25 * speed**2 / END_BRAKE
    assert path.to(place, 1, 1.0, speed=speed) == pytest.approx(0.45 * LEVEL, rel=0.05)


def test_the_end_holds_until_another_movement_is_announced_or_the_joint_rests():
    path = Path()
    path.to(0.5, 1, 0.4)
    assert path.beyond
    # Nor does the same announcement count again, at rest or inside.
    assert abs(path.to(0.5, 1, 0.4)) < 1e-3
    path.to(0.3, 1, 0.4)
    assert abs(path.to(0.3, 1, 0.4)) < 1e-3
    assert path.to(0.3, 1, 0.7) == pytest.approx(HELP * LEVEL, rel=0.03)
    assert not path.beyond
    path.to(0.8, 1, 0.7)
    path.to(0.8, 0)
    assert not path.beyond
    assert path.to(0.9, 0) == pytest.approx(HELP * LEVEL, rel=0.03)


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_a_joint_let_go_whose_friction_is_lower_than_its_model_stays_near_the_end(side):
    """The model is that of a drive whose friction is 0.70 of what was identified."""
    model = note_model(2)
    identified = replace(model, sigmoid=replace(model.sigmoid, **{
        name: getattr(model.sigmoid, name) / 0.7 for name in ('upper', 'lower', 'viscous')}))
    farthest = {}
    for end in (side * 20.0 * DEGREE, math.nan):
        plant, law = Plant([model], 1), CompensationLaw([identified])
        for k in range(6000):
            state = plant.state
            current = law.update(1e-3 * k, state.position, None, [side], end=[end])
            wish = (side * 0.35e-3 * k, side * 0.35) if k < 800 else (math.nan, math.nan)
            plant.step(current, [wish[0]], [wish[1]], [k < 800])
        farthest[end] = side * plant.state.position[0] / DEGREE
    assert farthest[side * 20.0 * DEGREE] < 25.0
    assert farthest[math.nan] > 40.0


def test_the_laws_without_memory_lose_the_direction_beyond_the_end():
    path = Path('paper')
    start = path.to(0.0, 1, 0.4, 1.0)
    assert start > 0.5 * LEVEL
    path.to(0.5, 1, 0.4)
    assert path.to(0.5, 1, 0.4) == 0.0
    # They know no rest: the movement is over as soon as nothing is announced.
    path.to(0.0, 0)
    assert path.to(0.0, 1, 0.4) == start
