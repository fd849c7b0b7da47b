# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""gnomon calibrate with a GigE Vision camera on loopback, which sees what is drawn here.

usage: calibrate_live.py GNOMON FAKE_GIGE FISHEYE_SHOTS
"""
import json
import math
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
import own_network  # noqa: E402
from chart import CHART  # noqa: E402
from folder import Folder  # noqa: E402
from pictures import png_bytes, read_png  # noqa: E402

GNOMON, FAKE, FISHEYE_SHOTS = sys.argv[1:4]
WIDTH, HEIGHT, FOCAL, CENTRE = 240, 180, 220, (118.3, 91.6)
COLUMNS, ROWS = 7, 6
# A machine that stands still for a second does not answer for its camera.
TRIES, NO_ANSWER = 3, 'no GigE Vision camera answers'
BOARD = ['--board', '%dx%d' % (COLUMNS, ROWS), '--square-pixels']
# Of the board: turns about its two sides, and where its middle is, in squares.
VIEWS = [(.5, 0, 0, 0, 11), (-.5, .1, -1.4, -.8, 11), (0, .5, 1.4, 1, 11), (.1, -.5, -1.4, 1, 11),
         (.4, .4, 1.5, -.8, 11), (-.4, .4, 0, .4, 10), (-.3, -.4, 0, -.5, 10)]


class Camera:
    """Serves the folder's pictures that match, each for step_s, in turn."""

    def __init__(self, pattern, step_s, *more, width=WIDTH, height=HEIGHT):
        self.process = subprocess.Popen(
            [FAKE, '--width', str(width), '--height', str(height), '--files', pattern, '--step-s',
             str(step_s), *more], stdout=subprocess.PIPE, text=True)
        assert self.process.stdout.readline() == 'ready\n', 'the camera does not start'

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.said, _ = self.process.communicate()

    def get_settings(self):
        """Exposure, us, and automatic gain (1: off, 2: continuous) when it ended."""
        return tuple(map(int, re.search(r'exposure of (\d+) us, automatic gain (\d)', self.said).groups()))


def read_end(err):
    """What went wrong, one line; a machine that stood still may have lost the camera meanwhile."""
    lines = [line for line in err.splitlines() if not re.search('camera 127.0.0.1: (lost: .*|back|another '
                                                                'program controls it.*)$', line)]
    assert len(lines) == 1, err
    return lines[0]


def run(*arguments, status=0):
    for _ in range(TRIES):
        done = subprocess.run([GNOMON, 'calibrate', *map(str, arguments)], stdin=subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=100, text=True)
        if status != 0 or NO_ANSWER not in done.stderr:
            break
    assert done.returncode == status, (arguments, done.returncode, done.stdout, done.stderr)
    return done.stdout if status == 0 else read_end(done.stderr)


def draw_board(view, noise):
    """A chessboard through a pinhole, edges blurred over a pixel, 8 bits, gray."""
    a, b, x0, y0, z0 = view
    # Columns: the board's x and y axes in the camera, and its middle.
    u = (math.cos(b), math.sin(a) * math.sin(b), -math.cos(a) * math.sin(b))
    v = (0, math.cos(a), math.sin(a))
    n = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    t = (x0, y0, z0)
    height = sum(i * j for i, j in zip(n, t))
    out = bytearray()
    for py in range(HEIGHT):
        dy = (py + .5 - CENTRE[1]) / FOCAL
        for px in range(WIDTH):
            dx = (px + .5 - CENTRE[0]) / FOCAL
            s = height / (n[0] * dx + n[1] * dy + n[2])
            p = (s * dx - t[0], s * dy - t[1], s - t[2])
            x = p[0] * u[0] + p[1] * u[1] + p[2] * u[2] + COLUMNS / 2
            y = p[0] * v[0] + p[1] * v[1] + p[2] * v[2] + ROWS / 2
            ink = 1.
            if -.1 < x < COLUMNS + .1 and -.1 < y < ROWS + .1:
                # A wave that crosses 0 at each edge, as steep as a pixel is wide.
                wide = FOCAL / s
                inside = min(x, COLUMNS - x, y, ROWS - y) * wide
                cx, cy = (min(max((.5 - abs(w % 2 - 1)) * wide, -.5), .5) for w in (x + .5, y + .5))
                ink = 1 - min(max(inside + .5, 0), 1) * (.5 + 2 * cx * cy)
            out.append(int(40 + 170 * ink + (px * 7 + py * 13 + noise * 5) % 3))
    return png_bytes(WIDTH, HEIGHT, bytes(out), 1)


def write_views(folder):
    """The views; another of one, little apart; one picture without a board."""
    for i, view in enumerate(VIEWS):
        folder.write('a%d.png' % i, draw_board(view, i))
    a, b, x, y, z = VIEWS[2]
    folder.write('a2b.png', draw_board((a + .02, b, x + .1, y, z), 50))
    folder.write('a4b.png', png_bytes(WIDTH, HEIGHT, bytes([90]) * (WIDTH * HEIGHT), 1))


