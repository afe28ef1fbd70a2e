# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The live page: what it shows of a recording, how it is played, and who can open it."""

from importlib.util import find_spec
import json
from pathlib import Path
import re
import socket
import subprocess
import sys
from types import SimpleNamespace
from urllib.request import urlopen
from xml.etree import ElementTree

import numpy as np
import pytest
from table_maker import write

from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.package_files import package_file
from friction_comp.recordings import recorded_joints, RecordingInfo, write_samples
from friction_comp.recordings.activity import Activity
from friction_comp.samples import Samples
from friction_comp.tools import watch
from friction_comp.topics import TOPICS

LIVE_PAGES = True
pytestmark = pytest.mark.skipif(
    not find_spec('bokeh'), reason='Bokeh is an extra: pip install friction_comp[watch]')
FILE = package_file('config', 'armin_configuration_1.yaml')
MODEL = FrictionModel.load(FILE)
GAIN = MODEL.drive.torque_per_current


@pytest.fixture(scope='module')
def recording(tmp_path_factory):
    """Two joints; the person carries half of the friction, so the residual is nothing."""
    time = np.arange(0.0, 12.0, 0.005)
    joints = []
    for joint, speed in (('shoulder', 0.7), ('elbow', 1.1)):
        position = 0.6 * np.sin(speed * time)
        velocity = np.gradient(position, time)
        friction = MODEL.sigmoid(velocity)
        joints.append(Samples(
            time=time, position=position, velocity=velocity, current=0.5 * friction,
            load=0.5 * friction * GAIN, direction=np.sign(velocity).astype(int), joint=joint))
    path = tmp_path_factory.mktemp('watch') / 'trial'
    write_samples(path, joints, MODEL.drive.torque_constant, MODEL.drive.gear_ratio)
    return path


@pytest.fixture(scope='module')
def page():
    """The live page; importing Bokeh takes a second, which not every worker needs."""
    from bokeh import document, models

    from friction_comp.reports import live_page

    def open_page(feed):
        opened = document.Document()
        live_page.live_page(feed)(opened)
        return opened, lambda kind, wanted=lambda _: True: next(filter(
            wanted, opened.select({'type': getattr(models, kind)})))
    return SimpleNamespace(open=open_page, **vars(live_page))


@pytest.fixture(scope='module')
def feed(recording):
    return watch.recorded_feed(recording, [], [MODEL, MODEL])


def test_a_window_ends_at_its_time_and_holds_every_signal(feed, page):
    assert feed.joints == ['shoulder', 'elbow']
    assert feed.duration == pytest.approx(12.0, abs=0.02)
    data = feed.window('elbow', 8.0, 3.0)
    assert set(data) == set(page.SIGNALS)
    assert data['time'][0] == pytest.approx(5.0, abs=0.02)
    assert data['time'][-1] == pytest.approx(8.0, abs=0.02)
    np.testing.assert_allclose(data['torque'], data['current'] * GAIN)
    assert np.abs(data['residual']).max() < 0.2 * np.abs(data['predicted']).max()
    assert set(np.unique(data['direction'])) <= {-1.0, 0.0, 1.0}


def test_without_a_model_there_is_torque_but_no_current(recording):
    data = watch.recorded_feed(recording, ['elbow'], []).window('elbow', 8.0, 3.0)
    assert np.isfinite(data['torque']).all()
    assert np.isnan(data['current']).all()
    assert np.isnan(data['residual']).all()


