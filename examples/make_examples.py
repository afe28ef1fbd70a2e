# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Makes the small recordings in this folder, with which the tools can be tried.

    python3 examples/make_examples.py

It needs ROS 2 and Pinocchio. The recordings in `elbow/` are of running nodes: a simulated elbow
with undeclared friction ripple and gravity, a person who moves it, and the compensator with the
drive's model, once without and once with the direction announced. The recording in `arm/` is
computed: three joints whose links have other masses than in `arm.urdf`. `log.csv` is what most
people have: time, position and torque of a simulated joint that its controller moves. `plan.csv`
is a planned motion without torque.
"""

from __future__ import annotations

from argparse import Namespace
import os
from pathlib import Path
import sys
import tempfile

ROOT = Path(__file__).resolve().parent.parent
HERE = ROOT / 'examples'
DRIVE = Path('config', 'armin_configuration_2.yaml')
HIDDEN = ROOT / 'config' / 'undeclared_example.yaml'
# s; longer than that of a real driver, so that files are small.
SAMPLE_TIME = 5e-3
MOVEMENT = {'amplitude': 0.7, 'speed': 0.5, 'acceleration_time': 0.5, 'standstill': 1.5,
            'announcement': 1.0, 'repetitions': 2}
# Stamp of the plant's first state in simulated time, ns.
FIRST = 1_000_000_000
# Resolution of the arm's encoders, rad, and current sensors, A.
RESOLUTION = {'position': 1e-5, 'current': 5e-3}


def record_elbow(folder: Path) -> None:
    """Record the elbow without and with its direction announced."""
    from friction_comp.demo.processes import private_domain

    with private_domain():
        from friction_comp.demo.scenes import open_system

        with open_system(Namespace(output=folder, seed=1)) as stage:
            stage.start_plant(['elbow'], [DRIVE], HIDDEN, SAMPLE_TIME)
            stage.start('compensator', DRIVE)
            for name in ('without_direction', 'with_direction'):
                stage.start_recorder(name)
                stage.wait_for_recorder()
                stage.start_exercise(announce_direction=name == 'with_direction', **MOVEMENT)
                stage.follow(name)
                stage.nodes.stop('recorder')
    for name in ('without_direction', 'with_direction'):
        compress(folder / 'recordings' / name, HERE / 'elbow' / f'{name}.mcap.zstd')


def compress(source: Path, target: Path) -> None:
    """Compress a recording's only file, with receive times as of `ros2 bag record --use-sim-time`.

    Real receive times, which are irregular, would compress badly.
    """
    from rosbags.rosbag2 import Reader
    import zstandard

    from friction_comp.recordings.writer import RecordingWriter
    from friction_comp.ros.dated_topics import stamp_of

    now = 0
    simulated = source.with_name(f'{source.name}_simulated')
    with Reader(source) as reader, RecordingWriter(simulated) as writer:
        for connection, _, data in reader.messages():
            if connection.topic == '/joint_states':
                now = stamp_of(bytes(data))
            writer.write(connection.topic, connection.msgtype, now or FIRST, bytes(data))
    file, = simulated.glob('*.mcap')
    target.write_bytes(zstandard.ZstdCompressor(level=19).compress(file.read_bytes()))


def compute_arm(room: Path) -> None:
    """Compute the arm's recording."""
    import numpy as np

    from friction_comp.recordings.writer import write_samples

    sys.path.insert(0, str(ROOT / 'harness'))
    from simulated_arms import PLANE, recorded, small_arm, waves

    rng = np.random.default_rng(1)
    joints = recorded(small_arm((5.0, 2.2, 2.6)), PLANE, waves(rng, 2000, 3, 0.01),
                      (0.4, 0.25, 0.5), ((0.02, 0.3, 0.2, 0.05), (-0.03, 0.4, 0.3, 0.04),
                                         (0.0, 0.2, 0.1, 0.02)), rng)
    rounded = [one.with_(arm=None, velocity=None, **{
        name: step * np.round(getattr(one, name) / step) for name, step in RESOLUTION.items()})
        for one in joints]
    (HERE / 'arm' / 'arm.urdf').write_text(small_arm() + '\n', encoding='utf-8')
    write_samples(room / 'arm', rounded)
    compress(room / 'arm', HERE / 'arm' / 'arm.mcap.zstd')


def compute_log() -> None:
    """Compute the table of a joint whose position controller follows a sum of sines for 20 s."""
    import numpy as np

    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.simulation.joint import Plant
    from friction_comp.simulation.undeclared import Undeclared

    model = FrictionModel.load(ROOT / DRIVE)
    plant = Plant([model], 1, [Undeclared.from_file(HIDDEN)])
    rows = []
    for k in range(20_000):
        time, state = 1e-3 * k, plant.state
        target = 0.6 * np.sin(1.1 * time) + 0.25 * np.sin(3.7 * time)
        if k % 10 == 0:
            rows.append((time, state.position[0],
                         state.current[0] * model.drive.torque_per_current))
        plant.step(20.0 * (target - state.position[0]) - 0.5 * state.velocity[0])
    np.savetxt(HERE / 'log.csv', rows, fmt=('%.2f', '%.6f', '%.4f'), delimiter=',',
               header='time,position,torque', comments='')
    time = np.arange(0.0, 4.001, 0.02)
    np.savetxt(HERE / 'plan.csv', np.column_stack((time, 0.5 - 0.5 * np.cos(np.pi * time / 2.0))),
               fmt=('%.2f', '%.6f'), delimiter=',', header='time,position', comments='')


if __name__ == '__main__':
    # The model is named as the user names it, from here.
    os.chdir(ROOT)
    for name in ('elbow', 'arm'):
        (HERE / name).mkdir(exist_ok=True)
    compute_log()
    with tempfile.TemporaryDirectory() as folder:
        compute_arm(Path(folder))
        record_elbow(Path(folder))
