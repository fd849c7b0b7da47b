# SPDX-FileCopyrightText: 2026 the Gnomon authors
# SPDX-License-Identifier: ISC
"""Frames through a real daemon: each id once, in the right light, with a whole receipt."""
import json
import struct
import sys
import time

sys.path.insert(0, sys.argv[2])
from gnomond import *  # noqa: E402,F403


def test_composite_and_receipt():
    with Daemon() as daemon, probe(daemon) as light, Viewer(daemon) as viewer:
        light_up(light, 7)
        frame_id = viewer.send_frame(lighting_min_sequence=7, lighting_wait_ms=60000)
        result, payload = viewer.expect_result(frame_id)
        view, receipt = result.views[0], result.receipt
        assert (view.format, view.width, view.height) == (pb.PICTURE_FORMAT_RGB8, 32, 24), view
        assert view.payload_length == len(payload) == 32 * 24 * 3
        corner, middle = payload[:3], payload[3 * (12 * 32 + 16):][:3]
        assert middle != b'\x80\x80\x80', 'no cube in the middle'
        # Far from the cube the shadow is faint: at most a few codes.
        assert all(abs(c - 128) <= 24 for c in corner), corner
        assert receipt.lighting_sequence == 7 and receipt.lights_used > 0
        assert receipt.rays_primary > 0 and receipt.rays_shadow > 0
        assert abs(receipt.lighting_age_ms) < 60000 and receipt.queue_ms >= 0
        assert receipt.primary_ms > 0 and receipt.composite_ms > 0
        assert receipt.quality == pb.QUALITY_INTERACTIVE
        assert result.capture_time_ns > 0


def test_lamp_in_the_scene():
    """A room that no probe lights: a lamp of scene.json throws the cube's shadow to the other side."""
    scene = SCENE[:-1] + ', "lights": [{"type": "point", "position": [0.6, 0, 0.6],' \
        ' "intensity": [3, 3, 3]}]}'
    with Daemon(rooms=Room(scene=scene)) as daemon, Viewer(daemon, 64, 48) as viewer:
        result, payload = viewer.expect_result(viewer.send_frame(lighting_wait_ms=60000))
        row = [payload[3 * (24 * 64 + x)] for x in range(64)]
        left = [x for x in range(32) if row[x] == 0]
        print('# row through the cube: %s' % row)
        assert len(left) >= 3, 'no shadow to the left of the cube'
        assert all(code == 128 for code in row[44:]), 'a shadow towards the lamp'
        assert result.receipt.lights_used == 1
        assert result.receipt.lighting_sequence == 0
    with Daemon() as daemon, Viewer(daemon) as viewer:
        viewer.expect_dropped(viewer.send_frame(), pb.DROP_REASON_NO_LIGHTING)


