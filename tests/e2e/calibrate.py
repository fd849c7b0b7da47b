# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""gnomon calibrate on pictures made here with known truth, and on real photographs.

usage: calibrate.py GNOMON
"""
import glob
import json
import math
import os
import re
import struct
import subprocess
import sys

from chart import CHART
from folder import Folder
from pictures import png_bytes, read_png

GNOMON = os.environ.get('CLIENT_UNDER_TEST') or sys.argv[1]
DATA = os.environ.get('GNOMON_DATA')
PATCH, GAP, BORDER = 90, 9, 60
A, B, C = 0.6, 0.07, 2e-4


class Skip(Exception):
    pass


def calibrate(*arguments):
    done = subprocess.run([GNOMON, 'calibrate', *map(str, arguments)], stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=100)
    return done.returncode, done.stdout.decode(), done.stderr.decode()


def succeed(*arguments):
    status, out, err = calibrate(*arguments)
    assert status == 0 and err == '', (arguments, status, out[-500:], err)
    return out


def refuse(words, *arguments, status=1):
    """One line that says what is wrong, no traceback of any sort. status: 2 for misuse."""
    got, out, err = calibrate(*arguments)
    assert got == status, (arguments, got, out, err)
    assert err.count('\n') == 1 and words in err, (words, err)


def need_opencv():
    if 'opencv' in calibrate('intrinsics', '--files', '/', '--board', '10x7', '--out', '/x')[2]:
        raise Skip('this build has no OpenCV')


def chart_picture(encode):
    """A picture of the chart in 16 bits, codes [0, 4095]: encode(light) of each patch."""
    def samples(rgb, n):
        return struct.pack('>3H', *(min(max(round(4095 * encode(v)), 0), 4095) for v in rgb)) * n
    dark = (.03, .03, .03)
    width, height = 2 * BORDER + 6 * PATCH + 5 * GAP, 2 * BORDER + 4 * PATCH + 3 * GAP
    empty = samples(dark, width)
    rows = []
    for row in range(4):
        line = samples(dark, BORDER)
        for column in range(6):
            line += samples(CHART[6 * row + column], PATCH) + samples(dark, GAP if column < 5 else BORDER)
        rows += [line] * PATCH + [empty] * (GAP if row < 3 else BORDER)
    return png_bytes(width, height, b''.join([empty] * BORDER + rows), bits=16)


def write_charts(folder, times):
    for i, t in enumerate(times):
        folder.write('chart%d.png' % i,
                     chart_picture(lambda v, t=t: A + B * math.log(C + t * v)))


def centre(column, row):
    return ('%g,%g' % (BORDER + PATCH / 2 + column * (PATCH + GAP),
                       BORDER + PATCH / 2 + row * (PATCH + GAP)))


CORNERS = ','.join((centre(0, 0), centre(5, 0), centre(5, 3), centre(0, 3)))


def check_response(path, scale):
    """The written curve against the true one: light 1e-3 to 100 within 3 %."""
    r = json.load(open(path))['response']
    assert r['type'] == 'log', r
    worst = 0
    for i in range(101):
        x = 10 ** (-3 + i * .05)
        found = math.exp((A + B * math.log(C + x) - r['a']) / r['b']) - r['c']
        worst = max(worst, abs(found * scale / x - 1))
    print('# log curve: worst %.2f %% of five decades' % (100 * worst))
    assert worst < .01, worst


def check_chart():
    times = [1, .01, .1, 10, 100]
    with Folder() as f:
        write_charts(f, times)
        listed = ','.join(map(str, times))
        out = succeed('response', '--chart', f.at('chart*.png'), '--times', listed, '--full-scale', 4095,
                      '--corners', CORNERS, '--out', f.at('camera.json'), '--plot', f.at('plot.svg'))
        assert 'condition number' in out and 'dark skin' in out, out
        check_response(f.at('camera.json'), 1)
        m = json.load(open(f.at('camera.json')))['to_rec709']
        assert all(abs(m[i] - (i % 4 == 0)) < .03 for i in range(9)), m
        svg = open(f.at('plot.svg')).read()
        assert svg.startswith('<svg') and svg.count('<circle') > 200, svg[:200]
        succeed('response', '--chart', f.at('chart*.png'), '--full-scale', 4095, '--corners', CORNERS,
                '--out', f.at('unknown.json'))
        check_response(f.at('unknown.json'), 1)

        refuse('one exposure alone', 'response', '--chart', f.at('chart0.png'), '--full-scale', 4095,
               '--corners', CORNERS, '--out', f.at('x.json'))
        refuse('5 pictures', 'response', '--chart', f.at('chart*.png'), '--times', '1,2', '--full-scale',
               4095, '--corners', CORNERS, '--out', f.at('x.json'))
        refuse('is above the full scale of 1000', 'response', '--chart', f.at('chart*.png'), '--full-scale',
               1000, '--corners', CORNERS, '--out', f.at('x.json'))
        refuse('lies outside', 'response', '--chart', f.at('chart*.png'), '--full-scale', 4095,
               '--corners', '0,0,9e3,0,9e3,9e3,0,9e3', '--out', f.at('x.json'))
        turned = CORNERS.split(',')
        turned = ','.join(turned[4:] + turned[:4])
        refuse('the chart lies another way', 'response', '--chart', f.at('chart*.png'), '--times', listed,
               '--full-scale', 4095, '--corners', turned, '--no-matrix', '--out', f.at('x.json'))
        refuse('8 numbers', 'response', '--chart', f.at('chart*.png'), '--full-scale', 4095,
               '--corners', '0,0,9', '--out', f.at('x.json'))
        refuse('number 2 is none', 'response', '--chart', f.at('chart*.png'), '--times', '1,two',
               '--out', f.at('x.json'))
        refuse('one of them', 'response', '--out', f.at('x.json'), status=2)
        f.write('bad.json', b'{"width": 0, "fx": 1}')
        refuse('bad.json', 'response', '--chart', f.at('chart*.png'), '--times', listed, '--full-scale', 4095,
               '--corners', CORNERS, '--out', f.at('bad.json'))
        assert not os.path.exists(f.at('x.json'))
        assert open(f.at('bad.json')).read() == '{"width": 0, "fx": 1}'


def check_chart_order():
    """Times that are not the pictures' are refused, whatever curve they would give."""
    cases = (('linear', (9, .3, 1, 3, 30), (.3, 1, 3, 9, 30), lambda v: .01 + .9 * v / 30),
             ('log', (100, 2, 10, 30, 500, 2000), (2, 10, 30, 100, 500, 2000),
              lambda v: A + B * math.log(C + v / 100)))
    for model, times, wrong, encode in cases:
        with Folder() as f:
            for i, t in enumerate(times):
                f.write('chart%d.png' % i, chart_picture(lambda v, t=t, encode=encode: encode(t * v)))
            start = ('response', '--chart', f.at('chart*.png'), '--full-scale', 4095, '--corners', CORNERS,
                     '--no-matrix', '--model', model, '--out', f.at('camera.json'), '--times')
            refuse('codes fall as the exposure rises: are the times', *start, ','.join(map(str, wrong)))
            # In their order, but of other pictures: named is one that lies off.
            far = [t * 3 if i == 2 else t for i, t in enumerate(times)]
            refuse('chart2.png', *start, ','.join(map(str, far)))
            refuse('without a unit', *start, ','.join('%gms' % t for t in times))
            assert not os.path.exists(f.at('camera.json'))
            succeed(*start, ','.join(map(str, times)))


