# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""gnomon calibrate print: what comes out is what the other commands find, where and as large as it says.

usage: sheets.py GNOMOND DIRECTORY_OF_GNOMON_PB2 GNOMON HAS_OPENCV
"""
import json
import math
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as xml

sys.path.insert(0, sys.argv[2])
from folder import Folder  # noqa: E402
from gnomond import Daemon, light_up, probe, run_tests  # noqa: E402
from pictures import png_bytes  # noqa: E402

GNOMON, HAS_OPENCV = os.path.abspath(sys.argv[3]), sys.argv[4] == 'yes'
SCALE = 3  # pixels of a millimetre
SVG = '{http://www.w3.org/2000/svg}'


class Paper(Folder):
    def run(self, *arguments, status=0):
        done = subprocess.run([GNOMON, *map(str, arguments)], cwd=self.path, timeout=100, text=True,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        assert done.returncode == status, (arguments, done)
        assert (done.stderr == '') == (status == 0) and 'Sanitizer' not in done.stderr, done
        return done.stdout if status == 0 else done.stderr

    def print(self, *arguments):
        """Width and height of the sheet in mm, and its quadrangles."""
        said = self.run('calibrate', 'print', *arguments, '--out', 'sheet.svg')
        root = xml.parse(self.at('sheet.svg')).getroot()
        size = [float(root.get(name)[:-2]) for name in ('width', 'height')]
        assert root.get('width').endswith('mm') and root.get('height').endswith('mm')
        assert [float(v) for v in root.get('viewBox').split()] == [0, 0] + size, 'units of 1 mm'
        assert said.startswith('sheet.svg: %.0f x %.0f mm' % tuple(size)), said
        drawing, ruler = root.findall(SVG + 'path')
        assert re.search('h100m', ruler.get('d')) and '100 mm' in root.findall(SVG + 'text')[1].text
        quads = [[tuple(map(float, p.split())) for p in re.split('[ML]', q) if p.strip()]
                 for q in drawing.get('d').split('z') if q.strip()]
        assert all(len(q) == 4 for q in quads)
        return size, quads

    def rasterise(self, size, quads, name):
        """As a printer at so many dots a mm; returns the picture's size."""
        width, height = (math.ceil(v * SCALE) for v in size)
        rows = [bytearray(b'\xff' * width) for _ in range(height)]
        for quad in quads:
            points = [(x * SCALE, y * SCALE) for x, y in quad]
            low, high = min(p[1] for p in points), max(p[1] for p in points)
            for row in range(math.ceil(low - .5), math.ceil(high - .5)):
                y, cuts = row + .5, []
                for (x0, y0), (x1, y1) in zip(points, points[1:] + points[:1]):
                    if (y0 <= y) != (y1 <= y):
                        cuts.append(x0 + (x1 - x0) * (y - y0) / (y1 - y0))
                x0, x1 = (math.ceil(c - .5) for c in (min(cuts), max(cuts)))
                rows[row][x0:x1] = bytes(x1 - x0)
        pixels = b''.join(bytes(v for v in row for _ in range(3)) for row in rows)
        self.write(name, png_bytes(width, height, pixels))
        return width, height


def test_boards():
    """All inner corners of what is printed are found: a chessboard's and a ChArUco board's."""
    boards = ((('--board', '10x7'), 9 * 6, 250, 175),
              (('--board', '8x6', '--charuco', '5x5_100', '--square', '0.03', '--marker', '0.022'),
               7 * 5, 240, 180))
    for words, n_corners, width, height in boards:
        with Paper() as f:
            if '--charuco' in words and not HAS_OPENCV:
                assert 'opencv' in f.run('calibrate', 'print', *words, '--out', 'x.svg', status=1)
                continue
            size, quads = f.print(*words)
            for axis, wide in ((0, width), (1, height)):
                low, high = (end(p[axis] for q in quads for p in q) for end in (min, max))
                assert abs(high - low - wide) < 1e-3 and low >= 10, (low, high)
            f.rasterise(size, quads, 'sheet.png')
            if HAS_OPENCV:
                done = subprocess.run([GNOMON, 'calibrate', 'intrinsics', '--files', f.at('sheet.png'),
                                       *words, '--out', f.at('camera.json')], capture_output=True, text=True)
                assert done.stdout.startswith('%s: %d corners\n' % (f.at('sheet.png'), n_corners)), done
                assert 'at least 5' in done.stderr and done.returncode == 1, done  # one is too few
                assert not os.path.exists(f.at('camera.json'))


def find_world(f, size, quads, *words):
    """The poses.jsonl line of a camera that looks at the sheet from right above."""
    os.mkdir(f.at('shots'))
    width, height = f.rasterise(size, quads, 'shots/a.png')
    with open(f.at('camera.json'), 'w') as out:
        json.dump({'width': width, 'height': height, 'fx': 900, 'fy': 900, 'cx': width / 2,
                   'cy': height / 2, 'distortion': [0, 0, 0, 0, 0]}, out)
    with Daemon() as daemon, probe(daemon) as light:
        light_up(light)
        f.run('view', '--server=%s:%d' % daemon.address, '--files', 'shots', '--camera',
              'camera.json', '--out', 'out', *words)
    with open(f.at('out/poses.jsonl')) as lines:
        body, = json.loads(lines.readline())['bodies']
    return body


