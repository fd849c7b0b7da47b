# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Runs docs/tutorial.md from its first command to its last, in one folder, and looks at what comes out.
TAP on stdout.

usage: tutorial.py SOURCE_ROOT BUILD_ROOT GNOMON_RIG FAKE_GIGE WORK_FOLDER

What the two cameras see is drawn here or comes from the rig; both are GigE Vision cameras on loopback, so
/dev/video0 is written as one. The window opens where nobody sees it (SDL's driver dummy).
"""
import json
import math
import os
import re
import subprocess
import sys
import time

import numpy

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), '..'))
sys.path[:0] = [ROOT, os.path.join(ROOT, 'e2e')]
import own_network  # noqa: E402
import sequences  # noqa: E402
import shell  # noqa: E402
from chart import CHART  # noqa: E402
from folder import make_folder  # noqa: E402
from live_stage import HEIGHT, WIDTH, load, make_sequence  # noqa: E402
from pictures import png_bytes  # noqa: E402

SOURCE, BUILD, RIG, FAKE, WORK = (os.path.abspath(a) for a in sys.argv[1:6])
TABLE = ('/dev/video0', '127.0.0.2')  # as the page has it, and as it is here
FOCAL = 422.4  # the rig's camera
PROBE = 300
COLUMNS, ROWS = 10, 7
# Of the board: turns about its two sides, where its middle is and how far, in squares.
VIEWS = [(.5, 0, 0, 0, 20), (-.5, .1, -2, -1.4, 22), (0, .5, 2, 1.4, 22), (.1, -.5, -2, 1.4, 22),
         (.4, .4, 2, -1.4, 22), (-.4, .4, 0, .4, 19), (-.3, -.4, .5, -.5, 18), (.6, .2, -1.6, 1, 21),
         (-.2, .6, -1.5, -1, 21), (.3, -.6, 1.5, .8, 21)]


def get_steps():
    """Title and commands of each section that has some."""
    with open(os.path.join(SOURCE, 'docs/tutorial.md'), encoding='utf-8') as f:
        sections = re.split('^## ', f.read(), flags=re.M)[1:]
    return [(s.split('\n')[0], block) for s in sections for block in shell.get_blocks(s)]


def draw_board(view):
    """The chessboard through the rig's camera, edges blurred over a pixel."""
    a, b, x0, y0, z0 = view
    u = numpy.array((math.cos(b), math.sin(a) * math.sin(b), -math.cos(a) * math.sin(b)))
    v = numpy.array((0, math.cos(a), math.sin(a)))
    n, t = numpy.cross(u, v), numpy.array((x0, y0, z0))
    py, px = numpy.mgrid[:HEIGHT, :WIDTH]
    rays = numpy.stack(((px + .5 - WIDTH / 2) / FOCAL, (py + .5 - HEIGHT / 2) / FOCAL,
                        numpy.ones(px.shape)), -1)
    s = (n @ t) / (rays @ n)
    p = s[..., None] * rays - t
    x, y = p @ u + COLUMNS / 2, p @ v + ROWS / 2
    wide = FOCAL / s  # pixels of a square
    cx, cy = (numpy.clip((.5 - abs(w % 2 - 1)) * wide, -.5, .5) for w in (x + .5, y + .5))
    inside = numpy.clip(numpy.minimum(numpy.minimum(x, COLUMNS - x), numpy.minimum(y, ROWS - y)) * wide + .5, 0, 1)
    ink = 1 - inside * (.5 + 2 * cx * cy)
    grain = numpy.random.default_rng(1).integers(0, 3, px.shape)
    return png_bytes(WIDTH, HEIGHT, (40 + 170 * ink + grain).astype('u1').tobytes(), 1)


def light_bytes(light):
    """light[y][x][3], full scale 1 at the camera's 10 ms."""
    height, width, _ = light.shape
    return png_bytes(width, height, numpy.rint(65535 * light).astype('>u2').tobytes(), 3, 16)


def draw_scene():
    """Anything with many shades."""
    y, x = numpy.mgrid[:HEIGHT, :WIDTH]
    return light_bytes(numpy.minimum(0.05 * 1.0094 ** x * (1 + y / 400), 1)[..., None].repeat(3, 2))


def draw_chart():
    light, patch = numpy.full((PROBE, PROBE, 3), .03), 46
    for i, color in enumerate(CHART):
        x, y = 14 + patch * (i % 6), 58 + patch * (i // 6)
        light[y:y + 41, x:x + 41] = color
    return light_bytes(light)


class Desk:
    """The folder, and all that runs in it."""

    def __init__(self):
        self.path = make_folder('desk')
        self.work = make_folder('cameras')
        self.running = []
        path = ':'.join(os.path.join(BUILD, d) for d in ('server', 'client'))
        self.env = dict(os.environ, PATH=path + ':' + os.environ['PATH'], SDL_VIDEODRIVER='dummy')
        self.table, self.lamps = make_sequence(RIG, WORK), sequences.make(RIG, WORK, 'lamps')
        self.probe = load(os.path.join(self.lamps, 'sequence.json'))['environment']
        for i, view in enumerate(VIEWS):
            self.write('board%d.png' % i, draw_board(view))
        self.write('scene.png', draw_scene())
        self.write('chart.png', draw_chart())

    def at(self, name):
        return os.path.join(self.path, name)

    def write(self, name, data):
        """What cameras see is not in the reader's folder."""
        with open(os.path.join(self.work, name), 'wb') as out:
            out.write(data)

    def show(self, address, size, files, *more):
        """A camera that sees the files."""
        camera = subprocess.Popen([FAKE, '--address', address, '--width', str(size[0]), '--height', str(size[1]),
                                   '--files', os.path.join(self.work, files), *map(str, more)], stdout=subprocess.PIPE, text=True)
        self.running.append(camera)
        assert camera.stdout.readline() == 'ready\n', 'the camera does not start'

    def show_table(self, files, *more):
        self.show(TABLE[1], (WIDTH, HEIGHT), files, *more)

    def show_probe(self, files, *more):
        self.show('127.0.0.1', (PROBE, PROBE), files, *more)

    def run(self, block, until=None):
        """What was printed."""
        block = block.replace('--v4l2 ' + TABLE[0], '--gige ' + TABLE[1])
        assert TABLE[0] not in block, 'a camera that this test does not know: ' + block
        # Calibrating at the cameras' own 25 pictures a second takes a minute.
        block = re.sub(r'(gnomon calibrate \w+ --gige \S+)', r'\1 --frame-rate 100', block)
        return shell.run(block, self.path, self.env, until, 100)

    def end(self):
        for camera in self.running:
            camera.kill()
            camera.communicate()
        self.running = []


def step_print(desk, block):
    desk.show_probe('chart.png')
    text = desk.run(block)
    assert 'FAILED server' in text and re.search(r'^ok +gige +yes .*127.0.0.1$', text, re.M), 'what doctor says'
    assert {'board.svg', 'marker.svg'} <= set(os.listdir(desk.path))


def step_lens(desk, block):
    desk.show_table('board?.png', '--step-s', .4)
    desk.run(block)
    found = load(desk.at('camera.json'))
    for key, value in (('fx', FOCAL), ('fy', FOCAL), ('cx', WIDTH / 2), ('cy', HEIGHT / 2)):
        assert abs(found[key] / value - 1) < .015, (key, found[key])


def step_response(desk, block):
    desk.show_table('scene.png', '--response', 'srgb')
    desk.run(block)
    found = load(desk.at('camera.json'))
    assert found['response']['type'] == 'srgb' and 'fx' in found, found


def step_probe_response(desk, block):
    r = desk.probe['response']
    desk.show_probe('chart.png', '--chunks', '--response', 'log:%(a).17g,%(b).17g,%(c).17g' % r, '--noise', 1)
    desk.run(block)
    found = load(desk.at('probe.json'))['response']
    for i in range(-15, 16):
        x = 10 ** (i / 10)
        seen = math.exp((r['a'] + r['b'] * math.log(r['c'] + x) - found['a']) / found['b']) - found['c']
        assert abs(seen / x - 1) < .05, (x, seen, found)


def step_orientation(desk, block):
    desk.show_probe(os.path.join(desk.lamps, 'env/fisheye-3.png'))
    desk.run(block)
    q, p = load(desk.at('probe.json'))['orientation'], desk.probe['orientation']
    off = 2 * math.degrees(math.acos(min(1, abs(sum(a * b for a, b in zip(q, p))))))
    print('# the probe looks %.2f degrees off' % off)
    assert off < 1, off


def step_scene(desk, block):
    desk.run(block)


def step_together(desk, block):
    frame = load(os.path.join(desk.table, 'sequence.json'))['frames'][-1]
    desk.show_table(os.path.join(desk.table, frame['picture']))
    desk.show_probe(os.path.join(desk.lamps, 'env/fisheye-3.png'))
    out = desk.at('composites')
    desk.run(block, lambda: os.path.isdir(out) and len([n for n in os.listdir(out) if n.endswith('.png')]) > 4)
    report = load(os.path.join(out, 'view.json'))
    assert report['results'] > 3 and all(f['receipt']['lights'] > 0 for f in report['frames']
                                         if f['outcome'] == 'result'), report
    true = numpy.array(frame['world_from_camera_true']).reshape(4, 4)
    with open(os.path.join(out, 'poses.jsonl')) as lines:
        bodies = [json.loads(line)['bodies'] for line in lines]
    pose = numpy.linalg.inv(numpy.array(bodies[-1][0]['camera_from_body']).reshape(4, 4))
    off = 1e3 * numpy.linalg.norm(pose[:3, 3] - true[:3, 3])
    print('# the camera %.1f mm off, of %.0f' % (off, 1e3 * numpy.linalg.norm(true[:3, 3])))
    assert all(len(b) == 1 for b in bodies) and off < 15, off


STEPS = [step_print, step_lens, step_response, step_probe_response, step_orientation, step_scene, step_together]


def main():
    own_network.enter()
    steps = get_steps()
    assert len(steps) == len(STEPS), [title for title, _ in steps]
    print('1..%d' % len(steps))
    desk, failed = Desk(), 0
    try:
        for n, ((title, block), check) in enumerate(zip(steps, STEPS), 1):
            begin = time.monotonic()
            try:
                check(desk, block)
                print('ok %d - %s (%.1f s)' % (n, title, time.monotonic() - begin))
            except (AssertionError, OSError, KeyError, RuntimeError) as fault:
                failed = 1
                print('# %s\nnot ok %d - %s' % (repr(fault).replace('\n', '\n# '), n, title))
            desk.end()
    finally:
        desk.end()
    return failed


sys.exit(main())
