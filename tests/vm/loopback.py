# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""No file between, with a V4L2 camera: one in a virtual machine looks at the rig's table, the marker
there says from where, a fake GigE camera outside is the fisheye that lights it; a daemon outside,
and composites judged against the rig's truth as those of truth/live.py are. TAP on stdout.

The camera is the kernel's V4L2 with the driver v4l2loopback, which shows what feed writes into it.

usage: loopback.py GNOMON_RIG GNOMOND GNOMON FAKE_GIGE WORK_FOLDER FEED KERNEL
"""
import json
import os
import signal
import sys

TESTS = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path[1:1] = [TESTS, os.path.join(TESTS, 'truth')]
import own_network  # noqa: E402
from live_stage import (HEIGHT, MARKER, WIDTH, Stage, describe, judge,  # noqa: E402
                        make_sequence)
from machine import Machine, find_missing, quote  # noqa: E402

PROGRAMS, WORK = [os.path.abspath(path) for path in sys.argv[1:5]], sys.argv[5]
FEED, KERNEL = map(os.path.abspath, sys.argv[6:8])
VIDEO = '/dev/video0'
DRIVER = 'v4l2loopback'
N_COMPOSITES = 3
RATE = 4  # pictures a second: the machine's processor is emulated


def write_script(stage, address):
    """What runs in the machine, whose 10.0.2.2 is our loopback."""
    with open(stage.camera, encoding='utf-8') as f:
        script = 'cat >camera.json <<END\n%s\nEND\n' % f.read()
    view = [stage.gnomon, 'view', '--server', '10.0.2.2:' + address.rsplit(':', 1)[1], '--v4l2',
            VIDEO, '--camera', 'camera.json', '--marker', MARKER, '--out', 'composites']
    return script + (
        '%s >feed.out 2>feed.err &\nfeed=$!\n'
        'until grep -q ready feed.out || ! kill -0 $feed; do sleep 0.1; done 2>/dev/null\n'
        '%s >view.out 2>view.err &\nview=$!\n'
        "until grep -q '^frame %d:' view.out || ! kill -0 $view; do sleep 0.1; done 2>/dev/null\n"
        'kill -TERM $view\nwait $view\necho $? >view.rc\n'
        'kill $feed\n' % (
            quote(FEED, VIDEO, RATE, 'YUYV', os.path.join(stage.sequence, stage.frame['picture'])),
            quote(*view), N_COMPOSITES))


def play(stage, machine):
    """Returns the folder of composites."""
    daemon, address = stage.start_daemon()
    stage.start_sky('sky')
    lamp = stage.start_probe(address, [], RATE)
    machine.run(write_script(stage, address))
    status, out, err = machine.get('view')
    assert status == 0, out + err + machine.get_bytes('feed.err').decode()
    assert lamp.end() == 0 and daemon.end(signal.SIGTERM) == 0
    report = json.loads(machine.get_bytes('composites/view.json'))
    print('# ' + describe(report))
    assert report['complete'] and report['results'] >= N_COMPOSITES, report
    capture = report['capture']
    n_bytes = 3 * WIDTH * HEIGHT  # of the one conversion, from YUYV
    assert capture['copied_bytes'] == capture['read_bytes'] == n_bytes * capture['read'], capture
    return os.path.join(machine.path, 'out', 'composites')


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
        if os.environ.get('GN_KEEP'):
            print('# kept ' + machine.path)
        else:
            machine.close()
    for problem in found:
        print('# ' + problem.replace('\n', '\n# '))
    print('%s 1 - a V4L2 camera, its pose from a marker' % ('not ok' if found else 'ok'))


main()
