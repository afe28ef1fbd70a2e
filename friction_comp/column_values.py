# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Converts the values of a column to numbers, dates to seconds, and columns to text."""

from __future__ import annotations

from collections.abc import Mapping
import io
import re

import numpy as np

from friction_comp.errors import InputError

_DATE = re.compile(r'(\d{4}-\d\d-\d\d)[T ]?(\d\d:\d\d(?::\d\d(?:[.,]\d+)?)?)?'
                   r'\s*(?:Z|([+-])(\d\d):?(\d\d))?')
# With points, unlike slashes, the day always comes before the month.
_DAY = re.compile(r'(\d\d?)\.(\d\d?)\.(\d{4})(?:,? +(\d.*))?')
# A time of the day, or a duration as pandas writes it, with days before.
_CLOCK = re.compile(r'(?:(\d+) days? )?(\d\d?):(\d\d):(\d\d(?:[.,]\d+)?)')
# Advice for a column that has the name of a signal but other content.
NOT_A_SIGNAL = 'give it numbers (a direction is -1, 0 or 1), or a name that is not one of a signal'


def to_numbers(values: np.ndarray, name: str, where: object) -> np.ndarray:
    """Return a column as floats, dates in s; raises InputError if its values are neither."""
    if np.issubdtype(values.dtype, np.datetime64):
        dates = values.astype('datetime64[ns]')
        return np.where(np.isnat(dates), np.nan, dates.astype(np.int64) * 1e-9)
    if np.issubdtype(values.dtype, np.timedelta64):
        return values / np.timedelta64(1, 's')
    if values.dtype == bool:
        raise InputError(f'{where}: column {name!r} holds true and false: {NOT_A_SIGNAL}')
    try:
        return values.astype(float)
    except (TypeError, ValueError):
        pass
    try:
        return np.array([date_in_seconds(str(value)) for value in values])
    except ValueError:
        raise InputError(f'{where}: column {name!r} does not contain numbers') from None


def date_in_seconds(text: str) -> float:
    """Return an ISO 8601 date as s since 1970, a time of the day as s since midnight.

    A day may be written 4.3.2026, too. Raises ValueError for any other text.
    """
    clock_time = _CLOCK.fullmatch(text.strip())
    if clock_time:
        days, hours, minutes, seconds = (float((part or '0').replace(',', '.'))
                                         for part in clock_time.groups())
        return 3600.0 * (24.0 * days + hours) + 60.0 * minutes + seconds
    written = _DAY.fullmatch(text.strip())
    if written:
        day, month, year, clock = written.groups()
        return date_in_seconds(f'{year}-{int(month):02}-{int(day):02}') + (
            date_in_seconds(clock) if clock else 0.0)
    match = _DATE.fullmatch(text.strip())
    if not match:
        raise ValueError(text)
    day, clock, sign, *zone = match.groups()
    date = np.datetime64(f'{day}T{(clock or "00:00").replace(",", ".")}', 'ns')
    ahead = 60.0 * (60.0 * int(zone[0]) + int(zone[1])) if sign else 0.0
    return float(date.astype(np.int64) * 1e-9) - (ahead if sign == '+' else -ahead)


def to_csv(columns: Mapping[str, np.ndarray], digits: int) -> str:
    """Return columns as CSV with some significant digits, the first, times in s, to the ns."""
    stream = io.StringIO()
    np.savetxt(stream, np.column_stack(list(columns.values())), delimiter=',', comments='',
               header=','.join(columns), fmt=['%.9f', *[f'%.{digits}g'] * (len(columns) - 1)])
    return stream.getvalue()


def read_pairs(text: str, what: str, form: str = 'SIGNAL=NAME, for instance time=t,position=q_2'
               ) -> dict[str, str]:
    """Parse ``a=b,c=d`` into a dictionary; InputError, which says the form, if it is invalid."""
    pairs: dict[str, str] = {}
    for part in text.split(','):
        name, sign, value = (piece.strip() for piece in part.partition('='))
        if not (name and sign and value):
            raise InputError(f'{what}: {part.strip()!r} is not of the form {form}')
        if name in pairs:
            raise InputError(f'{what}: names {name} twice')
        pairs[name] = value
    return pairs
