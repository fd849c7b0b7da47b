# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""gnomon-render from outside: a small scene's layers, and each bad input's error.

usage: render_cli.py GNOMON_RENDER. Prints TAP. Only the standard library.
"""
import json
import math
import os
import struct
import subprocess
import sys
import zlib

from folder import make_folder

PROGRAM = os.path.abspath(sys.argv[1])
FLOOR = 'v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n'
BOX = ''.join('v %g %g %g\n' % (x, y, z) for z in (0, .2)
              for x, y in ((-.1, -.1), (.1, -.1), (.1, .1), (-.1, .1))) + \
    'f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n'
SCENE = {'objects': [{'mesh': 'floor.obj', 'role': 'real'},
                     {'mesh': 'box.obj', 'role': 'virtual',
                      'material': {'type': 'diffuse', 'albedo': [.8, .4, .2]}}]}
# One metre above the floor, looking straight down: x right, y down on the picture.
CAMERA = {'width': 64, 'height': 48, 'fx': 60, 'fy': 60, 'cx': 32, 'cy': 24,
          'distortion': [0, 0, 0, 0, 0],
          'world_from_camera': [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 1, 0, 0, 0, 1]}


def write(name, data):
    with open(name, 'wb') as file:
        file.write(data.encode() if isinstance(data, str) else data)


def make_hdr(width, height, rgbe=bytes((128, 128, 128, 129))):
    """A Radiance picture of one colour; the default is 1.0."""
    return b'#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n' % (height, width) + \
        rgbe * (width * height)


def make_png(width, height, code):
    def chunk(kind, data):
        return struct.pack('>I', len(data)) + kind + data + \
            struct.pack('>I', zlib.crc32(kind + data))
    rows = (b'\0' + bytes((code,)) * (3 * width)) * height
    return b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', struct.pack('>IIBBBBB', width, height, 8, 2, 0, 0, 0)) + \
        chunk(b'IDAT', zlib.compress(rows)) + chunk(b'IEND', b'')


def read_exr(name):
    """Channels of a scan-line ZIP file of 32-bit floats: {name: [values]}, width, height."""
    with open(name, 'rb') as file:
        data = file.read()
    assert data[:8] == b'\x76\x2f\x31\x01\x02\0\0\0', 'not a plain EXR'
    at, attributes = 8, {}
    while data[at]:
        key, kind, rest = data[at:].split(b'\0', 2)
        at += len(key) + len(kind) + 2
        size, = struct.unpack_from('<i', data, at)
        attributes[key.decode()] = data[at + 4:at + 4 + size]
        at += 4 + size
    at += 1
    x0, y0, x1, y1 = struct.unpack('<4i', attributes['dataWindow'])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    names, rest = [], attributes['channels']
    while rest[0]:
        channel, rest = rest.split(b'\0', 1)
        kind, = struct.unpack_from('<i', rest)
        assert kind == 2, '%s is no 32-bit float' % channel
        names.append(channel.decode())
        rest = rest[16:]
    assert attributes['compression'] == b'\x03', 'not ZIP'
    lines = 16
    channels = {channel: [0.0] * (width * height) for channel in names}
    for block in range((height + lines - 1) // lines):
        offset, = struct.unpack_from('<Q', data, at + 8 * block)
        y, size = struct.unpack_from('<ii', data, offset)
        n_lines = min(lines, height - (y - y0))
        raw = data[offset + 8:offset + 8 + size]
        want = n_lines * width * 4 * len(names)
        if size < want:
            coded = bytearray(zlib.decompress(raw))
            for i in range(1, len(coded)):
                coded[i] = (coded[i - 1] + coded[i] - 128) & 255
            half = (len(coded) + 1) // 2
            raw = bytearray(len(coded))
            raw[0::2], raw[1::2] = coded[:half], coded[half:]
        position = 0
        for line in range(n_lines):
            for channel in names:
                start = (y - y0 + line) * width
                channels[channel][start:start + width] = struct.unpack_from('<%df' % width, raw, position)
                position += 4 * width
    return channels, width, height


def run(*options, **changes):
    """Runs on the good inputs but for the changes; an option of None is left out."""
    inputs = {'scene': 'scene.json', 'env': 'white.hdr', 'camera': 'camera.json', 'out': 'out.exr'}
    inputs.update({key.replace('_', '-'): value for key, value in changes.items()})
    command = [PROGRAM]
    for key, value in inputs.items():
        if value is not None:
            command += ['--' + key, value]
    return subprocess.run(command + list(options), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          timeout=120)


def check(condition, text):
    if not condition:
        raise AssertionError(text)


def check_run(*options, **changes):
    done = run(*options, **changes)
    check(done.returncode == 0 and not done.stderr, 'exit %d: %r' % (done.returncode, done.stderr))


def near(value, wanted, tolerance):
    return abs(value - wanted) <= tolerance


def test_layers():
    # Fine enough that texels' centres stand for the texels within 3e-4.
    write('fine.hdr', make_hdr(128, 64))
    check_run('--quality', 'reference', '--report', 'report.json', '--shadow-png', 'shadow.png',
              '--composite-png', 'composite.png', background='grey.png', env='fine.hdr')
    channels, width, height = read_exr('out.exr')
    check((width, height) == (64, 48), 'size')
    wanted = ['virtual.R', 'virtual.G', 'virtual.B', 'virtual.A', 'shadow.R', 'shadow.G', 'shadow.B',
              'added.R', 'added.G', 'added.B', 'depth.Z', 'composite.R', 'composite.G', 'composite.B']
    check(sorted(channels) == sorted(wanted), sorted(channels))
    middle, corner = 24 * 64 + 32, 0
    # The top of the box sees the whole white sky: its radiance is its albedo.
    for channel, albedo in (('R', .8), ('G', .4), ('B', .2)):
        value = channels['virtual.' + channel][middle]
        check(near(value, albedo, 1e-3 * albedo), 'virtual.%s %g' % (channel, value))
    check(channels['virtual.A'][middle] == 1 and channels['virtual.A'][corner] == 0, 'coverage')
    check(near(channels['depth.Z'][middle], .8, 1e-6), 'depth %g' % channels['depth.Z'][middle])
    check(near(channels['depth.Z'][corner], 1, 1e-6), 'depth %g' % channels['depth.Z'][corner])
    shadow = channels['shadow.R']
    check(min(shadow) >= 0 and max(shadow) <= 1, 'shadow range')
    beside = 24 * 64 + 32 + 9  # 5 cm from the box's side: a fair part of the sky is hidden
    check(.5 < shadow[beside] < .95 < shadow[corner], 'shadow %g %g' % (shadow[beside], shadow[corner]))
    linear = ((128 / 255 + .055) / 1.055) ** 2.4
    for i, value in enumerate(channels['composite.R']):
        a = channels['virtual.A'][i]
        over = (shadow[i] * linear + channels['added.R'][i]) * (1 - a) + channels['virtual.R'][i]
        check(near(value, over, 1e-5), 'composite at %d: %g, not %g' % (i, value, over))
    for name in ('shadow.png', 'composite.png'):
        with open(name, 'rb') as file:
            check(file.read(8) == b'\x89PNG\r\n\x1a\n', name)


def test_report():
    check_run('--report', 'report.json', '--lights', '32')
    with open('report.json') as file:
        report = json.load(file)
    check(report['plan'] and all(set(line) == {'pass', 'ran', 'why'} and line['why']
                                 for line in report['plan']), 'plan')
    check(any(line['ran'] for line in report['plan']), 'nothing ran')
    check(report['timings_ms']['total'] > 0 and report['rays']['primary'] >= 64 * 48, 'figures')
    check(report['lights'] > 0 and report['quality'] == 'interactive', 'lights')
    check(report['scene'] == {'objects': 2, 'real_triangles': 2, 'virtual_triangles': 12}, 'scene')


def test_budget():
    """What no machine can do, and what each can: no time is looked at."""
    for budget, setting, verdict in (('0.001', (4, 1), 'too small'), ('1e8', (32, 3), 'fits')):
        check_run('--report', 'report.json', '--lights', '32', '--budget-ms', budget)
        with open('report.json') as file:
            told = json.load(file)['budget']
        got = told['setting']['lights'], told['setting']['grid']
        check(got == setting and told['verdict'] == verdict, told)
        check(told['budget_ms'] == float(budget) and told['ms'] > 0 and told['predicted_ms'] > 0, told)
        check(told['misses'] == (told['frames'] if verdict == 'too small' else 0), told)
        check(told['lights_to_choose_from'] == 32 and told['predicted_error'] >= 0, told)
    check_run('--report', 'report.json')
    with open('report.json') as file:
        check(json.load(file)['budget'] is None, 'a budget that nobody asked for')


def test_threads_give_the_same_bits():
    check_run('--threads', '1', out='one.exr')
    check_run('--threads', '3', out='three.exr')
    with open('one.exr', 'rb') as one, open('three.exr', 'rb') as three:
        check(one.read() == three.read(), 'the layers differ')


def test_refining():
    """More passes bring the shadow nearer to the reference's, as near as they say."""
    def rms(name, wanted):
        pairs = [(a, b) for channel in ('shadow.R', 'shadow.G', 'shadow.B')
                 for a, b in zip(read_exr(name)[0][channel], wanted[channel]) if b < 1]
        return math.sqrt(sum((a - b) ** 2 for a, b in pairs) / len(pairs))

    check_run('--quality', 'reference', out='reference.exr')
    check_run('--lights', '16', out='coarse.exr')
    done = run('--refine', '1e-6', '--passes', '130', '--lights', '16', '--report', 'report.json',
               out='fine.exr')
    lines = done.stderr.decode().splitlines()
    check(done.returncode == 0 and 'gnomon-render: 128 passes, off by ' in lines[-1] and
          lines[-1].endswith(': all passes are done'), lines)
    with open('report.json') as file:
        report = json.load(file)
    refined = report['refined']
    check(refined['passes'] == 128 and refined['error'] >= refined['error_shadow'] > 0, refined)
    check(report['plan'][-1] == {'pass': 'progressive', 'ran': True, 'why': 'asked for'}, report)
    reference = read_exr('reference.exr')[0]
    coarse, fine = rms('coarse.exr', reference), rms('fine.exr', reference)
    print('# shadow off by %.4f, after 128 passes by %.4f, says %.4f' % (
        coarse, fine, refined['error_shadow']))
    check(fine < 0.2 * coarse and fine < 3 * refined['error_shadow'], 'not refined')
    done = run('--refine', '0.05', '--report', 'report.json')
    with open('report.json') as file:
        refined = json.load(file)['refined']
    check(done.returncode == 0 and refined['error'] <= 0.05 and refined['passes'] < 200, refined)


