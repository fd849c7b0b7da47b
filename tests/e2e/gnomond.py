# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""What the daemon's tests share: a daemon of their own, a client that speaks the wire, TAP.

The environment's GNOMOND names another binary than the build's, as one made with sanitizers.
"""
import http.client
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import traceback

import gnomon_pb2 as pb
from folder import make_folder

HELLO, WELCOME, REDIRECT, ERROR, BYE, PING, PONG = 1, 2, 3, 4, 5, 6, 7
ENVIRONMENT_FRAME, POSE, CAMERA, FRAME = 16, 17, 18, 19
RESULT, DROPPED, LIGHTING_STATE, STATISTICS = 32, 33, 34, 35
MESSAGES = {
    HELLO: pb.Hello, WELCOME: pb.Welcome, REDIRECT: pb.Redirect, ERROR: pb.Error, BYE: pb.Bye,
    PING: pb.Ping, PONG: pb.Pong, ENVIRONMENT_FRAME: pb.EnvironmentFrame, POSE: pb.Pose,
    CAMERA: pb.Camera, FRAME: pb.Frame, RESULT: pb.Result, DROPPED: pb.Dropped,
    LIGHTING_STATE: pb.LightingState, STATISTICS: pb.Statistics,
}
ENVELOPE = struct.Struct('<4sBBHIII')

FLOOR = 'v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3\nf 1 3 4\n'
CUBE = ''.join('v %g %g %g\n' % (x, y, z) for z in (0.05, 0.25)
               for x, y in ((-.1, -.1), (.1, -.1), (.1, .1), (-.1, .1))) + \
    'f 1 3 2\nf 1 4 3\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 2 3 7\nf 2 7 6\n' \
    'f 3 4 8\nf 3 8 7\nf 4 1 5\nf 4 5 8\n'
SCENE = '{"objects": [{"mesh": "floor.obj", "role": "real"},' \
    ' {"mesh": "cube.obj", "role": "virtual"}]}'


def envelope(kind, header_bytes, payload_bytes, magic=b'GNOM', version=1, flags=0, stream=0):
    return ENVELOPE.pack(magic, version, flags, kind, stream, header_bytes, payload_bytes)


class Room:
    """A folder with a small scene and a configuration."""

    def __init__(self, settings='', server='', scene=SCENE):
        self.path = make_folder('room')
        self.write('floor.obj', FLOOR)
        self.write('cube.obj', CUBE)
        self.write('scene.json', scene)
        self.config = self.write('gnomond.conf', '[server]\n%s\n[room demo]\nscene = scene.json\n%s\n'
                                 % (server, settings))

    def write(self, name, text):
        path = os.path.join(self.path, name)
        with open(path, 'w') as out:
            out.write(text)
        return path


def binary():
    return os.environ.get('GNOMOND') or sys.argv[1]


def start_badly(*arguments):
    """Runs a daemon that must refuse to start; returns exit status and stderr."""
    done = subprocess.run([binary(), *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          timeout=60, text=True)
    return done.returncode, done.stderr


class Daemon:
    """A running gnomond with a room of its own, on ports that it picked."""

    def __init__(self, settings='', server='', rooms=None, listen='127.0.0.1:0'):
        self.room = rooms or Room(settings, server)
        ready = os.path.join(self.room.path, 'ready')
        self.log = open(os.path.join(self.room.path, 'log'), 'w+')
        self.is_killed = False
        self.process = subprocess.Popen(
            [binary(), '--config', self.room.config, '--listen', listen,
             '--http', '127.0.0.1:0', '--ready-file', ready], stderr=self.log)
        deadline = time.monotonic() + 60
        while not os.path.exists(ready):
            if self.process.poll() is not None or time.monotonic() > deadline:
                raise AssertionError('gnomond did not start: ' + self.read_log())
            time.sleep(0.01)
        values = dict(line.strip().split('=', 1) for line in open(ready))
        self.address = self.split(values['listen'])
        self.http_address = self.split(values['http'])

    @staticmethod
    def split(text):
        host, port = text.rsplit(':', 1)
        return host, int(port)

    def read_log(self):
        self.log.flush()
        self.log.seek(0)
        return self.log.read()

    def get(self, path, headers=None, method='GET'):
        connection = http.client.HTTPConnection(*self.http_address, timeout=20)
        try:
            connection.request(method, path, headers=headers or {})
            answer = connection.getresponse()
            return answer.status, answer.read(), dict(answer.getheaders())
        finally:
            connection.close()

    def is_alive(self):
        return self.process.poll() is None

    def kill(self):
        """As a crash: no word to anybody. It has no exit status that stop() could judge."""
        self.process.kill()
        self.process.wait()
        self.is_killed = True

    def stop(self):
        """Ends it as an operator does; it must end well and leave no sanitizer's report."""
        if self.is_alive():
            self.process.send_signal(signal.SIGTERM)
        try:
            status = self.process.wait(timeout=60)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise AssertionError('gnomond did not stop: ' + self.read_log())
        log = self.read_log()
        self.log.close()
        for word in ('AddressSanitizer', 'LeakSanitizer', 'ThreadSanitizer', 'runtime error'):
            assert word not in log, log
        assert self.is_killed or status == 0, 'exit status %d: %s' % (status, log)

    def __enter__(self):
        return self

    def __exit__(self, kind, value, trace):
        if kind:
            sys.stderr.write(self.read_log()[-4000:])
            self.process.kill()
            self.process.wait()
            self.log.close()
        else:
            self.stop()


