# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""gnomon view --window on a virtual screen: real keys, and the screen's own pixels.

usage: window.py GNOMOND DIRECTORY_OF_GNOMON_PB2 GNOMON
"""
import json
import os
import random
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, sys.argv[2])
from gnomond import Daemon, light_up, probe, run_tests  # noqa: E402
from pictures import png_bytes, read_png  # noqa: E402

GNOMON = os.path.abspath(sys.argv[3])
WIDTH, HEIGHT = 320, 240
# 1 m above the floor, looking down: the cube is in the middle, floor all around.
CAMERA = {'width': WIDTH, 'height': HEIGHT, 'fx': WIDTH, 'fy': WIDTH, 'cx': WIDTH / 2,
          'cy': HEIGHT / 2, 'distortion': [0, 0, 0, 0, 0],
          'world_from_camera': [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 1, 0, 0, 0, 1]}
SHOT = random.Random(7).getrandbits(24 * WIDTH * HEIGHT).to_bytes(3 * WIDTH * HEIGHT, 'little')
ON_CUBE, BESIDE_CUBE = (160, 120), (108, 120)
# What the keys have done is said for a while in the rows below these bytes.
UPPER = 3 * WIDTH * 200
TRIES_S = 60  # generous: the machine may be busy with other tests


def wait_for(what, look, timeout=TRIES_S):
    """What look() gives once it is something."""
    deadline = time.monotonic() + timeout
    while True:
        got = look()
        if got:
            return got
        assert time.monotonic() < deadline, 'never: ' + what
        time.sleep(0.03)


# libdbus and what SDL loads by itself leave memory behind; our own leaks show in client.py.
ENVIRONMENT = dict(os.environ, ASAN_OPTIONS=os.environ.get('ASAN_OPTIONS', '') + ':detect_leaks=0')


class Screen:
    """An X server whose frame buffer is a file: XWD, as its XWDFile.h has it."""

    def __init__(self, width=800, height=600):
        self.path = tempfile.mkdtemp(prefix='gnomon-screen.')
        ours, its = os.pipe()
        self.process = subprocess.Popen(
            ['Xvfb', '-displayfd', str(its), '-screen', '0', '%dx%dx24' % (width, height),
             '-nolisten', 'tcp', '-noreset', '-fbdir', self.path], pass_fds=[its], stderr=subprocess.DEVNULL)
        os.close(its)
        with os.fdopen(ours) as end:
            number = end.readline().strip()
        assert number.isdigit(), 'Xvfb did not start: %r' % number
        self.display = ':' + number
        self.env = dict(ENVIRONMENT, DISPLAY=self.display, SDL_RENDER_DRIVER='software')
        self.env.pop('SDL_VIDEODRIVER', None)
        self.env.pop('WAYLAND_DISPLAY', None)
        wait_for('the screen', lambda: self.do('getdisplaygeometry'))

    def read(self, x, y, width, height):
        """Pixels as R, G, B."""
        with open(self.path + '/Xvfb_screen0', 'rb') as f:
            data = f.read()
        head = struct.unpack('>25I', data[:100])
        start, stride = head[0] + 12 * head[19], head[12]
        out = bytearray(3 * width * height)
        for row in range(height):
            at = start + (y + row) * stride + 4 * x
            for k in range(3):  # stored B, G, R and a byte of nothing
                out[3 * width * row + k:3 * width * (row + 1):3] = \
                    data[at + 2 - k:at + 4 * width:4]
        return bytes(out)

    def do(self, *arguments):
        return subprocess.run(['xdotool', *map(str, arguments)], env=self.env, timeout=TRIES_S,
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout.decode()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()
        shutil.rmtree(self.path)


class View:
    """gnomon view in a folder of its own, and its window if there is a screen."""

    def __init__(self, address, *more, screen=None, env=None):
        self.path = tempfile.mkdtemp(prefix='gnomon-window-test.')
        self.screen, self.id = screen, None
        os.mkdir(self.at('shots'))
        with open(self.at('camera.json'), 'w') as out:
            json.dump(CAMERA, out)
        with open(self.at('shots/shot.png'), 'wb') as out:
            out.write(png_bytes(WIDTH, HEIGHT, SHOT))
        self.out, self.err = open(self.at('stdout'), 'w'), open(self.at('stderr'), 'w')
        self.process = subprocess.Popen(
            [GNOMON, 'view', '--server=%s:%d' % address, '--files', 'shots', '--camera', 'camera.json',
             '--window', *more], cwd=self.path, stdout=self.out, stderr=self.err,
            env=screen.env if screen else env)
        if screen:
            self.id = int(wait_for('a window', self.find).split()[0])
            screen.do('windowfocus', self.id)

    def find(self):
        assert self.process.poll() is None and not self.read('stderr'), self.read('stderr')
        return self.screen.do('search', '--onlyvisible', '--name', '^gnomon: room demo')

    def at(self, name):
        return os.path.join(self.path, name)

    def read(self, name):
        with open(self.at(name), errors='replace') as f:
            return f.read()

    def press(self, key):
        self.screen.do('key', key)

    def get_box(self):
        text = self.screen.do('getwindowgeometry', '--shell', self.id)
        values = dict(line.split('=') for line in text.splitlines())
        return tuple(int(values[name]) for name in ('X', 'Y', 'WIDTH', 'HEIGHT'))

    def see(self):
        """Width, height and pixels of the window."""
        x, y, width, height = self.get_box()
        return width, height, self.screen.read(x, y, width, height)

    def resize(self, width, height):
        self.screen.do('windowsize', self.id, width, height)
        wait_for('the new size', lambda: self.get_box()[2:] == (width, height))

    def end(self, timeout=TRIES_S):
        """Exit status, standard output and standard error; the folder stays."""
        try:
            status = self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise AssertionError('did not end: ' + self.read('stdout') + self.read('stderr'))
        self.out.close()
        self.err.close()
        out, err = self.read('stdout'), self.read('stderr')
        assert 'Sanitizer' not in err and 'runtime error' not in err, err
        return status, out, err

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self.out.close()
        self.err.close()
        shutil.rmtree(self.path)


def lit(listen='127.0.0.1:0'):
    """A room whose picture, once its light is there, does not change by itself."""
    return Daemon('refine = false', listen=listen)


def pixel(data, at, width=WIDTH):
    return data[3 * (at[1] * width + at[0]):][:3]


def enlarge(data, times):
    rows = [data[3 * WIDTH * y:3 * WIDTH * (y + 1)] for y in range(HEIGHT)]
    return b''.join(b''.join(row[3 * x:3 * x + 3] * times for x in range(WIDTH)) * times
                    for row in rows)


def find_differences(a, b, width):
    """The box of the pixels that differ: x0, y0, x1, y1, the last ones outside; None: none."""
    stride, xs, ys = 3 * width, set(), set()
    for at in range(0, len(a), stride):
        x, y = a[at:at + stride], b[at:at + stride]
        if x != y:
            ys.add(at // stride)
            xs.update(i // 3 for i in range(stride) if x[i] != y[i])
    return (min(xs), min(ys), max(xs) + 1, max(ys) + 1) if xs else None


class Watch:
    """A view at one pixel a pixel, and what it shows undisturbed."""

    def __init__(self, view):
        self.view = view
        view.resize(WIDTH, HEIGHT)

    def wait(self, what, claim):
        """The window's pixels once the claim holds of them."""
        def look():
            width, height, data = self.view.see()
            return data if (width, height) == (WIDTH, HEIGHT) and claim(data) else None
        try:
            return wait_for(what, look)
        except AssertionError:
            with tempfile.NamedTemporaryFile(prefix='gnomon-window-test.', suffix='.png',
                                             delete=False) as out:
                out.write(png_bytes(*self.view.see()))
            print('# the window is kept in ' + out.name)
            raise

    def wait_composite(self):
        """Until the window shows what the server sent, to the bit, and that is a composite."""
        def claim(data):
            path = self.view.at('out/shot.png')
            return os.path.exists(path) and data == read_png(path)[2] != SHOT
        return self.wait('the composite on the screen', claim)


