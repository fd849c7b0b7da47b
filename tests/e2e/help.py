# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""What --help and --version of the programs print: complete, once each, and narrow enough to read.

usage: help.py GNOMOND GNOMON GNOMON_RENDER
"""
import re
import subprocess
import sys

GNOMOND, GNOMON, RENDER = sys.argv[1:4]
SERVER = {'server', 'room', 'token'}
CONNECT = SERVER | {'record', 'record-max'}
FEED = {'sequence', 'files', 'video', 'rate', 'start-at', 'loop', 'count'}
LIVE = {'gige', 'v4l2', 'frame-size', 'frame-rate', 'exposure-us', 'gain', 'pixel-format', 'controls',
        'lock-white-balance'}
MARKERS = {'marker', 'markers', 'steady', 'debug-markers'}
# What users and tools rely on. A star: there may be more.
OPTIONS = [
    ([GNOMON, 'probe'], CONNECT | FEED | LIVE | {'setup', 'projection', 'first-sequence'}),
    ([GNOMON, 'track'], CONNECT | (FEED - {'sequence'}) | LIVE | MARKERS |
     {'object', 'poses', 'orbit', 'camera', 'predict-ms'}),
    ([GNOMON, 'screen'], CONNECT | (FEED - {'sequence'}) | {'stream', 'scale'}),
    ([GNOMON, 'view'], CONNECT | FEED | LIVE | MARKERS | {'camera', 'out', 'result', 'jpeg-quality',
                                                  'quality', 'budget-ms', 'outstanding',
                                                  'match', 'sync-light', 'window', 'show'}),
    ([GNOMON, 'replay'], CONNECT | {'info', 'streams', 'rate-factor', 'as-fast-as-possible',
                                    'open-loop', 'pin-light', 'loop', 'out', 'expect-equal'}),
    ([GNOMON, 'doctor'], SERVER),
    ([GNOMON, 'calibrate', 'print'], {'board', 'square', 'charuco', 'marker', 'markers', 'body', 'out'}),
    ([GNOMON, 'calibrate', 'intrinsics'], LIVE | {'files', 'video', 'board', 'square', 'charuco', 'marker',
                                                  'square-pixels', 'max-error', 'out', 'picture',
                                                  'views', 'keep'}),
    ([GNOMON, 'calibrate', 'response'], LIVE | {'chart', 'stack', 'live', 'exposures', 'frames', 'keep', 'times',
                                                'model', 'method', 'as', 'corners', 'out', 'full-scale',
                                                'bits', 'bayer', 'matrix', 'plot', 'picture', 'radiance'}),
    ([GNOMON, 'calibrate', 'probe'], LIVE | {'files', 'video', 'frames', 'out', 'projection', 'theta-max', 'find-circle', 'ball',
                                      'camera-share', 'lamps', 'markers', 'marker', 'camera', 'camera-files',
                                      'fit', 'share', 'tolerance', 'full-scale', 'picture'}),
    ([GNOMOND], {'config', 'listen', 'http', 'ready-file', 'print-config', 'threads', 'log', '*'}),
    ([RENDER], {'scene', 'env', 'env-projection', 'env-params', 'world-from-env', 'camera',
                'background', 'quality', 'budget-ms', 'lights', 'light-method', 'bounces',
                'threads', 'out', 'report', '*'}),
]


def ask(*command):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=60,
                          stdin=subprocess.DEVNULL)
    assert done.returncode == 0 and done.stderr == b'', (command, done)
    return done.stdout.decode('utf-8')


def check_shape(text):
    assert text.endswith('\n') and not text.endswith('\n\n')
    for line in text.splitlines():
        assert len(line) <= 80, '%d columns: %s' % (len(line), line)
        assert line == line.rstrip() and '\t' not in line, repr(line)


def check_options(command, wanted):
    text = ask(*command, '--help')
    check_shape(text)
    name = ' '.join([command[0].rsplit('/', 1)[1]] + command[1:])
    assert text.startswith('Usage: %s ' % name), text.splitlines()[0]
    lines = text.splitlines()
    listed = [(i, re.match(r'  --([a-zA-Z0-9.-]+)', line)) for i, line in enumerate(lines)]
    listed = [(i, m.group(1)) for i, m in listed if m]
    names = [n for _, n in listed]
    assert len(set(names)) == len(names), 'twice: %s' % sorted(n for n in names if names.count(n) > 1)
    missing = (wanted | {'help', 'version'}) - {'*'} - set(names)
    assert not missing, '%s --help leaves out %s' % (name, sorted(missing))
    extra = set(names) - wanted - {'help', 'version'}
    assert '*' in wanted or not extra, '%s --help has %s, this test has not' % (name, sorted(extra))
    for i, option in listed:
        assert re.match(r' {6}\S', lines[i + 1]), '--%s of %s has no help' % (option, name)
    assert ask(*command, '-h') == text
    version = ask(*command, '--version')
    assert re.fullmatch(re.escape(name) + r' \d+\.\d+\.\d+\n', version), version


def check_program():
    """gnomon itself and gnomon calibrate: each command once, with a summary."""
    text = ask(GNOMON, '--help')
    check_shape(text)
    for command in ('probe', 'screen', 'track', 'view', 'calibrate', 'replay', 'doctor'):
        assert len(re.findall(r'^  %s +\S' % command, text, re.M)) == 1, text
    assert ask(GNOMON, 'help') == ask(GNOMON, '-h') == text
    assert re.fullmatch(r'gnomon \d+\.\d+\.\d+\n', ask(GNOMON, '--version'))
    text = ask(GNOMON, 'calibrate', '--help')
    check_shape(text)
    for command in ('print', 'intrinsics', 'response', 'probe'):
        assert len(re.findall(r'^  %s +\S' % command, text, re.M)) == 1, text


def main():
    print('1..%d' % (len(OPTIONS) + 1))
    failed = 0
    tests = [('gnomon', check_program, ())]
    tests += [(' '.join([c[0].rsplit('/', 1)[1]] + c[1:]), check_options, (c, w)) for c, w in OPTIONS]
    for n, (name, check, arguments) in enumerate(tests, 1):
        try:
            check(*arguments)
            print('ok %d - %s' % (n, name))
        except AssertionError as fault:
            failed += 1
            print('# %s\nnot ok %d - %s' % (str(fault).replace('\n', '\n# '), n, name))
    sys.exit(1 if failed else 0)


main()
