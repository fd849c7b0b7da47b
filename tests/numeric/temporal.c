/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Light in time at its extremes: any rate, any clock, lamps that go on, strobe and alias. */
#include "tests/unit/cmocka_setup.h"

#include <stdio.h>

#include "common/pool.h"
#include "tests/light_fixture.h"
#include "tests/random.h"
#include "tests/temporal_play.h"

static const double pi = 3.14159265358979323846;

static double get_normal(uint64_t *state)
{
    return sqrt(-2 * log(1 - gn_test_random_unit(state))) *
           cos(2 * pi * gn_test_random_unit(state));
}

/* Sets the power of the i-th light. */
static void set_power(struct play *p, int i, double power)
{
    p->lights[i].irradiance[0] = (float)power;
    p->lights[i].irradiance[1] = (float)(0.9 * power);
    p->lights[i].irradiance[2] = (float)(0.5 * power);
}

/* After half a second of darkness-to-light steps, what each rate says at the same times. The step
 * is a lamp that grows by the factor and turns by 0.08 rad. */
static void follow_step(double tau, double rate, double factor, double out_power[8],
                        double out_turn[8])
{
    struct play p;
    uint64_t seed = 5;
    begin(&p);
    p.tau = tau;
    show(&p, 0.1);
    struct gn_light old = p.lights[1];
    p.lights[1] = p.lights[3];
    p.n = 3;
    put_light(&p, 2, 1.5 + 0.08, 0.5, 10 * factor);
    for (int i = 0; i < 8; i++) { // 67 ms apart: one frame at 15 Hz
        double left = 1.0 / 15;
        while (left > 1e-9) {
            double dt = rate > 0 ? 1 / rate : 1e-4 + 0.02 * gn_test_random_unit(&seed);
            dt = dt < left + 1e-9 ? dt : left;
            show(&p, dt);
            left -= dt;
            assert_int_equal(p.now->figures.n_snaps, 0);
        }
        out_power[i] = get_power(&p, 2);
        out_turn[i] = get_angle(find(&p, 2), &old);
    }
    end(&p);
}

static void compare_rates(double tau, double *out_power, double *out_turn)
{
    static const double rates[] = {15, 60, 240, 0}, factors[] = {0.5, 1, 1.02, 1.2, 2};
    *out_power = *out_turn = 0;
    for (int f = 0; f < 5; f++) {
        double power[4][8], turn[4][8];
        for (int r = 0; r < 4; r++)
            follow_step(tau, rates[r], factors[f], power[r], turn[r]);
        for (int i = 0; i < 8; i++) {
            for (int r = 1; r < 4; r++) {
                *out_power = fmax(*out_power, fabs(power[r][i] / power[0][i] - 1));
                *out_turn = fmax(*out_turn, fabs(turn[r][i] - turn[0][i]));
            }
        }
    }
    print_message("# tau %g s at 15, 60, 240 Hz and random: powers within %.2g, directions within "
                  "%.2g rad\n",
                  tau, *out_power, *out_turn);
}

static void depends_on_time_not_on_the_rate(void **test)
{
    (void)test;
    double power, turn;
    compare_rates(0.04, &power, &turn); // one pace for all changes: exact but for float
    assert_true(power < 1e-6 && turn < 2e-4);
    compare_rates(0.2, &power, &turn);
    assert_true(power < 0.01 && turn < 0.01);
    compare_rates(0.4, &power, &turn);
    assert_true(power < 0.01 && turn < 0.01);
}

/* The step is monotone, does not overshoot, and is there to 90 % within the longer of 3 frames and
 * 100 ms. */
static void check_step(double rate, double from, double to)
{
    struct play p;
    begin(&p);
    set_power(&p, 1, from);
    show(&p, 0.1);
    set_power(&p, 1, to);
    double last = from, direction = to > from ? 1 : -1, t = 0;
    double limit = fmax(3 / rate, 0.1);
    for (int i = 0; i < (int)(rate * 0.6) + 4; i++) {
        show(&p, 1 / rate);
        t += 1 / rate;
        double power = get_power(&p, 2);
        assert_true(direction * (power - last) >= -1e-6 * fabs(last));
        assert_true(direction * (power - to) <= 1e-6 * to);
        if (t >= limit * (1 - 1e-9))
            assert_true(fabs(power - to) <= 0.1 * fabs(to - from));
        last = power;
    }
    end(&p);
}

