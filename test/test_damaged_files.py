# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Damaged and hostile files: each is read as far as it is whole, or refused in one line."""

from contextlib import suppress
import gc
import gzip
import os
import random
import re
import resource
import shutil
import signal
import sqlite3
import struct
import sys
import tempfile
import time
import traceback

from helpers import ROOT, write
import numpy as np
import pytest
from recording_maker import record, states
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from scipy.io import savemat
import zstandard

from friction_comp.__main__ import run
from friction_comp.arm.urdf import Chain
from friction_comp.direction.exercise import load_exercise
from friction_comp.errors import InputError
from friction_comp.excitation.plan import from_urdf, pairs_in
from friction_comp.files import read_json, to_json
from friction_comp.interrupts import end_by_exception, Ended
from friction_comp.recordings.reader import read_recording
from friction_comp.trajectory import Trajectory

# A good file of each format, cut, with one bit or one length changed: an answer, or one line.

COUNT = int(os.environ.get('FRICTION_COMP_MUTATIONS', '3'))
MEMORY, SECONDS = 3_000_000_000, 20
MODEL = ROOT / 'config' / 'armin_configuration_1.yaml'
URDF = ROOT / 'examples' / 'arm' / 'arm.urdf'
TIME = 0.01 * np.arange(1, 601)
COLUMNS = {'time': TIME, 'position': np.sin(TIME), 'velocity': np.cos(TIME),
           'effort': np.tanh(9.0 * np.cos(TIME)) + 0.1 * np.cos(TIME)}


def bag(folder, plugin):
    suffix = 'mcap' if plugin == StoragePlugin.MCAP else 'db3'
    path = record(folder / 'r', states(300), plugin) / f'r.{suffix}'
    shutil.move(path, folder / f'good.{suffix}')
    shutil.rmtree(folder / 'r')


def hdf5(folder):
    h5py = pytest.importorskip('h5py')
    with h5py.File(folder / 'good.h5', 'w') as file:
        file.update(COLUMNS)


def trajectory(folder):
    state = np.sin(TIME)[:, None]
    (folder / 'good.yaml').write_text(
        Trajectory(('elbow',), TIME, state, state, state).to_yaml('a plan'))


def table(suffix, write):
    return suffix, lambda folder: write(folder / f'good{suffix}'), [
        'predict', 'good' + suffix, '--model', 'model.yaml', '--output', 'out.csv']


def of_file(load):
    """Return what stands for a tool that loads a file at its beginning, and works for long."""
    def tool(path):
        try:
            load(path)
        except InputError as error:
            print(f'tool: {error}', file=sys.stderr)
            return 2
        return 0
    return tool


def convert_to(suffix, make):
    return suffix, make, ['convert', 'good' + suffix, '--output', 'out.csv']


# Suffix, how the good file is made, and the arguments of what reads it.
FORMATS = {
    'mcap': convert_to('.mcap', lambda folder: bag(folder, StoragePlugin.MCAP)),
    'sqlite3': convert_to('.db3', lambda folder: bag(folder, StoragePlugin.SQLITE3)),
    'CSV': table('.csv', lambda path: write(path, **COLUMNS)),
    'CSV to a bag': ('.csv', lambda folder: write(folder / 'good.csv', **COLUMNS), [
        'convert', 'good.csv', '--output', 'out']),
    'npy': table('.npy', lambda path: np.save(path, np.rec.fromarrays(
        [*COLUMNS.values()], names=[*COLUMNS]).view(np.ndarray))),
    'npz': table('.npz', lambda path: np.savez_compressed(path, **COLUMNS)),
    'mat': table('.mat', lambda path: savemat(path, COLUMNS, do_compression=True)),
    'JSON': table('.json', lambda path: path.write_text(to_json(COLUMNS))),
    'HDF5': ('.h5', hdf5, table('.h5', None)[2]),
    'model': ('.yaml', lambda folder: shutil.copy(MODEL, folder / 'good.yaml'), [
        'export', 'good.yaml', '--to', 'csv', '--output', 'out.csv']),
    'URDF': ('.urdf', lambda folder: shutil.copy(URDF, folder / 'good.urdf'), of_file(
        lambda path: (from_urdf(path, 1.0), Chain(path, ['turn', 'lift', 'bend'])))),
    'trajectory': ('.yaml', trajectory, [
        'predict', 'good.yaml', '--model', 'model.yaml', '--output', 'out.csv']),
    'exercise': ('.yaml', lambda folder: shutil.copy(
        ROOT / 'config' / 'exercises' / 'to_and_fro.yaml', folder / 'good.yaml'),
        of_file(load_exercise)),
    'report': ('.json', lambda folder: (folder / 'good.json').write_text(to_json({
        'ambiguous': [{'between': ['gravity', 'spring']}], 'effects': [
            {'name': 'stribeck', 'chosen': 0.4}], 'unexplained': [{'variable': 'position'}]})),
        of_file(lambda path: pairs_in(read_json(path), str(path)))),
}


