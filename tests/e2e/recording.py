# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Sessions recorded by --record and replayed: the same bytes out, the same composites back.

usage: recording.py GNOMOND DIRECTORY_OF_GNOMON_PB2 GNOMON
"""
import json
import os
import random
import signal
import struct
import sys
import time
import zlib

sys.path.insert(0, sys.argv[2])
from folder import Folder  # noqa: E402
from gnomond import *  # noqa: E402,F403
from pictures import exr_bytes, png_bytes, read_png  # noqa: E402
from run import Run, server  # noqa: E402

WIDTH, HEIGHT, FRAMES = 64, 48, 6
CAMERA_JSON = {'width': WIDTH, 'height': HEIGHT, 'fx': WIDTH / 2, 'fy': WIDTH / 2, 'cx': WIDTH / 2,
               'cy': HEIGHT / 2, 'distortion': [0, 0, 0, 0, 0],
               'world_from_camera': [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 2, 0, 0, 0, 1]}
SCENE = '{"objects": [{"mesh": "floor.obj", "role": "real"},' \
    ' {"mesh": "cube.obj", "role": "virtual", "name": "cube", "movable": true}]}'
# Nothing of a room that depends on when something happens: what a replay to the bit needs.
STEADY = 'light-smoothing-ms = 0\nenvironment-noise = 0\nrefine = false\n'


def open_room():
    return Daemon(rooms=Room(STEADY, scene=SCENE))


class Given(Folder):
    """Camera frames, lights, poses, and room for what comes of them."""

    def __init__(self):
        super().__init__()
        self.write('camera.json', json.dumps(CAMERA_JSON).encode())
        os.mkdir(self.at('shots'))
        for i in range(FRAMES):
            shot = random.Random(i).getrandbits(24 * WIDTH * HEIGHT).to_bytes(3 * WIDTH * HEIGHT, 'little')
            self.write('shots/f%03d.png' % i, png_bytes(WIDTH, HEIGHT, shot))
            self.write('light%d.exr' % i, exr_bytes(32, 16, (1 + i, 1, 1)))
        poses = [{'time_s': .2 * i, 'world_from_object': [1, 0, 0, .1 * i, 0, 1, 0, 0, 0, 0, 1, 0,
                                                          0, 0, 0, 1]} for i in range(4)]
        self.write('poses.jsonl', '\n'.join(map(json.dumps, poses)).encode())
        self.recording = self.at('session.gnr')


def begin(daemon, folder, *more, rate='8', recording=None):
    """Probe and viewer, in step, each frame in the light of its number; recorded into one file."""
    step = ('--start-at', '%.3f' % (time.time() + 1), '--rate', rate, '--record',
            recording or folder.recording, *more)
    return (Run('probe', server(daemon), '--files', folder.at('light?.exr'), *step),
            Run('view', server(daemon), '--files', folder.at('shots'), '--camera',
                folder.at('camera.json'), '--out', folder.at('out'), '--sync-light', '1', *step))


SESSION = {}  # the recording and composites of the session that most tests replay


def record(folder):
    """Puts a recorded session of probe and viewer into the folder: the same one for all tests."""
    for _ in range(5):
        if SESSION:
            break
        with open_room() as daemon:
            lamp, viewer = begin(daemon, folder)
            viewer.succeed()
            lamp.succeed()
        with open(folder.at('out/view.json')) as report:
            lights = [f['receipt']['lighting_sequence'] for f in json.load(report)['frames']]
        # A machine that stood still lets environment frames replace each other: not to the bit.
        if lights == list(range(1, FRAMES + 1)):
            SESSION['recording'] = open(folder.recording, 'rb').read()
            SESSION['composites'] = get_composites(folder.at('out'))
        else:
            os.remove(folder.recording)
    assert SESSION, 'this machine is too busy to record in step'
    folder.write(folder.recording, SESSION['recording'])


def replay(daemon, folder, *more, recording=None):
    return Run('replay', server(daemon), recording or folder.recording, *more)


STREAM, SENT, RECEIVED, CLOCK = 1, 2, 3, 4
HEAD = struct.Struct('<4sHHIIqII')


def read_recording(path):
    """The records of a file, as docs/recording.md says, read apart from the program."""
    data = open(path, 'rb').read()
    assert data[:8] == b'\x89GNR\r\n\x1a\n' and data[8:16] == b'\x0d\x0c\x0b\x0a\x01\x00\x50\x00'
    assert zlib.crc32(data[:52]) == struct.unpack_from('<I', data, 52)[0]
    end, n_streams, check = struct.unpack_from('<QII', data, 56)
    assert zlib.crc32(data[56:68]) == check and end == len(data)
    at, records = 80, []
    while at < end:
        magic, kind, flags, stream, size, when, body_check, check = HEAD.unpack_from(data, at)
        assert magic == b'\xf3rec' and flags == 0 and 1 <= stream <= n_streams
        assert zlib.crc32(data[at:at + 28]) == check
        body = data[at + 32:at + 32 + size]
        assert len(body) == size and zlib.crc32(body) == body_check
        records.append((kind, stream, when, body))
        at += 32 + size
    return records


def get_begin(path):
    """When a recording began, CLOCK_MONOTONIC."""
    with open(path, 'rb') as recording:
        return struct.unpack_from('<q', recording.read(40), 32)[0]


def split(message):
    magic, version, flags, kind, stream, n_header, n_payload = ENVELOPE.unpack_from(message)
    assert magic == b'GNOM' and len(message) == 20 + n_header + n_payload
    if kind == 20:
        return kind, pb.EmitterFrame.FromString(message[20:20 + n_header]), message[20 + n_header:]
    return kind, MESSAGES[kind].FromString(message[20:20 + n_header]), message[20 + n_header:]


def list_sent(path):
    """By role: the messages of each stream, [(kind, message, payload, time)]."""
    roles, streams = {}, {}
    for kind, stream, when, body in read_recording(path):
        if kind == STREAM:
            hello = split(body)[1]
            assert not hello.token and not hello.resume_token
            roles[stream] = hello.role
        if kind == SENT:
            streams.setdefault(stream, []).append(split(body) + (when,))
    return {roles[stream]: messages for stream, messages in streams.items()}


def get_frame_span(path):
    """From the first FRAME to the last, s."""
    times = [m[3] for m in list_sent(path)[pb.ROLE_VIEWER] if m[0] == FRAME]
    return (times[-1] - times[0]) * 1e-9


def get_composites(path):
    pictures = {name: read_png(os.path.join(path, name)) for name in sorted(os.listdir(path))
                if name != 'view.json'}
    return list(pictures.values())


def test_to_the_bit():
    """The same bytes go out but for capture times, and the same composites come back: twice."""
    with Given() as folder:
        record(folder)
        first = SESSION['composites']
        assert len(first) == FRAMES and len({p[2] for p in first}) == FRAMES
        for i in range(2):
            again = folder.at('again%d' % i)
            with open_room() as daemon:
                out = replay(daemon, folder, '--expect-equal', '--out', again, '--record',
                             again + '.gnr').succeed('%d composites equal to the bit' % FRAMES)
            streams = os.listdir(again)
            assert len(streams) == 1, streams
            assert get_composites(os.path.join(again, streams[0])) == first
            assert json.load(open(os.path.join(again, streams[0], 'view.json')))['complete']
            then, now = list_sent(folder.recording), list_sent(again + '.gnr')
            assert then.keys() == now.keys() == {pb.ROLE_PROBE, pb.ROLE_VIEWER}
            shifts = set()
            for role in then:
                assert len(then[role]) == len(now[role])
                for old, new in zip(then[role], now[role]):
                    assert old[0] == new[0] and old[2] == new[2], 'another payload'
                    if hasattr(old[1], 'capture_time_ns'):
                        # Captured now, not then; one machine, one clock.
                        age = get_begin(again + '.gnr') + new[3] - new[1].capture_time_ns
                        assert -1e6 <= age < 1e9 or 'behind schedule' in out, age
                        shifts.add((role, new[1].capture_time_ns - old[1].capture_time_ns))
                        new[1].capture_time_ns = old[1].capture_time_ns
                    assert old[1] == new[1], (old[1], new[1])
            # What lay between two captures of one stream lies between them still.
            assert len(shifts) == 2, shifts
            # And they go when they went, where the machine was not kept from it.
            frames = [[m[3] for m in sent[pb.ROLE_VIEWER] if m[0] == FRAME] for sent in (then, now)]
            for k in range(FRAMES):
                off = (frames[1][k] - frames[1][0]) - (frames[0][k] - frames[0][0])
                assert abs(off) < 300e6 or 'behind schedule' in out, off


def test_paces():
    """By order alone, stretched, and drawn together: the composites stay the same."""
    with Given() as folder:
        record(folder)
        length = get_frame_span(folder.recording)
        assert length > .5, length
        for more, least, most in ((('--as-fast-as-possible',), 0, .7 * length),
                                  (('--rate-factor', '.5'), 1.5 * length, 3 * length)):
            for attempt in range(4):  # the machine may be kept from it for a while
                with open_room() as daemon:
                    replay(daemon, folder, '--expect-equal', '--record',
                           folder.at('paced%d.gnr' % attempt), *more).succeed()
                span = get_frame_span(folder.at('paced%d.gnr' % attempt))
                os.remove(folder.at('paced%d.gnr' % attempt))
                if least <= span <= most:
                    break
            else:
                raise AssertionError((more, span))
        with open_room() as daemon:
            loop = replay(daemon, folder, '--loop', '--rate-factor', '5')
            deadline = time.monotonic() + 60
            while daemon.read_log().count(' in room demo as ') < 5:  # the third round
                assert time.monotonic() < deadline, 'never began again'
                time.sleep(.05)
            time.sleep(.2)  # to the end of its greeting
            loop.process.send_signal(signal.SIGINT)
            # A later round begins in the light of the one before: its first frame may differ.
            n = int(loop.succeed().splitlines()[-1].split(' streams')[0])
            assert n >= 4, n
        with open_room() as daemon:
            replay(daemon, folder, '--streams', 'probe', '--expect-equal').fail(
                1, 'no composite came back')


def test_other_light():
    """What is not as recorded is said, with what differs."""
    with Given() as folder:
        record(folder)
        with Daemon(STEADY + 'light-method = median-cut\nlights = 2\n') as daemon:
            out, _ = replay(daemon, folder, '--expect-equal', '--as-fast-as-possible').fail(
                1, '%d of %d composites are not as recorded' % (FRAMES, FRAMES))
            assert 'frame 3: not the recorded composite: ' in out, out
        with open_room() as daemon:  # no light at all
            out, _ = replay(daemon, folder, '--streams', 'viewer', '--rate-factor', '50',
                          '--open-loop', '--expect-equal').fail(1, 'are not as recorded')
            assert 'dropped, though recorded with a result: ' in out, out


def test_three_in_one_file():
    """Probe, viewer and tracker of one room write one file; the object moves again in the replay."""
    with Given() as folder:
        with open_room() as daemon:
            lamp, viewer = begin(daemon, folder)
            hand = Run('track', server(daemon), '--object', 'cube', '--poses',
                       folder.at('poses.jsonl'), '--record', folder.recording)
            for run in (hand, viewer, lamp):
                run.succeed()
        sent = list_sent(folder.recording)
        assert sent.keys() == {pb.ROLE_PROBE, pb.ROLE_VIEWER, pb.ROLE_TRACKER}
        assert [m[0] for m in sent[pb.ROLE_TRACKER]] == [POSE] * 4 + [BYE]
        info = Run('replay', '--info', folder.recording).succeed(
            '3 streams', "tracker 'gnomon track'", 'sent 1 BYE, 4 POSE', 'sent 1 BYE, 1 CAMERA, '
            '%d FRAME' % FRAMES, '1 WELCOME, %d RESULT' % FRAMES)
        assert 'damage' not in info and 'not ended' not in info, info
        with open_room() as daemon:
            replay(daemon, folder, '--record', folder.at('again.gnr')).succeed(
                '3 streams, %d messages' % (2 * FRAMES + 1 + 4 + 3))
            room = json.loads(daemon.get('/api/v1/status')[1])['rooms'][0]
            assert room['poses_in'] == 4, room
        again = list_sent(folder.at('again.gnr'))
        assert [m[1].world_from_object.position_m[0] for m in again[pb.ROLE_TRACKER][:4]] == \
            [m[1].world_from_object.position_m[0] for m in sent[pb.ROLE_TRACKER][:4]]


def test_killed_writer():
    """A viewer that is killed harms neither the probe's recording nor what it had written itself."""
    with Given() as folder:
        with open_room() as daemon:
            lamp, viewer = begin(daemon, folder, '--loop', rate='20')
            viewer.wait_for('frame 12:')
            viewer.process.kill()
            viewer.end()
            time.sleep(.3)
            lamp.process.send_signal(signal.SIGINT)
            lamp.succeed()
        info = Run('replay', '--info', folder.recording).succeed('2 streams', 'not ended by BYE')
        assert info.count('not ended by BYE') == 1, info
        sent = list_sent(folder.recording)
        n = sum(m[0] == FRAME for m in sent[pb.ROLE_VIEWER])
        assert n >= 11 and sent[pb.ROLE_PROBE][-1][0] == BYE
        with open_room() as daemon:
            # At this rate the next light may come before a frame is begun: when recorded, or now.
            replay(daemon, folder, '--pin-light').succeed('%d frames, ' % n, ', 0 not')


