# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""V4L2 cameras as the kernel has them: the real driver vivid in a virtual machine, whose test
pattern, rate, controls and faults are known. One boot runs every step; the tests judge the steps.

usage: vivid.py GNOMOND DIRECTORY_OF_GNOMON_PB2 GNOMON GRAB KERNEL
"""
import json
import os
import struct
import sys
import threading

sys.path.insert(0, sys.argv[2])
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'e2e'))
from gnomond import Daemon, light_up, probe, run_tests  # noqa: E402
from machine import Machine, find_missing, quote  # noqa: E402
from pictures import read_png  # noqa: E402

GNOMON, GRAB, KERNEL = map(os.path.abspath, sys.argv[3:6])
VIDEO = '/dev/video0'
WIDTH, HEIGHT, RATE = 320, 180, 30
FRAME_NS = 1e9 / RATE
# vivid's pattern "100% Colorbar" (v4l2-tpg-core.c, bar100 and tpg_colors).
BARS = [(255, 255, 255), (255, 255, 0), (0, 255, 255), (0, 255, 0),
        (255, 0, 255), (255, 0, 0), (0, 0, 255), (0, 0, 0)]
RGB8, MONO12, MONO16 = 5, 1, 3  # enum gn_capture_format
FORMATS = {'YUYV': ('8', RGB8), 'NV12': ('8', RGB8), 'RGB3': ('8', RGB8), 'BGR3': ('8', RGB8),
           'GREY': ('8', RGB8), 'Y10': ('all', MONO16), 'Y12': ('all', MONO12),
           'Y16': ('all', MONO16)}
# 2 m above the floor, looking down: 80 pixels a metre, the floor in the middle, a cube on it.
CAMERA = {'width': WIDTH, 'height': HEIGHT, 'fx': 160, 'fy': 160, 'cx': 160, 'cy': 90,
          'distortion': [0, 0, 0, 0, 0],
          'world_from_camera': [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 2, 0, 0, 0, 1]}


def grab(name, *arguments, size='%dx%d' % (WIDTH, HEIGHT), rate=RATE, n=3, bits='8', more=()):
    return 'step %s %s\n' % (name, quote(GRAB, VIDEO, *arguments, size, rate, n, name + '.raw',
                                         bits, *more))


def control(name, *settings):
    return 'step %s v4l2-ctl -d %s -c %s\n' % (name, VIDEO, ','.join(settings))


def disturbed(name, setting):
    """A grab in whose middle a control is set, and that goes on for 20 pictures."""
    out = name + '.raw'
    return ('(until grep -q picture %s.out; do sleep 0.05; done 2>/dev/null\n'
            'v4l2-ctl -d %s -c %s; touch %s.go) &\n' % (name, VIDEO, setting, out) +
            grab(name, 'YUYV', n='+20') + 'wait\n')


def until(n):
    return 'until [ $(ls composites | wc -l) -ge %s ]; do sleep 0.1; done 2>/dev/null\n' % n


def write_script(address):
    """Every step of the one boot."""
    script = 'cat >camera.json <<END\n%s\nEND\n' % json.dumps(CAMERA)
    script += control('bars', 'test_pattern=1', 'osd_text_mode=2')
    for name, (bits, _) in FORMATS.items():
        script += grab('format_' + name, name, bits=bits)
    script += control('full709', 'y_cbcr_encoding=2', 'quantization=1')
    script += grab('bars_709_full', 'YUYV')
    script += control('asbefore', 'y_cbcr_encoding=0', 'quantization=0')
    script += grab('times', 'YUYV', n=30)
    script += control('drop', 'percentage_of_dropped_buffers=30')
    script += grab('dropped', 'YUYV', n=40)
    script += control('nodrop', 'percentage_of_dropped_buffers=0')
    script += disturbed('flagged', 'inject_v4l2_buf_flag_error=1')
    script += disturbed('unplugged', 'disconnect=1')
    script += disturbed('fatal', 'inject_fatal_streaming_error=1')
    script += grab('controlled', 'YUYV', more=('gain_automatic=0,gain=99,brightness=200',))
    script += 'step gain v4l2-ctl -d %s -C gain,brightness\n' % VIDEO
    script += control('bright', 'brightness=128')
    script += grab('no_control', 'YUYV', more=('exposure_absolute=3',))
    script += 'step no_exposure %s\n' % quote(GNOMON, 'calibrate', 'response', '--v4l2', VIDEO, '--exposures',
                                              '1,2,4ms', '--out', 'response.json')
    script += grab('no_size', 'YUYV', size='641x481')
    script += grab('no_rate', 'YUYV', rate=500)
    script += grab('no_format', 'MJPG')
    view = [GNOMON, 'view', '--server', '10.0.2.2:%d' % address[1], '--v4l2', VIDEO,
            '--camera', 'camera.json', '--pixel-format', 'YUYV', '--gain', 99, '--out', 'composites']
    script += '%s >view.out 2>view.err &\npid=$!\n' % quote(*view)
    script += until(3) + control('unplug', 'disconnect=1')
    script += 'n=$(($(ls composites | wc -l) + 6))\n' + until('$n') + 'kill -TERM $pid\nwait $pid\n'
    script += 'echo $? >view.rc\n'
    return script


class Grabbed:
    """What grab said, and the last picture's bytes."""

    def __init__(self, name, status=0):
        got, out, self.err = machine.get(name)
        assert got == status, 'status %d: %s%s' % (got, out, self.err)
        lines = [line.split() for line in out.splitlines()]
        self.times = [int(line[1]) for line in lines if line[0] == 'picture']
        self.ages_ms = [(int(line[2]) - int(line[1])) / 1e6 for line in lines
                        if line[0] == 'picture']
        self.formats = {(int(line[3]), line[4]) for line in lines if line[0] == 'picture'}
        self.news = [line for line in out.splitlines() if line.startswith('news')]
        counts = [line for line in lines if line[0] == 'counts']
        self.counts = dict(zip(counts[0][1::2], map(int, counts[0][2::2]))) if counts else {}
        self.data = machine.get_bytes(name + '.raw') if status == 0 else b''


