# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""What the daemon refuses to start with, and that it says so in one line; its page and files."""
import json
import re
import sys
import time

sys.path.insert(0, sys.argv[2])
from gnomond import *  # noqa: E402,F403

EXAMPLE = sys.argv[3]


def refuse(room, *words, arguments=()):
    """gnomond must end with status != 0 and one line on stderr that holds the words."""
    doors = [x for door in ('--listen', '--http') if door not in arguments
             for x in (door, '127.0.0.1:0')]
    status, text = start_badly('--config', room.config, '--log', 'W', *doors, *arguments)
    assert status not in (0, -6, -11), (status, text)
    lines = [line for line in text.splitlines() if line.startswith('gnomond: ')]
    assert len(lines) == 1, text
    for word in words:
        assert word in lines[0], (word, lines[0])


def test_scenes():
    refuse(Room(scene='{"objects": []}'), 'room demo', 'scene.json')
    refuse(Room(scene='{"objects": [{"mesh": "gone.obj", "role": "real"}]}'), 'gone.obj')
    refuse(Room(scene='no JSON'), 'scene.json')
    refuse(Room(scene='{"objects": [{"mesh": "cube.obj", "role": "real", '
                      '"world_from_object": [0,0,0,0, 0,0,0,0, 0,0,0,0, 0,0,0,1]}]}'),
           'world_from_object')
    room = Room()
    os.unlink(os.path.join(room.path, 'scene.json'))
    refuse(room, 'scene.json', 'No such file')


def test_configuration():
    refuse(Room('lihgts = 4'), 'gnomond.conf:', 'lihgts', 'lights')
    refuse(Room('lights = many'), 'gnomond.conf:', 'lights', 'many')
    refuse(Room('lights = 0'), 'gnomond.conf:', 'lights', '4096')
    refuse(Room('light-method = quadtree\nlight-weights = equal'), 'gnomond.conf:',
           'light-weights = equal has no effect: the method quadtree does not take it; penrose does')
    refuse(Room('light-method = seed\nlights = 9'), 'lights = 9', 'penrose, median-cut')
    refuse(Room('shading = phong'), 'shading', 'lights', 'irradiance')
    refuse(Room(server='max-connections = -3'), 'max-connections')
    refuse(Room('[roon x]'), 'roon')
    room = Room()
    room.config = room.write('none.conf', '')
    refuse(room, '[room NAME]')
    room = Room()
    room.config = room.path + '/absent.conf'
    refuse(room, 'absent.conf', 'No such file')
    refuse(Room(), '--frobnicate', arguments=['--frobnicate'])


def test_addresses():
    refuse(Room(), '--listen', '0.0.0.0', 'loopback', arguments=['--listen', '0.0.0.0:0'])
    refuse(Room(), '--http', '192.0.2.1', 'loopback', arguments=['--http', '192.0.2.1:0'])
    refuse(Room(), 'loopback', arguments=['--listen', '[::]:0'])
    with Daemon() as daemon:
        taken = '127.0.0.1:%d' % daemon.address[1]
        refuse(Room(), '--listen %s: in use: another program listens there' % taken,
               'another --listen', arguments=['--listen', taken])
        taken = '127.0.0.1:%d' % daemon.http_address[1]
        refuse(Room(), '--http %s: in use' % taken, 'another --http', arguments=['--http', taken])


def test_ready_file():
    refuse(Room(), 'no/such/folder', arguments=['--ready-file', '/no/such/folder/ready'])


def test_help_and_example():
    def show(*arguments):
        return subprocess.run([binary(), *arguments], stdout=subprocess.PIPE, check=True, text=True,
                              timeout=60).stdout
    help_text = show('--help')
    for word in ('--config FILE', '--listen', '--http', '--ready-file', 'SIGTERM', '[room NAME]'):
        assert word in help_text, word
    assert re.match(r'gnomond \d+\.\d+\.\d+\n$', show('--version'))
    printed = show('--print-config')
    assert printed == open(EXAMPLE).read(), \
        'deploy/gnomond.conf.example is stale: gnomond --print-config > it'
    # Every key of the example, with the default that it names, is a configuration that starts.
    text = re.sub(r'(?m)^#(\[|[a-z-]+ =)', r'\1', printed)
    text = re.sub(r'(?m)^(log|scene) =.*$', '', text).replace('[room demo]',
                                                              '[room demo]\nscene = scene.json')
    room = Room()
    room.config = room.write('all.conf', text)
    with Daemon(rooms=room) as daemon:
        values = json.loads(daemon.get('/api/v1/status')[1])['configuration']
        keys = set(re.findall(r'(?m)^#([a-z-]+) =', printed))
        assert keys - {v['key'] for v in values} <= {'log'} and len(keys) > 25, \
            keys - {v['key'] for v in values}
        by_key = {(v['section'], v['key']): v for v in values}
        lights = [v for v in values if v['key'] == 'lights'][0]
        assert lights['value'] == '64' and 'all.conf:' in lights['source'], lights
        assert by_key[('server', 'listen')]['source'] == 'command line'


