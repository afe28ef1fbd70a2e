# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Builds a report as one self-contained HTML file without scripts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import datetime
from html import escape
from numbers import Real
from pathlib import Path
import re
from typing import Any, NamedTuple, TYPE_CHECKING
from urllib.parse import quote

from friction_comp import __version__
from friction_comp.files import write_atomically
from friction_comp.terminal import in_own_units, number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Private characters around the name and the text of a value: no text that is read has them.
_BEGIN, _NAMED, _END = '\ue000', '\ue001', '\ue002'
_VALUE = re.compile(f'{_BEGIN}(.*?){_NAMED}(.*?){_END}')
_NUMERIC = re.compile(r'^[>+−\d][>\d. ]*( to [−\d.]+| [^\s,]+)$')


class Link(NamedTuple):
    """A table cell's text, and the file that it links to."""

    text: str
    target: str


def value(name: str, text: str) -> str:
    """Return a figure with the name of what it is, to be inserted into any text of a page.

    A page has one text for each name, wherever it shows it: `Report.values` lists them.
    """
    return f'{_BEGIN}{name}{_NAMED}{text}{_END}'


def without_marks(text: str) -> str:
    """Return a text for a terminal: values without their names, nothing strong."""
    return _VALUE.sub(r'\2', text).replace('**', '').replace('`', '')


class Report:
    """A page that grows from top to bottom.

    In texts, ``**strong**`` and ```code``` are marked. `subtitle` is a line under the title. The
    page of a `linear` axis is in m and N instead of rad and N·m.

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
        self._origin: list[str] = []

    @property
    def values(self) -> list[tuple[str, str]]:
        """Name and text of every figure on the page, in the order in which they stand there."""
        return [(name, _plain(text)) for name, text in _VALUE.findall('\n'.join(self._parts))]

    def heading(self, text: str) -> None:
        """Begin a section."""
        self._parts.append(f'<h2>{_inline(text)}</h2>')

    def text(self, text: str) -> None:
        """Add paragraphs, which empty lines separate."""
        self._parts += [f'<p>{_inline(part)}</p>' for part in text.strip().split('\n\n') if part]

    def bullets(self, lines: Iterable[str], title: str = '') -> None:
        """Add a bullet list after a paragraph `title`; without lines, add nothing."""
        items = ''.join(f'<li>{_inline(line)}</li>' for line in lines)
        if items:
            self.text(title)
            self._parts.append(f'<ul>{items}</ul>')

    def verdict(self, text: str) -> None:
        """Add the main result in a box; it comes first on every page."""
        paragraphs = ''.join(f'<p>{_inline(part)}</p>' for part in text.strip().split('\n\n'))
        self._parts.append(f'<div class="verdict">{paragraphs}</div>')

    def numbers(self, tiles: Sequence[tuple[str, str]]) -> None:
        """Add tiles with a number in large type; each is a value with unit, and a label."""
        cells = ''.join(f'<div class="tile"><b>{_cell(text)}</b><span>{_inline(label)}</span>'
                        '</div>' for text, label in tiles)
        self._parts.append(f'<div class="tiles">{cells}</div>')

    def table(self, header: Sequence[str], rows: Iterable[Sequence[Any]],
              caption: str = '') -> None:
        """Add a table of strings, numbers (with three digits), links and None."""
        rows = list(rows)
        numeric = [any(map(_is_number, column)) for column in zip(*rows)] or [False] * len(header)
        kinds = [' class="number"' if is_number else '' for is_number in numeric]
        head = ''.join(f'<th scope="col"{kind}>{_inline(name)}</th>' if name else '<td></td>'
                       for kind, name in zip(kinds, header, strict=True))
        body = ''.join('<tr>' + ''.join(
            f'<td{kind}>{_cell(one)}</td>' for kind, one in zip(kinds, row, strict=True))
            + '</tr>' for row in rows)
        # Above what scrolls, so that it breaks at the width of the page.
        title = f'<p class="caption">{_inline(caption)}</p>' if caption else ''
        # A scrollable region must be reachable from the keyboard.
        self._parts.append(
            f'{title}<div class="wide" tabindex="0"><table><thead><tr>{head}</tr></thead>'
            f'<tbody>{body}</tbody></table></div>')

    def figure(self, figure: Figure, caption: str) -> None:
        """Add a figure with a text below it, which screen readers read in place of the figure."""
        # Matplotlib is imported only where something is drawn.
        from friction_comp.reports.figures import for_page

        drawing = for_page(figure, self._linear)
        self._figures += 1
        # Ids must be unique among all drawings of the page.
        drawing = re.sub(r'( id="|href="#|url\(#)', rf'\g<1>f{self._figures}-', drawing)
        drawing = drawing.replace('<svg ', f'<svg role="img" aria-label="{_plain(caption)}" ', 1)
        self._parts.append(f'<figure>{drawing}<figcaption><b>Figure {self._figures}.</b> '
                           f'{_inline(caption)}</figcaption></figure>')

    def code(self, text: str) -> None:
        """Add a block of commands or file content."""
        self._parts.append(f'<pre tabindex="0"><code>{escape(text.strip(chr(10)))}</code></pre>')

    def made_by(self, *lines: str) -> None:
        """Add the origin of the page to its footer: command, recordings and models."""
        self._origin.extend(lines)

    def html(self) -> str:
        """Return the page."""
        style = Path(__file__).with_name('page.css').read_text(encoding='utf-8')
        subtitle = f'<p class="subtitle">{_inline(self.subtitle)}</p>' if self.subtitle else ''
        when = datetime.now().astimezone().strftime('%Y-%m-%d %H:%M %Z')
        footer = '<br>'.join([f'Made by friction_comp {__version__} on {when}.',
                              *map(_inline, self._origin)])
        parts = in_own_units(_VALUE.sub(
            r'<span data-name="\1">\2</span>', '\n'.join(self._parts)), self._linear)
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
{subtitle}
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


def _is_number(one: object) -> bool:
    return isinstance(one, Real) and not isinstance(one, bool)


def _cell(one: Any) -> str:
    if one is None or _is_number(one):
        return number(one)
    if isinstance(one, Link):
        return f'<a href="{escape(quote(one.target))}">{escape(one.text)}</a>'
    # A number stays in one line with its unit, or the other end of its interval.
    return _inline(_NUMERIC.sub(lambda found: found[0].replace(' ', '\u00a0'), str(one)))


def _inline(text: object) -> str:
    """Return a text as HTML, with what is strong and code, and with formulas in one line."""
    marked = re.sub(r'\b(\w) = (?=\S)', '\\1\u00a0=\u00a0', escape(str(text), quote=False))
    marked = re.sub(r'`([^`]+)`', r'<code>\1</code>', marked)
    return re.sub(r'\*\*(.+?)\*\*', r'<strong>\1</strong>', marked)


def _plain(text: str) -> str:
    """Return a line of text without markup, escaped for an attribute."""
    bare = re.sub(r'<[^>]+>', '', _inline(_VALUE.sub(r'\2', text)))
    return bare.replace('"', '&quot;')
