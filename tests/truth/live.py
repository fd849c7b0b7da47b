# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""No file between: two GigE Vision cameras that show what the rig's devices deliver, a daemon, and
composites judged against the rig's truth. TAP on stdout.

usage: live.py GNOMON_RIG GNOMOND GNOMON FAKE_GIGE WORK_FOLDER

One camera is the fisheye and sends 12-bit log codes, the other looks at the table, and the marker
there says from where. Twice: as who
runs the tests, and without any right (packets then come through ordinary sockets). In the middle the
fisheye is killed and comes back: environment frames flow again within 2 s, and neither the viewer
nor the daemon notices. The last composite must be as near to the truth as the limits of truth.py
ask of files.
"""
import glob
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
import own_network  # noqa: E402

LIMIT = 2.0  # 8-bit codes, mean absolute
SHARE = 0.2  # of the untouched frame's error
WIDTH, HEIGHT = 320, 240
MARKER = '4x4_50:0:0.08'  # printed on the rig's table, at the world's origin
RIG, GNOMOND, GNOMON, FAKE, WORK = sys.argv[1:6]


def write_light(path):
    """A room's light as Radiance file: gray walls, a dark floor, a bright window."""
    with open(path, 'wb') as out:
        out.write(b'#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 32 +X 64\n')
        for y in range(32):
            for x in range(64):
                is_window = 6 <= y < 10 and 20 <= x < 26
                out.write(bytes((255, 240, 220, 133) if is_window else
                                (60, 60, 66, 128) if y < 16 else (40, 36, 32, 128)))


def load(path):
    with open(path, encoding='utf-8') as f:
        return json.load(f)


def save(path, value):
    with open(path, 'w', encoding='utf-8') as f:
        json.dump(value, f)
    return path


class Program:
    """A running program; its output goes to a file."""

    def __init__(self, folder, name, *command):
        self.path = os.path.join(folder, name + '.log')
        self.log = open(self.path, 'w')
        self.process = subprocess.Popen(command, stdout=self.log, stderr=self.log)

    def read(self):
        with open(self.path, encoding='utf-8') as f:
            return f.read()

    def wait_for(self, pattern, count=1, timeout=60):
        deadline = time.monotonic() + timeout
        while len(re.findall(pattern, self.read(), re.M)) < count:
            assert self.process.poll() is None, 'it ended: ' + self.read()
            assert time.monotonic() < deadline, '%r not %d times: %s' % (pattern, count,
                                                                        self.read()[-2000:])
            time.sleep(0.01)

    def count(self, pattern):
        return len(re.findall(pattern, self.read(), re.M))

    def end(self, number=signal.SIGINT):
        if self.process.poll() is None:
            self.process.send_signal(number)
        status = self.process.wait(60)
        self.log.close()
        return status


class Stage:
    """Everything that runs; ended whatever happens."""

    def __init__(self, folder, sequence):
        self.folder, self.sequence, self.running = folder, sequence, []

    def start(self, name, *command):
        program = Program(self.folder, name, *command)
        self.running.append(program)
        return program

    def start_camera(self, name, address, picture, width, height):
        camera = self.start(name, FAKE, '--address', address, '--files',
                            os.path.join(self.sequence, picture), '--width', str(width),
                            '--height', str(height))
        camera.wait_for('^ready')
        return camera

    def end(self):
        for program in reversed(self.running):
            if program.process.poll() is None:
                program.process.kill()
                program.process.wait()


