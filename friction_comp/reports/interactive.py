# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Turns drawings into Bokeh plots with hover and zoom, which work without network access.

The drawing comes first: it needs no script and can be printed. Where scripts run and Bokeh was
installed, a plot of the curves in it replaces it on the screen.
"""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Any, TYPE_CHECKING

from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
import numpy as np

from friction_comp.reports.figures import INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

# Largest number of points of a line: two for each column of pixels of a screen are enough; and of
# dots.
POINTS, _DOTS = 2000, 1500
_FONT = 'system-ui, sans-serif'


def bokeh_is_installed() -> bool:
    """Return whether plots can be made."""
    try:
        import bokeh  # noqa: F401
    except ModuleNotFoundError:
        return False
    return True


def library() -> str:
    """Return Bokeh's library as a script tag for the page's head."""
    from bokeh.resources import Resources

    return Resources(mode='inline', components=['bokeh']).render_js()


def interactive_plot(figure: Figure) -> str:
    """Return the lines, dots and bands of a figure as HTML with its script.

    The panels share the x axis in a column and the y axis in a row.
    """
    from bokeh.embed import components

    plots: dict[tuple[int, int], Any] = {}
    for axes in figure.axes:
        spec: Any = axes.get_subplotspec()
        row, column = spec.rowspan.start, spec.colspan.start
        plots[row, column] = _plot(axes, plots.get((0, column)), plots.get((row, 0)))
    columns = 1 + max(column for _, column in plots)
    script, elements = components([plots[place] for place in sorted(plots)])
    panels = ''.join(f'<div>{element}</div>' for element in elements)
    return (f'{_key(figure)}<div class="panels" style="--columns:{columns}">{panels}</div>'
            f'{script.strip()}')


def thinning_note(figure: Figure) -> str:
    """Return a sentence on curves that were thinned out, '' where none were."""
    most = max((len(line.get_xdata(orig=False)) for axes in figure.axes  # type: ignore[arg-type]
                for line in _lines(axes) if not _is_dots(line)), default=0)
    if most <= POINTS:
        return ''
    return (f' Of up to {most} points per curve, the lowest and highest of each of {POINTS // 2} '
            'stretches are drawn.')


def thin_extremes(x: np.ndarray, y: np.ndarray, points: int = POINTS
                  ) -> tuple[np.ndarray, np.ndarray]:
    """Thin out a curve to the lowest and the highest point of each stretch, which keeps its peaks.

    Parameters
    ----------
    x, y : ndarray, shape (N,)
    points : int
        Largest number of points that is returned.
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


def _lines(axes: Axes) -> Iterable[Line2D]:
    """Return the lines with data, without those across the whole panel."""
    return (line for line in axes.lines if line.get_transform() is axes.transData)


def _is_dots(line: Line2D) -> bool:
    return line.get_linestyle() == 'None'


def _name(line: Line2D) -> str:
    name = str(line.get_label())
    return '' if name.startswith('_') else name


def _key(figure: Figure) -> str:
    """Return the key of curves as HTML, so that its lines wrap on a narrow page."""
    lines = {_name(line): line for axes in figure.axes for line in _lines(axes) if _name(line)}
    if len(lines) < 2:
        return ''
    return '<p class="key">' + ' '.join(
        f'<span><i style="border-top:3px {"dashed" if line.get_linestyle() == "--" else "solid"} '
        f'{to_hex(line.get_color())}"></i>{escape(name)}</span>' for name, line in lines.items()
    ) + '</p>'


def _plot(axes: Axes, above: Any, left: Any) -> Any:
    """Return one panel with the x range of the one above and the y range of the one to its left."""
    from bokeh.models import HoverTool, Range1d
    from bokeh.plotting import figure

    # Inner panels have no labels of their own in a drawing.
    spec: Any = axes.get_subplotspec()
    drawn = axes.get_figure().axes  # type: ignore[union-attr]
    x_label = next((other.get_xlabel() for other in drawn if other.get_xlabel()
                    and other.get_subplotspec().colspan.start == spec.colspan.start), '')
    y_label = next((other.get_ylabel() for other in drawn if other.get_ylabel()
                    and other.get_subplotspec().rowspan.start == spec.rowspan.start), '')
    title = axes.get_title(loc='left')
    # The wheel scrolls the page unless its tool is selected.
    plot = figure(height=270, sizing_mode='stretch_width', title=title or None,
                  tools='pan,box_zoom,wheel_zoom,reset,save', active_drag='box_zoom',
                  x_range=above.x_range if above else Range1d(*axes.get_xlim()),
                  y_range=left.y_range if left else Range1d(*axes.get_ylim()),
                  x_axis_type=axes.get_xscale(), x_axis_label=x_label, y_axis_label=y_label,
                  background_fill_alpha=0.0, border_fill_alpha=0.0, outline_line_color=None)
    for filled in axes.collections:
        if isinstance(filled, PolyCollection):
            for path in filled.get_paths():
                plot.patch(*np.asarray(path.vertices).T, line_width=0, fill_alpha=0.2,
                           fill_color=to_hex(filled.get_facecolor()[0]))
    renderers = []
    for line in _lines(axes):
        colour, name = to_hex(line.get_color()), _name(line)
        x, y = (np.asarray(values, dtype=float) for values in line.get_data(orig=False))
        # Single precision halves the size of the page.
        if _is_dots(line):
            step = max(1, len(x) // _DOTS)
            renderers.append(plot.scatter(
                x[::step].astype(np.float32), y[::step].astype(np.float32), size=3, color=colour,
                alpha=0.5, name=name))
        else:
            x, y = thin_extremes(x, y)
            renderers.append(plot.line(
                x.astype(np.float32), y.astype(np.float32), color=colour, line_width=1.8,
                line_dash=[6, 4] if line.get_linestyle() == '--' else 'solid', name=name))
    plot.add_tools(HoverTool(renderers=renderers, tooltips=[
        ('', '$name'), (x_label, '$x{0.[0000]}'), (y_label, '$y{0.[0000]}')]))
    for axis in (plot.xaxis, plot.yaxis):
        axis.axis_label_text_font_style = 'normal'
        axis.axis_label_text_font = axis.major_label_text_font = _FONT
        axis.axis_label_text_color = axis.major_label_text_color = INK
    if title:
        plot.title.text_color = INK
        plot.title.text_font = _FONT
    plot.grid.grid_line_alpha = 0.5
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    return plot
