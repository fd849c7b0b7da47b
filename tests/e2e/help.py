# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""What --help and --version of the programs print: complete, once each, and narrow enough to read.

usage: help.py GNOMOND GNOMON GNOMON_RENDER
"""
import glob
import os
import re
import subprocess
import sys

from folder import Folder

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
    ([GNOMON, 'calibrate', 'response'], (LIVE - {'exposure-us'}) | {'chart', 'stack', 'live', 'exposures', 'frames', 'keep', 'times',
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


# Command lines that each command takes, as far as they go: nothing is there that they name. Together
# they have every option that it lists, but for --gige, which looks for cameras for seconds.
FED = '--server 127.0.0.1:1 --room a --token s --record none/a --record-max 1MiB --rate 5 --start-at 1 --loop --count 9'
SET = '--v4l2 /dev/null --frame-size 4x4 --frame-rate 5 --gain 1 --lock-white-balance --controls a=1 --pixel-format a'
ONE = '--camera none --marker 4x4_50:7:0.05'
WAYS = {
    'probe': ['--files none --setup none ' + FED, '--video none --projection angular', '--sequence none',
              '--exposure-us 9 --first-sequence 9 ' + SET],
    'track': ['--object a --poses none', '--object a --orbit 1',
              '--object a --files none --camera none --markers none --predict-ms 5 ' + FED,
              '--object a --video none --no-steady --debug-markers none ' + ONE,
              '--object a --exposure-us 9 %s %s' % (ONE, SET)],
    'screen': ['--stream a --files none --scale 5 ' + FED, '--stream a --video none'],
    'view': ['--files none --camera none --markers none --out none/a --match blur --sync-light 9 ' + FED,
             '--sequence none --out none/a --result jpeg --jpeg-quality 9 --quality reference --outstanding 9',
             '--video none --no-steady --debug-markers none --window --show shadow --budget-ms 9 ' + ONE,
             '--out none/a --exposure-us 9 %s %s' % (ONE, SET)],
    'replay': ['none --streams probe --rate-factor 2 --open-loop --pin-light --loop --out none/a --record none/b'
               ' --record-max 1MiB --server 127.0.0.1:1 --room a --token s',
               'none --as-fast-as-possible --expect-equal', 'none --info'],
    'calibrate print': ['--board 10x7 --square 0.03 --charuco 4x4_50 --marker 1 --out none/a.svg',
                        '--markers none --body cup --out none/a.svg'],
    'calibrate intrinsics': ['--files none --board 10x7 --square 0.03 --charuco 4x4_50 --marker 0.02'
                             ' --square-pixels --max-error 2 --out none/a --picture none/b',
                             '--video none --board 10x7 --out none/a',
                             '--views 9 --keep none/c --exposure-us 9 --board 10x7 --out none/a ' + SET],
    'calibrate response': ['--chart none --times 1,2 --model linear --corners 1,2 --full-scale 4095 --bits 12'
                           ' --bayer rggb --no-matrix --plot none/b --picture none/c --out none/a',
                           '--stack none --times 1,2 --method robertson --as gamma --radiance none/b --out none/a',
                           '--live stack --exposures auto --frames 9 --keep none/c --out none/a ' + SET],
    'calibrate probe': ['--files none --projection angular --theta-max 90 --lamps none --fit radius --share 0.5'
                        ' --tolerance 5 --full-scale 4095 --picture none/b --out none/a',
                        '--video none --ball 9,9,9 --camera-share 0.5 --out none/a',
                        '--files none --markers none --camera none --camera-files none --out none/a',
                        '--find-circle --marker 4x4_50:7:0.05 --frames 9 --exposure-us 9 --out none/a ' + SET],
}


def check_accepted(name):
    """What --help lists is taken: no command refuses an option of its own always."""
    command = [os.path.abspath(GNOMON)] + name.split()
    taken = {'help', 'version', 'gige'}
    for way in WAYS[name]:
        with Folder() as nowhere:
            done = subprocess.run(command + way.split(), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                  timeout=60, stdin=subprocess.DEVNULL, text=True, cwd=nowhere.path)
        assert done.returncode == 1 and done.stderr.count('\n') == 1, (way, done)
        taken |= {word[5:] if word.startswith('--no-') else word[2:] for word in way.split() if word[:2] == '--'}
    listed = set(re.findall(r'^  --([a-z0-9-]+)', ask(*command, '--help'), re.M))
    assert listed <= taken, '%s lists what no command line here has: %s' % (name, sorted(listed - taken))


def check_documents():
    """Commands in the documents name options that these commands have."""
    root, known, n = os.path.join(os.path.dirname(os.path.abspath(__file__)), '../..'), {}, 0
    for command, wanted in OPTIONS:
        if command[0] == GNOMON:
            known[' '.join(command[1:])] = wanted | {'help', 'version'}
    words = re.compile(r'\bgnomon (%s)\b((?:\\\\\n|[^`\n|&;])*)' % '|'.join(known))
    for path in glob.glob(os.path.join(root, '*.md')) + glob.glob(os.path.join(root, 'docs/*.md')):
        with open(path, encoding='utf-8') as f:
            for command, rest in words.findall(f.read()):
                for option in re.findall(r'(?<![\w-])--([a-z][a-z0-9-]*)', rest):
                    n += 1
                    assert {option, re.sub('^no-', '', option)} & known[command], (
                        '%s: gnomon %s has no --%s' % (os.path.basename(path), command, option))
    assert n > 100, '%d options only' % n


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
    failed = 0
    tests = [('gnomon', check_program, ()), ('documents', check_documents, ())]
    tests += [(' '.join([c[0].rsplit('/', 1)[1]] + c[1:]), check_options, (c, w)) for c, w in OPTIONS]
    tests += [('gnomon %s takes what it lists' % name, check_accepted, (name,)) for name in WAYS]
    print('1..%d' % len(tests))
    for n, (name, check, arguments) in enumerate(tests, 1):
        try:
            check(*arguments)
            print('ok %d - %s' % (n, name))
        except AssertionError as fault:
            failed += 1
            print('# %s\nnot ok %d - %s' % (str(fault).replace('\n', '\n# '), n, name))
    sys.exit(1 if failed else 0)


main()
