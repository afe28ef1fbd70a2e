# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Figures with hover and zoom, by Bokeh, inside the page and without network.

One principle: **the drawing is there first**. A page holds each figure as a drawing that needs no
script and prints; where scripts run and Bokeh made the page, a plot of the same data takes its
place on the screen. A page made without Bokeh is the same page without hover and zoom.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

from friction_comp.reports.figures import COLOURS

# Points of a line: a screen shows about 1400 columns, and two points make one.
POINTS = 2000
# The ink of the light page; in the dark the style sheet inverts plots as a whole.
_INK = '#1a2b3d'
_FONT = 'system-ui, sans-serif'


@dataclass
class Line:
    """A curve of a panel.

    Parameters
    ----------
    name : str
        For the legend and the hover.
    x, y : ndarray, shape (N,)
    colour : str
        A key of `friction_comp.reports.figures.COLOURS`.
    spread : ndarray, shape (N,), optional
        Half the width of a band around the curve.
    style : str
        'line', 'dashed' or 'dots'.
    """

    name: str
    x: np.ndarray
    y: np.ndarray
    colour: str = 'blue'
    spread: np.ndarray | None = None
    style: str = 'line'


@dataclass
class Panel:
    """One plot: what is on its axes, with units, and its curves."""

    x_label: str
    y_label: str
    lines: list[Line] = field(default_factory=list)
    title: str = ''


def thin_extremes(x: np.ndarray, y: np.ndarray, points: int = POINTS
                  ) -> tuple[np.ndarray, np.ndarray]:
    """Return which points of a curve to draw: of each stretch the lowest and the highest.

    Peaks survive, which every n-th point would miss.

    Parameters
    ----------
    x, y : ndarray, shape (N,)
    points : int
        At most so many.

    Returns
    -------
    tuple of ndarray
        x and y, shape (M,), M <= `points`.
    """
    if len(x) <= points:
        return x, y
    edges = np.linspace(0, len(x), points // 2 + 1).astype(int)
    chosen = []
    for first, last in zip(edges[:-1], edges[1:]):
        part = y[first:last]
        if np.isfinite(part).any():
            chosen += [first + int(np.nanargmin(part)), first + int(np.nanargmax(part))]
        else:
            # A gap stays one.
            chosen.append(first)
    kept = np.unique(chosen)
    return x[kept], y[kept]


def thinned(panels: Sequence[Sequence[Panel]]) -> str:
    """Return a sentence that says which curves show fewer points than there are, '' where none."""
    most = max((len(line.x) for row in panels for panel in row for line in panel.lines), default=0)
    if most <= POINTS:
        return ''
    return (f' Of up to {most} points a curve, the lowest and highest of each of {POINTS // 2} '
            'stretches are drawn.')


def bokeh_version() -> str | None:
    """Return the version of Bokeh, or None where it is not installed."""
    try:
        import bokeh
    except ModuleNotFoundError:
        return None
    return str(bokeh.__version__)


def library() -> str:
    """Return Bokeh's script as a tag, for the page's head."""
    from bokeh.resources import Resources

    return Resources(mode='inline', components=['bokeh']).render_js()


def plots(figures: Sequence[Sequence[Sequence[Panel]]]) -> tuple[str, list[str]]:
    """Return the script that draws figures, and the elements of each with its key.

    Parameters
    ----------
    figures : sequence of rows of Panel
        Panels of one figure share their x axis in a column, and their y axis in a row.
    """
    from bokeh.embed import components

    grids = [_grid(rows) for rows in figures]
    script, elements = components([plot for grid in grids for plot in grid])
    parts = iter(elements)
    return script, [
        f'{_key(rows)}<div class="panels" style="--columns:{len(rows[0])}">'
        + ''.join(f'<div>{next(parts)}</div>' for _ in grid) + '</div>'
        for rows, grid in zip(figures, grids)]


def _key(rows: Sequence[Sequence[Panel]]) -> str:
    """Return which colour is which curve; in HTML, so that it breaks where the page is narrow."""
    curves = {line.name: line for row in rows for panel in row for line in panel.lines}
    if len(curves) < 2:
        return ''
    return '<p class="key">' + ' '.join(
        f'<span><i style="border-top:3px {"dashed" if line.style == "dashed" else "solid"} '
        f'{COLOURS[line.colour]}"></i>{escape(name)}</span>' for name, line in curves.items()
    ) + '</p>'


def _grid(rows: Sequence[Sequence[Panel]]) -> list[Any]:
    made: list[list[Any]] = []
    for row in rows:
        line: list[Any] = []
        for column, panel in enumerate(row):
            shared: dict[str, Any] = {}
            if made:
                shared['x_range'] = made[0][column].x_range
            if line:
                shared['y_range'] = line[0].y_range
            line.append(_plot(panel, shared))
        made.append(line)
    return [plot for line in made for plot in line]


def _plot(panel: Panel, shared: dict[str, Any]) -> Any:
    from bokeh.models import HoverTool
    from bokeh.plotting import figure

    # The wheel scrolls the page; it zooms once its tool is chosen.
    plot = figure(height=270, sizing_mode='stretch_width', title=panel.title or None,
                  tools='pan,box_zoom,wheel_zoom,reset,save', active_drag='box_zoom',
                  x_axis_label=panel.x_label, y_axis_label=panel.y_label,
                  background_fill_alpha=0.0, border_fill_alpha=0.0, outline_line_color=None,
                  **shared)
    drawn = []
    for curve in panel.lines:
        x, y = thin_extremes(np.asarray(curve.x, dtype=float), np.asarray(curve.y, dtype=float))
        colour = COLOURS[curve.colour]
        if curve.spread is not None:
            every = max(1, -(-len(curve.x) // 400))
            part = slice(None, None, every)
            plot.varea(curve.x[part], (curve.y - curve.spread)[part],
                       (curve.y + curve.spread)[part], fill_color=colour, fill_alpha=0.2)
        # Single precision is a tenth of a pixel and half of the bytes.
        x, y = x.astype(np.float32), y.astype(np.float32)
        if curve.style == 'dots':
            drawn.append(plot.scatter(x, y, size=3, color=colour, alpha=0.5, name=curve.name))
        else:
            drawn.append(plot.line(
                x, y, color=colour, line_width=1.8,
                line_dash=[6, 4] if curve.style == 'dashed' else 'solid',
                name=curve.name))
    plot.add_tools(HoverTool(renderers=drawn, tooltips=[
        ('', '$name'), (panel.x_label, '$x{0.[0000]}'), (panel.y_label, '$y{0.[0000]}')]))
    for axis in (plot.xaxis, plot.yaxis):
        axis.axis_label_text_font_style = 'normal'
        axis.axis_label_text_font = axis.major_label_text_font = _FONT
        axis.axis_label_text_color = axis.major_label_text_color = _INK
    if panel.title:
        plot.title.text_color = _INK
        plot.title.text_font = _FONT
    plot.grid.grid_line_alpha = 0.5
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    return plot
