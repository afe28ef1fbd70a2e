# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""One style for all figures: panels one above the other, legible on a phone and on any page.

A colour has one meaning on all pages, and colours differ for people of any colour vision; lines
that may touch also differ in their strokes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
import io
import re
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
import numpy as np

from friction_comp.terminal import in_own_units

P = ParamSpec('P')
T = TypeVar('T')

# From the palettes of Okabe and Ito (2008), legible on white and near-black.
COLOURS = {
    'measured': '#7a8491', 'predicted': '#0b78c2',
    'no help': '#d55e00', 'unknown': '#d98cc4', 'known': '#009e73', 'other': '#e6c229',
    'refined': '#1f4fa0', 'out': '#d2454f', 'faint': '#9aa5b1'}
"""What a colour stands for: measured and predicted values; no help, help without and with a known
direction, with another law or model; what is out."""
# Placeholder for the page's text colour, which replaces it in the SVG.
INK = '#1a2b3d'
WIDTH = 6.6
"""Width of every figure, inches."""
_MOST_DOTS = 6000

_STYLE: dict[Any, Any] = {
    'axes.edgecolor': INK, 'axes.labelcolor': INK, 'axes.titlecolor': INK,
    'text.color': INK, 'xtick.color': INK, 'ytick.color': INK,
    'axes.facecolor': 'none', 'figure.facecolor': 'none', 'savefig.facecolor': 'none',
    'axes.spines.top': False, 'axes.spines.right': False, 'axes.linewidth': 0.8,
    'axes.titlesize': 10, 'axes.titleweight': 'bold', 'axes.titlelocation': 'left',
    'axes.labelsize': 10, 'xtick.labelsize': 9, 'ytick.labelsize': 9, 'font.size': 10,
    'axes.grid': True, 'grid.color': COLOURS['faint'], 'grid.alpha': 0.3, 'grid.linewidth': 0.6,
    'axes.axisbelow': True, 'lines.linewidth': 1.6, 'legend.frameon': False,
    'legend.fontsize': 9, 'font.family': ['DejaVu Sans'], 'svg.fonttype': 'none',
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
def panels(labels: Sequence[str], x: str | Sequence[str] = '', heights: float | Sequence[float] = 2,
           legend_rows: int = 1) -> tuple[Figure, list[Axes]]:
    """Create a figure with a panel for each label of an axis of y, one above the other.

    They share the axis of x if `x` is one label. `heights` are of the panels, inches, `legend_rows`
    is the number of rows of the legend above.
    """
    count, shared = len(labels), isinstance(x, str)
    sizes = [float(heights)] * count if isinstance(heights, (int, float)) else list(heights)
    # Inches between panels, above and below them.
    gap, above, below = 0.16 if shared else 0.72, 0.15 + 0.19 * legend_rows, 0.5
    height = above + sum(sizes) + gap * (count - 1) + below
    # Places are known: Matplotlib's layout engine would take half of the time of a page.
    figure = Figure(figsize=(WIDTH, height))
    FigureCanvasAgg(figure)
    axes: list[Axes] = []
    top = height - above
    for k, (label, size) in enumerate(zip(labels, sizes)):
        # At the left is room for labels.
        place = (0.8 / WIDTH, (top - size) / height, 1.0 - 0.92 / WIDTH, size / height)
        panel = figure.add_axes(place, sharex=axes[0] if axes and shared else None)
        panel.set_ylabel(label)
        last = k == count - 1
        if shared:
            panel.tick_params(labelbottom=last)
            panel.set_xlabel(str(x) if last else '')
        else:
            panel.set_xlabel(x[k])
        axes.append(panel)
        top -= size + gap
    figure.align_ylabels(axes)
    return figure, axes


def curve(axes: Axes, x: Any, y: Any, colour: str, label: str | None = None, style: str = '-',
          **options: Any) -> None:
    """Draw a line or markers in a colour of COLOURS; `style` is Matplotlib's format.

    Matplotlib leaves out points of lines that nobody could see; many markers are drawn as pixels.
    """
    axes.plot(x, y, style, color=COLOURS[colour], label=label,
              rasterized=style in ('.', 'o') and len(x) > 1500, **options)


def scatter(axes: Axes, x: np.ndarray, y: np.ndarray, colour: str = 'measured',
            label: str | None = None) -> None:
    """Draw measured points as small dots, a random sample where there are too many."""
    if len(x) > _MOST_DOTS:
        chosen = np.sort(np.random.default_rng(0).choice(len(x), _MOST_DOTS, replace=False))
        x, y = x[chosen], y[chosen]
    # Below and wider than lines, so that one shows beside the other.
    size, alpha = (4.5, 0.5) if len(x) > 200 else (9.0, 0.9)
    curve(axes, x, y, colour, label, '.', markersize=size, alpha=alpha, markeredgewidth=0,
          zorder=1.5)


def measured_and_predicted(labels: tuple[str, str], x: str, line: tuple[np.ndarray, np.ndarray],
                           name: str, dots: tuple[np.ndarray, np.ndarray], error: np.ndarray
                           ) -> tuple[Figure, list[Axes]]:
    """Draw a line named `name`, measured dots, and the error of each dot in a strip below."""
    figure, axes = panels(labels, x, (2.3, 0.9))
    curve(axes[0], *line, 'predicted', name, linewidth=1.2)
    scatter(axes[0], *dots, label='measured')
    scatter(axes[1], dots[0], error)
    zero(axes[1])
    legend(axes[0])
    return figure, axes


def band(axes: Axes, x: np.ndarray, mean: np.ndarray, spread: np.ndarray, colour: str,
         label: str) -> None:
    """Draw a mean and a band around it, of half width `spread`, in a colour of COLOURS."""
    x, mean, spread = thin(x, mean, spread)
    axes.fill_between(
        x, mean - spread, mean + spread, color=COLOURS[colour], alpha=0.2, linewidth=0)
    curve(axes, x, mean, colour, label)


def zero(axes: Axes) -> None:
    """Draw the line of zero."""
    axes.axhline(0.0, color=COLOURS['faint'], linewidth=0.8)


def shade_waiting(axes: Axes, begin: float) -> None:
    """Shade what is not counted: the time from `begin` until the movement begins, at 0."""
    axes.axvspan(min(begin, -0.1), 0.0, color=COLOURS['faint'], alpha=0.25, linewidth=0)


def legend(axes: Axes, columns: int = 3) -> None:
    """Put the legend above a panel, where it covers nothing."""
    shown = axes.legend(
        loc='lower left', bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.2,
        handlelength=1.6, columnspacing=1.2, handletextpad=0.5)
    for handle in shown.legend_handles:
        if isinstance(handle, Line2D) and handle.get_marker() == '.':
            handle.set(markersize=9.0, alpha=1.0)


def thin(x: np.ndarray, *curves: np.ndarray, points: int = 800) -> tuple[np.ndarray, ...]:
    """Return every n-th point of curves, at most about `points` of them."""
    step = max(-(-len(x) // points), 1)
    return tuple(np.asarray(values)[::step] for values in (x, *curves))


def to_svg(figure: Figure) -> str:
    """Return a figure as SVG in the page's text colour, without external files or scripts."""
    stream = io.StringIO()
    with mpl.rc_context({**_STYLE, 'svg.hashsalt': 'friction_comp'}):
        figure.savefig(stream, dpi=160, format='svg', metadata={'Date': None, 'Creator': None})
    text = stream.getvalue()
    text = re.sub(r'<metadata>.*?</metadata>\s*', '', text[text.index('<svg'):], flags=re.DOTALL)
    # A thousandth of a point is finer than any screen.
    text = re.sub(r'([ML] -?\d+\.\d{3})\d*( -?\d+\.\d{3})\d*', r'\1\2', text)
    return text.replace(INK, 'currentColor').replace(
        "'DejaVu Sans'", "'DejaVu Sans', Verdana, sans-serif")


def for_page(figure: Figure, linear: bool = False) -> str:
    """Return a figure as SVG for a page; that of a `linear` axis gets its units."""
    if linear:
        for text in figure.findobj(Text):
            text.set_text(in_own_units(text.get_text(), True))
    return to_svg(figure)