def test_picture_and_toggles():
    """What the screen shows is what came, to the bit; s and v change it as they say."""
    with lit() as daemon, probe(daemon) as light, Screen() as screen:
        light_up(light)
        with View(daemon.address, '--out', 'out', '--loop', '--rate', '10', screen=screen) as view:
            assert view.get_box()[2:] == (2 * WIDTH, 2 * HEIGHT), view.get_box()
            wait_for('the enlarged composite', lambda: os.path.exists(view.at('out/shot.png')) and
                     view.see()[2] == enlarge(read_png(view.at('out/shot.png'))[2], 2))
            watch = Watch(view)
            whole = watch.wait_composite()
            assert pixel(whole, ON_CUBE) != pixel(SHOT, ON_CUBE)
            assert pixel(whole, BESIDE_CUBE) != pixel(SHOT, BESIDE_CUBE)

            view.press('s')  # the cube alone
            watch.wait('no shadow', lambda d: pixel(d, BESIDE_CUBE) == pixel(SHOT, BESIDE_CUBE) and
                       pixel(d, ON_CUBE) == pixel(whole, ON_CUBE))
            view.press('v')  # nothing
            watch.wait('the camera\'s picture', lambda d: d[:UPPER] == SHOT[:UPPER])
            view.press('s')  # the shadow alone, where the cube stands too
            watch.wait('a shadow without a cube', lambda d:
                       pixel(d, BESIDE_CUBE) == pixel(whole, BESIDE_CUBE) and
                       pixel(d, ON_CUBE) != pixel(whole, ON_CUBE) and
                       max(pixel(d, ON_CUBE)) < max(pixel(SHOT, ON_CUBE)))
            view.press('v')
            watch.wait('all as before', lambda d: d[:UPPER] == whole[:UPPER])
            view.press('q')
            status, out, err = view.end()
            assert (status, err) == (0, ''), (status, err)
            assert 'frames sent' in out and '; in out\n' in out, out[-300:]


