# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""gnomon calibrate probe by markers that a fisheye sees, and gnomon probe with what it wrote: the
server has the lamp where it is.

usage: calibrate_probe.py GNOMOND DIRECTORY_OF_GNOMON_PB2 GNOMON FISHEYE_SHOTS
"""
import json
import math
import os
import shutil
import subprocess
import sys

sys.path.insert(0, sys.argv[2])
from gnomond import *  # noqa: E402,F403
from folder import Folder  # noqa: E402
from pictures import png_bytes, read_png  # noqa: E402

GNOMON = os.environ.get('CLIENT_UNDER_TEST') or sys.argv[3]
LAMP = (-0.291386, 0.388514, 0.874157)
MARKERS = {'dictionary': '4x4_50', 'bodies': [
    {'name': 'world', 'markers': [{'id': 7, 'size': 0.1}, {'id': 8, 'size': 0.06, 'position': [0.14, 0, 0]}]},
    {'name': 'post', 'markers': [{'id': 20, 'size': 0.1}]}]}


class Desk(Folder):
    """All shots, made once; tests write files of their own names beside them."""

    def __init__(self):
        super().__init__()
        self.write_json('markers.json', MARKERS)
        self.truth = json.loads(subprocess.run([sys.argv[4], self.at('markers.json'), self.path],
                                               check=True, capture_output=True, text=True).stdout)

    def write_json(self, name, what):
        return self.write(name, json.dumps(what).encode())

    def new_setup(self, name):
        return shutil.copy(self.at('probe.json'), self.at(name))


def calibrate(shots, out, *more):
    done = subprocess.run([GNOMON, 'calibrate', 'probe', '--files', DESK.at(shots + '.png'),
                           '--projection', 'fisheye-equidistant', '--find-circle', '--out', out, *more],
                          stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=100)
    return done.returncode, done.stdout, done.stderr


def succeed(*arguments):
    status, out, err = calibrate(*arguments)
    assert status == 0 and not err, (status, out, err)
    return out


def refuse(words, *arguments):
    status, out, err = calibrate(*arguments)
    assert status in (1, 2) and err.count('\n') == 1 and words in err, (status, out, err)
    return out


def turn(q, v):
    """v in the frame that the quaternion w, x, y, z leads to."""
    w, x, y, z = q
    t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])]
    return [v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2],
            v[2] + w * t[2] + x * t[1] - y * t[0]]


def get_angle(a, b):
    return math.degrees(math.acos(max(-1, min(1, sum(p * q for p, q in zip(a, b))))))


def check(setup_file, truth):
    """Each of the probe's axes within 0.3 degrees, the place within 3 mm."""
    with open(setup_file) as f:
        setup = json.load(f)
    off = max(get_angle(turn(setup['orientation'], [float(i == k) for i in range(3)]), truth[k:12:4])
              for k in range(3))
    place = math.dist(setup['position'], truth[3:12:4])
    print('# orientation off by %.3f degrees, position by %.2f mm' % (off, 1e3 * place))
    assert 0 < off < 0.3 and 0 < place < 0.003, (off, place)
    assert setup['response']['type'] == 'log' and setup['pixel_format'] == 'log12', setup
    return setup


def count_pixels(path, rgb):
    width, height, data = read_png(path)
    return sum(tuple(data[3 * i:3 * i + 3]) == rgb for i in range(width * height))


def find_lamp(setup_file, shots):
    """Where the server has the brightest light, in the world."""
    with Daemon() as daemon, probe(daemon, want_lighting_maps=True) as listener:
        subprocess.run([GNOMON, 'probe', '--server=%s:%d' % daemon.address, '--files',
                        DESK.at(shots + '-0.png'), '--setup', setup_file], check=True, timeout=60,
                       capture_output=True)
        state, payload = listener.expect(LIGHTING_STATE)
        w, h = state.map_width, state.map_height
        light = struct.unpack_from('<%de' % (3 * w * h), payload, 32 * state.light_count)[1::3]
        assert [abs(a - b) < 1e-4 for a, b in zip(state.probe_position_m,
                                                  json.load(open(setup_file))['position'])] == [True] * 3
    total = [0, 0, 0]
    for i, v in enumerate(light):
        if v > 5:
            theta, phi = math.pi * (i // w + .5) / h, math.pi - 2 * math.pi * (i % w + .5) / w
            for k, x in enumerate((math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi),
                                   math.cos(theta))):
                total[k] += v * math.sin(theta) * x
    norm = math.sqrt(sum(x * x for x in total))
    return [x / norm for x in total]