class Client:
    """A connection; with a role, an open session."""

    def __init__(self, daemon, role=None, timeout=120, **hello):
        self.socket = socket.create_connection(daemon.address, timeout=timeout)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.last_id = 0
        if role:
            self.send(HELLO, pb.Hello(version_min=1, version_max=1, client_name='test', role=role,
                                      **hello))
            kind, self.welcome, _ = self.receive()
            assert kind == WELCOME, self.welcome

    def send_bytes(self, data):
        self.socket.sendall(data)

    def send(self, kind, message, payload=b''):
        header = message.SerializeToString()
        self.send_bytes(envelope(kind, len(header), len(payload)) + header + payload)

    def read(self, n):
        data = bytearray()
        while len(data) < n:
            part = self.socket.recv(n - len(data))
            if not part:
                raise EOFError('closed after %d of %d bytes' % (len(data), n))
            data += part
        return bytes(data)

    def receive(self):
        start = time.monotonic()
        while True:
            magic, _, _, kind, _, n_header, n_payload = ENVELOPE.unpack(self.read(20))
            assert magic == b'GNOM', magic
            message = MESSAGES[kind]()
            message.ParseFromString(self.read(n_header))
            payload = self.read(n_payload)
            if kind != PING:
                return kind, message, payload
            assert time.monotonic() - start < self.socket.gettimeout(), 'nothing but PING'
            self.send(PONG, pb.Pong(t1_ns=message.t1_ns))

    def expect(self, kind):
        got, message, payload = self.receive()
        assert got == kind, '%s instead of %s: %s' % (got, kind, message)
        return message, payload

    def expect_closed(self):
        try:
            rest = self.socket.recv(1)
        except ConnectionResetError:
            return
        assert rest == b'', rest

    def expect_fatal(self, code):
        message, _ = self.expect(ERROR)
        assert message.code == code and message.fatal and message.sentence, message
        self.expect_closed()
        return message.sentence

    def close(self):
        self.socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def probe(daemon, **hello):
    return Client(daemon, pb.ROLE_PROBE, **hello)


def environment(sequence, width=32, height=16, pixels=None, **fields):
    values = dict(sequence=sequence, width=width, height=height,
                  capture_time_ns=time.monotonic_ns(), pixel_format=pb.PIXEL_FORMAT_RGB_F32,
                  projection=pb.Projection(type=pb.PROJECTION_TYPE_LATLONG))
    values.update(fields)
    return pb.EnvironmentFrame(**values), \
        struct.pack('<f', 1.0) * (3 * width * height) if pixels is None else pixels


