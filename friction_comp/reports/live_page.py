# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The live page, which needs no internet: motion, currents and residual of each joint."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
import time
from typing import Any, Protocol

from bokeh import models
from bokeh.layouts import column, row
from bokeh.plotting import figure
import numpy as np

from friction_comp.reports.figures import COLOURS
from friction_comp.reports.moving_joint import still_joint
from friction_comp.signal_checks import STANDSTILL

SIGNALS = ('time', 'position', 'velocity', 'reference_velocity', 'direction', 'current', 'command',
           'predicted', 'residual', 'torque', 'load')
# Signals of each plot with legend and colour, distinguishable with any colour vision (Okabe and
# Ito 2008).
_PLOTS = (
    ('Torque (N·m)', (('torque', 'motor, at the joint', 'blue'), ('load', 'person', 'orange'))),
    ('Current (A)', (('current', 'measured', 'blue'), ('command', 'commanded', 'yellow'),
                     ('predicted', 'model', 'green'))),
    ('Velocity (rad/s)', (('velocity', 'joint', 'blue'),
                          ('reference_velocity', 'reference', 'yellow'))),
    ('Direction', (('direction', 'announced', 'pink'),)),
    ('Residual (A)', (('residual', 'measured − model, in motion', 'red'),)))
_TABLE = {'position': 'rad', 'velocity': 'rad/s', 'direction': 'd', 'current': 'A',
          'torque': 'N·m', 'load': 'N·m', 'residual': 'A'}
_LEVELS = {'ok': '#0a7d4f', 'note': '#4a5765', 'warning': '#a85b00', 'problem': '#b3261e'}
# Gap across which no line is drawn, and length of the time axis, s.
_GAP, _LENGTH = 0.25, 10.0
# Time between updates, ms, and playback speeds of a recording as multiples of real time.
_PERIOD = 200
_PLAYBACK_SPEEDS = ('0.1', '0.5', '1', '2', '5', '20')

# The style of the other pages. Style sheets cannot change the colours of a canvas, so the dark
# page is inverted as a whole with its hues kept.
_TEMPLATE = """
{% block postamble %}
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
html { background: #f6f7f9; }
body {
  max-width: 75rem; min-height: 100vh; margin: 0 auto; padding: 1rem 1.25rem 3rem;
  box-sizing: border-box; background: #fff;
  font: 16px/1.6 system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', sans-serif;
}
@media (prefers-color-scheme: dark) {
  html { background: #12171d; }
  body { filter: invert(0.9) hue-rotate(180deg); }
}
</style>
{% endblock %}
"""


class Feed(Protocol):
    """The source of the page's data."""

    title: str
    joints: list[str]
    duration: float  # of a recording, s; 0 for a running system

    def window(self, joint: str, end: float, length: float) -> dict[str, np.ndarray]:
        """Return the `SIGNALS` in `length` s before `end`, or before now for a running system."""

    def status(self) -> list[tuple[str, str, str]]:
        """Return level ('ok', 'note', 'warning', 'problem'), name and text, the worst first."""


def live_page(feed: Feed) -> Callable[[Any], None]:
    """Return the Bokeh application that shows a feed."""
    def application(document: Any) -> None:
        page = _Page(feed)
        document.title = feed.title
        document.template = _TEMPLATE
        document.add_root(page.layout)
        document.add_periodic_callback(page.update, _PERIOD)
    return application


