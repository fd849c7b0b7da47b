#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Writes a text file as a C array: embed.py NAME INPUT OUTPUT."""
import sys

name, source, target = sys.argv[1:]
data = open(source, 'rb').read() + b'\0'
with open(target, 'w') as out:
    out.write('/* made from %s */\n#include "server/http/page.h"\nconst char %s[] = {\n'
              % (source.rsplit('/', 1)[-1], name))
    for i in range(0, len(data), 20):
        # Values beyond 127 do not fit a signed char: written as what they become.
        out.write(','.join(str(b - 256 if b > 127 else b) for b in data[i:i + 20]) + ',\n')
    out.write('};\n')