static void follows_steps_without_overshoot(void **test)
{
    (void)test;
    static const double rates[] = {5, 15, 30, 60, 240, 1000};
    static const double factors[] = {1e4, 30, 3.9, 2, 1.3, 0.7, 0.5, 0.2, 1e-4};
    for (size_t r = 0; r < sizeof(rates) / sizeof(rates[0]); r++)
        for (size_t f = 0; f < sizeof(factors) / sizeof(factors[0]); f++)
            check_step(rates[r], 10, 10 * factors[f]);
}

static void check_finite(const struct play *p, double largest)
{
    for (int i = 0; i < p->now->n_lights; i++) {
        struct gn_light light;
        double n = 0;
        gn_temporal_get_light(p->now, i, &light);
        for (int k = 0; k < 3; k++) {
            assert_true(light.irradiance[k] >= 0 && (double)light.irradiance[k] <= largest);
            n += (double)light.dir_world[k] * (double)light.dir_world[k];
        }
        assert_near(n, 1, 1e-5);
        assert_true(light.angular_radius >= 0 && (double)light.angular_radius <= pi + 1e-6);
    }
    for (int c = 0; c < 3; c++)
        assert_near(get_sum(p, c), p->now->total[c], 1e-5 * p->now->total[c]);
}

/* Frame intervals from 1 us to 100 s, jittered, duplicate and backward, lights that come and go,
 * powers over 60 decades. */
static void stands_any_clock(void **test)
{
    (void)test;
    uint64_t seed = 11;
    for (int run = 0; run < 20; run++) {
        struct play p;
        begin(&p);
        double unit = pow(10, 3 * run - 30), largest = 0;
        for (int frame = 0; frame < 400; frame++) {
            p.n = (int)(20 * gn_test_random_unit(&seed));
            int n = p.n;
            p.n = 0;
            for (int i = 0; i < n; i++) {
                double power = unit * pow(10, 4 * gn_test_random_unit(&seed));
                put_light(&p, 1 + (uint64_t)(30 * gn_test_random_unit(&seed)),
                          6.28 * gn_test_random_unit(&seed),
                          3.1 * gn_test_random_unit(&seed) - 1.55, power);
                largest += power;
            }
            double kind = gn_test_random_unit(&seed),
                   dt = pow(10, -6 + 8 * gn_test_random_unit(&seed));
            show(&p, kind < 0.1 ? 0 : kind < 0.2 ? -dt : dt);
            check_finite(&p, largest * 1.0001);
        }
        end(&p);
    }
}

static void takes_a_microsecond_as_it_is(void **test)
{
    (void)test;
    struct play p;
    begin(&p);
    show(&p, 0.1);
    set_power(&p, 1, 10.05);
    for (int i = 0; i < 20000; i++)
        show(&p, 1e-6);
    assert_near(get_power(&p, 2), 10.05 - 0.05 * exp(-0.02 / play_tau), 1e-5);
    end(&p);
}

/* On, off, on, off, at the frame rate and at half of it: never beyond what the lamp does. */
static void bounds_a_strobing_lamp(void **test)
{
    (void)test;
    for (int period = 1; period <= 2; period++) {
        for (int weak = 0; weak < 2; weak++) {
            struct play p;
            begin(&p);
            double low = weak ? 5 : 0.001, high = weak ? 10 : 1000, least = high, most = 0;
            for (int i = 0; i < 240; i++) {
                set_power(&p, 1, i / period % 2 ? high : low);
                show(&p, 1.0 / 60);
                double power = get_power(&p, 2);
                assert_true(power >= low * (1 - 1e-6) && power <= high * (1 + 1e-6));
                assert_near(get_sum(&p, 0), p.now->total[0], 1e-5 * p.now->total[0]);
                if (i > 120) {
                    least = fmin(least, power);
                    most = fmax(most, power);
                }
            }
            print_message("# strobe, %d frames on, %g to %g: %.4g to %.4g\n", period, low, high,
                          least, most);
            if (weak)
                assert_true(most - least < 0.5 * (high - low));
            end(&p);
        }
    }
}

