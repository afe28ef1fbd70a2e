# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An animated drawing of the joint as recorded, with the person's torque as an arrow.

Angle, arrow and dot always show the measured values of the same time. The animation is plain SVG
without scripts, which plays in a page and in a README.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from friction_comp.reports.figures import COLOURS, INK

# Number of frames of an animation: 25 per second for a movement of 3 s.
_FRAMES = 75
_WIDTH, _HEIGHT = 320, 330
# In SVG units: pivot (x, y) and hand (x) of the arm; length of the longest arrow; left, top, width
# and height of the torque plot.
_X, _Y, _HAND = 70.0, 120.0, 220.0
_ARROW, _PLOT = 78.0, (34.0, 218.0, 268.0, 74.0)
_LETTERS = 'font-family="system-ui, sans-serif" font-size="13"'


@dataclass
class MovingScene:
    """A movement to animate."""

    title: str  # the condition in a few words
    time: np.ndarray  # (N,): increasing, s
    position: np.ndarray  # (N,): rad
    torque: np.ndarray  # (N,): of the person in N·m, positive in the direction of positive angles
    colour: str = 'blue'  # a key of `COLOURS`
    peak: float | None = None  # that is written, N·m; by default the largest of `torque`

    @property
    def largest(self) -> float:
        """The peak torque that is written, N·m."""
        return float(np.nanmax(np.abs(self.torque))) if self.peak is None else self.peak


def moving_joint(scenes: Sequence[MovingScene]) -> list[str]:
    """Return an animated SVG of each scene in the page's text colour, with the same scales."""
    return [
        _svg(_WIDTH, _HEIGHT, f'role="img" aria-label="{escape(scene.title)}: a joint that moves '
             f'as recorded; the person applies up to {scene.largest:.2f} N·m" ', part)
        for scene, part in zip(scenes, _draw_scenes(scenes))]


def moving_picture(scenes: Sequence[MovingScene]) -> str:
    """Return the drawings of `moving_joint` as one SVG file for light and dark pages."""
    parts = ''.join(f'<g transform="translate({k * _WIDTH} 0)">{part}</g>'
                    for k, part in enumerate(_draw_scenes(scenes)))
    return _svg(
        _WIDTH * len(scenes), _HEIGHT, '', f'<style>svg {{ color: {INK}; }} @media '
        f'(prefers-color-scheme: dark) {{ svg {{ color: #e4e9ee; }} }}</style>{parts}') + '\n'


def _svg(width: float, height: float, attributes: str, content: str) -> str:
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
            f'{attributes}{_LETTERS}>{content}</svg>')


def still_joint(position: float, torque: float, largest: float, middle: float) -> str:
    """Return a drawing of the joint at one time; rad and N·m, NaN where not measured.

    `largest` is the torque of the longest arrow, `middle` the position that is drawn horizontally.
    """
    angle = -np.degrees(position - middle) if np.isfinite(position) else 0.0
    height = np.clip(torque / largest, -1, 1) if np.isfinite(torque) else 0.0
    shown = f'{torque:.2f} N·m'.replace('-', '−') if np.isfinite(torque) else 'not measured'
    return _svg(
        _WIDTH, 215, f'width="320" height="215" role="img" color="{INK}" aria-label="Joint at '
        f'{np.degrees(position):.0f} degrees" ',
        f'{_draw_joint(np.array([angle]), np.array([height]), 0, COLOURS["blue"])}'
        f'<text x="8" y="208" fill="currentColor">angle {np.degrees(position):.1f}°, torque of the '
        f'person {shown}</text>')


def _draw_scenes(scenes: Sequence[MovingScene]) -> list[str]:
    begin = max(float(scene.time[0]) for scene in scenes)
    end = min(float(scene.time[-1]) for scene in scenes)
    moments = np.linspace(begin, end, _FRAMES)
    largest = max(float(np.nanmax(np.abs(scene.torque))) for scene in scenes) or 1.0
    middle = float(np.mean([0.5 * (np.nanmin(s.position) + np.nanmax(s.position)) for s in scenes]))
    return [_draw_scene(scene, moments, largest, middle) for scene in scenes]