def check_chart_found():
    with Folder() as f:
        write_charts(f, [1, .1, 10])
        out = succeed('response', '--chart', f.at('chart*.png'), '--times', '1,.1,10', '--full-scale', 4095,
                      '--out', f.at('camera.json'))
        found = re.search(r'--corners ([\d.,]+)', out)
        assert found, out
        off = max(abs(float(a) - float(b)) for a, b in zip(found.group(1).split(','), CORNERS.split(',')))
        print('# the chart\'s corner patches found within %.1f px' % off)
        assert off < 8
        check_response(f.at('camera.json'), 1)


def encode_srgb(x):
    return 12.92 * x if x <= .0031308 else 1.055 * x ** (1 / 2.4) - .055


def check_stack():
    times = [2.0 ** k for k in range(-4, 6)]
    with Folder() as f:
        for k, t in enumerate(times):
            f.write('s%d.png' % k, png_bytes(128, 128, bytes(
                min(round(255 * encode_srgb(min(.002 * 1.0004 ** i * t, 1))), 255)
                for i in range(128 * 128)), 1))
        f.write('times.txt', '\n'.join('%g # %d' % (t, k) for k, t in enumerate(times)).encode())
        for method in ('debevec', 'robertson'):
            succeed('response', '--stack', f.at('s*.png'), '--times', f.at('times.txt'), '--method', method,
                    '--out', f.at('probe.json'), '--radiance', f.at('scene.exr'))
            table = json.load(open(f.at('probe.json')))['response']['table']
            worst = max(abs(table[z] / ((z / 255 + .055) / 1.055) ** 2.4 - 1) for z in range(15, 246))
            print('# %s: table against sRGB, worst %.2f %% of codes 15 to 245' % (method, 100 * worst))
            assert len(table) == 256 and worst < .03
        assert os.path.getsize(f.at('scene.exr')) > 1000
        out = succeed('response', '--stack', f.at('s*.png'), '--times', f.at('times.txt'), '--as', 'srgb',
                      '--out', f.at('probe.json'))
        assert float(re.search(r'off the table by ([\d.]+) %', out).group(1)) < 2, out
        assert json.load(open(f.at('probe.json')))['response'] == {'type': 'srgb'}
        refuse('needs --times', 'response', '--stack', f.at('s*.png'), '--out', f.at('x.json'), status=2)
        for option, words in ((['--plot', 'x'], '--plot is for charts'), (['--model', 'linear'], '--model is for charts')):
            refuse(words, 'response', '--stack', f.at('s*.png'), '--times', f.at('times.txt'), *option, '--out',
                   f.at('x.json'), status=2)
        refuse('--as is for stacks', 'response', '--chart', f.at('s*.png'), '--as', 'srgb', '--out', f.at('x.json'),
               status=2)
        refuse('codes fall', 'response', '--stack', f.at('s*.png'), '--times',
               ','.join(map(str, times[::-1])), '--out', f.at('x.json'))