def read_camera(path):
    with open(path) as f:
        return json.load(f)


def intrinsics(folder, *more):
    return ['intrinsics', '--gige', '127.0.0.1', '--frame-rate', 25, *BOARD, '--out',
            folder.at('camera.json'), *more]


def test_intrinsics():
    """One view of each way the board was held, the lens as it is, and again from what was kept."""
    with Folder() as f:
        with Camera(SHOTS.at('a*.png'), .4):
            out = run(*intrinsics(f, '--views', len(VIEWS), '--keep', f.at('kept')))
        lines = re.findall(r'^view (\d+) of (\d+): \d+ corners; in (\d+) % of the picture', out, re.M)
        assert [line[:2] for line in lines] == [(str(i + 1), '7') for i in range(7)], out
        shares = [int(line[2]) for line in lines]
        assert shares == sorted(shares) and shares[0] < 40 < shares[-1], out
        assert 'still few or none: top left' in out, out
        found = read_camera(f.at('camera.json'))
        for key, value in (('fx', FOCAL), ('fy', FOCAL), ('cx', CENTRE[0]), ('cy', CENTRE[1])):
            assert abs(found[key] / value - 1) < .015, (key, found[key], value)
        assert 'world_from_camera' not in found and 'where the camera is it does not say' in out, out
        assert len(os.listdir(f.at('kept'))) == len(VIEWS)
        run('intrinsics', '--files', f.at('kept'), *BOARD, '--out', f.at('again.json'))
        assert read_camera(f.at('again.json')) == found
        with Camera(SHOTS.at('a*.png'), .4):
            err = run(*intrinsics(f, '--keep', f.at('kept')), status=1)
            assert 'pictures are there already' in err, err


def interrupt_at(start, arguments, number=signal.SIGINT):
    """A signal, Ctrl-C's for example, at the line that begins so."""
    process = subprocess.Popen([GNOMON, 'calibrate', *map(str, arguments)], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True)
    for line in process.stdout:
        if line.startswith(start):
            break
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    return process, err


def test_interrupt():
    """Ctrl-C: what is there is taken where it suffices, else told why not and nothing written."""
    for wanted, status in ((7, 0), (3, 1)):
        with Folder() as f:
            with Camera(SHOTS.at('a*.png'), .4):
                for _ in range(TRIES):
                    process, err = interrupt_at('view %d of ' % wanted, intrinsics(f, '--views', 9))
                    if NO_ANSWER not in err:
                        break
            assert process.returncode == status, (process.returncode, err)
            assert os.path.exists(f.at('camera.json')) == (status == 0)
            assert status == 0 or 'at least 5 are needed' in read_end(err), err


def test_probe():
    """A ball in the mean of pictures; a square that only every second has is half as dark there."""
    def draw(square):
        def pixel(x, y):
            if math.hypot(x + .5 - 122.4, y + .5 - 88.2) < 60.6:
                return 90
            return square if x < 20 and y < 20 else 220 - (x + y) % 3
        return png_bytes(WIDTH, HEIGHT, bytes(pixel(x, y) for y in range(HEIGHT) for x in range(WIDTH)), 1)
    with Folder() as f:
        f.write('a.png', draw(90))
        f.write('b.png', draw(220))
        with Camera(f.at('?.png'), 0):
            run('probe', '--gige', '127.0.0.1', '--frame-rate', 25, '--frames', 8, '--projection',
                'mirrorball', '--ball', '118,92,57', '--out', f.at('probe.json'), '--picture',
                f.at('found.png'))
        width, _, pixels = read_png(f.at('found.png'))
        assert 20 < pixels[3 * (10 * width + 10)] < 235, pixels[3 * (10 * width + 10)]
        found = read_camera(f.at('probe.json'))
        assert math.dist(found['center'], (122.4, 88.2)) < .5, found
        assert abs(found['radius'] / math.sin(found['theta_max'] / 2) - 60.6) < .5, found
        err = run('probe', '--files', f.at('a.png'), '--frames', 2, '--ball', '118,92,57', '--out',
                  f.at('probe.json'), status=2)
        assert '--frames is for cameras' in err, err


def light_picture(color):
    """16 bits, color(x, y) R, G, B, full scale 1 at the camera's 10 ms."""
    return png_bytes(WIDTH, HEIGHT, b''.join(struct.pack('>3H', *(round(65535 * v) for v in color(x, y)))
                                             for y in range(HEIGHT) for x in range(WIDTH)), 3, 16)


