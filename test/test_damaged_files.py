# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A good file of each format, cut, with one bit or one length changed: an answer, or one line.

FRICTION_COMP_MUTATIONS is how many of each format are tried, each in a process with 3 GB and 20 s
of processor time.
"""

from contextlib import suppress
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback

from helpers import ROOT
import numpy as np
import pytest
from recording_maker import record, states
from rosbags.rosbag2 import StoragePlugin
from scipy.io import savemat

from friction_comp.__main__ import run
from friction_comp.arm.urdf import Chain
from friction_comp.errors import InputError
from friction_comp.excitation.joint_limits import from_urdf
from friction_comp.excitation.plan import pairs_in
from friction_comp.exercise.exercise_script import load_exercise
from friction_comp.files import read_json
from friction_comp.interrupts import end_by_exception, Ended
from friction_comp.recordings import write_samples
from friction_comp.results import to_json
from friction_comp.samples import Samples
from friction_comp.trajectory import Trajectory

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


def evaluation(folder):
    """Two movements behind a person's torque, as `evaluate` reads them."""
    phase = np.clip(TIME % 3.0 - 0.5, 0.0, 2.0)
    speed = np.sin(0.5 * np.pi * phase) * np.where(TIME < 3.0, 1.0, -1.0)
    write_samples(folder / 'r', Samples(
        time=TIME, position=0.01 * np.cumsum(speed), current=np.zeros(600), velocity=speed,
        load=0.3 * np.sign(speed), direction=np.sign(speed).astype(int), joint='elbow'))
    shutil.move(folder / 'r' / 'r_0.mcap', folder / 'good.mcap')
    shutil.rmtree(folder / 'r')


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
    'CSV': table('.csv', lambda path: np.savetxt(
        path, np.column_stack([*COLUMNS.values()]), delimiter=',', header=','.join(COLUMNS),
        comments='')),
    'CSV to a bag': ('.csv', lambda folder: np.savetxt(
        folder / 'good.csv', np.column_stack([*COLUMNS.values()]), delimiter=',',
        header=','.join(COLUMNS), comments=''), ['convert', 'good.csv', '--output', 'out']),
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
    'evaluation': ('.mcap', evaluation, ['evaluate', 'good.mcap', '--output', 'out']),
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
    begun, begin = os.pipe()
    child = os.fork()
    if not child:
        code = 99
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
        for part in ('work', 'said', 'temporary'):
            (folder / part).mkdir(parents=True)
        path = folder / 'work' / f'good{suffix}'
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
