# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Several probes light one room: their light is blended by place, and each may come and go."""
import json
import sys
import time

sys.path.insert(0, sys.argv[2])
from gnomond import *  # noqa: E402,F403

PLACES = {'red': -0.5, 'middle': 0, 'blue': 0.5}  # x, m
CUBE_AT = '{"mesh": "cube.obj", "role": "virtual", "world_from_object": ' \
    '[1,0,0,%g, 0,1,0,0, 0,0,1,0, 0,0,0,1]}'
SCENE = '{"objects": [{"mesh": "floor.obj", "role": "real"}, %s]}' % \
    ', '.join(CUBE_AT % x for x in PLACES.values())
COLORS = {'red': (1, .05, .05), 'green': (.05, 1, .05), 'blue': (.05, .05, 1)}


def light_at(client, color, x, sequence=1):
    """All of the sphere in one colour, seen from (x, 0, 0.2)."""
    pose = pb.Transform(orientation=[1, 0, 0, 0], position_m=[x, 0, .2])
    light_up(client, sequence, world_from_probe=pose,
             pixels=struct.pack('<3f', *COLORS[color]) * (32 * 16))


def read_room(daemon):
    return json.loads(daemon.get('/api/v1/status')[1])['rooms'][0]


def wait_for(daemon, condition):
    deadline = time.monotonic() + 60
    while not condition(read_room(daemon)['lit_by']):
        assert time.monotonic() < deadline, read_room(daemon)['lit_by']
        time.sleep(.02)


def look(viewer, x, sequence=0):
    """The cube's top in the middle of a picture from above x: its R, G, B, no frame lost.
    sequence: of the probe that began last, to be in the light."""
    pose = pb.Transform(orientation=[0, 1, 0, 0], position_m=[x, 0, 1])
    _, payload = viewer.expect_result(viewer.send_frame(
        pose=pose, lighting_min_sequence=sequence, lighting_wait_ms=60000))
    at = 3 * (12 * 32 + 16)
    return payload[at:at + 3]


def test_blend_and_leave():
    with Daemon(rooms=Room(scene=SCENE)) as daemon, Viewer(daemon) as viewer, \
            Viewer(daemon, want_lighting_states=True) as listener:
        red, blue = probe(daemon), probe(daemon)
        light_at(red, 'red', PLACES['red'], 7)
        first, _ = listener.expect(LIGHTING_STATE)
        alone = [look(viewer, x, 7) for x in PLACES.values()]
        assert all(c == alone[0] and c[0] > 2 * c[2] for c in alone), alone
        light_at(blue, 'blue', PLACES['blue'], 3)
        second, _ = listener.expect(LIGHTING_STATE)
        assert (first.probe, second.probe) == (red.welcome.session_id, blue.welcome.session_id)
        assert list(first.probe_position_m) == [-.5, 0, struct.unpack('f', struct.pack('f', .2))[0]]
        near_red, middle, near_blue = (look(viewer, x, 3) for x in PLACES.values())
        assert len(read_room(daemon)['lit_by']) == 2
        print('# near red %s, in the middle %s, near blue %s' %
              (list(near_red), list(middle), list(near_blue)))
        assert near_red[0] > 2 * near_red[2] and near_blue[2] > 2 * near_blue[0]
        assert abs(middle[0] - middle[2]) <= 8 and middle[0] > 2 * near_blue[0]
        assert near_red[0] == near_blue[2]  # the scene is symmetrical

        # A late subscriber gets both; the page and the metrics list them.
        with Client(daemon, pb.ROLE_PROBE, want_lighting_states=True) as late:
            got = {late.expect(LIGHTING_STATE)[0].probe for _ in range(2)}
            assert got == {red.welcome.session_id, blue.welcome.session_id}
        lit_by = {p['session']: p for p in read_room(daemon)['lit_by']}
        assert lit_by[first.probe]['position_m'] == [-.5, 0, .2]
        assert lit_by[first.probe]['sequence'] == 7 and lit_by[first.probe]['age_ms'] > 0
        assert not any(p['has_left'] for p in lit_by.values())
        metrics = daemon.get('/metrics')[1].decode()
        assert 'gnomon_probe_states_total{room="demo",session="%d"} 1' % first.probe in metrics

        # One dies: the other's light is left, at once. No frame is lost meanwhile.
        red.close()
        deadline = time.monotonic() + 60
        while look(viewer, PLACES['red'])[0] > 100:
            assert time.monotonic() < deadline
        assert all(look(viewer, x) == look(viewer, PLACES['blue']) for x in PLACES.values())
        wait_for(daemon, lambda lit_by: [p['session'] for p in lit_by] == [second.probe])
        gone, payload = listener.expect(LIGHTING_STATE)
        assert gone.gone and gone.probe == first.probe and not payload, gone
        # The last one's light stays until another comes.
        blue.close()
        wait_for(daemon, lambda lit_by: [p['has_left'] for p in lit_by] == [True])
        assert look(viewer, 0) == look(viewer, PLACES['blue']) != near_red
        with probe(daemon) as green:
            light_at(green, 'green', 0)
            r, g, b = look(viewer, 0, 1)
            assert g > 2 * r and g > 2 * b
            assert [p['session'] for p in read_room(daemon)['lit_by']] == [green.welcome.session_id]


