# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""unpack_kernel.py BZIMAGE VMLINUX: takes the ELF kernel out of a compressed one.

QEMU starts it directly (PVH), so that the emulated processor need not decompress it. Where it is
compressed by something else than xz, it is copied as it is: slower, and right all the same.
Source: Documentation/x86/boot.rst of the kernel, protocol 2.08.
"""
import lzma
import struct
import sys

with open(sys.argv[1], 'rb') as image:
    data = image.read()
setup_sectors = data[0x1f1] or 4
offset, length = struct.unpack_from('<II', data, 0x248)
start = (setup_sectors + 1) * 512 + offset
payload = data[start:start + length]
if data[0x202:0x206] == b'HdrS' and payload.startswith(b'\xfd7zXZ'):
    data = lzma.LZMADecompressor().decompress(payload)
with open(sys.argv[2], 'wb') as out:
    out.write(data)
