# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""What the runs from cameras to composites share: the rig's room, the programs, the judge."""
import fcntl
import glob
import json
import os
import re
import shutil
import signal
import subprocess
import time

from folder import make_folder

LIMIT = 2.0  # 8-bit codes, mean absolute
SHARE = 0.2  # of the untouched frame's error
WIDTH, HEIGHT = 320, 240
MARKER = '4x4_50:0:0.08'  # printed on the rig's table, at the world's origin


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


def make_sequence(rig, work):
    """The rig's sequence of the table, with its truth; returns its folder."""
    os.makedirs(work, exist_ok=True)
    light = os.path.join(work, 'live.hdr')
    sequence = os.path.join(work, 'live')
    with open(os.path.join(work, 'lock'), 'w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        write_light(light)
        subprocess.run([rig, 'make', '--light', light, '--probe', 'fisheye', '--width', str(WIDTH),
                        '--height', str(HEIGHT), '--frames-per-light', '1', '--paths', '8',
                        '--direct-paths', '128', '--bounces', '0', sequence], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return os.path.abspath(sequence)


class Stage:
    """Everything that runs, in a folder of its own; ended whatever happens."""

    def __init__(self, rig, gnomond, gnomon, fake_gige, sequence):
        self.rig, self.gnomond, self.gnomon, self.fake_gige = rig, gnomond, gnomon, fake_gige
        self.sequence, self.running = sequence, []
        self.folder = make_folder('stage')
        self.root = load(os.path.join(sequence, 'sequence.json'))
        self.frame, self.probe = self.root['frames'][-1], self.root['environment']
        self.setup = save(os.path.join(self.folder, 'setup.json'), self.probe)
        # Where it is, the marker says.
        self.camera = save(os.path.join(self.folder, 'camera.json'), self.root['camera'])

    def start(self, name, *command):
        program = Program(self.folder, name, *command)
        self.running.append(program)
        return program

    def start_camera(self, name, address, picture, width, height):
        camera = self.start(name, self.fake_gige, '--address', address, '--files',
                            os.path.join(self.sequence, picture), '--width', str(width),
                            '--height', str(height))
        camera.wait_for('^ready')
        return camera

    def start_sky(self, name):
        """The fisheye, which sends 12-bit log codes."""
        return self.start_camera(name, '127.0.0.1', self.frame['environment'],
                                 self.probe['width'], self.probe['height'])

    def start_daemon(self):
        """Returns it, and its address."""
        config = os.path.join(self.folder, 'gnomond.conf')
        with open(config, 'w', encoding='utf-8') as f:
            f.write('[room demo]\nscene = %s\n' % os.path.join(self.sequence, self.root['scene']))
        ready = os.path.join(self.folder, 'ready')
        daemon = self.start('gnomond', self.gnomond, '--config', config, '--listen', '127.0.0.1:0',
                            '--http', '127.0.0.1:0', '--ready-file', ready)
        deadline = time.monotonic() + 60
        while not os.path.exists(ready):
            assert daemon.process.poll() is None and time.monotonic() < deadline, daemon.read()
            time.sleep(0.01)
        return daemon, re.search('^listen=(.*)$', open(ready).read(), re.M).group(1)

    def start_probe(self, address, before, rate):
        """before: what the command is run by. It has sent light when this returns."""
        lamp = self.start('probe', *before, self.gnomon, 'probe', '--server', address, '--gige',
                          '127.0.0.1', '--setup', self.setup, '--pixel-format', 'RGB12',
                          '--frame-rate', str(rate))
        lamp.wait_for('^environment frame 3:')
        return lamp

    def end(self):
        for program in reversed(self.running):
            if program.process.poll() is None:
                program.process.kill()
                program.process.wait()


def judge(stage, out):
    """What is wrong with the last composite, against the truth of its one frame."""
    frame = stage.frame
    judged = os.path.join(stage.folder, 'judged')
    os.mkdir(judged)
    for name in os.listdir(stage.sequence):
        os.symlink(os.path.join(stage.sequence, name), os.path.join(judged, name))
    os.unlink(os.path.join(judged, 'sequence.json'))
    save(os.path.join(judged, 'sequence.json'), dict(stage.root, frames=[frame]))
    composites = os.path.join(stage.folder, 'composites')
    os.mkdir(composites)
    shutil.copy(sorted(glob.glob(os.path.join(out, '*.png')))[-1],
                os.path.join(composites, os.path.basename(frame['picture'])))
    report = os.path.join(stage.folder, 'judged.json')
    done = subprocess.run([stage.rig, 'judge', '--report', report, judged, composites],
                          capture_output=True, text=True, check=True)
    print('\n'.join('# ' + line for line in done.stdout.split('\n') if line))
    for part in ('object', 'shadow'):
        error = load(report)['frames'][0][part]
        if error['pixels'] < 100:
            yield '%s: only %d pixels' % (part, error['pixels'])
        if error['composite'] > LIMIT or error['composite'] > SHARE * error['untouched']:
            yield '%s: %.2f/255, untouched %.2f' % (part, error['composite'], error['untouched'])


def describe(report):
    """What a viewer's report says of its composites, in a line."""
    latencies = sorted(f['latency_ms'] for f in report['frames'])
    ages = sorted(f['receipt']['lighting_age_ms'] for f in report['frames'])
    return '%d composites, %.1f ms each (median), of light %.0f ms old (median), %s incomplete' % (
        len(latencies), latencies[len(latencies) // 2], ages[len(ages) // 2],
        report['capture']['incomplete'])