def light_up(client, sequence=1, **fields):
    client.send(ENVIRONMENT_FRAME, *environment(sequence, **fields))


# 1 m above the floor, looking down: x right, y down of the camera are world x and -y.
DOWN = pb.Transform(orientation=[0, 1, 0, 0], position_m=[0, 0, 1])


def camera(width=32, height=24, **fields):
    values = dict(index=0, width=width, height=height, fx=width, fy=width, cx=width / 2,
                  cy=height / 2)
    values.update(fields)
    return pb.Camera(**values)


class Viewer(Client):
    """A viewer with a camera, that knows what it owes and is owed."""

    def __init__(self, daemon, width=32, height=24, **hello):
        super().__init__(daemon, pb.ROLE_VIEWER, **hello)
        self.width, self.height = width, height
        self.picture = bytes([128]) * (3 * width * height)
        self.send(CAMERA, camera(width, height))

    def send_frame(self, picture=None, pose=DOWN, picture_format=pb.PICTURE_FORMAT_RGB8, **fields):
        self.last_id += 1
        picture = self.picture if picture is None else picture
        view = pb.FrameView(world_from_camera=pose, camera=0, picture_format=picture_format,
                            payload_length=len(picture))
        values = dict(id=self.last_id, capture_time_ns=time.monotonic_ns(), views=[view])
        values.update(fields)
        self.send(FRAME, pb.Frame(**values), picture)
        return self.last_id

    def take(self):
        """The next answer to a FRAME; anything else is a failure."""
        kind, message, payload = self.receive()
        assert kind in (RESULT, DROPPED), message
        return kind, message, payload

    def expect_result(self, frame_id):
        kind, message, payload = self.take()
        assert kind == RESULT and message.id == frame_id, message
        return message, payload

    def expect_dropped(self, frame_id, reason):
        kind, message, _ = self.take()
        assert kind == DROPPED and message.id == frame_id and message.reason == reason, message
        return message.sentence


class Bystanders:
    """A good probe and a good viewer that go on while others misbehave, and must lose nothing."""

    def __init__(self, daemon):
        self.probe, self.viewer = probe(daemon), Viewer(daemon)
        self.is_over, self.fault, self.n = threading.Event(), None, 0
        self.thread = threading.Thread(target=self.run)
        light_up(self.probe, 1)
        self.thread.start()

    def run(self):
        try:
            while not self.is_over.is_set():
                self.n += 1
                light_up(self.probe, 1 + self.n)
                frame_id = self.viewer.send_frame(lighting_min_sequence=1, lighting_wait_ms=20000)
                self.viewer.expect_result(frame_id)
                time.sleep(0.01)
        except Exception as fault:  # shown by the test's own thread
            self.fault = fault

    def finish(self):
        before = self.n
        deadline = time.monotonic() + 120
        while self.n < before + 3 and not self.fault and time.monotonic() < deadline:
            time.sleep(0.01)
        self.is_over.set()
        self.thread.join()
        self.probe.close()
        self.viewer.close()
        assert not self.fault, 'the good viewer suffered: %r' % self.fault
        assert self.n >= before + 3, 'the good viewer stood still'


def run_tests(tests):
    """Runs the functions and speaks TAP."""
    print('1..%d' % len(tests), flush=True)
    n_failed = 0
    for i, test in enumerate(tests, 1):
        start = time.monotonic()
        try:
            test()
            verdict = 'ok'
        except Exception:
            traceback.print_exc()
            verdict, n_failed = 'not ok', n_failed + 1
        print('%s %d - %s # %.1f s' % (verdict, i, test.__name__, time.monotonic() - start),
              flush=True)
    sys.exit(1 if n_failed else 0)
