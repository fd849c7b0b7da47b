# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""GigE Vision cameras on loopback: Aravis' own fake and one of ours, read by the client's source
and by gnomon probe and view, against a real gnomond.

usage: gige.py GNOMOND DIRECTORY_OF_GNOMON_PB2 GNOMON FAKE_GIGE GIGE_TOOL
"""
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, sys.argv[2])
import own_network  # noqa: E402
from folder import Folder  # noqa: E402
from gnomond import Daemon, run_tests  # noqa: E402
from pictures import exr_bytes, png_bytes, read_png  # noqa: E402

GNOMON, FAKE, TOOL = sys.argv[3:6]
WIDTH, HEIGHT = 128, 96
SETUP = {'projection': 'fisheye-equidistant', 'response': {'type': 'log', 'a': 0.6, 'b': 0.045,
                                                           'c': 0.0001}}
CAMERA = {'width': WIDTH, 'height': HEIGHT, 'fx': WIDTH / 2, 'fy': WIDTH / 2, 'cx': WIDTH / 2,
          'cy': HEIGHT / 2, 'distortion': [0, 0, 0, 0, 0],
          'world_from_camera': [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 2, 0, 0, 0, 1]}


class Camera:
    """A running camera, found at 127.0.0.1."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen([FAKE, *arguments], stdout=subprocess.PIPE, text=True)
        self.ready_s = None
        assert self.process.stdout.readline() == 'ready\n', 'the camera does not start'
        self.ready_s = time.monotonic()

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.terminate()
            self.process.wait()
            self.process.stdout.close()


class Program:
    """A running program whose lines are read as they come."""

    def __init__(self, *command):
        self.err = tempfile.TemporaryFile('w+')
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self.err, text=True)

    def wait_for(self, pattern, timeout=30):
        """Reads on until a line has the pattern."""
        deadline = time.monotonic() + timeout
        for line in self.process.stdout:
            if re.search(pattern, line):
                return line
            assert time.monotonic() < deadline, 'never said %r' % pattern
        raise AssertionError('ended without %r: %s' % (pattern, self.read_err()))

    def read_err(self):
        return os.pread(self.err.fileno(), 1 << 20, 0).decode()

    def interrupt(self):
        """As Ctrl-C; it must end well. Returns what it still said."""
        self.process.send_signal(signal.SIGINT)
        return self.end()

    def end(self, status=0, timeout=60):
        out, _ = self.process.communicate(timeout=timeout)
        err = self.read_err()
        self.err.close()
        assert self.process.returncode == status, (self.process.returncode, out[-2000:], err)
        return out, err


class Given(Folder):
    def __init__(self):
        super().__init__()
        self.write('setup.json', json.dumps(SETUP).encode())
        self.write('camera.json', json.dumps(CAMERA).encode())


def size(width=WIDTH, height=HEIGHT):
    return ['--width', str(width), '--height', str(height)]


def read_pictures(who, name, n, depth='deep', width=WIDTH, height=HEIGHT, rate=100, before=()):
    """n pictures held to the pattern, to the bit."""
    done = subprocess.run([*before, TOOL, who, name, str(width), str(height), str(rate), str(n),
                           depth], stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=90,
                          text=True)
    assert done.returncode == 0, (name, done.stdout[-500:], done.stderr)
    got = json.loads(done.stdout.splitlines()[-1])
    assert got['pictures'] == n, (name, got, done.stderr)
    assert got['wrong'] == 0 and got['unordered'] == 0, (name, got, done.stderr)
    # Taken before they were read, and not long before.
    assert 0 <= got['age_ms'][0] and got['age_ms'][2] < 3000, got
    return got


def server(daemon):
    return '--server=%s:%d' % daemon.address


def probe(daemon, folder, *more, who='127.0.0.1'):
    return Program(GNOMON, 'probe', server(daemon), '--gige', who, '--setup',
                   folder.at('setup.json'), *more)