def check_metrics(text):
    """Prometheus text format 0.0.4: one HELP, one TYPE, then all samples of a name, each once."""
    kind, seen, last = {}, {}, None
    assert text.endswith('\n')
    for line in text.splitlines():
        word = line.split(' ')
        if line.startswith('#'):
            assert word[1] in ('HELP', 'TYPE') and len(word) >= 4, line
            if word[1] == 'TYPE':
                assert last == ('HELP', word[2]) and word[2] not in kind, line
                assert word[3] in ('counter', 'gauge', 'histogram') and len(word) == 4, line
                assert (word[3] == 'counter') == word[2].endswith('_total'), line
                kind[word[2]] = word[3]
            last = (word[1], word[2])
            continue
        match = re.match(r'([a-z_]+)(?:\{((?:[a-z]+="(?:[^"\\\n]|\\[\\"n])*",?)*)\})? (\S+)$', line)
        assert match, line
        name, labels, value = match.groups()
        family = re.sub('_(bucket|sum|count)$', '', name)
        family = family if kind.get(family) == 'histogram' else name
        assert last == ('TYPE', family) and (name, labels) not in seen, line
        seen[name, labels] = float(value)
        assert kind[family] == 'gauge' or seen[name, labels] >= 0, line
    for family in (name for name in kind if kind[name] == 'histogram'):
        counts = [v for (name, _), v in seen.items() if name == family + '_bucket']
        total = [v for (name, _), v in seen.items() if name == family + '_count']
        assert counts == sorted(counts) and counts[-1:] == total, family
    assert len(seen) > len(kind) > 20


def test_page_and_documents():
    with Daemon() as daemon, probe(daemon) as light, Viewer(daemon) as viewer:
        status, page, headers = daemon.get('/')
        assert status == 200 and b'<title>Gnomon</title>' in page
        assert "default-src 'none'" in headers['Content-Security-Policy']
        assert b'http://' not in page and b'https://' not in page, 'an external resource'
        assert daemon.get('/healthz')[:2] == (200, b'alive\n')
        status, text, _ = daemon.get('/readyz')
        assert status == 200 and json.loads(text)['ready'] is True
        composite, map_picture = ('/api/v1/rooms/demo/%s.jpg' % name
                                  for name in ('composite', 'light'))
        assert daemon.get(composite)[0] == 404 and daemon.get(map_picture)[0] == 404
        light_up(light)
        for _ in range(2):
            viewer.expect_result(viewer.send_frame(lighting_min_sequence=1, lighting_wait_ms=20000))
        for path in (composite, map_picture):
            status, picture, headers = daemon.get(path)
            assert status == 200 and picture[:2] == b'\xff\xd8', (path, status)
            assert headers['Content-Type'] == 'image/jpeg'
        status, text, _ = daemon.get('/api/v1/status')
        room = json.loads(text)['rooms'][0]
        assert (room['frames_in'], room['frames_out'], room['frames_dropped']) == (2, 2, 0)
        assert room['last_receipt']['rays']['primary'] > 0
        assert {s['role'] for s in room['sessions']} == {'probe', 'viewer'}
        assert room['light']['lit'] and room['light']['lights'] > 0
        status, text, headers = daemon.get('/metrics')
        assert 'version=0.0.4' in headers['Content-Type']
        check_metrics(text.decode())
        metrics = dict(re.findall(r'(?m)^([a-z_]+(?:\{[^}]*\})?) (\S+)$', text.decode()))
        assert metrics['gnomon_frames_rendered_total{room="demo"}'] == '2', metrics
        assert metrics['gnomon_frame_busy_seconds_count{room="demo"}'] == '2'


def test_bytes():
    """A path may hold any bytes, the server's name may not: it goes out in messages."""
    room = Room()
    os.rename(os.path.join(room.path, 'scene.json'), os.fsencode(room.path) + b'/sc\xffene.json')
    with open(room.config, 'wb') as out:
        out.write(b'[room demo]\nscene = sc\xffene.json\n')
    with Daemon(rooms=room) as daemon:
        values = json.loads(daemon.get('/api/v1/status')[1])['configuration']
        assert [v['value'] for v in values if v['key'] == 'scene'] == ['sc?ene.json']
    refuse(Room(), 'name = g?n', '63 bytes', arguments=[b'--server-name', b'g\xffn'])
    refuse(Room(server='name = ' + 'x' * 64), 'name', '63 bytes')


def test_names():
    """A client's name is shown as text, whatever it holds."""
    with Daemon() as daemon, Client(daemon) as client:
        name = '<script>"\\ \u00fc'
        client.send(HELLO, pb.Hello(version_min=1, version_max=1, role=pb.ROLE_VIEWER,
                                    client_name=name))
        client.expect(WELCOME)
        sessions = json.loads(daemon.get('/api/v1/status')[1])['rooms'][0]['sessions']
        assert sessions[0]['name'] == name


run_tests([test_scenes, test_configuration, test_addresses, test_ready_file, test_help_and_example,
           test_page_and_documents, test_bytes, test_names])