def test_qualities_and_methods_run():
    for options in (['--quality', 'seed'], ['--quality', 'seed', '--shading', 'irradiance'],
                    ['--light-method', 'penrose', '--lights', '16'],
                    ['--light-method', 'penrose', '--light-weights', 'equal',
                     '--no-light-relaxed'],
                    ['--light-literal', 'sample-mean,strict', '--light-mended', 'strict',
                     '--light-metric', 'twice', '--light-rings', '2', '--light-sectors', '5',
                     '--light-max-ls', '4', '--light-samples', '500'],
                    ['--quality', 'reference', '--bounces', '1', '--paths', '2', '--seed', '3']):
        check_run(*options)
        channels, _, _ = read_exr('out.exr')
        for name, values in channels.items():
            check(not any(math.isnan(v) for v in values), '%s: NaN in %s' % (options, name))


def test_discs_can_be_left_to_the_method():
    bright = bytes((200, 180, 160, 140))  # radiances of 2560 to 3200 over 0.5
    row = b''.join(bright if x == 128 else bytes((128, 128, 128, 128)) for x in range(256))
    grey = bytes((128, 128, 128, 128)) * 256
    write('sun.hdr', b'#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 128 +X 256\n' + grey * 40 + row + grey * 87)
    lights = []
    for options in ([], ['--light-discs'], ['--no-light-discs']):
        check_run('--light-method', 'median-cut', '--lights', '4', '--report', 'report.json', *options,
                  env='sun.hdr')
        with open('report.json', encoding='utf-8') as report:
            lights.append(json.load(report)['lights'])
    check(lights[0] == lights[1] > 4 and lights[2] == 4, lights)


