# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""gnomon view and track take poses from markers in the pictures: each frame goes with the pose of
its own picture, one without markers comes back as it is.

usage: markers.py GNOMOND DIRECTORY_OF_GNOMON_PB2 GNOMON MARKER_SHOTS yes|no (built with libav)
"""
import json
import math
import os
import re
import subprocess
import sys
import time

sys.path.insert(0, sys.argv[2])
from folder import Folder  # noqa: E402
from gnomond import *  # noqa: E402,F403
from pictures import exr_bytes, png_bytes, read_png, y4m_bytes  # noqa: E402

GNOMON = os.environ.get('CLIENT_UNDER_TEST') or sys.argv[3]
SHOTS = 6  # picture 3 has no marker in it
SCENE = '{"objects": [{"mesh": "floor.obj", "role": "real"},' \
    ' {"mesh": "cube.obj", "role": "virtual", "name": "cube", "movable": true}]}'
CAMERA = {'width': 320, 'height': 240, 'fx': 330, 'fy': 330, 'cx': 160, 'cy': 120,
          'distortion': [-0.15, 0.05, 0.001, -0.001, 0]}
MARKERS = {'dictionary': '4x4_50', 'bodies': [
    {'name': 'world', 'markers': [{'id': 7, 'size': 0.08}]},
    {'name': 'cube', 'grids': [{'columns': 2, 'rows': 2, 'size': 0.045, 'gap': 0.01,
                                'first_id': 20}]}]}


class Desk(Folder):
    """A folder with the shots, their truth, the markers' and the camera's files."""

    def __init__(self):
        super().__init__()
        self.write('markers.json', json.dumps(MARKERS))
        self.write('camera.json', json.dumps(CAMERA))
        os.mkdir(self.at('shots'))
        out = subprocess.run([sys.argv[4], self.at('markers.json'), self.at('shots'), str(SHOTS)],
                             check=True, capture_output=True, text=True).stdout
        self.truth = [json.loads(line) for line in out.splitlines()]
        with open(self.at('light.exr'), 'wb') as light:
            light.write(exr_bytes(32, 16, (1, 1, 1)))

    def write(self, name, text):
        with open(self.at(name), 'w') as out:
            out.write(text)
        return self.at(name)


def gnomon(*arguments):
    done = subprocess.run([GNOMON, *arguments], capture_output=True, text=True, timeout=200)
    return done.returncode, done.stdout, done.stderr


def succeed(*arguments):
    status, out, err = gnomon(*arguments)
    assert status == 0 and not err, (status, out, err)
    return out


def refuse(status, words, *arguments):
    got, out, err = gnomon(*arguments)
    assert got == status and err.count('\n') == 1, (got, out, err)
    for word in words:
        assert word in err, '%r is not in %r' % (word, err)


def server(daemon):
    return '--server=%s:%d' % daemon.address


def give_light(daemon, desk):
    succeed('probe', server(daemon), '--files', desk.at('light.exr'))


def pixels(path):
    return read_png(path)[2]


def differing(a, b, codes):
    """The share of pixels of which a channel differs by more."""
    n = sum(max(abs(a[i + k] - b[i + k]) for k in range(3)) > codes for i in range(0, len(a), 3))
    return n / (len(a) / 3)


def read_poses(path):
    with open(path) as lines:
        return [json.loads(line) for line in lines]


def far(a, b):
    """Largest difference of two matrices' translations, m, and of their rotations."""
    return (max(abs(a[i] - b[i]) for i in (3, 7, 11)),
            max(abs(a[i] - b[i]) for i in (0, 1, 2, 4, 5, 6, 8, 9, 10)))


def inverse(m):
    r = [m[4 * j + i] for i in range(3) for j in range(3)]
    t = [-sum(r[3 * i + j] * m[4 * j + 3] for j in range(3)) for i in range(3)]
    return [*r[0:3], t[0], *r[3:6], t[1], *r[6:9], t[2], 0, 0, 0, 1]


