# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Starts simulated joints in real time, and the node that commands them.

By default that is the compensator, with an exercise that the simulated person follows; with
``identify:=true`` it is the identification, which waits for goals. Only one of the two may command
a motor.
"""

from typing import List

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode, Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    configuration = PathJoinSubstitution([FindPackageShare('friction_comp'), 'config'])
    types = {'joints': List[str], 'model_files': List[str], 'law': str, 'use_sim_time': bool}

    def settings(context, name, *parameters):
        return {
            'package': 'friction_comp',
            'executable': name,
            'name': name,
            'namespace': LaunchConfiguration('namespace'),
            'parameters': [LaunchConfiguration('parameters'), {
                parameter: ParameterValue(
                    LaunchConfiguration(parameter), value_type=types[parameter])
                for parameter in ('joints', *parameters)
                if LaunchConfiguration(parameter).perform(context)}],
            'arguments': ['--ros-args', '--log-level', LaunchConfiguration('log_level')],
            'output': 'screen',
        }

    laws, switch = ['', 'continuous', 'desired', 'paper', 'kinetic', 'none'], ['true', 'false']
    levels = ['debug', 'info', 'warn', 'error', 'fatal']
    arguments = (
        ('namespace', '', 'of all nodes'),
        ('parameters', [configuration, '/parameters.yaml'],
         'parameter file of all nodes; arguments below that are given override it'),
        ('joints', "['joint']", 'names of the joints, as a YAML list'),
        ('model_files', ["['", configuration, "/armin_configuration_1.yaml']"],
         'one model file per joint, for plant and compensator, as a YAML list'),
        ('law', '', 'compensation law', laws),
        ('use_sim_time', '', 'time from /clock, of all nodes but the plant', ['', *switch]),
        ('log_level', 'info', 'what is logged', levels),
        ('identify', 'false', 'start the identification instead of compensator and exercise',
         switch))

    def nodes(context):
        plant = Node(**settings(context, 'plant', 'model_files'))
        if LaunchConfiguration('identify').perform(context) == 'true':
            return [plant, Node(**settings(
                context, 'identification', 'model_files', 'use_sim_time'))]
        return [plant,
                LifecycleNode(**settings(
                    context, 'compensator', 'model_files', 'law', 'use_sim_time')),
                Node(**settings(context, 'exercise', 'use_sim_time'))]
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=text,
                                choices=choices[0] if choices else None)
          for name, default, text, *choices in arguments),
        OpaqueFunction(function=nodes)])
