# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""The spherical harmonics, written apart: numpy against gnomon-render's report.

usage: sh_oracle.py GNOMON_RENDER. Prints TAP. Takes numpy; the photographs of GNOMON_DATA and
cmgen of Debian's libfilament-tools where they are there.

Here a texel is cut into many points, the harmonics come from the associated Legendre recurrence
and the sums over a row from its Fourier transform: no formula is shared with server/light.
"""
import functools
import glob
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile

import numpy as np

PROGRAM = os.path.abspath(sys.argv[1])
DATA = os.environ.get('GNOMON_DATA', '')
MAPS = sorted(glob.glob(os.path.join(DATA, 'hdr/equirect/*.hdr'))) if DATA else []
LUMINANCE = np.array([.2126, .7152, .0722])


def read_hdr(path, middle=0):
    """A Radiance picture as [height, width, 3]; row 0 first. middle is added to the codes."""
    with open(path, 'rb') as file:
        data = file.read()
    end = data.index(b'\n\n') + 2
    line_end = data.index(b'\n', end)
    height, width = map(int, re.fullmatch(rb'-Y (\d+) \+X (\d+)', data[end:line_end]).groups())
    codes, at = np.frombuffer(data, np.uint8), line_end + 1
    out = np.zeros((height, 4, width), np.uint8)
    if len(codes) - at == 4 * width * height and codes[at:at + 2].tolist() != [2, 2]:
        out = codes[at:].reshape(height, width, 4).transpose(0, 2, 1)
    else:
        for y in range(height):
            assert codes[at:at + 2].tolist() == [2, 2], 'not run-length coded'
            at += 4
            for channel in range(4):
                x = 0
                while x < width:
                    count = int(codes[at])
                    if count > 128:
                        out[y, channel, x:x + count - 128] = codes[at + 1]
                        x, at = x + count - 128, at + 2
                    else:
                        out[y, channel, x:x + count] = codes[at + 1:at + 1 + count]
                        x, at = x + count, at + 1 + count
    scale = np.where(out[:, 3] > 0, np.ldexp(1.0, out[:, 3].astype(int) - 136), 0)
    return ((out[:, :3] + middle) * scale[:, None]).transpose(0, 2, 1)


def write_hdr(path, width, height, seed):
    """Noise over five decades, flat coded."""
    rng = np.random.default_rng(seed)
    codes = rng.integers(0, 256, (height, width, 4), dtype=np.uint8)
    codes[..., 3] = rng.integers(120, 137, (height, width))
    codes[0, 0, 0] = 77  # no run-length mark
    with open(path, 'wb') as file:
        file.write(b'#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n' % (height, width))
        file.write(codes.tobytes())


def get_legendre(m, z, s):
    """Orthonormal associated Legendre functions of l = m ... 4, without (-1)^m."""
    p = np.full_like(z, math.sqrt((2 * m + 1) / (4 * math.pi)))
    for i in range(1, m + 1):
        p = p * s * math.sqrt((2 * i - 1) / (2 * i))
    out, before = {m: p}, 0 * z
    for l in range(m + 1, 5):
        a = math.sqrt((4 * l * l - 1) / (l * l - m * m))
        b = math.sqrt(((l - 1) ** 2 - m * m) / (4 * (l - 1) ** 2 - 1))
        out[l], before, p = a * (z * p - b * before), p, a * (z * p - b * before)
    return out


def project(radiance):
    """L_lm [25, 3] of a lat-long."""
    height, width, _ = radiance.shape
    cuts = max(8, 1024 // min(width, height))  # points along each side of a texel
    # sum of L exp(-i m phi), phi = pi - 2 pi (x + 1/2) / width, and the mean over the cuts
    fourier = np.fft.ifft(radiance, axis=1) * width
    cut = (np.arange(cuts) + .5) / cuts - .5
    theta = math.pi * (np.arange(height)[:, None] + (np.arange(cuts) + .5) / cuts) / height
    weight = np.sin(theta) * (math.pi / height / cuts) * (2 * math.pi / width)
    out = np.zeros((25, 3))
    for m in range(5):
        turn = (-1) ** m * np.exp(1j * math.pi * m / width)
        wide = np.mean(np.exp(2j * math.pi * m * cut / width))
        row = fourier[:, m % width] * turn * wide  # [height, 3]
        for l, p in get_legendre(m, np.cos(theta), np.sin(theta)).items():
            sums = (np.sum(p * weight, axis=1)[:, None] * row).sum(axis=0)
            if m == 0:
                out[l * (l + 1)] = sums.real
            else:
                out[l * (l + 1) + m] = math.sqrt(2) * sums.real
                out[l * (l + 1) - m] = -math.sqrt(2) * sums.imag
    return out


def get_basis(normals):
    """[n, 25]"""
    x, y, z = normals.T
    phi, out = np.arctan2(y, x), np.zeros((len(normals), 25))
    for m in range(5):
        for l, p in get_legendre(m, z, np.hypot(x, y)).items():
            out[:, l * (l + 1) + m] = p * (math.sqrt(2) * np.cos(m * phi) if m else 1)
            if m:
                out[:, l * (l + 1) - m] = p * math.sqrt(2) * np.sin(m * phi)
    return out


def get_irradiance(sh, lights, normals, order):
    band = [math.pi, 2 * math.pi / 3, math.pi / 4, 0, -math.pi / 24]
    factor = np.array([band[int(math.sqrt(k))] for k in range((order + 1) ** 2)])
    residual, exact = sh.copy(), 0
    for light in lights:
        d, e = np.array(light['direction']), np.array(light['irradiance'])
        residual = residual - get_basis(d[None])[0][:, None] * e
        exact = exact + np.maximum(normals @ d, 0)[:, None] * e
    n = len(factor)
    return np.maximum(get_basis(normals)[:, :n] @ (factor[:, None] * residual[:n]) + exact, 0)


def sum_texels(radiance, normals):
    """E at the normals by a sum over all texels."""
    height, width, _ = radiance.shape
    edge = np.cos(math.pi * np.arange(height + 1) / height)
    solid_angle = (edge[:-1] - edge[1:]) * 2 * math.pi / width
    theta = math.pi * (np.arange(height) + .5) / height
    phi = math.pi - 2 * math.pi * (np.arange(width) + .5) / width
    wave, out = np.stack([np.cos(phi), np.sin(phi)]).astype('f4'), 0
    for y in range(height):
        flat = normals[:, :2].astype('f4') @ (math.sin(theta[y]) * wave).astype('f4')
        cosine = np.maximum(flat + (normals[:, 2:] * math.cos(theta[y])).astype('f4'), 0)
        out = out + solid_angle[y] * (cosine @ radiance[y].astype('f4')).astype('f8')
    return out


def has_sun(path):
    return re.match('noon|narrow|rooitou', os.path.basename(path))  # or moon


def get_normals(n):
    i = np.arange(n)
    z, phi = 1 - 2 * (i + .5) / n, i * math.pi * (3 - math.sqrt(5))
    s = np.sqrt(1 - z * z)
    return np.stack([s * np.cos(phi), s * np.sin(phi), z], axis=1)


@functools.lru_cache(maxsize=None)
def run(path, order=4):
    """The report's "sh" of the picture."""
    if not os.path.exists('scene.json'):
        with open('box.obj', 'w') as file:
            file.write('v -1 -1 0\nv 1 -1 0\nv 1 1 0\nf 1 2 3\n')
        with open('scene.json', 'w') as file:
            json.dump({'objects': [{'mesh': 'box.obj', 'role': 'virtual',
                                    'material': {'type': 'diffuse', 'albedo': [.5, .5, .5]}}]},
                      file)
        with open('camera.json', 'w') as file:
            json.dump({'width': 4, 'height': 4, 'fx': 4, 'fy': 4, 'cx': 2, 'cy': 2,
                       'distortion': [0, 0, 0, 0, 0],
                       'world_from_camera': [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 1, 0, 0, 0, 1]},
                      file)
    subprocess.run([PROGRAM, '--scene', 'scene.json', '--camera', 'camera.json', '--env', path,
                    '--shading', 'irradiance', '--sh-order', str(order), '--out', 'out.exr',
                    '--report', 'report.json'], check=True)
    with open('report.json') as file:
        return json.load(file)['sh']


