# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Bad input of every kind at every door, while a good probe and a good viewer lose nothing."""
import json
import os
import random
import struct
import sys
import time

sys.path.insert(0, sys.argv[2])
from gnomond import *  # noqa: E402,F403

DAEMON = None


def hello(**fields):
    values = dict(version_min=1, version_max=1, client_name='rude', role=pb.ROLE_VIEWER)
    values.update(fields)
    return pb.Hello(**values)


def raw(data):
    """Sends bytes to a fresh connection; returns it."""
    client = Client(DAEMON)
    client.send_bytes(data)
    return client


def test_envelopes():
    cases = [
        (b'GET / HTTP/1.1\r\nHost: localhost\r\n\r\n', pb.ERROR_CODE_MALFORMED),
        (b'\0' * 20, pb.ERROR_CODE_MALFORMED),
        (envelope(HELLO, 4, 0, magic=b'GNOm'), pb.ERROR_CODE_MALFORMED),
        (envelope(HELLO, 4, 0, version=9), pb.ERROR_CODE_VERSION),
        (envelope(HELLO, 4, 0, flags=1), pb.ERROR_CODE_MALFORMED),
        (envelope(HELLO, 4, 0, stream=1), pb.ERROR_CODE_MALFORMED),
        (envelope(999, 4, 0), None),
        (envelope(HELLO, 0xffffffff, 0), pb.ERROR_CODE_TOO_LARGE),
        (envelope(HELLO, 4, 0xffffffff), pb.ERROR_CODE_TOO_LARGE),
        (envelope(ENVIRONMENT_FRAME, 4, 64 << 20), pb.ERROR_CODE_TOO_LARGE),
        (envelope(RESULT, 4, 4), None),
        (envelope(HELLO, 4, 0) + b'\xff\xff\xff\xff', pb.ERROR_CODE_MALFORMED),
    ]
    for data, code in cases:
        with raw(data) as client:
            message, _ = client.expect(ERROR)
            assert message.fatal and message.sentence, message
            assert code is None or message.code == code, (data[:20], message)
            client.expect_closed()
    with raw(envelope(HELLO, 4, 0, version=9)) as client:
        sentence = client.expect_fatal(pb.ERROR_CODE_VERSION)
        assert '9' in sentence and '1' in sentence, sentence


def test_hellos():
    cases = [
        (hello(version_min=2, version_max=3), pb.ERROR_CODE_VERSION, ('2', '3', '1')),
        (hello(room='cellar'), pb.ERROR_CODE_NO_SUCH_ROOM, ('demo',)),
        (hello(role=pb.ROLE_UNSPECIFIED), pb.ERROR_CODE_BAD_VALUE, ()),
        (hello(resume_token=b'x'), pb.ERROR_CODE_UNSUPPORTED, ('resume_token',)),
        (hello(ticket=b'x'), pb.ERROR_CODE_UNSUPPORTED, ('ticket',)),
        (hello(token='secret'), pb.ERROR_CODE_NOT_ALLOWED, ('token',)),
        (hello(version_min=0), pb.ERROR_CODE_BAD_VALUE, ()),
    ]
    for message, code, words in cases:
        with Client(DAEMON) as client:
            client.send(HELLO, message)
            sentence = client.expect_fatal(code)
            assert all(word in sentence for word in words), sentence


def test_states():
    """A message in the wrong state, or of another role."""
    with Client(DAEMON) as client:
        client.send(PING, pb.Ping(t1_ns=1))
        assert 'HELLO comes first' in client.expect_fatal(pb.ERROR_CODE_UNEXPECTED)
    with Client(DAEMON, pb.ROLE_VIEWER) as client:
        client.send(HELLO, hello())
        client.expect_fatal(pb.ERROR_CODE_UNEXPECTED)
    with probe(DAEMON) as client:
        client.send(CAMERA, camera())
        client.expect_fatal(pb.ERROR_CODE_UNEXPECTED)
    with Client(DAEMON, pb.ROLE_VIEWER) as client:
        light_up(client)
        client.expect_fatal(pb.ERROR_CODE_UNEXPECTED)
    with Viewer(DAEMON) as viewer:
        viewer.send_frame(id=1)
        viewer.send_frame(id=1)
        while viewer.receive()[0] != ERROR:
            pass
        viewer.expect_closed()


