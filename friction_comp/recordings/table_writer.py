# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Writes samples as a table that `friction_comp.recordings.tables` can read, in SI units."""

from __future__ import annotations

from collections.abc import Sequence
import io
from pathlib import Path

import numpy as np

from friction_comp.errors import InputError
from friction_comp.files import write_atomically
from friction_comp.samples import Samples

# Column to attribute of `Samples`; effort equals `current` with k_t = n = 1.
_SIGNALS = {
    'position': 'position', 'velocity': 'velocity', 'effort': 'current', 'command': 'command',
    'direction': 'direction', 'load': 'load', 'temperature': 'temperature',
    'reference_position': 'reference_position', 'reference_velocity': 'reference_velocity',
}


def table_of(joints: Sequence[Samples]) -> dict[str, np.ndarray]:
    """Return samples of joints with a common time base as columns: ``time``, ``elbow.position``, ….

    Their current must be the effort, as read with k_t = n = 1.
    """
    columns = {'time': joints[0].time}
    for samples in joints:
        prefix = f'{samples.joint}.' if samples.joint else ''
        for name, signal in _SIGNALS.items():
            values = getattr(samples, signal)
            if values is not None:
                columns[prefix + name] = values
    return columns


def write_table(path: Path, joints: Sequence[Samples]) -> None:
    """Write samples as CSV, Parquet or npz, depending on the file name, with columns of `table_of`.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    columns = table_of(joints)
    name = path.name.lower()
    stream = io.BytesIO()
    if name.endswith('.npz'):
        np.savez_compressed(stream, **columns)  # type: ignore[arg-type] # its allow_pickle
    elif name.endswith('.parquet'):
        try:
            from pyarrow import table
            from pyarrow.parquet import write_table as write
        except ModuleNotFoundError:
            raise InputError(f'{path}: Parquet files need pyarrow: pip install '
                             '"friction_comp[parquet]", or pip install pyarrow') from None
        write(table(columns), stream)
    elif name.endswith('.csv'):
        stream.write((','.join(columns) + '\n').encode())
        np.savetxt(stream, np.column_stack(list(columns.values())), delimiter=',',
                   fmt=['%.9f', *['%.12g'] * (len(columns) - 1)])
    else:
        raise InputError(f'{path}: a table is .csv, .parquet or .npz')
    write_atomically(path, stream.getvalue())
