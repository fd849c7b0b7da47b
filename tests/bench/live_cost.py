# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""What live capture and tracking cost, in one run: processor time of all threads of gnomon view per
640x480 picture, from a camera's packets or buffers to the message, its answer and its file. Fails
where a followed marker takes 5 ms or more (median), its pose is not found, none in sight takes that
(mean), or a picture is copied more than once.

GigE Vision comes from the fake camera through AF_PACKET and, without rights, through a socket; V4L2
is recorded buffers in the kernel's place (recorded_v4l2.c), the rest of the program its own. The
pictures are of a marker in clutter before a camera that swings; 'none' is a plain backdrop without
a marker, 'clutter' a cluttered one, of which client/track searches some pictures whole.

usage: live_cost.py GNOMOND DIRECTORY_OF_GNOMON_PB2 GNOMON FAKE_GIGE MAKE_SHOTS GNOMON_RECORDED [N]
"""
import glob
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path[1:1] = [os.path.join(sys.path[0], 'e2e'), sys.argv[2]]
import own_network  # noqa: E402
from gnomond import Daemon, Room  # noqa: E402
from pictures import exr_bytes  # noqa: E402

GNOMON, FAKE, MAKE_SHOTS, RECORDED = sys.argv[3:7]
N = int(sys.argv[7]) if len(sys.argv) > 7 else 45
WARM_UP = 25  # the daemon's first frames take longer than the camera's interval
LIMIT_MS = 5
MARKER = '6x6_250:0:0.08'
SHOTS = (('one', 'one', 'cluttered'), ('none', 'none', 'plain'), ('clutter', 'none', 'cluttered'))
# So little to render that the daemon keeps pace with the camera: a cube of 2 mm.
SCENE = {'objects': [{'mesh': 'cube.obj', 'role': 'virtual', 'world_from_object':
                      [.01, 0, 0, 0, 0, .01, 0, 0, 0, 0, .01, 0, 0, 0, 0, 1]}]}
# Camera, pixel format, picture, received by, rate in Hz.
CASES = [('gige', 'RGB8', 'one', 'AF_PACKET', 25), ('gige', 'RGB8', 'one', 'socket', 25),
         ('gige', 'RGB8', 'one', 'socket, packets of 8000', 25),
         ('gige', 'Mono8', 'one', 'AF_PACKET', 25), ('gige', 'BayerRG8', 'one', 'AF_PACKET', 25),
         ('gige', 'RGB8', 'none', 'AF_PACKET', 30), ('gige', 'RGB8', 'none', 'AF_PACKET', 60),
         ('gige', 'RGB8', 'clutter', 'AF_PACKET', 30), ('gige', 'RGB8', 'clutter', 'AF_PACKET', 60),
         ('v4l2', 'YUYV', 'one', 'buffers', 25), ('v4l2', 'MJPG', 'one', 'buffers', 25),
         ('v4l2', 'YUYV', 'none', 'buffers', 30), ('v4l2', 'YUYV', 'none', 'buffers', 60),
         ('v4l2', 'YUYV', 'clutter', 'buffers', 30), ('v4l2', 'YUYV', 'clutter', 'buffers', 60)]


def get_process_ms(pid):
    """Of all threads, ended ones too: clock_getcpuclockid(3), whose encoding is the kernel's ABI."""
    return 1e3 * time.clock_gettime(~pid << 3 | 2)


def get_thread_ms(pid):
    """By name; a thread that runs just now is told up to its last tick."""
    found = {}
    for path in glob.glob('/proc/%d/task/*/' % pid):
        with open(path + 'comm') as name, open(path + 'schedstat') as spent:
            key = name.read().strip()
            found[key] = found.get(key, 0) + int(spent.read().split()[0]) * 1e-6
    return found