/* A lamp on 50 Hz mains flickers at 100 Hz; frames at 30 Hz see 10 Hz of it. */
static void bounds_a_lamp_that_aliases(void **test)
{
    (void)test;
    struct play p;
    begin(&p);
    double least = 1e9, most = 0, mean = 0;
    int n = 0;
    for (int i = 0; i < 300; i++) {
        set_power(&p, 1, 10 * (1 + 0.3 * sin(2 * pi * 100 * i / 30.0)));
        show(&p, 1.0 / 30);
        double power = get_power(&p, 2);
        if (i < 60)
            continue;
        least = fmin(least, power);
        most = fmax(most, power);
        mean += power;
        n++;
    }
    mean /= n;
    print_message("# 100 Hz at 30 Hz: 7.4 to 12.6 becomes %.4g to %.4g, mean %.4g\n", least, most,
                  mean);
    assert_true((most - least) < 0.75 * 5.2);
    assert_near(mean, 10, 0.05);
    end(&p);
}

static void tells_two_identical_suns_apart(void **test)
{
    (void)test;
    struct play p = {.tau = play_tau};
    put_light(&p, 7, 1, 0.5, 1e5);
    put_light(&p, 8, 1, 0.5, 1e5);
    show(&p, 0.1);
    for (int i = 0; i < 50; i++) {
        set_power(&p, 1, 1.002e5); // one of them changes, the other does not
        show(&p, 0.02);
        assert_true(get_power(&p, 7) == 1e5);
        assert_int_equal(p.now->n_lights, 2);
    }
    assert_near(get_power(&p, 8), 1.002e5, 5);
    p.lights[0].id = p.lights[1].id = 9; // not even their names differ
    for (int i = 0; i < 80; i++) {
        show(&p, 0.02);
        assert_near(get_sum(&p, 0), p.now->total[0], 1e-5 * p.now->total[0]);
    }
    assert_int_equal(p.now->n_lights, 2);
    end(&p);
}

/* A light that noise moves about the horizon, and one whose direction nothing says. */
static void stands_lights_on_the_horizon(void **test)
{
    (void)test;
    uint64_t seed = 3;
    struct play p = {.tau = play_tau};
    put_light(&p, 1, 0.3, 0, 10);
    put_light(&p, 2, 2.3, 0, 10);
    p.lights[1].angular_radius = (float)pi; // light from all sides
    double worst = 0;
    for (int i = 0; i < 600; i++) {
        p.lights[0].dir_world[2] = (float)(3e-4 * get_normal(&seed));
        show(&p, 1.0 / 60);
        check_finite(&p, 11);
        if (i > 60)
            worst = fmax(worst, fabs((double)find(&p, 1)->dir_world[2]));
    }
    assert_true(worst < 3e-4); // of noise alone: over 9e-4
    end(&p);
}

/* Largest powers that a map may give, and the smallest. */
static void keeps_extreme_powers(void **test)
{
    (void)test;
    static const double powers[] = {1e31, 1e-30, 1e-37};
    for (int i = 0; i < 3; i++) {
        struct play p;
        begin(&p);
        for (int k = 0; k < 4; k++)
            set_power(&p, k, powers[i]);
        show(&p, 0.1);
        set_power(&p, 0, 2 * powers[i]);
        p.n = 3;
        for (int frame = 0; frame < 60; frame++) {
            show(&p, 0.02);
            check_finite(&p, 2.001 * powers[i]);
        }
        end(&p);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(depends_on_time_not_on_the_rate),
        cmocka_unit_test(follows_steps_without_overshoot),
        cmocka_unit_test(stands_any_clock),
        cmocka_unit_test(takes_a_microsecond_as_it_is),
        cmocka_unit_test(bounds_a_strobing_lamp),
        cmocka_unit_test(bounds_a_lamp_that_aliases),
        cmocka_unit_test(tells_two_identical_suns_apart),
        cmocka_unit_test(stands_lights_on_the_horizon),
        cmocka_unit_test(keeps_extreme_powers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
