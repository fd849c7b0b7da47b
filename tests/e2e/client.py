# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""gnomon probe, view and doctor against a real gnomond, as separate processes.

usage: client.py GNOMOND DIRECTORY_OF_GNOMON_PB2 GNOMON
"""
import json
import os
import random
import re
import signal
import sys
import time

sys.path.insert(0, sys.argv[2])
from folder import Folder  # noqa: E402
from gnomond import Daemon, light_up, pb, probe as daemon_probe, run_tests  # noqa: E402
from pictures import exr_bytes, png_bytes, read_png  # noqa: E402
from run import Run, server  # noqa: E402

WIDTH, HEIGHT = 64, 48
# 2 m above the floor, looking down; the floor's 2 m fill the middle of the picture's 4 m.
CAMERA = {'width': WIDTH, 'height': HEIGHT, 'fx': WIDTH / 2, 'fy': WIDTH / 2, 'cx': WIDTH / 2,
          'cy': HEIGHT / 2, 'distortion': [0, 0, 0, 0, 0],
          'world_from_camera': [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 2, 0, 0, 0, 1]}


def noise(seed, n=3 * WIDTH * HEIGHT):
    return random.Random(seed).getrandbits(8 * n).to_bytes(n, 'little')


class Bench(Folder):
    """A folder with a camera, n camera frames and a light."""

    def __init__(self, n=6):
        super().__init__()
        self.write('camera.json', json.dumps(CAMERA).encode())
        os.mkdir(self.at('shots'))
        self.shots = [noise(i) for i in range(n)]
        for i, shot in enumerate(self.shots):
            self.write('shots/f%03d.png' % i, png_bytes(WIDTH, HEIGHT, shot))
        self.write('light.exr', exr_bytes(32, 16, (1, 1, 1)))


def probe(daemon, bench, *more, files='light.exr'):
    return Run('probe', server(daemon), '--files', bench.at(files), *more)


def view(daemon, bench, *more, files='shots', out='out', camera='camera.json'):
    return Run('view', server(daemon), '--files', bench.at(files), '--camera', bench.at(camera),
               '--out', bench.at(out), *more)


def read_report(bench, out='out'):
    with open(bench.at(out + '/view.json')) as f:
        report = json.load(f)
    assert report['format'] == 'gnomon-view 1'
    frames = report['frames']
    assert len({f['id'] for f in frames}) == len(frames), 'an id came back twice'
    for outcome, key in (('result', 'results'), ('dropped', 'dropped')):
        assert report[key] == sum(f['outcome'] == outcome for f in frames), report
    left = [name for name in os.listdir(bench.at(out)) if name.endswith('.tmp')]
    assert not left, left
    return report


def pixel(data, x, y):
    return data[3 * (y * WIDTH + x):][:3]


def check_composite(bench, name, shot, out='out'):
    width, height, data = read_png(bench.at('%s/%s.png' % (out, name)))
    assert (width, height) == (WIDTH, HEIGHT)
    # Beyond the floor nothing virtual is seen and no shadow can fall: not a bit may change.
    for x, y in [(x, y) for y in range(HEIGHT) for x in range(WIDTH)]:
        if not (14 <= x < 50 and 6 <= y < 42):
            assert pixel(data, x, y) == pixel(shot, x, y), (name, x, y)
    cube = [pixel(data, x, y) for y in (23, 24) for x in (31, 32)]
    assert max(max(p) - min(p) for p in zip(*cube)) <= 2, 'no even cube in the middle: %r' % cube
    assert data != shot


def test_frames():
    """Probe and view end to end: every frame once, the object in it, the rest untouched."""
    with Daemon() as daemon, Bench() as bench:
        out = probe(daemon, bench, '--count', '1').succeed()
        assert '1 environment frames sent' in out, out
        view(daemon, bench, '--rate', '50').succeed()
        report = read_report(bench)
        assert report['complete'] is True and report['sent'] == report['results'] == 6
        assert [f['name'] for f in report['frames']] == ['f%03d' % i for i in range(6)]
        assert [f['id'] for f in report['frames']] == list(range(1, 7))
        for i, frame in enumerate(report['frames']):
            check_composite(bench, frame['name'], bench.shots[i])
            receipt = frame['receipt']
            assert frame['latency_ms'] > 0 and receipt['lighting_sequence'] == 1
            assert receipt['lights'] > 0 and receipt['rays']['primary'] > 0
            assert set(receipt['stages_ms']) == {'queue', 'decode', 'plan', 'primary', 'shade',
                                                 'shadow', 'composite', 'encode'}
        assert len(os.listdir(bench.at('out'))) == 7  # and nothing else


def test_nothing_virtual_is_told():
    """Where no picture shows an object though asked for, moving or at rest: by the pixels counted."""
    none = 'no virtual object was in any picture'
    with Daemon() as daemon, Bench() as bench:
        probe(daemon, bench).succeed()
        bench.write('up.json', json.dumps({**CAMERA, 'world_from_camera': [
            1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 2, 0, 0, 0, 1]}).encode())
        for camera, more, pixels in (('up.json', (), range(1)), ('camera.json', (), range(9, WIDTH * HEIGHT // 2)),
                                     ('camera.json', ('--show', 'shadow'), range(1))):
            out = view(daemon, bench, *more, camera=camera).succeed()
            counts = [frame['receipt']['virtual_pixels'] for frame in read_report(bench)['frames']]
            assert len(counts) == 6 and all(n in pixels for n in counts), counts
            assert (none in out) == (camera == 'up.json'), (camera, more, out)


def test_outstanding():
    """Faster than the server: dropped frames are counted, none is lost, the last one comes back."""
    with Daemon() as daemon, Bench(60) as bench:
        probe(daemon, bench).succeed()
        out = view(daemon, bench, '--rate', '1000', '--outstanding', '8').succeed()
        report = read_report(bench)
        assert report['sent'] == 60 and report['results'] + report['dropped'] == 60, out
        assert report['complete'] and report['results'] >= 2
        assert [f['outcome'] for f in report['frames'] if f['id'] == 60] == ['result']
        names = {f['name'] + '.png' for f in report['frames'] if f['outcome'] == 'result'}
        assert names == set(os.listdir(bench.at('out'))) - {'view.json'}
        for frame in report['frames']:
            if frame['outcome'] == 'dropped':
                assert frame['reason'] and frame['sentence'], frame


def test_probe_killed():
    with Daemon() as daemon, Bench() as bench:
        lamp = probe(daemon, bench, '--loop', '--rate', '20')
        lamp.wait_for('environment frame 3')
        viewer = view(daemon, bench, '--loop', '--count', '40', '--rate', '20')
        viewer.wait_for('frame 5:')
        lamp.process.kill()
        lamp.end()
        viewer.succeed()
        report = read_report(bench)
        assert report['results'] == 40 and report['complete']
        Run('doctor', server(daemon)).succeed()


def test_daemon_killed():
    with Daemon() as daemon, Bench() as bench:
        lamp = probe(daemon, bench, '--loop', '--rate', '20')
        viewer = view(daemon, bench, '--loop', '--rate', '20')
        viewer.wait_for('frame 5:')
        daemon.kill()
        viewer.fail(1, 'gnomon view: the server is lost: ')
        lamp.fail(1, 'gnomon probe: the server is lost: ')
        report = read_report(bench)
        assert report['complete'] is False and report['results'] >= 4
        view(daemon, bench, out='none').fail(1, 'Connection refused', 'is gnomond running')
        assert not os.path.exists(bench.at('none')), 'a folder for a run that never began'


def test_daemon_stopped():
    """A server that an operator ends says so, and that is what its clients say."""
    with Daemon() as daemon, Bench() as bench:
        probe(daemon, bench).succeed()
        viewer = view(daemon, bench, '--loop', '--rate', '20')
        viewer.wait_for('frame 3:')
        daemon.process.terminate()
        viewer.fail(1, 'gnomon view: the server ended the session: ')


def test_daemon_slow():
    """A server that stands still for a while costs time, no frame; the rest does not burst."""
    with Daemon() as daemon, Bench() as bench:
        probe(daemon, bench).succeed()
        begin = time.monotonic()
        viewer = view(daemon, bench, '--loop', '--count', '30', '--rate', '10')
        viewer.wait_for('frame 5:')
        daemon.process.send_signal(signal.SIGSTOP)
        time.sleep(3.5)
        daemon.process.send_signal(signal.SIGCONT)
        out = viewer.succeed()
        assert 's behind schedule' in out, out
        assert time.monotonic() - begin >= 6, 'the frames after the pause burst'
        assert read_report(bench)['results'] == 30


def test_jpeg():
    """JPEG out, and what came out as JPEG in."""
    with Daemon() as daemon, Bench() as bench:
        bench.write('shots/gray.png', png_bytes(WIDTH, HEIGHT, bytes([128]) * 3 * WIDTH * HEIGHT))
        probe(daemon, bench).succeed()
        view(daemon, bench, '--result', 'jpeg', '--jpeg-quality', '95', out='jpeg').succeed()
        names = sorted(n for n in os.listdir(bench.at('jpeg')) if n != 'view.json')
        assert names == ['f%03d.jpg' % i for i in range(6)] + ['gray.jpg']
        for name in names:
            assert open(bench.at('jpeg/' + name), 'rb').read(3) == b'\xff\xd8\xff'
        view(daemon, bench, files='jpeg', out='again').succeed()
        report = read_report(bench, 'again')
        assert report['results'] == 7, report
        _, _, data = read_png(bench.at('again/gray.png'))
        assert all(abs(c - 128) <= 2 for c in pixel(data, 2, 2)), pixel(data, 2, 2)
        assert pixel(data, 32, 24) != pixel(data, 2, 2)


def test_sync_light():
    """Probe and view started for the same moment: each frame in the light of its number."""
    with Daemon() as daemon, Bench() as bench:
        for i in range(6):
            bench.write('light%d.exr' % i, exr_bytes(32, 16, (1 + i, 1, 1)))
        os.remove(bench.at('light.exr'))
        start = '%.3f' % (time.time() + 3)
        step = ('--start-at', start, '--rate', '2')
        lamp = probe(daemon, bench, *step, '--first-sequence', '100', files='light*.exr')
        viewer = view(daemon, bench, *step, '--sync-light', '100')
        lamp.wait_for('starting in')
        viewer.succeed()
        lamp.succeed()
        got = [f['receipt']['lighting_sequence'] for f in read_report(bench)['frames']]
        assert got == list(range(100, 106)), got


def test_several_views():
    with Daemon() as daemon, Bench() as bench:
        probe(daemon, bench).succeed()
        viewers = [view(daemon, bench, '--loop', '--count', '12', '--rate', '30', out='out%d' % i)
                   for i in range(3)]
        for i, viewer in enumerate(viewers):
            viewer.succeed()
            report = read_report(bench, 'out%d' % i)
            assert report['results'] == 12 and report['complete']
            check_composite(bench, 'f005', bench.shots[5], 'out%d' % i)


def test_no_light():
    """Light is waited for, once; then frames are dropped for want of it."""
    with Daemon() as daemon, Bench() as bench:
        viewer = view(daemon, bench, '--count', '2')
        time.sleep(1)
        probe(daemon, bench).succeed()
        viewer.succeed()
    with Daemon() as daemon, Bench() as bench:
        view(daemon, bench).fail(1, 'no frame was rendered: no probe has lit the room',
                                'is a gnomon probe running?')
        report = read_report(bench)
        assert report['dropped'] == 6 and report['results'] == 0


def test_late_start():
    """A start that has passed is said; the pace is kept, not made up for."""
    with Daemon() as daemon, Bench() as bench:
        begin = time.monotonic()
        status, out, err = probe(daemon, bench, '--start-at', '%.0f' % (time.time() - 100),
                                 '--rate', '5', '--loop', '--count', '6').end()
        assert status == 0 and time.monotonic() - begin >= 1.0, time.monotonic() - begin
        assert err.count('\n') == 1 and 'the time to start was ' in err, err
        assert 's behind schedule' in out, out


def test_interrupt():
    """Ctrl-C ends a loop well and anything else with a word; view.json is there, and says it."""
    with Daemon() as daemon, Bench() as bench:
        probe(daemon, bench).succeed()
        for loop, status in ((['--loop'], 0), ([], 1)):
            viewer = view(daemon, bench, '--rate', '0.5' if status else '20', *loop)
            viewer.wait_for('frame 1:')
            viewer.process.send_signal(signal.SIGINT)
            if status:
                viewer.fail(1, 'gnomon view: interrupted')
            else:
                viewer.succeed()
            assert read_report(bench)['complete'] is False
        lamp = probe(daemon, bench, '--loop')
        lamp.wait_for('environment frame 2')
        lamp.process.send_signal(signal.SIGTERM)
        lamp.succeed()


def test_probe_files():
    """What a probe takes and refuses."""
    setup = {'projection': 'fisheye-equidistant', 'pixel_format': 'log12', 'orientation': [1, 0, 0, 0],
             'response': {'type': 'log', 'a': 0.6, 'b': 0.045, 'c': 0.0001}}
    with Daemon() as daemon, Bench() as bench:
        setup_file = bench.write('setup.json', json.dumps(setup).encode())
        sized = bench.write('sized.json', json.dumps(dict(setup, width=30, height=30)).encode())
        off = bench.write('off.json', json.dumps(dict(setup, center=[900, 900], radius=5)).encode())
        bench.write('log.png', png_bytes(32, 32, b'\x08\x00' * 1024, 1, 16))
        bench.write('bad.png', png_bytes(32, 32, b'\x08\x00' * 1023 + b'\x10\x00', 1, 16))
        bench.write('codes.png', png_bytes(32, 16, bytes(3 * 512)))
        bench.write('wide.exr', exr_bytes(4097, 1, (1, 1, 1)))
        bench.write('no.exr', b'nothing')
        for name, value in (('bright', 3), ('dim', 1)):  # light, or codes, as floats
            bench.write(name + '.exr', exr_bytes(32, 32, (value, 0, 0)))
        status, out, err = probe(daemon, bench, '--setup', setup_file, '--loop', '--count', '2', files='bright.exr').end()
        assert status == 0 and 'environment frame 2' in out and err.count('\n') == 1, (status, out, err)
        assert 'bright has values up to 3, and codes end at 1' in err, err
        probe(daemon, bench, '--setup', setup_file, files='dim.exr').succeed()
        view(daemon, bench, '--count', '1').succeed()  # in that light
        viewer = view(daemon, bench, '--loop', '--rate', '5', out='loop')
        viewer.wait_for('frame 1:')
        for files, more, words in (
                ('bad.png', ['--setup', setup_file], ['bad.png', '4096', '[0, 4095]']),
                ('codes.png', [], ['codes', 'response']),
                ('log.png', ['--setup', sized], ['log is 32x32', '30x30']),
                ('log.png', ['--setup', off], ['does not fit']),
                ('wide.exr', [], ['the server: ', '4097x1', '4096x2048']),
                ('no.exr', [], ['no.exr', 'not a picture']),
                ('none/*.exr', [], ['no file there']),
                ('light.exr', ['--setup', bench.at('none.json')], ['none.json', 'No such file'])):
            probe(daemon, bench, *more, files=files).fail(1, *words)
        viewer.process.send_signal(signal.SIGINT)
        viewer.succeed()


def test_probe_table_and_mask():
    """Codes through a table, a lamp in them masked, are the same light as plain light of 1."""
    codes = bytearray(b'\x75\x30' * 512)  # 30000, which the table calls 1
    for y in range(2, 14):
        codes[2 * (32 * y + 14):2 * (32 * y + 26)] = b'\xff' * 24
    setup = {'projection': 'latlong', 'response': {'type': 'table', 'table': [0, 65535 / 30000]}}
    masked = dict(setup, mask=[{'center': [20, 8], 'radius': 8.7}])
    with Daemon() as daemon, Bench() as bench:
        bench.write('codes.png', png_bytes(32, 16, bytes(codes), 1, 16))
        seen = {}
        for n, (name, files, what) in enumerate((('plain', 'light.exr', None), ('lamp', 'codes.png', setup),
                                                 ('masked', 'codes.png', masked)), 1):
            more = ['--first-sequence', str(n)]
            if what:
                more += ['--setup', bench.write(name + '.json', json.dumps(what).encode())]
            probe(daemon, bench, *more, files=files).succeed()
            view(daemon, bench, '--count', '1', '--sync-light', str(n), out=name).succeed()
            seen[name] = pixel(read_png(bench.at(name + '/f000.png'))[2], 32, 24)
        off = {name: max(abs(a - b) for a, b in zip(seen[name], seen['plain'])) for name in seen}
        assert off['masked'] <= 1 and off['lamp'] > 5, seen


def test_view_files():
    """Camera frames that do not fit, and names of every kind."""
    with Daemon() as daemon, Bench(1) as bench:
        probe(daemon, bench).succeed()
        good = png_bytes(WIDTH, HEIGHT, bench.shots[0])
        for name in ('wide', 'deep', 'broken', 'empty', 'same', 'long', 'raw', 'gray', 'brackets[1]'):
            os.mkdir(bench.at(name))
        bench.write('wide/a.png', good)
        bench.write('wide/b.png', png_bytes(8, 8, bytes(192)))
        bench.write('deep/a.png', png_bytes(WIDTH, HEIGHT, bytes(6 * WIDTH * HEIGHT), 3, 16))
        bench.write('broken/a.png', good[:-30])
        bench.write('empty/notes.txt', b'no picture')
        bench.write('same/a.png', good)
        bench.write('same/a.jpg', good)
        bench.write('brackets[1]/a.png', good)
        bench.write('brackets[1]/notes.txt', b'no picture')
        bench.write('gray/a.png', png_bytes(WIDTH, HEIGHT, noise(1, WIDTH * HEIGHT), 1))
        bench.write('gray/b.png', png_bytes(WIDTH, HEIGHT, noise(1, 4 * WIDTH * HEIGHT), 4))
        bench.write('long/' + 'n' * 251 + '.png', good)
        with open(os.path.join(os.fsencode(bench.at('raw')), b'a\xff\x1b[2J.png'), 'wb') as out:
            out.write(good)
        for files, words in (('wide', ['b is 8x8, but the camera was calibrated at 64x48']),
                             ('deep', ['a is no 8-bit picture']),
                             ('broken', ['a.png']),
                             ('empty', ['no picture in this folder']),
                             ('same', ['a.jpg', 'a.png', 'the same name']),
                             ('light.exr', ['light is no 8-bit picture']),
                             ('nowhere', ['no file there'])):
            view(daemon, bench, files=files).fail(1, *words)
        for files, n in (('long', 1), ('raw', 1), ('brackets[1]', 1), ('gray', 2), ('wide/a.png', 1)):
            view(daemon, bench, files=files, out=files.replace('/', '-') + '-out').succeed()
            assert read_report(bench, files.replace('/', '-') + '-out')['results'] == n
        assert os.listdir(bench.at('raw-out')).count('a??[2J.png') == 1
        big = bench.write('big.json', json.dumps(dict(CAMERA, width=4000, height=3000)).encode())
        bench.write('big.png', png_bytes(4000, 3000, bytes(3 * 12000000)))
        Run('view', server(daemon), '--files', bench.at('big.png'), '--camera', big, '--out',
            bench.at('big')).fail(1, 'the server: ', '4000x3000', '1920x1200')
        view(daemon, bench, out='camera.json').fail(1, 'camera.json', 'Not a directory')
        view(daemon, bench, out='no/such').fail(1, 'no/such', 'No such file')


def test_sequence():
    """A recorded sequence: both commands take their part of it, at its own times."""
    with Daemon() as daemon, Bench(3) as bench:
        camera = {k: v for k, v in CAMERA.items() if k != 'world_from_camera'}
        frames = [{'time_s': 10 + 0.4 * i, 'picture': 'shots/f%03d.png' % i, 'environment': 'light.exr',
                   'world_from_camera': CAMERA['world_from_camera']} for i in range(3)]
        bench.write('sequence.json', json.dumps(
            {'format': 'gnomon-sequence 1', 'camera': camera,
             'environment': {'projection': 'latlong'}, 'frames': frames}).encode())
        probe_out = Run('probe', server(daemon), '--sequence', bench.path).succeed()
        assert '3 environment frames sent' in probe_out
        begin = time.monotonic()
        Run('view', server(daemon), '--sequence', bench.path, '--out', bench.at('out')).succeed()
        assert time.monotonic() - begin >= 0.8
        check_composite(bench, 'f002', bench.shots[2])
        assert read_report(bench)['results'] == 3


def test_doctor_tells_of_light():
    """What is missing while there is no light, then whose it is, how old, and where."""
    def ask(wanted, mark):
        out = Run('doctor', server(daemon)).succeed()
        rows = re.findall(r'^(\w*) +probes +(.*)\n((?:\w* {9,}.*\n)*)', out, re.M)
        assert len(rows) == 1 and rows[0][0] == mark and re.search(wanted, rows[0][1]), (wanted, out)
        return rows[0][2]

    with Daemon() as daemon, Bench() as bench:
        with daemon_probe(daemon) as dark:
            ask('1 connected, and none has sent a frame', 'none')
            light_up(dark, pixels=b'\xff\xd8 and no more', pixel_format=pb.PIXEL_FORMAT_JPEG)
            ask('of 1 environment frames none gave any', 'none')
            light_up(dark, 2, capture_time_ns=time.monotonic_ns() - 100 * 10**9)
            with daemon_probe(daemon):
                lamp = probe(daemon, bench, '--loop', '--rate', '5')
                lamp.wait_for('environment frame 2')
                rest = ask(r'session %d: \d+ lights, (?:1\d\d s|\d+ min) old, at 0\.00, 0\.00, 0\.00 m; nothing newer' %
                           dark.welcome.session_id, 'old')
                assert re.search(r'^(?:ok|old) +session \d+: \d+ lights, .* old.*, where session %d is: the mean '
                                 'of both' % dark.welcome.session_id, rest), rest
                assert re.search(r'^none +1 more connected, without light so far$', rest, re.M), rest
                lamp.process.terminate()
                lamp.end()


def test_doctor():
    with Daemon() as daemon:
        out = Run('doctor', server(daemon)).succeed()
        assert 'FAILED' not in out
        assert re.search('^none +probes +no light since the room was opened: no probe is connected', out, re.M), out
        for word in ("room 'demo'", 'protocol 1', 'round trip', '1920x1200', 'OpenEXR', 'gige',
                     'v4l2', 'video', 'vision', 'window'):
            assert word in out, out
        for part in ('gige', 'v4l2', 'video', 'vision', 'window'):
            rows = re.findall(r'^(ok|none|absent) +%s +(yes|no) +\S' % part, out, re.M)
            assert rows in ([('ok', 'yes')], [('none', 'yes')], [('absent', 'no')]), (part, out)
        page = daemon.http_address
        for where, word in (('127.0.0.1:%d' % page[1], 'not that of its page'),
                            ('127.0.0.1:1', 'is gnomond running')):
            status, out, _ = Run('doctor', '--server', where).end()
            assert status == 1 and 'FAILED' in out and word in out and 'OpenEXR' in out, out
        status, out, _ = Run('doctor', server(daemon), '--room', 'attic').end()
        assert status == 1 and 'its first is demo' in out, out


run_tests([test_frames, test_nothing_virtual_is_told, test_outstanding, test_probe_killed, test_daemon_killed,
           test_daemon_stopped, test_daemon_slow, test_jpeg, test_sync_light, test_several_views,
           test_no_light, test_late_start, test_interrupt, test_probe_files,
           test_probe_table_and_mask, test_view_files,
           test_sequence, test_doctor_tells_of_light, test_doctor])
