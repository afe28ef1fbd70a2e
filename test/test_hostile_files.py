# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Files that are meant to fill the memory, to hang or to mislead: each is refused in one line."""

import gzip
import os
import shutil
import signal
import sqlite3
import struct

import pytest
from recording_maker import record, states
from rosbags.rosbag2 import CompressionMode
from test_damaged_files import answer, COLUMNS, MODEL, of_file, URDF
import zstandard

from friction_comp.__main__ import run
from friction_comp.arm.urdf import Chain
from friction_comp.recordings import read_recording

POINT = '{{positions: [{}], velocities: [0.0], accelerations: [0.0], ' \
        'time_from_start: {{sec: {}, nanosec: 0}}}}'


def plan(*points):
    return 'joint_names: [elbow]\npoints:\n' + ''.join(
        f'- {POINT.format(position, second)}\n' for position, second in points)


def sheet(change=lambda text: text, mark=','):
    rows = '\n'.join(mark.join(f'{value:.4f}' for value in row)
                     for row in zip(*COLUMNS.values()))
    return change(mark.join(COLUMNS) + '\n' + rows + '\n')


def bomb():
    """References of ten levels: 10^10 values."""
    levels = ['a0: &a0 [x, x, x, x, x, x, x, x, x, x]']
    levels += [f'a{k}: &a{k} [{", ".join([f"*a{k - 1}"] * 10)}]' for k in range(1, 10)]
    return '\n'.join(levels) + '\n'


def mcap_of(*records):
    """Return an mcap file with records of an opcode and its content each."""
    header = struct.pack('<I4sI', 4, b'ros2', 0)
    return b'\x89MCAP0\r\n' + b''.join(
        struct.pack('<BQ', code, len(content)) + content
        for code, content in ((1, header), *records))


def chunk(size, compression, packed):
    name = compression.encode()
    return 6, struct.pack('<QQQI', 0, 0, size, 0) + struct.pack('<I', len(name)) + name + (
        struct.pack('<Q', len(packed)) + packed)


def zeros(size):
    """Return that many zeros, packed with zstd block by block."""
    packer = zstandard.ZstdCompressor().compressobj()
    return b''.join([*(packer.compress(bytes(1 << 20)) for _ in range(size >> 20)),
                     packer.flush()])


def endless_view(path):
    database = sqlite3.connect(path)
    database.executescript(
        'CREATE TABLE topics(id, name, type, serialization_format); '
        "INSERT INTO topics VALUES(1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr'); "
        'CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n) '
        "SELECT id, 1 topic_id, id timestamp, x'00' data FROM n")
    database.close()


def sparse_hdf5(path):
    h5py = pytest.importorskip('h5py')
    with h5py.File(path, 'w') as file:
        for name in COLUMNS:
            file.create_dataset(name, (180_000_000,), chunks=(1 << 20,))


def hdf5_elsewhere(path):
    h5py = pytest.importorskip('h5py')
    (path.parent / 'secret').write_bytes(b'root:x:0:0:root:/root:/bin/bash\n' * 200)
    with h5py.File(path, 'w') as file:
        for name, values in list(COLUMNS.items())[:3]:
            file[name] = values
        file.create_dataset('effort', (600,), dtype='f8', external=[('secret', 0, 4800)])


def gzip_line(path):
    with gzip.open(path, 'wb', 1) as file:
        for _ in range(50):
            file.write(b' ' * 1_000_000)


def urdf(old, new):
    text = URDF.read_text()
    assert old in text
    return text.replace(old, new, 1)


PREDICT = ['predict', '{}', '--model', str(MODEL), '--output', 'out.csv']
CONVERT = ['convert', '{}', '--output', 'out.csv']
URDF_OF = of_file(lambda path: Chain(path, ['turn', 'lift', 'bend']))
EXPORT = ['export', '{}', '--to', 'csv', '--output', 'out.csv']

