# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The error for unusable input, which a user can correct, and checks of what comes from outside.

The schema of a file is made of readers: `number`, `interval`, `listed`, `mapping` and, for
dataclasses whose fields say what they take, `section`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field, fields, MISSING
import math
from numbers import Integral, Real
from typing import Any, TypeVar

T = TypeVar('T')
Reader = Callable[[Any, str], Any]
"""Returns a value of a file, called by a name in errors; raises InputError if it is no such."""


class InputError(ValueError):
    """Input that cannot be used: a file, an argument, a message or a parameter.

    The message is one line that names the input and the reason. Command-line tools print it to
    standard error and exit with status 2; nodes reject the parameter, goal or message.
    """


@contextmanager
def errors_name(thing: object) -> Iterator[None]:
    """Prefix the message of an InputError with the origin of the input, usually a path."""
    try:
        yield
    except InputError as error:
        raise InputError(f'{thing}: {error}') from None


@contextmanager
def os_errors_name(thing: object, what: str = '') -> Iterator[None]:
    """Turn an error of the operating system into an InputError: origin, `what` failed, and why."""
    try:
        yield
    except OSError as error:
        raise InputError(f'{thing}: {what}{error.strerror or error}') from None


def one_line(error: BaseException) -> str:
    """Return an error's message in one line, or its type if it has none."""
    return ' '.join(str(error).split()) or type(error).__name__


def check_number(value: Any, name: str, *, above: float = -math.inf, least: float = -math.inf,
                 most: float = math.inf) -> float:
    """Return an input, called `name` in errors, as a float.

    Raises InputError if it is not a finite number (booleans are not numbers), or out of bounds:
    `above` is an exclusive, `least` and `most` are inclusive bounds.
    """
    if (isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
            and above < float(value) and least <= float(value) <= most):
        return float(value)
    raise InputError(
        f'{name} must be a {_requirement("finite number", above, least, most)}, not {value!r}')


def check_whole_number(value: Any, name: str, *, least: float = -math.inf,
                       most: float = math.inf) -> int:
    """Return an input as an int; parameters and errors are those of `check_number`."""
    if isinstance(value, Integral) and not isinstance(value, bool) and least <= int(value) <= most:
        return int(value)
    raise InputError(
        f'{name} must be a {_requirement("whole number", -math.inf, least, most)}, not {value!r}')


def _requirement(kind: str, above: float, least: float, most: float) -> str:
    """Return kind and bounds as text, such as 'positive finite number'."""
    if above == 0.0 and most == math.inf:
        return f'positive {kind}'
    above_words = f' above {above:g}' if above > -math.inf else ''
    least_words = f' from {least:.15g}' if least > -math.inf else ''
    most_words = f' {"to" if least_words else "of at most"} {most:.15g}' if most < math.inf else ''
    return f'{kind}{above_words}{least_words}{most_words}'


def check_interval(value: Any, name: str) -> tuple[float, float]:
    """Return two numbers of a file, the lower one first; raises InputError if they are not."""
    if isinstance(value, (list, tuple)) and len(value) == 2:
        low, high = (check_number(end, name) for end in value)
        if low <= high:
            return low, high
    raise InputError(f'{name} must be two numbers, the lower one first, not {value!r}')


def one_of(joints: Sequence[str], joint: str | None, where: object = None) -> str:
    """Return the joint that is named, or the only one; `where` names what holds them, in errors.

    Raises InputError, which lists them, if there are several and none is named, or not that one.
    """
    place, listed = '' if where is None else f'{where}: ', ', '.join(map(repr, joints))
    if not joint and len(joints) > 1:
        raise InputError(f'{place}several joints, name one with --joint: {listed}')
    if joint and joint not in joints:
        raise InputError(f'{place}no joint {joint!r} in it, but {listed}')
    return joint or joints[0]


def check_mapping(value: Any, name: str, known: Collection[str] | None = None) -> dict[str, Any]:
    """Return a section of a file; raises InputError if it is no mapping of `known` entries."""
    if not isinstance(value, dict):
        raise InputError(f'{name} is missing or not a mapping')
    unknown = sorted(str(key) for key in value if known is not None and key not in known)
    if known is not None and unknown:
        raise InputError(f'{name} has unknown entries: {", ".join(unknown)}; '
                         f'known: {", ".join(sorted(known))}')
    return value


def check_list(value: Any, name: str) -> list[Any]:
    """Return a list of a file, empty for None; raises InputError if it is none."""
    if isinstance(value, (str, Mapping)) or not isinstance(value, Iterable | None):
        raise InputError(f'{name} is not a list')
    return [] if value is None else list(value)


def check_document(value: Any, kind: str, format_name: str, version: int,
                   known: Collection[str] | None = None) -> dict[str, Any]:
    """Return the content of a file, called `kind` in errors.

    Raises InputError if it has another format or version, or entries that are not in `known`.
    """
    if not isinstance(value, dict) or value.get('format') != format_name:
        raise InputError(f"not {kind}: 'format: {format_name}' is missing")
    if value.get('version') != version:
        raise InputError(f'{kind} of version {value.get("version")!r}, not {version}')
    return check_mapping(value, kind, known)


def number(**bounds: float) -> Reader:
    """Return a reader of a number within bounds, see `check_number`."""
    return lambda value, name: check_number(value, name, **bounds)


def listed(item: Reader) -> Reader:
    """Return a reader of a list, to a tuple; nothing is an empty one."""
    return lambda value, name: tuple(item(one, name) for one in check_list(value, name))


def mapping(items: Mapping[str, Reader] | Reader, known: Collection[str] | None = None) -> Reader:
    """Return a reader of a mapping: of known entries, or all alike; what is None stays so."""
    def read(value: Any, name: str) -> dict[str, Any]:
        entries = check_mapping(value or {}, name, items if isinstance(items, Mapping) else known)
        return {str(key): None if one is None else (
            items[key] if isinstance(items, Mapping) else items)(one, f'{name}.{key}')
            for key, one in entries.items()}
    return read


def section(kind: Callable[..., T]) -> Callable[[Any, str], T]:
    """Return a reader of a mapping with the fields of a dataclass, to one of these."""
    def read(value: Any, name: str) -> T:
        known = {one.name: one for one in fields(kind)}  # type: ignore[arg-type]
        check_mapping(value, name, known)
        missing = [name for name, one in known.items() if one.default is MISSING
                   and one.default_factory is MISSING and name not in value]
        if missing:
            raise InputError(f'{name}.{missing[0]} is missing')
        return kind(**{name: one for name, one in value.items() if one is not None})
    return read


def stated(read: Reader, default: Any = MISSING) -> Any:
    """Return the field of a `Checked` dataclass, which `read` checks; a default may be None."""
    return field(default=default, metadata={'read': read})


class Checked:
    """Dataclasses whose `stated` fields are checked, called by the class's name in errors."""

    def __post_init__(self) -> None:
        called = type(self).__name__.lower()
        for one in fields(self):  # type: ignore[arg-type]
            value = getattr(self, one.name)
            if 'read' in one.metadata and (value is not None or one.default is not None):
                object.__setattr__(self, one.name, one.metadata['read'](
                    value, f'{called}.{one.name}'))