def test_rotation_turns_the_light():
    # Light from the map's +x half only; the rotation decides which side of the box's floor sees it.
    row = [bytes((128, 128, 128, 133)) if 7 <= x < 9 else bytes(4) for x in range(16)]
    write('side.hdr', b'#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n' + b''.join(row) * 8)
    left, right = 24 * 64 + 32 - 14, 24 * 64 + 32 + 13
    factors = []
    for turn in ('1,0,0,0,1,0,0,0,1', '-1,0,0,0,-1,0,0,0,1'):
        check_run('--quality', 'reference', '--world-from-env', turn, env='side.hdr')
        shadow = read_exr('out.exr')[0]['shadow.R']
        factors.append((shadow[left], shadow[right]))
    check(factors[0][0] < factors[0][1] - .2, 'light from +x: shadow on the left: %s' % factors)
    check(factors[1][1] < factors[1][0] - .2, 'light from -x: shadow on the right: %s' % factors)


def test_params_describe_the_picture():
    write('params.json', json.dumps({'projection': 'fisheye-equisolid', 'center': [16, 16],
                                     'radius': 15.5, 'theta_max': 1.5, 'orientation': [0, 1, 0, 0]}))
    write('fisheye.hdr', make_hdr(32, 32))
    check_run(env='fisheye.hdr', env_params='params.json')
    write('params.json', json.dumps({'radius': 15.5, 'response': {'type': 'srgb'}}))
    write('fisheye.png', make_png(32, 32, 200))
    check_run('--env-projection', 'fisheye-equidistant', '--world-from-env', '1,0,0,0,-1,0,0,0,-1',
              env='fisheye.png', env_params='params.json')


