#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Our encoder and decoder against Google's protobuf, which knows nothing of ours but gnomon.proto.

usage: proto_python.py PROTO_TOOL DIRECTORY_OF_GNOMON_PB2
Every message is made in Python with every field set, in two variants (ordinary values, and the longest
strings and largest numbers). Our C decodes it and prints each member of its struct by name; then it
encodes it again, and Python decodes that. Both must have the same fields with the same values.
"""
import math
import struct
import subprocess
import sys

sys.path.insert(0, sys.argv[2])
import gnomon_pb2 as pb  # noqa: E402
from google.protobuf.descriptor import FieldDescriptor as F  # noqa: E402

TOOL = sys.argv[1]
# Written apart from the C table on purpose, as PROTOCOL.md has it.
TYPES = {
    1: 'Hello', 2: 'Welcome', 3: 'Redirect', 4: 'Error', 5: 'Bye', 6: 'Ping', 7: 'Pong',
    16: 'EnvironmentFrame', 17: 'Pose', 18: 'Camera', 19: 'Frame', 20: 'EmitterFrame',
    32: 'Result', 33: 'Dropped', 34: 'LightingState', 35: 'Statistics',
}
NAMES = {'EnvironmentFrame': 'ENVIRONMENT_FRAME', 'EmitterFrame': 'EMITTER_FRAME',
         'LightingState': 'LIGHTING_STATE'}


def f32(x):
    return struct.unpack('<f', struct.pack('<f', x))[0]


# What the meaning of a field asks for; anything else gets a number of its own from the counter.
# name: (ordinary, extreme)
FIXED = {
    'Hello.version_min': (1, 2**32 - 1), 'Hello.version_max': (3, 2**32 - 1),
    'Redirect.port': (7340, 65535), 'Response.gamma': (2.2, 10.0),
    'Response.type': (pb.RESPONSE_TYPE_LOG, pb.RESPONSE_TYPE_LOG),
    'Response.log_b': (0.07, 1e300), 'Response.table_entries': (0, 0),
    'Projection.type': (pb.PROJECTION_TYPE_KANNALA_BRANDT,) * 2,
    'Projection.theta_max': (1.5, math.pi), 'EnvironmentFrame.pixel_format': (pb.PIXEL_FORMAT_RGB16,
                                                                              pb.PIXEL_FORMAT_MONO12),
    'EmitterFrame.width': (5, 2048), 'EmitterFrame.height': (3, 2), 'EmitterFrame.pixel_format': (
        pb.PIXEL_FORMAT_RGB8, pb.PIXEL_FORMAT_RGB_F16),
    'EnvironmentFrame.width': (5, 8192), 'EnvironmentFrame.height': (3, 2), 'Pose.confidence': (0.5, 1.0),
    'Camera.index': (2, 3), 'Camera.width': (640, 8192), 'Camera.height': (480, 8192),
    'Camera.noise_slope': (1e-3, 1.0), 'Camera.noise_offset': (1e-6, 1.0), 'Camera.blur_px': (0.7, 8.0),
    'Frame.jpeg_quality': (85, 100), 'Frame.budget_ms': (33.0, 60000.0),
    'Frame.lighting_wait_ms': (250, 60000),
    'FrameView.camera': (1, 3), 'ResultView.width': (4, 4), 'ResultView.height': (2, 2),
    'ResultView.format': (pb.PICTURE_FORMAT_RGB8,) * 2, 'ResultView.payload_length': (24, 24),
    'FrameView.payload_length': (10, 10),
    'LightingState.light_count': (3, 5), 'LightingState.map_width': (4, 6),
    'LightingState.map_height': (2, 3),
}
COUNTS = {'orientation': 4, 'position_m': 3, 'matrix_to_rec709': 9, 'noise_slope': 3, 'noise_offset': 3, 'sh': 27,
          'probe_position_m': 3}
STRING_BYTES = {  # without the NUL of C
    'Hello.client_name': 63, 'Hello.client_version': 31, 'Hello.token': 255, 'Hello.room': 63,
    'Welcome.server_name': 63, 'Welcome.server_version': 31, 'Welcome.room': 63, 'Redirect.host': 255,
    'Error.sentence': 511, 'Bye.sentence': 255, 'Pose.object': 63, 'LeftOut.pass': 31,
    'LeftOut.why': 127, 'Dropped.sentence': 255, 'LightingState.room': 63, 'LightingState.node': 63,
    'Statistics.room': 63, 'EmitterFrame.stream': 63,
}
BYTES_BYTES = {'Hello.resume_token': 32, 'Hello.ticket': 64, 'Welcome.resume_token': 32,
               'Redirect.ticket': 64}
EXTREMES = {F.TYPE_UINT32: 2**32 - 1, F.TYPE_UINT64: 2**64 - 1, F.TYPE_INT64: -2**63}
MUST_BE_ZERO = {'Camera.response.table_entries',  # no table can travel with a camera
                'EmitterFrame.response.table_entries'}
COUNTER = [10]


def scalar(field, extreme):
    key = field.containing_type.name + '.' + field.name
    COUNTER[0] += 1
    n = COUNTER[0]
    if key in FIXED:
        value = FIXED[key][extreme]
        return f32(value) if field.type == F.TYPE_FLOAT else value
    if field.type == F.TYPE_ENUM:
        values = [v.number for v in field.enum_type.values]
        return values[-1] if extreme else values[1]
    if field.type == F.TYPE_BOOL:
        return True
    if field.type == F.TYPE_STRING:
        # Two-byte characters, so that a cut in the middle of one would show.
        limit = STRING_BYTES[key]
        return 'ü' * (limit // 2) + 'x' * (limit % 2) if extreme else 'text %d é' % n
    if field.type == F.TYPE_BYTES:
        return bytes(range(BYTES_BYTES[key])) if extreme else bytes([n % 256, 0, 255])
    if field.type in EXTREMES and extreme:
        return EXTREMES[field.type]
    if field.type == F.TYPE_FLOAT:
        return f32(3.4028234e38) if extreme else f32(n + 0.1)
    if field.type == F.TYPE_DOUBLE:
        return 1e6 if extreme and n % 2 else n + 0.1
    return n


def fill(message, extreme):
    for field in message.DESCRIPTOR.fields:
        repeated = field.label == F.LABEL_REPEATED
        if field.type == F.TYPE_MESSAGE:
            # (the most that the bounds allow, or two)
            count = (4 if field.name == 'views' else 16) if extreme else 2
            for i in range(count if repeated else 1):
                child = getattr(message, field.name).add() if repeated else getattr(message, field.name)
                fill(child, extreme)
                if field.name == 'views':
                    child.payload_offset = child.payload_length * (count - i)
        elif field.name == 'orientation':
            message.orientation.extend([0.5, -0.5, 0.5, -0.5] if extreme else [0.6, 0.0, -0.8, 0.0])
        elif field.name == 'discs':
            message.discs.extend([0, 4] if extreme else [2])  # of light_count
        elif repeated:
            getattr(message, field.name).extend(scalar(field, extreme) for _ in range(COUNTS[field.name]))
        else:
            setattr(message, field.name, scalar(field, extreme))


def variants(name):
    """Ordinary, extreme, and what those two cannot have at once."""
    made = []
    for extreme in (0, 1):
        message = getattr(pb, name)()
        fill(message, extreme)
        made.append(message)
    if name == 'EnvironmentFrame':
        message = pb.EnvironmentFrame()
        message.CopyFrom(made[0])
        message.response.type = pb.RESPONSE_TYPE_TABLE
        message.response.table_entries = 4096
        made.append(message)
    return made


def payload_bytes(m):
    if isinstance(m, pb.EnvironmentFrame):
        size = {pb.PIXEL_FORMAT_RGB16: 6, pb.PIXEL_FORMAT_MONO12: 2}[m.pixel_format]
        return m.response.table_entries * 4 + m.width * m.height * size
    if isinstance(m, pb.EmitterFrame):
        return m.width * m.height * {pb.PIXEL_FORMAT_RGB8: 3, pb.PIXEL_FORMAT_RGB_F16: 6}[m.pixel_format]
    if isinstance(m, pb.LightingState):
        return 32 * m.light_count + 6 * m.map_width * m.map_height
    if isinstance(m, (pb.Frame, pb.Result)):
        return max(v.payload_offset + v.payload_length for v in m.views)
    return 0


def frame_bytes(number, message):
    """The envelope, written from PROTOCOL.md."""
    header = message.SerializeToString()
    payload = bytes(i % 251 for i in range(payload_bytes(message)))
    return struct.pack('<4sBBHIII', b'GNOM', 1, 0, number, 0, len(header), len(payload)) + header + payload


def parse(stream):
    """Yields (type number, message, payload) from bytes, strictly."""
    while stream:
        magic, version, flags, number, channel, header, payload = struct.unpack('<4sBBHIII', stream[:20])
        assert (magic, version, flags, channel) == (b'GNOM', 1, 0, 0), stream[:20]
        assert len(stream) >= 20 + header + payload
        message = getattr(pb, TYPES[number])()
        message.ParseFromString(stream[20:20 + header])
        assert len(message.UnknownFields()) == 0, 'fields that gnomon.proto does not have'
        yield number, message, stream[20 + header:20 + header + payload]
        stream = stream[20 + header + payload:]


def flatten(path, message, out):
    """Each field as proto_tool prints it."""
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        items = [(path + '.' + field.name, value)]
        if field.label == F.LABEL_REPEATED:
            items = [('%s.%s[%d]' % (path, field.name, i), v) for i, v in enumerate(value)]
        elif field.type == F.TYPE_MESSAGE and not message.HasField(field.name):
            continue
        for item_path, item in items:
            if field.type == F.TYPE_MESSAGE:
                flatten(item_path, item, out)
            elif field.type == F.TYPE_STRING:
                out[item_path] = item.encode().hex()
            elif field.type == F.TYPE_BYTES:
                out[item_path] = item.hex()
            elif field.type in (F.TYPE_FLOAT, F.TYPE_DOUBLE):
                out[item_path] = float(item)
            else:
                out[item_path] = int(item)


def read_dump(text):
    out = {}
    for line in text.splitlines():
        path, value = line.split('=', 1)
        out.setdefault(path, []).append(value)
    return out


def same(want, got):
    if isinstance(want, str):
        return want == got
    if isinstance(want, float):
        return want == float.fromhex(got)
    return want == int(got)


def run(mode, data):
    done = subprocess.run([TOOL, mode], input=data, capture_output=True, timeout=60)
    return done.returncode, done.stdout, done.stderr.decode()


def unset_fields(path, message):
    """Fields that still have their default."""
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        if field.type == F.TYPE_MESSAGE:
            for item in value if field.label == F.LABEL_REPEATED else [value]:
                yield from unset_fields(path + '.' + field.name, item)
        elif field.label != F.LABEL_REPEATED and value == field.default_value:
            yield path + '.' + field.name


def check(number, name):
    compared = 0
    never_set = None
    for message in variants(name):
        unset = set(unset_fields(name, message))
        never_set = unset if never_set is None else never_set & unset
        data = frame_bytes(number, message)
        code, out, err = run('dump', data)
        assert code == 0, '%s: our decoder refuses it: %s' % (name, err)
        want = {}
        flatten(NAMES.get(name, name.upper()), message, want)
        got = read_dump(out.decode())
        assert set(want) == set(got), '%s: fields differ: %s' % (name, set(want) ^ set(got))
        for path, value in want.items():
            assert len(got[path]) == 1 and same(value, got[path][0]), \
                '%s: Python has %r, C %r' % (path, value, got[path])
        compared += len(want)
        code, out, err = run('echo', data)
        assert code == 0, '%s: our encoder fails: %s' % (name, err)
        (back_number, back, payload), = parse(out)
        assert back_number == number and back == message, '%s: came back as\n%s' % (name, back)
        assert payload == data[len(data) - len(payload):] and len(payload) == payload_bytes(message)
    assert never_set <= MUST_BE_ZERO, '%s: no variant sets %s' % (name, never_set)
    return compared


def check_refusals():
    """Python can write what we must not take."""
    frame = variants('Frame')[0]
    frame.views[0].world_from_camera.position_m[1] = math.nan
    code, _, err = run('dump', frame_bytes(19, frame))
    assert code == 1 and 'FRAME.views[0].world_from_camera.position_m[1]' in err, err
    hello = variants('Hello')[0]
    hello.room = 'r' * 64
    code, _, err = run('dump', frame_bytes(1, hello))
    assert code == 1 and 'HELLO' in err, err
    frame = variants('Frame')[0]
    for _ in range(3):
        frame.views.add().CopyFrom(frame.views[0])
    code, _, err = run('dump', frame_bytes(19, frame))
    assert code == 1 and 'FRAME' in err, err


def check_later_version():
    """A field that this version does not know is skipped."""
    ping = pb.Ping(t1_ns=5)
    header = ping.SerializeToString() + b'\xfa\x07\x03new'  # field 127, bytes
    data = struct.pack('<4sBBHIII', b'GNOM', 1, 0, 6, 0, len(header), 0) + header
    code, out, err = run('dump', data)
    assert code == 0 and out == b'PING.t1_ns=5\n', (out, err)


def check_presence():
    """A count of 0 is another thing than none, which is what a server sends that does not know it."""
    for value in (None, 0, 9120):
        result = variants('Result')[0]
        result.receipt.ClearField('virtual_pixels')
        if value is not None:
            result.receipt.virtual_pixels = value
        data = frame_bytes(32, result)
        dump = read_dump(run('dump', data)[1].decode())
        assert dump.get('RESULT.receipt.virtual_pixels') == (None if value is None else [str(value)]), dump
        (_, back, _), = parse(run('echo', data)[1])
        assert back == result and back.receipt.HasField('virtual_pixels') == (value is not None), back


CASES = [(name, lambda number=number, name=name: check(number, name)) for number, name in TYPES.items()]
CASES += [('refusals', check_refusals), ('later version', check_later_version),
          ('presence', check_presence)]
print('1..%d' % len(CASES))
failed = False
for i, (title, case) in enumerate(CASES, 1):
    try:
        compared = case()
        print('ok %d - %s%s' % (i, title, ': %d values each way' % compared if compared else ''))
    except Exception as problem:  # every case is reported
        failed = True
        print('not ok %d - %s' % (i, title))
        for line in repr(problem).split('\\n'):
            print('#', line)
sys.exit(1 if failed else 0)
