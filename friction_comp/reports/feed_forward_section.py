# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the motor gets before and after refinement, in the report of one joint."""

from __future__ import annotations

from friction_comp.compensation.feed_forward import feed_forward
from friction_comp.refinement.result import RefineResult
from friction_comp.reports.html import Report


def feed_forward_section(page: Report, result: RefineResult, unit: str) -> None:
    """Add a table of what the law feeds forward with both models, and what differs."""
    models = {'before': result.start, 'after': result.model}
    feeds = {name: feed_forward(model) for name, model in models.items()}
    page.heading('What the compensator feeds forward')
    page.table(
        ['model', f'at rest, both directions ({unit})', f'sliding ({unit})',
         f'friction by the model, sliding ({unit})'],
        [[name, *(' and '.join(f'{value:.3g}' for value in values) for values in (
            feed.rest, feed.sliding, feed.friction))] for name, feed in feeds.items()],
        f"The continuous law is run on each model, without gravity and other carried torques: at "
        'rest with the direction announced, and sliding at '
        f"{feeds['after'].speed:.3g} rad/s. At rest it needs the breakaway currents of "
        'identification.')
    page.bullets(feeds['after'].compared(feeds['before']),
                 'With the new model the motor gets clearly more or less than before:')
    page.bullets(feeds['after'].lacking(result.model),
                 'The law feeds forward clearly more or less than the new model says:')