def test_budget():
    """What no machine can do, and what each can: no time is looked at."""
    def watch(viewer, n, **fields):
        results = [viewer.expect_result(viewer.send_frame(lighting_wait_ms=60000, **fields))[0]
                   for _ in range(n)]
        return [r.receipt for r in results]

    with Daemon('budget-ms = 0.001\nrefine = false') as daemon, probe(daemon) as light, Viewer(daemon) as viewer:
        light_up(light)
        receipts = watch(viewer, 20, budget_ms=50)  # the shorter one counts
        assert all(abs(r.budget.budget_ms - 0.001) < 1e-9 for r in receipts), receipts[0].budget
        assert receipts[0].budget.verdict == pb.BUDGET_VERDICT_LEARNS
        assert receipts[0].budget.predicted_ms < 0
        last = receipts[-1].budget
        assert last.verdict == pb.BUDGET_VERDICT_TOO_SMALL and last.predicted_ms > 0.001, last
        assert (last.lights, last.grid) == (4, 1) and last.misses == 20, last
        assert last.busy_ms > 0.001
        # The next light is made in the number that the only viewer wants, though it is the same;
        # some that go are still fading.
        before = json.loads(daemon.get('/api/v1/status')[1])['rooms'][0]['light']['lights']
        light_up(light, 2)
        receipt = watch(viewer, 1, lighting_min_sequence=2)[0]
        room = json.loads(daemon.get('/api/v1/status')[1])['rooms'][0]
        print('# of %d lights, for a budget of 4: %d' % (before, room['light']['lights']))
        assert receipt.lighting_sequence == 2 and before > 100, before
        assert 1 <= room['light']['lights'] <= 20, room['light']
        assert not watch(viewer, 1, quality=pb.QUALITY_SEED)[0].HasField('budget')
        room = json.loads(daemon.get('/api/v1/status')[1])['rooms'][0]
        assert room['budget']['frames'] == room['budget']['misses'] == 21, room['budget']
        assert room['last_receipt']['budget'] is None
        assert b'gnomon_budget_misses_total{room="demo"} 21' in daemon.get('/metrics')[1]
    with Daemon('refine = false') as daemon, probe(daemon) as light, \
            Viewer(daemon, 64, 48) as viewer:
        light_up(light)
        assert not watch(viewer, 1)[0].HasField('budget')
        receipts = watch(viewer, 40, budget_ms=60000)
        last = receipts[-1].budget
        assert last.verdict == pb.BUDGET_VERDICT_FITS and last.misses == 0, last
        assert (last.lights, last.grid, last.shadow_step) == (64, 3, 1), last
        assert last.busy_ms < last.budget_ms and last.switches > 0
        assert receipts[-1].estimated_error > 0 and last.predicted_error > 0, receipts[-1]
        status = json.loads(daemon.get('/api/v1/status')[1])['rooms'][0]['last_receipt']['budget']
        assert status['verdict'] == 'fits' and status['setting']['lights'] == 64, status


def why_not_refined(receipt):
    return [line.why for line in getattr(receipt, 'left_out') if getattr(line, 'pass') == 'progressive']


def test_what_is_not_asked_for():
    """Objects and shadows are switched frame by frame, each by itself, and the receipt says so."""
    def see(viewer, **fields):
        result, payload = viewer.expect_result(viewer.send_frame(**fields))
        spared = {getattr(line, 'pass') for line in result.receipt.left_out if line.why == 'not asked for'}
        middle = 3 * (24 * 64 + 32)
        # A pixel of the floor beside the cube, another behind it.
        return spared, payload[middle - 3 * 11:][:3], payload[middle:][:3], payload, result.receipt

    grey = b'\x80\x80\x80'
    with Daemon() as daemon, probe(daemon) as light, Viewer(daemon, 64, 48) as viewer:
        light_up(light)
        spared, beside, on, whole, whole_receipt = see(viewer, lighting_min_sequence=1, lighting_wait_ms=60000)
        assert not spared and max(beside) < 128 and on != grey, (spared, beside, on)
        shown = whole_receipt.virtual_pixels
        assert 100 < shown < 64 * 48 / 2, shown
        spared, _, on_alone, alone, receipt = see(viewer, no_shadow=True)
        assert 'shadow' in spared and 'shade' not in spared and on_alone != grey
        assert alone[:3 * 64] == grey * 64 and receipt.estimated_error <= 0, receipt
        assert receipt.virtual_pixels == shown, (receipt.virtual_pixels, shown)
        left = [why_not_refined(receipt)]
        spared, beside, on, _, _ = see(viewer, no_virtual=True)
        assert 'shade' in spared and 'shadow' not in spared, spared
        assert max(beside) < 128 and max(on) < 80, 'no deep shadow under the hidden cube: %r' % on
        _, _, _, nothing, receipt = see(viewer, no_virtual=True, no_shadow=True)
        assert nothing == grey * (64 * 48) and receipt.rays_shadow == 0
        assert receipt.HasField('virtual_pixels') and receipt.virtual_pixels == 0, receipt
        left.append(why_not_refined(receipt))
        assert left == 2 * [['other things are asked for than in the last frame']], left
        # A budget's figures are of frames that show the same.
        for _ in range(3):
            receipt = see(viewer, budget_ms=0.001)[4]
        for verdict in (pb.BUDGET_VERDICT_LEARNS, receipt.budget.verdict):
            before = receipt.budget.misses
            receipt = see(viewer, budget_ms=0.001, no_shadow=verdict == pb.BUDGET_VERDICT_LEARNS)[4]
            assert receipt.budget.verdict == pb.BUDGET_VERDICT_LEARNS, receipt.budget
            assert receipt.budget.misses == before + 1