def test_several_probes():
    # White at x = -1 m, half of that at 1 m; the box's top in the middle gets the mean.
    write('half.hdr', make_hdr(32, 16, bytes((128, 128, 128, 128))))
    for name, x in (('left', -1), ('right', 1)):
        write(name + '.json', json.dumps({'projection': 'latlong', 'position': [x, 0, .2]}))
    middle, values = 24 * 64 + 32, []
    for more in ((), ('--more-envs', 'half.hdr=right.json')):
        check_run('--quality', 'reference', *more, env_params='left.json')
        values.append(read_exr('out.exr')[0]['virtual.R'][middle])
    check(near(values[1], .75 * values[0], .01 * values[0]), values)
    for bad in ('half.hdr', '=x', 'half.hdr=', 'none.hdr=right.json',
                ','.join(['half.hdr=right.json'] * 8)):
        done = run('--more-envs', bad, env_params='left.json')
        check(done.returncode != 0 and done.stderr.count(b'\n') == 1, bad)


def test_global_model():
    # A mirror that looks down at the floor from above the probe: it shows what the probe measured
    # there, black, and not the lit floor of the local model.
    write('mirror.json', json.dumps({'projection': 'latlong', 'position': [0, 0, .1]}))
    black = bytes((0, 0, 0, 0))
    write('sky.hdr', b'#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16 +X 32\n' +
          bytes((128, 128, 128, 129)) * (32 * 8) + black * (32 * 8))
    up = dict(CAMERA, world_from_camera=[1, 0, 0, 0, 0, 0, 1, -.6, 0, -1, 0, .1, 0, 0, 0, 1])
    write('side.json', json.dumps(up))
    mirror = {'mesh': 'box.obj', 'role': 'virtual', 'material': {'type': 'mirror'},
              'world_from_object': [1, 0, 0, 0, 0, .8, -.6, .3, 0, .6, .8, .1, 0, 0, 0, 1]}
    values = {}
    for model in ('local', 'global'):
        write('m.json', json.dumps({'objects': [SCENE['objects'][0], mirror], 'model': model}))
        check_run(scene='m.json', env='sky.hdr', env_params='mirror.json', camera='side.json')
        channels = read_exr('out.exr')[0]
        values[model] = [v for v, a in zip(channels['virtual.R'], channels['virtual.A']) if a == 1]
    check(max(values['local']) > .1, 'no mirror in view')
    darker = sum(g < .5 * l for l, g in zip(values['local'], values['global']))
    check(darker > 20, '%d of %d pixels' % (darker, len(values['local'])))
    write('m.json', json.dumps(dict(SCENE, model='half')))
    done = run(scene='m.json')
    check(done.returncode != 0 and b'model' in done.stderr, done.stderr)


def test_help():
    done = run('--help', scene=None, env=None, camera=None, out=None)
    check(done.returncode == 0 and b'Examples:' in done.stdout and b'--light-method' in done.stdout, 'help')
    done = run('--version', scene=None, env=None, camera=None, out=None)
    check(done.returncode == 0 and done.stdout.startswith(b'gnomon-render '), 'version')


def scene_with(**members):
    write('bad.json', json.dumps(dict(SCENE, **members)))
    return {'scene': 'bad.json'}


def camera_with(**members):
    write('bad_camera.json', json.dumps(dict(CAMERA, **members)))
    return {'camera': 'bad_camera.json'}