def test_models_that_the_recording_names_are_shown(tmp_path):
    time = np.arange(0.0, 4.0, 0.005)
    samples = Samples(time=time, position=np.sin(time), velocity=np.cos(time),
                      current=MODEL.sigmoid(np.cos(time)), joint='elbow')
    write_samples(tmp_path / 'named', samples, MODEL.drive.torque_constant,
                  MODEL.drive.gear_ratio, custom_data={'model_file': str(FILE)})
    one, other = (watch.recorded_feed(tmp_path / 'named', [], models).window('elbow', 3.0, 3.0)
                  for models in ([MODEL], []))
    for name in ('current', 'torque', 'residual'):
        np.testing.assert_allclose(other[name], one[name], atol=1e-9)
    assert np.isfinite(one['residual']).any()
    write_samples(tmp_path / 'in_ampere', samples, custom_data={'model_file': str(FILE)})
    other = watch.recorded_feed(tmp_path / 'in_ampere', [], [], True).window('elbow', 3.0, 3.0)
    for name in ('current', 'torque', 'residual'):
        np.testing.assert_allclose(other[name], one[name], atol=1e-9)
    write_samples(tmp_path / 'elsewhere', samples, custom_data={'model_file': '/no/such.yaml'})
    assert np.isnan(watch.recorded_feed(tmp_path / 'elsewhere', [], []).window(
        'elbow', 3.0, 3.0)['current']).all()


def test_one_model_shown_of_several_is_said():
    other = package_file('config', 'armin_configuration_2.yaml')
    said = [(float(k), Activity(0, 'active', 'paper', str(path)))
            for k, path in enumerate((FILE, other, FILE))]
    notes = []
    model = watch.recorded_model(RecordingInfo('trial', '', activity=said), '', notes)
    assert model.sigmoid(1.0) == MODEL.sigmoid(1.0)
    note, = notes
    assert str(other) in note
    assert '--model' in note
    watch.recorded_model(RecordingInfo('trial', '', activity=said[:1]), '', notes)
    assert len(notes) == 1


def test_the_page_seeks_plays_and_changes_the_joint(feed, monkeypatch, page):
    clock = [0.0]
    monkeypatch.setattr('friction_comp.reports.live_page.time', SimpleNamespace(
        monotonic=lambda: clock[0]))
    document, shown = page.open(feed)
    update = document.session_callbacks[0].callback
    slider, play = shown('Slider'), shown('Toggle')
    source, overview = (shown('ColumnDataSource', lambda one, name=name: name in one.data)
                        for name in ('time', 'joint'))
    # The shoulder turns round: at rest there is no residual, in the table as in the plot.
    slider.value = 0.5 * np.pi / 0.7
    update()
    assert np.isnan(overview.data['residual'][0])
    slider.value = 11.0
    update()
    assert np.isfinite(overview.data['residual']).all()
    assert source.data['time'][-1] == pytest.approx(11.0, abs=0.02)
    assert source.data['time'][0] == pytest.approx(1.0, abs=0.02)
    before = np.array(source.data['position'])
    shown('Select', lambda one: one.title == 'Joint').value = 'elbow'
    update()
    assert not np.array_equal(before, source.data['position'])
    play.active = True
    clock[0] = 0.3
    update()
    assert slider.value == pytest.approx(11.3)
    clock[0] = 2.0
    update()
    assert slider.value == feed.duration
    assert not play.active, 'it stops at the end'


def test_a_joint_without_a_name_is_shown_too(tmp_path, page):
    time = np.arange(0.0, 12.0, 0.005)
    write(tmp_path / 'plain.csv', time=time, position=np.sin(time), effort=np.cos(time))
    _, shown = page.open(watch.recorded_feed(tmp_path / 'plain.csv', [], []))
    source = shown('ColumnDataSource', lambda one: 'time' in one.data)
    assert len(source.data['time']) > 100


def test_a_joint_without_effort_is_left_out_unless_it_was_asked_for(tmp_path):
    time = np.arange(0.0, 12.0, 0.005)
    elbow = Samples(time=time, position=np.sin(time), current=np.cos(time), joint='elbow')
    write_samples(tmp_path / 'r', [elbow, elbow.with_(joint='grip', current=np.nan * time)])
    shown = watch.recorded_feed(tmp_path / 'r', [], [])
    assert shown.joints == ['elbow']
    assert any('left out' in text and "'grip'" in text for _, _, text in shown.status())
    with pytest.raises(InputError, match="no finite effort of joint 'grip'"):
        watch.recorded_feed(tmp_path / 'r', ['elbow', 'grip'], [])


