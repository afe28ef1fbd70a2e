# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Draws the README's first picture: ``python3 docs/moving_picture.py`` writes docs/moving.svg."""

from __future__ import annotations

from pathlib import Path

from friction_comp.evaluation.sessions import evaluate_recordings
from friction_comp.reports.evaluation_report import scenes_of
from friction_comp.reports.moving_joint import moving_picture

ROOT = Path(__file__).resolve().parent.parent


def picture() -> str:
    """Return the picture."""
    evaluation, = evaluate_recordings([ROOT / 'examples' / 'elbow'])
    return moving_picture(scenes_of(evaluation))


if __name__ == '__main__':
    (ROOT / 'docs' / 'moving.svg').write_text(picture(), encoding='utf-8')