def test_formats():
    """Every way of packing, from our camera, to the bit, with at most one copy."""
    with Camera(*size()):
        for name, depth, copies in (
                ('Mono8', 'deep', 1), ('Mono10', 'deep', 1), ('Mono10p', 'deep', 1),
                ('Mono10Packed', 'deep', 1), ('Mono12', 'deep', 0), ('Mono12p', 'deep', 1),
                ('Mono12Packed', 'deep', 1), ('Mono12', '8', 1), ('Mono14', 'deep', 1),
                ('Mono16', 'deep', 0), ('BayerRG8', '8', 1), ('BayerRG12p', 'deep', 1),
                ('RGB8', '8', 0), ('BGR8', '8', 1), ('RGB12', 'deep', 0)):
            got = read_pictures('127.0.0.1', name, 3, depth)
            assert got['copies'] == copies, (name, got)


def test_stock():
    """Aravis' own camera, found by search; gnomon doctor lists it."""
    with Camera('--stock', '--serial', 'ST7'), Daemon() as daemon:
        for who, name in (('any', 'Mono12'), ('ST7', 'RGB8')):
            read_pictures(who, name, 3)
        out, _ = Program(GNOMON, 'doctor', server(daemon)).end()
        assert re.search(r'^ok +gige +yes +Aravis-Fake-ST7: .*at 127\.0\.0\.1$', out, re.M), out
        out, err = Program(GNOMON, 'probe', server(daemon), '--gige', 'ST8').end(1)
        assert 'no such camera; there are: Aravis-Fake-ST7' in err and err.count('\n') == 1, err


def get_socket_limit():
    """Largest receive buffer of a socket, bytes. Kernels before 6.9 do not show it in networks of
    one's own; None then."""
    try:
        with open('/proc/sys/net/core/rmem_max') as f:
            return int(f.read())
    except FileNotFoundError:
        return None


def test_ordinary_user():
    """Without the right to raw sockets: the socket's buffer must hold a picture's packets."""
    drop = own_network.NO_RIGHTS
    nobody = drop + ['--reuid', '65534', '--regid', '65534', '--clear-groups']
    if subprocess.run(nobody + ['test', '-x', TOOL], stderr=subprocess.DEVNULL).returncode == 0:
        drop = nobody
    with Camera(*size(640, 480)):
        got = read_pictures('127.0.0.1', 'Mono12', 30, width=640, height=480, rate=30, before=drop)
    if (get_socket_limit() or 0) >= 1 << 20:
        # With the buffer that sockets have by themselves three of four are incomplete.
        assert got['incomplete'] <= 6, got


def test_loss():
    """What is lost is asked for again; where it never comes the picture is counted, not sent."""
    with Camera(*size(640, 480), '--loss', '0.01'):
        got = read_pictures('127.0.0.1', 'Mono12p', 30, width=640, height=480, rate=30)
    assert got['resent'] > 30 and got['complete'] > got['incomplete'], got
    with Camera(*size(640, 480), '--loss', '0.002', '--no-resend'):
        got = read_pictures('127.0.0.1', 'Mono12', 10, width=640, height=480, rate=30)
    assert got['incomplete'] > 0 and got['lost_packets'] > 0 and got['resent'] == 0, got
    with Camera(*size(), '--fault', 'drop'):  # every fifth picture never leaves
        got = read_pictures('127.0.0.1', 'Mono12', 20)
    assert got['lost'] >= 3, got


def test_times():
    """A picture's time is when it was taken, by the camera's stamp, however late it left."""
    for more in ([], ['--chunks']):
        with Camera(*size(), '--delay-ms', '12', *more):
            got = read_pictures('127.0.0.1', 'Mono12', 40, rate=50)
        # By their arrival they would be some ms off the camera's beat.
        assert got['off_ms'] < 0.3, (more, got)
        # The middle of the exposure, 10 ms, which ended before the first packet left.
        assert got['age_ms'][0] >= 5, (more, got)
    with Camera(*size(), '--chunks', '--fault', 'exposure'):  # no picture is before the one before
        read_pictures('127.0.0.1', 'Mono12', 20)


