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
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    configuration = PathJoinSubstitution([FindPackageShare('friction_comp'), 'config'])
    topics = ('joint_states', 'current_command', 'direction', 'direction_stamped',
              'motor_temperature')
    types = {'joints': List[str], 'model_files': List[str], 'law': str,
             'breakaway_gain': float, 'current_limit': float, 'autostart': bool,
             'use_sim_time': bool}
    laws, switch = ['', 'continuous', 'desired', 'paper', 'kinetic', 'none'], ['true', 'false']
    levels = ['debug', 'info', 'warn', 'error', 'fatal']
    arguments = (
        ('namespace', '', 'of the node'),
        ('parameters', [configuration, '/parameters.yaml'],
         'parameter file; arguments below that are given override it'),
        ('joints', '', "names of the joints as a YAML list, such as ['elbow']"),
        ('model_files', '', 'one model file per joint, as a YAML list'),
        ('law', '', 'compensation law', laws),
        ('breakaway_gain', '', 'share of breakaway that is fed forward'),
        ('current_limit', '', 'A; the limit of the model file applies if it is smaller'),
        ('autostart', '', 'whether the node configures and activates itself', ['', *switch]),
        ('use_sim_time', '', 'time from /clock', ['', *switch]),
        ('log_level', 'info', 'what is logged', levels),
        ('respawn', 'false', 'whether to start the node again when it ends', switch),
        *((topic, topic, f'topic to use as {topic}') for topic in topics))

    def node(context):
        return [LifecycleNode(
            package='friction_comp',
            executable='compensator',
            name='compensator',
            namespace=LaunchConfiguration('namespace'),
            parameters=[
                LaunchConfiguration('parameters'),
                {name: ParameterValue(LaunchConfiguration(name), value_type=kind)
                 for name, kind in types.items() if LaunchConfiguration(name).perform(context)},
            ],
            remappings=[(topic, LaunchConfiguration(topic)) for topic in topics],
            arguments=['--ros-args', '--log-level', LaunchConfiguration('log_level')],
            respawn=LaunchConfiguration('respawn'),
            respawn_delay=2.0,
            output='screen',
        )]
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=text,
                                choices=choices[0] if choices else None)
          for name, default, text, *choices in arguments),
        OpaqueFunction(function=node)])