def test_bad_frames():
    nan = float('nan')
    bad = [
        pb.Frame(id=0),
        pb.Frame(id=1),
        pb.Frame(id=1, views=[pb.FrameView()] * 5),
        pb.Frame(id=1, views=[pb.FrameView(world_from_camera=pb.Transform(
            orientation=[0, 0, 0, 0], position_m=[0, 0, 0]))]),
        pb.Frame(id=1, views=[pb.FrameView(world_from_camera=pb.Transform(
            orientation=[1, 0, 0, 0], position_m=[nan, 0, 0]))]),
        pb.Frame(id=1, views=[pb.FrameView(world_from_camera=DOWN, payload_offset=5,
                                           payload_length=0xfffffff0,
                                           picture_format=pb.PICTURE_FORMAT_RGB8)]),
        pb.Frame(id=1, views=[pb.FrameView(world_from_camera=DOWN, payload_length=9,
                                           picture_format=pb.PICTURE_FORMAT_RGB8)] * 2),
        pb.Frame(id=1, views=[pb.FrameView(world_from_camera=DOWN, scale=-1)]),
        pb.Frame(id=1, views=[pb.FrameView(world_from_camera=DOWN, scale=nan)]),
        pb.Frame(id=1, views=[pb.FrameView(world_from_camera=DOWN, matrix_to_rec709=[1e7] * 9)]),
    ]
    for message in bad:
        with Viewer(DAEMON) as viewer:
            viewer.send(FRAME, message, b'123456789')
            error, _ = viewer.expect(ERROR)
            assert error.code in (pb.ERROR_CODE_BAD_VALUE, pb.ERROR_CODE_MALFORMED), error
    for fields in (dict(width=0), dict(height=0), dict(fx=0), dict(fy=-1), dict(cx=nan),
                   dict(width=8193), dict(index=4), dict(k1=float('inf')),
                   dict(blur_px=8.01), dict(blur_px=-1), dict(noise_slope=[0, -1e-9, 0]),
                   dict(noise_offset=[0, 0, 1.5]), dict(noise_slope=[nan, 0, 0])):
        with Client(DAEMON, pb.ROLE_VIEWER) as client:
            client.send(CAMERA, camera(**fields))
            error, _ = client.expect(ERROR)
            assert error.code in (pb.ERROR_CODE_BAD_VALUE, pb.ERROR_CODE_TOO_LARGE), error


def test_bad_light():
    """Wrong sizes and files get an ERROR that names the frame."""
    n = 32 * 16
    dwa = b'\x76\x2f\x31\x01\x02\0\0\0' + b'\0' * 64
    cases = [
        dict(pixels=b'\0' * 7),
        dict(width=0), dict(height=0),
        dict(projection=pb.Projection()),
        dict(projection=pb.Projection(type=pb.PROJECTION_TYPE_LATLONG, radius_px=float('nan'))),
        dict(scale=-1.0),
        dict(pixel_format=pb.PIXEL_FORMAT_MONO12, pixels=b'\xff\xff' * n),
        dict(pixel_format=pb.PIXEL_FORMAT_JPEG, pixels=b'\xff\xd8 no'),
        dict(pixel_format=pb.PIXEL_FORMAT_EXR, pixels=dwa),
        dict(pixel_format=pb.PIXEL_FORMAT_EXR, pixels=b'not an EXR'),
        dict(response=pb.Response(type=pb.RESPONSE_TYPE_TABLE, table_entries=4096), pixels=b'1234'),
        dict(width=8192, height=8192, pixels=b'1234'),
    ]
    for case in cases:
        with probe(DAEMON, want_lighting_states=True) as client:
            # The bystander's frames may replace it unread: it is sent until it is answered.
            for sequence in range(10**6, 10**6 + 1000):
                client.send(ENVIRONMENT_FRAME, *environment(sequence, **case))
                kind, error, _ = client.receive()
                if kind != LIGHTING_STATE:
                    break
            assert kind == ERROR and error.about_type == ENVIRONMENT_FRAME, (case, error)


def test_nan_map():
    """NaN, infinite and negative texels are mended, not passed on."""
    values = [float('nan'), float('inf'), -1.0, 1e38]
    pixels = struct.pack('<1536f', *(values[i % 4] if i % 7 == 0 else 1.0 for i in range(1536)))
    with probe(DAEMON, want_lighting_states=True) as client:
        for sequence in range(2 * 10**6, 2 * 10**6 + 1000):  # until it is not replaced unread
            client.send(ENVIRONMENT_FRAME, *environment(sequence, pixels=pixels))
            kind, state, payload = client.receive()
            assert kind == LIGHTING_STATE, state
            if state.sequence >= 2 * 10**6:
                break
        assert state.sequence >= 2 * 10**6, state.sequence
        assert all(abs(v) < 1e32 for v in state.sh), state.sh


