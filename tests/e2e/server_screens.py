# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Pictures streamed onto a TV of the scene light what stands beside it.

usage: server_screens.py GNOMOND DIRECTORY_OF_GNOMON_PB2 GNOMON
"""
import json
import os
import subprocess
import sys
import time

sys.path.insert(0, sys.argv[2])
from gnomond import *  # noqa: E402,F403
from pictures import exr_bytes, png_bytes  # noqa: E402

GNOMON = os.environ.get('CLIENT_UNDER_TEST') or sys.argv[3]
EMITTER_FRAME = 20
# A quad at x = -0.4, 0.8 m wide, that faces +x; the cube stands at the origin.
TV = 'v -0.4 -0.4 0.3\nv -0.4 0.4 0.3\nv -0.4 0.4 0.9\nv -0.4 -0.4 0.9\n' \
    'vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n'
SCENE = '{"objects": [{"mesh": "floor.obj", "role": "real"}, {"mesh": "cube.obj", "role": "virtual"},' \
    ' {"mesh": "tv.obj", "role": "real", "material": {"type": "diffuse", "albedo": [0, 0, 0],' \
    ' "emission_stream": "tv", "emission_scale": 4}},' \
    ' {"mesh": "tv.obj", "role": "real", "material": {"type": "diffuse", "emission_stream": "wall"},' \
    ' "world_from_object": [1,0,0,0, 0,1,0,9, 0,0,1,0, 0,0,0,1]}]}'
RED, BLUE, BLACK = b'\xff\x10\x10', b'\x10\x10\xff', b'\0\0\0'


def open_room(settings=''):
    room = Room(settings, scene=SCENE)
    room.write('tv.obj', TV)
    return Daemon(rooms=room)


def screen(daemon, **hello):
    return Client(daemon, pb.ROLE_SCREEN, **hello)


def picture(sequence, color, **fields):
    values = dict(stream='tv', sequence=sequence, width=4, height=2, pixel_format=pb.PIXEL_FORMAT_RGB8,
                  capture_time_ns=time.monotonic_ns())
    values.update(fields)
    return pb.EmitterFrame(**values), color * (values['width'] * values['height'])


def read_room(daemon):
    return json.loads(daemon.get('/api/v1/status')[1])['rooms'][0]


def wait_for_shown(daemon, n):
    deadline = time.monotonic() + 60
    while read_room(daemon)['emitter_frames_shown'] < n:
        assert time.monotonic() < deadline, read_room(daemon)
        time.sleep(.02)


def look(viewer):
    """The top of the cube: R, G, B."""
    _, payload = viewer.expect_result(viewer.send_frame(lighting_wait_ms=60000))
    at = 3 * (12 * 32 + 16)
    return payload[at:at + 3]


def test_red_to_blue_in_the_dark():
    """No probe at all: the TV alone lights the cube."""
    with open_room() as daemon, Viewer(daemon) as viewer, screen(daemon) as tv:
        tv.send(EMITTER_FRAME, *picture(1, RED))
        wait_for_shown(daemon, 1)
        assert read_room(daemon)['near_lights'] > 0
        red = look(viewer)
        tv.send(EMITTER_FRAME, *picture(2, BLUE))
        wait_for_shown(daemon, 2)
        blue = look(viewer)
        tv.send(EMITTER_FRAME, *picture(3, BLACK))
        wait_for_shown(daemon, 3)
        off = look(viewer)
        print('# beside red %s, beside blue %s, off %s' % (list(red), list(blue), list(off)))
        assert red[0] > 60 and red[0] > 2 * red[2], red
        assert blue[2] > 60 and blue[2] > 2 * blue[0], blue
        assert off == b'\0\0\0', off


def test_pieces():
    """Both screens are cut into as many lights as the room asks for; of the dark one none is used."""
    for settings, n in (('', 32), ('emitter-pieces = 1', 1), ('emitter-pieces = 200', 200)):
        with open_room(settings) as daemon, Viewer(daemon) as viewer, screen(daemon) as tv:
            tv.send(EMITTER_FRAME, *picture(1, RED))
            wait_for_shown(daemon, 1)
            look(viewer)
            found = read_room(daemon)['near_lights']
            assert n / 2 <= found <= n, (settings, found)


def test_beside_a_probe():
    """The probe's light stays as it is: nothing of it is made again for a picture."""
    with open_room() as daemon, Viewer(daemon) as viewer, screen(daemon) as tv, \
            probe(daemon) as lamp:
        light_up(lamp, 1, pixels=struct.pack('<f', .2) * (3 * 32 * 16))
        grey = look(viewer)
        before = read_room(daemon)['light']
        for i, color in enumerate((RED, BLUE, BLACK), 1):
            tv.send(EMITTER_FRAME, *picture(i, color))
            wait_for_shown(daemon, i)
            seen = look(viewer)
            if color != BLACK:
                strong, weak = (0, 2) if color == RED else (2, 0)
                assert seen[strong] > grey[strong] + 20, (list(grey), list(seen))
                assert seen[weak] < grey[weak] + 10, (list(grey), list(seen))
        assert seen == grey, (list(grey), list(seen))
        after = read_room(daemon)['light']
        assert (after['published'], after['sequence']) == (before['published'], 1), after
        light_up(lamp, 2, pixels=struct.pack('<f', .2) * (3 * 32 * 16))  # and the TV's light stays
        tv.send(EMITTER_FRAME, *picture(9, RED))
        wait_for_shown(daemon, 4)
        light_up(lamp, 3, pixels=struct.pack('<f', .2) * (3 * 32 * 16))
        viewer.expect_result(viewer.send_frame(lighting_min_sequence=3, lighting_wait_ms=60000))
        assert look(viewer)[0] > grey[0] + 20


