# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Builds a report as one self-contained HTML file without scripts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import datetime
from html import escape
import math
from pathlib import Path
import re
from typing import Any, NamedTuple
from urllib.parse import quote

from markdown_it import MarkdownIt
from markdown_it.rules_core import StateCore
from matplotlib.figure import Figure
from matplotlib.text import Text
import numpy as np

from friction_comp import __version__
from friction_comp.files import write_atomically
from friction_comp.number_text import number
from friction_comp.reports.figures import for_page
from friction_comp.units import in_own_units


def _keep_formulas_together(state: StateCore) -> None:
    """Prevent line breaks within short formulas such as d = 0."""
    for token in state.tokens:
        for child in token.children or ():
            if child.type == 'text':
                child.content = re.sub(r'\b(\w) = (?=\S)', '\\1\u00a0=\u00a0', child.content)


_MARKDOWN = MarkdownIt('zero').enable(['emphasis', 'backticks', 'list'])
_MARKDOWN.core.ruler.push('formulas', _keep_formulas_together)


class Link(NamedTuple):
    """A table cell's text, and the file that it links to."""

    text: str
    target: str


class Report:
    """A page that grows from top to bottom.

    Texts may contain Markdown: ``**strong**``, ``*emphasis*`` and ```code```; `text` and `verdict`
    also take several paragraphs and lists. `subtitle` is a line under the title. The page of a
    `linear` axis is in m and N instead of rad and N·m.

    Examples
    --------
    >>> report = Report('Backdrivability of the elbow')
    >>> report.verdict('The joint was **much** easier to move.')
    >>> report.table(['condition', 'peak (N·m)'], [['d = 0', 1.28], ['d = ±1', 0.44]])
    >>> '<h1>Backdrivability of the elbow</h1>' in report.html()
    True
    """

    def __init__(self, title: str, subtitle: str = '', linear: bool = False) -> None:
        self.title, self.subtitle, self._linear = title, subtitle, linear
        self._figures = 0
        self._parts: list[str] = []
        self._sections: list[str] = []
        self._origin: list[str] = []

    def heading(self, text: str, level: int = 2) -> None:
        """Begin a section (level 2), which the page's head links to, or a subsection (level 3)."""
        anchor = ''
        if level == 2:
            self._sections.append(_plain(text))
            anchor = f' id="section-{len(self._sections)}"'
        self._parts.append(f'<h{level}{anchor}>{_inline(text)}</h{level}>')

    def text(self, text: str) -> None:
        """Add paragraphs and lists."""
        self._parts.append(_block(text))

    def bullets(self, lines: Iterable[str], title: str = '') -> None:
        """Add a bullet list after a paragraph `title`; without lines, add nothing."""
        items = ''.join(f'- {line}\n' for line in lines)
        if items:
            self.text(f'{title}\n\n{items}')

    def verdict(self, text: str) -> None:
        """Add the main result in a box; it comes first on every page."""
        self._parts.append(f'<div class="verdict">{_block(text)}</div>')

    def numbers(self, tiles: list[tuple[str, str]]) -> None:
        """Add tiles with a number in large type; each is a value with unit, and a label."""
        cells = ''.join(f'<div class="tile"><b>{_unbroken(value)}</b>'
                        f'<span>{_inline(label)}</span></div>' for value, label in tiles)
        self._parts.append(f'<div class="tiles">{cells}</div>')

    def table(self, header: Sequence[str], rows: Iterable[Sequence[Any]],
              caption: str = '') -> None:
        """Add a table of strings, numbers, links and None.

        Numbers of a column have as many decimals as the largest with three significant digits, or
        three significant digits each if their magnitudes differ much.
        """
        rows = list(rows)
        columns = list(zip(*rows, strict=True)) or [()] * len(header)
        numeric = [any(map(_is_number, column)) and all(
            value is None or _is_number(value) for value in column) for column in columns]
        kinds = [' class="number"' if is_number else '' for is_number in numeric]
        cells = [[_cell(value, decimals) for value in column]
                 for column in columns for decimals in [_decimals(column)]]
        head = ''.join(f'<th scope="col"{kind}>{_inline(name)}</th>' if name else '<td></td>'
                       for kind, name in zip(kinds, header, strict=True))
        body = ''.join(
            '<tr>' + ''.join(f'<td{kind}>{cell}</td>' for kind, cell in zip(kinds, row)) + '</tr>'
            for row in zip(*cells))
        title = f'<caption>{_inline(caption)}</caption>' if caption else ''
        # A scrollable region must be reachable from the keyboard.
        self._parts.append(
            f'<div class="wide" tabindex="0"><table>{title}<thead><tr>{head}</tr></thead>'
            f'<tbody>{body}</tbody></table></div>')

    def figure(self, figure: Figure, caption: str) -> None:
        """Add a figure with a text below it, which screen readers read in place of the figure."""
        if self._linear:
            for text in figure.findobj(Text):
                text.set_text(in_own_units(text.get_text(), True))
        drawing, note = for_page(figure)
        # Ids must be unique among all drawings of the page.
        drawing = re.sub(r'( id="|href="#|url\(#)', rf'\g<1>f{self._figures + 1}-', drawing)
        drawing = drawing.replace('<svg ', f'<svg role="img" aria-label="{_plain(caption)}" ', 1)
        self._figures += 1
        self._parts.append(
            f'<figure>{drawing}<figcaption><b>Figure {self._figures}.</b> '
            f'{_inline(caption + note)}</figcaption></figure>')

    def made_by(self, *lines: str) -> None:
        """Add the origin of the page to its footer: command, recordings and models."""
        self._origin.extend(lines)

    def code(self, text: str) -> None:
        """Add a block of commands or file content."""
        self._parts.append(f'<pre tabindex="0"><code>{escape(text.strip(chr(10)))}</code></pre>')

    def html(self) -> str:
        """Return the page."""
        style = Path(__file__).with_name('page.css').read_text(encoding='utf-8')
        subtitle = f'<p class="subtitle">{_inline(self.subtitle)}</p>' if self.subtitle else ''
        links = ''.join(f'<a href="#section-{k}">{name}</a>'
                        for k, name in enumerate(self._sections, 1))
        contents = f'<nav aria-label="Sections">{links}</nav>' if len(self._sections) > 2 else ''
        when = datetime.now().astimezone().strftime('%Y-%m-%d %H:%M %Z')
        footer = '<br>'.join([f'Made by friction_comp {__version__} on {when}.',
                              *map(_inline, self._origin)])
        parts = in_own_units('\n'.join(self._parts), self._linear)
        return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{_plain(self.title)}</title>
