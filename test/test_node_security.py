# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The SROS 2 policy grants each node the rights that it uses, no others; and what doctor sees."""

from collections import defaultdict
from contextlib import ExitStack
import json
import time
from xml.etree import ElementTree

from node_process import Process, ROOT
import numpy as np
from ros_system import BEST_EFFORT, joint_state, MODELS, own_domain, probe_node, RELIABLE
from sensor_msgs.msg import JointState

POLICY = ROOT / 'sros2' / 'friction_comp.policy.xml'
# Rights that a node uses at times only: in a simulation, during a goal, in lockstep.
AT_TIMES = {*(('direction', 'subscribe', topic) for topic in ('/trajectory', '/reference')),
            ('plant', 'publish', '/clock'), ('identification', 'publish', '/current_command'),
            ('exercise', 'subscribe', '/joint_states'),
            *((node, 'subscribe', '/clock') for node in (
                'compensator', 'identification', 'exercise', 'direction', 'recorder',
                'refinement')),
            *(('friction_comp_doctor', 'request', f'/{node}/{what}') for node in (
                'plant', 'compensator', 'identification', 'exercise', 'direction', 'recorder',
                'refinement')
              for what in ('get_parameters', 'list_parameters'))}


def rights():
    """Return {node: {kind of right: names}}, actions in the topics and services they stand for."""
    found = defaultdict(lambda: defaultdict(set))
    for profile in ElementTree.parse(POLICY).iter('profile'):
        node = profile.get('node')
        for group in profile:
            for kind in group.attrib:
                for item in group:
                    name = item.text.replace('~/', f'/{node}/')
                    name = name if name.startswith('/') else f'/{name}'
                    if kind == 'execute':
                        found[node]['publish'] |= {
                            f'{name}/_action/{end}' for end in ('feedback', 'status')}
                        found[node]['reply'] |= {
                            f'{name}/_action/{end}'
                            for end in ('cancel_goal', 'get_result', 'send_goal')}
                    else:
                        found[node][kind].add(name)
    return found


def actions(node, right):
    """Return the actions that a node may call or execute."""
    return {action.text for profile in ElementTree.parse(POLICY).iter('profile')
            if profile.get('node') == node for group in profile.iter('actions')
            if right in group.attrib for action in group}


def test_only_few_nodes_may_command_a_current_or_announce_a_direction():
    table = rights()
    commanders = {node for node, has in table.items() if '/current_command' in has['publish']}
    assert commanders == {'compensator', 'identification'}
    planners = {node for node, has in table.items()
                if has['publish'] & {'/direction', '/direction_stamped'}}
    assert planners == {'exercise', 'direction'}
    listeners = {node for node, has in table.items() if '/interaction_wrench' in has['subscribe']}
    assert listeners == {'recorder', 'refinement'}
    assert not listeners & (commanders | planners), 'the torque sensor is for evaluation only'
    assert '/compensator/set_parameters' in table['refinement']['request']
    assert actions('operator', 'call') == {
        'identify_friction', 'play_trajectory', 'refine_model'}
    assert actions('identification', 'execute') | actions('refinement', 'execute') == actions(
        'operator', 'call')


def test_the_nodes_use_what_they_may_and_nothing_else(tmp_path):
    one = {'joints': ['elbow'], 'model_files': MODELS[:1]}
    # What they use does not depend on how much of it.
    starts = {'plant': {**one, 'sample_time': 0.01}, 'compensator': one, 'identification': one,
              'exercise': {'joints': ['elbow']},
              'direction': {'joints': ['elbow'], 'source': 'sensor', 'sensor_range': [0.0, 1.0]},
              'recorder': {'output': str(tmp_path / 'bag')},
              'refinement': one}
    with own_domain(), probe_node() as probe, ExitStack() as nodes:
        for name, parameters in starts.items():
            nodes.enter_context(Process(tmp_path / 'logs', name, parameters))
        nodes.enter_context(Process(tmp_path / 'logs', 'doctor', arguments=('--seconds', '600')))
        for name in (*starts, 'friction_comp_doctor'):
            allowed = {kind: names for kind, names in rights()[name].items() if names}
            questions = {
                'publish': probe.get_publisher_names_and_types_by_node,
                'subscribe': probe.get_subscriber_names_and_types_by_node,
                'reply': probe.get_service_names_and_types_by_node,
                'request': probe.get_client_names_and_types_by_node}

            def used(kind, ask, name=name):
                if name not in probe.get_node_names():
                    return set()
                return {topic for topic, _ in ask(name, '/')}

            def unused(name=name, allowed=allowed, questions=questions):
                return {(name, kind, topic) for kind, ask in questions.items()
                        for topic in allowed.get(kind, set()) - used(kind, ask)}
            probe.until(lambda unused=unused: unused() <= AT_TIMES, f'all of {name}')
            for kind, ask in questions.items():
                assert used(kind, ask) <= allowed.get(kind, set())


def test_the_doctor_finds_the_sign_and_who_publishes(tmp_path):
    with own_domain(), probe_node() as probe, Process(
            tmp_path, 'doctor', remappings={'__ns': '/arm'},
            arguments=('--seconds', '4', '--json')) as doctor:
        publisher = probe.talk(JointState, 'arm/joint_states', BEST_EFFORT)
        probe.listen(JointState, 'arm/joint_states', RELIABLE)
        while doctor.running:
            now = time.time_ns()
            t = now * 1e-9 % 1000.0
            publisher.publish(joint_state(
                now, ['elbow'], [np.sin(2.0 * t)], [-2.0 * np.cos(2.0 * t)], [0.0]))
            probe.spin_for(0.004)
        assert doctor.wait() == 1
        findings = json.loads(doctor.text)['findings']
    problems = [f"{one['about']}: {one['what']}" for one in findings if one['level'] == 'problem']
    assert any('elbow: velocity is -1 times the rate' in line for line in problems), problems
    assert any('QoS' in line and 'reliable: nothing arrives' in line for line in problems), problems
    assert all(one['do'] for one in findings if one['level'] == 'problem')
