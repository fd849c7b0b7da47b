# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""No file between, with a V4L2 camera: one in a virtual machine looks at the rig's table, the marker
there says from where, a fake GigE camera outside is the fisheye that lights it; a daemon outside,
and composites judged against the rig's truth as those of truth/live.py are. TAP on stdout.

The camera is the kernel's V4L2 with the driver v4l2loopback, which shows what feed writes into it.

usage: loopback.py GNOMON_RIG GNOMOND GNOMON FAKE_GIGE WORK_FOLDER FEED KERNEL
"""
import json
import math
import os
import signal
import sys

TESTS = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path[1:1] = [TESTS, os.path.join(TESTS, 'e2e'), os.path.join(TESTS, 'truth')]
import own_network  # noqa: E402
from live_stage import (HEIGHT, MARKER, WIDTH, Stage, describe, judge,  # noqa: E402
                        make_sequence)
from machine import Machine, find_missing, quote  # noqa: E402

PROGRAMS, WORK = [os.path.abspath(path) for path in sys.argv[1:5]], sys.argv[5]
FEED, KERNEL = map(os.path.abspath, sys.argv[6:8])
VIDEO = '/dev/video0'
DRIVER = 'v4l2loopback'
N_COMPOSITES = 3
FORMATS = ('YUYV', 'MJPG')
SKY = {'projection': 'latlong', 'response': {'type': 'srgb'}}
RATE = 4  # pictures a second: the machine's processor is emulated


def write_script(stage, address):
    """What runs in the machine, whose 10.0.2.2 is our loopback: for each format a camera that gives
    it and a viewer, then a probe that takes the same camera for the sky."""
    server = '10.0.2.2:' + address.rsplit(':', 1)[1]
    picture = os.path.join(stage.sequence, stage.frame['picture'])
    with open(stage.camera, encoding='utf-8') as f:
        script = 'cat >camera.json <<END\n%s\nEND\n' % f.read()
    script += 'cat >setup.json <<END\n%s\nEND\n' % json.dumps(SKY)
    for name in FORMATS:
        view = [stage.gnomon, 'view', '--server', server, '--v4l2', VIDEO, '--camera',
                'camera.json', '--marker', MARKER, '--out', name]
        script += (
            '%s >%s.feed 2>&1 &\nfeed=$!\n'
            'until grep -q ready %s.feed || ! kill -0 $feed; do sleep 0.1; done 2>/dev/null\n'
            '%s >%s.out 2>%s.err &\nview=$!\n'
            "until grep -q '^frame %d:' %s.out || ! kill -0 $view; do sleep 0.1; done 2>/dev/null\n"
            'kill -TERM $view\nwait $view\necho $? >%s.rc\n' % (
                quote(FEED, VIDEO, RATE, name, picture), name, name, quote(*view), name, name,
                N_COMPOSITES, name, name))
        if name == FORMATS[-1]:
            script += 'step probe %s\n' % quote(
                stage.gnomon, 'probe', '--server', server, '--v4l2', VIDEO, '--setup', 'setup.json',
                '--count', N_COMPOSITES)
        script += 'kill $feed\nwait $feed\n'
    return script


def play(stage, machine):
    """Returns the folder of composites of the first format."""
    daemon, address = stage.start_daemon()
    stage.start_sky('sky')
    lamp = stage.start_probe(address, [], RATE)
    machine.run(write_script(stage, address))
    assert lamp.end() == 0 and daemon.end(signal.SIGTERM) == 0
    for name in FORMATS:
        status, out, err = machine.get(name)
        assert status == 0, out + err + machine.get_bytes(name + '.feed').decode()
        report = json.loads(machine.get_bytes(name + '/view.json'))
        print('# %s: %s' % (name, describe(report)))
        assert report['complete'] and report['results'] >= N_COMPOSITES, report
        capture = report['capture']
        # The driver has two buffers only, so that a JPEG is copied, too.
        assert capture['copied_bytes'] == capture['read_bytes'] > 0, capture
        # YUYV becomes RGB, a JPEG is passed on as it is. (Of a buffer that was filled before the
        # viewer asked for it the driver names the size, four bytes a pixel, as the JPEG's.)
        rgb_bytes = 3 * WIDTH * HEIGHT * capture['read']
        if name == 'YUYV':
            assert capture['read_bytes'] == rgb_bytes, capture
        else:
            assert capture['read_bytes'] < rgb_bytes, capture
    status, out, err = machine.get('probe')
    assert status == 0 and '%d environment frames sent' % N_COMPOSITES in out, out + err
    folders = [os.path.join(machine.path, 'out', name) for name in FORMATS]
    check_poses(*map(read_place, folders))
    return folders[0]


def read_place(folder):
    """Where the marker was in the last picture, m."""
    with open(os.path.join(folder, 'poses.jsonl'), encoding='utf-8') as f:
        (body,) = json.loads(f.read().splitlines()[-1])['bodies']
    return body['camera_from_body'][3:12:4]


def check_poses(a, b):
    """Within half a millimetre, at half a metre: what a JPEG of a webcam's quality takes."""
    apart_mm = 1e3 * math.dist(a, b)
    print('# the same marker by YUYV and by MJPG: %.2f mm apart' % apart_mm)
    assert apart_mm < 0.5, (a, b)


def main():
    reason = find_missing(KERNEL, DRIVER)
    if reason:
        print('1..0 # SKIP ' + reason)
        return
    own_network.enter()
    stage = Stage(*PROGRAMS, make_sequence(PROGRAMS[0], WORK))
    machine = Machine(KERNEL, DRIVER)
    print('1..1')
    found = []
    try:
        found += judge(stage, play(stage, machine))
    except AssertionError as fault:
        found.append(str(fault) or 'an assertion failed')
    finally:
        stage.end()
    for problem in found:
        print('# ' + problem.replace('\n', '\n# '))
    print('%s 1 - a V4L2 camera, its pose from a marker' % ('not ok' if found else 'ok'))


main()