class _Page:
    """One visitor's view; its controls do not affect other visitors."""

    def __init__(self, feed: Feed):
        self._feed = feed
        self._updated = time.monotonic()
        self._source = models.ColumnDataSource({name: [] for name in SIGNALS})
        self._overview = models.ColumnDataSource({'joint': [], **{name: [] for name in _TABLE}})
        self._status = models.Div(sizing_mode='stretch_width')
        self._drawing = models.Div(width=330, height=220)
        self._span: dict[str, tuple[float, float, float]] = {}
        self._joint = models.Select(title='Joint', value=next(iter(feed.joints), ''), width=160,
                                    options=feed.joints)
        self._play = models.Toggle(label='Play', button_type='primary', width=80, align='end')
        self._speed = models.Select(title='Speed', value='1', width=80,
                                    options=list(_PLAYBACK_SPEEDS))
        self._seek = models.Slider(
            title='Time (s)', start=0.0, end=feed.duration or 1.0, step=0.05, min_width=240,
            value=min(_LENGTH, feed.duration), sizing_mode='stretch_width')
        playback = [self._play, self._speed, self._seek] if feed.duration else []
        self.layout = column(
            models.Div(
                text=f'<h1 style="font-size:1.3em;margin:0.2em 0">{escape(feed.title)}</h1>'),
            self._status,
            # The controls wrap on a narrow page.
            row(self._joint, *playback, sizing_mode='stretch_width',
                styles={'flex-wrap': 'wrap'}),
            self._drawing,
            self._table(),
            *_plots(self._source), sizing_mode='stretch_width')
        self.update()

    def _table(self) -> Any:
        numbers, whole = (models.NumberFormatter(format=digits, nan_format='–', text_align='right')
                          for digits in ('0.0000', '0'))
        columns = [models.TableColumn(field='joint', title='joint')] + [
            models.TableColumn(field=name, title=f'{name} ({unit})',
                               formatter=whole if name == 'direction' else numbers)
            for name, unit in _TABLE.items()]
        return models.DataTable(
            source=self._overview, columns=columns, index_position=None, sortable=False,
            selectable=False, reorderable=False, sizing_mode='stretch_width',
            height=30 + 26 * max(1, min(8, len(self._feed.joints))))

    def update(self) -> None:
        """Update the page to the present time."""
        now = time.monotonic()
        if self._play.active:
            self._seek.value = min(
                self._seek.value + (now - self._updated) * float(self._speed.value),
                self._feed.duration)
            self._play.active = self._seek.value < self._feed.duration
        self._updated = now
        if self._joint.options != self._feed.joints:
            self._joint.options = list(self._feed.joints)
            if self._joint.value not in self._feed.joints:
                self._joint.value = next(iter(self._feed.joints), '')
        # The only joint of a table may have no name.
        if self._joint.value in self._feed.joints:
            data = self._feed.window(self._joint.value, self._seek.value, _LENGTH)
            self._source.data = with_gaps(data)
            self._drawing.text = self._draw_joint(self._joint.value, data)
        last = {joint: with_gaps(self._feed.window(joint, self._seek.value, 1.0))
                for joint in self._feed.joints}
        self._overview.data = {'joint': list(last), **{
            name: [float(data[name][-1]) if len(data[name]) else float('nan')
                   for data in last.values()] for name in _TABLE}}
        self._status.text = ' '.join(
            f'<span style="color:{_LEVELS[level]};margin-right:1.5em"><b>{escape(name)}</b>: '
            f'{escape(text)}</span>' for level, name, text in self._feed.status())

    def _draw_joint(self, joint: str, data: dict[str, np.ndarray]) -> str:
        """Return a drawing of the joint's latest state, scaled to all data so far."""
        if not len(data['time']):
            return ''
        position = data['position'][np.isfinite(data['position'])]
        load = np.abs(data['load'][np.isfinite(data['load'])])
        low, high, largest = self._span.get(joint, (np.inf, -np.inf, 1e-3))
        low, high = position.min(initial=low), position.max(initial=high)
        self._span[joint] = low, high, largest = low, high, load.max(initial=largest)
        middle = 0.5 * (low + high) if np.isfinite(low + high) else 0.0
        return still_joint(float(data['position'][-1]), float(data['load'][-1]), largest, middle)


def _plots(source: models.ColumnDataSource) -> list[Any]:
    """Return the plots one above the other, with a common time axis."""
    plots: list[Any] = []
    for label, lines in _PLOTS:
        ranges: dict[str, Any] = {'x_range': plots[0].x_range} if plots else {}
        if label == 'Direction':
            ranges['y_range'] = (-1.4, 1.4)
        plot = figure(height=125 if label == 'Direction' else 180, min_border_left=80,
                      sizing_mode='stretch_width', tools='xpan,xwheel_zoom,reset',
                      toolbar_location=None, y_axis_label=label, **ranges)
        for name, legend, colour in lines:
            draw = plot.step if name == 'direction' else plot.line
            # Set points are dashed.
            draw('time', name, source=source, color=COLOURS[colour], line_width=1.6,
                 line_dash=[6, 4] if name in ('command', 'reference_velocity') else 'solid',
                 legend_label=legend)
        if label == 'Direction':
            plot.yaxis.ticker = [-1, 0, 1]
        # Above the plot, where it does not cover the curves.
        plot.add_layout(plot.legend[0], 'above')
        plot.legend[0].update(orientation='horizontal', border_line_color=None, margin=0, padding=0,
                              label_text_font_size='9pt')
        plot.yaxis.axis_label_text_font_style = 'normal'
        plots.append(plot)
    plots[-1].xaxis.axis_label = 'Time (s)'
    return plots


def with_gaps(data: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return signals with a NaN inserted in each gap, and the residual NaN at standstill."""
    still = ~(np.abs(data['velocity']) > STANDSTILL)
    data = {**data, 'residual': np.where(still, np.nan, data['residual'])}
    gaps = np.nonzero(np.diff(data['time']) > _GAP)[0] + 1
    result = {name: np.insert(values, gaps, np.nan) for name, values in data.items()}
    # The inserted time lies between its neighbours, so that time increases.
    result['time'] = np.insert(data['time'], gaps, data['time'][gaps - 1] + 0.5 * _GAP)
    return result