def draw_chart(x, y):
    u, v = (x + .5 - 12) / 36, (y + .5 - 18) / 36
    if 0 <= u < 6 and 0 <= v < 4 and abs(u % 1 - .5) < .45 and abs(v % 1 - .5) < .45:
        return CHART[6 * int(v) + int(u)]
    return .03, .03, .03


A, B, C = .55, .05, 2e-4
CURVE = ['--response', 'log:%g,%g,%g' % (A, B, C), '--noise', '2']


def response(folder, *more, pixels='RGB12', rate=30):
    return ['response', '--gige', '127.0.0.1', '--frame-rate', rate, '--pixel-format', pixels, '--out',
            folder.at('probe.json'), *more]


def find_worst(path, decades):
    """The written curve against the camera's, light decades about 1."""
    r = read_camera(path)['response']
    worst = 0
    for i in range(-100, 101):
        x = 10 ** (decades / 2 * i / 100)
        found = math.exp((A + B * math.log(C + x) - r['a']) / r['b']) - r['c']
        worst = max(worst, abs(found / x - 1))
    return worst


def test_chart():
    """A log sensor from 10 us to 10 s; its settings are back, and what was saved says the same."""
    with Folder() as f:
        f.write('light.png', light_picture(draw_chart))
        with Camera(f.at('light.png'), 0, '--chunks', *CURVE) as camera:
            out = run(*response(f, '--exposures', '10,.01,1/7,1,100,1000,10000ms', '--controls',
                                'GainAuto=Continuous', '--keep', f.at('shots')))
        assert camera.get_settings() == (10000, 2), camera.said
        times = re.findall(r'^exposure (\d) of 7: (\S+) us.*: mean of 8, noise ([\d.]+) codes of 4095', out, re.M)
        assert [float(t) for _, t, _ in times] == [1e4, 10, 142, 1e3, 1e5, 1e6, 1e7], out
        assert '142 us (asked 142.857): ' in out, out
        # Codes are cut to whole ones: 1/12 more.
        assert all(abs(float(noise) - math.sqrt(4 + 1 / 12)) < .05 for _, _, noise in times), out
        worst = [find_worst(f.at('probe.json'), decades) for decades in (4, 6)]
        print('# log curve: worst %.2f %% of four decades, %.2f %% of six' % tuple(100 * w for w in worst))
        assert worst[0] < .03 and worst[1] < .08, worst
        again = re.search(r'again by (.*)$', out, re.M).group(1).replace("'", '').split()
        run('response', *again, '--out', f.at('again.json'))
        assert read_camera(f.at('again.json')) == read_camera(f.at('probe.json'))


def test_stack():
    """An 8-bit camera that does not say what exposure a picture has; exposures of its own choice."""
    with Folder() as f:
        f.write('light.png', light_picture(lambda x, y: 3 * (min(.0004 * 1.033 ** x * (1 + y / 400), 1),)))
        with Camera(f.at('light.png'), 0, '--response', 'srgb') as camera:
            out = run(*response(f, '--live', 'stack', '--exposures', 'auto', '--frames', 2,
                                pixels='RGB8'))
        assert camera.get_settings()[0] == 10000, camera.said
        times = [float(t) for t in re.findall(r'^(\S+) us: mean of 2.*clipped$', out, re.M)]
        assert times[0] == 1e4 and all(b == 2 * a for a, b in zip(times[1:], times[2:])), out
        assert 'too dark, left out' in out and times[1] < 1e3 and 1e4 < times[-1] < 1e6, times
        table = read_camera(f.at('probe.json'))['response']['table']
        # The camera cuts its 12 bits to 8: a code stands for the middle of 16 of them.
        true = [(((16 * z + 7.5) / 4095 + .055) / 1.055) ** 2.4 for z in range(256)]
        worst = max(abs(table[z] / table[128] * true[128] / true[z] - 1) for z in range(15, 246))
        print('# table against sRGB, worst %.2f %% of codes 15 to 245' % (100 * worst))
        assert len(table) == 256 and worst < .03