def test_no_line_across_a_gap_and_no_residual_at_rest(feed, page):
    data = feed.window('elbow', 12.0, 12.0)
    cut = {name: np.delete(values, slice(300, 400)) for name, values in data.items()}
    shown = page.with_gaps(cut)
    assert len(shown['time']) == len(cut['time']) + 1
    assert (np.diff(shown['time']) > 0).all()
    assert np.isnan(shown['position'][300])
    at_rest = np.abs(shown['velocity']) < 0.01
    assert at_rest.any()
    assert np.isnan(shown['residual'][at_rest]).all()
    moving = np.abs(shown['velocity']) > 0.02
    assert np.isfinite(shown['residual'][moving]).all()


@pytest.mark.slow
def test_served_to_this_machine_alone_without_anything_from_elsewhere(recording):
    process = subprocess.Popen(
        [sys.executable, '-m', 'friction_comp', 'watch', str(recording), '--port', '0'],
        stdout=subprocess.PIPE, text=True, cwd=FILE.parent.parent)
    try:
        port = int(re.search(r'localhost:(\d+)', process.stdout.readline())[1])
        page = urlopen(f'http://localhost:{port}/', timeout=20).read().decode()
        # On a phone it is as wide as the screen.
        assert 'width=device-width' in page
        assert 'prefers-color-scheme: dark' in page, 'one look with the reports'
        for source in re.findall(r'(?:src|href)="([^"]+)"', page):
            assert not source.startswith(('http', '//')) or 'localhost' in source, source
        script = re.search(r'src="([^"]*bokeh[^"]*\.js[^"]*)"', page)[1]
        assert urlopen(f'http://localhost:{port}/{script.lstrip("/")}', timeout=20).status == 200
        # Another address of this machine, where it has one.
        outside = socket.gethostbyname(socket.gethostname())
        if not outside.startswith('127.'):
            with pytest.raises((ConnectionError, TimeoutError)):
                socket.create_connection((outside, port), timeout=2.0)
    finally:
        process.terminate()
        assert process.wait(20.0) == 0


def test_what_cannot_be_used_is_named(recording, monkeypatch, capsys):
    with pytest.raises(InputError, match='one file per joint'):
        watch.recorded_feed(recording, [], [MODEL])
    with pytest.raises(InputError, match='nothing'):
        watch.recorded_feed(recording / 'nothing', [], [])
    with pytest.raises(SystemExit):
        watch.main([str(recording), '--port', '99999'])
    assert 'must be a whole number from 0 to 65535' in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, 'bokeh.server.server', None)
    monkeypatch.setitem(sys.modules, 'bokeh', None)
    with pytest.raises(InputError, match=r'pip install'):
        watch.main([str(recording)])


def test_the_layouts_of_other_viewers_name_topics_of_this_package():
    folder = package_file('config', 'layouts')
    layout = json.loads((folder / 'foxglove_lichtblick.json').read_text(encoding='utf-8'))

    def panels(node):
        return [node] if isinstance(node, str) else panels(node['first']) + panels(node['second'])
    assert sorted(panels(layout['layout'])) == sorted(layout['configById'])
    paths = [path['value'] for panel in layout['configById'].values()
             for path in panel.get('paths', ())]
    curves = [curve.get('name') for curve in ElementTree.parse(
        folder / 'plotjuggler.xml').iter('curve')]
    assert {re.match(r'/(\w+)', name)[1] for name in paths + curves} <= set(TOPICS)
    # Of the joint that README's first lines and its example recordings have.
    named = {name.split('/')[2] for name in curves if name.startswith(('/joint_states', '/ref'))}
    example = Path(__file__).parents[1] / 'examples' / 'elbow' / 'with_direction.mcap.zstd'
    assert named == set(recorded_joints(example))
