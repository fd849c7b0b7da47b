/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Working memory of frames: pieces of one pile, which the next frame finds again. */
#include <stdint.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "server/light/scratch.h"
#include "tests/allocations.h"

/* Takes pieces of many sizes, each filled with its own number; none may touch another. */
static void take_pieces(struct gn_scratch *scratch)
{
    unsigned char *pieces[40];
    for (int i = 0; i < 40; i++) {
        size_t n = (size_t)(i * i) * 500;
        pieces[i] = gn_scratch_take(scratch, n, 1);
        assert_non_null(pieces[i]);
        assert_int_equal((uintptr_t)pieces[i] % 64, 0);
        memset(pieces[i], i, n);
    }
    for (int i = 0; i < 40; i++)
        for (size_t k = 0; k < (size_t)(i * i) * 500; k++)
            if (pieces[i][k] != i)
                fail_msg("piece %d was written over by piece %d", i, pieces[i][k]);
}

static void the_second_frame_takes_nothing(void **unused)
{
    (void)unused;
    gn_scratch_place place = NULL;
    for (int frame = 0; frame < 4; frame++) {
        long before = gn_test_n_allocations;
        struct gn_scratch *scratch = gn_scratch_borrow(&place);
        assert_non_null(scratch);
        take_pieces(scratch);
        gn_scratch_give_back(&place, &scratch);
        assert_null(scratch);
        if (frame == 0)
            assert_true(gn_test_n_allocations > before); // the counter works
        else
            assert_int_equal(gn_test_n_allocations, before);
    }
    gn_scratch_finish(&place);
}

static void a_cleared_piece_is_clear(void **unused)
{
    (void)unused;
    gn_scratch_place place = NULL;
    for (int frame = 0; frame < 2; frame++) {
        struct gn_scratch *scratch = gn_scratch_borrow(&place);
        unsigned char *piece = gn_scratch_take_zeroed(scratch, 1000, 3);
        for (int i = 0; i < 3000; i++)
            assert_int_equal(piece[i], 0);
        memset(piece, 7, 3000);
        gn_scratch_give_back(&place, &scratch);
    }
    gn_scratch_finish(&place);
}

/* Two that grow in turn, so that neither stays on top. */
static void growing_keeps_what_is_there(void **unused)
{
    (void)unused;
    gn_scratch_place place = NULL;
    for (int frame = 0; frame < 2; frame++) {
        struct gn_scratch *scratch = gn_scratch_borrow(&place);
        int *a = NULL, *b = NULL;
        for (int n = 1; n <= 40000; n *= 2) {
            a = gn_scratch_grow(scratch, a, (size_t)n / 2, (size_t)n, sizeof(*a));
            int *again = gn_scratch_grow(scratch, a, (size_t)n, (size_t)n, sizeof(*a));
            assert_ptr_equal(again, a);
            for (int i = n / 2; i < n; i++)
                a[i] = i;
            b = gn_scratch_grow(scratch, b, (size_t)n / 2, (size_t)n, sizeof(*b));
            for (int i = n / 2; i < n; i++)
                b[i] = -i;
        }
        for (int i = 0; i < 32768; i++) {
            assert_int_equal(a[i], i);
            assert_int_equal(b[i], -i);
        }
        gn_scratch_give_back(&place, &scratch);
    }
    gn_scratch_finish(&place);
}

static void what_is_borrowed_twice_is_two(void **unused)
{
    (void)unused;
    gn_scratch_place place = NULL;
    struct gn_scratch *a = gn_scratch_borrow(&place), *b = gn_scratch_borrow(&place);
    assert_ptr_not_equal(a, b);
    assert_non_null(gn_scratch_take(a, 10, 10));
    gn_scratch_give_back(&place, &a);
    gn_scratch_give_back(&place, &b);
    gn_scratch_give_back(&place, &b); // NULL
    gn_scratch_finish(&place);
    gn_scratch_finish(&place);
}

static void sizes_beyond_memory_are_refused(void **unused)
{
    (void)unused;
    gn_scratch_place place = NULL;
    struct gn_scratch *scratch = gn_scratch_borrow(&place);
    assert_null(gn_scratch_take(scratch, SIZE_MAX / 2, 4));
    assert_null(gn_scratch_take(scratch, SIZE_MAX, 1));
    assert_null(gn_scratch_take(scratch, SIZE_MAX / 8, 1));
    int *piece = gn_scratch_take_zeroed(scratch, 4, sizeof(*piece));
    assert_null(gn_scratch_grow(scratch, piece, 4, SIZE_MAX / 2, sizeof(*piece)));
    assert_int_equal(piece[3], 0);
    gn_scratch_give_back(&place, &scratch);
    gn_scratch_finish(&place);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_second_frame_takes_nothing),
        cmocka_unit_test(a_cleared_piece_is_clear),
        cmocka_unit_test(growing_keeps_what_is_there),
        cmocka_unit_test(what_is_borrowed_twice_is_two),
        cmocka_unit_test(sizes_beyond_memory_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