def run_view(daemon, folder, case):
    """Returns per picture the process' and the threads' milliseconds, the counts, the last words."""
    kind, pixel_format, shots, way, rate = case
    place = os.path.join(folder, shots)
    command = own_network.NO_RIGHTS if way.startswith('socket') else []
    command = [*command, GNOMON if kind == 'gige' else RECORDED, 'view', '--server=%s:%d' % daemon.address,
               '--' + kind, '127.0.0.1' if kind == 'gige' else place, '--camera',
               os.path.join(place, 'camera.json'), '--marker', MARKER, '--result', 'jpeg',
               '--pixel-format', pixel_format, '--frame-rate', str(rate), '--count',
               str(N + WARM_UP), '--out', os.path.join(folder, 'out')]
    if '8000' in way:
        command += ['--controls', 'GevSCPSPacketSize=8000']
    view = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    totals, threads, words = [], [], ''
    for line in view.stdout:
        if line.startswith('frame '):
            totals.append(get_process_ms(view.pid))
            threads.append(get_thread_ms(view.pid))
        words += line
    # Where no picture had a pose, nothing was shown: that is no success.
    assert view.wait() == (0 if shots == 'one' else 1), words
    with open(os.path.join(folder, 'out', 'view.json')) as f:
        counts = json.load(f)['capture']
    steps = [b - a for a, b in zip(totals[WARM_UP:], totals[WARM_UP + 1:])]
    names = sorted(threads[-1])
    by_thread = {name: statistics.median(b.get(name, 0) - a.get(name, 0) for a, b in
                                         zip(threads[WARM_UP:], threads[WARM_UP + 1:]))
                 for name in names}
    return steps, by_thread, counts, words


def measure(daemon, folder, case):
    kind, pixel_format, shots, way, rate = case
    camera = None
    if kind == 'gige':
        camera = subprocess.Popen([FAKE, '--width', '640', '--height', '480', '--files',
                                   os.path.join(folder, shots, '*.png')], stdout=subprocess.PIPE,
                                  text=True)
        assert camera.stdout.readline() == 'ready\n'
    try:
        steps, by_thread, counts, words = run_view(daemon, folder, case)
    finally:
        if camera:
            camera.terminate()
            camera.communicate()
    markers = re.search(r'^markers: (\d+) poses from (\d+) pictures, ([\d.]+) ms', words, re.M)
    copies = counts['copied_bytes'] / counts['read_bytes']
    median, mean = statistics.median(steps), statistics.fmean(steps)
    print('| %s %s | %s | %s, %d Hz | %.2f | %.2f | %.2f | %s | %.2f | %.2f |' % (
        kind, pixel_format, way, shots, rate, median, mean, statistics.quantiles(steps, n=20)[-1],
        ', '.join('%s %.2f' % item for item in by_thread.items() if item[1] >= 0.01),
        float(markers.group(3)), copies), flush=True)
    has_pose = int(markers.group(1)) > 0.9 * int(markers.group(2))
    return copies <= 1 and (median < LIMIT_MS and has_pose if shots == 'one' else mean < LIMIT_MS)


def main():
    own_network.enter()
    room = Room(scene=json.dumps(SCENE))
    with tempfile.TemporaryDirectory(prefix='gnomon-live-cost.') as folder, \
            Daemon(rooms=room) as daemon:
        makers = []
        for name, *what in SHOTS:
            os.mkdir(os.path.join(folder, name))
            makers.append(subprocess.Popen([MAKE_SHOTS, os.path.join(folder, name), *what]))
        assert not any([maker.wait() for maker in makers])
        light = os.path.join(folder, 'light.exr')
        with open(light, 'wb') as out:
            out.write(exr_bytes(32, 16, (1, 1, 1)))
        subprocess.run([GNOMON, 'probe', '--server=%s:%d' % daemon.address, '--files', light],
                       check=True, stdout=subprocess.DEVNULL)
        print('| camera | received by | markers | ms a picture, median | mean | 95 % below | of it by '
              'thread (medians) | of it tracking (mean) | copies |\n'
              '| --- | --- | --- | ---: | ---: | ---: | --- | ---: | ---: |')
        is_good = [measure(daemon, folder, case) for case in CASES]
    sys.exit(not all(is_good))


main()
