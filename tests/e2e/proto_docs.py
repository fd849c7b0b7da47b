#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""PROTOCOL.md says the same as gnomon.proto, gnomon.options and the code.

usage: proto_docs.py PROTO_TOOL DIRECTORY_OF_GNOMON_PB2 DIRECTORY_OF_PROTOCOL_MD
"""
import re
import struct
import subprocess
import sys

sys.path.insert(0, sys.argv[2])
import gnomon_pb2 as pb  # noqa: E402
from google.protobuf.descriptor import FieldDescriptor as F  # noqa: E402

PAGE = open(sys.argv[3] + '/PROTOCOL.md', encoding='utf-8').read()
OPTIONS = open(sys.argv[3] + '/gnomon.options', encoding='utf-8').read()
PROTO = open(sys.argv[3] + '/gnomon.proto', encoding='utf-8').read()
TOOL = [line.split('\t') for line in
        subprocess.run([sys.argv[1], 'table'], capture_output=True, check=True, timeout=60)
        .stdout.decode().splitlines()]
TYPE_NAMES = {getattr(F, name): name[5:].lower() for name in dir(F) if name.startswith('TYPE_')}


def section(name):
    """Rows of the table under a heading: lists of cells."""
    found = re.search(r'^#### %s(?: \(enum\))?\n(.*?)(?=^#|\Z)' % re.escape(name), PAGE, re.M | re.S)
    assert found, 'PROTOCOL.md has no section %s' % name
    rows = [[cell.strip() for cell in line.strip('|').split('|')]
            for line in found.group(1).replace('\\|', ' ').splitlines() if line.startswith('|')]
    return rows[2:]


def field_type(message, field):
    bound = re.search(r'^gn_msg\.%s\.%s\s+(.*)$' % (message.name, field.name), OPTIONS, re.M)
    bound = dict(item.split(':') for item in bound.group(1).split()) if bound else {}
    if field.type == F.TYPE_MESSAGE:
        text = field.message_type.name
    elif field.type == F.TYPE_ENUM:
        text = field.enum_type.name
    else:
        text = TYPE_NAMES[field.type]
    if field.type == F.TYPE_STRING:
        text += ' ≤ %d B' % (int(bound['max_size']) - 1)
    elif field.type == F.TYPE_BYTES:
        text += ' ≤ %s B' % bound['max_size']
    if field.label == F.LABEL_REPEATED:
        text += (' × ' if 'fixed_count' in bound else ' × ≤ ') + bound['max_count']
    return text


def check_fields():
    for message in pb.DESCRIPTOR.message_types_by_name.values():
        rows = section(message.name)
        want = [[str(f.number), '`%s`' % f.name, field_type(message, f)] for f in message.fields]
        assert [row[:3] for row in rows] == want, '%s: the page has %s, the code %s' % (
            message.name, [row[:3] for row in rows if row[:3] not in want],
            [row for row in want if row not in [r[:3] for r in rows]])
        assert all(len(row) == 4 and row[3] for row in rows), '%s: a field has no meaning' % message.name


def check_enums():
    for enum in pb.DESCRIPTOR.enum_types_by_name.values():
        want = [[str(v.number), '`%s`' % v.name] for v in enum.values]
        assert [row[:2] for row in section(enum.name)] == want, enum.name


def check_sentences():
    for kind, enum in (('error', 'ErrorCode'), ('drop', 'DropReason'), ('bye', 'ByeReason')):
        want = {row[1]: row[2] for row in TOOL if row[0] == kind}
        got = {row[0]: row[2] for row in section(enum) if row[0] != '0'}
        assert want == got, '%s: %s' % (enum, set(want.items()) ^ set(got.items()))


def check_types_and_limits():
    way = {'1': 'client → server', '2': 'server → client', '3': 'both'}
    for row in TOOL:
        if row[0] == 'type':
            line = '| %s | %s | %s | %s | %s |' % (row[1], row[2], way[row[3]], row[4], row[5])
            assert line in PAGE, 'PROTOCOL.md lacks: ' + line
    assert len([row for row in TOOL if row[0] == 'type']) == len(re.findall(
        r'^\| \d+ \| [A-Z_]+ \| (?:client|server|both)', PAGE, re.M))


def check_example():
    block = re.search(r'### A worked example.*?```\n(.*?)```', PAGE, re.S).group(1)
    data = bytes(int(byte, 16) for line in block.splitlines() for byte in line[:36].split())
    hello = pb.Hello(version_min=1, version_max=1, client_name='demo', role=pb.ROLE_VIEWER)
    header = hello.SerializeToString()
    assert data == struct.pack('<4sBBHIII', b'GNOM', 1, 0, 1, 0, len(header), 0) + header
    assert '%d bytes in all' % len(data) in PAGE
    done = subprocess.run([sys.argv[1], 'echo'], input=data, capture_output=True, timeout=60)
    assert done.returncode == 0 and done.stdout == data, done.stderr


def check_rules_of_the_proto():
    """wire_walk.c takes every fixed-size value for a float."""
    code = re.sub(r'//.*', '', PROTO)
    assert not re.search(r'\bs?fixed(32|64)\b', code)
    assert not re.search(r'\bs?int32\b|\bsint64\b|\boneof\b|\bmap<', code)


CASES = [check_fields, check_enums, check_sentences, check_types_and_limits, check_example,
         check_rules_of_the_proto]
print('1..%d' % len(CASES))
failed = False
for i, case in enumerate(CASES, 1):
    try:
        case()
        print('ok %d - %s' % (i, case.__name__))
    except Exception as problem:  # every case is reported
        failed = True
        print('not ok %d - %s' % (i, case.__name__))
        print('#', repr(problem))
sys.exit(1 if failed else 0)