def see_the_same_in_a_video(daemon, desk):
    """All of it again from a video of the shots, whose codes are rounded twice."""
    shots = [pixels(desk.at('shots/shot-%02d.png' % i)) for i in range(SHOTS)]
    with open(desk.at('shots.y4m'), 'wb') as video:
        video.write(y4m_bytes(CAMERA['width'], CAMERA['height'], 10, shots))
    out = succeed('view', server(daemon), '--video', desk.at('shots.y4m'), '--camera',
                  desk.at('camera.json'), '--markers', desk.at('markers.json'), '--no-steady',
                  '--out', desk.at('from-video'))
    assert '%d results' % SHOTS in out and '1 frames without' in out, out
    poses = [read_poses(desk.at(where + '/poses.jsonl')) for where in ('out', 'from-video')]
    for i, (still, moving) in enumerate(zip(*poses, strict=True)):
        assert moving['time_ns'] == 100000000 * i, moving
        for a, b in zip(still['bodies'], moving['bodies'], strict=True):
            off = far(a['camera_from_body'], b['camera_from_body'])
            assert a['name'] == b['name'] and off[0] < 0.001 and off[1] < 0.003, (a, b)
        if still['bodies']:
            name = sorted(n for n in os.listdir(desk.at('from-video')) if n.endswith('.png'))[i]
            share = differing(pixels(desk.at('out/shot-%02d.png' % i)),
                              pixels(desk.at('from-video/' + name)), 24)
            assert share < 0.01, 'picture %d: %.4f of the pixels differ' % (i, share)


def test_each_frame_has_the_pose_of_its_own_picture():
    with Daemon(rooms=Room(scene=SCENE)) as daemon, Desk() as desk:
        give_light(daemon, desk)
        out = succeed('view', server(daemon), '--files', desk.at('shots'), '--camera',
                      desk.at('camera.json'), '--markers', desk.at('markers.json'), '--no-steady',
                      '--debug-markers', desk.at('seen'), '--out', desk.at('out'))
        assert '%d results' % SHOTS in out and '1 frames without' in out, out
        # What was measured is the truth of that picture: no two of them are near each other.
        poses = read_poses(desk.at('out/poses.jsonl'))
        assert [p['picture'] for p in poses] == ['shot-%02d' % i for i in range(SHOTS)]
        for truth, line in zip(desk.truth, poses):
            bodies = {b['name']: b for b in line['bodies']}
            assert ('world' in bodies) == (not truth['empty']), line
            if not truth['empty']:
                off = far(inverse(bodies['world']['camera_from_body']), truth['world_from_camera'])
                assert off[0] < 0.003 and off[1] < 0.006, (line, truth)
                assert bodies['world']['error_mm'] < 1, line
        if sys.argv[5] == 'yes':
            see_the_same_in_a_video(daemon, desk)
        assert sorted(os.listdir(desk.at('seen'))) == ['shot-%02d.png' % i for i in range(SHOTS)]
        # And the composites are those of the true poses.
        frames = [{'time_s': .1 * i, 'picture': 'shots/shot-%02d.png' % i,
                   'environment': 'light.exr', 'world_from_camera': t['world_from_camera']}
                  for i, t in enumerate(desk.truth)]
        desk.write('sequence.json', json.dumps(
            {'format': 'gnomon-sequence 1', 'camera': CAMERA,
             'environment': {'projection': 'latlong'}, 'frames': frames}))
        succeed('view', server(daemon), '--sequence', desk.path, '--out', desk.at('true'))
        for i, truth in enumerate(desk.truth):
            name = 'shot-%02d.png' % i
            mine, true = pixels(desk.at('out/' + name)), pixels(desk.at('true/' + name))
            shot = pixels(desk.at('shots/' + name))
            if truth['empty']:
                assert mine == shot, 'a frame without a marker did not come back as it was'
                continue
            assert differing(true, shot, 24) > 0.02, 'the cube is not in picture %d' % i
            share = differing(mine, true, 24)
            assert share < 0.01, 'picture %d: %.4f of its pixels are of another pose' % (i, share)


