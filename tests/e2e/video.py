# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""gnomon view, probe and screen --video against a real gnomond, with video files written here.

usage: video.py GNOMOND DIRECTORY_OF_GNOMON_PB2 GNOMON yes|no (built with libav)
"""
import json
import os
import random
import subprocess
import sys
import time

sys.path.insert(0, sys.argv[2])
from folder import Folder  # noqa: E402
from gnomond import *  # noqa: E402,F403
from pictures import exr_bytes, read_png, y4m_bytes  # noqa: E402

GNOMON = sys.argv[3]
WIDTH, HEIGHT, N = 64, 48, 5
CAMERA_JSON = {'width': WIDTH, 'height': HEIGHT, 'fx': WIDTH / 2, 'fy': WIDTH / 2, 'cx': WIDTH / 2,
               'cy': HEIGHT / 2, 'distortion': [0, 0, 0, 0, 0],
               'world_from_camera': [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 2, 0, 0, 0, 1]}
COLOURS = [(200, 60, 60), (60, 200, 60), (60, 60, 200), (128, 128, 128), (220, 220, 30)]


def y4m(rate):
    """One colour a picture."""
    return y4m_bytes(WIDTH, HEIGHT, rate, [bytes(colour) * (WIDTH * HEIGHT) for colour in COLOURS])


class Given(Folder):
    def __init__(self):
        super().__init__()
        self.write('camera.json', json.dumps(CAMERA_JSON).encode())
        self.write('light.exr', exr_bytes(32, 16, (1, 1, 1)))
        self.write('v.y4m', y4m(5))


def run(*arguments):
    done = subprocess.run([GNOMON, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          timeout=120, text=True)
    assert 'Sanitizer' not in done.stderr and 'runtime error' not in done.stderr, done.stderr
    return done.returncode, done.stdout, done.stderr


def succeed(*arguments):
    status, out, err = run(*arguments)
    assert status == 0 and err == '', (status, out, err)
    return out


def fail(status, *arguments, words):
    got, out, err = run(*arguments)
    assert got == status and err.count('\n') == 1 and words in err, (got, out, err)


def server(daemon):
    return '--server=%s:%d' % daemon.address


def view(folder, daemon, *more, name='v.y4m'):
    return ('view', server(daemon), '--video', folder.at(name), '--camera',
            folder.at('camera.json'), '--match', 'none', '--out', folder.at('out'), *more)


def light(folder, daemon):
    succeed('probe', server(daemon), '--files', folder.at('light.exr'), '--count', '1')


def test_view():
    """Every picture with its colour, at the file's times."""
    with Given() as folder, Daemon() as daemon:
        light(folder, daemon)
        start = time.monotonic()
        succeed(*view(folder, daemon))
        assert time.monotonic() - start >= .2 * (N - 1)
        assert sorted(os.listdir(folder.at('out'))) == \
            ['v-%06d.png' % (i + 1) for i in range(N)] + ['view.json']
        for i, wanted in enumerate(COLOURS):
            _, _, data = read_png(folder.at('out/v-%06d.png' % (i + 1)))
            assert all(abs(a - b) <= 3 for a, b in zip(data[:3], wanted)), (i, data[:3], wanted)
            middle = 3 * (HEIGHT // 2 * WIDTH + WIDTH // 2)
            assert data[middle:middle + 3] != data[:3], 'no object'


def test_pace():
    with Given() as folder, Daemon() as daemon:
        light(folder, daemon)
        start = time.monotonic()
        succeed(*view(folder, daemon, '--rate', '2'))
        assert time.monotonic() - start >= .5 * (N - 1)
        start = time.monotonic()
        out = succeed(*view(folder, daemon, '--loop', '--count', '8'))
        assert time.monotonic() - start >= .2 * 7 and '8 results' in out, out


def test_probe_and_screen():
    with Given() as folder, Daemon() as daemon:
        video = folder.at('v.y4m')
        setup = folder.write('setup.json', json.dumps(
            {'projection': 'latlong', 'response': {'type': 'srgb'}}).encode())
        out = succeed('probe', server(daemon), '--video', video, '--setup', setup, '--rate', '20')
        assert '%d environment frames sent' % N in out, out
        deadline = time.monotonic() + 20
        while json.loads(daemon.get('/api/v1/status')[1])['rooms'][0]['environment_frames_in'] < N:
            assert time.monotonic() < deadline
            time.sleep(.05)
        fail(1, 'probe', server(daemon), '--video', video, words='holds codes, not light')
        fail(1, 'screen', server(daemon), '--stream', 'tv', '--video', video, words='tv')


def test_refusals():
    with Given() as folder, Daemon() as daemon:
        noise = folder.write('noise.mp4', random.Random(1).randbytes(20000))
        fail(1, *view(folder, daemon, name='noise.mp4'), words='noise.mp4: no video file')
        fail(1, *view(folder, daemon, name='light.exr'), words='light.exr: no video file')
        fail(1, *view(folder, daemon, name='none.mp4'), words='No such file')
        folder.write('cut.y4m', y4m(50)[:-100])
        light(folder, daemon)
        out = succeed(*view(folder, daemon, name='cut.y4m'))  # what is whole in it
        assert '%d results' % (N - 1) in out, out
        for command in ('view', 'probe', 'screen'):
            more = {'view': ('--camera', 'c', '--out', 'o'), 'screen': ('--stream', 's')}
            fail(2, command, '--video', noise, '--files', 'x', *more.get(command, ()),
                 words='one of them' if command != 'view' else 'give --sequence')


def test_absent():
    with Given() as folder, Daemon() as daemon:
        fail(1, *view(folder, daemon), words='libavformat-dev')


run_tests([test_view, test_pace, test_probe_and_screen, test_refusals]
          if sys.argv[4] == 'yes' else [test_absent])