def mutated(content, number):
    """Return a file's content cut, with one bit, or with one length or digit changed."""
    draw = random.Random(number)
    at = draw.randrange(len(content))
    kind = ('cut', 'bit', 'length')[number % 3]
    if kind == 'cut':
        return content[:at]
    if kind == 'bit':
        return content[:at] + bytes([content[at] ^ 1 << draw.randrange(8)]) + content[at + 1:]
    if content.isascii():
        return content[:at] + b'9' * draw.choice([1, 20]) + content[at:]
    size = draw.choice([b'\xff\xff\xff\x7f', b'\0\0\0\0', b'\xff\xff\xff\xff', b'\0\0\0\x10'])
    return content[:at] + size + content[at + 4:]


def answer(folder, what, file='', most=resource.RLIM_INFINITY, end=None):
    """Run a tool, or function of a file, alone; return its exit status and what it printed.

    No file may become larger than `most` bytes; `end` is a signal, and the s after which it comes.
    """
    for part in ('work', 'said', 'temporary'):
        (folder / part).mkdir(parents=True, exist_ok=True)
    begun, begin = os.pipe()
    child = os.fork()
    if not child:
        code = 99
        gc.freeze()     # what other tests have left belongs to the parent
        try:
            for number, name in ((1, 'stdout'), (2, 'stderr')):
                said = os.open(folder / 'said' / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
                os.dup2(said, number)
            sys.stdout, sys.stderr = (os.fdopen(number, 'w', 1) for number in (1, 2))
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
            for number in (signal.SIGALRM, signal.SIGXCPU):
                signal.signal(number, signal.SIG_DFL)
            signal.signal(signal.SIGINT, signal.default_int_handler)
            end_by_exception()
            os.write(begin, b'.')
            resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
            signal.alarm(6 * SECONDS)   # it may also wait
            os.chdir(folder / 'work')
            tempfile.tempdir = str(folder / 'temporary')
            code = run(what[0], what[1:]) if isinstance(what, list) else what(file)
        except SystemExit as error:
            code = error.code
        except Ended as ended:
            code = 128 + ended.number
        except BaseException:
            traceback.print_exc()
        finally:
            while True:
                with suppress(BaseException):   # the signal may come as late as here
                    os._exit(code)
    if end:
        os.read(begun, 1)
        time.sleep(end[1])
        os.kill(child, end[0])
    os.close(begun)
    os.close(begin)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status), *(
        (folder / 'said' / name).read_text(errors='replace') for name in ('stdout', 'stderr'))


@pytest.mark.parametrize('name', FORMATS)
def test_a_damaged_file_is_read_or_refused_in_one_line(tmp_path, name):
    suffix, make, what = FORMATS[name]
    make(tmp_path)
    good = (tmp_path / f'good{suffix}').read_bytes()
    faults = []
    for number in range(-1, COUNT):
        folder = tmp_path / 'one'
        path = folder / 'work' / f'good{suffix}'
        path.parent.mkdir(parents=True)
        path.write_bytes(good if number < 0 else mutated(good, number))
        shutil.copy(MODEL, folder / 'work' / 'model.yaml')
        code, out, error = answer(folder, what, path.name)
        left = sorted(one.name for one in (folder / 'work').iterdir()
                      if one.name not in (path.name, 'model.yaml', 'out', 'out.csv'))
        left += [one.name for one in (folder / 'temporary').iterdir()]
        written = [*(folder / 'work').glob('out*')]
        text = out + ''.join(one.read_text() for one in written if one.is_file())
        if not (code == 0 or (code == 2 and number >= 0)):
            faults.append((number, f'exit {code}', error[-600:]))
        elif code == 2 and (error.count('\n') != 1 or written):
            faults.append((number, 'refused badly', error[-600:], written))
        elif code == 0 and re.search(r'\bnan\b', text):
            faults.append((number, 'nan', text[:300]))
        elif left:
            faults.append((number, 'left', left))
        if not faults or faults[-1][0] != number:
            shutil.rmtree(folder)
        else:
            folder.rename(tmp_path / f'{number}')
    assert faults == []


