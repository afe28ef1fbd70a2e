# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""One style for all figures, legible on paper and on light and dark pages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
import io
import re
from typing import Any, ParamSpec, TypeVar

from cycler import cycler
import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
import numpy as np

P = ParamSpec('P')
T = TypeVar('T')

# Distinguishable with any colour vision, and legible on white and near-black.
COLOURS = {
    'blue': '#2a86c8', 'orange': '#dd6b12', 'green': '#0f9d76', 'pink': '#c96ba6',
    'violet': '#8474d6', 'grey': '#87909a', 'red': '#d2454f', 'yellow': '#c39b12',
}
# Placeholder for the page's text colour, which replaces it in the SVG.
INK = '#1a2b3d'
_MOST_DOTS, _MOST_MARKERS = 6000, 1500
# Stretches of a long curve, each drawn with its lowest and highest point: two for each pixel.
_STRETCHES = 1000

_STYLE: dict[Any, Any] = {
    'axes.prop_cycle': cycler(color=list(COLOURS.values())),
    'axes.edgecolor': INK, 'axes.labelcolor': INK, 'axes.titlecolor': INK,
    'text.color': INK, 'xtick.color': INK, 'ytick.color': INK,
    'axes.facecolor': 'none', 'figure.facecolor': 'none', 'savefig.facecolor': 'none',
    'axes.spines.top': False, 'axes.spines.right': False, 'axes.linewidth': 0.8,
    'axes.titlesize': 10.5, 'axes.titleweight': 'bold', 'axes.titlelocation': 'left',
    'axes.labelsize': 9.5, 'xtick.labelsize': 8.5, 'ytick.labelsize': 8.5, 'font.size': 9.5,
    'axes.grid': True, 'grid.color': COLOURS['grey'], 'grid.alpha': 0.25, 'grid.linewidth': 0.6,
    'axes.axisbelow': True, 'lines.linewidth': 1.5, 'legend.frameon': False,
    'legend.fontsize': 8.5, 'font.family': ['DejaVu Sans'], 'svg.fonttype': 'path',
    'figure.dpi': 100, 'mathtext.default': 'regular', 'axes.formatter.useoffset': False,
    'axes.formatter.limits': (-4, 5), 'axes.formatter.min_exponent': 4,
}


def styled(draw: Callable[P, T]) -> Callable[P, T]:
    """Decorate a function that draws, so that its figure has the style of this module."""
    @wraps(draw)
    def with_style(*args: P.args, **kwargs: P.kwargs) -> T:
        with mpl.rc_context(_STYLE):
            return draw(*args, **kwargs)
    return with_style


@styled
def new_figure(rows: int = 1, columns: int = 1, width: float = 8.0, height: float = 3.0,
               x: str = '', y: str | Sequence[str] = '', **options: Any) -> tuple[Figure, Any]:
    """Create a figure with a grid of axes, an ndarray of them where there are several.

    `width` is that of the figure and `height` that of one row, inches; `x` labels the lowest axes,
    `y` those on the left, all or row by row; `options` are those of ``Figure.subplots``.
    """
    figure = Figure(figsize=(width, height * rows), layout='constrained')
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, **options)
    grid = np.reshape(axes, (rows, columns))
    for lowest in grid[-1]:
        lowest.set_xlabel(x)
    for leftmost, label in zip(grid[:, 0], [y] * rows if isinstance(y, str) else y):
        leftmost.set_ylabel(label)
    return figure, axes


def curve(axes: Axes, x: Any, y: Any, colour: str, label: str | None = None, style: str = '-',
          **options: Any) -> None:
    """Draw a line or markers in a colour of COLOURS; `style` is Matplotlib's format."""
    axes.plot(x, y, style, color=COLOURS[colour], label=label, **options)


def band(axes: Axes, x: np.ndarray, mean: np.ndarray, spread: np.ndarray, colour: str,
         label: str) -> None:
    """Draw a mean and a band around it, of half width `spread`, in a colour of COLOURS."""
    x, mean, spread = thin(x, mean, spread)
    axes.fill_between(
        x, mean - spread, mean + spread, color=COLOURS[colour], alpha=0.22, linewidth=0)
    curve(axes, x, mean, colour, label)


