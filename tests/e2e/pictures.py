# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""PNG and EXR with nothing but the standard library: apart from the code under test."""
import struct
import zlib

PNG_HEAD = b'\x89PNG\r\n\x1a\n'


def png_bytes(width, height, pixels, channels=3, bits=8):
    """pixels: rows of samples, 16-bit ones big-endian."""
    def chunk(kind, data):
        return struct.pack('>I', len(data)) + kind + data + \
            struct.pack('>I', zlib.crc32(kind + data))
    color = {1: 0, 3: 2, 4: 6}[channels]
    stride = width * channels * bits // 8
    assert len(pixels) == stride * height, len(pixels)
    rows = b''.join(b'\0' + pixels[y * stride:(y + 1) * stride] for y in range(height))
    return PNG_HEAD + chunk(b'IHDR', struct.pack('>IIBBBBB', width, height, bits, color, 0, 0, 0)) + \
        chunk(b'IDAT', zlib.compress(rows)) + chunk(b'IEND', b'')


def read_png(path):
    """Width, height and the bytes of an 8-bit RGB PNG (PNG specification, section 9: filters)."""
    data = open(path, 'rb').read()
    assert data[:8] == PNG_HEAD, path
    at, packed = 8, b''
    while at < len(data):
        n, kind = struct.unpack('>I4s', data[at:at + 8])
        body = data[at + 8:at + 8 + n]
        assert struct.unpack('>I', data[at + 8 + n:at + 12 + n])[0] == zlib.crc32(kind + body)
        if kind == b'IHDR':
            width, height, bits, color, _, _, interlace = struct.unpack('>IIBBBBB', body)
            assert (bits, color, interlace) == (8, 2, 0)
        elif kind == b'IDAT':
            packed += body
        at += 12 + n
    rows, stride = zlib.decompress(packed), 3 * width
    above, out = bytearray(stride), bytearray()
    for y in range(height):
        kind, row = rows[y * (stride + 1)], bytearray(rows[y * (stride + 1) + 1:][:stride])
        for x in range(stride):
            left, up = (row[x - 3] if x >= 3 else 0), above[x]
            corner = above[x - 3] if x >= 3 else 0
            if kind == 4:
                p = left + up - corner
                guess = min((abs(p - left), 0, left), (abs(p - up), 1, up),
                            (abs(p - corner), 2, corner))[2]
            else:
                guess = (0, left, up, (left + up) // 2)[kind]
            row[x] = (row[x] + guess) & 255
        above = row
        out += row
    return width, height, bytes(out)


def exr_bytes(width, height, rgb):
    """A scanline EXR of float32 R, G, B, uncompressed, every pixel the same rgb."""
    def attribute(name, kind, data):
        return name.encode() + b'\0' + kind.encode() + b'\0' + struct.pack('<I', len(data)) + data
    channels = b''.join(c + b'\0' + struct.pack('<iBBBBii', 2, 0, 0, 0, 0, 1, 1)
                        for c in (b'B', b'G', b'R')) + b'\0'
    window = struct.pack('<4i', 0, 0, width - 1, height - 1)
    head = struct.pack('<II', 20000630, 2) + b''.join((
        attribute('channels', 'chlist', channels),
        attribute('compression', 'compression', b'\0'),
        attribute('dataWindow', 'box2i', window),
        attribute('displayWindow', 'box2i', window),
        attribute('lineOrder', 'lineOrder', b'\0'),
        attribute('pixelAspectRatio', 'float', struct.pack('<f', 1)),
        attribute('screenWindowCenter', 'v2f', struct.pack('<2f', 0, 0)),
        attribute('screenWindowWidth', 'float', struct.pack('<f', 1)))) + b'\0'
    row = b''.join(struct.pack('<f', rgb[c]) * width for c in (2, 1, 0))
    first, block = len(head) + 8 * height, 8 + len(row)
    offsets = b''.join(struct.pack('<Q', first + y * block) for y in range(height))
    return head + offsets + b''.join(struct.pack('<iI', y, len(row)) + row for y in range(height))


def y4m_bytes(width, height, rate, pictures):
    """YUV4MPEG2, 4:4:4, full range, of pictures as R, G, B bytes: codes by BT.601 (JFIF 1.02)."""
    data = b'YUV4MPEG2 W%d H%d F%d:1 Ip A1:1 C444 XCOLORRANGE=FULL\n' % (width, height, rate)
    for rgb in pictures:
        planes = [bytearray(), bytearray(), bytearray()]
        for r, g, b in zip(rgb[0::3], rgb[1::3], rgb[2::3]):
            y = .299 * r + .587 * g + .114 * b
            for plane, code in zip(planes, (y, (b - y) / 1.772 + 128, (r - y) / 1.402 + 128)):
                plane.append(min(round(code), 255))
        data += b'FRAME\n' + b''.join(planes)
    return data