def check(path, orders):
    expected = project(read_hdr(path))
    for order in orders:
        found = np.array(run(path, order)['radiance'])
        n = (order + 1) ** 2
        assert found.shape == (n, 3), found.shape
        error = np.abs(found - expected[:n]).max() / expected[0].max()
        print('# %s, order %d: %.2g of L00' % (os.path.basename(path), order, error))
        assert error < 1e-4, error


def test_noise_of_any_size():
    for i, (width, height) in enumerate(((64, 32), (37, 19), (48, 5), (1, 1), (5, 40))):
        write_hdr('noise%d.hdr' % i, width, height, i)
        check('noise%d.hdr' % i, (2, 4))


def test_photographs():
    for path in MAPS:
        check(path, (4,))


def test_irradiance_of_photographs():
    """Root of the mean square error over 200 normals and the channels, of the mean irradiance."""
    normals = get_normals(200)
    for path in MAPS:
        report, exact = run(path), sum_texels(read_hdr(path), normals)
        sh = np.array(report['radiance'])
        error = {}
        for order in 2, 4:
            for lights in [], report['lights']:
                e = get_irradiance(sh, lights, normals, order)
                error[order, len(lights) > 0] = math.sqrt(np.mean((e - exact) ** 2)) / exact.mean()
        has = len(report['lights']) > 0
        print('# %-30s order 2 %.4f, order 4 %.4f; %d lights out: %.4f, %.4f' % (
            os.path.basename(path), error[2, False], error[4, False], len(report['lights']),
            error[2, has], error[4, has]))
        assert error[4, has] < .055 and error[2, False] < .105
        assert error[4, has] <= error[2, has] <= 1.01 * error[2, False]
        if has_sun(path):
            assert has and error[4, False] > .04 and error[4, has] < .0075