def test_restart():
    """The camera is killed and comes back: pictures within 2 s, and nobody else notices."""
    with Daemon() as daemon, Given() as folder, Camera(*size()) as camera:
        lamp = probe(daemon, folder, '--frame-rate', '25')
        lamp.wait_for('environment frame 5:')
        os.mkdir(folder.at('shots'))
        folder.write('shots/a.png', png_bytes(WIDTH, HEIGHT, bytes(3 * WIDTH * HEIGHT)))
        viewer = Program(GNOMON, 'view', server(daemon), '--files', folder.at('shots'), '--camera',
                         folder.at('camera.json'), '--out', folder.at('out'), '--loop', '--rate',
                         '10')
        viewer.wait_for('^frame 3:')
        camera.kill()
        time.sleep(1)
        while 'lost' not in lamp.read_err():
            time.sleep(0.02)
        viewer.wait_for('^frame 10:')
        with Camera(*size()) as again:
            # All that was printed before is read; the next line is of a picture that came now.
            os.set_blocking(lamp.process.stdout.fileno(), False)
            while lamp.process.stdout.readline():
                pass
            os.set_blocking(lamp.process.stdout.fileno(), True)
            lamp.wait_for('environment frame')
            gap_s = time.monotonic() - again.ready_s
            assert gap_s < 2, 'pictures came %.2f s after the camera' % gap_s
            lamp.wait_for('environment frame')
            out, err = lamp.interrupt()
        assert re.search('opened again [1-9]', out), out
        # Each is said once; a machine that stood still for seconds may have lost it more often.
        lines = err.splitlines()
        assert len(lines) % 2 == 0 and all(': lost: ' in line for line in lines[::2]), err
        assert all(line.endswith(': back') for line in lines[1::2]), err
        _, err = viewer.interrupt()
        assert err == '', err
        with open(folder.at('out/view.json')) as f:
            report = json.load(f)
        assert report['dropped'] == 0 and report['results'] >= 10 and daemon.is_alive()


def test_view():
    """A camera's pictures as camera frames: composites of the camera's pixels."""
    with Daemon() as daemon, Given() as folder:
        folder.write('a.png', png_bytes(WIDTH, HEIGHT, bytes([16, 160, 80]) * WIDTH * HEIGHT))
        subprocess.run([GNOMON, 'probe', server(daemon), '--files',
                        folder.write('light.exr', exr_bytes(32, 16, (1, 1, 1)))], check=True,
                       stdout=subprocess.DEVNULL)
        with Camera(*size(), '--files', folder.at('*.png')):
            out, _ = Program(GNOMON, 'view', server(daemon), '--gige', '127.0.0.1', '--camera',
                             folder.at('camera.json'), '--out', folder.at('out'),
                             '--pixel-format', 'BayerRG12p', '--frame-rate', '25', '--count',
                             '8').end()
        assert '8 frames sent, 8 results' in out and 'camera: ' in out, out
        with open(folder.at('out/view.json')) as f:
            report = json.load(f)
        capture = report['capture']
        assert capture['read'] >= 8 and capture['copied_bytes'] == capture['read_bytes'], capture
        assert capture['read_bytes'] == capture['read'] * 3 * WIDTH * HEIGHT, capture
        width, height, data = read_png(folder.at('out/000001.png'))
        assert (width, height) == (WIDTH, HEIGHT)
        assert data[:3] == bytes([16, 160, 80]), data[:3]  # beyond the floor: as it came


def test_controller():
    """A dead client's hold is waited for; a living one's is told."""
    with Camera(*size()):
        first = Program(TOOL, '127.0.0.1', 'Mono12', str(WIDTH), str(HEIGHT), '50', '1000000',
                        'deep')
        first.wait_for('^5 ')
        done = subprocess.run([TOOL, '127.0.0.1', 'Mono12', '0', '0', '0', '1', 'deep'],
                              stderr=subprocess.PIPE, text=True, timeout=60)
        assert done.returncode == 1 and 'another program controls it' in done.stderr, done
        first.process.kill()
        first.process.wait()
        first.process.stdout.close()
        read_pictures('127.0.0.1', 'Mono12', 3)