def test_overlays():
    """Figures, plan, light and keys stay inside a small window and leave nothing behind."""
    with lit() as daemon, probe(daemon) as light, Screen() as screen:
        light_up(light)
        with View(daemon.address, '--out', 'out', '--loop', '--rate', '10', screen=screen) as view:
            watch = Watch(view)
            whole = watch.wait_composite()

            def wait_box(key, what, claim):
                """Presses the key and waits for the box of what has changed."""
                view.press(key)
                data = watch.wait(what, lambda d: find_differences(d, whole, WIDTH) and
                                  claim(*find_differences(d, whole, WIDTH)))
                x0, y0, x1, y1 = find_differences(data, whole, WIDTH)
                assert 6 <= x0 and 6 <= y0 and x1 <= WIDTH - 6 and y1 <= HEIGHT - 6, (x0, y0, x1, y1)
                changed = [pixel(data, (x, y)) for y in range(y0, y1) for x in range(x0, x1)]
                bright = sum(min(p) >= 240 for p in changed)
                assert 100 < bright < len(changed) / 3, (what, bright, len(changed))

            wait_box('o', 'figures', lambda x0, y0, x1, y1: (x0, y0) == (6, 6) and y1 > 80)
            wait_box('o', 'the plan', lambda x0, y0, x1, y1: (x0, y0) == (6, 6) and y1 > 80)
            view.press('o')
            watch.wait('no page', lambda d: d == whole)
            wait_box('l', 'the light', lambda x0, y0, x1, y1: x0 > WIDTH / 2 and y0 > HEIGHT / 2 and
                     (x1, y1) == (WIDTH - 6, HEIGHT - 6))
            view.press('l')
            watch.wait('no light', lambda d: d == whole)
            wait_box('h', 'the keys', lambda x0, y0, x1, y1: abs(x0 + x1 - WIDTH) <= 1 and
                     abs(y0 + y1 - HEIGHT) <= 1)
            view.press('h')
            watch.wait('no keys', lambda d: d == whole)
            view.press('Escape')
            assert view.end()[0] == 0


def test_keeping():
    """p keeps the picture that is shown, r all of them; without --out in the working folder."""
    with lit() as daemon, probe(daemon) as light, Screen() as screen:
        light_up(light)
        with View(daemon.address, '--rate', '10', '--show', 'virtual', screen=screen) as view:
            view.resize(WIDTH, HEIGHT)
            wait_for('a picture', lambda: view.see()[:2] == (WIDTH, HEIGHT) and
                     pixel(view.see()[2], BESIDE_CUBE) == pixel(SHOT, BESIDE_CUBE))
            view.press('p')
            kept = wait_for('a picture kept', lambda: [n for n in os.listdir(view.path)
                                                       if n.startswith('gnomon-') and n.endswith('.png')])
            wait_for('that said', lambda: 'kept ' + kept[0] in view.read('stdout'))
            width, height, data = read_png(view.at(kept[0]))
            assert (width, height) == (WIDTH, HEIGHT)
            assert pixel(data, BESIDE_CUBE) == pixel(SHOT, BESIDE_CUBE), '--show virtual'
            assert pixel(data, ON_CUBE) != pixel(SHOT, ON_CUBE)
            view.press('r')
            folder = wait_for('a recording', lambda: [n for n in os.listdir(view.path)
                                                      if n.startswith('gnomon-') and os.path.isdir(view.at(n))])[0]
            wait_for('some pictures', lambda: len(os.listdir(view.at(folder))) > 4)
            view.press('r')
            wait_for('its end', lambda: ' pictures: ' + folder in view.read('stdout'))
            with open(view.at(folder + '/view.json')) as f:
                report = json.load(f)
            names = {frame['name'] + '.png' for frame in report['frames']}
            assert names == set(os.listdir(view.at(folder))) - {'view.json'} and len(names) > 2
            assert read_png(view.at(folder + '/' + sorted(names)[-1]))[2] == data
            view.resize(500, HEIGHT)  # the picture keeps its shape, black beside it

            def is_letterboxed():
                width, height, seen = view.see()
                rows = [seen[3 * width * y:3 * width * (y + 1)] for y in range(height)]
                return (width, height) == (500, HEIGHT) and \
                    b''.join(row[3 * 90:3 * 410] for row in rows) == data and \
                    all(row[:3 * 90] == row[3 * 410:] == bytes(3 * 90) for row in rows)
            wait_for('a letterboxed picture', is_letterboxed)
            view.press('q')
            status, out, err = view.end()
            assert (status, err) == (0, '') and 'frame 1:' not in out, (status, out, err)


