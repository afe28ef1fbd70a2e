# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What nodes say of unusable input, their parameters, and their ends."""

from contextlib import contextmanager, ExitStack, suppress
import signal

from node_process import Process, ROOT, ros_arguments
import pytest
import rclpy
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from ros_system import MODELS, own_domain, probe_node

from friction_comp.errors import InputError
from friction_comp.nodes.compensator import CompensatorNode
from friction_comp.nodes.direction import DirectionNode
from friction_comp.nodes.exercise import ExerciseNode
from friction_comp.nodes.plant import PlantNode
from friction_comp.nodes.recorder import RecorderNode

ONE = {'joints': ['elbow'], 'model_files': MODELS[:1]}
ODD_EFFECT = 'format: friction_comp_undeclared\nversion: 1\neffects: [{name: ghost}]\n'



@pytest.fixture(scope='module')
def domain():
    with own_domain():
        yield


@contextmanager
def in_this_process(kind, parameters):
    """Yield a node."""
    rclpy.init(args=['x', *ros_arguments(parameters)],
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


@pytest.mark.parametrize(('kind', 'parameters', 'words'), [
    (PlantNode, {**ONE, 'undeclared_effect_files': ['odd.yaml']}, 'ghost'),
    (PlantNode, {**ONE, 'clock': 'sundial'}, 'clock'),
    (PlantNode, {'joints': ['elbow']}, 'must have the name of this node'),
    (CompensatorNode, {'joints': ['a', 'a'], 'model_files': MODELS[:2]}, 'joints'),
    (CompensatorNode, {**ONE, 'model_files': MODELS[:2]}, 'model_files'),
    (CompensatorNode, {**ONE, 'joints': []}, 'joints: has no value'),
    (CompensatorNode, {**ONE, 'joints': ['']}, 'joints: names must be given'),
    (CompensatorNode, {**ONE, 'breakaway_gain': 1}, 'expecting type'),
    (CompensatorNode, {**ONE, 'breakaway_gain': 1.1}, 'breakaway_gain'),
    (CompensatorNode, {**ONE, 'joints': 'elbow'}, 'expecting type'),
    (CompensatorNode, {**ONE, 'command_interface': 'voltage'},
     'command_interface: must be one of current, effort'),
    (ExerciseNode, {'announcement': 3.0, 'standstill': 1.0}, 'announcement'),
    (DirectionNode, {'source': 'sensor'}, 'sensor_range must be'),
    (RecorderNode, {'output': 'taken'}, 'taken')])
def test_says_what_it_cannot_use(domain, tmp_path, monkeypatch, kind, parameters, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'odd.yaml').write_text(ODD_EFFECT)
    (tmp_path / 'taken').mkdir()
    (tmp_path / 'taken' / 'kept').write_text('')
    with pytest.raises(InputError, match=words), in_this_process(kind, parameters):
        pass
    assert [path.name for path in (tmp_path / 'taken').iterdir()] == ['kept']
    assert not (tmp_path / 'recording').exists()


@pytest.mark.parametrize(('parameters', 'arguments', 'words'), [
    ({**ONE, 'model_files': ['none.yaml']}, (), 'none.yaml'), (ONE, ('surplus',), 'surplus'),
    (ONE, ('--ros-args', '--params-file', 'none.yaml', '--'), 'none.yaml')])
def test_one_that_cannot_start_says_so_in_one_line(
        domain, tmp_path, parameters, arguments, words):
    with Process(tmp_path, 'compensator', parameters, arguments=arguments) as process:
        assert process.wait() == 2
        lines = [line for line in process.text.splitlines() if line.startswith('compensator: ')]
        assert len(lines) == 1
        assert words in lines[0]
        assert 'Traceback' not in process.text


def test_a_misspelt_parameter_is_told(domain, tmp_path):
    """Not so those of the file for all nodes."""
    config = ROOT / 'config' / 'parameters.yaml'
    with probe_node() as probe, Process(tmp_path, 'compensator', {
            **ONE, 'breakaway_gian': 0.1}, arguments=(
                '--ros-args', '--params-file', str(config), '--')) as process:
        probe.until(lambda: 'breakaway_gian does not exist' in process.text, 'what is told')
        process.send(signal.SIGINT)
        assert process.wait() == 0
        assert process.text.count('does not exist') == 1


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


@pytest.mark.parametrize(('name', 'value'), [
    ('breakaway_gain', 1.1), ('law', 'odd'), ('command_interface', 'effort')])
def test_a_change_beyond_range_or_choices_or_of_what_stays_is_refused(domain, name, value):
    with in_this_process(CompensatorNode, ONE) as node:
        before = node.get_parameter(name).value
        answer, = node.set_parameters([Parameter(name, value=value)])
        assert not answer.successful
        assert node.get_parameter(name).value == before
