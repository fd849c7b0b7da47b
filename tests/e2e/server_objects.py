# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""A tracker moves an object of the scene: it and its shadow move for every viewer; bad poses move
nothing and disturb nobody.

usage: server_objects.py GNOMOND DIRECTORY_OF_GNOMON_PB2 GNOMON
"""
import json
import math
import os
import signal
import subprocess
import sys
import time

sys.path.insert(0, sys.argv[2])
from gnomond import *  # noqa: E402,F403

GNOMON = os.environ.get('CLIENT_UNDER_TEST') or sys.argv[3]
SCENE = '{"objects": [{"mesh": "floor.obj", "role": "real"},' \
    ' {"mesh": "cube.obj", "role": "virtual", "name": "cube", "movable": true}]}'


def open_room():
    return Daemon(rooms=Room(scene=SCENE))


def tracker(daemon, **hello):
    return Client(daemon, pb.ROLE_TRACKER, **hello)


def pose(x=0, y=0, z=0, **fields):
    where = pb.Transform(orientation=[1, 0, 0, 0], position_m=[x, y, z])
    values = dict(object='cube', world_from_object=where, time_ns=time.monotonic_ns())
    values.update(fields)
    return pb.Pose(**values)


def read_room(daemon):
    return json.loads(daemon.get('/api/v1/status')[1])['rooms'][0]


def wait_for(daemon, key, n):
    deadline = time.monotonic() + 60
    while read_room(daemon)[key] < n:
        assert time.monotonic() < deadline, read_room(daemon)
        time.sleep(.02)


def look(viewer):
    """The pixels that differ from the picture sent: the object and its shadow."""
    _, payload = viewer.expect_result(viewer.send_frame(lighting_wait_ms=60000))
    return {i for i in range(len(payload) // 3) if payload[3 * i:3 * i + 3] != b'\x80\x80\x80'}


def centre(pixels, width=32):
    return (sum(i % width for i in pixels) / len(pixels), sum(i // width for i in pixels) / len(pixels))


def test_the_object_and_its_shadow_move():
    with open_room() as daemon, Viewer(daemon) as viewer, Viewer(daemon) as other, \
            probe(daemon) as lamp, tracker(daemon) as hand:
        light_up(lamp, 1)
        first = look(viewer)
        assert first and look(other) == first
        hand.send(POSE, pose(.3))
        wait_for(daemon, 'poses_in', 1)
        moved = look(viewer)
        assert look(other) == moved
        shift = centre(moved)[0] - centre(first)[0]
        assert abs(shift) > 2, (centre(first), centre(moved))
        hand.send(POSE, pose(-.3))
        wait_for(daemon, 'poses_in', 2)
        back = centre(look(viewer))[0] - centre(first)[0]
        assert back * shift < 0 and abs(abs(back) - abs(shift)) < 2, (shift, back)
        hand.send(POSE, pose(50))  # out of the picture: nothing is left of it
        wait_for(daemon, 'poses_in', 3)
        assert look(viewer) == set()
        hand.send(POSE, pose(0))
        wait_for(daemon, 'poses_in', 4)
        assert look(viewer) == first


def test_a_move_ends_refining():
    with open_room() as daemon, Viewer(daemon) as viewer, probe(daemon) as lamp, \
            tracker(daemon) as hand:
        light_up(lamp, 1)

        def see():
            result, payload = viewer.expect_result(viewer.send_frame(lighting_wait_ms=60000))
            return result.receipt, payload

        receipt, first = see()
        while receipt.refined_passes < 8:
            receipt, first = see()
        hand.send(POSE, pose(.3))
        wait_for(daemon, 'poses_in', 1)
        receipt, moved = see()
        assert receipt.refined_passes == 0 and receipt.rays_primary > 0, receipt
        assert 'an object has moved since the last frame' in [line.why for line in receipt.left_out]
        assert moved != first
        while receipt.refined_passes < 8:
            receipt, payload = see()
        off = max(abs(a - b) for a, b in zip(payload, moved))
        assert off <= 24, 'what is refined is not where the object is: %d codes' % off


def test_the_status_says_who_moves_what():
    with open_room() as daemon, tracker(daemon) as hand:
        cube, = read_room(daemon)['movable']
        assert cube['name'] == 'cube' and cube['role'] == 'virtual' and cube['poses'] == 0, cube
        assert cube['age_ms'] is None and cube['session'] is None, cube
        now = time.monotonic_ns()
        for i in range(5):
            hand.send(POSE, pose(.01 * i, time_ns=now - 10**9 + i * 10**8))
        wait_for(daemon, 'poses_in', 5)
        room = read_room(daemon)
        cube, = room['movable']
        assert cube['poses'] == 5 and abs(cube['rate_hz'] - 10) < .1, cube
        assert abs(cube['position_m'][0] - .04) < 1e-9 and cube['age_ms'] > 500, cube
        assert room['trackers'] == 1 and room['sessions'][0]['role'] == 'tracker', room
        assert cube['session'] == room['sessions'][0]['id'] and room['sessions'][0]['poses_in'] == 5
        metrics = daemon.get('/metrics')[1].decode()
        assert 'gnomon_object_poses_received_total{room="demo"} 5\n' in metrics, metrics


def test_the_newest_capture_wins():
    with open_room() as daemon, tracker(daemon) as a, tracker(daemon) as b:
        now = time.monotonic_ns()
        a.send(POSE, pose(.1, time_ns=now))
        wait_for(daemon, 'poses_in', 1)
        for time_ns in (now, now - 1, 1, -2**63):
            b.send(POSE, pose(.2, time_ns=time_ns))
        wait_for(daemon, 'poses_in', 5)
        room = read_room(daemon)
        assert room['poses_late'] == 4 and room['movable'][0]['position_m'][0] == .1, room
        b.send(POSE, pose(.3, time_ns=0))  # when it comes
        wait_for(daemon, 'poses_in', 6)
        a.close()
        b.close()
        deadline = time.monotonic() + 60
        while read_room(daemon)['trackers'] > 0 and time.monotonic() < deadline:
            time.sleep(.02)
        room = read_room(daemon)
        assert room['trackers'] == 0 and room['movable'][0]['position_m'][0] == .3, room


def test_bad_poses_move_nothing():
    ahead = time.monotonic_ns() + 3600 * 10**9
    gentle = [
        (pose(object='ball'), pb.ERROR_CODE_BAD_VALUE, ('ball', 'movable objects are cube')),
        (pose(object='floor.obj'), pb.ERROR_CODE_BAD_VALUE, ('floor.obj', 'cube')),
        (pose(object=''), pb.ERROR_CODE_UNSUPPORTED, ('names a movable object',)),
        (pose(time_ns=ahead), pb.ERROR_CODE_BAD_VALUE, ('ahead', 'PING')),
        (pose(time_ns=2**63 - 1), pb.ERROR_CODE_BAD_VALUE, ('ahead',)),
    ]
    turned = [[0, 0, 0, 0], [2, 0, 0, 0], [math.nan, 0, 0, 1], [1, math.inf, 0, 0]]
    fatal = [pb.Transform(orientation=q, position_m=[0, 0, 0]) for q in turned]
    fatal += [pb.Transform(orientation=[1, 0, 0, 0], position_m=p)
              for p in ([math.nan, 0, 0], [0, 1e7, 0], [0, 0, -math.inf])]
    with open_room() as daemon:
        bystanders = Bystanders(daemon)
        with tracker(daemon) as hand:
            for message, code, words in gentle:
                hand.send(POSE, message)
                said, _ = hand.expect(ERROR)
                assert said.code == code and not said.fatal, said
                assert all(word in said.sentence for word in words), said.sentence
            hand.send(POSE, pose(.1))  # the session goes on
            wait_for(daemon, 'poses_in', len(gentle))
        for where in fatal:
            with tracker(daemon) as hand:
                hand.send(POSE, pose(world_from_object=where))
                hand.expect_fatal(pb.ERROR_CODE_BAD_VALUE)
        with tracker(daemon) as hand:
            hand.send(POSE, pb.Pose(object='cube'))
            hand.expect_fatal(pb.ERROR_CODE_BAD_VALUE)
        with tracker(daemon) as hand:
            hand.send(CAMERA, camera())
            assert 'tracker sends POSE' in hand.expect_fatal(pb.ERROR_CODE_UNEXPECTED)
        with probe(daemon) as lamp:
            lamp.send(POSE, pose())
            lamp.expect_fatal(pb.ERROR_CODE_UNEXPECTED)
        assert read_room(daemon)['movable'][0]['position_m'] == [.1, 0, 0]
        bystanders.finish()


def test_a_flood_of_poses():
    """Hundreds per frame: the latest counts, a viewer's frames go on."""
    with open_room() as daemon:
        bystanders = Bystanders(daemon)
        with tracker(daemon) as hand:
            for i in range(3000):
                hand.send(POSE, pose(.3 * math.sin(i), .3 * math.cos(i)))
            hand.send(POSE, pose(.25))
            wait_for(daemon, 'poses_in', 3001)
            assert read_room(daemon)['movable'][0]['position_m'] == [.25, 0, 0]
        bystanders.finish()


