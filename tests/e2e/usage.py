# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Wrong command lines of gnomon: one line each, which says what is right. Needs no server.

usage: usage.py GNOMOND DIRECTORY_OF_GNOMON_PB2 GNOMON
"""
import signal
import socket
import subprocess
import sys

sys.path.insert(0, sys.argv[2])
from folder import Folder  # noqa: E402
from gnomond import run_tests  # noqa: E402
from run import GNOMON, Run  # noqa: E402

WRONG = (
    (['probes'], ["did you mean 'probe'"]), (['fly'], ['--help lists them']),
    (['probe'], ['--sequence DIR, --files PATTERN, --video FILE or a camera']),
    (['probe', '--files', 'a', '--sequence', 'b'], ['one of them']),
    (['probe', '--files', 'a', '--setup', 'b', '--projection', 'angular'], ['one of them']),
    (['probe', '--files', 'a', '--rate', '0'], ['--rate', '0.001']),
    (['probe', '--files', 'a', '--start-at', '1e12'], ['--start-at']),
    (['probe', '--files', 'a', '--projection', 'square'], ['latlong, angular']),
    (['probe', '--files', 'a', '--gige', 'any'], ['one of them']),
    (['probe', '--gige', 'any', '--rate', '5'], ['--frame-rate']),
    (['probe', '--gige', 'any', '--v4l2', 'any'], ['one camera']),
    (['probe', '--files', 'a', '--controls', 'a=1'], ['for cameras']),
    (['probe', '--files', 'a', '--v4l2', 'any'], ['one of them']),
    (['probe', '--files', 'a', '--frame-size', '4x4'], ['for cameras']),
    (['view', '--files', 'a', '--out', 'o'], ['--camera FILE']),
    (['view', '--gige', 'any', '--out', 'o'], ['--camera FILE']),
    (['view', '--sequence', 'a', '--camera', 'c', '--out', 'o'], ['--camera FILE']),
    (['view', '--sequence', 'a'], ['--out']),
    (['view', '--sequence', 'a', '--out', 'o', '--outstanding', '17'], ['[1, 16]']),
    (['view', '--sequence', 'a', '--out', 'o', '--sync-lihgt', '1'], ['--sync-light']),
    (['doctor', '--server', 'nowhere'], ['--server']),
    (['view', '--sequence', 'a', '--out', 'o', '--jpeg-quality', '50'], ['--result jpeg']),
    (['view', '--sequence', 'a', '--out', 'o', '--quality', 'seed', '--budget-ms', '9'], ['--quality interactive']),
    (['view', '--sequence', 'a', '--out', 'o', '--no-steady'], ['give --markers FILE']),
    (['view', '--sequence', 'a', '--out', 'o', '--marker', 'a', '--markers', 'b'], ['one of']),
    (['view', '--sequence', 'a', '--out', 'o', '--loop=maybe'], ['--loop', 'true or false']),
    (['view', '--sequence', 'a', '--out', 'o', '--out', 'p'], ['--out is given twice']),
    (['view', '--sequence', 'a', '--out'], ['--out lacks its value']),
    (['view', '--sequence', 'a', '--out', 'o', 'p'], ['unexpected p']),
    (['view', '--files', 'a', 'b', '--out', 'o'], ['unexpected b (put a pattern in quotes)']),
    (['calibrate', 'response', '--chart', 'a', 'b', '--out', 'o'], ['unexpected b (put a pattern in quotes)']),
    (['view', '--files', 'a', '--camera', 'c'], ['--out DIR', '--window']),
    (['view', '--sequence', 'a', '--out', 'o', '--record-max', '1MiB'], ['--record FILE']),
    (['probe', '--files', 'a', '--record-max', '1MiB'], ['--record FILE']),
    (['screen', '--stream', 'a', '--files', 'b', '--record-max', '1MiB'], ['--record FILE']),
    (['screen', '--stream', 'a'], ['--files PATTERN or --video FILE']),
    (['track', '--orbit', '1'], ['--object is missing']),
    (['track', '--object', 'a'], ['one of --poses, --orbit']),
    (['track', '--object', 'a', '--poses', 'b', '--orbit', '1'], ['one of --poses, --orbit']),
    (['track', '--object', 'a', '--orbit', '1', '--record-max', '1MiB'], ['--record FILE']),
    (['track', '--object', 'a', '--orbit', '1', '--camera', 'c'], ['give --markers FILE']),
    (['track', '--object', 'a', '--orbit', '1', '--loop'], ['are for --markers']),
    (['track', '--object', 'a', '--poses', 'b', '--start-at', '5'], ['are for --markers']),
    (['track', '--object', 'a', '--orbit', '1', '--predict-ms', '5'], ['are for --markers']),
    (['track', '--object', 'a', '--markers', 'b', '--camera', 'c'], ['--files PATTERN']),
    (['replay'], ['a word is missing', 'usage: gnomon replay FILE']),
    (['replay', 'a', '--info', '--loop'], ['--info replays nothing']),
    (['replay', 'a', '--info', '--out', 'b'], ['--info replays nothing']),
    (['replay', 'a', '--record-max', '1MiB'], ['--record FILE']),
    (['replay', 'a', '--rate-factor', '2', '--as-fast-as-possible'], ['one of them']),
    (['replay', 'a', '--streams', 'foo'], ['probe, viewer, tracker']),
    (['doctor', 'a'], ['unexpected a']),
    (['calibrate', 'lens'], ['--help lists']), (['calibrate', 'prnt'], ["did you mean 'print'"]),
    (['calibrate', 'intrinsics', '--files', 'a', '--out', 'b'], ['--board is missing']),
    (['calibrate', 'intrinsics', '--files', 'a', '--board', '10x7', '--marker', '0.01', '--out', 'x'],
     ['--charuco DICTIONARY']),
    (['calibrate', 'response', '--out', 'x'], ['--chart PATTERN, --stack PATTERN or a camera']),
    (['calibrate', 'response', '--chart', 'a', '--method', 'robertson', '--out', 'x'], ['--method is for stacks']),
    (['calibrate', 'response', '--stack', 'a', '--times', '1,2', '--model', 'linear', '--out', 'x'], ['--model is for charts']),
    (['calibrate', 'response', '--stack', 'a', '--times', '1,2', '--no-matrix', '--out', 'x'], ['--matrix is for charts']),
    (['calibrate', 'response', '--stack', 'a', '--times', '1,2', '--corners', '1,2', '--out', 'x'], ['--corners is for charts']),
    (['calibrate', 'response', '--v4l2', 'any', '--live', 'stack', '--exposures', 'auto', '--plot', 'p', '--out', 'x'],
     ['--plot is for charts']),
    (['calibrate', 'response', '--stack', 'a', '--out', 'x'], ['--stack needs --times']),
    (['calibrate', 'response', '--chart', 'a', '--model', 'linear', '--out', 'x'], ['--model linear needs --times']),
    (['calibrate', 'probe', '--files', 'a', '--out', 'x'], ['nothing to find']),
    (['calibrate', 'probe', '--files', 'a', '--find-circle', '--ball', '1,2,3', '--out', 'x'], ['--ball for balls']),
    (['calibrate', 'probe', '--files', 'a', '--find-circle', '--camera-share', '0.2', '--out', 'x'], ['is for --ball']),
    (['calibrate', 'probe', '--files', 'a', '--find-circle', '--share', '0.3', '--out', 'x'], ['are for --lamps']),
    (['calibrate', 'probe', '--files', 'a', '--marker', '4x4_50:0:0.1', '--fit', 'lens', '--out', 'x'],
     ['do not determine a lens']),
)


def test_options():
    """Options that are none, go not together, or would be ignored: status 2."""
    runs = []
    for arguments, words in WRONG:
        runs.append((Run(*arguments), words))
        if len(runs) > 3:
            run, wanted = runs.pop(0)
            run.fail(2, *wanted)
    for run, wanted in runs:
        run.fail(2, *wanted)


def test_values():
    """Values that only the command itself can judge, and places that are not there: status 1."""
    for arguments, words in (
            (['replay', 'none.gnr'], ['none.gnr: No such file']),
            (['replay', sys.argv[0]], ['no recording']),
            (['view', '--files', 'none', '--camera', 'none.json', '--out', 'o'], ['none.json: cannot open']),
            (['view', '--sequence', 'none', '--out', 'o'], ['none/sequence.json: cannot open']),
            (['probe', '--files', 'none'], ['none: no file there']),
            (['track', '--object', 'a', '--poses', 'none'], ['none: cannot open']),
            (['calibrate', 'response', '--chart', 'none', '--out', 'x'], ['none: no file there'])):
        Run(*arguments).fail(1, *words)
    with Folder() as folder:
        lens = folder.write('lens.json', b'{"width": 64, "height": 48, "fx": 32, "fy": 32, "cx": 32, "cy": 24,'
                            b' "distortion": [0, 0, 0, 0, 0]}')
        Run('view', '--files', 'none', '--camera', lens, '--out', 'o').fail(
            1, 'nothing says where the camera is: give --marker DICT:ID:SIZE or --markers FILE',
            'or world_from_camera in ' + lens)
    Run('probe', '--files', sys.argv[0], '--server', '127.0.0.1:0').fail(1, '[1, 65535]')
    for size in ('640', '640x', 'x480', '0x480', '640x480x3', '99999x480'):
        Run('probe', '--gige', 'any', '--frame-size', size).fail(1, '--frame-size %s: ' % size,
                                                                 '640x480')
    status, _, err = Run().end()
    assert status == 2 and 'usage: gnomon' in err
    with open('/dev/full', 'w') as full:
        done = subprocess.run([GNOMON, '--help'], stdout=full, stderr=subprocess.PIPE, timeout=60)
    assert done.returncode == 1 and b'standard output' in done.stderr


def test_interrupt():
    """Ctrl-C ends the wait for a server that takes the connection and says nothing."""
    with socket.create_server(('127.0.0.1', 0)) as mute:
        run = Run('track', '--object', 'a', '--orbit', '1', '--server', '127.0.0.1:%d' % mute.getsockname()[1])
        connection, _ = mute.accept()
        with connection:
            assert connection.recv(1), 'no HELLO'
            run.process.send_signal(signal.SIGINT)
            run.fail(1, 'interrupted before it answered')


run_tests([test_options, test_values, test_interrupt])