# Name of the file, its content or how it is made, the tool, and words of its answer.
HOSTILE = {
    'a plan with no number': ('x.yaml', plan((0.0, 0), ('.nan', 1)), PREDICT, 'position of nan'),
    'a plan that runs back': ('x.yaml', plan((0.0, 2), (0.1, 1)), PREDICT, 'do not rise'),
    'a mass of nan': ('x.urdf', urdf('mass value="', 'mass value="nan" x="'), URDF_OF, 'mass'),
    'a mass of 1e300': ('x.urdf', urdf('mass value="', 'mass value="1e300" x="'), URDF_OF, 'mass'),
    'a negative inertia': ('x.urdf', urdf('ixx="', 'ixx="-5" x="'), URDF_OF, 'inertia'),
    'a drive without bounds': ('x.yaml', MODEL.read_text().replace(
        'torque_constant: ', 'torque_constant: 1e300  #'), EXPORT, 'torque_constant'),
    'a plan of nan in a table': ('x.csv', 'time,position\n0,0\n1,nan\n2,nan\n3,1\n', PREDICT,
                                'in every row'),
    'a table of a plan that runs back': (
        'x.csv', 'time,position\n0,0\n1,0.1\n0.5,0.2\n3,1\n', PREDICT, 'do not rise'),
    'commas beside points': ('x.csv', sheet(lambda text: text.replace('0.9', '0,9'), ';'),
                             PREDICT, ''),
    'a sparse file of 5.8 GB': ('x.h5', sparse_hdf5, PREDICT, 'would unpack'),
    'a time that no stamp holds': ('x.csv', sheet() + '99999999999,0,0,0\n', [
        'convert', '{}', '--output', 'out'], 'beyond the stamps of ROS'),
    'references in a plan': ('x.yaml', bomb() + plan((0.0, 0), (0.1, 1)), PREDICT, 'references'),
    'references in a model': ('x.yaml', bomb(), EXPORT, 'references'),
    'deep YAML': ('x.yaml', '[' * 100_000, EXPORT, 'nesting'),
    'deep JSON': ('x.json', '[' * 100_000 + ']' * 100_000, PREDICT, 'JSON'),
    'a chunk of 3.9 GB': ('x.mcap', lambda: mcap_of(
        chunk(3_900_000_000, 'zstd', zeros(1 << 26))), CONVERT, 'would unpack'),
    'a chunk that is larger than it says': ('x.mcap', lambda: mcap_of(
        chunk(1000, 'zstd', zeros(1 << 26))), CONVERT, 'did not decompress'),
    'a file of 2 GB in 70 kB': (
        'x.mcap.zstd', lambda: zeros(1 << 26) * 32, CONVERT, 'would unpack'),
    'rows without end': ('x.db3', endless_view, CONVERT, 'not a database of rosbag2'),
    'a line of 2.9 GB': ('x.csv.gz', gzip_line, PREDICT, ''),
    'a pipe as a model': ('x.yaml', os.mkfifo, EXPORT, 'not a regular file'),
    'a pipe as a table': ('x.csv', os.mkfifo, PREDICT, 'not a regular file'),
    'a pipe as a bag': ('x.mcap', os.mkfifo, CONVERT, 'not a regular file'),
    'a pipe as a URDF': ('x.urdf', os.mkfifo, URDF_OF, 'not a regular file'),
    'a device as a URDF': ('x.urdf', lambda path: path.symlink_to('/dev/zero'), URDF_OF,
                           'not a regular file'),
    'a device as a table': ('x.csv', lambda path: path.symlink_to('/dev/zero'), PREDICT,
                            'not a regular file'),
    'a chunk that is damaged': ('x.mcap', lambda: mcap_of(
        (6, struct.pack('<QQQIIQ', 0, 0, 40, 7, 0, 40) + bytes(40))), CONVERT,
        'crc validation failed'),
}


@pytest.mark.parametrize('name', HOSTILE)
def test_a_hostile_file_is_refused_in_one_line(tmp_path, name):
    file, content, what, words = HOSTILE[name]
    for part in ('work', 'said', 'temporary'):
        (tmp_path / part).mkdir()
    work = tmp_path / 'work'
    (work / 'good.csv').write_text(sheet())
    if isinstance(content, str):
        (work / file).write_text(content)
    else:
        try:
            made = content(work / file)
        except TypeError:
            made = content()
        if isinstance(made, bytes):
            (work / file).write_bytes(made)
    before = sorted(work.iterdir())
    code, _, error = answer(tmp_path, what if callable(what) else [
        word.format(file) for word in what], file)
    print(error)
    assert code == 2, error
    named = file in error or 'out: ' in error
    assert (error.count('\n'), words in error, named) == (1, True, True), error
    assert sorted(work.iterdir()) == before
    assert not list((tmp_path / 'temporary').iterdir())