def test_times():
    """Capture times are the peers' to make up: no difference of them overflows."""
    first, last = -2**63, 2**63 - 1
    with probe(DAEMON, want_lighting_states=True) as light, Viewer(DAEMON) as viewer:
        for sequence, (lit_ns, seen_ns) in enumerate([(first, last), (last, first)], 3 * 10**6):
            light_up(light, sequence, capture_time_ns=lit_ns)
            viewer.send_frame(capture_time_ns=seen_ns)
            receipt = viewer.expect_result(viewer.last_id)[0].receipt
            assert abs(receipt.lighting_age_ms) < 2e13, receipt
            assert DAEMON.get('/api/v1/status')[0] == DAEMON.get('/metrics')[0] == 200


def test_vanishing():
    """Peers that break off anywhere: in envelope, header and payload, by FIN and by RST."""
    whole = hello().SerializeToString()
    whole = envelope(HELLO, len(whole), 0) + whole
    header = pb.Frame(id=1, views=[pb.FrameView(world_from_camera=DOWN)]).SerializeToString()
    frame = envelope(FRAME, len(header), 5000) + header + b'x' * 100
    for data in (whole[:3], whole[:20], whole[:25], whole + frame[:30], whole + frame):
        for linger in (None, struct.pack('ii', 1, 0)):
            client = raw(data)
            if linger:
                client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
            client.close()
    for _ in range(5):  # gone while the frame is rendered
        viewer = Viewer(DAEMON, 160, 120)
        viewer.send_frame(lighting_min_sequence=1, lighting_wait_ms=10000)
        viewer.close()


def test_garbage():
    """Random bytes, and good messages with bytes changed, from a printed seed."""
    seed = int(os.environ.get('GN_TEST_SEED') or random.randrange(10**9))
    print('# seed %d: GN_TEST_SEED repeats it' % seed)
    chance = random.Random(seed)
    opening = hello().SerializeToString()
    header, payload = camera().SerializeToString(), b''
    good = envelope(HELLO, len(opening), 0) + opening + envelope(CAMERA, len(header), 0) + header
    for _ in range(60):
        data = bytearray(good)
        for _ in range(chance.randrange(1, 6)):
            data[chance.randrange(len(data))] = chance.randrange(256)
        with raw(bytes(data) + chance.randbytes(chance.randrange(300))):
            pass


def test_silent():
    """No HELLO in time, and a HELLO that comes byte by byte."""
    with Client(DAEMON) as silent, Client(DAEMON) as slow:
        data, n_sent = envelope(HELLO, 2000, 0) + b'\x1a\x3f' + b'a' * 63, 0
        try:
            for byte in data:
                slow.send_bytes(bytes([byte]))
                n_sent += 1
                time.sleep(0.1)
        except (ConnectionResetError, BrokenPipeError):
            pass
        assert 0 < n_sent < len(data), 'a HELLO of one byte each 0.1 s is waited for'
        silent.expect_fatal(pb.ERROR_CODE_TIMEOUT)


def test_idle():
    """An open session that says nothing is asked, then closed; one that answers stays."""
    with Client(DAEMON, pb.ROLE_VIEWER) as client, Client(DAEMON, pb.ROLE_VIEWER) as awake:
        start, n_pings = time.monotonic(), 0
        while time.monotonic() - start < 6:
            kind, n = ENVELOPE.unpack(awake.read(20))[3:6:2]
            ping = pb.Ping.FromString(awake.read(n))
            assert kind == PING
            awake.send(PONG, pb.Pong(t1_ns=ping.t1_ns))
            n_pings += 1
        assert n_pings >= 2
        envelope_bytes = client.read(20)
        assert ENVELOPE.unpack(envelope_bytes)[3] == PING
        client.read(ENVELOPE.unpack(envelope_bytes)[5])
        client.expect_fatal(pb.ERROR_CODE_TIMEOUT)
        assert time.monotonic() - start < 10


def get_network():
    return json.loads(DAEMON.get('/api/v1/status')[1])['network']