def test_a_still_view_is_refined():
    """While nothing changes a picture gets better, says how good it is, and in the end costs nothing."""
    with Daemon() as daemon, probe(daemon) as light, Viewer(daemon) as viewer:
        def see(**fields):
            result, payload = viewer.expect_result(viewer.send_frame(**fields))
            return result.receipt, payload

        light_up(light, 1)
        receipt, first = see(lighting_min_sequence=1, lighting_wait_ms=60000)
        assert receipt.refined_passes == 0 and receipt.refined_error < 0, receipt
        shown = receipt.virtual_pixels
        assert why_not_refined(receipt) == ["the view's first frame"], receipt
        passes, errors = [], []
        while receipt.rays_primary > 0:
            receipt, payload = see()
            passes.append(receipt.refined_passes)
            errors.append(receipt.refined_error)
            # The camera's picture is each frame's own, what is put over it hardly changes.
            off = max(abs(a - b) for a, b in zip(payload, first))
            assert off <= 24, 'a pop of %d codes after %d passes' % (off, passes[-1])
            assert len(passes) < 1100, 'never done'
        print('# %d frames, %d passes, error %.4f' % (len(passes), passes[-1], errors[-1]))
        assert passes[0] == 0 and passes == sorted(passes) and passes[-1] >= 16
        known = [e for e in errors if e >= 0]
        assert errors[0] < 0 and 0 <= known[-1] < 0.5 * known[0]
        assert known[-1] <= 1e-3 or passes[-1] == 1024
        assert receipt.rays_shadow == 0 and receipt.lighting_sequence == 1
        assert receipt.virtual_pixels >= shown > 10, (receipt.virtual_pixels, shown)
        assert len(why_not_refined(receipt)) == 1
        status = json.loads(daemon.get('/api/v1/status')[1])
        assert status['rooms'][0]['last_receipt']['refined']['passes'] == passes[-1]

        dark, _ = see(picture=bytes(len(viewer.picture)))
        assert dark.refined_passes == passes[-1], 'another picture is no change'
        light_up(light, 2)  # the same light at a later time
        receipt, _ = see(lighting_min_sequence=2, lighting_wait_ms=60000)
        assert receipt.refined_passes == passes[-1] and receipt.lighting_sequence == 2
        moved = pb.Transform(orientation=[0, 1, 0, 0], position_m=[0, 0, 1.001])
        receipt, _ = see(pose=moved)
        assert receipt.refined_passes == 0 and receipt.rays_primary > 0
        assert why_not_refined(receipt) == ['the camera has moved since the last frame']
        see(pose=moved)
        light_up(light, 3, pixels=struct.pack('<f', 0.5) * (3 * 32 * 16))
        receipt, _ = see(pose=moved, lighting_min_sequence=3, lighting_wait_ms=60000)
        assert receipt.refined_passes == 0
        assert why_not_refined(receipt) == ['the light has changed since the last frame']
        receipt, _ = see(pose=moved, quality=pb.QUALITY_SEED)
        assert why_not_refined(receipt) == ["seed quality is the paper's picture, not a step to "
                                            "another"]
    with Daemon('budget-ms = 0.001') as daemon, probe(daemon) as light, Viewer(daemon) as viewer:
        light_up(light, 1)
        for i in range(12):
            receipt = viewer.expect_result(viewer.send_frame(lighting_min_sequence=1,
                                                             lighting_wait_ms=60000))[0].receipt
            assert receipt.refined_passes == 0 and receipt.HasField('budget'), receipt
            assert why_not_refined(receipt) == ["a pass takes longer than the frame's budget" if i
                                                else "the view's first frame"], receipt
    with Daemon('refine = false') as daemon, probe(daemon) as light, \
            Viewer(daemon) as viewer:
        light_up(light, 1)
        for _ in range(12):
            result, _ = viewer.expect_result(viewer.send_frame(lighting_min_sequence=1,
                                                               lighting_wait_ms=60000))
            assert result.receipt.refined_passes == 0 and result.receipt.rays_primary > 0
            assert why_not_refined(result.receipt) == ['switched off for the room']