def spots_picture(size, positions):
    """A gray 16-bit picture, dark but for discs of radius 4.2 px at positions."""
    pixels = bytearray(struct.pack('>H', 300) * (size * size))
    for u, v in positions:
        for y in range(int(v) - 7, int(v) + 8):
            for x in range(int(u) - 7, int(u) + 8):
                share = min(max(4.7 - math.hypot(x + .5 - u, y + .5 - v), 0), 1)
                at = 2 * (y * size + x)
                pixels[at:at + 2] = struct.pack('>H', 300 + int(50000 * share))
    return png_bytes(size, size, bytes(pixels), 1, 16)


def rotate(q, v):
    w, x, y, z = q
    t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])]
    return [v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2],
            v[2] + w * t[2] + x * t[1] - y * t[0]]


def check_probe():
    q = [.2, .93, -.25, .18]
    norm = math.sqrt(sum(v * v for v in q))
    q = [v / norm for v in q]
    seen = [[(40, 70), (215, 120)], [(150, 210), (60, 190)], [(120, 60)]]
    with Folder() as f:
        lines = ['# three pictures']
        for i, spots in enumerate(seen):
            f.write('p%d.png' % i, spots_picture(256, spots))
            for u, v in spots[::-1]:  # in another order than they are found
                theta = math.hypot(u - 128, v - 128) / 128 * math.pi / 2
                phi = math.atan2(v - 128, u - 128)
                d = rotate(q, (math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi),
                               math.cos(theta)))
                lines.append('p%d.png %.6f %.6f %.6f' % (i, *(3.7 * x for x in d)))
        f.write('lamps.txt', '\n'.join(lines).encode())
        f.write('probe.json', b'{"response": {"type": "linear"}, "position": [0, 0, 0.3]}')
        out = succeed('probe', '--files', f.at('p*.png'), '--projection', 'fisheye-equidistant', '--lamps',
                      f.at('lamps.txt'), '--out', f.at('probe.json'), '--picture', f.at('found.png'))
        setup = json.load(open(f.at('probe.json')))
        error = math.degrees(2 * math.acos(min(abs(sum(a * b for a, b in zip(q, setup['orientation']))), 1)))
        print('# orientation off by %.3f degrees' % error)
        assert error < .3 and '5 lamps' in out, (error, out)
        assert setup['position'] == [0, 0, 0.3] and setup['width'] == 256, setup
        assert os.path.getsize(f.at('found.png')) > 500

        f.write('small.png', spots_picture(128, [(40, 40), (80, 90)]))
        refuse('128 x 128, but the probe\'s pictures are 256 x 256', 'probe', '--files', f.at('small.png'),
               '--lamps', f.at('lamps.txt'), '--out', f.at('probe.json'))
        f.write('wrong.txt', b'* 0 0 1\n* 1 0 0\n')
        refuse('no orientation', 'probe', '--files', f.at('p0.png'), '--lamps', f.at('wrong.txt'), '--out',
               f.at('probe.json'))
        mirrored = [' '.join([w[0], '%.6f' % -float(w[1])] + w[2:]) for w in (x.split() for x in lines[1:])]
        f.write('mirrored.txt', '\n'.join(mirrored).encode())
        refuse('is not where the others say', 'probe', '--files', f.at('p*.png'), '--lamps',
               f.at('mirrored.txt'), '--out', f.at('probe.json'))
        f.write('swapped.txt', '\n'.join(lines[1:3]).encode())
        refuse('two orientations', 'probe', '--files', f.at('p0.png'), '--lamps', f.at('swapped.txt'), '--out',
               f.at('probe.json'))
        f.write('one.txt', lines[1].encode())
        refuse('has one lamp', 'probe', '--files', f.at('p0.png'), '--lamps', f.at('one.txt'), '--out',
               f.at('probe.json'))
        f.write('zero.txt', b'p0.png 0 0 0\n')
        refuse('line 1: right would be', 'probe', '--files', f.at('p0.png'), '--lamps', f.at('zero.txt'),
               '--out', f.at('probe.json'))
        refuse('nothing to find', 'probe', '--files', f.at('p0.png'), '--out', f.at('probe.json'), status=2)
        refuse('says no projection', 'probe', '--files', f.at('p0.png'), '--find-circle', '--out',
               f.at('new.json'))
        assert json.load(open(f.at('probe.json'))) == setup