def test_refusals():
    with open_room() as daemon, Viewer(daemon) as viewer, screen(daemon) as tv:
        def expect_complaint(sequence, *words):
            message, _ = tv.expect(ERROR)
            assert not message.fatal and message.about_type == EMITTER_FRAME, message
            assert message.about_id == sequence, message
            assert all(word in message.sentence for word in words), message.sentence

        tv.send(EMITTER_FRAME, *picture(1, RED, stream='radio'))
        expect_complaint(1, "'radio'", 'tv, wall')
        tv.send(EMITTER_FRAME, picture(2, RED, pixel_format=pb.PIXEL_FORMAT_JPEG)[0], b'no JPEG')
        expect_complaint(2, 'JPEG')
        assert read_room(daemon)['emitter_frames_refused'] == 2
        tv.send(EMITTER_FRAME, *picture(3, RED))  # the session goes on
        wait_for_shown(daemon, 1)
        assert look(viewer)[0] > 60
        tv.send(EMITTER_FRAME, *picture(3, RED))
        assert 'not above the last one' in tv.expect_fatal(pb.ERROR_CODE_BAD_VALUE)
    with open_room() as daemon:
        for role in (pb.ROLE_PROBE, pb.ROLE_VIEWER):
            with Client(daemon, role) as rude:
                rude.send(EMITTER_FRAME, *picture(1, RED))
                rude.expect_fatal(pb.ERROR_CODE_UNEXPECTED)
        with screen(daemon) as rude:
            rude.send(ENVIRONMENT_FRAME, *environment(1))
            assert 'EMITTER_FRAME' in rude.expect_fatal(pb.ERROR_CODE_UNEXPECTED)
        for message, payload in (picture(1, RED, width=5000), (picture(1, RED)[0], b'short'),
                                 picture(1, RED, scale=-1), picture(1, RED, stream='')):
            with screen(daemon) as rude:
                rude.send(EMITTER_FRAME, message, payload[:1 << 20])
                rude.expect_fatal(pb.ERROR_CODE_BAD_VALUE)
    with Daemon() as daemon, screen(daemon) as tv:
        tv.send(EMITTER_FRAME, *picture(1, RED))
        assert 'emission_stream' in tv.expect(ERROR)[0].sentence


def gnomon(daemon, *arguments):
    done = subprocess.run([GNOMON, 'screen', '--server=%s:%d' % daemon.address, *arguments],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=120)
    return done.returncode, done.stdout.decode(), done.stderr.decode()


def test_command():
    """gnomon screen: files of every kind, one after another."""
    folder = make_folder('files')

    def at(name, data=None):
        if data is not None:
            with open(os.path.join(folder, name), 'wb') as out:
                out.write(data)
        return os.path.join(folder, name)

    at('a.png', png_bytes(4, 2, RED * 8))
    at('b.exr', exr_bytes(4, 2, (.01, .01, 1)))
    with open_room() as daemon, Viewer(daemon) as viewer:
        status, out, err = gnomon(daemon, '--stream', 'tv', '--files', at('a.png'))
        assert (status, err) == (0, '') and '1 pictures sent' in out, (status, out, err)
        wait_for_shown(daemon, 1)
        red = look(viewer)
        assert red[0] > 60 and red[0] > 2 * red[2], list(red)
        status, out, err = gnomon(daemon, '--stream', 'tv', '--files', at('*.*'), '--rate', '50',
                                  '--loop', '--count', '4')
        assert (status, err) == (0, '') and '4 pictures sent' in out, (status, out, err)
        deadline = time.monotonic() + 60
        while not look(viewer)[2] > 60:
            assert time.monotonic() < deadline, read_room(daemon)
        blue = look(viewer)
        assert blue[2] > 2 * blue[0], list(blue)
        status, out, err = gnomon(daemon, '--stream', 'radio', '--files', at('a.png'))
        assert status == 1 and 'tv, wall' in err and err.count('\n') == 1, (status, err)
        assert 'sent' not in out, out
        at('wide.png', png_bytes(2049, 1, RED * 2049))
        status, out, err = gnomon(daemon, '--stream', 'tv', '--files', at('wide.png'))
        assert status == 1 and '2049x1' in err and '2048' in err, (status, err)
        status, out, err = gnomon(daemon, '--files', at('a.png'))
        assert status == 2 and 'stream' in err, (status, err)


run_tests([test_red_to_blue_in_the_dark, test_pieces, test_beside_a_probe, test_refusals, test_command])
