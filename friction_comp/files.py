# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The one door for files: through it every byte comes in and goes out; and where the package is.

In: a regular file that may be read, unpacked to no more than a recording could hold. Out: whole or
absent, whatever ends the program (see `friction_comp.interrupts`), and never in the place of a file
that was read as an input.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
import json
import math
import os
from pathlib import Path
import re
import sys
from typing import Any, BinaryIO, TYPE_CHECKING
import zlib

import yaml

from friction_comp.errors import InputError, one_line, os_errors_name
from friction_comp.interrupts import interrupts_deferred

if TYPE_CHECKING:
    import xml.etree.ElementTree as ElementTree

AnyPath = str | os.PathLike[str]
PACKED = 1000
"""What is packed, as in a .gz, .zstd, .npz or .h5 file, unpacks to at most so many times its size:
times and noise of a recording do not pack better."""
# What may always be unpacked, and the largest documents, both in bytes.
_SMALL, _LARGEST = 16_000_000, 20_000_000
# Files that were read, by device and inode.
_inputs: dict[tuple[int, int], Path] = {}


# In.

def open_input(path: AnyPath) -> BinaryIO:
    """Open a file for reading; raises InputError if it is not a regular file, or cannot be read.

    Nothing is written in its place later, but a new model.
    """
    path = Path(path)
    with os_errors_name(path, 'cannot be read: '):
        if path.is_fifo() or path.is_char_device():
            raise InputError(f'{path}: not a regular file')
        stream = path.open('rb')
        kind = os.fstat(stream.fileno())
    _inputs[kind.st_dev, kind.st_ino] = path.absolute()
    return stream


def check_input(path: AnyPath) -> Path:
    """Return the path of a file that a library opens itself; raises InputError as `open_input`."""
    open_input(path).close()
    return Path(path)


def read_text(path: AnyPath) -> str:
    """Return a text file in UTF-8; raises InputError if it is none, or too large."""
    with open_input(path) as stream:
        data = stream.read(_LARGEST + 1)
    if len(data) > _LARGEST:
        raise InputError(f'{path}: more than {_LARGEST // 1_000_000} MB')
    try:
        return data.decode('utf-8-sig')
    except UnicodeDecodeError:
        raise InputError(f'{path}: not a text file in UTF-8') from None


def check_unpacked(where: object, size: float, packed: int) -> None:
    """Raise InputError if `packed` bytes say that they unpack to a `size` that is absurd."""
    if size > _SMALL + PACKED * packed:
        raise InputError(f'{where}: {packed} bytes would unpack to {size:.3g}, more than '
                         f'{PACKED} times as many, which no recording does')


def unpacked(where: object, packed: BinaryIO, salvage: bool = False) -> Iterator[bytes]:
    """Yield the plain bytes of a file that is packed with gzip or zstd.

    Raises InputError if they are absurd, or damaged; `salvage` ends at a damage behind others.
    """
    import gzip

    import zstandard

    is_zstd, given = packed.read(4) == b'\x28\xb5\x2f\xfd', 0
    packed.seek(0)
    plain: Any = zstandard.ZstdDecompressor(max_window_size=1 << 27).stream_reader(
        packed, read_across_frames=True) if is_zstd else gzip.GzipFile(fileobj=packed)
    try:
        while data := plain.read(1 << 20):
            given += len(data)
            check_unpacked(where, given, os.fstat(packed.fileno()).st_size)
            yield data
    except (EOFError, OSError, zlib.error, zstandard.ZstdError) as error:
        if not (given and salvage):
            raise InputError(f'{where}: is damaged: {one_line(error)}') from None


@contextmanager
def unpacked_file(path: Path) -> Iterator[Path]:
    """Yield a file, or what a .zstd file holds as a temporary one; errors as of `open_input`."""
    with open_input(path) as packed:
        if path.suffix != '.zstd':
            yield path
            return
        import shutil
        from tempfile import gettempdir

        # A `TemporaryDirectory` stays behind where a signal comes while it is made or removed.
        folder = Path(gettempdir(), f'friction_comp_{os.urandom(12).hex()}')
        plain = folder / path.stem
        try:
            folder.mkdir(mode=0o700)
            with plain.open('wb') as stream:
                stream.writelines(unpacked(path, packed, salvage=True))
            yield plain
        finally:
            with interrupts_deferred():
                shutil.rmtree(folder, ignore_errors=True)


def library_for(path: Path, name: str, extra: str, files: str) -> Any:
    """Return the package of an optional module; raises InputError if it is not installed."""
    try:
        return __import__(name)
    except ModuleNotFoundError:
        package = name.partition('.')[0]
        raise InputError(f'{path}: {files} need {package}: pip install "friction_comp[{extra}]", '
                         f'or pip install {package}') from None