def test_each_id_once():
    """Frames faster than they can be rendered, from three viewers: every id comes back once."""
    with Daemon() as daemon, probe(daemon) as light:
        viewers = [Viewer(daemon, 160, 120) for _ in range(3)]
        light_up(light)
        viewers[0].expect_result(viewers[0].send_frame(lighting_min_sequence=1,
                                                       lighting_wait_ms=60000))
        n = 40
        for _ in range(n):
            for viewer in viewers:
                viewer.send_frame()
        for viewer in viewers:
            first = 2 if viewer is viewers[0] else 1
            answers = [viewer.take() for _ in range(n)]
            assert sorted(m.id for _, m, _ in answers) == list(range(first, first + n))
            last = [kind for kind, m, _ in answers if m.id == viewer.last_id]
            assert last == [RESULT], 'the newest frame was lost'
            assert {m.reason for kind, m, _ in answers if kind == DROPPED} <= \
                {pb.DROP_REASON_SUPERSEDED, pb.DROP_REASON_OVERLOAD}
            # One answer each and no more: what comes next is the answer to the PING.
            viewer.send(PING, pb.Ping(t1_ns=5))
            assert viewer.expect(PONG)[0].t1_ns == 5
        dropped = [m for _, m, _ in answers if not hasattr(m, 'views')]
        assert dropped, 'no frame was superseded: the test has to send faster'
        for viewer in viewers:
            viewer.close()


def test_one_outstanding_loses_nothing():
    """At the rate that the server states, with one frame outstanding, nothing is dropped."""
    with Daemon() as daemon, probe(daemon) as light, Viewer(daemon, 640, 480) as viewer:
        light_up(light)
        for _ in range(5):
            viewer.expect_result(viewer.send_frame(lighting_min_sequence=1,
                                                   lighting_wait_ms=60000))
        with Client(daemon, pb.ROLE_VIEWER) as other:  # two viewers now: half for each
            share = other.welcome.holdable_fps
        assert share > 0
        other.close()
        interval, due = 1 / (2 * share), time.monotonic()
        print('# holds %.1f frames/s at 640x480' % (2 * share))
        for _ in range(min(60, int(3 / interval) + 2)):
            time.sleep(max(0, due - time.monotonic()))
            due = max(due + interval, time.monotonic())
            viewer.expect_result(viewer.send_frame())


def test_slow_reader():
    """A peer that reads late, but within stall-timeout-ms, gets every answer, each id once."""
    n = 50000
    with Daemon() as daemon, Viewer(daemon) as viewer:
        header = [pb.Frame(id=i, views=[pb.FrameView(camera=3)]).SerializeToString()
                  for i in range(1, n + 1)]
        data = b''.join(envelope(FRAME, len(h), 0) + h for h in header)
        sender = threading.Thread(target=viewer.send_bytes, args=[data], daemon=True)
        sender.start()
        time.sleep(1.5)  # long enough to fill the socket's buffers, and what the daemon keeps
        for i in range(1, n + 1):
            viewer.expect_dropped(i, pb.DROP_REASON_NO_CAMERA)
        sender.join()


def test_told_at_once():
    """A probe that nobody looks at is told of its bad frame; a late subscriber gets the state."""
    with Daemon(server='max-connections = 80') as daemon, probe(daemon) as light:
        light_up(light, 1, pixel_format=pb.PIXEL_FORMAT_JPEG, pixels=b'\xff\xd8 no')
        error, _ = light.expect(ERROR)
        assert error.about_type == ENVIRONMENT_FRAME and error.about_id == 1 and not error.fatal
        light_up(light, 2)
        with Viewer(daemon, want_lighting_states=True) as viewer, \
                probe(daemon, want_lighting_maps=True) as other:
            state, payload = viewer.expect(LIGHTING_STATE)
            assert state.sequence == 2 and len(payload) == 32 * state.light_count > 0
            state, payload = other.expect(LIGHTING_STATE)
            assert state.sequence == 2 and state.map_width == 512
            light_up(light, 3)
            assert viewer.expect(LIGHTING_STATE)[0].sequence == 3
        clients = []
        for _ in range(64):
            clients.append(Client(daemon, pb.ROLE_PROBE, want_lighting_states=True))
            clients[-1].expect(LIGHTING_STATE)
        with Client(daemon) as more:
            more.send(HELLO, pb.Hello(version_min=1, version_max=1, role=pb.ROLE_PROBE,
                                      want_lighting_states=True))
            assert '64 subscribers' in more.expect_fatal(pb.ERROR_CODE_FULL)
        for client in clients:
            client.close()


