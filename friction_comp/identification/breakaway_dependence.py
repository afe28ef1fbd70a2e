# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the scatter of breakaway currents depends on."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np
from scipy import stats

from friction_comp.errors import InputError
from friction_comp.series import lag1_autocorrelation
from friction_comp.statistics import holm

if TYPE_CHECKING:
    from friction_comp.identification.breakaway import BreakawayRecords

VARIABLES = {
    'position': 'rad', 'rest_time': 's', 'temperature': 'degrees Celsius', 'slope': 'A/s',
    'cycle': 'cycles', 'ramp_rate': ''}
LEVEL = 0.01
"""Probability of naming any variable by chance, all variables and directions taken together."""

_FEWEST = 8


@dataclass(frozen=True)
class BreakawayDependence:
    """How the breakaway level depends on one variable.

    Attributes
    ----------
    variable : str
    direction : int
        +1 or -1; 0 where the data do not tell directions apart.
    correlation : float
        Rank correlation (Spearman) of the level's magnitude with the variable.
    p_value : float
        Probability of such a correlation by chance, serial correlation allowed for and raised
        for the number of variables tried (Holm).
    gradient : float
        Change of the magnitude per unit of the variable, by a robust line (Theil and Sen).
    explained : float
        Share of the variance that goes with the variable's rank, 0 to 1.
    significant : bool
    """

    variable: str
    direction: int
    correlation: float
    p_value: float
    gradient: float
    explained: float
    significant: bool


@dataclass(frozen=True)
class ScatterReport:
    """Dependences, strongest first, and what could not be judged.

    Attributes
    ----------
    dependences : list of BreakawayDependence
    constant : list of str
        Variables that hardly varied or were not measured: nothing can be said of them.
    confounded : list of (str, str)
        Pairs that rose and fell together, at least one of them significant: the data cannot
        tell which of the two it is.
    """

    dependences: list[BreakawayDependence]
    constant: list[str] = field(default_factory=list)
    confounded: list[tuple[str, str]] = field(default_factory=list)

    @property
    def significant(self) -> list[BreakawayDependence]:
        """The dependences that are not chance."""
        return [item for item in self.dependences if item.significant]

    def sentences(self) -> list[str]:
        """Return the report in plain sentences."""
        side = {1: ' in the positive direction', -1: ' in the negative direction', 0: ''}
        lines = []
        for item in self.significant:
            lines.append(
                f'The breakaway level{side[item.direction]} '
                f"{'rises' if item.correlation > 0 else 'falls'} with {_word(item.variable)} "
                f'(rank correlation {item.correlation:+.2f}, p = {item.p_value:.1g}, '
                f'{100 * item.explained:.0f} % of the variance).')
        if not lines and self.dependences:
            lines.append('The scatter depends on none of the variables measured: '
                         + ', '.join(sorted({_word(d.variable) for d in self.dependences})) + '.')
        for a, b in self.confounded:
            lines.append(f'{_word(a)} and {_word(b)} varied together; vary one with the other '
                         'held, or in random order, to tell them apart.')
        if self.constant:
            lines.append('Nothing can be said of what hardly varied, or was measured fewer than '
                         f'{_FEWEST} times: '
                         + ', '.join(map(_word, self.constant)) + '.')
        return lines


def scatter_report(records: BreakawayRecords | dict[str, Any],
                   level: float = LEVEL) -> ScatterReport:
    """Test the breakaway level against everything recorded with it.

    Parameters
    ----------
    records : BreakawayRecords or dict
        A dict has 'level' (magnitudes), optionally 'direction' and 'session', and the variables,
        all (M,). Differences between sessions are taken out first.
    level : float
        Probability of any false finding.

    Returns
    -------
    ScatterReport
    """
    if isinstance(records, dict):
        magnitude = np.asarray(records['level'], dtype=float)
        direction = np.asarray(records.get('direction', np.zeros(magnitude.size)), dtype=int)
        columns = {name: np.asarray(records[name], dtype=float)
                   for name in VARIABLES if name in records}
        session = np.asarray(records.get('session', np.zeros(magnitude.size)))
        for number in np.unique(session):
            magnitude = np.where(session == number,
                                 magnitude - np.median(magnitude[session == number]), magnitude)
    else:
        magnitude = np.abs(records.current)
        direction = records.direction
        columns = {name: np.asarray(getattr(records, name), dtype=float)
                   for name in VARIABLES if hasattr(records, name)}
    found, varied, tables = [], set(), []
    for side in np.unique(direction):
        here = direction == side
        for name, values in columns.items():
            chosen = here & np.isfinite(values) & np.isfinite(magnitude)
            if np.sum(chosen) < _FEWEST or not _varies(values[chosen]):
                continue
            varied.add(name)
            found.append((name, int(side), *_test(values[chosen], magnitude[chosen])))
            tables.append((name, int(side), np.where(chosen, values, np.nan)))
    adjusted = holm([item[3] for item in found]).tolist()
    dependences = [
        BreakawayDependence(
            variable=name, direction=side, correlation=rho, p_value=p, gradient=gradient,
            explained=rho ** 2, significant=bool(p < level))
        for (name, side, rho, _, gradient), p in zip(found, adjusted)]
    confounded = []
    for k, first in enumerate(dependences):
        for j in range(k + 1, len(dependences)):
            second = dependences[j]
            if first.direction != second.direction or not (
                    first.significant or second.significant):
                continue
            both = np.isfinite(tables[k][2]) & np.isfinite(tables[j][2])
            pair = (first.variable, second.variable)
            if pair not in confounded and abs(
                    stats.spearmanr(tables[k][2][both], tables[j][2][both])[0]) > 0.8:
                confounded.append(pair)
    dependences.sort(key=lambda item: item.p_value)
    return ScatterReport(dependences, [name for name in columns if name not in varied], confounded)