def thin(x: np.ndarray, *curves: np.ndarray, points: int = 800) -> tuple[np.ndarray, ...]:
    """Return every n-th point of curves, at most about `points` of them."""
    step = max(-(-len(x) // points), 1)
    return tuple(np.asarray(values)[::step] for values in (x, *curves))


def thin_extremes(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Thin out a long curve to the lowest and highest point of each stretch, to keep its peaks."""
    if len(x) <= 2 * _STRETCHES:
        return x, y
    edges = np.linspace(0, len(x), _STRETCHES + 1).astype(int)
    # A stretch without numbers keeps one NaN, which draws a gap.
    known = np.isfinite(y)
    chosen = [first + find(np.where(known[first:last], y[first:last], other))
              for find, other in ((np.argmin, np.inf), (np.argmax, -np.inf))
              for first, last in zip(edges[:-1], edges[1:])]
    indices = np.unique(chosen)
    return x[indices], y[indices]


def scatter(axes: Axes, x: np.ndarray, y: np.ndarray, colour: str, label: str | None = None
            ) -> None:
    """Draw measured points as small dots, a random sample where there are too many."""
    if len(x) > _MOST_DOTS:
        chosen = np.sort(np.random.default_rng(0).choice(len(x), _MOST_DOTS, replace=False))
        x, y = x[chosen], y[chosen]
    curve(axes, x, y, colour, label, '.', markersize=3.0, alpha=0.45, markeredgewidth=0,
          rasterized=True)


def legend_below(figure: Figure, columns: int, *shown: Any) -> None:
    """Put the legend of all axes, or what is given as handles and labels, below them."""
    legend = figure.legend(*shown, loc='lower center', ncols=columns)
    height = legend.get_window_extent(FigureCanvasAgg(figure).get_renderer()).height
    low = 1.1 * height / figure.bbox.height
    engine = figure.get_layout_engine()
    if isinstance(engine, ConstrainedLayoutEngine):
        # Matplotlib's 'outside lower center' does the same, from 3.7 on; Jazzy's Ubuntu has 3.6.
        engine.set(rect=(0.0, low, 1.0, 1.0 - low))


def to_svg(figure: Figure) -> str:
    """Return a figure as SVG in the page's text colour, without external files or scripts."""
    stream = io.StringIO()
    with mpl.rc_context({**_STYLE, 'svg.hashsalt': 'friction_comp'}):
        # Run the layout engine once: otherwise saving draws twice.
        engine = figure.get_layout_engine()
        if engine is not None:
            engine.execute(figure)
            figure.set_layout_engine(None)
        figure.savefig(stream, dpi=160, format='svg', metadata={'Date': None, 'Creator': None})
    text = stream.getvalue()
    text = re.sub(r'<metadata>.*?</metadata>\s*', '', text[text.index('<svg'):], flags=re.DOTALL)
    return text.replace(INK, 'currentColor')


def shade_directions(axes: Axes, time: np.ndarray, direction: np.ndarray) -> None:
    """Shade the times, (N,), at which a direction is announced: blue positive, orange negative."""
    for sign, colour in ((1, 'blue'), (-1, 'orange')):
        axes.fill_between(time, 0, 1, where=direction == sign, alpha=0.15, color=COLOURS[colour],
                          linewidth=0, transform=axes.get_xaxis_transform(),
                          label=f'announced: {sign:+d}')


def to_file(figure: Figure, title: str, description: str) -> str:
    """Return a figure as the content of an SVG file for light and dark pages."""
    text = to_svg(figure)
    start = text.index('>') + 1
    return f"""{text[:start]}
<!-- Copyright 2026 The friction_comp authors, SPDX-License-Identifier: Apache-2.0 -->
<title>{title}</title>
<desc>{description}</desc>
<style>
  svg {{ color: {INK}; background: #ffffff }}
  @media (prefers-color-scheme: dark) {{ svg {{ color: #e4e9ee; background: #161c22 }} }}
</style>{text[start:]}"""


def for_page(figure: Figure) -> tuple[str, str]:
    """Return a figure as SVG for a page, and a note on curves that are thinned out."""
    longest = max((_lighten(line) for axes in figure.axes for line in _curves(axes)), default=0)
    # A thousandth of a point is finer than any screen.
    text = re.sub(r'([ML] -?\d+\.\d{3})\d*( -?\d+\.\d{3})\d*', r'\1\2', to_svg(figure))
    note = (f' Curves have up to {longest} points: the lowest and highest of each of {_STRETCHES} '
            'stretches are drawn.') if longest > 2 * _STRETCHES else ''
    return text, note


def _curves(axes: Axes) -> list[Line2D]:
    """Return the lines with data, without those from ``axhline`` and ``axvline``."""
    return [line for line in axes.lines if line.get_transform() is axes.transData]


def _lighten(line: Line2D) -> int:
    """Thin out a long curve, or draw many dots as pixels; return a curve's number of points."""
    points = np.asarray(line.get_xydata(), dtype=float)
    if line.get_linestyle() == 'None':
        line.set_rasterized(line.get_rasterized() or len(points) > _MOST_MARKERS)
        return 0
    line.set_data(*thin_extremes(*points.T))
    return len(points)
