# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""A virtual screen whose pixels can be read, and gnomon view with its window on it."""
import ctypes
import json
import os
import random
import struct
import subprocess
import sys
import time

from folder import make_folder
from gnomond import Daemon
from pictures import png_bytes, read_png

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
        self.path = make_folder('screen')
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

    def ask_to_close(self, window):
        """What a window manager sends when its close button is pressed (ICCCM 4.2.8.1)."""
        class Message(ctypes.Structure):
            _fields_ = [('type', ctypes.c_int), ('serial', ctypes.c_ulong), ('send_event', ctypes.c_int),
                        ('display', ctypes.c_void_p), ('window', ctypes.c_ulong), ('what', ctypes.c_ulong),
                        ('format', ctypes.c_int), ('data', ctypes.c_long * 5), ('pad', ctypes.c_long * 24)]
        x = ctypes.CDLL('libX11.so.6')
        x.XOpenDisplay.restype = ctypes.c_void_p
        x.XInternAtom.restype = ctypes.c_ulong
        display = ctypes.c_void_p(x.XOpenDisplay(self.display.encode()))
        protocols, delete = (x.XInternAtom(display, name, 0) for name in (b'WM_PROTOCOLS', b'WM_DELETE_WINDOW'))
        message = Message(type=33, window=window, what=protocols, format=32)
        message.data[0] = delete
        assert x.XSendEvent(display, ctypes.c_ulong(window), 0, ctypes.c_long(0), ctypes.byref(message))
        x.XCloseDisplay(display)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()


class View:
    """gnomon view in a folder of its own, and its window if there is a screen."""

    def __init__(self, address, *more, screen=None, env=None, title='gnomon: room demo'):
        self.path = make_folder('view')
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
            self.id = int(wait_for('a window', lambda: self.find(title)).split()[0])
            screen.do('windowfocus', self.id)

    def find(self, title):
        assert self.process.poll() is None, self.read('stderr')
        return self.screen.do('search', '--onlyvisible', '--name', '^' + title)

    def get_title(self):
        return self.screen.do('getwindowname', self.id).rstrip('\n')

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
        view.press('x')  # no key of ours: the hint goes, as for any
        view.resize(WIDTH, HEIGHT)

    def wait(self, what, claim):
        """The window's pixels once the claim holds of them."""
        def look():
            width, height, data = self.view.see()
            return data if (width, height) == (WIDTH, HEIGHT) and claim(data) else None
        try:
            return wait_for(what, look)
        except AssertionError:
            with open(self.view.at('window.png'), 'wb') as out:
                out.write(png_bytes(*self.view.see()))
            print('# with GN_KEEP the window is in ' + out.name)
            raise

    def wait_composite(self):
        """Until the window shows what the server sent, to the bit, and that is a composite."""
        def claim(data):
            path = self.view.at('out/shot.png')
            return os.path.exists(path) and data == read_png(path)[2] != SHOT
        return self.wait('the composite on the screen', claim)