def test_server_lost():
    """The last picture stays, with a word about it; when the server is back, all goes on."""
    with lit() as daemon, Screen() as screen:
        address, light = daemon.address, probe(daemon)
        light_up(light)
        with View(address, '--out', 'out', '--loop', '--rate', '10', screen=screen) as view:
            watch = Watch(view)
            whole = watch.wait_composite()
            daemon.process.send_signal(signal.SIGSTOP)
            watch.wait('a word about the silence', lambda d: find_differences(d, whole, WIDTH))
            daemon.kill()
            light.close()
            wait_for('that said', lambda: 'the server is lost: ' in view.read('stderr'))
            seen = watch.wait('a warning', lambda d: find_differences(d, whole, WIDTH))
            x0, y0, x1, y1 = find_differences(seen, whole, WIDTH)
            assert x0 == 6 and y1 == HEIGHT - 6 and y0 > HEIGHT / 2, (x0, y0, x1, y1)
            red, green, blue = pixel(seen, (x0 + 2, y0 + 2))
            assert red > 2 * green and red > 2 * blue, (red, green, blue)
            view.press('o')  # it still answers
            watch.wait('figures', lambda d: find_differences(d, whole, WIDTH)[1] == 6)
            view.press('o')
            view.press('o')
            n_before = view.read('stdout').count('frame ')
            with lit('%s:%d' % address) as second, probe(second) as light:
                light_up(light)
                wait_for('a way back', lambda: 'connected again after' in view.read('stdout'))
                wait_for('frames', lambda: view.read('stdout').count('frame ') > n_before + 2)
                watch.wait('the picture alone', lambda d: d == whole)
                view.press('q')
                status, out, err = view.end()
            assert status == 0 and '; connected again 1 time, ' in out, out[-300:]
            assert err.count('\n') == 1 and 'the server is lost: ' in err, err
            with open(view.at('out/view.json')) as f:
                report = json.load(f)
            # When q is pressed one frame may be out.
            assert 0 <= report['sent'] - len(report['frames']) <= 1, 'not every frame is accounted for'
            lost = [f for f in report['frames'] if f.get('sentence') == 'the server was lost']
            assert len(lost) == 1 and ', 1 frame lost' in out, (lost, out[-300:])


def test_no_display():
    """Where there is no display, files are written, and that is said in one line."""
    bare = {k: v for k, v in ENVIRONMENT.items()
            if k not in ('DISPLAY', 'WAYLAND_DISPLAY', 'SDL_VIDEODRIVER')}
    deaf = dict(bare, DISPLAY='127.0.0.1:99')  # a display that is not there
    with lit() as daemon, probe(daemon) as light:
        light_up(light)
        for more, folder, env in (((), 'composites', bare), (('--out', 'there'), 'there', deaf)):
            with View(daemon.address, *more, env=env) as view:
                status, out, err = view.end()
                assert status == 0 and '; in %s\n' % folder in out, (out, err)
                assert err.count('\n') == 1 and 'no display' in err and folder in err, err
                assert sorted(os.listdir(view.at(folder))) == ['shot.png', 'view.json']
        with View(daemon.address, '--count', '3', env=dict(bare, SDL_VIDEODRIVER='dummy')) as view:
            status, out, err = view.end()
            assert (status, err) == (0, '') and '3 frames sent, 3 results' in out, (out, err)
            assert sorted(os.listdir(view.path)) == ['camera.json', 'shots', 'stderr', 'stdout']
    done = subprocess.run([GNOMON, 'view', '--files', 'x', '--camera', 'y'], stderr=subprocess.PIPE)
    assert done.returncode == 2 and b'--out DIR' in done.stderr and b'--window' in done.stderr


if b'ok     window' not in subprocess.run([GNOMON, 'doctor'], stdout=subprocess.PIPE,
                                          stderr=subprocess.DEVNULL).stdout:
    print('1..0 # SKIP built without windows (libsdl2-dev)')
    sys.exit(0)
for tool in ('Xvfb', 'xdotool'):
    if not shutil.which(tool):
        print('1..0 # SKIP no %s (deploy/install-packages test)' % tool)
        sys.exit(0)
run_tests([test_picture_and_toggles, test_overlays, test_keeping, test_server_lost, test_no_display])