def test_response_ends():
    """Ctrl-C, and exposures that cannot be: the camera's settings are back, nothing is written."""
    with Folder() as f:
        f.write('light.png', light_picture(draw_chart))
        with Camera(f.at('light.png'), 0, '--chunks', *CURVE) as camera:
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                for _ in range(TRIES):
                    process, err = interrupt_at('exposure 2 of 3', response(
                        f, '--exposures', '10,20,40ms', '--frames', 50, '--controls', 'GainAuto=Continuous'),
                        number)
                    if NO_ANSWER not in err:
                        break
                assert process.returncode == 1 and 'interrupted after' in read_end(err), (process.returncode, err)
            for exposures, words in (('10,20000ms', '2e+07 us is not in [10, 1e+07] us'),
                                     ('1,2,4', 'its exposure is set by times, not by counts: give a unit'),
                                     ('1ms,2', 'as 1,2,4,8ms'), ('1,2parsecs', 'as 1,2,4,8ms'),
                                     ('0ms', 'as 1,2,4,8ms')):
                err = run(*response(f, '--exposures', exposures), status=1)
                assert words in err, (exposures, err)
            err = run(*response(f, '--live', 'stack', '--exposures', 33 * '1,' + '1ms'), status=1)
            assert 'right would be up to 32 times' in err, err
        assert camera.get_settings() == (10000, 2), camera.said
        for more, words in (([], 'a camera needs --exposures'),
                            (['--exposures', '1ms', '--times', '1'], 'no --times'),
                            (['--exposures', '1ms', '--chart', 'x'], 'one of them'),
                            (['--exposures', '1ms', '--bayer', 'rggb'], '--bayer is for files')):
            err = run(*response(f, *more), status=2)
            assert words in err, (more, err)
        err = run('response', '--chart', 'x', '--keep', 'y', '--out', f.at('probe.json'), status=2)
        assert '--keep are for cameras' in err, err
        assert os.listdir(f.path) == ['light.png']


def test_camera_comes_back():
    """Gone in the middle of an exposure, and back with its own: not a picture of that counts."""
    with Folder() as f:
        f.write('light.png', light_picture(draw_chart))
        with Camera(f.at('light.png'), 0, *CURVE):
            process = subprocess.Popen(
                [GNOMON, 'calibrate', *map(str, response(
                    f, '--exposures', '10,100ms', '--frames', 30, '--controls',
                    'GainAuto=Continuous', rate=15))], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            head = ''
            for line in process.stdout:
                head += line
                if line.startswith('exposure 1 of 2'):
                    break
            time.sleep(1.2)  # into the second
        with Camera(f.at('light.png'), 0, *CURVE) as camera:
            out, err = process.communicate(timeout=100)
        assert process.returncode == 0, (process.returncode, err)
        assert 'back' in err, err
        steady = [float(codes) for codes in re.findall(r'level steady to ([\d.]+)', head + out)]
        assert len(steady) == 2 and max(steady) < 5, out
        assert camera.get_settings() == (10000, 2), camera.said


def test_probe_sees_marker():
    """A fisheye with a marker in it, the mean of 12-bit pictures, is as good as the file."""
    markers = {'dictionary': '4x4_50', 'bodies': [{'name': 'world', 'markers': [{'id': 7, 'size': .1}]},
                                                  {'name': 'post', 'markers': [{'id': 20, 'size': .1}]}]}
    with Folder() as f:
        f.write('markers.json', json.dumps(markers).encode())
        subprocess.run([FISHEYE_SHOTS, f.at('markers.json'), f.path], check=True, capture_output=True)
        shutil.copy(f.at('probe.json'), f.at('files.json'))
        common = ['--find-circle', '--projection', 'fisheye-equidistant', '--markers', f.at('markers.json')]
        run('probe', '--files', f.at('near-0.png'), *common, '--out', f.at('files.json'))
        with Camera(f.at('near-0.png'), 0, width=480, height=480):
            out = run('probe', '--gige', '127.0.0.1', '--pixel-format', 'Mono12', '--frames', 3, *common,
                      '--out', f.at('probe.json'))
        assert 'camera: 2 markers' in out, out
        for a, b in zip(*(read_camera(f.at(name))['orientation'] for name in ('files.json', 'probe.json'))):
            assert abs(a - b) < 1e-6, (a, b)


def test_misuse():
    """Sources that are none, several, or not for this."""
    with Folder() as f:
        for status, arguments, words in (
                (2, [], 'one of them'), (2, ['--files', 'x', '--gige', 'any'], 'one of them'),
                (2, ['--files', 'x', '--keep', 'y'], '--views and --keep'),
                (2, ['--files', 'x', '--gain', '1'], 'are for cameras'),
                (1, ['--gige', '127.0.0.1'], 'no GigE Vision camera answers')):
            err = run('intrinsics', *arguments, *BOARD, '--out', f.at('camera.json'), status=status)
            assert words in err, (arguments, err)
        assert os.listdir(f.path) == []


def main():
    tests = [test_intrinsics, test_interrupt, test_probe, test_probe_sees_marker, test_chart, test_stack,
             test_camera_comes_back, test_response_ends, test_misuse]
    print('1..%d' % len(tests))
    failed = 0
    for number, test in enumerate(tests, 1):
        begin = time.monotonic()
        try:
            test()
            print('ok %d - %s (%.1f s)' % (number, test.__name__[5:], time.monotonic() - begin))
        except AssertionError as fault:
            failed += 1
            print('# %s\nnot ok %d - %s' % (str(fault).replace('\n', '\n# '), number, test.__name__[5:]))
    return 1 if failed else 0


own_network.enter()
with Folder() as SHOTS:
    write_views(SHOTS)
    STATUS = main()
sys.exit(STATUS)
