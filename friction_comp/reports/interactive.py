# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Converts Matplotlib figures to Bokeh plots with hover and zoom, which work offline.

A report always contains the Matplotlib drawing, which needs no script and can be printed. Where
scripts run and Bokeh was installed, a plot of the same curves replaces it on the screen.
"""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from importlib.util import find_spec
from typing import Any, TYPE_CHECKING

from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
import numpy as np

from friction_comp.reports.figures import INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

# Largest numbers of points of a line (two per pixel column of a screen are enough) and of dots.
_POINTS, _DOTS = 2000, 1500
_FONT = 'system-ui, sans-serif'


def bokeh_is_installed() -> bool:
    """Return whether interactive plots are available."""
    return find_spec('bokeh') is not None


def library() -> str:
    """Return Bokeh's library as a script tag for the page's head."""
    from bokeh.resources import Resources

    return Resources(mode='inline', components=['bokeh']).render_js()


def interactive_plot(figure: Figure) -> tuple[str, str]:
    """Return the lines, dots and bands of a figure as HTML, and a note on thinned curves.

    The panels share the x axis in a column and the y axis in a row.
    """
    from bokeh.embed import components

    plots: dict[tuple[int, int], Any] = {}
    for axes in figure.axes:
        spec: Any = axes.get_subplotspec()
        row, column = spec.rowspan.start, spec.colspan.start
        plots[row, column] = _plot(axes, plots.get((0, column)), plots.get((row, 0)))
    script, elements = components([plots[row_column] for row_column in sorted(plots)])
    panels = ''.join(f'<div>{element}</div>' for element in elements)
    lines = [line for axes in figure.axes for line in _lines(axes)]
    most = max((len(line.get_path()) for line in lines if not _is_dots(line)), default=0)
    note = (f' Curves have up to {most} points: the lowest and highest of each of {_POINTS // 2} '
            'stretches are drawn.') if most > _POINTS else ''
    return (f'{_legend(lines)}<div class="panels" style="--columns:{1 + max(plots)[1]}">{panels}'
            f'</div>{script.strip()}', note)


def thin_extremes(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Thin out a long curve to the lowest and highest point of each stretch, to keep its peaks."""
    if len(x) <= _POINTS:
        return x, y
    edges = np.linspace(0, len(x), _POINTS // 2 + 1).astype(int)
    chosen = []
    for first, last in zip(edges[:-1], edges[1:]):
        part = y[first:last]
        if np.isfinite(part).any():
            chosen += [first + int(np.nanargmin(part)), first + int(np.nanargmax(part))]
        else:
            # One NaN keeps the gap.
            chosen.append(first)
    indices = np.unique(chosen)
    return x[indices], y[indices]


def _lines(axes: Axes) -> list[Line2D]:
    """Return the lines with data, without those from ``axhline`` and ``axvline``."""
    return [line for line in axes.lines if line.get_transform() is axes.transData]


def _is_dots(line: Line2D) -> bool:
    return line.get_linestyle() == 'None'


def _name(line: Line2D) -> str:
    name = str(line.get_label())
    return '' if name.startswith('_') else name


def _legend(lines: Iterable[Line2D]) -> str:
    """Return the legend as HTML, so that it wraps on a narrow page."""
    named = {_name(line): line for line in lines if _name(line)}
    if len(named) < 2:
        return ''
    return '<p class="key">' + ' '.join(
        f'<span><i style="border-top:3px {"dashed" if line.get_linestyle() == "--" else "solid"} '
        f'{to_hex(line.get_color())}"></i>{escape(name)}</span>' for name, line in named.items()
    ) + '</p>'


def _label(axes: Axes, span: str, name: str) -> str:
    """Return an axis label; inner axes have that of others in the same column or row."""
    def start(other: Any) -> int:
        return int(getattr(other.get_subplotspec(), span).start)
    figure: Any = axes.get_figure()
    return next((label for other in figure.axes if start(other) == start(axes)
                 and (label := getattr(other, name)())), '')


def _plot(axes: Axes, above: Any, left: Any) -> Any:
    """Return one panel with the x range of the one above and the y range of the one to its left."""
    from bokeh.models import HoverTool, Range1d
    from bokeh.plotting import figure

    x_label, y_label = _label(axes, 'colspan', 'get_xlabel'), _label(axes, 'rowspan', 'get_ylabel')
    # The wheel scrolls the page unless its tool is selected.
    plot = figure(height=270, sizing_mode='stretch_width', title=axes.get_title(loc='left'),
                  tools='pan,box_zoom,wheel_zoom,reset,save', active_drag='box_zoom',
                  x_range=above.x_range if above else Range1d(*axes.get_xlim()),
                  y_range=left.y_range if left else Range1d(*axes.get_ylim()),
                  x_axis_type=axes.get_xscale(), x_axis_label=x_label, y_axis_label=y_label,
                  background_fill_alpha=0.0, border_fill_alpha=0.0, outline_line_color=None)
    for filled in axes.collections:
        if isinstance(filled, PolyCollection):
            for path in filled.get_paths():
                plot.patch(*np.asarray(path.vertices).T, line_width=0, fill_alpha=0.2,
                           fill_color=to_hex(np.asarray(filled.get_facecolor())[0]))
    renderers = []
    for line in _lines(axes):
        options: Any = {'color': to_hex(line.get_color()), 'name': _name(line)}
        points = np.asarray(line.get_xydata()).T
        # Single precision halves the size of the page.
        if _is_dots(line):
            dots = points[:, ::max(1, points.shape[1] // _DOTS)].astype(np.float32)
            renderers.append(plot.scatter(*dots, size=3, alpha=0.5, **options))
        else:
            x, y = (part.astype(np.float32) for part in thin_extremes(*points))
            dash = [6, 4] if line.get_linestyle() == '--' else 'solid'
            renderers.append(plot.line(x, y, line_width=1.8, line_dash=dash, **options))
    plot.add_tools(HoverTool(renderers=renderers, tooltips=[
        ('', '$name'), (x_label, '$x{0.[0000]}'), (y_label, '$y{0.[0000]}')]))
    for axis in plot.axis:
        axis.update(axis_label_text_font_style='normal', axis_label_text_font=_FONT,
                    major_label_text_font=_FONT, axis_label_text_color=INK,
                    major_label_text_color=INK)
    plot.title.update(text_color=INK, text_font=_FONT)
    plot.grid.grid_line_alpha = 0.5
    plot.toolbar.update(logo=None, autohide=True)
    return plot
