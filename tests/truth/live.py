# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""No file between: two GigE Vision cameras that show what the rig's devices deliver, a daemon, and
composites judged against the rig's truth. TAP on stdout.

usage: live.py GNOMON_RIG GNOMOND GNOMON FAKE_GIGE WORK_FOLDER

One camera is the fisheye and sends 12-bit log codes, the other looks at the table, and the marker
there says from where. Twice: as who runs the tests, and without any right (packets then come through
ordinary sockets). In the middle the fisheye is killed and comes back: environment frames flow again
within 2 s, and neither the viewer nor the daemon notices. The last composite must be as near to the
truth as the limits of truth.py ask of files.
"""
import os
import re
import signal
import sys
import time

TESTS = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path[1:1] = [TESTS, os.path.join(TESTS, 'e2e')]
import own_network  # noqa: E402
from live_stage import (HEIGHT, MARKER, WIDTH, Stage, describe, judge, load,  # noqa: E402
                        make_sequence)

PROGRAMS, WORK = sys.argv[1:5], sys.argv[5]


def play(stage, before):
    """The main job with both cameras; returns the folder of composites."""
    daemon, address = stage.start_daemon()
    eye = stage.start_sky('sky')
    stage.start_camera('table', '127.0.0.2', stage.frame['picture'], WIDTH, HEIGHT)
    out = os.path.join(stage.folder, 'out')
    lamp = stage.start_probe(address, before, 10)
    viewer = stage.start('view', *before, stage.gnomon, 'view', '--server', address, '--gige',
                         '127.0.0.2', '--camera', stage.camera, '--marker', MARKER, '--out', out,
                         '--pixel-format', 'RGB8', '--frame-rate', '10')
    viewer.wait_for('^frame 5:')

    eye.end(signal.SIGKILL)
    lamp.wait_for('camera 127.0.0.1: lost')
    n_seen = viewer.count('^frame ')
    viewer.wait_for('^frame ', n_seen + 3)
    n_sent = lamp.count('^environment frame ')
    stage.start_sky('sky-again')
    begin = time.monotonic()
    lamp.wait_for('^environment frame ', n_sent + 1)
    gap_s = time.monotonic() - begin
    print('# environment frames %.2f s after the camera came back' % gap_s)
    assert gap_s < 2
    n_seen = viewer.count('^frame ')
    viewer.wait_for('^frame ', n_seen + 5)
    assert viewer.end() == 0 and lamp.end() == 0 and daemon.end(signal.SIGTERM) == 0
    assert ', 0 dropped' in viewer.read(), viewer.read()
    assert re.search('opened again [1-9]', lamp.read()), lamp.read()
    print('# ' + describe(load(os.path.join(out, 'view.json'))))
    return out


def main():
    own_network.enter()
    sequence = make_sequence(PROGRAMS[0], WORK)
    cases = [('as who runs this', []), ('without raw sockets', own_network.NO_RIGHTS)]
    print('1..%d' % len(cases))
    for n, (name, before) in enumerate(cases, 1):
        stage = Stage(*PROGRAMS, sequence)
        found = []
        try:
            found += judge(stage, play(stage, before))
        except AssertionError as fault:
            found.append(str(fault) or 'an assertion failed')
        finally:
            stage.end()
        for problem in found:
            print('# ' + problem.replace('\n', '\n# '))
        print('%s %d - %s' % ('not ok' if found else 'ok', n, name))


main()
