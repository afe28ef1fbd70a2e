# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The report of `excite`: a planned motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from friction_comp.excitation.plan import JointPlan
from friction_comp.excitation.separation import Pair
from friction_comp.reports.figures import COLOURS, curve, new_figure, styled
from friction_comp.reports.html import Report

_RATE = 50.0  # of the drawn curves, Hz


def excitation_report(plans: Sequence[JointPlan],
                      others: Sequence[Mapping[str, Mapping[Pair, float]]]) -> Report:
    """Return the report; `others` has for each plan the separation by other motions, by name."""
    seconds = plans[0].seconds
    report = Report('Planned motion', f'{len(plans)} joint{"s" * (len(plans) > 1)}, {seconds:g} s')
    worst = min((share, pair, plan.limits.joint) for plan in plans
                for pair, share in plan.separation.items())
    report.verdict(f'**Hardest to distinguish: {_pair_text(worst[1])}** of joint {worst[2]}: '
                   f'{100 * worst[0]:.2g} % of one is independent of the other and of the friction '
                   'curve (Eq. 6).')
    for plan, other in zip(plans, others):
        report.heading(f'Joint {plan.limits.joint}')
        report.figure(_plan_figure(plan), 'Left: position and velocity over time. Right: '
                      'velocity over position; dashed: the limits.')
        report.table(
            ['effects', 'this plan (%)', *(f'{name} (%)' for name in other)],
            [[_pair_text(pair), 100 * share,
              *(100 * separation[pair] for separation in other.values())]
             for pair, share in plan.separation.items()])
    report.text('The percentage is the part of one effect that is independent of the other: the '
                "smallest for several values of the effects' constants. It depends on the motion "
                'alone; whether `refine` finds an effect also depends on noise and on its size.')
    return report


def _pair_text(pair: Pair) -> str:
    return ' and '.join(pair).replace('_', ' ')


@styled
def _plan_figure(plan: JointPlan) -> Figure:
    motion, limits = plan.samples(_RATE), plan.limits
    figure, (left, right) = new_figure(columns=2, height=3.2)
    curve(left, motion.time, motion.position, 'blue', 'position (rad)')
    curve(left, motion.time, motion.velocity, 'orange', 'velocity (rad/s)', linewidth=0.8)
    left.set_xlabel('time (s)')
    left.legend(loc='lower left', bbox_to_anchor=(0.0, 1.0), ncols=2)
    curve(right, motion.position, motion.velocity, 'blue', style='.', markersize=2.0)
    for value in (limits.lowest, limits.highest):
        right.axvline(value, color=COLOURS['grey'], linestyle='--', linewidth=0.8)
    for value in (-limits.velocity, limits.velocity):
        right.axhline(value, color=COLOURS['grey'], linestyle='--', linewidth=0.8)
    right.set(xlabel='position (rad)', ylabel='velocity (rad/s)')
    return figure
