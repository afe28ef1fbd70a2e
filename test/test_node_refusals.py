# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of nodes on unusable input, their defaults, and the end of an exercise."""

from contextlib import contextmanager, ExitStack, suppress
import signal
import time

from node_process import Process, ROOT, ros_arguments
import pytest
import rclpy
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from ros_system import joint_state, MODELS, own_domain, probe_node
from sensor_msgs.msg import JointState
from std_msgs.msg import Int8MultiArray
import yaml

from friction_comp.errors import InputError
from friction_comp.nodes.compensator import CompensatorNode
from friction_comp.nodes.direction import DirectionNode
from friction_comp.nodes.exercise import ExerciseNode
from friction_comp.nodes.identification import IdentificationNode
from friction_comp.nodes.plant import PlantNode
from friction_comp.nodes.recorder import RecorderNode
from friction_comp.nodes.refinement import RefinementNode
from friction_comp.ros.parameters import described

ONE = {'joints': ['elbow'], 'model_files': MODELS[:1]}
BROKEN_MODEL = 'format: friction_comp_model\nversion: 1\njoint: [\n'
ODD_EFFECT = 'format: friction_comp_undeclared\nversion: 1\neffects: [{name: ghost}]\n'


@pytest.mark.parametrize(('node', 'parameters', 'arguments', 'words'), [
    ('plant', {**ONE, 'model_files': ['broken.yaml']}, (), 'broken.yaml'),
    ('plant', {**ONE, 'undeclared_effect_files': ['odd.yaml']}, (), 'ghost'),
    ('plant', ONE, ('surplus',), 'surplus'),
    ('plant', {**ONE, 'clock': 'sundial'}, (), 'clock'),
    ('plant', {'joints': ['elbow']}, (), 'model_files'),
    ('compensator', {'joints': ['a', 'a'], 'model_files': MODELS[:2]}, (), 'joints'),
    ('compensator', {**ONE, 'model_files': MODELS[:2]}, (), 'model_files'),
    ('compensator', ONE, ('--ros-args', '--params-file', 'none.yaml', '--'), 'none.yaml'),
    ('compensator', {**ONE, 'joints': []}, (), 'joints: has no value'),
    ('compensator', {**ONE, 'joints': ['']}, (), 'joints: names must be given'),
    ('compensator', {**ONE, 'law': 'magic'}, (), 'law'),
    ('compensator', {**ONE, 'breakaway_gain': 1}, (), 'expecting type'),
    ('compensator', {**ONE, 'autostart': 'yes'}, (), 'expecting type'),
    ('compensator', {**ONE, 'joints': 'elbow'}, (), 'expecting type'),
    ('compensator', {}, (), 'must have the name of this node'),
    ('compensator', {**ONE, 'command_interface': 'voltage'}, (),
     'command_interface: must be one of current, effort'),
    ('identification', {**ONE, 'default_speeds': [1]}, (), 'default_speeds'),
    ('identification', {**ONE, 'default_speeds': []}, (), 'default_speeds: has no value'),
    ('exercise', {'announcement': 3.0, 'standstill': 1.0}, (), 'announcement'),
    ('exercise', {'when_done': 'dance'}, (), 'when_done'),
    ('direction', {'source': 'stars'}, (), 'source'),
    ('direction', {'source': 'sensor'}, (), 'sensor_range must be'),
    ('recorder', {'output': 'taken'}, (), 'taken'),
    ('recorder', {'compression': 'squeeze'}, (), 'squeeze'),
    ('recorder', {'max_file_duration': 0.001}, (), 'max_file_duration: 0.001 s is too short')])
def test_says_in_one_line_what_it_cannot_use(tmp_path, node, parameters, arguments, words):
    (tmp_path / 'broken.yaml').write_text(BROKEN_MODEL)
    (tmp_path / 'odd.yaml').write_text(ODD_EFFECT)
    (tmp_path / 'taken').mkdir()
    (tmp_path / 'taken' / 'kept').write_text('')
    with own_domain(), Process(tmp_path, node, parameters, arguments=arguments) as process:
        assert process.wait() == 2
        lines = [line for line in process.text.splitlines() if line.startswith(f'{node}: ')]
        assert len(lines) == 1
        assert words in lines[0]
        assert 'Traceback' not in process.text
    assert [path.name for path in (tmp_path / 'taken').iterdir()] == ['kept']
    assert not (tmp_path / 'recording').exists()