def file_of(option, name, data):
    write(name, data)
    return {option: name}


def test_global_model_that_does_nothing_is_noted():
    """A probe on the floor sees none of it; one above sees it in its lower half."""
    scene = dict(SCENE, model='global')
    write('global.json', json.dumps(scene))
    write('up.json', '{"projection": "latlong", "position": [0, 0, 0.3]}')
    for changes, n_lines in ({}, 1), ({'env_params': 'up.json'}, 0):
        done = run(scene='global.json', **changes)
        error = done.stderr.decode()
        check(done.returncode == 0 and error.count('\n') == n_lines, error)
        check(n_lines == 0 or 'note: ' in error and '"position"' in error, error)


def list_bad():
    """(what the error must hold, further options, changed inputs)"""
    params = {'env_params': 'p.json'}
    yield '--scene', [], {'scene': None}
    yield '--env', [], {'env': None}
    yield '--camera', [], {'camera': None}
    yield '--out', [], {'out': None}
    yield 'absent.json', [], {'scene': 'absent.json'}
    yield 'absent.hdr', [], {'env': 'absent.hdr'}
    yield 'absent_camera', [], {'camera': 'absent_camera'}
    yield 'absent.png', [], {'background': 'absent.png'}
    yield 'absent.params', [], {'env_params': 'absent.params'}
    yield 'nowhere/out.exr', [], {'out': 'nowhere/out.exr'}
    yield 'nowhere/report', ['--report', 'nowhere/report'], {}
    for key, name in (('out', 'x.png'), ('irradiance-map', 'x.png'), ('light-map', 'x.exr'),
                      ('shadow-png', 'x.exr'), ('composite-png', 'exr'), ('out', '.exr')):
        more = {'background': 'grey.png'} if key == 'composite-png' else {}
        yield '--%s %s: ' % (key, name), ['--report', 'report.json'], dict({key.replace('-', '_'): name}, **more)
    yield 'two outputs', ['--report', 'out.exr'], {}
    yield 'an input and an output', ['--report', 'camera.json'], {}
    yield '--budget-ms', ['--budget-ms', '0'], {}
    yield 'is for --quality interactive', ['--budget-ms', '20', '--quality', 'seed'], {}
    yield '--refine ERROR', ['--passes', '20'], {}
    yield 'passes', ['--refine', '0.1', '--passes', '3'], {}
    yield 'refine', ['--refine', '0'], {}
    yield '--budget-ms: one', ['--refine', '0.1', '--budget-ms', '20'], {}
    yield '--refine: reference quality', ['--refine', '0.1', '--quality', 'reference'], {}
    yield '--no-such', ['--no-such', '3'], {}
    yield 'quality', ['--quality', 'best'], {}
    yield 'lights', ['--lights', '0'], {}
    yield 'lights', ['--lights', '9999'], {}
    yield 'light-method', ['--light-method', 'magic'], {}
    yield "did you mean 'sample-mean'?", ['--light-literal', 'strict,sample-maen'], {}
    for method, takers, options in (
            ('quadtree', 'partition, seed and penrose do', ['--light-literal', 'strict']),
            ('median-cut', 'partition, seed and penrose do', ['--light-mended', 'unclamped']),
            ('variance', 'partition, seed and penrose do', ['--no-light-relaxed']),
            ('penrose', 'partition and seed do', ['--light-rings', '4']),
            ('penrose', 'partition and seed do', ['--light-sectors', '12']),
            ('inversion', 'partition and seed do', ['--light-max-ls', '4']),
            ('penrose', 'partition and seed do', ['--light-samples', '500']),
            ('penrose', 'partition and seed do', ['--light-metric', 'twice']),
            ('partition', 'penrose does', ['--light-weights', 'density']),
            ('seed', 'variance, inversion and quadtree do', ['--lights', '64']),
            ('penrose', 'plain-sampling and discard-dark', ['--light-literal', 'plain-sampling,midpoint']),
            ('partition', 'log2 only', ['--lights', '9', '--light-metric', 'pow2']),
            ('partition', 'light-literal has sample-mean', ['--light-samples', '500']),
            ('partition', 'light-literal has sample-mean', ['--no-light-relaxed'])):
        yield takers, ['--light-method', method] + options, {}
    yield '1024 regions', ['--light-rings', '64', '--light-sectors', '256'], {}
    yield 'bounces', ['--bounces', '17', '--quality', 'reference'], {}
    yield '--bounces is for --quality reference', ['--bounces', '2'], {}
    yield 'threads', ['--threads', '-1'], {}
    yield '--background', ['--composite-png', 'c.png'], {}
    yield 'nine numbers', ['--world-from-env', '1,2,3'], {}
    yield 'nine numbers', ['--world-from-env', '1,0,0,0,1,0,0,0,nan'], {}
    yield 'no rotation', ['--world-from-env', '1,0,0,0,1,0,0,0,-1'], {}
    yield 'no rotation', ['--world-from-env', '0,0,0,0,0,0,0,0,0'], {}
    yield 'env-projection', ['--env-projection', 'square'], {}
    yield 'codes', [], {'env': 'grey.png'}
    yield 'zero.hdr', [], file_of('env', 'zero.hdr', b'#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 0 +X 4\n')
    yield 'cut.hdr', [], file_of('env', 'cut.hdr', make_hdr(32, 16)[:200])
    yield 'text.exr', [], file_of('env', 'text.exr', 'this is no picture')
    yield 'small.png', [], file_of('background', 'small.png', make_png(8, 8, 9))
    yield '64 x 48', [], {'background': 'small.png'}
    yield 'scene.json', [], file_of('scene', 'cut_scene.json', json.dumps(SCENE)[:40])
    yield 'objects', [], scene_with(objects=[])
    yield 'lights', [], scene_with(lights=[{'type': 'point'}])
    yield 'gone.obj', [], scene_with(objects=[{'mesh': 'gone.obj', 'role': 'real'}])
    yield "'glass', 'ggx', found", [], scene_with(
        objects=[{'mesh': 'box.obj', 'role': 'virtual', 'material': {'type': 'wood'}}])
    yield 'width', [], camera_with(width=0)
    yield 'width', [], camera_with(width=1000000)
    yield 'fx', [], camera_with(fx=-1)
    yield 'world_from_camera', [], camera_with(world_from_camera=[0] * 16)
    yield 'world_from_camera: missing: where the camera is', [], file_of('camera', 'calibrated.json', json.dumps(
        {k: v for k, v in CAMERA.items() if k != 'world_from_camera'}))
    yield 'p.json', [], dict(params, **file_of('env_params', 'p.json', '{"projection": "square"}'))
    yield 'radius', ['--env-projection', 'angular'], dict(
        params, **file_of('env_params', 'p.json', '{"radius": -3}'))
    yield 'leave one out', ['--env-projection', 'angular', '--world-from-env', '1,0,0,0,1,0,0,0,1'], \
        dict(params, **file_of('env_params', 'p.json', '{"orientation": [1, 0, 0, 0]}'))


