# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads YAML files with error messages that name them, and writes files atomically."""

from __future__ import annotations

from collections.abc import Iterable
import errno
import json
import math
import os
from pathlib import Path
import re
import stat
import tempfile
from typing import Any
import uuid

import yaml

from friction_comp.errors import InputError, one_line, os_errors_name


def library_for(path: Path, name: str, extra: str, files: str) -> Any:
    """Return the package of an optional module; raises InputError if it is not installed."""
    try:
        return __import__(name)
    except ModuleNotFoundError:
        package = name.partition('.')[0]
        raise InputError(f'{path}: {files} need {package}: pip install "friction_comp[{extra}]", '
                         f'or pip install {package}') from None


class _PlainLoader(yaml.SafeLoader):
    """Reads the plain values of YAML 1.2, and rejects duplicate keys and references.

    PyYAML's own loader (YAML 1.1) reads 3:00 as 180, 3_000 as 3000, 010 as 8 and 'no' as false. It
    silently keeps the last of two equal keys, and a few references can expand to fill the memory.
    """

    yaml_implicit_resolvers = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark
            raise yaml.YAMLError(f'line {mark.line + 1}: references (*) are not allowed')
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        seen = set()
        for key, _ in node.value:
            word = key.value if isinstance(key, yaml.ScalarNode) else None
            if word in seen:
                raise yaml.YAMLError(f'line {key.start_mark.line + 1}: {word!r} occurs twice')
            seen.add(word)
        return super().construct_mapping(node, deep)


class _QuotingDumper(yaml.SafeDumper):
    """Quotes strings that any version of YAML would read as a number, such as 3:00 and 0E0."""


def _whole_number(loader: Any, node: Any) -> int:
    return int(loader.construct_scalar(node))


def _number(loader: Any, node: Any) -> float:
    text = loader.construct_scalar(node).lower()
    return float(text.replace('.inf', 'inf').replace('.nan', 'nan'))


# The core schema of YAML 1.2.
for _tag, _pattern, _first in (
        ('bool', r'^(?:true|True|TRUE|false|False|FALSE)$', 'tTfF'),
        ('int', r'^[-+]?[0-9]+$', '-+0123456789'),
        ('float', r'^(?:[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?'
                  r'|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$', '-+0123456789.'),
        ('null', r'^(?:~|null|Null|NULL|)$', ['~', 'n', 'N', ''])):
    for _either in (_PlainLoader, _QuotingDumper):
        _either.add_implicit_resolver(
            f'tag:yaml.org,2002:{_tag}', re.compile(_pattern), list(_first))
_PlainLoader.add_constructor('tag:yaml.org,2002:int', _whole_number)
_PlainLoader.add_constructor('tag:yaml.org,2002:float', _number)

# Largest size of a YAML document, bytes; the largest model files have a tenth of it.
_LARGEST = 1_000_000