def check_pose(body, size, x_mm, y_mm):
    """The origin is at that place of the sheet, x to the right, y up, z towards the camera."""
    m = body['camera_from_body']
    away = 900 / SCALE  # mm
    for i, value in ((0, 1), (5, -1), (10, -1)):
        assert abs(m[i] - value) < 2e-3, m
    seen = [1e3 * m[i] for i in (3, 7, 11)]
    wanted = (x_mm - size[0] / 2, y_mm - size[1] / 2, away)
    assert math.dist(seen, wanted) < 1, (seen, wanted)


def test_marker():
    """What gnomon view --marker finds is the marker printed from the same word, as far as it is large."""
    with Paper() as f:
        size, quads = f.print('--marker', 'apriltag_36h11:72:0.08')
        body = find_world(f, size, quads, '--marker', 'apriltag_36h11:72:0.08')
        check_pose(body, size, size[0] / 2, 80 / 6 + 40)


def test_body():
    """Markers of markers.json lie where it says, turned ones too."""
    turned = [math.cos(.3), 0, 0, math.sin(.3)]
    markers = {'dictionary': '4x4_50', 'bodies': [
        {'name': 'world', 'markers': [{'id': 7, 'size': 0.05},
                                      {'id': 8, 'size': 0.04, 'position': [0.1, 0.06, 0], 'orientation': turned}]},
        {'name': 'box', 'markers': [{'id': 3, 'size': 0.05, 'position': [0, 0, 0.01]}]},
        {'name': 'back', 'markers': [{'id': 4, 'size': 0.05, 'orientation': [0, 1, 0, 0]}]}]}
    with Paper() as f:
        with open(f.at('markers.json'), 'w') as out:
            json.dump(markers, out)
        size, quads = f.print('--markers', 'markers.json')
        body = find_world(f, size, quads, '--markers', 'markers.json')
        low = min(p[0] for q in quads for p in q)
        high = max(p[1] for q in quads for p in q)
        check_pose(body, size, low + 25, high - 25)
        assert body['markers'] == 2 and body['rms_px'] < 0.5, body
        for name, marker in (('box', 3), ('back', 4)):  # raised, and seen from behind
            err = f.run('calibrate', 'print', '--markers', 'markers.json', '--body', name, '--out',
                        'x.svg', status=1)
            assert 'body "%s": marker %d does not lie in the plane' % (name, marker) in err, err
        err = f.run('calibrate', 'print', '--markers', 'markers.json', '--body', 'cup', '--out',
                    'x.svg', status=1)
        assert 'markers.json: there is no body called "cup"' in err, err


def test_refused():
    """Words that do not go together, and boards that are none: one line each, and no file."""
    for words, status, what in (
            ((), 2, '--board CxR, --marker DICT:ID:SIZE or --markers FILE'),
            (('--board', '10x7', '--markers', 'm.json'), 2, 'one of them'),
            (('--marker', '4x4_50:7:0.05', '--square', '0.1'), 2, 'are for --board'),
            (('--marker', '4x4_50:7:0.05', '--body', 'cup'), 2, '--body is for --markers'),
            (('--board', '10x7', '--marker', '4x4_50:7:0.05'), 2, '--charuco DICTIONARY only'),
            (('--board', '10by7'), 1, '--board 10by7: right would be'),
            (('--board', '10x10'), 1, 'upside down'),
            (('--board', '40x7'), 1, '3 to 33 squares'),
            (('--board', '10x7', '--charuco', '4x4_50', '--marker', '4x4_50:7:0.05'), 1, 'in metres'),
            (('--board', '10x7', '--charuco', '4x4_50', '--marker', '0.5'), 1, 'do not lie in squares'),
            (('--markers', 'none.json'), 1, 'none.json')):
        with Paper() as f:
            err = f.run('calibrate', 'print', *words, '--out', 'x.svg', status=status)
            assert what in err and err.count('\n') == 1, err
            assert os.listdir(f.path) == []
    with Paper() as f:
        err = f.run('calibrate', 'print', '--board', '10x7', '--out', 'no/x.svg', status=1)
        assert 'no/x.svg' in err, err
        for name in ('x.pdf', 'x', 'svg', 'x.svg.png', '.'):
            err = f.run('calibrate', 'print', '--board', '10x7', '--out', name, status=2)
            assert 'ends in .svg, or - for standard output' in err and err.count('\n') == 1, err
        assert os.listdir(f.path) == []
        f.run('calibrate', 'print', '--board', '10x7', '--out', 'X.SVG')
        done = subprocess.run([GNOMON, 'calibrate', 'print', '--board', '10x7', '--out', '-'], cwd=f.path,
                              capture_output=True, text=True, timeout=100, check=True)
        with open(f.at('X.SVG')) as sheet:
            assert done.stdout == sheet.read() and os.listdir(f.path) == ['X.SVG'], done.stdout
        assert done.stderr.startswith('standard output: ') and 'print it at 100 %' in done.stderr, done.stderr
        if HAS_OPENCV:
            err = f.run('calibrate', 'print', '--board', '33x33', '--charuco', '4x4_50', '--out', 'x.svg',
                        status=1)
            assert "needs more markers than the dictionary's 50" in err, err
            done = subprocess.run([GNOMON, 'calibrate', 'print', '--marker', '4x4_50:7:80', '--out', '-'],
                                  capture_output=True, text=True, timeout=100, check=True)
            assert done.stderr.startswith('gnomon: --marker: marker 7: sizes are in metres: 80 m?\n'), done.stderr
            err = f.run('calibrate', 'print', '--marker', '4x4_50:50:0.05', '--out', 'x.svg', status=1)
            assert '--marker 4x4_50:50:0.05: ' in err and 'ID from 0 to 49' in err, err


run_tests([test_boards, test_refused] + ([test_marker, test_body] if HAS_OPENCV else []))
