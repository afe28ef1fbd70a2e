# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Memory and time that it takes to stream a CSV of ten million rows.

    python3 bench/table_memory.py --rows 10000000
"""

from pathlib import Path
import resource
import tempfile
import time

from bench_tools import table_parser
import numpy as np

from friction_comp.recordings import stream_recording_with_info


def write(path, rows, block=100_000):
    with path.open('w', encoding='utf-8') as stream:
        stream.write('t,q,dq,tau\n')
        for first in range(0, rows, block):
            moment = 1e-3 * np.arange(first, min(first + block, rows))
            np.savetxt(stream, np.column_stack((
                moment, 0.4 * np.sin(moment), 0.4 * np.cos(moment),
                np.tanh(20.0 * np.cos(moment)))), delimiter=',', fmt='%.6f')


def main():
    parser = table_parser(__doc__, rows=10_000_000)
    rows = parser.parse_args().rows
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'log.csv'
        write(path, rows)
        begin = time.monotonic()
        read = sum(len(part) for part, _ in stream_recording_with_info(path))
        seconds = time.monotonic() - begin
        assert read == rows, read
        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f'{rows} rows, {path.stat().st_size / 1e6:.0f} MB of CSV: '
              f'{seconds:.1f} s, {most:.0f} MB of memory at most')


if __name__ == '__main__':
    main()
