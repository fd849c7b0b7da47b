# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""gnomon calibrate with a GigE Vision camera on loopback, which sees what is drawn here.

usage: calibrate_live.py GNOMON FAKE_GIGE
"""
import json
import math
import os
import re
import signal
import subprocess
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
import own_network  # noqa: E402
from folder import Folder  # noqa: E402
from pictures import png_bytes, read_png  # noqa: E402

GNOMON, FAKE = sys.argv[1:3]
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

    def __init__(self, pattern, step_s, width=WIDTH, height=HEIGHT):
        self.process = subprocess.Popen(
            [FAKE, '--width', str(width), '--height', str(height), '--files', pattern, '--step-s',
             str(step_s)], stdout=subprocess.PIPE, text=True)
        assert self.process.stdout.readline() == 'ready\n', 'the camera does not start'

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.communicate()


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
        assert len(os.listdir(f.at('kept'))) == len(VIEWS)
        run('intrinsics', '--files', f.at('kept'), *BOARD, '--out', f.at('again.json'))
        assert read_camera(f.at('again.json')) == found
        with Camera(SHOTS.at('a*.png'), .4):
            err = run(*intrinsics(f, '--keep', f.at('kept')), status=1)
            assert 'pictures are there already' in err, err


def interrupt_at(view, arguments):
    """Ctrl-C when that view is there."""
    process = subprocess.Popen([GNOMON, 'calibrate', *map(str, arguments)], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True)
    for line in process.stdout:
        if line.startswith('view %d of ' % view):
            break
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    return process, err


def test_interrupt():
    """Ctrl-C: what is there is taken where it suffices, else told why not and nothing written."""
    for wanted, status in ((7, 0), (3, 1)):
        with Folder() as f:
            with Camera(SHOTS.at('a*.png'), .4):
                for _ in range(TRIES):
                    process, err = interrupt_at(wanted, intrinsics(f, '--views', 9))
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
                  f.at('probe.json'), status=1)
        assert '--frames is for cameras' in err, err


def test_misuse():
    """Sources that are none, several, or not for this."""
    with Folder() as f:
        for arguments, words in (
                ([], 'one of them'), (['--files', 'x', '--gige', 'any'], 'one of them'),
                (['--files', 'x', '--keep', 'y'], '--views and --keep'),
                (['--files', 'x', '--gain', '1'], 'are for cameras'),
                (['--gige', '127.0.0.1'], 'no GigE Vision camera answers')):
            err = run('intrinsics', *arguments, *BOARD, '--out', f.at('camera.json'), status=1)
            assert words in err, (arguments, err)
        assert os.listdir(f.path) == []


def main():
    tests = [test_intrinsics, test_interrupt, test_probe, test_misuse]
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