def test_waiting_for_light():
    with Daemon() as daemon, probe(daemon) as light, Viewer(daemon) as patient, \
            Viewer(daemon) as other:
        sentence = other.expect_dropped(other.send_frame(), pb.DROP_REASON_NO_LIGHTING)
        assert 'probe' in sentence
        start = time.monotonic()
        other.expect_dropped(other.send_frame(lighting_wait_ms=200), pb.DROP_REASON_NO_LIGHTING)
        assert 0.15 < time.monotonic() - start < 10
        light_up(light, 3)
        other.expect_result(other.send_frame(lighting_min_sequence=3, lighting_wait_ms=60000))
        # One waits for light 4; the other is not held up by it.
        waiting = patient.send_frame(lighting_min_sequence=4, lighting_wait_ms=60000)
        for _ in range(5):
            other.expect_result(other.send_frame())
        light_up(light, 4)
        assert patient.expect_result(waiting)[0].receipt.lighting_sequence == 4
        # The wait over, the light that is there serves.
        late = patient.send_frame(lighting_min_sequence=99, lighting_wait_ms=100)
        assert patient.expect_result(late)[0].receipt.lighting_sequence == 4


def test_reasons():
    """Frames that cannot be made come back with the reason, and the session goes on."""
    with Daemon('allow-reference = false\nmax-picture-width = 64') as daemon, \
            probe(daemon) as light, Viewer(daemon) as viewer:
        light_up(light)
        good = dict(lighting_min_sequence=1, lighting_wait_ms=60000)
        viewer.expect_result(viewer.send_frame(**good))
        viewer.expect_dropped(viewer.send_frame(pose=None), pb.DROP_REASON_NO_POSE)
        viewer.send(POSE, pb.Pose(world_from_object=DOWN))
        viewer.expect_result(viewer.send_frame(pose=None))
        wrong = pb.FrameView(world_from_camera=DOWN, camera=2,
                             picture_format=pb.PICTURE_FORMAT_NONE)
        viewer.expect_dropped(viewer.send_frame(b'', views=[wrong]), pb.DROP_REASON_NO_CAMERA)
        assert '2304' in viewer.expect_dropped(viewer.send_frame(b'\1' * 300),
                                               pb.DROP_REASON_BAD_FRAME)
        viewer.expect_dropped(viewer.send_frame(b'\xff\xd8 no JPEG',
                                                picture_format=pb.PICTURE_FORMAT_JPEG),
                              pb.DROP_REASON_BAD_PICTURE)
        viewer.expect_dropped(viewer.send_frame(quality=pb.QUALITY_REFERENCE),
                              pb.DROP_REASON_UNSUPPORTED)
        viewer.send(CAMERA, camera(65, 24))
        error, _ = viewer.expect(ERROR)
        assert error.code == pb.ERROR_CODE_BAD_VALUE and not error.fatal and '64' in error.sentence
        viewer.send(POSE, pb.Pose(object='cube', world_from_object=DOWN))
        error, _ = viewer.expect(ERROR)
        assert error.code == pb.ERROR_CODE_BAD_VALUE and not error.fatal, error
        assert 'movable' in error.sentence
        viewer.expect_result(viewer.send_frame())


