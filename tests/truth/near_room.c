/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/truth/near_room.h"

#include "tests/unit/cmocka_setup.h"

#include <string.h>

#include "tests/meshes.h"
#include "tests/rig/view.h"
#include "tests/stage.h"

/* Adds an object at `position` whose +z looks at `target`. */
static void add_object(struct gn_rig_room *room, const char *name, enum gn_rt_set role,
                       struct gn_mesh mesh, const double position[static 3],
                       const double target[static 3], const double emission[static 3])
{
    struct gn_rig_object object = {
        .name = name, .role = role, .albedo = {0.8, 0.7, 0.6}, .mesh = mesh};
    memcpy(object.emission, emission, sizeof(object.emission));
    gn_rig_look_at(position, target, object.world_from_object);
    assert_int_equal(gn_rig_room_add(room, &object), 0);
}

void gn_near_room_init(struct gn_rig_room *out_room)
{
    // The table leans by a thousandth: gn_rig_look_at cannot look along z.
    static const double dark[3] = {0}, table[3] = {0, 0, 0}, above[3] = {0, 0.001, 1};
    static const double wall[3] = {0, 0.2, 0}, before_wall[3] = {0, 0, 0};
    static const double box[3] = {-0.01, 0.09, 0.035}, beside_box[3] = {0.5, 0.4, 0.035};
    static const double screen[3] = {-0.16, 0.02, 0.14}, screen_light[3] = {5, 6, 9};
    static const double shown[3] = {0.11, 0.12, 0.03}, shown_light[3] = {1.5, 1, 0.5};
    static const struct gn_rig_lamp lamps[] = {
        {{0.14, -0.04, 0.22}, {0.06, 0.05, 0.03}, 0.02, false},
        {{0.06, 0.03, 0.10}, {0.002, 0.003, 0.004}, 0, true},
    };
    memset(out_room, 0, sizeof(*out_room));
    add_object(out_room, "table", GN_RT_REAL, gn_test_make_plane(2, 1), table, above, dark);
    add_object(out_room, "wall", GN_RT_REAL, gn_test_make_plane(2, 1), wall, before_wall, dark);
    add_object(out_room, "box", GN_RT_VIRTUAL, gn_test_make_box(0.06f, 0.07f, 0.06f), box,
               beside_box, dark);
    add_object(out_room, "screen", GN_RT_REAL, gn_test_make_plane(0.1f, 1), screen, box,
               screen_light);
    add_object(out_room, "shown", GN_RT_VIRTUAL, gn_test_make_plane(0.05f, 1), shown, box,
               shown_light);
    out_room->n_lamps = sizeof(lamps) / sizeof(lamps[0]);
    memcpy(out_room->lamps, lamps, sizeof(lamps));
}

void gn_near_room_set_lamps(const struct gn_rig_room *room, struct gn_scene *scene)
{
    struct gn_scene_light lights[GN_RIG_MAX_LAMPS];
    for (int i = 0; i < room->n_lamps; i++) {
        const struct gn_rig_lamp *lamp = &room->lamps[i];
        lights[i] = (struct gn_scene_light){.radius = (float)lamp->radius,
                                            .role = lamp->is_virtual ? GN_RT_VIRTUAL : GN_RT_REAL};
        for (int k = 0; k < 3; k++) {
            lights[i].position[k] = lamp->position[k];
            lights[i].intensity[k] = (float)lamp->intensity[k];
        }
    }
    assert_int_equal(gn_scene_set_lights(scene, lights, room->n_lamps, NULL), 0);
}
