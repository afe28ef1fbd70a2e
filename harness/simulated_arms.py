# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""URDF files of random arms, and recordings of arms, whose torques come from Pinocchio."""

import numpy as np

from friction_comp.samples import JointStates, Samples


def link(name, mass, centre, inertia):
    """Return the text of a link; inertia about the centre of mass, shape (3, 3)."""
    xx, xy, xz, yy, yz, zz = (inertia[i][j] for i, j in (
        (0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)))
    return (f'<link name="{name}"><inertial><mass value="{mass!r}"/>'
            f'<origin xyz="{" ".join(repr(float(x)) for x in centre)}" rpy="0 0 0"/>'
            f'<inertia ixx="{xx!r}" ixy="{xy!r}" ixz="{xz!r}" iyy="{yy!r}" iyz="{yz!r}" '
            f'izz="{zz!r}"/></inertial></link>')


def joint(name, kind, parent, child, place, turn, axis):
    """Return the text of a joint."""
    def text(values):
        return ' '.join(repr(float(x)) for x in values)
    limit = '' if kind in ('continuous', 'fixed') else (
        '<limit lower="-3" upper="3" effort="100" velocity="5"/>')
    return (f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{text(place)}" rpy="{text(turn)}"/><axis xyz="{text(axis)}"/>{limit}'
            '</joint>')


def random_urdf(rng, size, kinds=('revolute', 'prismatic', 'continuous'), branches=0.3):
    """Return the URDF text of a random tree, and its joints' names.

    A share of links branches off. Between two joints there may be a fixed one, so that a joint
    carries several links.
    """
    parts, names = [link('base', 1.0, np.zeros(3), np.eye(3).tolist())], []
    bodies = ['base']
    for k in range(size):
        parent = bodies[rng.integers(len(bodies))] if (
            rng.random() < branches) else bodies[-1]
        if rng.random() < 0.3:
            parts += [random_link(rng, f'plate{k}'), joint(
                f'screw{k}', 'fixed', parent, f'plate{k}', rng.normal(size=3) * 0.2,
                rng.normal(size=3), (1, 0, 0))]
            parent = f'plate{k}'
        kind = kinds[rng.integers(len(kinds))]
        axis = rng.normal(size=3) if rng.random() < 0.5 else np.eye(3)[rng.integers(3)]
        axis = axis / np.linalg.norm(axis)
        names.append(f'joint_{k + 1}')
        parts += [random_link(rng, f'link{k}'), joint(
            names[-1], kind, parent, f'link{k}', rng.normal(size=3) * 0.3, rng.normal(size=3),
            axis)]
        bodies.append(f'link{k}')
    return f'<robot name="random">{"".join(parts)}</robot>', names


def random_link(rng, name):
    """Return a link with random mass and a possible random inertia."""
    mass = float(rng.uniform(0.5, 3.0))
    points = rng.normal(size=(3, 6)) * 0.1
    spread = points @ points.T * mass / 6
    inertia = (np.trace(spread) * np.eye(3) - spread)
    return link(name, mass, rng.normal(size=3) * 0.1, inertia.tolist())


PLANE = ('turn', 'lift', 'bend')
# Of the small arm's drives: A per N·m; offset, Coulomb, viscous and rotor, in A.
SCALES = (0.4, 0.25, 0.5)
FRICTION = ((0.02, 0.3, 0.2, 0.05), (-0.03, 0.4, 0.3, 0.04), (0.0, 0.2, 0.1, 0.02))
# kg, where the small arm's URDF says 4, 3 and 2.
MASSES = (5.0, 2.2, 2.6)


def small_arm(masses=(4.0, 3.0, 2.0)):
    """Return the URDF text of an arm of three joints: one vertical, two horizontal axes."""
    parts = [link('base', 1.0, np.zeros(3), np.eye(3).tolist())]
    lengths, places = (0.2, 0.4, 0.3), ((0, 0, 0.1), (0, 0, 0.2), (0.4, 0, 0))
    axes = ((0, 0, 1), (0, 1, 0), (0, 1, 0))
    before = 'base'
    for name, mass, length, place, axis in zip(PLANE, masses, lengths, places, axes):
        thin = mass * length ** 2 / 12
        centre = (0, 0, length / 2) if name == 'turn' else (length / 2, 0, 0)
        size = np.diag([thin, thin, 0.1 * thin] if name == 'turn' else [0.1 * thin, thin, thin])
        parts += [link(f'of_{name}', mass, centre, size.tolist()),
                  joint(name, 'revolute', before, f'of_{name}', place, (0, 0, 0), axis)]
        before = f'of_{name}'
    return f'<robot name="small">{"".join(parts)}</robot>'


def waves(rng, size, joints, step, fastest=0.5):
    """Return position, velocity and acceleration of sums of sines, each of shape (N, J)."""
    t = np.arange(size) * step
    frequency = 2 * np.pi * rng.uniform(0.05, fastest, (4, joints))
    phase = rng.uniform(0, 2 * np.pi, (4, joints))
    share = 0.4 * rng.uniform(0.3, 1.0, (4, joints))
    angle = frequency * t[:, None, None] + phase
    return ((share * np.sin(angle)).sum(axis=1), (share * frequency * np.cos(angle)).sum(axis=1),
            (-share * frequency ** 2 * np.sin(angle)).sum(axis=1))


def recorded(urdf, names, motion, scales, friction, rng, noise=0.02, step=0.01):
    """Return one `Samples` a joint of an arm whose links are those of a URDF text.

    `scales`: A per N·m of each joint. `friction`: offset, Coulomb, viscous and rotor of each, in A.
    `noise`: A. `step`: s.
    """
    import pinocchio
    model = pinocchio.buildModelFromXML(urdf)
    data = model.createData()
    q, v, a = motion
    order = [model.getJointId(name) - 1 for name in names]
    torque = np.empty_like(q)
    for n in range(len(q)):
        state = [np.empty(len(order)) for _ in range(3)]
        for values, row in zip(state, (q[n], v[n], a[n])):
            values[order] = row
        torque[n] = pinocchio.rnea(model, data, *state)[order]
    samples, arm = [], JointStates(tuple(names), q, v)
    for k, name in enumerate(names):
        offset, coulomb, viscous, rotor = friction[k]
        current = (scales[k] * torque[:, k] + offset + coulomb * np.tanh(v[:, k] / 0.01)
                   + viscous * v[:, k] + rotor * a[:, k] + noise * rng.standard_normal(len(q)))
        samples.append(Samples(time=np.arange(len(q)) * step, position=q[:, k], velocity=v[:, k],
                               current=current, arm=arm, joint=name))
    return samples
