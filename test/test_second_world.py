# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The second simulator of test recordings: its physics, and its stated error floors."""

from dataclasses import replace

import numpy as np
import pytest

from second_world import oracle
from second_world.cases import make
from second_world.families import draw
from world import arm, motion
from world.drive import Controller, DT, simulate
from world.joint import carried, Joint, new_state, resistance


@pytest.mark.slow
def test_motor_work_is_stored_or_dissipated():
    """In A rad, with the currents taken as torque over k_t n."""
    joint = Joint(inertia=0.05, coulomb=0.4, viscous=0.2, gravity=1.3, gravity_phase=0.4,
                  spring=0.5, stribeck=0.6)
    reference = motion.KINDS['joystick'](np.random.default_rng(3), 4.0, 0.8, 1.5)
    trace = simulate(joint, Controller(proportional=40.0, derivative=2.0, integral=20.0),
                     arm.Chain(), 0, reference)
    work = np.sum(trace.current * trace.v) * DT
    kinetic = 0.5 * joint.inertia * (trace.v[-1] ** 2 - trace.v[0] ** 2)
    height = [-joint.gravity * np.cos(q + joint.gravity_phase)
              + 0.5 * joint.spring * (q - joint.spring_centre) ** 2 + joint.offset * q
              for q in (trace.q[0], trace.q[-1])]
    state = new_state(trace.q[0])
    lost = 0.0
    for t, q, v in zip(trace.time, trace.q, trace.v):
        total = resistance(joint, state, t, q, v, 0.0, 0.0, DT)
        lost += (total - carried(joint, q, v, 0.0)) * v * DT
    assert lost > 0.3
    assert work == pytest.approx(kinetic + height[1] - height[0] + lost, abs=0.01 * lost)


@pytest.mark.parametrize('number', [0, 1])
def test_chain_agrees_with_the_two_link_arm_of_textbooks(number):
    m1, m2, l1, r1, r2, i1, i2 = 2.0, 1.5, 0.4, 0.15, 0.2, 0.02, 0.03
    chain = arm.Chain(np.array([m1, m2]), np.array([l1, 0.3]), np.array([r1, r2]),
                      np.array([i1, i2]))
    q, v, a = np.array([0.4, -0.9]), np.array([1.2, -0.7]), np.array([2.0, 3.0])
    c2, h = np.cos(q[1]), m2 * l1 * r2 * np.sin(q[1])
    m22 = i2 + m2 * r2 ** 2
    m12 = m22 + m2 * l1 * r2 * c2
    m11 = i1 + m1 * r1 ** 2 + i2 + m2 * (l1 ** 2 + r2 ** 2 + 2 * l1 * r2 * c2)
    g2 = m2 * arm.G * r2 * np.cos(q[0] + q[1])
    g1 = (m1 * r1 + m2 * l1) * arm.G * np.cos(q[0]) + g2
    expected = (m11 * a[0] + m12 * a[1] - h * (2 * v[0] * v[1] + v[1] ** 2) + g1,
                m12 * a[0] + m22 * a[1] + h * v[0] ** 2 + g2)
    assert arm.torque(chain, number, q, v, a, arm.G) == pytest.approx(expected[number])


@pytest.mark.parametrize('family', ['none', 'gravity', 'load', 'temperature', 'ripple', 'rest',
                                    'presliding', 'lag', 'other_joints', 'product'])
def test_the_true_law_leaves_the_noise_of_current_and_no_more(family):
    case = draw(family, 0)
    case = replace(case, fit_sensors=replace(
        case.fit_sensors, noise_memory=0.0, current_quantum=0.0, jitter=0.0))
    trace, seen = make(case, 'fit')
    assert oracle.noise_floor(case, trace, seen) == pytest.approx(case.fit_sensors.noise, rel=0.2)