def test_world_seen():
    """The fisheye sees the world's markers itself."""
    out = DESK.new_setup('near.json')
    said = succeed('near-*', out, '--markers', DESK.at('markers.json'), '--picture', DESK.at('found-near.png'))
    assert 'marker 7: ' in said and 'marker 8: ' in said and '4 of 4 sightings' in said, said
    assert '"post" is in the world is not known' in said, said
    check(out, DESK.truth['near'])
    assert count_pixels(DESK.at('found-near.png'), (0, 220, 0)) > 100   # the used
    assert count_pixels(DESK.at('found-near.png'), (255, 200, 0)) > 40  # the post's
    off = get_angle(find_lamp(out, 'near'), LAMP)
    print('# the lamp in the server is off by %.3f degrees' % off)
    assert off < 0.4


def test_one_marker():
    out = DESK.new_setup('one.json')
    said = succeed('near-0', out, '--marker', '4x4_50:7:0.1')
    assert 'marker 8: ' in said and 'not listed, left out' in said, said
    check(out, DESK.truth['near'])
    status, said, err = calibrate('near-0', out, '--marker', '4x4_50:7:100')  # millimetres
    assert status == 0 and err == 'gnomon: --marker: marker 7: sizes are in metres: 100 m?\n', (status, err)


def test_another_body_seen():
    """The probe looks up and sees the post alone, which a camera sees with the world's markers."""
    out = DESK.new_setup('up.json')
    with open(out) as f:
        before = f.read()
    said = refuse('no marker whose place is known', 'up-1', out, '--markers', DESK.at('markers.json'),
                  '--picture', DESK.at('refused-up.png'))
    assert '--picture shows what was seen' in said, said
    assert count_pixels(DESK.at('refused-up.png'), (255, 200, 0)) > 100
    with open(out) as f:
        assert f.read() == before
    said = succeed('up-*', out, '--markers', DESK.at('markers.json'), '--camera', DESK.at('camera.json'),
                   '--camera-files', DESK.at('cam-*.png'))
    assert '"post" in the world: 2 of 2 pictures agree' in said, said
    check(out, DESK.truth['up'])
    off = get_angle(find_lamp(out, 'up'), LAMP)
    print('# the lamp in the server is off by %.3f degrees' % off)
    assert off < 0.4


def test_refusals():
    markers, out = DESK.at('markers.json'), DESK.new_setup('refused.json')
    with open(out) as f:
        before = f.read()
    wrong = DESK.write_json('wrong.json', {'dictionary': '4x4_50', 'bodies': [{'name': 'world', 'markers': [
        {'id': 7, 'size': 0.1}, {'id': 8, 'size': 0.06, 'position': [0.24, 0, 0.05]}]}]})
    nobody = DESK.write_json('nobody.json', {'dictionary': '4x4_50', 'bodies': [MARKERS['bodies'][1]]})
    black = DESK.write('black.png', png_bytes(640, 480, bytes(640 * 480), 1))
    lamps = DESK.write('lamps.txt', b'* 0 0 1\n* 1 0 0\n')
    for words, *more in (
            ('size and position of each marker', '--markers', wrong, '--picture', DESK.at('wrong.png')),
            ('there is no body "world"', '--markers', nobody),
            ('give --lamps, or --markers', '--markers', markers, '--lamps', lamps),
            ('--fit is for --lamps', '--markers', markers, '--fit', 'lens'),
            ('one of --markers FILE and --marker', '--markers', markers, '--marker', '4x4_50:7:0.1'),
            ('--camera and --camera-files go together', '--markers', markers, '--camera', markers),
            ('no picture shows markers of "world" and of another body', '--markers', markers, '--camera',
             DESK.at('camera.json'), '--camera-files', black),
            ('the place of "post" in the world: only 1 of 2 pictures agree', '--markers', markers, '--camera',
             DESK.at('camera.json'), '--camera-files', DESK.at('[cs][al][mi]*-0.png')),
            ('the place of "post" in the world: only 1 of 2 pictures agree', '--markers', markers, '--camera',
             DESK.at('camera.json'), '--camera-files', DESK.at('[ct][au][mr]*-0.png')),
            ('no orientation brings two spots', '--lamps', lamps, '--picture', DESK.at('lamps.png'))):
        refuse(words, 'near-0', out, *more)
    assert os.path.exists(DESK.at('wrong.png')) and count_pixels(DESK.at('lamps.png'), (255, 200, 0)) > 10
    coarse = DESK.write_json('coarse.json', {'response': json.loads(before)['response']})
    said = calibrate('near-0', coarse, '--markers', markers)[1]
    assert 'no code is above 4095 of 65535: for 12 bits say --full-scale 4095' in said, said
    assert 'says no response' in calibrate('near-0', DESK.at('new.json'), '--markers', markers)[1]
    done = subprocess.run([GNOMON, 'calibrate', 'probe', '--files', DESK.at('near-0.png'), '--projection',
                           'mirrorball', '--markers', markers, '--out', out], capture_output=True, text=True)
    assert done.returncode == 1 and 'from its surface' in done.stderr, done
    with open(out) as f:
        assert f.read() == before


with Desk() as DESK:
    run_tests([test_world_seen, test_one_marker, test_another_body_seen, test_refusals])