def test_a_short_text_and_steady_poses():
    with Daemon(rooms=Room(scene=SCENE)) as daemon, Desk() as desk:
        give_light(daemon, desk)
        out = succeed('view', server(daemon), '--files', desk.at('shots/shot-00.png'), '--loop',
                      '--count', '4', '--rate', '50', '--camera', desk.at('camera.json'),
                      '--marker', '4x4_50:7:0.08', '--out', desk.at('out'))
        assert '4 poses from 4 pictures' in out and 'at rest' in out, out
        for line in read_poses(desk.at('out/poses.jsonl')):
            body, = line['bodies']
            off = far(inverse(body['camera_from_body']), desk.truth[0]['world_from_camera'])
            assert off[0] < 0.003, (off, line)


def test_a_recording_gives_the_same_poses_each_time():
    with Daemon(rooms=Room(scene=SCENE)) as daemon, Desk() as desk:
        give_light(daemon, desk)
        said = []
        for _ in range(2):
            succeed('view', server(daemon), '--files', desk.at('shots'), '--loop', '--count', '18',
                    '--rate', '100', '--camera', desk.at('camera.json'), '--markers',
                    desk.at('markers.json'), '--out', desk.at('out'))
            with open(desk.at('out/poses.jsonl')) as lines:
                said.append(lines.read())
        assert said[0] == said[1] and said[0].count('\n') == 18, said


