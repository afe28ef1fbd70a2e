# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reports as one self-contained HTML file.

A page is complete without scripts. Where a figure comes with its curves (`live`), a script adds an
interactive plot.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from datetime import datetime
from html import escape
import math
from pathlib import Path
import re
from typing import Any, NamedTuple, TYPE_CHECKING
from urllib.parse import quote

import numpy as np

from friction_comp import __version__
from friction_comp.errors import InputError
from friction_comp.files import write_atomically
from friction_comp.reports.figures import for_page
from friction_comp.reports.interactive import bokeh_version, library, Panel, plots, thinning_note

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Link(NamedTuple):
    """A table cell's text, and the file that it links to."""

    text: str
    target: str


class Report:
    """A page that grows from top to bottom.

    Parameters
    ----------
    title : str
    subtitle : str
        One line under the title.

    Examples
    --------
    >>> report = Report('Backdrivability of the elbow')
    >>> report.verdict('The joint was **much** easier to move.')
    >>> report.table(['condition', 'peak (N·m)'], [['d = 0', 1.28], ['d = ±1', 0.44]])
    >>> '<h1>Backdrivability of the elbow</h1>' in report.html()
    True
    """

    def __init__(self, title: str, subtitle: str = '') -> None:
        self.title = title
        self.subtitle = subtitle
        self._parts: list[str] = []
        self._sections: list[str] = []
        self._figures = 0
        self._live: list[tuple[int, str, Sequence[Sequence[Panel]]]] = []
        self._origin: list[str] = []
        self._moves = False

    def heading(self, text: str, level: int = 2) -> None:
        """Begin a section (level 2) or a part of one (level 3)."""
        if level not in (2, 3):
            raise InputError(f'heading level must be 2 or 3, not {level}')
        anchor = ''
        if level == 2:
            self._sections.append(text)
            anchor = f' id="section-{len(self._sections)}"'
        self._parts.append(f'<h{level}{anchor}>{_inline(text)}</h{level}>')

    def text(self, text: str) -> None:
        """Add text.

        Parameters
        ----------
        text : str
            Paragraphs separated by blank lines. ``## `` and ``### `` begin headings, ``- `` list
            items and ``> `` a block quote; ``**bold**``, ``*emphasis*`` and ```code``` work inside
            them.
        """
        for block in re.split(r'\n\s*\n', text.strip()):
            lines = [line.strip() for line in block.strip().splitlines()]
            if not lines:
                continue
            heading = re.match(r'(#{2,3}) (.+)', lines[0])
            if heading:
                self.heading(heading[2], len(heading[1]))
                lines = lines[1:]
            if not lines:
                continue
            if lines[0].startswith('- '):
                self._parts.append(_items(lines))
            elif all(line.startswith('>') for line in lines):
                words = ' '.join(line[1:].strip() for line in lines)
                self._parts.append(f'<blockquote><p>{_inline(words)}</p></blockquote>')
            else:
                self._parts.append(f'<p>{_inline(" ".join(lines))}</p>')

    def verdict(self, text: str) -> None:
        """Add the main result in a box; it comes first on every page.

        Parameters
        ----------
        text : str
            Paragraphs separated by blank lines, with markup as in `text`.
        """
        # Not str.split: it would also replace non-breaking spaces.
        words = ''.join(f'<p>{_inline(" ".join(block.strip().splitlines()))}</p>'
                        for block in re.split(r'\n\s*\n', text.strip()))
        self._parts.append(f'<div class="verdict">{words}</div>')

    def numbers(self, tiles: list[tuple[str, str]]) -> None:
        """Add a few numbers in large type.

        Parameters
        ----------
        tiles : list of (str, str)
            Value with unit, and label.
        """
        cells = ''.join(
            f'<div class="tile"><b>{_unbroken(str(value))}</b><span>{_inline(label)}</span></div>'
            for value, label in tiles)
        self._parts.append(f'<div class="tiles">{cells}</div>')

    def table(self, header: Sequence[str], rows: Iterable[Sequence[Any]],
              caption: str = '') -> None:
        """Add a table.

        Parameters
        ----------
        header : list of str
        rows : list of list
            Strings, numbers or None. Columns of numbers are aligned to the right, with three
            significant digits of the largest where their magnitudes are similar, otherwise of each.
        caption : str

        Raises
        ------
        InputError
            If a row has another length than the header.
        """
        rows = [list(row) for row in rows]
        for row in rows:
            if len(row) != len(header):
                raise InputError(
                    f'table row has {len(row)} cells, but the header {len(header)}: {row}')
        numeric = [
            any(_is_number(row[k]) for row in rows)
            and all(row[k] is None or _is_number(row[k]) for row in rows)
            for k in range(len(header))]
        decimals = [_decimals([row[k] for row in rows]) if is_number else None
                    for k, is_number in enumerate(numeric)]
        kinds = [' class="number"' if is_number else '' for is_number in numeric]
        head = ''.join(
            f'<th scope="col"{kind}>{_inline(str(name))}</th>' if name else '<td></td>'
            for kind, name in zip(kinds, header))
        body = ''.join(
            '<tr>' + ''.join(
                f'<td{kind}>{_cell(value, places)}</td>'
                for kind, value, places in zip(kinds, row, decimals)) + '</tr>'
            for row in rows)
        title = f'<caption>{_inline(caption)}</caption>' if caption else ''
        # A scrollable region must be reachable from the keyboard.
        self._parts.append(
            f'<div class="wide" tabindex="0"><table>{title}<thead><tr>{head}</tr></thead>'
            f'<tbody>{body}</tbody></table></div>')

    def figure(self, figure: Figure, caption: str, alternative: str | None = None,
               live: Sequence[Sequence[Panel]] | None = None) -> None:
        """Add a matplotlib figure.

        Parameters
        ----------
        figure : matplotlib.figure.Figure
        caption : str
            Text below the figure.
        alternative : str, optional
            Alternative text for screen readers; the caption by default.
        live : rows of Panel, optional
            The same curves for an interactive plot, which replaces the drawing on a screen where
            scripts run. Without Bokeh, and on paper, the drawing is shown.
        """
        self._figures += 1
        words = escape(_plain(alternative or caption), quote=True)
        if live is not None and bokeh_version() is not None:
            self._live.append((self._figures, words, live))
            caption += thinning_note(live)
        content = for_page(figure)
        if isinstance(content, str):
            # Ids must be unique among all drawings of the page.
            content = re.sub(r'( id="|href="#|url\(#)', rf'\g<1>f{self._figures}-', content)
            content = content.replace('<svg ', f'<svg role="img" aria-label="{words}" ', 1)
        else:
            data = base64.b64encode(content).decode('ascii')
            content = f'<img alt="{words}" src="data:image/png;base64,{data}">'
        kind = ''
        if self._live and self._live[-1][0] == self._figures:
            kind = ' class="two"'
            content = f'<div class="drawn">{content}</div><!--live {self._figures}-->'
        self._parts.append(
            f'<figure{kind}>{content}<figcaption><b>Figure {self._figures}.</b> {_inline(caption)}'
            '</figcaption></figure>')

    def movie(self, drawings: Sequence[str], caption: str) -> None:
        """Add animated drawings from `friction_comp.reports.moving_joint`.

        Parameters
        ----------
        drawings : sequence of str
            Animated SVG, shown side by side where there is room.
        caption : str
        """
        self._figures += 1
        self._moves = True
        self._parts.append(
            f'<figure class="movie"><div class="scenes">{"".join(drawings)}</div>'
            '<button type="button" hidden>Pause</button>'
            f'<figcaption><b>Figure {self._figures}.</b> {_inline(caption)}</figcaption></figure>')

    def made_by(self, *lines: str) -> None:
        """Add the origin of the page to its footer: the command, the recordings, the models."""
        self._origin.extend(lines)

    def code(self, text: str) -> None:
        """Add a block of commands or file content."""
        self._parts.append(
            f'<pre tabindex="0"><code>{escape(text.strip(chr(10)))}</code></pre>')

    def html(self) -> str:
        """Return the page."""
        style = Path(__file__).with_name('page.css').read_text(encoding='utf-8')
        subtitle = f'<p class="subtitle">{_inline(self.subtitle)}</p>' if self.subtitle else ''
        links = ''.join(
            f'<a href="#section-{k}">{escape(_plain(name))}</a>'
            for k, name in enumerate(self._sections, 1))
        contents = f'<nav aria-label="Sections">{links}</nav>' if len(self._sections) > 2 else ''
        parts, scripts = '\n'.join(self._parts), ''
        if self._live:
            script, elements = plots([panels for _, _, panels in self._live])
            for (index, words, _), element in zip(self._live, elements):
                parts = parts.replace(
                    f'<!--live {index}-->',
                    f'<div class="live" role="group" aria-label="{words}">{element}</div>')
            # Set before the layout, so that nothing jumps.
            scripts = ("<script>document.documentElement.classList.add('scripted');</script>\n"
                       f'{library()}\n{script}\n')
        if self._moves:
            moving = Path(__file__).with_name('moving.js').read_text(encoding='utf-8')
            parts += f'\n<script>\n{moving}</script>'
        origin = ''.join(f'<br>{_inline(line)}' for line in self._origin)
        when = datetime.now().astimezone().strftime('%Y-%m-%d %H:%M %Z')
        return (
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f'<title>{escape(_plain(self.title))}</title>\n<style>\n{style}</style>\n{scripts}'
            '</head>\n'
            f'<body>\n<main>\n<header>\n<h1>{_inline(self.title)}</h1>\n{subtitle}{contents}\n'
            f'</header>\n{parts}\n<footer>Made by friction_comp {__version__} on {when}.'
            f'{origin}</footer>\n'
            '</main>\n</body>\n</html>\n')

    def save(self, path: str | Path) -> None:
        """Write the page atomically.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        write_atomically(path, self.html())


def number(value: float | int | None, digits: int = 3) -> str:
    """Return a number with few significant digits, thousands in full, and a dash for None.

    Parameters
    ----------
    value : float, int or None
    digits : int
        Significant digits.

    Returns
    -------
    str
    """
    if value is None or (isinstance(value, (float, np.floating)) and math.isnan(value)):
        return '–'
    if isinstance(value, (int, np.integer)):
        return str(value)
    if value == 0 or math.isinf(value):
        return f'{value:g}'
    magnitude = math.floor(math.log10(abs(value)))
    if -4 <= magnitude < 6:
        return f'{value:.{max(digits - 1 - magnitude, 0)}f}'.replace('-', '\u2212')
    return f'{value:.{digits - 1}e}'.replace('-', '\u2212')


def quantity(value: float, unit: str) -> str:
    """Return a number with its unit, small currents in mA.

    Parameters
    ----------
    value : float
    unit : str

    Examples
    --------
    >>> quantity(0.0123, 'A')
    '12.3 mA'
    >>> quantity(0.0123, 'N·m')
    '0.0123 N·m'
    """
    if unit == 'A' and abs(value) < 0.1:
        value, unit = 1e3 * value, 'mA'
    return f'{number(value)} {unit}'


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) \
        and not isinstance(value, bool)


def _decimals(column: list[Any]) -> int | None:
    """Return the number of decimals for a column, or None where its magnitudes differ too much."""
    sizes = [abs(float(v)) for v in column if isinstance(v, (float, np.floating))
             and math.isfinite(v) and v != 0]
    if not sizes or min(sizes) < 0.01 * max(sizes) or not 1e-4 <= max(sizes) < 1e6:
        return None
    return max(2 - math.floor(math.log10(max(sizes))), 0)


def _cell(value: Any, decimals: int | None = None) -> str:
    if isinstance(value, (float, np.floating)) and math.isfinite(value) and decimals is not None:
        return f'{value:.{decimals}f}'.replace('-', '\u2212')
    if value is None or _is_number(value):
        return number(value)
    if isinstance(value, Link):
        return f'<a href="{escape(quote(value.target), quote=True)}">{escape(value.text)}</a>'
    return _inline(str(value))


def _items(lines: list[str]) -> str:
    items = []
    for line in lines:
        if line.startswith('- '):
            items.append(line[2:])
        else:
            items[-1] += ' ' + line
    return '<ul>' + ''.join(f'<li>{_inline(item)}</li>' for item in items) + '</ul>'


def _inline(text: object) -> str:
    """Return text as HTML: markup becomes tags, everything else is escaped."""
    pieces = re.split(r'(`[^`]+`)', str(text))
    for k, piece in enumerate(pieces):
        if k % 2:
            pieces[k] = f'<code>{escape(piece[1:-1])}</code>'
            continue
        # No line break in a formula as short as d = 0.
        piece = re.sub(r'\b(\w) = (?=\S)', '\\1\u00a0=\u00a0', escape(piece))
        piece = re.sub(r'\*\*(.+?)\*\*', r'<b>\1</b>', piece)
        pieces[k] = re.sub(r'(?<![\w*])\*(?!\s)([^*]+?)(?<!\s)\*(?![\w*])', r'<em>\1</em>', piece)
    return ''.join(pieces)


def _unbroken(value: str) -> str:
    """Return an escaped value without a line break between number and unit."""
    return escape(re.sub(r'(?<=\d) (?=\S+$)', '\u00a0', value))


def _plain(text: object) -> str:
    """Return text without markup."""
    return re.sub(r'\*\*|`|(?<!\w)\*(?=\w)|(?<=\w)\*(?!\w)', '', str(text))