def test_reads_nothing():
    """A viewer that sends and does not read is closed; what it leaves costs nobody else."""
    before = get_network()['stalled']
    client = Client(DAEMON, pb.ROLE_VIEWER)
    client.socket.settimeout(20)
    start, frame_id = time.monotonic(), 0
    try:
        while time.monotonic() - start < 60:
            batch = b''
            for _ in range(500):  # each is answered DROPPED: it names a camera that was not sent
                frame_id += 1
                header = pb.Frame(id=frame_id, views=[pb.FrameView()]).SerializeToString()
                batch += envelope(FRAME, len(header), 0) + header
            client.send_bytes(batch)
    except (ConnectionResetError, BrokenPipeError, TimeoutError):
        pass  # where both systems' buffers are full, the end may not get through to this side
    deadline = time.monotonic() + 20  # counted a moment after the socket is closed
    while get_network()['stalled'] == before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert get_network()['stalled'] == before + 1, get_network()
    client.close()


def test_long_quiet():
    """An answer that is late for a good reason is not taken for a peer that reads nothing."""
    with Viewer(DAEMON) as viewer:
        frame_id = viewer.send_frame(lighting_min_sequence=10**12, lighting_wait_ms=1800)
        viewer.expect_result(frame_id)
        viewer.expect_result(viewer.send_frame())


def test_many():
    """More connections than are allowed: those above are told so, and go."""
    clients = [Client(DAEMON) for _ in range(50)]
    n_full = 0
    for client in clients:
        try:
            if client.receive()[1].code == pb.ERROR_CODE_FULL:
                n_full += 1
        except (EOFError, ConnectionResetError):
            n_full += 1
    assert n_full >= 50 - 24, n_full
    for client in clients:
        client.close()
    deadline = time.monotonic() + 10
    while True:  # and there is room again
        try:
            with Client(DAEMON, pb.ROLE_VIEWER):
                return
        except (AssertionError, EOFError, ConnectionResetError):
            assert time.monotonic() < deadline
            time.sleep(0.05)


def test_http():
    """Garbage and slowness at the other door."""
    def send(data, n=200):
        with socket.create_connection(DAEMON.http_address, timeout=20) as s:
            s.sendall(data)
            try:
                return s.recv(n)
            except ConnectionResetError:
                return b''
    assert b'403' in send(b'GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n')
    assert b'403' in send(b'GET / HTTP/1.1\r\nHost: 127.0.0.1.evil.example\r\n\r\n')
    assert b'403' in send(b'GET / HTTP/1.1\r\nHost: localhost:80\r\nOrigin: http://evil\r\n\r\n')
    assert b'405' in send(b'POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n')
    assert b'404' in send(b'GET /../../etc/passwd HTTP/1.1\r\nHost: localhost\r\n\r\n')
    assert b'404' in send(b'GET /api/v1/rooms/cellar/composite.jpg HTTP/1.1\r\nHost: localhost\r\n\r\n')
    assert b'200' not in send(envelope(HELLO, 4, 0) + b'\r\n\r\n')
    assert b'200' not in send(b'GET / HTTP/1.1\r\nHost: localhost\r\nX: ' + b'a' * 100000)
    assert b'413' in send(b'GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n\r\nhello')
    slow = [socket.create_connection(DAEMON.http_address, timeout=20) for _ in range(8)]
    start = time.monotonic()
    while slow and time.monotonic() - start < 15:  # a byte now and then keeps none of them open
        for s in slow[:]:
            try:
                s.send(b'G')
            except (BrokenPipeError, ConnectionResetError):
                slow.remove(s)
        time.sleep(0.1)
    assert not slow, '%d slow requests still hold their connections' % len(slow)
    assert DAEMON.get('/healthz')[0] == 200


def among_bystanders(test):
    """The test with a good session beside it, on a daemon that must survive it."""
    def run():
        bystanders = Bystanders(DAEMON)
        try:
            test()
        finally:
            bystanders.finish()
        assert DAEMON.is_alive(), DAEMON.read_log()
        assert DAEMON.get('/healthz')[0] == 200
    run.__name__ = test.__name__
    return run


def stop():
    """SIGTERM ends it well: nothing leaked, nothing hangs."""
    DAEMON.stop()


DAEMON = Daemon(server='max-connections = 24\nhello-timeout-ms = 1000\nidle-timeout-ms = 4000\n'
                'stall-timeout-ms = 1500\nhttp-timeout-s = 2')
tests = [among_bystanders(test) for test in (
    test_envelopes, test_hellos, test_states, test_bad_frames, test_bad_light, test_nan_map, test_times,
    test_vanishing, test_garbage, test_silent, test_idle, test_reads_nothing, test_long_quiet,
    test_http)]
# Fills the server up, so that no bystander could come in.
tests += [test_many, stop]
try:
    run_tests(tests)
finally:
    if DAEMON.is_alive():
        DAEMON.process.kill()