def read_yaml(path: AnyPath) -> Any:
    """Return the content of a YAML file, see `parse_yaml`; raises InputError if it is none."""
    return parse_yaml(read_text(path), path)


def parse_json(text: str, where: object) -> Any:
    """Return the content of a JSON document; raises InputError if it is not valid."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f'{where}: not a JSON document: {one_line(error)}') from None


def read_json(path: AnyPath) -> Any:
    """Return the content of a JSON file; raises InputError if it cannot be read or is not valid."""
    return parse_json(read_text(path), path)


def read_xml(path: AnyPath) -> tuple[str, ElementTree.Element]:
    """Return text and root of an XML file without entities; raises InputError if it is none."""
    import xml.etree.ElementTree as ElementTree

    text = read_text(path)
    try:
        if '<!ENTITY' in text:
            raise ValueError('entities are not allowed')
        return text, ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f'{path}: not a usable XML file: {one_line(error)}') from None


def to_yaml(document: Any) -> str:
    """Return plain values as a YAML document, with rows of numbers on one line."""
    return str(yaml.dump(document, Dumper=QuotingDumper, sort_keys=False, allow_unicode=True,
                         width=96, default_flow_style=None))


# Out.

def write_atomically(path: AnyPath, content: str | bytes, sync: bool = True,
                     is_model: bool = False) -> None:
    """Write text or bytes to a temporary file that then replaces the file.

    Without `sync` it does not wait for the disk. Raises InputError if the file cannot be written,
    or is one that was read: only a model may replace one.
    """
    path = Path(path)
    # Other bytes, as of file names, become escapes.
    data = content.encode('utf-8', 'backslashreplace') if isinstance(content, str) else content
    with os_errors_name(path, 'cannot be written: '):
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists() and not path.is_file():
            raise InputError(f'{path}: exists and is no ordinary file')
        if not is_model:
            _keep_input(path)
        draft = path.with_name(f'.{os.urandom(12).hex()}')
        try:
            with draft.open('xb') as stream:
                stream.write(data)
                stream.flush()
                if sync:
                    os.fsync(stream.fileno())
            draft.replace(path)
        finally:
            draft.unlink(missing_ok=True)


def write_yaml(path: AnyPath, document: Any) -> None:
    """Write a model as YAML; raises InputError if it cannot be written."""
    write_atomically(path, to_yaml(document), is_model=True)


def _keep_input(path: Path) -> None:
    """Raise InputError if a file is one that was read, and is still in its place."""
    with suppress(OSError):
        kind = path.stat()
        read = _inputs.get((kind.st_dev, kind.st_ino))
        if read is not None and read.samefile(path):
            raise InputError(f'{path}: is the input itself')


@contextmanager
def output_folder(path: Path) -> Iterator[Path]:
    """Yield a hidden folder for results, which are moved to `path` when the block succeeds.

    Files with the same names in `path` are replaced, others are kept. Otherwise nothing is left.
    """
    import shutil  # imported late: it takes long, and a single file needs none of it

    if path.exists() and not path.is_dir():
        raise InputError(f'{path}: exists and is not a folder')
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    unfinished = path / f'.unfinished.{os.urandom(12).hex()}'
    try:
        unfinished.mkdir(parents=True)
        yield unfinished
        moves = {source: path / source.relative_to(unfinished)
                 for source in sorted(unfinished.rglob('*'))}
        for source, target in moves.items():
            if target.exists() and not (target.is_dir() if source.is_dir() else target.is_file()):
                raise InputError(f'{target}: exists and is of another kind')
            if target.suffix != '.yaml':
                _keep_input(target)
        with interrupts_deferred():
            for source, target in moves.items():
                if source.is_dir():
                    target.mkdir(exist_ok=True)
                else:
                    source.replace(target)
        made.clear()
    except OSError as error:
        raise InputError(f'{path}: cannot be written: {error.strerror or error}') from None
    finally:
        # A second signal must not end what the first one began.
        with interrupts_deferred():
            shutil.rmtree(unfinished, ignore_errors=True)
            # Without success, folders that were made are removed as well, the innermost first.
            for folder in made:
                with suppress(OSError):
                    folder.rmdir()


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Yield where to make a folder that becomes `path`, which must not exist, if all succeeds.

    It bears the same name. Nothing is left otherwise.
    """
    if os.path.lexists(path):
        raise InputError(f'{path}: already exists, a recording needs a new folder')
    with output_folder(path.absolute().parent) as unfinished, os_errors_name(
            path, 'cannot be written: '):
        try:
            yield unfinished / path.name
        except InputError as error:
            raise InputError(str(error).replace(str(unfinished / path.name), str(path))) from None


