# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Starts the identification on a real robot whose driver publishes joint states.

For example, followed by the goal that makes the joint move::

    ros2 launch friction_comp identification.launch.py joints:="['elbow']" \
        model_files:="['elbow_drive.yaml']" output_folder:=models \
        current_command:=effort_controller/commands
    ros2 action send_goal --feedback /identify_friction \
        friction_comp_interfaces/action/IdentifyFriction "{joint: elbow}"

While a compensator is active, goals are refused.
"""

from typing import List

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    configuration = PathJoinSubstitution([FindPackageShare('friction_comp'), 'config'])
    topics = ('joint_states', 'current_command')
    types = {'joints': List[str], 'model_files': List[str], 'output_folder': str,
             'use_sim_time': bool}
    levels = ['debug', 'info', 'warn', 'error', 'fatal']
    arguments = (
        ('namespace', '', 'of the node'),
        ('parameters', [configuration, '/parameters.yaml'],
         'parameter file; arguments below that are given override it'),
        ('joints', '', "names of the joints as a YAML list, such as ['elbow']"),
        ('model_files', '', 'one model file per joint, as a YAML list: their drives, and what '
         'carries the joints'),
        ('output_folder', '', 'folder for the model files'),
        ('use_sim_time', '', 'time from /clock', ['', 'true', 'false']),
        ('log_level', 'info', 'what is logged', levels),
        *((topic, topic, f'topic to use as {topic}') for topic in topics))

    def node(context):
        return [Node(
            package='friction_comp',
            executable='identification',
            name='identification',
            namespace=LaunchConfiguration('namespace'),
            parameters=[
                LaunchConfiguration('parameters'),
                {name: ParameterValue(LaunchConfiguration(name), value_type=kind)
                 for name, kind in types.items() if LaunchConfiguration(name).perform(context)},
            ],
            remappings=[(topic, LaunchConfiguration(topic)) for topic in topics],
            arguments=['--ros-args', '--log-level', LaunchConfiguration('log_level')],
            output='screen',
        )]
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=text,
                                choices=choices[0] if choices else None)
          for name, default, text, *choices in arguments),
        OpaqueFunction(function=node)])