def wait_for_error(program, words, timeout=30):
    deadline = time.monotonic() + timeout
    while words not in program.read_err():
        assert program.process.poll() is None and time.monotonic() < deadline, program.read_err()
        time.sleep(0.02)


def test_triggers():
    """A camera that waits for triggers is not lost between them; it is when it restarts."""
    trigger = ['--trigger-ms', '500']  # 12 frame times
    with Daemon() as daemon, Given() as folder, Camera(*size(), *trigger) as camera:
        lamp = probe(daemon, folder, '--frame-rate', '25', '--controls', 'TriggerMode=On')
        lamp.wait_for('environment frame 4:')
        assert lamp.read_err() == ''
        camera.kill()
        with Camera(*size(), *trigger):
            wait_for_error(lamp, ': back')
            lamp.wait_for('environment frame [5-9]:')
            out, err = lamp.interrupt()
        assert re.match('.*: lost: .* restarted or answers no more.*\n.*: back\n$', err), err
        # Its triggers are on again: at its frame rate it would have sent a dozen by now.
        assert int(re.search(r'(\d+) environment frames sent', out).group(1)) < 10, out


def test_silence():
    """A camera that answers while its packets do not arrive: said once, with what to look for; and
    one whose exposures grow by themselves: not lost."""
    with Daemon() as daemon, Given() as folder:
        with Camera(*size(), '--fault', 'silent'):
            lamp = probe(daemon, folder, '--frame-rate', '25')
            wait_for_error(lamp, 'not a packet of one, though it answers')
        with Camera(*size()):
            lamp.wait_for('environment frame 1:')
            _, err = lamp.interrupt()
        assert ': back\n' in err and err.count('not a packet') == 1, err
        with Camera(*size(), '--fault', 'dim'):
            lamp = probe(daemon, folder, '--frame-rate', '20', '--count', '24')
            assert lamp.end()[1] == ''
        with Camera(*size()):  # slower than --frame-rate by what has the last word
            lamp = probe(daemon, folder, '--frame-rate', '50', '--controls',
                         'AcquisitionFrameRate=3', '--count', '4')
            assert lamp.end()[1] == ''


def find_thread(process, name):
    """The id of its thread of that name."""
    for thread in os.listdir('/proc/%d/task' % process.pid):
        with open('/proc/%d/task/%s/comm' % (process.pid, thread)) as f:
            if f.read() == name + '\n':
                return int(thread)
    raise AssertionError('no thread ' + name)


def test_overload():
    """A client that does not run, or whose packets are not read, for longer than the camera may be
    silent, does not take it for lost."""
    rate = 10
    patience_s = 5 / rate
    with Camera(*size()):
        tool = Program(TOOL, '127.0.0.1', 'Mono12', str(WIDTH), str(HEIGHT), str(rate), '30', 'deep')
        tool.wait_for('^4 ')
        cpu = min(os.sched_getaffinity(0))
        receiver = find_thread(tool.process, 'arv_gv_stream')
        os.sched_setaffinity(receiver, {cpu})
        os.sched_setscheduler(receiver, os.SCHED_IDLE, os.sched_param(0))
        busy = []
        try:
            for _ in range(3):
                busy.append(subprocess.Popen(['taskset', '-c', str(cpu), 'sh', '-c', 'while :; do :; done']))
            time.sleep(3 * patience_s)
        finally:
            for process in busy:
                process.kill()
                process.wait()
        tool.process.send_signal(signal.SIGSTOP)
        time.sleep(2 * patience_s)
        tool.process.send_signal(signal.SIGCONT)
        out, err = tool.end()
    assert err == '' and json.loads(out.splitlines()[-1])['reopened'] == 0, (out[-500:], err)


def test_packet_size():
    """Packets that are too large for the network become smaller ones."""
    with Daemon() as daemon, Given() as folder, Camera(*size(), '--max-packet', '1500'):
        out, err = probe(daemon, folder, '--controls', 'GevSCPSPacketSize=9000', '--frame-rate',
                         '50', '--count', '5').end()
        assert ' 0 incomplete' in out and err == '', (out, err)