def check_folder(path: AnyPath) -> None:
    """Raise InputError if files cannot be written into a folder; it is not created."""
    folder = Path(path).absolute()
    with os_errors_name(path, 'cannot be written to: '):
        while not folder.exists() and folder != folder.parent:
            folder = folder.parent
        # Permissions are not sufficient: a file system may be full or read-only.
        probe = folder / f'.{os.urandom(12).hex()}'
        with interrupts_deferred():
            probe.open('xb').close()
            probe.unlink()


def check_file(path: AnyPath) -> None:
    """Raise InputError if a file cannot be written."""
    path = Path(path)
    with os_errors_name(path, 'cannot be written to: '):
        if path.exists() and not path.is_file():
            raise InputError(f'{path}: exists and is no ordinary file')
    check_folder(path.parent)


def file_names(names: Iterable[str]) -> list[str]:
    """Return a different name of a file or folder for each name of a joint or recording."""
    files: list[str] = []
    for name in names:
        file = re.sub(r'[^\w.-]', '_', name.strip('/')).lstrip('.') or '_'
        while file in files:
            file += '_'
        files.append(file)
    return files


# By libyaml, where PyYAML has it, in a tenth of the time.
_Loader: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


class _PlainLoader(_Loader):  # type: ignore[misc] # one of two classes
    """Reads the plain values of YAML 1.2, and rejects duplicate keys.

    PyYAML's own loader (YAML 1.1) reads 3:00 as 180, 3_000 as 3000, 010 as 8 and 'no' as false, and
    silently keeps the last of two equal keys.
    """

    yaml_implicit_resolvers: dict[Any, Any] = {}

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """Return a mapping; raises YAMLError if a key occurs twice."""
        seen = set()
        for key, _ in node.value:
            word = key.value if isinstance(key, yaml.ScalarNode) else None
            if word in seen:
                raise yaml.YAMLError(f'line {key.start_mark.line + 1}: {word!r} occurs twice')
            seen.add(word)
        return super().construct_mapping(node, deep)


class QuotingDumper(yaml.SafeDumper):
    """Writes no references, and quotes what any version of YAML reads as a number, such as 3:00."""

    def ignore_aliases(self, data: Any) -> bool:
        """Return True."""
        return True


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
    for _either in (_PlainLoader, QuotingDumper):
        _either.add_implicit_resolver(
            f'tag:yaml.org,2002:{_tag}', re.compile(_pattern), list(_first))
_PlainLoader.add_constructor('tag:yaml.org,2002:int', _whole_number)
_PlainLoader.add_constructor('tag:yaml.org,2002:float', _number)


def parse_yaml(text: str, where: object) -> Any:
    """Return the plain values of a YAML document; raises InputError if it is not valid."""
    try:
        return yaml.load(text, Loader=_PlainLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InputError(f'{where}: not a YAML document: {one_line(error)}') from None


# Results.

def write_report(folder: Path, content: dict[str, Any], page: Any, command: str) -> None:
    """Write report.json and report.html, a `reports.html.Report` whose footer names the command."""
    write_atomically(folder / 'report.json', to_json(content), sync=False)
    page.made_by(command)
    page.save(folder / 'report.html')


def to_json(content: dict[str, Any]) -> str:
    """Return a report as JSON text, its schema version first: see docs/reports.md.

    Numpy values become plain ones, NaN and infinity null.
    """
    # The version increases when an entry is removed or changes its meaning.
    values = {'version': 1, **plain(content, not_finite=None)}
    return json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False) + '\n'


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


# Files of the package.

def package_file(*parts: str) -> Path:
    """Return the path of a file or folder of the package; raises InputError if it is missing.

    `parts` is its path below ``share/friction_comp``. It is searched in the source tree, if the
    package runs from one, in all sourced workspaces and in the Python environment.
    """
    root = Path(__file__).resolve().parent.parent
    folders = [root] if (root / 'package.xml').is_file() else []
    folders += [Path(p, 'share', 'friction_comp') for p in (*_ament_prefixes(), sys.prefix)]
    for folder in folders:
        path = folder.joinpath(*parts)
        if path.exists():
            return path
    raise InputError(f'friction_comp has no file {"/".join(parts)}')


def add_environment_to_ament_path() -> None:
    """Add this Python environment to AMENT_PREFIX_PATH, before ROS 2 is imported.

    Activating a virtual environment with ROS 2 wheels does not. Sourced workspaces take precedence.
    """
    if not Path(sys.prefix, 'share', 'ament_index').is_dir():
        return
    if sys.prefix not in _ament_prefixes():
        os.environ['AMENT_PREFIX_PATH'] = os.pathsep.join([*_ament_prefixes(), sys.prefix])


def _ament_prefixes() -> list[str]:
    return [p for p in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if p]