def run_track(daemon, *arguments):
    done = subprocess.run([GNOMON, 'track', '--server', '%s:%d' % daemon.address, *arguments],
                          capture_output=True, text=True, timeout=60)
    return done.returncode, done.stdout, done.stderr


def matrix(x, scale=1):
    return [scale, 0, 0, x, 0, scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, 1]


def test_the_track_command():
    room = Room(scene=SCENE)
    lines = [{'time_s': .02 * i, 'world_from_object': matrix(.05 * i, 1 + .01 * (i % 2))}
             for i in range(5)]
    path = room.write('poses.jsonl', ''.join(json.dumps(line) + '\n' for line in lines))
    bad = [
        ({'time_s': 1, 'world_from_object': matrix(0, 0)}, 'singular'),
        ({'time_s': 1, 'world_from_object': matrix(0, -1)}, 'mirrors'),
        ({'time_s': 1, 'world_from_object': matrix(0, 1.5)}, 'scales'),
        ({'time_s': 1, 'world_from_object': [1, 2]}, '16'),
        ({'time_s': 0, 'world_from_object': matrix(0)}, 'time_s'),
        ({'time_s': 1, 'word_from_object': matrix(0)}, 'unknown key'),
    ]
    with Daemon(rooms=room) as daemon:
        status, out, err = run_track(daemon, '--object', 'cube', '--poses', path)
        assert status == 0 and '5 poses sent' in out, (status, out, err)
        cube, = read_room(daemon)['movable']
        assert cube['poses'] == 5 and abs(cube['position_m'][0] - .2) < 1e-9, cube
        status, out, err = run_track(daemon, '--object', 'cube', '--orbit', '0.5', '--rate', '50',
                                     '--count', '20')
        assert status == 0 and '20 poses sent' in out, (status, out, err)
        x, y, _ = read_room(daemon)['movable'][0]['position_m']
        assert abs(math.hypot(x, y) - .5) < 1e-6, (x, y)
        status, out, err = run_track(daemon, '--object', 'ball', '--poses', path)
        assert status == 1 and "'ball'" in err and 'cube' in err, (status, out, err)
        for line, word in bad:
            text = json.dumps({'time_s': .5, 'world_from_object': matrix(0)}) + '\n' + json.dumps(line)
            status, out, err = run_track(daemon, '--object', 'cube', '--poses',
                                         room.write('bad.jsonl', text))
            assert status == 1 and word in err and 'bad.jsonl' in err and 'line 2' in err, (line, err)
        for arguments, word in (((), '--poses'), (('--poses', path, '--orbit', '1'), '--orbit'),
                                (('--poses', '/nowhere'), '/nowhere')):
            status, out, err = run_track(daemon, '--object', 'cube', *arguments)
            assert status == (1 if '/nowhere' in arguments else 2) and word in err, (arguments, err)


def test_a_tracker_that_slept_does_not_hurry():
    with open_room() as daemon:
        track = subprocess.Popen([GNOMON, 'track', '--server', '%s:%d' % daemon.address, '--object',
                                  'cube', '--orbit', '1', '--rate', '20', '--count', '30'],
                                 stdout=subprocess.PIPE, text=True)
        wait_for(daemon, 'poses_in', 1)
        track.send_signal(signal.SIGSTOP)
        time.sleep(3)
        track.send_signal(signal.SIGCONT)
        out, _ = track.communicate(timeout=60)
        assert track.returncode == 0 and '30 poses sent, ' in out and 'behind schedule' in out, out


run_tests([test_the_object_and_its_shadow_move, test_a_move_ends_refining,
           test_the_status_says_who_moves_what,
           test_the_newest_capture_wins, test_bad_poses_move_nothing, test_a_flood_of_poses,
           test_the_track_command, test_a_tracker_that_slept_does_not_hurry])