def _draw_scene(scene: MovingScene, moments: np.ndarray, largest: float, middle: float) -> str:
    position = np.interp(moments, scene.time, scene.position)
    heights = np.interp(moments, scene.time, np.nan_to_num(scene.torque)) / largest
    # Where animations do not run, the frame with the largest torque is shown.
    peak = int(np.argmax(np.abs(heights)))
    seconds = moments[-1] - moments[0]
    timing = f'dur="{seconds:.2f}s" repeatCount="indefinite"'
    x, top, width, height = _PLOT
    across = x + width * (moments - moments[0]) / seconds
    down = top + height * (0.5 - 0.5 * heights)
    curve = ' '.join(f'{a:.1f},{b:.1f}' for a, b in zip(across, down))
    label = top + height + 14 if heights[peak] < 0 else top - 5
    joint = _draw_joint(-np.degrees(position - middle), heights, peak, COLOURS[scene.colour],
                        timing)
    return (
        f'<text x="16" y="22" fill="currentColor" font-weight="600" font-size="15">'
        f'{escape(scene.title)}</text>{joint}'
        f'<line x1="{x}" y1="{top + 0.5 * height}" x2="{x + width}" y2="{top + 0.5 * height}" '
        f'stroke="currentColor" stroke-opacity="0.35"/>'
        f'<polyline points="{curve}" fill="none" stroke="{COLOURS["orange"]}" '
        f'stroke-width="2"/><text x="{np.clip(across[peak], x + 45, x + width - 45):.1f}" '
        f'y="{label:.1f}" text-anchor="middle" fill="currentColor">'
        f'peak {scene.largest:.2f} N·m</text>'
        f'<circle r="5" cx="{across[peak]:.1f}" cy="{down[peak]:.1f}" fill="{COLOURS["orange"]}">'
        f'{_animate("cx", across, timing)}{_animate("cy", down, timing)}</circle>'
        f'<text x="{x}" y="{_HEIGHT - 6}" fill="currentColor" fill-opacity="0.75">torque of the '
        f'person over {seconds:.1f} s</text>')


def _draw_joint(angles: np.ndarray, heights: np.ndarray, shown: int, colour: str,
                timing: str = '') -> str:
    """Return the SVG of upper arm, forearm, and the arrow of the torque at the hand.

    Frame by frame, `angles` are in degrees, clockwise, `heights` relative to the longest arrow;
    `shown` is the frame that is shown without animation.
    """
    turns = [f'{angle:.2f} {_X:g} {_Y:g}' for angle in angles]
    turning = (f'<animateTransform attributeName="transform" type="rotate" '
               f'values="{";".join(turns)}" {timing}/>' if timing else '')
    ends = _Y - _ARROW * heights
    # The arrow head points in the direction of the torque and shrinks to nothing with it.
    sizes = np.sign(heights) * np.minimum(_ARROW * np.abs(heights) / 12.0, 1.0)
    heads = [f'M{_HAND - 8 * abs(s):.1f} {e:.1f}L{_HAND + 8 * abs(s):.1f} {e:.1f}L{_HAND:.1f} '
             f'{e - 13 * s:.1f}Z' for e, s in zip(ends, sizes)]
    orange = COLOURS['orange']
    return (
        f'<line x1="{_X}" y1="{_Y}" x2="{_X}" y2="{_Y - 72}" stroke="currentColor" '
        f'stroke-opacity="0.3" stroke-width="22" stroke-linecap="round"/>'
        f'<line x1="{_X}" y1="{_Y}" x2="{_HAND + 40}" y2="{_Y}" stroke="currentColor" '
        f'stroke-opacity="0.3" stroke-dasharray="3 5"/>'
        f'<g transform="rotate({turns[shown]})">{turning}'
        f'<line x1="{_X}" y1="{_Y}" x2="{_HAND}" y2="{_Y}" stroke="{colour}" '
        f'stroke-width="18" stroke-linecap="round"/><circle cx="{_X}" cy="{_Y}" r="15" '
        f'fill="{colour}"/><circle cx="{_X}" cy="{_Y}" r="6" fill="#fff"/>'
        f'<line x1="{_HAND}" y1="{_Y}" x2="{_HAND}" y2="{ends[shown]:.1f}" stroke="{orange}" '
        f'stroke-width="6">{_animate("y2", ends, timing)}</line>'
        f'<path fill="{orange}" d="{heads[shown]}">{_animate("d", heads, timing)}</path></g>')


def _animate(attribute: str, values: Sequence[str] | np.ndarray, timing: str) -> str:
    """Return the animation of an attribute, '' for a drawing that stands still."""
    if not timing:
        return ''
    texts = (value if isinstance(value, str) else f'{value:.1f}' for value in values)
    return f'<animate attributeName="{attribute}" values="{";".join(texts)}" {timing}/>'