def test_bounded():
    """Eight probes light a room; a ninth is told, and lights it once one has left."""
    with Daemon(rooms=Room(scene=SCENE)) as daemon, Viewer(daemon) as viewer:
        probes = [probe(daemon) for _ in range(9)]
        for i, client in enumerate(probes[:8]):
            light_at(client, 'red', .1 * i)
        wait_for(daemon, lambda lit_by: len(lit_by) == 8)
        light_at(probes[8], 'green', 0)
        error, _ = probes[8].expect(ERROR)
        assert error.code == pb.ERROR_CODE_FULL and not error.fatal and '8 probes' in error.sentence
        look(viewer, 0)
        probes[0].close()
        wait_for(daemon, lambda lit_by: len(lit_by) == 7)
        light_at(probes[8], 'green', 0, 2)
        wait_for(daemon, lambda lit_by: len(lit_by) == 8)
        for client in probes:
            client.close()


def test_fair():
    """Of two probes that flood the room neither starves the other: they take turns."""
    with Daemon(rooms=Room(scene=SCENE)) as daemon, probe(daemon) as one, probe(daemon) as other, \
            Viewer(daemon, want_lighting_states=True) as listener:
        over = threading.Event()

        def flood(client, color):
            sequence = 0
            while not over.is_set():
                sequence += 1
                light_at(client, color, 0, sequence)

        senders = [threading.Thread(target=flood, args=args, daemon=True)
                   for args in ((one, 'red'), (other, 'blue'))]
        for sender in senders:
            sender.start()
        for _ in range(100):
            listener.expect(LIGHTING_STATE)
        over.set()
        for sender in senders:
            sender.join()
        room = read_room(daemon)
        published = [p['published'] for p in room['lit_by']]
        print('# published %s' % published)
        assert len(published) == 2 and min(published) >= sum(published) / 4, published
        assert room['environment_frames_superseded'] > 0


def test_clipped_rails_are_said_once():
    """A saturated sun: in the status each time, in the log once."""
    dark = struct.pack('<H', 1000) * (32 * 16)
    sun = dark[:600] + struct.pack('<H', 4095) * 5 + dark[610:]
    response = pb.Response(type=pb.RESPONSE_TYPE_LOG, log_a=.6, log_b=.08, log_c=.01)
    with Daemon(rooms=Room(scene=SCENE)) as daemon, Viewer(daemon) as viewer, \
            probe(daemon) as lamp:
        for sequence, pixels, clipped in ((1, dark, 0), (2, sun, 5), (3, sun, 5), (4, dark, 0)):
            light_up(lamp, sequence, pixels=pixels, pixel_format=pb.PIXEL_FORMAT_MONO12,
                     response=response)
            viewer.expect_result(viewer.send_frame(lighting_min_sequence=sequence,
                                                   lighting_wait_ms=60000))
            lit_by, = read_room(daemon)['lit_by']
            assert lit_by['clipped_texels'] == clipped and lit_by['mended_texels'] == 0, lit_by
        assert daemon.read_log().count('5 clipped pixels') == 1, daemon.read_log()


def test_one_place_is_told():
    """Two in one place, as two without a position are: in the log once, in the status while it lasts."""
    with Daemon(rooms=Room(scene=SCENE)) as daemon, Viewer(daemon) as viewer, \
            probe(daemon) as one, probe(daemon) as other:
        ids = [one.welcome.session_id, other.welcome.session_id]
        light_at(one, 'red', .2)
        look(viewer, 0, 1)
        light_at(other, 'blue', .205)
        for sequence, x, is_same in ((2, .205, True), (3, .195, True), (4, .3, False), (5, .2, True)):
            light_at(other, 'blue', x, sequence)
            look(viewer, 0, sequence)
            told = {p['session']: p['same_place_as'] for p in read_room(daemon)['lit_by']}
            assert told == {ids[0]: ids[1:] * is_same, ids[1]: ids[:1] * is_same}, (x, told)
        light_at(one, 'red', .2, 2)  # the other's line was this one's, too
        wait_for(daemon, lambda lit_by: 2 in [p['sequence'] for p in lit_by])
        log = [line for line in daemon.read_log().splitlines() if 'the mean of both' in line]
        assert len(log) == 1, log
        assert ' WARN ' in log[0] and 'room demo: session %d (test) lights the room from the same place as session %d' % (
            ids[1], ids[0]) in log[0] and '"position"' in log[0], log


run_tests([test_one_place_is_told, test_clipped_rails_are_said_once, test_blend_and_leave, test_bounded, test_fair])
