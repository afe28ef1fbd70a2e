# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Files: read with errors that name them, written whole or not at all."""

from __future__ import annotations

import math
import os
from pathlib import Path
import tempfile
from typing import Any

import yaml

from friction_comp.errors import InputError


def read_yaml(path: str | Path) -> Any:
    """Return the plain values of a YAML document.

    Raises
    ------
    InputError
        If the file cannot be read or is not YAML.
    """
    path = Path(path)
    try:
        return yaml.safe_load(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise InputError(f'{path}: {error.strerror or error}') from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        reason = ' '.join(str(error).split())
        raise InputError(f'{path}: not a YAML document: {reason}') from None


def write_atomically(path: str | Path, content: str | bytes) -> None:
    """Write text or bytes to a file by way of a temporary file beside it.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    path = Path(path)
    data = content.encode('utf-8') if isinstance(content, str) else content
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=f'.{path.name}.', dir=path.parent)
        try:
            with os.fdopen(handle, 'wb') as stream:
                stream.write(data)
                stream.flush()
                os.fsync(stream.fileno())
            # mkstemp makes files private; a model or report is meant to be shared as usual.
            os.chmod(temporary, 0o666 & ~_umask())
            os.replace(temporary, path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise InputError(f'{path}: cannot be written: {error.strerror or error}') from None


def write_yaml(path: str | Path, document: Any) -> None:
    """Write plain values as a YAML document; rows of numbers stay on one line.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    write_atomically(path, yaml.safe_dump(
        document, sort_keys=False, allow_unicode=True, width=96, default_flow_style=None))


def plain(value: Any, not_finite: float | None = math.nan) -> Any:
    """Turn numpy values, tuples and paths into what YAML and JSON can write.

    Parameters
    ----------
    value : object
        Mappings, sequences, arrays and scalars, nested as they may be.
    not_finite : float or None
        What NaN and infinity become. NaN leaves them as they are; JSON has no word for them and
        takes None.
    """
    if isinstance(value, dict):
        return {str(key): plain(item, not_finite) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item, not_finite) for item in value]
    if hasattr(value, 'tolist'):
        # An array or scalar of numpy, which need not be imported for that.
        return plain(value.tolist(), not_finite)
    if isinstance(value, os.PathLike):
        return str(value)
    if isinstance(value, float) and not_finite is None and not math.isfinite(value):
        return None
    return value


def check_folder(path: str | Path) -> None:
    """Make sure that files can be written into a folder, which is not made yet if it is missing.

    Raises
    ------
    InputError
        If they cannot.
    """
    folder = Path(path).absolute()
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f'{path}: cannot be written to')


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