def test_cmgen():
    """Its x, y, z are our y, z, x, its basis has the Condon-Shortley sign; windows off, its
    coefficients are L_lm. It reads an RGBE code as its middle, (m + 1/2) / 256, where Radiance and
    we read m / 256: so numpy's coefficients, equal to ours above, are made of such codes here. It
    samples the picture into a cube first, which loses up to 2 % of a lamp and more of a sun."""
    normals = get_normals(100)
    sign = np.array([-1 if (k - l * l - l) % 2 else 1 for l in range(3)
                     for k in range(l * l, (l + 1) * (l + 1))])
    basis = get_basis(normals[:, [1, 2, 0]])[:, :9] * sign
    for path in [path for path in MAPS if not has_sun(path)]:
        subprocess.run(['cmgen', '--quiet', '--sh=3', '--sh-window=no', '--size=512',
                        '--sh-output=cmgen.txt', path], check=True, stdout=subprocess.DEVNULL)
        with open('cmgen.txt') as file:
            found = np.array([[float(v) for v in re.findall(r'-?\d+\.\d+', line)[:3]]
                              for line in file if line.startswith('(')])
        sh = project(read_hdr(path, .5))[:9]
        expected = np.linalg.lstsq(basis, get_basis(normals)[:, :9] @ sh, rcond=None)[0]
        error = np.abs(found - expected).max() / expected[0].max()
        print('# %-30s %.2g of L00' % (os.path.basename(path), error))
        assert error < 0.02, error


def skip_reason(test):
    if test is not test_noise_of_any_size and not MAPS:
        return 'GNOMON_DATA names no folder with hdr/equirect/*.hdr'
    if test is test_cmgen and not shutil.which('cmgen'):
        return 'there is no cmgen: apt-get install libfilament-tools'
    return None


def main():
    tests = [test_noise_of_any_size, test_photographs, test_irradiance_of_photographs, test_cmgen]
    n_failed = 0
    print('1..%d' % len(tests), flush=True)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for i, test in enumerate(tests, 1):
            reason = skip_reason(test)
            if reason:
                print('ok %d - %s # SKIP %s' % (i, test.__name__, reason))
                continue
            try:
                test()
                print('ok %d - %s' % (i, test.__name__), flush=True)
            except (AssertionError, subprocess.CalledProcessError) as error:
                n_failed += 1
                print('not ok %d - %s\n# %s' % (i, test.__name__, error), flush=True)
        os.chdir('/')
    sys.exit(n_failed > 0)


main()