def test_values_that_an_hdf5_file_keeps_in_another_are_left_out(tmp_path, capsys):
    hdf5_elsewhere(tmp_path / 'x.h5')
    assert run('predict', [str(tmp_path / 'x.h5'), '--model', str(MODEL), '--output',
                           str(tmp_path / 'out.csv')]) == 0
    assert 'has no effort' in ''.join(capsys.readouterr())


def test_references_in_metadata_fill_no_memory(tmp_path):
    """ROS writes references into the metadata of a bag; what else they hold is not looked at."""
    folder = record(tmp_path / 'r', states())
    about = (folder / 'metadata.yaml').read_text()
    (folder / 'metadata.yaml').write_text(
        bomb() + about.replace('custom_data: null', 'custom_data: {x: *a9}'))
    assert len(read_recording(folder)[0]) == 50


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_recording_that_is_converted_is_whole_or_absent_whatever_ends_it(tmp_path, number):
    """Ended at any time, nothing is left of it, neither beside it nor in the temporary folder."""
    for part in ('work', 'said', 'temporary'):
        (tmp_path / part).mkdir()
    record(tmp_path / 'r', states(2000), compression=CompressionMode.FILE)
    shutil.move(tmp_path / 'r' / 'r.mcap.zstd', tmp_path / 'work' / 'good.mcap.zstd')
    codes = []
    for delay in (0.02, 0.1, 0.2, 0.3, 0.4, 0.6):
        code, _, _ = answer(tmp_path, ['convert', 'good.mcap.zstd', '--output', 'out'],
                            end=(number, delay))
        codes.append(code)
        left = {path.name for path in (tmp_path / 'work').iterdir()} - {'good.mcap.zstd'}
        assert left <= {'out'}
        assert not list((tmp_path / 'temporary').iterdir())
        assert left or code
        if left:
            assert len(read_recording(tmp_path / 'work' / 'out')[0]) == 2000
            shutil.rmtree(tmp_path / 'work' / 'out')
    assert set(codes) <= {0, 128 + number}
    assert 128 + number in codes


@pytest.mark.parametrize('output', ['out', 'out.csv'])
def test_on_a_full_disk_nothing_is_left(tmp_path, output):
    for part in ('work', 'said', 'temporary'):
        (tmp_path / part).mkdir()
    (tmp_path / 'work' / 'good.csv').write_text(sheet())
    code, _, error = answer(tmp_path, ['convert', 'good.csv', '--output', output], most=20_000)
    assert (code, error.count('\n')) == (2, 1), error
    assert f'{output}: cannot be written: File too large' in error
    assert [path.name for path in (tmp_path / 'work').iterdir()] == ['good.csv']


@pytest.mark.parametrize('output', ['good.csv/below', 'x' * 300, 'x' * 300 + '.csv', '/proc/x.csv'])
def test_where_nothing_can_be_written_a_line_says_so(tmp_path, monkeypatch, capsys, output):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'good.csv').write_text(sheet())
    assert run('convert', ['good.csv', '--output', output]) == 2
    assert capsys.readouterr().err.count('\n') == 1
    assert [path.name for path in tmp_path.iterdir()] == ['good.csv']


def test_a_name_with_a_line_break_adds_nothing_to_an_exported_file(tmp_path):
    model = tmp_path / 'a\ninjected: 1.yaml'
    model.write_bytes(MODEL.read_bytes())
    for form in ('mujoco', 'urdf', 'sdf', 'csv', 'tanh', 'isaac', 'json'):
        assert run('export', [str(model), '--to', form, '--output', str(tmp_path / 'out')]) == 0
        lines = (tmp_path / 'out').read_text().splitlines()
        assert not any(line.startswith('injected') for line in lines)
