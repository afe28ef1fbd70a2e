# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Movements guided by hand become exercises: waypoints, and every reversal's direction."""

import numpy as np

from friction_comp.exercise.exercise_script import exercise_of
from friction_comp.exercise.taught_exercise import teach

DEGREE = np.pi / 180.0


def _bell(share):
    share = np.clip(share, 0.0, 1.0)
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


def guided(random, joints):
    """Return time, positions and for each joint its moves: begin, end (s), way (rad)."""
    moves = []
    for _ in range(joints):
        own, time = [], random.uniform(0.5, 2.0)
        for _ in range(random.integers(3, 7)):
            way = random.choice([-1.0, 1.0]) * random.uniform(5.0, 60.0) * DEGREE
            took = abs(way) / (random.uniform(10.0, 40.0) * DEGREE) + 0.3
            own.append((time, time + took, way))
            # On at once, as at a reversal, or after a rest.
            time += took + random.choice([0.0, random.uniform(0.8, 3.0)])
        moves.append(own)
    time = np.arange(0.0, max(own[-1][1] for own in moves) + 1.0, 2e-3)
    path = np.array([sum(way * _bell((time - begin) / (end - begin)) for begin, end, way in own)
                     for own in moves]).T
    tremor = random.uniform(0.0, 0.15, joints) * DEGREE * np.sin(
        2.0 * np.pi * random.uniform(6.0, 11.0, joints) * time[:, None])
    return time, np.round((path + tremor) / 1e-4) * 1e-4, moves


def taught(draws, seed):
    """Return the largest error of a turning point in deg, missed and extra turns, and turns."""
    random = np.random.default_rng([seed, 441])
    worst, missed, extra, total = 0.0, 0, 0, 0
    for _ in range(draws):
        time, path, moves = guided(random, int(random.integers(1, 4)))
        names = [f'joint{j}' for j in range(path.shape[1])]
        script = exercise_of(teach(names, time, path).document)
        grid = np.arange(0.0, script.duration, 0.01)
        played = np.array([script.at(t)[0] for t in grid])
        said = np.array([script.at(t)[2] for t in grid])
        for j, own in enumerate(moves):
            places = np.concatenate([[0.0], np.cumsum([way for _, _, way in own])])
            ways = np.sign([way for _, _, way in own])
            turns = [places[k] for k in range(1, len(own)) if ways[k] != ways[k - 1]]
            wanted = [ways[0], *(ways[k] for k in range(1, len(own)) if ways[k] != ways[k - 1])]
            signs = said[:, j][said[:, j] != 0]
            found = signs[np.concatenate([[True], np.diff(signs) != 0])]
            total += len(wanted)
            missed += max(0, len(wanted) - len(found))
            extra += max(0, len(found) - len(wanted))
            offset = played[0, j]
            for place in [*turns, places[-1]]:
                worst = max(worst, float(np.abs(played[:, j] - offset - place).min()) / DEGREE)
    return worst, missed, extra, total
