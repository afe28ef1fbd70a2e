# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Starts the compensator alone, for a real robot whose driver publishes joint states.

For example::

    ros2 launch friction_comp compensation.launch.py joints:="['elbow']" \
        model_files:="['elbow.yaml']" current_command:=effort_controller/commands

With ``respawn:=true`` a compensator that ends is started again; it waits until the publisher of its
predecessor has vanished, about 20 s if that was killed. With ``autostart:=false`` it waits for
lifecycle transitions: ``ros2 lifecycle set /compensator configure``, then ``activate``.
"""

from typing import List

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    configuration = PathJoinSubstitution([FindPackageShare('friction_comp'), 'config'])
    topics = ('joint_states', 'current_command', 'direction', 'direction_stamped',
              'motor_temperature')
    types = {'joints': List[str], 'model_files': List[str], 'law': str, 'autostart': bool,
             'use_sim_time': bool}
    return LaunchDescription([
        DeclareLaunchArgument('namespace', default_value='', description='of the node'),
        DeclareLaunchArgument(
            'parameters', default_value=[configuration, '/parameters.yaml'],
            description='parameter file; the arguments below override it'),
        DeclareLaunchArgument(
            'joints', description="names of the joints as a YAML list, such as ['elbow']"),
        DeclareLaunchArgument(
            'model_files', description='one model file per joint, as a YAML list'),
        DeclareLaunchArgument(
            'law', default_value='continuous', choices=['continuous', 'paper', 'kinetic', 'none'],
            description='compensation law'),
        DeclareLaunchArgument(
            'autostart', default_value='true', choices=['true', 'false'],
            description='whether the node configures and activates itself'),
        DeclareLaunchArgument(
            'use_sim_time', default_value='false', choices=['true', 'false'],
            description='time from /clock'),
        DeclareLaunchArgument(
            'log_level', default_value='info',
            choices=['debug', 'info', 'warn', 'error', 'fatal'], description='what is logged'),
        DeclareLaunchArgument(
            'respawn', default_value='false', choices=['true', 'false'],
            description='whether to start the node again when it ends'),
        *(DeclareLaunchArgument(
            topic, default_value=topic, description=f'topic to use as {topic}')
          for topic in topics),
        LifecycleNode(
            package='friction_comp',
            executable='compensator',
            name='compensator',
            namespace=LaunchConfiguration('namespace'),
            parameters=[
                LaunchConfiguration('parameters'),
                {name: ParameterValue(LaunchConfiguration(name), value_type=kind)
                 for name, kind in types.items()},
            ],
            remappings=[(topic, LaunchConfiguration(topic)) for topic in topics],
            arguments=['--ros-args', '--log-level', LaunchConfiguration('log_level')],
            respawn=LaunchConfiguration('respawn'),
            respawn_delay=2.0,
            output='screen',
        ),
    ])