<style>
{style}</style>
</head>
<body>
<main>
<header>
<h1>{_inline(self.title)}</h1>
{subtitle}{contents}
</header>
{parts}
<footer>{footer}</footer>
</main>
</body>
</html>
"""

    def save(self, path: str | Path) -> None:
        """Write the page atomically; an `InputError` says why it cannot be written."""
        write_atomically(path, self.html())


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def _decimals(column: Sequence[Any]) -> int | None:
    """Return the number of decimals for a column, or None where its magnitudes differ too much."""
    sizes = [abs(float(v)) for v in column if isinstance(v, (float, np.floating))
             and math.isfinite(v) and v != 0]
    if not sizes or min(sizes) < 0.01 * max(sizes) or not 1e-4 <= max(sizes) < 1e6:
        return None
    return max(2 - math.floor(math.log10(max(sizes))), 0)


def _cell(value: Any, decimals: int | None) -> str:
    if isinstance(value, (float, np.floating)) and math.isfinite(value) and decimals is not None:
        return f'{value:.{decimals}f}'.replace('-', '\u2212')
    if value is None or _is_number(value):
        return number(value)
    if isinstance(value, Link):
        return f'<a href="{escape(quote(value.target))}">{escape(value.text)}</a>'
    return _inline(value)


def _block(text: str) -> str:
    return str(_MARKDOWN.render(text))


def _inline(text: object) -> str:
    """Return a line of text as HTML."""
    return str(_MARKDOWN.renderInline(str(text)))


def _unbroken(value: str) -> str:
    """Return an escaped value without a line break between number and unit."""
    return escape(re.sub(r'(?<=\d) (?=\S+$)', '\u00a0', value))


def _plain(text: str) -> str:
    """Return a line of text without markup, escaped."""
    return re.sub(r'<[^>]+>', '', _inline(text))