@pytest.mark.parametrize(('node', 'given', 'told'), [
    ('compensator', {**ONE, 'breakaway_gian': 0.1, 'pace_of_all': 3},
     ['parameter breakaway_gian does not exist, and has no effect',
      'parameter pace_of_all does not exist, and has no effect']),
    # The file names those of all its sources.
    ('direction', {}, [])])
def test_a_misspelt_parameter_is_told(tmp_path, node, given, told):
    config = ROOT / 'config' / 'parameters.yaml'
    with own_domain(), probe_node() as probe, Process(tmp_path, node, given, arguments=(
            '--ros-args', '--params-file', str(config), '--')) as process:
        probe.until(lambda: node in probe.get_node_names(), 'the node')
        probe.until(lambda: process.text.count('does not exist') >= len(told), 'what is told')
        process.send(signal.SIGINT)
        assert process.wait() == 0
        assert process.text.count('does not exist') == len(told)
        assert all(text in process.text for text in told)


def test_an_exercise_takes_its_announcement_back_when_it_is_stopped(tmp_path):
    with own_domain(), probe_node() as probe, Process(tmp_path, 'exercise', {
            'joints': ['elbow', 'wrist'], 'amplitude': -0.5, 'standstill': 0.1,
            'announcement': 0.1, 'speed': 0.1}) as process:
        states = probe.talk(JointState, 'joint_states')
        directions = probe.listen(Int8MultiArray, 'direction')

        def announced():
            states.publish(joint_state(time.time_ns(), ['elbow', 'wrist'], [0.0, 0.0]))
            probe.spin_for(0.02)
            return directions and list(directions[-1].data) == [-1, -1]
        probe.until(announced, 'the announcement')
        process.send(signal.SIGINT)
        assert process.wait() == 0
        probe.until(lambda: list(directions[-1].data) == [0, 0], 'its end')
        assert 'Traceback' not in process.text


def test_nodes_that_end_leave_the_middleware(tmp_path):
    """Also those with an action or a life cycle, and before their processes are taken apart."""
    names = {'compensator', 'identification', 'refinement'}
    with own_domain(), probe_node() as probe:
        # Only the second one of each kind ends without that.
        for _ in range(2):
            with ExitStack() as nodes:
                for name in names:
                    nodes.enter_context(Process(tmp_path, name, ONE))
                probe.until(lambda: names <= set(probe.get_node_names()), 'all nodes')
            # Of a node that says nothing, others know after 20 s.
            probe.until(lambda: not names & set(probe.get_node_names()), 'their ends', 10.0)


@contextmanager
def in_this_process(kind, *arguments):
    """Yield a node of one joint."""
    with own_domain():
        rclpy.init(args=['x', *ros_arguments(ONE), *arguments],
                   signal_handler_options=SignalHandlerOptions.NO)
        try:
            node = kind()
            yield node
            # An empty recording is an error.
            with suppress(InputError):
                getattr(node, 'leave', lambda: None)()
            node.destroy_node()
        finally:
            rclpy.shutdown()


@pytest.mark.parametrize('kind', [CompensatorNode, DirectionNode, ExerciseNode, IdentificationNode,
                                  PlantNode, RecorderNode, RefinementNode])
def test_a_node_has_the_parameters_of_the_file(kind, tmp_path, monkeypatch):
    """With their defaults, and refuses what is beyond a range or no choice."""
    monkeypatch.chdir(tmp_path)
    file = yaml.safe_load((ROOT / 'config' / 'parameters.yaml').read_text(encoding='utf-8'))
    with in_this_process(kind) as node:
        name, own = node.get_name(), set(node.get_parameters_by_prefix(''))
        listed = file[f'/**/{name}']['ros__parameters']
        entries = list(described(name))
        assert {*listed, *({'joints', 'model_files'} & own)} == {one.name for one in entries}
        assert own - {one.name for one in entries} == {
            'use_sim_time', 'start_type_description_service'}
        for one in entries:
            if one.name in listed:
                assert (node.get_parameter(one.name).value if not isinstance(one.default, list)
                        else one.default) == listed[one.name]
            assert one.meaning
            wrong = one.range[-1] * 2 + 1 if one.range else 'odd'
            if one.changes and (one.range or one.choices):
                wrong = type(one.default)(wrong)
                answer, = node.set_parameters([Parameter(one.name, value=wrong)])
                assert not answer.successful
                assert node.get_parameter(one.name).value == one.default