def check_ball():
    def pixel(x, y):
        if math.hypot(x + .5 - 163.4, y + .5 - 118.2) < 84.6:
            return int(90 + 30 * math.sin(.08 * x) + 25 * math.cos(.11 * y))
        return 190 + (x + y) % 7
    with Folder() as f:
        f.write('ball.png', png_bytes(320, 240, bytes(pixel(x, y) for y in range(240) for x in range(320)), 1))
        succeed('probe', '--files', f.at('ball.png'), '--projection', 'mirrorball', '--ball', '156,124,79',
                '--camera-share', .15, '--out', f.at('probe.json'), '--picture', f.at('found.png'))
        setup = json.load(open(f.at('probe.json')))
        mask = setup['mask'][0]
        assert abs(setup['center'][0] - 163.4) < .5 and abs(setup['center'][1] - 118.2) < .5, setup
        ball = setup['radius'] / math.sin(setup['theta_max'] / 2)
        assert abs(ball - 84.6) < .5 and setup['theta_max'] < 2.6, setup
        assert abs(mask['radius'] - .15 * 84.6) < .2 and mask['center'] == setup['center'], setup
        succeed('probe', '--files', f.at('ball.png'), '--ball', '156,124,79', '--camera-share', 0,
                '--theta-max', 120, '--out', f.at('probe.json'))
        setup = json.load(open(f.at('probe.json')))
        assert abs(setup['radius'] / math.sin(math.radians(60)) - 84.6) < .5, setup
        assert abs(setup['theta_max'] - math.radians(120)) < 1e-6 and 'mask' not in setup, setup
        refuse('right would be X,Y,RADIUS', 'probe', '--files', f.at('ball.png'), '--projection',
               'mirrorball', '--ball', '160,120,1e300', '--out', f.at('x.json'))
        refuse('no ball is seen near (60, 60)', 'probe', '--files', f.at('ball.png'), '--projection',
               'mirrorball', '--ball', '60,60,30', '--out', f.at('x.json'))