def read_breakaway_table(paths: str | Path | list[str | Path]) -> dict[str, np.ndarray]:
    """Read tables of breakaway level and ramp rate, two columns of numbers per line.

    Parameters
    ----------
    paths : path or list of paths
        Text files; several are joined and told apart by the column ``session``.

    Returns
    -------
    dict
        ``level``, ``ramp_rate``, ``cycle`` (number within its file) and ``session``, each (M,);
        made for `scatter_report`.

    Raises
    ------
    InputError
        Naming the file, and the line where one is wrong.
    """
    paths = [paths] if isinstance(paths, (str, Path)) else list(paths)
    columns: dict[str, list[float]] = {
        'level': [], 'ramp_rate': [], 'cycle': [], 'session': []}
    for session, path in enumerate(paths):
        try:
            lines = Path(path).read_text(encoding='utf-8').splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f'{path}: cannot be read: {error}') from None
        before = len(columns['level'])
        for number, line in enumerate(lines, 1):
            parts = line.split('#')[0].replace(',', ' ').split()
            if not parts:
                continue
            try:
                level, rate = map(float, parts)
            except ValueError:
                raise InputError(f'{path}, line {number}: two numbers are expected') from None
            if not (np.isfinite(level) and np.isfinite(rate)):
                raise InputError(f'{path}, line {number}: numbers must be finite')
            columns['cycle'].append(len(columns['level']) - before)
            columns['level'].append(abs(level))
            columns['ramp_rate'].append(rate)
            columns['session'].append(session)
        if len(columns['level']) == before:
            raise InputError(f'{path}: holds no measurement')
    return {name: np.array(values, dtype=float) for name, values in columns.items()}


def _word(variable: str) -> str:
    return {'rest_time': 'rest time', 'slope': 'ramp slope', 'cycle': 'cycle number',
            'ramp_rate': 'ramp rate', 'temperature': 'motor temperature'}.get(variable, variable)


def _varies(values: np.ndarray) -> bool:
    """Whether a variable varied by more than rounding and a per mil of its size."""
    spread = float(np.max(values) - np.min(values))
    return spread > 1e-3 * float(np.max(np.abs(values))) and spread > 1e-9


def _test(variable: np.ndarray, magnitude: np.ndarray) -> tuple[float, float, float]:
    """Rank correlation, its probability by chance, and the gradient."""
    x = stats.rankdata(variable)
    y = stats.rankdata(magnitude)
    x = (x - x.mean()) / max(x.std(), 1e-12)
    y = (y - y.mean()) / max(y.std(), 1e-12)
    rho = float(np.clip(np.mean(x * y), -1.0, 1.0))
    # Neighbouring cycles resemble each other: what counts is how alike the variable's and the
    # leftover's neighbours are (Bretherton and others, J. Climate 12, 1999).
    rest = y - rho * x
    alike = lag1_autocorrelation(x) * lag1_autocorrelation(rest - rest.mean())
    count = max(x.size * (1.0 - alike) / (1.0 + alike), 3.0) if alike > 0.0 else x.size
    t = rho * np.sqrt(max(count - 2.0, 1.0) / max(1.0 - rho ** 2, 1e-12))
    p_value = float(2.0 * stats.t.sf(abs(t), max(count - 2.0, 1.0)))
    if variable.size > 1000:  # the gradient's pairs grow with the square
        keep = np.linspace(0, variable.size - 1, 1000).astype(int)
        variable, magnitude = variable[keep], magnitude[keep]
    gradient = float(stats.theilslopes(magnitude, variable)[0])
    return rho, p_value, gradient
