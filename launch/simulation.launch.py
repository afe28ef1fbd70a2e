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

    laws, switch = ['continuous', 'desired', 'paper', 'kinetic', 'none'], ['true', 'false']
    levels = ['debug', 'info', 'warn', 'error', 'fatal']
    arguments = (
        ('namespace', '', 'of all nodes'),
        ('parameters', [configuration, '/parameters.yaml'],
         'parameter file of all nodes; the arguments below override it'),
        ('joints', "['joint']", 'names of the joints, as a YAML list'),
        ('model_files', ["['", configuration, "/armin_configuration_1.yaml']"],
         'one model file per joint, for plant and compensator, as a YAML list'),
        ('law', 'continuous', 'compensation law', laws),
        ('use_sim_time', 'false', 'time from /clock, of all nodes but the plant', switch),
        ('log_level', 'info', 'what is logged', levels),
        ('identify', 'false', 'start the identification instead of compensator and exercise',
         switch))
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=text,
                                choices=choices[0] if choices else None)
          for name, default, text, *choices in arguments),
        Node(executable='plant', **settings('plant', 'model_files')),
        Node(executable='identification', condition=IfCondition(identify),
             **settings('identification', 'model_files', 'use_sim_time')),
        LifecycleNode(executable='compensator', condition=UnlessCondition(identify),
                      **settings('compensator', 'model_files', 'law', 'use_sim_time')),
        Node(executable='exercise', condition=UnlessCondition(identify),
             **settings('exercise', 'use_sim_time')),
    ])
