# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""One style for all figures, legible on paper and on light and dark pages."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
import io
import re
from typing import Any, ParamSpec, TYPE_CHECKING, TypeVar

from cycler import cycler
import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

P = ParamSpec('P')
T = TypeVar('T')

# Distinguishable with any colour vision, and legible on white and near-black.
COLOURS = {
    'blue': '#2a86c8', 'orange': '#dd6b12', 'green': '#0f9d76', 'pink': '#c96ba6',
    'violet': '#8474d6', 'grey': '#87909a', 'red': '#d2454f', 'yellow': '#c39b12',
}
# Placeholder for the page's text colour, which replaces it in the SVG.
INK = '#1a2b3d'
# Size of an SVG from which a bitmap is used instead, characters.
_LARGEST_SVG = 700_000
_MOST_DOTS = 6000

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
               **options: Any) -> tuple[Figure, Any]:
    """Create a figure with a grid of axes, an ndarray of them where there are several.

    `width` is that of the figure and `height` that of one row, inches; `options` are further
    arguments of ``Figure.subplots``, such as ``sharex=True``.
    """
    figure = Figure(figsize=(width, height * rows), layout='constrained')
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, **options)


def band(axes: Axes, x: np.ndarray, mean: np.ndarray, spread: np.ndarray, colour: str,
         label: str) -> None:
    """Draw a mean and a band around it, of half width `spread`, in a colour of COLOURS."""
    x, mean, spread = thin(x, mean, spread)
    axes.fill_between(
        x, mean - spread, mean + spread, color=COLOURS[colour], alpha=0.22, linewidth=0)
    axes.plot(x, mean, color=COLOURS[colour], label=label)


def thin(x: np.ndarray, *curves: np.ndarray, points: int = 800) -> tuple[np.ndarray, ...]:
    """Return every n-th point of curves, at most about `points` of them."""
    step = max(-(-len(x) // points), 1)
    return tuple(np.asarray(values)[::step] for values in (x, *curves))


def scatter(axes: Axes, x: np.ndarray, y: np.ndarray, colour: str, label: str | None = None
            ) -> None:
    """Draw measured points as small dots, a random sample where there are too many."""
    if len(x) > _MOST_DOTS:
        chosen = np.sort(np.random.default_rng(0).choice(len(x), _MOST_DOTS, replace=False))
        x, y = x[chosen], y[chosen]
    axes.plot(x, y, '.', color=COLOURS[colour], markersize=3.0, alpha=0.45, label=label,
              markeredgewidth=0, rasterized=True)


def to_svg(figure: Figure) -> str:
    """Return a figure as SVG in the page's text colour, without external files or scripts."""
    text = _saved(figure, format='svg', metadata={'Date': None, 'Creator': None}).decode()
    text = text[text.index('<svg'):]
    text = re.sub(r'<metadata>.*?</metadata>\s*', '', text, flags=re.DOTALL)
    return text.replace(INK, 'currentColor')


def to_png(figure: Figure) -> bytes:
    """Return a figure as PNG on white."""
    return _saved(figure, format='png', facecolor='white')


def _saved(figure: Figure, **options: Any) -> bytes:
    stream = io.BytesIO()
    with mpl.rc_context({**_STYLE, 'svg.hashsalt': 'friction_comp'}):
        # Run the layout engine once: otherwise saving draws twice.
        engine = figure.get_layout_engine()
        if engine is not None:
            engine.execute(figure)
            figure.set_layout_engine(None)
        figure.savefig(stream, dpi=160, **options)
    return stream.getvalue()


def for_page(figure: Figure) -> str | bytes:
    """Return a figure as SVG text, or as PNG bytes where the SVG would be too large."""
    text = to_svg(figure)
    return text if len(text) <= _LARGEST_SVG else to_png(figure)
