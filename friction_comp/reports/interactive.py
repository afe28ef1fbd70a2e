# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Figures with hover and zoom by Bokeh, which work without network access.

One principle: **the drawing comes first**. A page contains each figure as a drawing that needs no
script and can be printed; where scripts run and Bokeh was installed, a plot of the same data
replaces it on the screen. A page made without Bokeh only lacks hover and zoom.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

from friction_comp.reports.figures import COLOURS

# Largest number of points of a line: two for each column of pixels of a screen are enough.
POINTS = 2000
# Text colour of the light page; the style sheet inverts whole plots for the dark one.
_INK = '#1a2b3d'
_FONT = 'system-ui, sans-serif'


@dataclass
class Line:
    """A curve of a panel.

    Parameters
    ----------
    name : str
        Name in legend and hover.
    x, y : ndarray, shape (N,)
    colour : str
        A key of `friction_comp.reports.figures.COLOURS`.
    spread : ndarray, shape (N,), optional
        Half width of a band around the curve.
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
    """One plot: axis labels with units, curves and title."""

    x_label: str
    y_label: str
    lines: list[Line] = field(default_factory=list)
    title: str = ''


def thin_extremes(x: np.ndarray, y: np.ndarray, points: int = POINTS
                  ) -> tuple[np.ndarray, np.ndarray]:
    """Thin out a curve to the lowest and the highest point of each stretch, which keeps its peaks.

    Parameters
    ----------
    x, y : ndarray, shape (N,)
    points : int
        Largest number of points.

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
            # Keep a gap.
            chosen.append(first)
    indices = np.unique(chosen)
    return x[indices], y[indices]


def thinning_note(panels: Sequence[Sequence[Panel]]) -> str:
    """Return a sentence on curves that were thinned out, '' where none were."""
    most = max((len(line.x) for row in panels for panel in row for line in panel.lines), default=0)
    if most <= POINTS:
        return ''
    return (f' Of up to {most} points per curve, the lowest and highest of each of {POINTS // 2} '
            'stretches are drawn.')


def bokeh_version() -> str | None:
    """Return the version of Bokeh, or None where it is not installed."""
    try:
        import bokeh
    except ModuleNotFoundError:
        return None
    return str(bokeh.__version__)


def library() -> str:
    """Return Bokeh's library as a script tag for the page's head."""
    from bokeh.resources import Resources

    return Resources(mode='inline', components=['bokeh']).render_js()


def plots(figures: Sequence[Sequence[Sequence[Panel]]]) -> tuple[str, list[str]]:
    """Return the script that draws figures, and the elements of each figure with its key.

    Parameters
    ----------
    figures : sequence of rows of Panel
        The panels of a figure share the x axis in a column and the y axis in a row.
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
    """Return the key of curves as HTML, so that its lines wrap on a narrow page."""
    curves = {line.name: line for row in rows for panel in row for line in panel.lines}
    if len(curves) < 2:
        return ''
    return '<p class="key">' + ' '.join(
        f'<span><i style="border-top:3px {"dashed" if line.style == "dashed" else "solid"} '
        f'{COLOURS[line.colour]}"></i>{escape(name)}</span>' for name, line in curves.items()
    ) + '</p>'


def _grid(rows: Sequence[Sequence[Panel]]) -> list[Any]:
    plots: list[list[Any]] = []
    for row in rows:
        plot_row: list[Any] = []
        for column, panel in enumerate(row):
            shared: dict[str, Any] = {}
            if plots:
                shared['x_range'] = plots[0][column].x_range
            if plot_row:
                shared['y_range'] = plot_row[0].y_range
            plot_row.append(_plot(panel, shared))
        plots.append(plot_row)
    return [plot for plot_row in plots for plot in plot_row]


def _plot(panel: Panel, shared: dict[str, Any]) -> Any:
    from bokeh.models import HoverTool
    from bokeh.plotting import figure

    # The wheel scrolls the page unless its tool is selected.
    plot = figure(height=270, sizing_mode='stretch_width', title=panel.title or None,
                  tools='pan,box_zoom,wheel_zoom,reset,save', active_drag='box_zoom',
                  x_axis_label=panel.x_label, y_axis_label=panel.y_label,
                  background_fill_alpha=0.0, border_fill_alpha=0.0, outline_line_color=None,
                  **shared)
    renderers = []
    for curve in panel.lines:
        x, y = thin_extremes(np.asarray(curve.x, dtype=float), np.asarray(curve.y, dtype=float))
        colour = COLOURS[curve.colour]
        if curve.spread is not None:
            step = max(1, -(-len(curve.x) // 400))
            part = slice(None, None, step)
            plot.varea(curve.x[part], (curve.y - curve.spread)[part],
                       (curve.y + curve.spread)[part], fill_color=colour, fill_alpha=0.2)
        # Single precision halves the size of the page.
        x, y = x.astype(np.float32), y.astype(np.float32)
        if curve.style == 'dots':
            renderers.append(plot.scatter(x, y, size=3, color=colour, alpha=0.5, name=curve.name))
        else:
            renderers.append(plot.line(
                x, y, color=colour, line_width=1.8,
                line_dash=[6, 4] if curve.style == 'dashed' else 'solid',
                name=curve.name))
    plot.add_tools(HoverTool(renderers=renderers, tooltips=[
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
