# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Every effect with parameters in the middle or drawn at random, and motion with all signals."""

from hypothesis import strategies as st
import numpy as np

from friction_comp.model.effects import EFFECTS
from friction_comp.samples import Samples

# Values that any constant may have, so that properties hold for more than one drive.
RANGES = {
    'velocity': (0.005, 1.0), 'exponent': (0.3, 4.0), 'transition': (1e-4, 0.1),
    'reference': (0.1, 2.0), 'position': (-2.0, 2.0), 'frequency': (0.5, 500.0),
    'growth': (0.0, 2.0), 'speed': (0.1, 2.0), 'width': (0.005, 1.0),
    'reference_temperature': (10.0, 40.0), 'time_constant': (0.1, 1000.0),
    'distance': (1e-4, 1.0), 'gap': (1e-4, 1.0), 'cosine': (-2.0, 2.0), 'sine': (-2.0, 2.0),
    'slope': (-1.0, 1.0),
    # Live there is no acceleration: with it, live and offline are not the same.
    'inertia': (0.0, 0.0)}
MIDDLE = {'transition': 0.02, 'exponent': 2.0, 'offset': 0.0, 'directional': 1.0, 'growth': 0.0,
          'position': 0.3, 'width': 0.1, 'speed': 1.0, 'reference': 1.0, 'velocity': 0.1,
          'frequency': 12.0, 'time_constant': 2.0, 'distance': 0.05, 'gap': 0.04,
          'reference_temperature': 25.0, 'cosine': 0.5, 'sine': 0.2, 'slope': 0.1, 'inertia': 0.0,
          'with_inertia': 0.0, 'fading': 0.0}


@st.composite
def parameters_of(draw, name):
    """Draw parameters of an effect; constants without a range are switches."""
    count = (len(EFFECTS[name].units) or 1)
    found = {key: draw(st.floats(*RANGES[key]) if key in RANGES else st.sampled_from([0.0, 1.0]))
             for key in EFFECTS[name].constants}
    return {**found, 'coefficients': draw(
        st.lists(st.floats(-2.0, 2.0), min_size=count, max_size=count))}


def defaults(name, /, **changes):
    """Return parameters in the middle of everything, all coefficients 0.1."""
    # Squared, the bend is zero at its reference.
    own = {'hysteresis': {'exponent': 1.0}, 'viscous_shape': {'exponent': 3.0}}.get(name, {})
    found = {key: {**MIDDLE, **own}[key] for key in EFFECTS[name].constants}
    return {**found, 'coefficients': [0.1] * (len(EFFECTS[name].units) or 1), **changes}


def samples_of(position, velocity, step=0.01, load=1.5, temperature=35.0):
    """Return samples of a motion with every signal that an effect may need."""
    position, velocity = np.broadcast_arrays(
        np.asarray(position, dtype=float), np.asarray(velocity, dtype=float))
    time = step * np.arange(len(position))
    return Samples(
        time=time, position=position.copy(), velocity=velocity.copy(),
        current=np.zeros_like(time), acceleration=np.gradient(velocity, step),
        load=np.full_like(time, load), temperature=np.full_like(time, temperature),
        rigid_body=np.full_like(time, load), coupling=np.full_like(time, 0.1))
