# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What could stand between a fault and zero current, or between an end and its word."""

import os
import signal
import time

from friction_comp_interfaces.action import PlayTrajectory
from node_process import Process
import numpy as np
import pytest
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from ros_system import (
    compensator,
    FakeDriver,
    joint_state,
    JOINTS,
    MODELS,
    own_domain,
    probe_node,
    START,
    value_of,
    ZERO,
)

from friction_comp.ros.executor import yield_to_executor
from friction_comp.trajectory import Trajectory


def full_pipe(path):
    """Make a pipe that nobody reads and that takes nothing more; return its end."""
    os.mkfifo(path)
    end = os.open(path, os.O_RDWR | os.O_NONBLOCK)
    for size in (4096, 1):
        try:
            while True:
                os.write(end, size * b'.')
        except BlockingIOError:
            pass
    return end


def test_a_log_that_nobody_reads_delays_nothing(tmp_path):
    """With standard error a full pipe, each fault logs a line; silence still gives zero in time."""
    pipe = tmp_path / 'pipe'
    end = full_pipe(pipe)
    with own_domain(), probe_node() as probe, Process(tmp_path / 'run', 'compensator', {
            **START, 'joint_state_timeout': 0.3}, error=pipe) as process:
        driver = FakeDriver(probe, JOINTS)
        driver.find(direction=[1, 1])
        longest = heard = 0.0
        for wrong in (float('nan'), float('inf'), 1e300) * 40:
            driver.states.publish(joint_state(time.time_ns(), JOINTS, [0.0, wrong]))
            before, heard = heard or time.monotonic(), time.monotonic()
            longest = max(longest, heard - before)
            driver.ask(ZERO, ZERO)
        driver.find(direction=[1, 1])
        begin = time.monotonic()
        probe.until(lambda: list(driver.commands[-1].data) == ZERO, 'zero current')
        assert longest < 0.5
        assert time.monotonic() - begin < 0.5
        process.send(signal.SIGTERM)
        assert process.wait() == 0
    os.close(end)


@pytest.mark.parametrize('ended', [
    lambda driver: driver.probe.begin_transition('compensator', 'deactivate'),
    lambda driver: driver.process.send(signal.SIGTERM)], ids=['deactivated', 'ended'])
def test_a_listener_that_pauses_hears_the_last_zero(tmp_path, ended):
    with compensator(tmp_path / 'one', [1, 1]) as driver, Process(tmp_path / 'two', 'plant', {
            'joints': JOINTS, 'model_files': MODELS[:2], 'command_timeout': 10.0,
            'sample_time': 0.01}, {'joint_states': 'states_of_plant'}) as plant:
        probe = driver.probe

        def commanded():
            driver.announce([1, 1])
            driver.ask(ZERO, ZERO)
            return float(value_of(probe.status_of('plant'), 'elbow: command [A]')) > 0.05
        probe.until(commanded, 'a current in the plant')
        plant.send(signal.SIGSTOP)
        driver.announce([1, 1])
        assert driver.ask(ZERO, ZERO)[0] > 0.05
        ended(driver)
        probe.spin_for(1.6)
        plant.send(signal.SIGCONT)
        status = probe.status_of('plant')
        assert float(value_of(probe.status_of('plant'), 'elbow: command [A]')) == 0.0, status
        assert 'not acknowledged' not in driver.process.text


def test_a_zero_that_nobody_acknowledges_is_told(tmp_path):
    with compensator(tmp_path / 'one', [1, 1]) as driver, Process(tmp_path / 'two', 'recorder', {
            'output': str(tmp_path / 'recording')}) as stopped:
        probe = driver.probe
        probe.until(lambda: (driver.ask(ZERO, ZERO), int(value_of(probe.status_of(
            'compensator'), 'listeners to the command')))[1] > 1, 'a second listener')
        stopped.send(signal.SIGSTOP)
        driver.ask(ZERO, ZERO)
        driver.process.send()
        assert driver.process.wait() == 0
        assert 'zero, was not acknowledged within 2 s' in driver.process.text
        stopped.send(signal.SIGCONT)


def test_what_drives_a_motor_has_no_memory_in_common_with_those_who_listen(driver):
    """A listener that is stopped with the lock of such memory would stop its publishers, too."""
    folder = f'/proc/{driver.process._process.pid}/fd'
    files = []
    for end in os.listdir(folder):
        try:
            files.append(os.readlink(f'{folder}/{end}'))
        except OSError:
            continue
    assert files
    assert not [file for file in files if file.startswith('/dev/shm/fastrtps')]


@pytest.fixture(scope='module')
def moving(tmp_path_factory):
    """A server of `play_trajectory` whose motion ends when it is cancelled, in another process."""
    events = []

    async def execute(goal):
        events.append('moves')
        while not goal.is_cancel_requested:
            await yield_to_executor()
        events.append('cancelled')
        goal.canceled()
        return PlayTrajectory.Result()
    with own_domain(), probe_node() as robot:
        server = ActionServer(
            robot, PlayTrajectory, 'play_trajectory', execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup())
        folder = tmp_path_factory.mktemp('play')
        plan = folder / 'plan.yaml'
        plan.write_text(Trajectory(
            ('elbow',), np.array([0.0, 1.0]), *np.zeros((3, 2, 1))).to_yaml(''), encoding='utf-8')
        yield robot, events, folder, plan
        server.destroy()


@pytest.mark.parametrize('number', [
    signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1, signal.SIGTSTP])
def test_a_motion_ends_with_its_player_whatever_signal_ends_it(moving, number):
    robot, events, folder, plan = moving
    events.clear()
    with Process(folder, 'play', arguments=[str(plan)]) as player:
        robot.until(lambda: 'moves' in events, 'a motion')
        player.send(number)
        robot.until(lambda: not player.running, 'the end of the player')
        assert player.wait() == 128 + number
        robot.until(lambda: events == ['moves', 'cancelled'], 'the end of the motion')