def at_bars(read):
    """Calls read(x, y) in the middle of each bar, on several rows."""
    return [[read(i * WIDTH // 8 + WIDTH // 16 + dx, y) for dx in (-10, 0, 11)
             for y in (0, 100, HEIGHT - 1)] for i in range(8)]


def check_bars(data):
    """RGB8: the pattern's colours, within what vivid's 8-bit YUV and its integer matrices lose."""
    assert len(data) == 3 * WIDTH * HEIGHT

    def read(x, y):
        return data[3 * (WIDTH * y + x):3 * (WIDTH * y + x) + 3]
    for bar, pixels in zip(BARS, at_bars(read)):
        for pixel in pixels:
            assert max(abs(a - b) for a, b in zip(bar, pixel)) <= 4, (bar, list(pixel))


def luma(rgb):
    """BT.709, full range: what vivid makes of its colours where it gives luma alone."""
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]


def test_formats_show_the_bars():
    for name, (_, code) in FORMATS.items():
        got = Grabbed('format_' + name)
        assert got.formats == {(code, '%dx%d' % (WIDTH, HEIGHT))}, (name, got.formats)
        is_copied = name not in ('RGB3', 'Y12', 'Y16')
        assert got.counts['read_bytes'] == 3 * len(got.data), got.counts
        assert got.counts['copied_bytes'] == is_copied * 3 * len(got.data), (name, got.counts)
        if code == RGB8 and name != 'GREY':
            check_bars(got.data)
            continue
        size = 3 if code == RGB8 else 2
        assert len(got.data) == size * WIDTH * HEIGHT

        def read(x, y):
            at = size * (WIDTH * y + x)
            if size == 3:
                return got.data[at] / 255
            return struct.unpack_from('<H', got.data, at)[0] / (4095 if code == MONO12 else 65535)
        for bar, pixels in zip(BARS, at_bars(read)):
            for pixel in pixels:
                assert abs(255 * pixel - luma(bar)) < 3, (name, bar, 255 * pixel)


def test_matrix_and_range_of_the_driver():
    """The same colours, sent as BT.709 in full range: read as BT.601 they would be off by 20."""
    check_bars(Grabbed('bars_709_full').data)


def test_times_are_the_drivers():
    got = Grabbed('times')
    steps = [(b - a) / 1e6 for a, b in zip(got.times, got.times[1:])]
    assert not got.news, got.news  # it would say that the times are not the driver's
    assert min(steps) > 0, steps
    assert min(got.ages_ms) >= 0 and max(got.ages_ms) < 1000, got.ages_ms
    check_timeline(got)


def check_timeline(got):
    """Every frame time has its picture, read, replaced by a newer one, or counted as lost: also
    where the machine is too slow for the camera."""
    n = got.counts['complete'] + got.counts['lost'] - 1
    frames = (got.times[-1] - got.times[0]) / FRAME_NS
    assert abs(frames - n) <= 3, (frames, got.counts)