def play(stage, before):
    """The main job with both cameras; returns the folder of composites."""
    folder, root = stage.folder, load(os.path.join(stage.sequence, 'sequence.json'))
    frame, probe = root['frames'][-1], root['environment']
    setup = save(os.path.join(folder, 'setup.json'), probe)
    camera = save(os.path.join(folder, 'camera.json'),
                  root['camera'])  # where it is, the marker says
    config = os.path.join(folder, 'gnomond.conf')
    with open(config, 'w', encoding='utf-8') as f:
        f.write('[room demo]\nscene = %s\n' % os.path.join(stage.sequence, root['scene']))
    ready = os.path.join(folder, 'ready')
    daemon = stage.start('gnomond', GNOMOND, '--config', config, '--listen', '127.0.0.1:0', '--http',
                         '127.0.0.1:0', '--ready-file', ready)
    deadline = time.monotonic() + 60
    while not os.path.exists(ready):
        assert daemon.process.poll() is None and time.monotonic() < deadline, daemon.read()
        time.sleep(0.01)
    server = '--server=' + re.search('^listen=(.*)$', open(ready).read(), re.M).group(1)
    sky = (frame['environment'], probe['width'], probe['height'])
    eye = stage.start_camera('sky', '127.0.0.1', *sky)
    stage.start_camera('table', '127.0.0.2', frame['picture'], WIDTH, HEIGHT)
    out = os.path.join(folder, 'out')
    lamp = stage.start('probe', *before, GNOMON, 'probe', server, '--gige', '127.0.0.1', '--setup',
                       setup, '--pixel-format', 'RGB12', '--frame-rate', '10')
    lamp.wait_for('^environment frame 3:')
    viewer = stage.start('view', *before, GNOMON, 'view', server, '--gige', '127.0.0.2', '--camera',
                         camera, '--marker', MARKER, '--out', out, '--pixel-format', 'RGB8',
                         '--frame-rate', '10')
    viewer.wait_for('^frame 5:')

    eye.end(signal.SIGKILL)
    lamp.wait_for('camera 127.0.0.1: lost')
    n_seen = viewer.count('^frame ')
    viewer.wait_for('^frame ', n_seen + 3)
    n_sent = lamp.count('^environment frame ')
    stage.start_camera('sky-again', '127.0.0.1', *sky)
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
    report = load(os.path.join(out, 'view.json'))
    latencies = sorted(f['latency_ms'] for f in report['frames'])
    ages = sorted(f['receipt']['lighting_age_ms'] for f in report['frames'])
    print('# %d composites, %.1f ms each (median), of light %.0f ms old (median), %s incomplete' %
          (len(latencies), latencies[len(latencies) // 2], ages[len(ages) // 2],
           report['capture']['incomplete']))
    return out


def judge(stage, out):
    """What is wrong with the last composite, against the truth of its one frame."""
    root = load(os.path.join(stage.sequence, 'sequence.json'))
    frame = root['frames'][-1]
    judged = os.path.join(stage.folder, 'judged')
    os.mkdir(judged)
    for name in os.listdir(stage.sequence):
        os.symlink(os.path.join(stage.sequence, name), os.path.join(judged, name))
    os.unlink(os.path.join(judged, 'sequence.json'))
    save(os.path.join(judged, 'sequence.json'), dict(root, frames=[frame]))
    composites = os.path.join(stage.folder, 'composites')
    os.mkdir(composites)
    shutil.copy(sorted(glob.glob(os.path.join(out, '*.png')))[-1],
                os.path.join(composites, os.path.basename(frame['picture'])))
    report = os.path.join(stage.folder, 'judged.json')
    done = subprocess.run([RIG, 'judge', '--report', report, judged, composites],
                          capture_output=True, text=True, check=True)
    print('\n'.join('# ' + line for line in done.stdout.split('\n') if line))
    for part in ('object', 'shadow'):
        error = load(report)['frames'][0][part]
        if error['pixels'] < 100:
            yield '%s: only %d pixels' % (part, error['pixels'])
        if error['composite'] > LIMIT or error['composite'] > SHARE * error['untouched']:
            yield '%s: %.2f/255, untouched %.2f' % (part, error['composite'], error['untouched'])


def main():
    own_network.enter()
    os.makedirs(WORK, exist_ok=True)
    light = os.path.join(WORK, 'live.hdr')
    write_light(light)
    sequence = os.path.join(WORK, 'live')
    subprocess.run([RIG, 'make', '--light', light, '--probe', 'fisheye', '--width', str(WIDTH),
                    '--height', str(HEIGHT), '--frames-per-light', '1', '--paths', '8',
                    '--direct-paths', '128', '--bounces', '0', sequence], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    cases = [('as who runs this', []), ('without raw sockets', own_network.NO_RIGHTS)]
    print('1..%d' % len(cases))
    for n, (name, before) in enumerate(cases, 1):
        folder = tempfile.mkdtemp(prefix='gnomon-live-test.')
        stage = Stage(folder, os.path.abspath(sequence))
        found = []
        try:
            found += judge(stage, play(stage, before))
        except AssertionError as fault:
            found.append(str(fault) or 'an assertion failed')
        finally:
            stage.end()
            shutil.rmtree(folder)
        for problem in found:
            print('# ' + problem.replace('\n', '\n# '))
        print('%s %d - %s' % ('not ok' if found else 'ok', n, name))


main()