def read_yaml(path: str | Path) -> Any:
    """Return the content of a YAML file; see `_PlainLoader`.

    Raises InputError if it cannot be read, is not a regular file, is too large or not valid.
    """
    path = Path(path)
    with os_errors_name(path):
        # Do not wait for a writer if it is a pipe: there may never be one.
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, 'rb') as stream:
            kind = os.fstat(handle)
            if stat.S_ISDIR(kind.st_mode):
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            if not stat.S_ISREG(kind.st_mode):
                raise InputError(f'{path}: not a regular file')
            data = stream.read(_LARGEST + 1)
    if len(data) > _LARGEST:
        raise InputError(f'{path}: more than {_LARGEST // 1000} kB')
    try:
        return yaml.load(data.decode('utf-8'), Loader=_PlainLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InputError(f'{path}: not a YAML document: {one_line(error)}') from None


def load_yaml(text: str) -> Any:
    """Return the plain values of a long YAML document; raises yaml.YAMLError.

    libyaml, where PyYAML has it, takes a tenth of the time.
    """
    return yaml.load(text, Loader=getattr(yaml, 'CSafeLoader', yaml.SafeLoader))


def dump_yaml(document: Any) -> str:
    """Return plain values as a YAML document; libyaml refuses names that are not UTF-8."""
    return str(yaml.safe_dump(document, sort_keys=False, allow_unicode=True))


def read_json(path: str | Path) -> Any:
    """Return the content of a JSON file; raises InputError if it cannot be read or is not valid."""
    with os_errors_name(path, 'cannot be read: '):
        try:
            return json.loads(Path(path).read_text(encoding='utf-8'))
        except ValueError as error:
            raise InputError(f'{path}: not a JSON document: {error}') from None


def encodable(text: str) -> str:
    r"""Return text for UTF-8: other bytes, as of file names, become escapes such as ``\udcfc``."""
    return text.encode('utf-8', 'backslashreplace').decode('utf-8')


def file_names(names: Iterable[str]) -> list[str]:
    """Return a different name of a file for each name of a joint or recording.

    It is the name itself without slashes, which would name other folders.
    """
    files: list[str] = []
    for name in names:
        file = name.strip('/').replace('/', '_')
        while file in files:
            file += '_'
        files.append(file)
    return files


def write_atomically(path: str | Path, content: str | bytes, sync: bool = True) -> None:
    """Write text or bytes to a temporary file that then replaces the file.

    A device or pipe is written to directly. Without `sync` it does not wait for the disk. Raises
    InputError if the file cannot be written.
    """
    path = Path(path)
    data = encodable(content).encode('utf-8') if isinstance(content, str) else content
    with os_errors_name(path, 'cannot be written: '):
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists() and not path.is_file():
            # Do not wait until a pipe has a reader, but then wait for a slow one.
            handle = os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC)
            os.set_blocking(handle, True)
            with os.fdopen(handle, 'wb') as stream:
                stream.write(data)
            return
        draft = path.with_name(f'.{path.name}.{uuid.uuid4().hex}')
        try:
            with draft.open('xb') as stream:
                stream.write(data)
                stream.flush()
                if sync:
                    os.fsync(stream.fileno())
            draft.replace(path)
        finally:
            draft.unlink(missing_ok=True)


def to_yaml(document: Any) -> str:
    """Return plain values as a YAML document, with rows of numbers on one line."""
    return str(yaml.dump(document, Dumper=_QuotingDumper, sort_keys=False, allow_unicode=True,
                         width=96, default_flow_style=None))


def write_yaml(path: str | Path, document: Any) -> None:
    """Write plain values as a YAML document; raises InputError if the folder cannot be written."""
    write_atomically(path, to_yaml(document))


def plain(value: Any, not_finite: float | None = math.nan) -> Any:
    """Convert nested values with numpy types, tuples and paths to types of YAML and JSON.

    JSON has no NaN and no infinity: they become None if `not_finite` is None.
    """
    if isinstance(value, dict):
        return {str(key): plain(item, not_finite) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item, not_finite) for item in value]
    if hasattr(value, 'tolist'):
        # A numpy array or scalar, recognised without importing numpy.
        return plain(value.tolist(), not_finite)
    if isinstance(value, os.PathLike):
        return str(value)
    if isinstance(value, float) and not_finite is None and not math.isfinite(value):
        return None
    return value


def check_folder(path: str | Path) -> None:
    """Raise InputError if files cannot be written into a folder; it is not created."""
    folder = Path(path).absolute()
    with os_errors_name(path, 'cannot be written to: '):
        while not folder.exists() and folder != folder.parent:
            folder = folder.parent
        if not folder.is_dir():
            raise InputError(f'{path}: cannot be written to: {folder} is not a folder')
        # Permissions are not sufficient: a file system may be full or read-only.
        with tempfile.TemporaryFile(dir=folder):
            pass


def check_file(path: str | Path) -> None:
    """Raise InputError if a file cannot be written; existing devices are accepted."""
    path = Path(path)
    with os_errors_name(path, 'cannot be written to: '):
        if path.is_dir():
            raise InputError(f'{path}: is a folder, not a file')
        if path.exists() and not path.is_file():
            return
    check_folder(path.parent)
