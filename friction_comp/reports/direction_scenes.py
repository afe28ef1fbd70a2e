# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reports of the demo's scenes about directions: a person's intention, and a follower."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.reports.figures import new_figure, styled, thin
from friction_comp.reports.html import Report

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LINE, _SHADE, _FAINT = '#1a2b3d', '#c4661a', '#9aa5b1'
_SHOWN = 0.01  # rad/s of the reference in the picture


def intention_report(trials: dict[str, dict[str, Any]]) -> Report:
    """Return the report; for each source of directions its trial, with 'unknown' the first."""
    page = Report('A person moves a joint, and nobody announces where to',
                  'The same person, joint and law; only the source of the direction differs')
    least, most = trials['announced']['peak'], trials['unknown']['peak']
    page.table(['direction', "peak of the person's torque, N·m",
                'of what an announcement removes'],
               [[name, f'{one["peak"]:.2f}',
                 f'{100.0 * (most - one["peak"]) / max(most - least, 1e-9):.0f} %']
                for name, one in trials.items()])
    page.figure(_intention_figure(trials), "The person's torque in the first movements; shaded "
                'while a direction is known. The less torque, the easier is the joint to move.')
    return page


@styled
def _intention_figure(trials: dict[str, dict[str, Any]]) -> Figure:
    figure, axes = new_figure(len(trials), 1, width=8.4, height=1.6, sharex=True, sharey=True)
    for axis, (name, one) in zip(np.ravel(axes), trials.items()):
        part = one['time'] < 8.0
        time, torque, said = (one[key][part] for key in ('time', 'torque', 'direction'))
        size = 1.1 * max(float(np.abs(trial['torque']).max()) for trial in trials.values())
        for sign in (1, -1):
            axis.fill_between(time, 0.0, sign * size, where=said == sign, color=_SHADE, alpha=0.25,
                              linewidth=0, step='post')
        axis.plot(*thin(time, torque), color=_LINE)
        axis.axhline(0.0, color=_FAINT, linewidth=0.8)
        axis.set_ylim(-size, size)
        axis.set_ylabel(f'{name}\nN·m')
    np.ravel(axes)[-1].set_xlabel('time, s')
    return figure


def follow_report(runs: dict[str, dict[float, dict[str, Any]]]) -> Report:
    """Return the report; for each way to compensate, and each speed in rad/s, its run."""
    page = Report('A follower on slow references',
                  'An MIT-mode controller, 500 frames per second, and what is added to its torque')
    speeds = list(next(iter(runs.values())))
    for key, title in (('rms', 'RMS error'), ('stairs', 'height of the stairs')):
        page.table([f'{title}, mrad', *(f'{speed:g} rad/s' for speed in speeds)],
                   [[way, *(f'{1e3 * own[speed][key]:.1f}' for speed in speeds)]
                    for way, own in runs.items()])
    page.figure(_follow_figure(runs), f'Reference (grey) and joint, {_SHOWN:g} rad/s.')
    return page


@styled
def _follow_figure(runs: dict[str, dict[float, dict[str, Any]]]) -> Figure:
    figure, axes = new_figure(1, len(runs), width=10.0, height=2.8, sharex=True, sharey=True)
    for axis, (way, own) in zip(np.ravel(axes), runs.items()):
        one = own[_SHOWN]
        axis.plot(*thin(one['time'], np.degrees(one['desired'])), color=_FAINT, linewidth=4.0)
        axis.plot(*thin(one['time'], np.degrees(one['position'])), color=_LINE)
        axis.set_title(way, fontsize=9)
        axis.set_xlabel('time, s')
    np.ravel(axes)[0].set_ylabel('angle, deg')
    return figure