def read_tiff(path):
    """Width, height and bytes of an 8-bit TIFF of PackBits strips (TIFF 6.0, section 9)."""
    data = open(path, 'rb').read()
    assert data[:4] == b'II*\0', path
    at = struct.unpack_from('<I', data, 4)[0]
    tags = {}
    for i in range(struct.unpack_from('<H', data, at)[0]):
        tag, kind, n, value = struct.unpack_from('<HHII', data, at + 2 + 12 * i)
        size = {3: 2, 4: 4}.get(kind)
        if size:
            where = value if n * size > 4 else at + 2 + 12 * i + 8
            tags[tag] = struct.unpack_from('<%d%s' % (n, 'H' if size == 2 else 'I'), data, where)
    assert set(tags[258]) == {8} and tags[259] == (32773,), path
    out = bytearray()
    for offset, count in zip(tags[273], tags[279]):
        i = offset
        while i < offset + count:
            n = data[i]
            if n < 128:
                out += data[i + 1:i + 2 + n]
                i += n + 2
            else:
                out += data[i + 1:i + 2] * (257 - n) if n > 128 else b''
                i += 2 if n > 128 else 1
    return tags[256][0], tags[257][0], bytes(out)


def check_found(out, bound):
    """The chart of these photographs, against its patches' centres read off the pictures."""
    found = [float(x) for x in re.search(r'--corners ([\d.,]+)', out).group(1).split(',')]
    off = max(abs(a - b) for a, b in zip(found, (59, 57, 352, 58, 334, 224, 75, 218)))
    print('# the chart\'s corner patches found within %.1f px' % off)
    assert off < bound, (found, out)


def check_raw_photographs():
    """Linear raw Bayer photographs of a chart, 25 to 3916 ms, by their exposures alone."""
    if not DATA:
        raise Skip('GNOMON_DATA is unset')
    for band in (450, 550):
        with Folder() as f:
            times = []
            paths = glob.glob(os.path.join(DATA, 'colorchecker', 'raw_bayer', '*_%dnm_*.tif' % band))
            for path in sorted(paths, key=lambda p: int(re.search(r'_(\d+)ms', p).group(1))):
                times.append(re.search(r'_(\d+)ms', path).group(1))
                width, height, pixels = read_tiff(path)
                f.write('shot%d.png' % len(times), png_bytes(width, height, pixels, 1))
            assert len(times) == 7, paths
            out = succeed('response', '--chart', f.at('shot*.png'), '--times', ','.join(times), '--model',
                          'linear', '--bayer', 'gbrg', '--no-matrix', '--out', f.at('camera.json'))
            check_found(out, 6)
            errors = [(float(e), int(n)) for e, n in
                      re.findall(r'error ([\d.]+) % RMS over (\d+) sure', out)]
            print('# %d nm, %s ms: errors %s %%' % (band, ' '.join(times),
                                                   ' '.join('%.2f' % e for e, _ in errors)))
            assert len(errors) == 7 and all(e < 3 and n >= 5 for e, n in errors), out
            table = json.load(open(f.at('camera.json')))['response']['table']
            assert len(table) == 4096 and table[-1] > 0
            # Nearly black or nearly white, one alone shows the chart.
            for shot in ('shot1.png', 'shot7.png'):
                refuse('one exposure alone', 'response', '--chart', f.at(shot), '--bayer', 'gbrg', '--no-matrix',
                       '--out', f.at('x.json'))


def check_photograph_in_colour():
    """The same chart under white light."""
    if not DATA:
        raise Skip('GNOMON_DATA is unset')
    with Folder() as f:
        width, height, pixels = read_tiff(os.path.join(DATA, 'colorchecker', 'd2_colorChecker30cm_d3_wb.tif'))
        f.write('shot.png', png_bytes(width, height, pixels, 3))
        status, out, err = calibrate('response', '--chart', f.at('shot.png'), '--out', f.at('x.json'),
                                     '--picture', f.at('found.png'))
        assert status == 1 and 'one exposure alone' in err, (status, out, err)
        check_found(out, 6)
        assert read_png(f.at('found.png'))[:2] == (width, height)


