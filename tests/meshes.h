/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Simple meshes and random numbers for tests and benchmarks. Running out of memory ends the test.
 */
#ifndef GN_TESTS_MESHES_H
#define GN_TESTS_MESHES_H

#include <stdint.h>

#include "server/scene/mesh.h"
#include "tests/random.h"

/** The square [-size/2, size/2]^2 in z = 0, n x n cells of two triangles, normal +z. */
struct gn_mesh gn_test_make_plane(float size, int n);

/** A sphere about the origin of n rings and 2n sectors: 4n(n-1) triangles, closed; unit normals. */
struct gn_mesh gn_test_make_sphere(float radius, int n);

/** The cube [-size/2, size/2]^3, 12 triangles, 8 shared vertices, no normals. */
struct gn_mesh gn_test_make_cube(float size);

/** Uniform on the unit sphere; *state as in tests/random.h. */
void gn_test_random_direction(uint64_t *state, float out_dir[3]);

#endif