def test_views_and_jpeg():
    """Two views in one frame, JPEG both ways, no picture at all."""
    with Daemon() as daemon, probe(daemon) as light, Viewer(daemon, 64, 48) as viewer:
        viewer.send(CAMERA, camera(32, 24, index=1))
        light_up(light)
        small = bytes(32 * 24 * 3)
        views = [pb.FrameView(world_from_camera=DOWN, camera=0, payload_length=64 * 48 * 3,
                              picture_format=pb.PICTURE_FORMAT_RGB8),
                 pb.FrameView(world_from_camera=DOWN, camera=1, payload_offset=64 * 48 * 3,
                              payload_length=len(small), picture_format=pb.PICTURE_FORMAT_RGB8)]
        frame_id = viewer.send_frame(viewer.picture + small, views=views,
                                     lighting_min_sequence=1, lighting_wait_ms=60000)
        result, payload = viewer.expect_result(frame_id)
        assert [(v.width, v.height) for v in result.views] == [(64, 48), (32, 24)]
        assert len(payload) == 3 * (64 * 48 + 32 * 24)
        frame_id = viewer.send_frame(result_format=pb.PICTURE_FORMAT_JPEG)
        result, jpeg = viewer.expect_result(frame_id)
        assert jpeg[:2] == b'\xff\xd8' and result.views[0].format == pb.PICTURE_FORMAT_JPEG
        frame_id = viewer.send_frame(jpeg, picture_format=pb.PICTURE_FORMAT_JPEG)
        assert len(viewer.expect_result(frame_id)[1]) == 64 * 48 * 3
        frame_id = viewer.send_frame(b'', picture_format=pb.PICTURE_FORMAT_NONE)
        assert viewer.expect_result(frame_id)[1][:3] == b'\0\0\0'


def test_environment_formats():
    """The same constant light in every format gives the same irradiance."""
    n = 32 * 16
    log = dict(type=pb.RESPONSE_TYPE_LOG, log_a=0.5, log_b=0.1, log_c=0.0)
    table = struct.pack('<3f', 0, 1, 2)
    cases = [
        dict(),
        dict(pixel_format=pb.PIXEL_FORMAT_RGB_F16, pixels=b'\x00\x3c' * (3 * n)),
        dict(pixel_format=pb.PIXEL_FORMAT_MONO16, scale=1.0, pixels=b'\xff\xff' * n),
        dict(pixel_format=pb.PIXEL_FORMAT_RGB12, pixels=b'\xff\x0f' * (3 * n)),
        dict(pixel_format=pb.PIXEL_FORMAT_MONO12, pixels=struct.pack('<H', 2048) * n,
             response=pb.Response(**log)),
        dict(pixel_format=pb.PIXEL_FORMAT_RGB16, pixels=table + struct.pack('<H', 32768) * (3 * n),
             response=pb.Response(type=pb.RESPONSE_TYPE_TABLE, table_entries=3)),
    ]
    with Daemon() as daemon, probe(daemon, want_lighting_states=True) as light:
        for i, case in enumerate(cases, 1):
            light_up(light, i, **case)
            state, payload = light.expect(LIGHTING_STATE)
            assert state.sequence == i and state.room == 'demo'
            assert len(payload) == 32 * state.light_count
            # Radiance 1 everywhere: L00 = sqrt(4 pi), and the lights add up to 4 pi.
            assert abs(state.sh[0] - 3.5449077) < 0.02, (i, state.sh[0])
            lights = [struct.unpack_from('<8f', payload, 32 * k)
                      for k in range(state.light_count)]
            total = sum(v[4] for v in lights)
            assert abs(total - 12.566) < 0.2, (i, total)
            assert all(abs(v[0]**2 + v[1]**2 + v[2]**2 - 1) < 1e-3 for v in lights)
    with Daemon() as daemon, probe(daemon, want_lighting_maps=True) as light:
        light_up(light)
        state, payload = light.expect(LIGHTING_STATE)
        assert (state.map_width, state.map_height) == (512, 256)
        texels = payload[32 * state.light_count:]
        assert len(texels) == 512 * 256 * 6 and texels[:6] == b'\x00\x3c' * 3


def get_room(daemon):
    return json.loads(daemon.get('/api/v1/status')[1])['rooms'][0]


