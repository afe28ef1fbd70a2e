# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An animated drawing of the joint as recorded, with the person's torque as an arrow.

One principle: **the drawing is the recording**. Angle, arrow and dot show the measured curves at
the same time. The animation is plain SVG without scripts, which plays in a page and in a README.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from friction_comp.reports.figures import COLOURS

# Number of frames of an animation: 25 per second for a movement of 3 s.
_FRAMES = 75
_WIDTH, _HEIGHT = 320, 330
_PIVOT, _ARM = (70.0, 120.0), 150.0
# Font; length of the longest arrow, and the plot of the torque: left, top, width, height.
_LETTERS = 'font-family="system-ui, sans-serif" font-size="13"'
_ARROW, _PLOT = 78.0, (34.0, 218.0, 268.0, 74.0)


@dataclass
class MovingScene:
    """A movement to animate.

    Parameters
    ----------
    title : str
        The condition in a few words.
    time : ndarray, shape (N,)
        Increasing times, s.
    position : ndarray, shape (N,)
        Joint position, rad.
    torque : ndarray, shape (N,)
        Torque of the person in N·m, positive in the direction of positive angles.
    colour : str
        A key of `friction_comp.reports.figures.COLOURS`.
    """

    title: str
    time: np.ndarray
    position: np.ndarray
    torque: np.ndarray
    colour: str = 'blue'


def moving_joint(scenes: Sequence[MovingScene]) -> list[str]:
    """Return an animated drawing of each scene, all with the same time and scales.

    Parameters
    ----------
    scenes : sequence of MovingScene

    Returns
    -------
    list of str
        SVG in the page's text colour.
    """
    return [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" '
        f'aria-label="{escape(scene.title, quote=True)}: a joint that moves as recorded; the '
        f'person gives up to {np.nanmax(np.abs(scene.torque)):.2f} N·m" {_LETTERS}>{part}</svg>'
        for scene, part in zip(scenes, _draw_scenes(scenes))]


def moving_picture(scenes: Sequence[MovingScene]) -> str:
    """Return the drawings of `moving_joint` as one SVG file for light and dark pages."""
    parts = ''.join(f'<g transform="translate({k * _WIDTH} 0)">{part}</g>'
                    for k, part in enumerate(_draw_scenes(scenes)))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH * len(scenes)} {_HEIGHT}" '
        f'{_LETTERS}><style>svg {{ color: #1a2b3d; }} @media (prefers-color-scheme: dark) '
        f'{{ svg {{ color: #e4e9ee; }} }}</style>{parts}</svg>\n')


def _draw_scenes(scenes: Sequence[MovingScene]) -> list[str]:
    begin = max(float(scene.time[0]) for scene in scenes)
    end = min(float(scene.time[-1]) for scene in scenes)
    moments = np.linspace(begin, end, _FRAMES)
    largest = max(float(np.nanmax(np.abs(scene.torque))) for scene in scenes) or 1.0
    middle = float(np.mean([0.5 * (np.nanmin(s.position) + np.nanmax(s.position))
                            for s in scenes]))
    return [_draw_scene(scene, moments, largest, middle) for scene in scenes]


def still_joint(position: float, torque: float, largest: float, middle: float) -> str:
    """Return a drawing of the joint at one time, for a page that updates it.

    Parameters
    ----------
    position : float
        Joint position, rad.
    torque : float
        Torque of the person, N·m; NaN where it is not measured.
    largest : float
        Torque of the longest arrow, N·m.
    middle : float
        Position that is drawn horizontally, rad.
    """
    angle = -np.degrees(position - middle) if np.isfinite(position) else 0.0
    length = _ARROW * np.clip(torque / largest, -1, 1) if np.isfinite(torque) else 0.0
    torque_text = (f'{torque:.2f} N·m'.replace('-', '−') if np.isfinite(torque)
                   else 'not measured')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} 215" width="320" '
        f'height="215" role="img" aria-label="Joint at {np.degrees(position):.0f} degrees" '
        f'font-family="system-ui, sans-serif" font-size="13">{_draw_base("#1a2b3d")}'
        f'<g transform="rotate({angle:.2f} {_PIVOT[0]} {_PIVOT[1]})">{_draw_arm(COLOURS["blue"])}'
        f'{_draw_arrow(f"{-length:.1f}", COLOURS["orange"])}</g>'
        f'<text x="8" y="208" fill="#1a2b3d">angle {np.degrees(position):.1f}°, torque of the '
        f'person {torque_text}</text></svg>')