# Files that are meant to fill the memory, to hang or to mislead: each is refused in one line.

def sheet():
    rows = [','.join(f'{value:.4f}' for value in row) for row in zip(*COLUMNS.values())]
    return '\n'.join([','.join(COLUMNS), *rows, ''])


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
    'a mass of nan': ('x.urdf', urdf('mass value="', 'mass value="nan" x="'), URDF_OF, 'mass'),
    'a negative inertia': ('x.urdf', urdf('ixx="', 'ixx="-5" x="'), URDF_OF, 'inertia'),
    'a drive without bounds': ('x.yaml', MODEL.read_text().replace(
        'torque_constant: ', 'torque_constant: 1e300  #'), EXPORT, 'torque_constant'),
    'a plan of nan in a table': ('x.csv', 'time,position\n0,0\n1,nan\n2,nan\n3,1\n', PREDICT,
                                'in every row'),
    'a table of a plan that runs back': (
        'x.csv', 'time,position\n0,0\n1,0.1\n0.5,0.2\n3,1\n', PREDICT, 'do not rise'),
    'a sparse file of 5.8 GB': ('x.h5', sparse_hdf5, PREDICT, 'would unpack'),
    'a time that no stamp holds': ('x.csv', sheet() + '99999999999,0,0,0\n', [
        'convert', '{}', '--output', 'out'], 'beyond the stamps of ROS'),
    'references in a model': ('x.yaml', bomb(), EXPORT, 'not a model file'),
    'deep YAML': ('x.yaml', '[' * 100_000, EXPORT, 'nesting'),
    'deep JSON': ('x.json', '[' * 100_000 + ']' * 100_000, PREDICT, 'JSON'),
    'a chunk of 3.9 GB': ('x.mcap', lambda: mcap_of(
        chunk(3_900_000_000, 'zstd', zeros(1 << 26))), CONVERT, 'would unpack'),
    'a chunk that is larger than it says': ('x.mcap', lambda: mcap_of(
        chunk(1000, 'zstd', zeros(1 << 26))), CONVERT, 'did not decompress'),
    'a file of 2 GB in 70 kB': (
        'x.mcap.zstd', lambda: zeros(1 << 26) * 32, CONVERT, 'would unpack'),
    'rows without end': ('x.db3', endless_view, CONVERT, 'not a database of rosbag2'),
    'a line of 50 MB': ('x.csv.gz', lambda: gzip.compress(b' ' * 50_000_000, 1), PREDICT, ''),
    'a pipe as a table': ('x.csv', os.mkfifo, PREDICT, 'not a regular file'),
    'a pipe as a bag': ('x.mcap', os.mkfifo, CONVERT, 'not a regular file'),
    'a device as a URDF': ('x.urdf', lambda path: path.symlink_to('/dev/zero'), URDF_OF,
                           'not a regular file'),
    'a chunk that is damaged': ('x.mcap', lambda: mcap_of(
        (6, struct.pack('<QQQIIQ', 0, 0, 40, 7, 0, 40) + bytes(40))), CONVERT,
        'crc validation failed'),
}


@pytest.mark.parametrize('name', HOSTILE)
def test_a_hostile_file_is_refused_in_one_line(tmp_path, name):
    file, content, what, words = HOSTILE[name]
    work = tmp_path / 'work'
    work.mkdir()
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
    (tmp_path / 'work').mkdir()
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
    (tmp_path / 'work').mkdir()
    (tmp_path / 'work' / 'good.csv').write_text(sheet())
    code, _, error = answer(tmp_path, ['convert', 'good.csv', '--output', output], most=20_000)
    assert (code, error.count('\n')) == (2, 1), error
    assert f'{output}: cannot be written: File too large' in error
    assert [path.name for path in (tmp_path / 'work').iterdir()] == ['good.csv']


def test_a_name_with_a_line_break_adds_nothing_to_an_exported_file(tmp_path):
    model = tmp_path / 'a\ninjected: 1.yaml'
    model.write_bytes(MODEL.read_bytes())
    for form in ('mujoco', 'urdf', 'sdf', 'csv', 'tanh', 'isaac', 'json'):
        assert run('export', [str(model), '--to', form, '--output', str(tmp_path / 'out')]) == 0
        lines = (tmp_path / 'out').read_text().splitlines()
        assert not any(line.startswith('injected') for line in lines)
