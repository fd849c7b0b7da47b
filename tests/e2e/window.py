# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""gnomon view --window on a virtual screen: real keys, and the screen's own pixels.

usage: window.py GNOMOND DIRECTORY_OF_GNOMON_PB2 GNOMON
"""
import json
import os
import re
import shutil
import signal
import subprocess
import sys

sys.path.insert(0, sys.argv[2])
from gnomond import light_up, probe, run_tests  # noqa: E402
from pictures import read_png  # noqa: E402
from window_stage import (BESIDE_CUBE, ENVIRONMENT, GNOMON, HEIGHT, ON_CUBE, SHOT, UPPER, WIDTH,  # noqa: E402
                          Screen, View, Watch, enlarge, find_differences, lit, pixel, wait_for)


def test_picture_and_toggles():
    """What the screen shows is what came, to the bit; s and v change it as they say."""
    with lit() as daemon, probe(daemon) as light, Screen() as screen:
        light_up(light)
        with View(daemon.address, '--out', 'out', '--loop', '--rate', '10', screen=screen) as view:
            assert view.get_box()[2:] == (2 * WIDTH, 2 * HEIGHT), view.get_box()
            wait_for('the enlarged composite', lambda: os.path.exists(view.at('out/shot.png')) and
                     view.see()[2] == enlarge(read_png(view.at('out/shot.png'))[2], 2))
            watch = Watch(view)
            whole = watch.wait_composite()
            assert pixel(whole, ON_CUBE) != pixel(SHOT, ON_CUBE)
            assert pixel(whole, BESIDE_CUBE) != pixel(SHOT, BESIDE_CUBE)

            view.press('s')  # the cube alone
            watch.wait('no shadow', lambda d: pixel(d, BESIDE_CUBE) == pixel(SHOT, BESIDE_CUBE) and
                       pixel(d, ON_CUBE) == pixel(whole, ON_CUBE))
            view.press('v')  # nothing
            watch.wait('the camera\'s picture', lambda d: d[:UPPER] == SHOT[:UPPER])
            view.press('s')  # the shadow alone, where the cube stands too
            watch.wait('a shadow without a cube', lambda d:
                       pixel(d, BESIDE_CUBE) == pixel(whole, BESIDE_CUBE) and
                       pixel(d, ON_CUBE) != pixel(whole, ON_CUBE) and
                       max(pixel(d, ON_CUBE)) < max(pixel(SHOT, ON_CUBE)))
            view.press('v')
            watch.wait('all as before', lambda d: d[:UPPER] == whole[:UPPER])
            view.press('q')
            status, out, err = view.end()
            assert (status, err) == (0, ''), (status, err)
            assert 'frames sent' in out and '; in out\n' in out, out[-300:]


def test_overlays():
    """Figures, plan, light and keys stay inside a small window and leave nothing behind."""
    with lit() as daemon, probe(daemon) as light, Screen() as screen:
        light_up(light)
        with View(daemon.address, '--out', 'out', '--loop', '--rate', '10', screen=screen) as view:
            watch = Watch(view)
            whole = watch.wait_composite()

            def wait_box(key, what, claim):
                """Presses the key and waits for the box of what has changed."""
                view.press(key)
                data = watch.wait(what, lambda d: find_differences(d, whole, WIDTH) and
                                  claim(*find_differences(d, whole, WIDTH)))
                x0, y0, x1, y1 = find_differences(data, whole, WIDTH)
                assert 6 <= x0 and 6 <= y0 and x1 <= WIDTH - 6 and y1 <= HEIGHT - 6, (x0, y0, x1, y1)
                changed = [pixel(data, (x, y)) for y in range(y0, y1) for x in range(x0, x1)]
                bright = sum(min(p) >= 240 for p in changed)
                assert 100 < bright < len(changed) / 3, (what, bright, len(changed))

            wait_box('o', 'figures', lambda x0, y0, x1, y1: (x0, y0) == (6, 6) and y1 > 80)
            wait_box('o', 'the plan', lambda x0, y0, x1, y1: (x0, y0) == (6, 6) and y1 > 80)
            view.press('o')
            watch.wait('no page', lambda d: d == whole)
            wait_box('l', 'the light', lambda x0, y0, x1, y1: x0 > WIDTH / 2 and y0 > HEIGHT / 2 and
                     (x1, y1) == (WIDTH - 6, HEIGHT - 6))
            view.press('l')
            watch.wait('no light', lambda d: d == whole)
            wait_box('h', 'the keys', lambda x0, y0, x1, y1: abs(x0 + x1 - WIDTH) <= 1 and
                     abs(y0 + y1 - HEIGHT) <= 1)
            view.press('h')
            watch.wait('no keys', lambda d: d == whole)
            view.press('Escape')
            assert view.end()[0] == 0


def test_keeping():
    """p keeps the picture that is shown, r all of them; without --out in the working folder."""
    with lit() as daemon, probe(daemon) as light, Screen() as screen:
        light_up(light)
        with View(daemon.address, '--rate', '10', '--show', 'virtual', screen=screen) as view:
            view.resize(WIDTH, HEIGHT)
            wait_for('a picture', lambda: view.see()[:2] == (WIDTH, HEIGHT) and
                     pixel(view.see()[2], BESIDE_CUBE) == pixel(SHOT, BESIDE_CUBE))
            view.press('p')
            kept = wait_for('a picture kept', lambda: [n for n in os.listdir(view.path)
                                                       if n.startswith('gnomon-') and n.endswith('.png')])
            wait_for('that said', lambda: 'kept ' + kept[0] in view.read('stdout'))
            width, height, data = read_png(view.at(kept[0]))
            assert (width, height) == (WIDTH, HEIGHT)
            assert pixel(data, BESIDE_CUBE) == pixel(SHOT, BESIDE_CUBE), '--show virtual'
            assert pixel(data, ON_CUBE) != pixel(SHOT, ON_CUBE)
            view.press('r')
            folder = wait_for('a recording', lambda: [n for n in os.listdir(view.path)
                                                      if n.startswith('gnomon-') and os.path.isdir(view.at(n))])[0]
            wait_for('some pictures', lambda: len(os.listdir(view.at(folder))) > 4)
            view.press('r')
            wait_for('its end', lambda: ' pictures: ' + folder in view.read('stdout'))
            with open(view.at(folder + '/view.json')) as f:
                report = json.load(f)
            names = {frame['name'] + '.png' for frame in report['frames']}
            assert names == set(os.listdir(view.at(folder))) - {'view.json'} and len(names) > 2
            assert read_png(view.at(folder + '/' + sorted(names)[-1]))[2] == data
            view.resize(500, HEIGHT)  # the picture keeps its shape, black beside it

            def is_letterboxed():
                width, height, seen = view.see()
                rows = [seen[3 * width * y:3 * width * (y + 1)] for y in range(height)]
                return (width, height) == (500, HEIGHT) and \
                    b''.join(row[3 * 90:3 * 410] for row in rows) == data and \
                    all(row[:3 * 90] == row[3 * 410:] == bytes(3 * 90) for row in rows)
            wait_for('a letterboxed picture', is_letterboxed)
            view.press('q')
            status, out, err = view.end()
            assert (status, err) == (0, '') and 'frame 1:' not in out, (status, out, err)


def test_server_lost():
    """The last picture stays, with a word about it; when the server is back, all goes on."""
    with lit() as daemon, Screen() as screen:
        address, light = daemon.address, probe(daemon)
        light_up(light)
        with View(address, '--out', 'out', '--loop', '--rate', '10', screen=screen) as view:
            watch = Watch(view)
            whole = watch.wait_composite()
            daemon.process.send_signal(signal.SIGSTOP)
            watch.wait('a word about the silence', lambda d: find_differences(d, whole, WIDTH))
            daemon.kill()
            light.close()
            wait_for('that said', lambda: 'the server is lost: ' in view.read('stderr'))
            wait_for('its title', lambda: view.get_title().startswith('gnomon: room demo - server lost'))
            seen = watch.wait('a warning', lambda d: find_differences(d, whole, WIDTH))
            x0, y0, x1, y1 = find_differences(seen, whole, WIDTH)
            assert x0 == 6 and y1 == HEIGHT - 6 and y0 > HEIGHT / 2, (x0, y0, x1, y1)
            red, green, blue = pixel(seen, (x0 + 2, y0 + 2))
            assert red > 2 * green and red > 2 * blue, (red, green, blue)
            view.press('o')  # it still answers
            watch.wait('figures', lambda d: find_differences(d, whole, WIDTH)[1] == 6)
            view.press('o')
            view.press('o')
            n_before = view.read('stdout').count('frame ')
            with lit('%s:%d' % address) as second, probe(second) as light:
                light_up(light)
                wait_for('a way back', lambda: 'connected again after' in view.read('stdout'))
                wait_for('frames', lambda: view.read('stdout').count('frame ') > n_before + 2)
                watch.wait('the picture alone', lambda d: d == whole)
                view.press('q')
                status, out, err = view.end()
            assert status == 0 and '; connected again 1 time, ' in out, out[-300:]
            assert err.count('\n') == 1 and 'the server is lost: ' in err, err
            with open(view.at('out/view.json')) as f:
                report = json.load(f)
            # When q is pressed one frame may be out.
            assert 0 <= report['sent'] - len(report['frames']) <= 1, 'not every frame is accounted for'
            lost = [f for f in report['frames'] if f.get('sentence') == 'the server was lost']
            assert len(lost) == 1 and ', 1 frame lost' in out, (lost, out[-300:])


def test_full_screen():
    """With no window manager, as here, f fills the screen with the whole picture all the same, and back."""
    with lit() as daemon, probe(daemon) as light, Screen(2 * WIDTH, 2 * HEIGHT) as screen:
        light_up(light)
        with View(daemon.address, '--out', 'out', '--loop', '--rate', '10', screen=screen) as view:
            watch = Watch(view)
            whole = watch.wait_composite()
            before = view.get_box()
            view.press('f')
            wait_for('the whole screen', lambda: view.get_box() == (0, 0, 2 * WIDTH, 2 * HEIGHT))
            wait_for('the whole picture', lambda: screen.read(0, 0, 2 * WIDTH, 2 * HEIGHT) ==
                     enlarge(whole, 2))
            view.press('f')
            wait_for('the window', lambda: view.get_box() == before)
            watch.wait('the picture', lambda d: d == whole)
            screen.do('windowunmap', view.id)
            screen.do('windowmap', view.id)
            watch.wait('the picture once more', lambda d: d == whole)
            screen.do('windowfocus', view.id)
            view.press('q')
            assert view.end()[0] == 0


def test_server_late():
    """The window opens before its server is there, says so, and goes on when it comes."""
    with lit() as daemon:
        address = daemon.address
    with Screen() as screen:
        with View(address, '--out', 'out', '--loop', '--rate', '10', screen=screen,
                  title='gnomon - waiting for gnomond at %s:%d$' % address) as view:
            assert view.get_box()[2:] == (2 * WIDTH, 2 * HEIGHT), view.get_box()

            def is_said():
                width, _, seen = view.see()
                bright = {i // 3 // width for i in range(0, len(seen), 3) if min(seen[i:i + 3]) >= 240}
                return any(y < 20 for y in bright) and any(y > 2 * HEIGHT - 20 for y in bright)
            wait_for('the hint and a word about it', is_said)
            with lit('%s:%d' % address) as daemon, probe(daemon) as light:
                light_up(light)
                watch = Watch(view)
                watch.wait_composite()
                wait_for('its room', lambda: view.get_title() == 'gnomon: room demo - h: keys')
                view.press('q')
                status, out, err = view.end()
            assert status == 0 and 'connected again' not in out, out
            assert err.count('\n') == 1 and 'is gnomond running' in err and err.endswith('waiting for it\n'), err
        with lit() as daemon:  # one that is there and refuses is not waited for
            with View(daemon.address, '--room', 'attic', screen=screen, title='') as view:
                status, _, err = view.end()
                assert status == 1 and err.count('\n') == 1 and 'no room of that name' in err, err


def close_by_manager(view):
    view.screen.ask_to_close(view.id)


def close_by_signal(view):
    view.process.send_signal(signal.SIGTERM)


def test_closing():
    """The close button and SIGTERM end it well: receipts of --out and of a recording are whole."""
    with lit() as daemon, probe(daemon) as light, Screen() as screen:
        light_up(light)
        for close in (close_by_manager, close_by_signal):
            with View(daemon.address, '--out', 'out', '--loop', '--rate', '10', screen=screen) as view:
                wait_for('a picture', lambda: 'frame 2:' in view.read('stdout'))
                view.press('r')
                wait_for('that said', lambda: view.get_title() == 'gnomon: room demo - recording')
                wait_for('frames', lambda: view.read('stdout').count('frame ') > 4)
                close(view)
                status, out, err = view.end()
                assert (status, err) == (0, '') and '; in out\n' in out, (status, out, err)
                folder, = (n for n in os.listdir(view.at('out')) if n.startswith('gnomon-'))
                for name in ('out', 'out/' + folder):
                    with open(view.at(name + '/view.json')) as f:
                        assert json.load(f)['results'] > 0
                    assert not [n for n in os.listdir(view.at(name)) if n.endswith('.tmp')]
    with Screen() as screen:
        for close in (close_by_manager, close_by_signal):
            with View(('127.0.0.1', 1), '--out', 'out', screen=screen, title='gnomon - waiting') as view:
                close(view)
                status, _, err = view.end()
                assert status == 1 and err.endswith('ended before gnomond at 127.0.0.1:1 was there\n'), err
                assert not os.path.exists(view.at('out'))


def test_no_display():
    """Where there is no display, files are written, and that is said in one line."""
    bare = {k: v for k, v in ENVIRONMENT.items()
            if k not in ('DISPLAY', 'WAYLAND_DISPLAY', 'SDL_VIDEODRIVER')}
    deaf = dict(bare, DISPLAY='127.0.0.1:99')  # a display that is not there
    with lit() as daemon, probe(daemon) as light:
        light_up(light)
        for more, folder, env in (((), 'composites', bare), (('--out', 'there'), 'there', deaf)):
            with View(daemon.address, *more, env=env) as view:
                status, out, err = view.end()
                assert status == 0 and '; in %s\n' % folder in out, (out, err)
                assert err.count('\n') == 1 and 'no display' in err and folder in err, err
                assert sorted(os.listdir(view.at(folder))) == ['shot.png', 'view.json']
        with View(daemon.address, '--count', '3', env=dict(bare, SDL_VIDEODRIVER='dummy')) as view:
            status, out, err = view.end()
            assert (status, err) == (0, '') and '3 frames sent, 3 results' in out, (out, err)
            assert sorted(os.listdir(view.path)) == ['camera.json', 'shots', 'stderr', 'stdout']
    done = subprocess.run([GNOMON, 'view', '--files', 'x', '--camera', 'y'], stderr=subprocess.PIPE)
    assert done.returncode == 2 and b'--out DIR' in done.stderr and b'--window' in done.stderr


if not re.search(rb'^\w+ +window +yes', subprocess.run([GNOMON, 'doctor'], stdout=subprocess.PIPE).stdout, re.M):
    print('1..0 # SKIP built without windows (libsdl2-dev)')
    sys.exit(0)
for tool in ('Xvfb', 'xdotool'):
    if not shutil.which(tool):
        print('1..0 # SKIP no %s (deploy/install-packages test)' % tool)
        sys.exit(0)
run_tests([test_picture_and_toggles, test_overlays, test_keeping, test_full_screen,
           test_server_late, test_server_lost, test_closing, test_no_display])