def _draw_scene(scene: MovingScene, moments: np.ndarray, largest: float, middle: float) -> str:
    ink = 'currentColor'
    position = np.interp(moments, scene.time, scene.position)
    torque = np.interp(moments, scene.time, np.nan_to_num(scene.torque))
    colour = COLOURS[scene.colour]
    angles = ';'.join(f'{-np.degrees(value - middle):.2f} {_PIVOT[0]:g} {_PIVOT[1]:g}'
                      for value in position)
    timing = f'dur="{moments[-1] - moments[0]:.2f}s" repeatCount="indefinite"'
    lengths = -_ARROW * torque / largest
    x, top, width, height = _PLOT
    across = x + width * (moments - moments[0]) / (moments[-1] - moments[0])
    down = top + height * (0.5 - 0.5 * torque / largest)
    curve = ' '.join(f'{a:.1f},{b:.1f}' for a, b in zip(across, down))
    peak = int(np.argmax(np.abs(torque)))
    # Without animation, the time of the largest torque is shown.
    at = f'{angles.split(";")[peak]}'
    value = f'{abs(torque[peak]):.2f} N·m'
    label = top + (height if torque[peak] < 0 else 0) + (14 if torque[peak] < 0 else -5)
    return (
        f'<text x="16" y="22" fill="{ink}" font-weight="600" font-size="15">'
        f'{escape(scene.title)}</text>{_draw_base(ink)}'
        f'<g transform="rotate({at})"><animateTransform attributeName="transform" type="rotate" '
        f'values="{angles}" {timing}/>{_draw_arm(colour)}'
        f'{_draw_arrow(f"{lengths[peak]:.1f}", COLOURS["orange"], lengths, timing)}</g>'
        f'<line x1="{x}" y1="{top + 0.5 * height}" x2="{x + width}" y2="{top + 0.5 * height}" '
        f'stroke="{ink}" stroke-opacity="0.35"/>'
        f'<polyline points="{curve}" fill="none" stroke="{COLOURS["orange"]}" '
        f'stroke-width="2"/><text x="{np.clip(across[peak], x + 45, x + width - 45):.1f}" '
        f'y="{label:.1f}" text-anchor="middle" fill="{ink}">peak {value}</text>'
        f'<circle r="5" cx="{across[peak]:.1f}" cy="{down[peak]:.1f}" fill="{COLOURS["orange"]}">'
        f'<animate attributeName="cx" values="{_join_numbers(across)}" {timing}/>'
        f'<animate attributeName="cy" values="{_join_numbers(down)}" {timing}/></circle>'
        f'<text x="{x}" y="{_HEIGHT - 6}" fill="{ink}" fill-opacity="0.75">torque of the person '
        f'over {moments[-1] - moments[0]:.1f} s</text>')


def _draw_base(ink: str) -> str:
    """Return the fixed parts: the upper arm, and a line at the middle angle."""
    x, y = _PIVOT
    return (f'<line x1="{x}" y1="{y}" x2="{x}" y2="{y - 72}" stroke="{ink}" stroke-opacity="0.3" '
            f'stroke-width="22" stroke-linecap="round"/><line x1="{x}" y1="{y}" '
            f'x2="{x + _ARM + 40}" y2="{y}" stroke="{ink}" stroke-opacity="0.3" '
            'stroke-dasharray="3 5"/>')


def _draw_arm(colour: str) -> str:
    x, y = _PIVOT
    return (f'<line x1="{x}" y1="{y}" x2="{x + _ARM}" y2="{y}" stroke="{colour}" '
            f'stroke-width="18" stroke-linecap="round"/><circle cx="{x}" cy="{y}" r="15" '
            f'fill="{colour}"/><circle cx="{x}" cy="{y}" r="6" fill="#fff"/>')


def _draw_arrow(length: str, colour: str, lengths: np.ndarray | None = None,
                timing: str = '') -> str:
    """Return the arrow of the torque at the hand, pointing up for positive torque."""
    x, y = _PIVOT[0] + _ARM, _PIVOT[1]
    shaft = head = ''
    if lengths is not None:
        ends = y + lengths
        shaft = f'<animate attributeName="y2" values="{_join_numbers(ends)}" {timing}/>'
        # The head points in the torque's direction and vanishes with it.
        sizes = np.sign(-lengths) * np.minimum(np.abs(lengths) / 12.0, 1.0)
        tips = [f'M{x - 8 * abs(s):.1f} {e:.1f}L{x + 8 * abs(s):.1f} {e:.1f}L{x:.1f} '
                f'{e - 13 * s:.1f}Z' for e, s in zip(ends, sizes)]
        head = f'<animate attributeName="d" values="{";".join(tips)}" {timing}/>'
    end = y + float(length)
    size = float(np.sign(-float(length)) * min(abs(float(length)) / 12.0, 1.0))
    return (f'<line x1="{x}" y1="{y}" x2="{x}" y2="{end:.1f}" stroke="{colour}" '
            f'stroke-width="6">{shaft}</line><path fill="{colour}" d="M{x - 8 * abs(size):.1f} '
            f'{end:.1f}L{x + 8 * abs(size):.1f} {end:.1f}L{x:.1f} {end - 13 * size:.1f}Z">{head}'
            '</path>')


def _join_numbers(values: np.ndarray) -> str:
    return ';'.join(f'{value:.1f}' for value in values)