def test_bad_input_leaves_one_line_and_no_file():
    for says, options, changes in list_bad():
        for name in ('out.exr', 'report.json', 'shadow.png'):
            if os.path.exists(name):
                os.remove(name)
        with_outputs = [] if '--report' in options else ['--report', 'report.json',
                                                         '--shadow-png', 'shadow.png']
        before = sorted(os.listdir('.'))
        done = run(*options, *with_outputs, **changes)
        error = done.stderr.decode()
        what = '%s %s: exit %d: %r' % (options, changes, done.returncode, error)
        check(done.returncode == 1, what)
        check(error.startswith('gnomon-render: ') and error.count('\n') == 1 and error.endswith('\n'), what)
        check(says in error, '%s, wanted %r' % (what, says))
        check(sorted(os.listdir('.')) == before, '%s left %s' % (what, os.listdir('.')))


def main():
    tests = [(name, test) for name, test in globals().items() if name.startswith('test_')]
    print('1..%d' % len(tests))
    failed = 0
    os.chdir(make_folder('files'))
    write('floor.obj', FLOOR)
    write('box.obj', BOX)
    write('scene.json', json.dumps(SCENE))
    write('camera.json', json.dumps(CAMERA))
    write('white.hdr', make_hdr(32, 16))
    write('grey.png', make_png(64, 48, 128))
    for number, (name, test) in enumerate(tests, 1):
        try:
            test()
            print('ok %d - %s' % (number, name))
        except (AssertionError, OSError, subprocess.TimeoutExpired, ValueError, KeyError) as error:
            failed += 1
            print('# %s' % str(error).replace('\n', ' '))
            print('not ok %d - %s' % (number, name))
        sys.stdout.flush()
    os.chdir('/')
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())