def test_discs_are_told():
    """A small sun is one of the lights, and the message says which; not where the room has none."""
    half = struct.pack('<e', 0.5) * 3 * 256
    sun = half[:6 * 128] + struct.pack('<e', 60000) * 3 + half[:6 * 127]
    pixels = half * 40 + sun + half * 87
    for discs in ('true', 'false'):
        with Daemon(rooms=Room('light-discs = %s' % discs)) as daemon, \
                probe(daemon, want_lighting_states=True) as light:
            light_up(light, 1, width=256, height=128, pixels=pixels,
                     pixel_format=pb.PIXEL_FORMAT_RGB_F16)
            state, payload = light.expect(LIGHTING_STATE)
            assert len(state.discs) == (1 if discs == 'true' else 0), state
            for k in state.discs:
                x, y, z, radius, *_ = struct.unpack_from('<8f', payload, 32 * k)
                assert x > 0.8 and abs(y) < 0.03 and z > 0.5 and 0 < radius < 0.02, (x, y, z, radius)


def test_statistics():
    with Daemon() as daemon, probe(daemon) as light, \
            Viewer(daemon, want_statistics=True) as viewer:
        light_up(light)
        frame_id, n, seen = viewer.send_frame(lighting_min_sequence=1, lighting_wait_ms=60000), 0, 0
        deadline = time.monotonic() + 120
        while time.monotonic() < deadline and not (n and seen):
            kind, message, _ = viewer.receive()
            if kind == RESULT:
                assert message.id == frame_id
                n += 1
            elif kind == STATISTICS and message.frames_out == 1:
                assert message.sessions == 2 and message.frames_in == 1
                assert message.holdable_fps > 0 and message.median_frame_ms >= 0
                assert message.environment_frames_in == 1
                seen += 1
        assert n == 1 and seen
        # A frame that may wait but finds its light counts, also when its viewer has gone.
        viewer.send_frame(lighting_min_sequence=1, lighting_wait_ms=60000)
        while viewer.receive()[0] != RESULT:
            assert time.monotonic() < deadline
        viewer.close()
        deadline = time.monotonic() + 60
        while get_room(daemon)['viewers'] and time.monotonic() < deadline:
            time.sleep(0.01)
        assert get_room(daemon)['viewers'] == 0 < get_room(daemon)['latency_ms']['p50']


def test_no_work_without_need():
    """Light is not made for a room where nobody wants it, and is made when somebody comes."""
    with Daemon() as daemon, probe(daemon) as light:
        def get_light():
            return json.loads(daemon.get('/api/v1/status')[1])['rooms'][0]['light']
        light_up(light, 4)  # the first of a probe is always worked on
        deadline = time.monotonic() + 120
        while not get_light()['lit'] and time.monotonic() < deadline:
            time.sleep(0.01)
        light_up(light, 5)
        light.send(PING, pb.Ping(t1_ns=1))
        light.expect(PONG)
        time.sleep(0.2)
        lit = get_light()
        assert (lit['sequence'], lit['environment_frame_waiting']) == (4, True), lit
        with Viewer(daemon) as viewer:
            frame_id = viewer.send_frame(lighting_min_sequence=5, lighting_wait_ms=60000)
            viewer.expect_result(frame_id)


def test_shutdown():
    """SIGTERM tells every session, and the daemon ends at once although one never reads."""
    daemon = Daemon()
    with Viewer(daemon) as viewer, probe(daemon) as light, Client(daemon):
        light_up(light)
        viewer.send(PING, pb.Ping(t1_ns=1))
        viewer.expect(PONG)
        start = time.monotonic()
        daemon.process.send_signal(signal.SIGTERM)
        bye, _ = viewer.expect(BYE)
        assert bye.reason == pb.BYE_REASON_SHUTDOWN
        try:  # while the last are still being told, nobody new is sent here
            assert daemon.get('/readyz')[0] == 503
        except OSError:
            pass
        viewer.expect_closed()
        daemon.stop()
        assert time.monotonic() - start < 15


run_tests([test_composite_and_receipt, test_lamp_in_the_scene, test_budget,
           test_what_is_not_asked_for, test_a_still_view_is_refined, test_each_id_once,
           test_one_outstanding_loses_nothing,
           test_slow_reader, test_told_at_once, test_discs_are_told, test_waiting_for_light, test_reasons,
           test_views_and_jpeg, test_environment_formats, test_statistics, test_no_work_without_need,
           test_shutdown])