def test_an_object_follows_its_markers():
    with Daemon(rooms=Room(scene=SCENE)) as daemon, Desk() as desk, Viewer(daemon) as viewer, \
            Client(daemon, pb.ROLE_TRACKER) as hand:
        give_light(daemon, desk)

        def look():
            _, payload = viewer.expect_result(viewer.send_frame(lighting_wait_ms=60000))
            return {i for i in range(len(payload) // 3)
                    if payload[3 * i:3 * i + 3] != b'\x80\x80\x80'}

        before = look()
        out = succeed('track', server(daemon), '--object', 'cube', '--files', desk.at('shots'),
                      '--camera', desk.at('camera.json'), '--markers', desk.at('markers.json'),
                      '--no-steady', '--rate', '50')
        assert '%d poses sent of %d pictures' % (SHOTS - 1, SHOTS) in out, out
        followed = look()
        m = desk.truth[SHOTS - 1]['world_from_object']
        angle = .2 * (SHOTS - 1)  # about z, as marker_shots turns it
        where = pb.Transform(orientation=[math.cos(angle / 2), 0, 0, math.sin(angle / 2)],
                             position_m=[m[3], m[7], m[11]])
        hand.send(POSE, pb.Pose(object='cube', world_from_object=where,
                                time_ns=time.monotonic_ns()))
        deadline = time.monotonic() + 60
        while json.loads(daemon.get('/api/v1/status')[1])['rooms'][0]['poses_in'] < SHOTS:
            assert time.monotonic() < deadline
            time.sleep(.02)
        true = look()
        assert len(before ^ true) > 8, 'the object has not moved'
        assert len(followed ^ true) <= max(2, len(before ^ true) // 10), (
            len(followed ^ true), len(before ^ true))
        # One marker on the object, its middle the object's origin, before a camera at rest.
        rest = {**CAMERA, 'world_from_camera': desk.truth[0]['world_from_camera']}
        out = succeed('track', server(daemon), '--object', 'cube', '--files',
                      desk.at('shots/shot-00.png'), '--camera',
                      desk.write('rest.json', json.dumps(rest)), '--marker', '4x4_50:7:0.08')
        assert '1 poses sent of 1 pictures' in out, out
        lying = look()
        hand.send(POSE, pb.Pose(object='cube', world_from_object=pb.Transform(
            orientation=[1, 0, 0, 0], position_m=[0, 0, 0]), time_ns=time.monotonic_ns()))
        while json.loads(daemon.get('/api/v1/status')[1])['rooms'][0]['poses_in'] < SHOTS + 2:
            assert time.monotonic() < deadline
            time.sleep(.02)
        true = look()
        assert len(lying ^ followed) > 8 and len(lying ^ true) <= 2, len(lying ^ true)


def cube_markers(change):
    """MARKERS with the cube's grid listed one by one, each with what change(i) says."""
    return {**MARKERS, 'bodies': [MARKERS['bodies'][0], {'name': 'cube', 'markers': [
        {'id': 20 + i, 'size': 0.045, 'position': [(i % 2 - .5) * .055, (.5 - i // 2) * .055, 0],
         **change(i)} for i in range(4)]}]}


def test_markers_that_are_not_as_listed_are_told():
    upside_down = {'orientation': [0, 0, 0, 1]}
    wrong = [
        (cube_markers(lambda i: {}), None),
        (cube_markers(lambda i: upside_down), r'"cube" \(seen: 20, 21, 22, 23\).* 180 degrees fits'),
        (cube_markers(lambda i: upside_down if i == 2 else {}), 'marker 22 is turned by 180 deg'),
        (cube_markers(lambda i: {'size': 0.06} if i == 1 else {}),
         r'marker 21 is 4(4\.[5-9]|5\.[0-5]) mm wide, not 60\.0'),
        (cube_markers(lambda i: {'position': [.0275, -.0475, 0]} if i == 3 else {}),
         r'marker 23 lies (19\.[5-9]|20\.[0-5]) mm away'),
        ({**MARKERS, 'bodies': [MARKERS['bodies'][0], {'name': 'cube', 'grids': [
            {**MARKERS['bodies'][1]['grids'][0], 'gap': 0.02}]}]},
         r'5(4\.[5-9]|5\.[0-5]) mm apart, not 65\.0'),
        ({**MARKERS, 'bodies': [{'name': 'world', 'markers': [{'id': 9, 'size': 0.08}]},
                                MARKERS['bodies'][1]]},
         'no marker of "world" is seen, but of 4x4_50 there is id 7,'),
        ({**MARKERS, 'dictionary': '6x6_250'}, 'no marker of 6x6_250 is seen, but of 4x4_50 there '
                                               'are ids 7, 20, 21, 22, 23'),
    ]
    with Daemon(rooms=Room(scene=SCENE)) as daemon, Desk() as desk:
        for markers, words in wrong:
            status, out, err = gnomon(
                'track', server(daemon), '--object', 'cube', '--files', desk.at('shots'),
                '--camera', desk.at('camera.json'), '--markers',
                desk.write('wrong.json', json.dumps(markers)), '--rate', '15')
            lines = [line for line in err.splitlines() if 'wrong.json' in line]
            assert len(lines) == bool(words), (words, err)
            assert not words or re.search(words, lines[0]), (words, lines)
            assert words or (status == 0 and 'not where they are listed' not in out), out
            if markers['bodies'][0]['markers'][0]['id'] == 9:
                assert '5 pictures show the object\'s markers, none of them a marker of "world"' in err
        give_light(daemon, desk)
        # The viewer says it too, and puts nothing where it cannot know where that is.
        upside = {**MARKERS, 'bodies': [{**wrong[1][0]['bodies'][1], 'name': 'world'}]}
        status, out, err = gnomon(
            'view', server(daemon), '--files', desk.at('shots'), '--camera',
            desk.at('camera.json'), '--markers', desk.write('upside.json', json.dumps(upside)),
            '--out', desk.at('out'))
        assert status == 1 and err.count('\n') == 2 and '180 degrees fits' in err, err
        assert 'no picture says where the camera is' in err, err
        assert '%d frames without the world' % SHOTS in out, out
        assert '%d times they were not where they are listed' % (SHOTS - 1) in out, out


def test_one_picture_is_enough_to_be_told():
    with Daemon(rooms=Room(scene=SCENE)) as daemon, Desk() as desk:
        give_light(daemon, desk)
        for marker, lines in (
                ('6x6_250:7:0.08', ['no marker of 6x6_250 is seen, but of 4x4_50 there are ids 7, 20',
                                    'no picture says where the camera is']),
                ('4x4_50:9:0.08', ['of 4x4_50 there are ids 7, 20, 21, 22, 23, which no body has',
                                   'no picture says where the camera is']),
                ('4x4_50:7:80', ['--marker: marker 7: sizes are in metres: 80 m?'])):
            status, out, err = gnomon(
                'view', server(daemon), '--files', desk.at('shots/shot-00.png'), '--camera',
                desk.at('camera.json'), '--marker', marker, '--out', desk.at('one'))
            assert status == len(lines) - 1 and err.count('\n') == len(lines), (status, err)
            assert all(line in err for line in lines), (lines, err)
            assert ('no virtual object was in any picture' in out) == (status == 0), out


def test_what_is_wrong_is_said():
    with Desk() as desk:
        files = ['--files', desk.at('shots'), '--camera', desk.at('camera.json')]
        view = ['view', *files, '--out', desk.at('out')]
        refuse(1, ['ID from 0 to 49'], *view, '--marker', '4x4_50:77:0.05')
        refuse(1, ['apriltag_36h11'], *view, '--marker', 'aruco:7:0.05')
        refuse(1, ['gone.json'], *view, '--markers', desk.at('gone.json'))
        refuse(2, ['--markers'], *view, '--markers', 'a', '--marker', '4x4_50:7:0.05')
        refuse(2, ['--markers'], *view, '--no-steady')
        path = desk.write('no-world.json', json.dumps(
            {'dictionary': '4x4_50', 'bodies': [{'name': 'a', 'markers': [{'id': 1, 'size': 1}]}]}))
        refuse(1, ['"world"', 'no-world.json'], *view, '--markers', path)
        track = ['track', *files, '--object', 'cup']
        refuse(2, ['--markers'], *track)
        refuse(1, ['"cup"', 'markers.json'], *track, '--markers', desk.at('markers.json'))
        refuse(2, ['--no-steady'], *track, '--markers', path, '--predict-ms', '20', '--no-steady')
        for by in (['--markers', path], ['--marker', '4x4_50:7:0.05']):
            refuse(1, ['world_from_camera'], 'track', *files, '--object', 'a', *by)
        camera = json.load(open(desk.at('camera.json')))
        camera['response'] = {'type': 'table', 'table': [0, 1]}
        refuse(1, ['table.json', '--as gamma'], 'view', '--files', desk.at('shots'), '--camera',
               desk.write('table.json', json.dumps(camera)), '--marker', '4x4_50:7:0.05', '--out', desk.at('out'))
        # Pictures of another size than the camera's.
        with open(desk.at('shots/small.png'), 'wb') as small:
            small.write(png_bytes(8, 8, bytes(192)))
        with Daemon(rooms=Room(scene=SCENE)) as daemon:
            refuse(1, ['8x8', '320x240'], 'track', server(daemon), '--object', 'cube', '--files',
                   desk.at('shots/small.png'), '--camera', desk.at('camera.json'), '--markers',
                   desk.at('markers.json'))


run_tests([test_each_frame_has_the_pose_of_its_own_picture, test_a_short_text_and_steady_poses,
           test_a_recording_gives_the_same_poses_each_time, test_an_object_follows_its_markers,
           test_markers_that_are_not_as_listed_are_told,
           test_one_picture_is_enough_to_be_told, test_what_is_wrong_is_said])
