# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The page on a planned motion: its coverage, and how well it distinguishes effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from friction_comp.excitation.plan import JointPlan
from friction_comp.excitation.separation import Pair
from friction_comp.reports.figures import COLOURS, new_figure, styled
from friction_comp.reports.html import Report

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_RATE = 50.0


def excitation_report(plans: Sequence[JointPlan],
                      others: Sequence[Mapping[str, Mapping[Pair, float]]]) -> Report:
    """Return the page.

    Parameters
    ----------
    plans : sequence of JointPlan
    others : sequence of dict
        For each plan, the separations by other motions of the same length, by name.
    """
    seconds = plans[0].seconds
    report = Report('Planned motion', f'{len(plans)} joint{"s" * (len(plans) > 1)}, {seconds:g} s')
    worst = min((share, pair, plan.limits.joint) for plan in plans
                for pair, share in plan.separation.items())
    report.verdict(f'**Hardest to distinguish: {" and ".join(worst[1])}** of joint {worst[2]}: '
                   f'{100 * worst[0]:.2g} % of one is independent of the other and of Eq. 6.')
    for plan, other in zip(plans, others):
        report.heading(f'Joint {plan.limits.joint}')
        report.figure(_figure(plan), 'Left: position and velocity over time. Right: '
                      'velocity over position; dashed: the limits.')
        report.table(
            ['effects', 'this plan (%)', *(f'{name} (%)' for name in other)],
            [[' and '.join(pair), 100 * share,
              *(100 * separation[pair] for separation in other.values())]
             for pair, share in plan.separation.items()])
    report.text('The share is the smallest over a few constants of each effect, computed from the '
                'columns that refine fits. It depends on the motion alone; whether refine names '
                'an effect also depends on noise and on the size of the effect.')
    return report


@styled
def _figure(plan: JointPlan) -> Figure:
    motion, limits = plan.samples(_RATE), plan.limits
    figure, axes = new_figure(1, 2, height=3.2)
    axes[0].plot(motion.time, motion.position, color=COLOURS['blue'], label='position (rad)')
    axes[0].plot(motion.time, motion.velocity, color=COLOURS['orange'], linewidth=0.8,
                 label='velocity (rad/s)')
    axes[0].set_xlabel('time (s)')
    axes[0].legend(loc='lower left', bbox_to_anchor=(0.0, 1.0), ncols=2)
    axes[1].plot(motion.position, motion.velocity, '.', color=COLOURS['blue'], markersize=2.0)
    for value in (limits.lowest, limits.highest):
        axes[1].axvline(value, color=COLOURS['grey'], linestyle='--', linewidth=0.8)
    for value in (-limits.velocity, limits.velocity):
        axes[1].axhline(value, color=COLOURS['grey'], linestyle='--', linewidth=0.8)
    axes[1].set_xlabel('position (rad)')
    axes[1].set_ylabel('velocity (rad/s)')
    return figure