def test_no_room():
    """A recording that may not grow ends with a sentence; the session does not notice."""
    with Given() as folder, open_room() as daemon:
        lamp, viewer = begin(daemon, folder, '--record-max', '60KiB')
        status, out, err = viewer.end()
        assert status == 0 and ' %d results' % FRAMES in out, (out, err)
        assert 'the recording ends here: it may grow to' in err, err
        lamp.end()
        assert os.path.getsize(folder.recording) <= 60 << 10
        Run('replay', '--info', folder.recording).succeed('2 streams')
        # The same with a disk that is full, as far as a process can be shown one.
        full = folder.at('full.gnr')
        lamp = Run('probe', server(daemon), '--files', folder.at('light?.exr'), '--record', full,
                   limit=4096)
        status, out, err = lamp.end()
        assert status == 0 and '%d environment frames sent' % FRAMES in out, (out, err)
        assert err.count('\n') == 1 and 'the recording ends here: File too large' in err, err
        n = sum(kind == SENT for kind, *_ in read_recording(full))
        assert 0 < n < FRAMES
        with open_room() as other:
            replay(other, folder, recording=full).succeed('1 streams, %d messages' % n)


def test_hostile_files():
    with Given() as folder, open_room() as daemon:
        record(folder)
        data = open(folder.recording, 'rb').read()
        cases = (('nothing', b'', 'too short'), ('text', b'a text\n' * 40, 'no recording'),
                 ('noise', random.Random(1).randbytes(5000), 'no recording'),
                 ('later', data[:12] + b'\x02' + data[13:], 'another version'),
                 ('header', data[:20] + b'?' + data[21:], 'header is damaged'))
        for name, content, words in cases:
            path = folder.write(name, content)
            for more in ((), ('--info',)):
                replay(daemon, folder, *more, recording=path).fail(1, name + ': ', words)
        replay(daemon, folder, recording=folder.at('none')).fail(1, 'No such file')
        # Cut in the middle: what is there is replayed, and what is missing is said.
        cut = folder.write('cut', data[:len(data) // 2])
        replay(daemon, folder, '--as-fast-as-possible', recording=cut).succeed('the file is cut: ', ' frames, ')
        status, out, _ = Run('replay', '--info', cut).end()
        assert status == 1 and 'bytes are missing' in out, out
        # Noise in the middle: what is left around it.
        noisy = bytearray(data)
        noisy[len(data) // 2:len(data) // 2 + 3000] = random.Random(2).randbytes(3000)
        out = replay(daemon, folder, '--as-fast-as-possible',
                     recording=folder.write('noisy', noisy)).succeed('damaged in ')
        assert ' 0 messages' not in out, out
        # A message that no client sends, whole and with every checksum right.
        body = envelope(FRAME, 4, 0) + b'\xff\xff\xff\xff'
        head = HEAD.pack(b'\xf3rec', SENT, 0, 1, len(body), 1, zlib.crc32(body), 0)
        bad = bytearray(data) + head[:28] + struct.pack('<I', zlib.crc32(head[:28])) + body
        struct.pack_into('<Q', bad, 56, len(bad))
        struct.pack_into('<I', bad, 68, zlib.crc32(bad[56:68]))
        Run('replay', '--info', folder.write('bad', bad)).succeed('1 messages that this version')


def test_usage():
    with Given() as folder, open_room() as daemon:
        folder.write('other', b'something of mine that must stay')
        Run('probe', server(daemon), '--files', folder.at('light0.exr'), '--record',
            folder.at('other')).fail(1, 'will not be overwritten')
        assert open(folder.at('other'), 'rb').read() == b'something of mine that must stay'
        Run('probe', server(daemon), '--files', folder.at('light0.exr'), '--record',
            '/nowhere/r.gnr').fail(1, '/nowhere/r.gnr: No such file')
        record(folder)
        Run('replay').fail(2)
        replay(daemon, folder, '--as-fast-as-possible', '--open-loop').fail(2, 'give one')
        replay(daemon, folder, '--as-fast-as-possible', '--loop').fail(2, '--loop')
        replay(daemon, folder, '--as-fast-as-possible', '--rate-factor', '2').fail(2, 'one of them')
        replay(daemon, folder, '--streams', 'screen').fail(1, 'no stream of such a role')
        n_before = daemon.read_log().count(' in room demo as ')
        late = replay(daemon, folder, '--rate-factor', '.05')
        deadline = time.monotonic() + 60
        while daemon.read_log().count(' in room demo as ') < n_before + 2:
            assert time.monotonic() < deadline, 'never connected'
            time.sleep(.05)
        time.sleep(.3)  # to the end of its greeting
        daemon.kill()
        status, _, err = late.end()
        assert status == 1 and 'is lost: ' in err, err
        replay(daemon, folder).fail(1, 'Connection refused')


run_tests([test_to_the_bit, test_paces, test_other_light, test_three_in_one_file,
           test_killed_writer, test_no_room, test_hostile_files, test_usage])