def test_hostile_places():
    """A description outside the camera, or endless; an address that is not its own."""
    with Daemon() as daemon, Given() as folder:
        for url in ('file:///etc/passwd', 'http://127.0.0.1/x.xml', 'local:x.xml;0;fffffffff',
                    'local:x;0;1.xml;0;fffffffff', 'local:x.xml'):
            with Camera(*size(), '--description', url):
                _, err = probe(daemon, folder).end(1)
                assert "'%s'" % url in err and err.count('\n') == 1, err
        with Camera(*size(), '--said-address', '10.77.77.77'):
            _, err = probe(daemon, folder, who='any').end(1)
            assert 'its address 10.77.77.77 cannot be reached' in err, err


def count_lies(daemon, folder, fault, seconds):
    """How many of the camera's pictures were whole, and refused, while a probe read it; none of
    those was sent."""
    before = daemon.read_log().count(' as probe')
    lamp = probe(daemon, folder, '--frame-rate', '50')
    while daemon.read_log().count(' as probe') == before:
        assert lamp.process.poll() is None, lamp.read_err()
        time.sleep(0.02)
    time.sleep(seconds)
    out, err = lamp.interrupt()
    n_whole, n_incomplete = map(int, re.search(r'camera: (\d+) whole pictures, (\d+) incomplete',
                                               out).groups())
    assert int(re.search(r'^(\d+) environment frames sent', out, re.M).group(1)) <= n_whole, out
    n_told = err.count('its pictures are no longer %dx%d' % (WIDTH, HEIGHT))
    assert n_told == (fault != 'truncated') or not n_incomplete, (fault, err)
    return n_whole, n_incomplete


def test_hostile():
    """Cameras that lie: no picture of theirs is given out; the daemon sees nothing of it."""
    with Daemon() as daemon, Given() as folder:
        for fault in ('size', 'format', 'truncated', 'overlong', 'change'):
            with Camera(*size(), '--fault', fault):
                n_before_lies = 0
                for seconds in (0.7, 5, 20):  # the machine may be busy
                    n_whole, n_incomplete = count_lies(daemon, folder, fault, seconds)
                    n_before_lies += n_whole
                    if n_incomplete > 3:
                        break
                assert n_incomplete > 3, (fault, n_incomplete)
                assert n_before_lies in (range(1, 21) if fault == 'change' else [0]), n_before_lies
        for fault, word in (('codes', 'codes above those of Mono12'), ('huge', 'cannot')):
            with Camera(*size(), '--fault', fault):
                _, err = probe(daemon, folder, '--pixel-format', 'Mono12').end(1)
                assert word in err and err.count('\n') == 1, (fault, err)
        assert daemon.is_alive()


def test_settings():
    """What a camera cannot do is refused by name; without a camera it is said."""
    with Daemon() as daemon, Given() as folder:
        with Camera(*size()):
            for option, words in (('--pixel-format=Fancy', ['--pixel-format', 'Fancy']),
                                  ('--controls=GainRaw=1,Nope=2', ['--controls Nope=2']),
                                  ('--controls=GainRaw', ['NAME=VALUE']),
                                  ('--lock-white-balance', ['BalanceWhiteAuto']),
                                  ('--frame-size=9000x9000', ['9000x9000'])):
                _, err = probe(daemon, folder, option).end(1)
                assert err.count('\n') == 1 and all(word in err for word in words), err
            out, _ = probe(daemon, folder, '--controls', 'Height=48,Width=64', '--exposure-us',
                           '5000', '--gain', '2', '--frame-rate', '50', '--count', '3').end()
            assert '64x48' in out and '3 environment frames sent' in out, out
        _, err = probe(daemon, folder).end(1)
        assert 'no GigE Vision camera answers at this address' in err, err
        _, err = probe(daemon, folder, who='any').end(1)
        assert 'no GigE Vision camera answers in the networks' in err, err


own_network.enter()
run_tests([test_formats, test_stock, test_ordinary_user, test_loss, test_times, test_restart,
           test_view, test_controller, test_triggers, test_silence, test_overload, test_packet_size,
           test_hostile_places, test_hostile, test_settings])