def test_dropped_buffers_are_counted():
    got = Grabbed('dropped')
    n = got.counts['lost'] + got.counts['complete']
    assert got.counts['lost'] > 0.12 * n, got.counts  # 30 %, of some 57: 3 sigma
    assert got.counts['incomplete'] == 0, got.counts
    check_timeline(got)


def test_flagged_buffers_are_not_sent():
    got = Grabbed('flagged')
    assert got.counts['incomplete'] == 1 and len(got.times) > 20, got.counts
    assert not got.news, got.news


def check_reopened(got, why):
    assert got.counts['reopened'] == 1 and len(got.times) > 20, (got.counts, got.news)
    assert len(got.news) == 2 and why in got.news[0] and 'is back' in got.news[1], got.news
    gap = max(b - a for a, b in zip(got.times, got.times[1:])) / 1e9
    assert gap < 2, gap
    check_bars(got.data)


def test_unplugged_and_back():
    check_reopened(Grabbed('unplugged'), 'unplugged')


def test_a_failed_driver_is_opened_again():
    check_reopened(Grabbed('fatal'), 'it is opened again')


def test_controls_are_set():
    status, out, err = machine.get('gain')
    assert status == 0 and out.split() == ['gain:', '99', 'brightness:', '200'], out + err
    got = Grabbed('controlled')
    assert got.data[3 * (WIDTH * 100 + WIDTH - 20)] > 40, 'black is no brighter'


def test_what_is_not_there_is_named():
    for name, words in (('no_control', ("no control 'exposure_absolute'; it has brightness, ",)),
                        ('no_size', ('no 641x481 in YUYV; it has 320x180@',)),
                        ('no_rate', ('no 500 pictures/s at 320x180 in YUYV; it has', '30')),
                        ('no_format', ("no pixel format 'MJPG' that we read; it has Y16, Y12",))):
        err = Grabbed(name, status=3).err
        assert all(word in err for word in words) and VIDEO + ' (vivid): ' in err, err
    status, out, err = machine.get('no_exposure')
    assert status == 1 and VIDEO + ' (vivid): no exposure can be set; it has brightness, ' in err, out + err


def test_view_gives_composites():
    """gnomon view in the machine, gnomond outside, the camera unplugged in the middle."""
    status, out, err = machine.get('view')
    assert status == 0, out + err
    assert 'unplugged' in err and 'is back' in err and err.count('\n') == 2, err
    view = json.loads(machine.get_bytes('composites/view.json'))
    assert view['results'] >= 8 and view['complete'], view
    capture = view['capture']
    assert capture['reopened'] == 1 and capture['read'] >= 8, capture
    assert capture['copied_bytes'] == capture['read_bytes'], capture  # the one conversion
    last = os.path.join('composites', view['frames'][-1]['name'] + '.png')
    width, height, pixels = read_png(os.path.join(machine.path, 'out', last))[:3]
    assert (width, height) == (WIDTH, HEIGHT)

    def read(x, y):
        return pixels[3 * (width * y + x):3 * (width * y + x) + 3]
    for i, bar in enumerate(BARS):  # beside the floor the picture is the camera's
        if not 2 <= i <= 5:
            pixel = read(i * width // 8 + 20, 4)
            assert max(abs(a - b) for a, b in zip(bar, pixel)) <= 4, (i, list(pixel))
    cube = [read(x, 90) for x in (155, 165)]  # two bars meet here, and the cube hides them
    assert max(abs(a - b) for a, b in zip(*cube)) < 30, [list(c) for c in cube]


def run_machine():
    """The one boot, with a lit daemon beside it."""
    with Daemon() as daemon:
        with probe(daemon) as light:
            light_up(light)
            over = threading.Event()
            keeper = threading.Thread(target=keep_alive, args=(light, over))
            keeper.start()
            try:
                machine.run(write_script(daemon.address))
            finally:
                over.set()
                keeper.join()


def keep_alive(light, over):
    """New light now and then: an idle session would be ended."""
    sequence = 1
    while not over.wait(1):
        sequence += 1
        light_up(light, sequence)


reason = find_missing(KERNEL)
if reason:
    print('1..0 # SKIP ' + reason)
    sys.exit(0)
machine = Machine(KERNEL)
run_machine()
run_tests([test for name, test in sorted(globals().items()) if name.startswith('test_')])
