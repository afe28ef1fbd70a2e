# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Works out, from the numbers that the technical note prints, where they contradict each other."""

from __future__ import annotations

from friction_comp.note.published import EXPERIMENTS

# As printed: Eq. 11 row by row, gear ratios, breakaway currents (A), peaks with d = 0 (N·m).
ROWS = ((0.1101, 1.2456, 0.1359, 1.1671, 1.4959, 0.0008),
        (0.8896, 3.0735, 0.3082, 2.4381, 0.8727, 0.0032),
        (0.3629, 1.1022, 0.3000, 2.2795, 1.8775, 0.0027))
RATIO = [experiment.model().drive.gear_ratio for experiment in EXPERIMENTS]
BREAKAWAY = [experiment.breakaway for experiment in EXPERIMENTS]
PEAK = [experiment.peak_kinetic for experiment in EXPERIMENTS]
TORQUE_CONSTANT, GAIN = 0.119, 0.9
# Which row belongs to which configuration, after the correction.
SWAPPED = (0, 2, 1)


def tables() -> list[list[str]]:
    """Return the rows of the page's three tables, as they are written there."""
    plateau = [row[0] / row[3] for row in ROWS]
    found = [[f'configuration {k + 1}', f'{plateau[k]:.3f}', f'{plateau[SWAPPED[k]]:.3f}',
              f'{BREAKAWAY[k]:.3f}'] for k in (1, 2)]
    for k in range(3):
        torque = TORQUE_CONSTANT * RATIO[k] * BREAKAWAY[k]
        found.append([f'configuration {k + 1}', f'{torque:.2f}', f'{PEAK[k]:.2f}',
                      f'{PEAK[k] / torque:.2f}'])
    for k in range(3):
        c = ROWS[SWAPPED[k]]
        rest = (c[0] - c[2]) / (c[3] + c[4])
        shares = [(sign * rest + GAIN * BREAKAWAY[k]) / BREAKAWAY[k] for sign in (1, -1)]
        found.append([f'configuration {k + 1}' + ' (rows swapped)' * bool(k),
                      f'{1e3 * rest:.1f}'.replace('-', '\u2212'),
                      *(f'{share:.2f}' for share in shares)])
    return found


def sentences() -> list[str]:
    """Return the figures that stand in the page's sentences."""
    left = (1.0 - GAIN) * TORQUE_CONSTANT * RATIO[2] * BREAKAWAY[2]
    ramp = 0.06 * 2.35, 0.06 * (7.6 - 5.0)
    off = (ramp[1] - BREAKAWAY[1]) / EXPERIMENTS[1].breakaway_std
    count = 360.0 / 4000.0 / RATIO[0] / 1e-3
    return [f'{left:.2f} N·m', f'{1e3 * ramp[0]:.0f} mA', f'{1e3 * ramp[1]:.0f} mA',
            f'{off:.1f} standard deviations', f'{count:.1f} deg/s']


if __name__ == '__main__':
    for cells in tables():
        print('| ' + ' | '.join(cells) + ' |')
    print(*sentences(), sep='\n')
