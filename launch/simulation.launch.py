# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Starts simulated joints in real time, and the node that commands them.

By default that is the compensator, with an exercise that the simulated person follows; with
``identify:=true`` it is the identification, which waits for goals. Only one of the two may command
a motor.
"""

from typing import List

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode, Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    configuration = PathJoinSubstitution([FindPackageShare('friction_comp'), 'config'])
    identify = LaunchConfiguration('identify')
    types = {'joints': List[str], 'model_files': List[str], 'law': str, 'use_sim_time': bool}

    def settings(name, *parameters):
        return {
            'package': 'friction_comp',
            'name': name,
            'namespace': LaunchConfiguration('namespace'),
            'parameters': [LaunchConfiguration('parameters'), {
                parameter: ParameterValue(
                    LaunchConfiguration(parameter), value_type=types[parameter])
                for parameter in ('joints', *parameters)}],
            'arguments': ['--ros-args', '--log-level', LaunchConfiguration('log_level')],
            'output': 'screen',
        }

    return LaunchDescription([
        DeclareLaunchArgument('namespace', default_value='', description='of all nodes'),
        DeclareLaunchArgument(
            'parameters', default_value=[configuration, '/parameters.yaml'],
            description='parameter file of all nodes; the arguments below override it'),
        DeclareLaunchArgument(
            'joints', default_value="['joint']",
            description='names of the joints, as a YAML list'),
        DeclareLaunchArgument(
            'model_files',
            default_value=["['", configuration, "/armin_configuration_1.yaml']"],
            description='one model file per joint, for plant and compensator, as a YAML list'),
        DeclareLaunchArgument(
            'law', default_value='continuous', choices=['continuous', 'paper', 'kinetic', 'none'],
            description='compensation law'),
        DeclareLaunchArgument(
            'use_sim_time', default_value='false', choices=['true', 'false'],
            description='time from /clock, of all nodes but the plant'),
        DeclareLaunchArgument(
            'log_level', default_value='info',
            choices=['debug', 'info', 'warn', 'error', 'fatal'], description='what is logged'),
        DeclareLaunchArgument(
            'identify', default_value='false', choices=['true', 'false'],
            description='start the identification instead of compensator and exercise'),
        Node(executable='plant', **settings('plant', 'model_files')),
        Node(executable='identification', condition=IfCondition(identify),
             **settings('identification', 'model_files', 'use_sim_time')),
        LifecycleNode(executable='compensator', condition=UnlessCondition(identify),
                      **settings('compensator', 'model_files', 'law', 'use_sim_time')),
        Node(executable='exercise', condition=UnlessCondition(identify),
             **settings('exercise', 'use_sim_time')),
    ])