def check_published_intrinsics():
    need_opencv()
    if not DATA:
        raise Skip('GNOMON_DATA is unset')
    pictures = os.path.join(DATA, 'markers', 'opencv', 'left*.jpg')
    text = open(os.path.join(DATA, 'markers', 'opencv', 'left_intrinsics.yml')).read()
    k = [float(x) for x in re.search(r'camera_matrix.*?\[(.*?)\]', text, re.S).group(1).split(',')]
    # OpenCV's pixel centres are whole numbers, ours lie half a pixel further.
    published = {'fx': k[0], 'fy': k[4], 'cx': k[2] + .5, 'cy': k[5] + .5}
    with Folder() as f:
        out = succeed('intrinsics', '--files', pictures, '--board', '10x7', '--square-pixels', '--out',
                      f.at('camera.json'), '--picture', f.at('coverage.png'))
        found = json.load(open(f.at('camera.json')))
        for key, value in published.items():
            ours = float(re.search(r'^%s \S+ \+- (\S+)' % key, out, re.M).group(1))
            # Theirs: residuals of 0.39 px against our 0.20, from 13 views against 9.
            theirs = ours * .39 / .20 * math.sqrt(9 / 13)
            print('# %s %.2f, published %.2f, standard errors %.2f and %.2f' % (
                key, found[key], value, ours, theirs))
            assert abs(found[key] - value) < 2 * math.hypot(ours, theirs), (key, found[key], value)
        assert float(re.search(r'^error ([\d.]+) px RMS over', out, re.M).group(1)) < .3
        assert 'world_from_camera' not in found and 'where the camera is it does not say' in out, out
        refuse('pictures show the board', 'intrinsics', '--files', pictures, '--board', '8x5', '--out',
               f.at('x.json'))
        refuse('a board of 10x7 squares is seen, and --board counts squares', 'intrinsics', '--files', pictures,
               '--board', '9x6', '--out', f.at('x.json'))
        refuse('4 pictures show the board', 'intrinsics', '--files',
               os.path.join(DATA, 'markers', 'opencv', 'left0[1245].jpg'), '--board', '10x7', '--out',
               f.at('x.json'))
        assert not os.path.exists(f.at('x.json'))


def check_refusals():
    need_opencv()
    with Folder() as f:
        f.write('a.png', png_bytes(64, 48, bytes(64 * 48), 1))
        f.write('b.png', png_bytes(32, 48, bytes(32 * 48), 1))
        refuse('looks the same upside down', 'intrinsics', '--files', f.at('a.png'), '--board', '9x7', '--out',
               f.at('x.json'))
        refuse('10x7', 'intrinsics', '--files', f.at('a.png'), '--board', '10by7', '--out', f.at('x.json'))
        refuse('in [0.0001, 10] (METRES)', 'print', '--board', '10x7', '--square', 25, '--out', f.at('x.svg'),
               status=2)
        for more, hint in ((['10x7'], '; a chessboard must be whole in the picture'),
                           (['8x6', '--charuco', '4x4_50'], '')):
            out = calibrate('intrinsics', '--files', f.at('a.png'), '--out', f.at('x.json'), '--board', *more)[1]
            assert out == f.at('a.png') + ': no board (0 corners)%s\n' % hint, out
        refuse('the first picture is 64 x 48', 'intrinsics', '--files', f.at('*.png'), '--board', '10x7',
               '--out', f.at('x.json'))
        refuse('the pictures show no colour chart', 'response', '--chart', f.at('a.png'), '--out',
               f.at('x.json'))
        status, _, err = calibrate('respose')
        assert status == 2 and "did you mean 'response'" in err, err
        assert 'intrinsics' in succeed('--help')


def main():
    tests = [check_chart, check_chart_order, check_chart_found, check_stack, check_probe, check_ball,
             check_raw_photographs, check_photograph_in_colour, check_published_intrinsics, check_refusals]
    print('1..%d' % len(tests))
    failed = 0
    for n, test in enumerate(tests, 1):
        name = test.__name__[6:].replace('_', ' ')
        try:
            test()
            print('ok %d - %s' % (n, name))
        except Skip as reason:
            print('ok %d - %s # SKIP %s' % (n, name, reason))
        except AssertionError as fault:
            failed += 1
            print('# %s\nnot ok %d - %s' % (str(fault).replace('\n', '\n# '), n, name))
    sys.exit(1 if failed else 0)


main()
