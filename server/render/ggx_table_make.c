/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Prints the table of ggx_table.h as C; runs while Gnomon is built. */
#include <math.h>
#include <stdio.h>

#include "server/render/ggx.h"
#include "server/render/ggx_table.h"

/** Facets of each node's mean, in a Fibonacci lattice: this number and the one before. */
#define FACETS 1597
#define STEP 987

static double square(double x)
{
    return x * x;
}

/** E, and of it what goes with (1 - wo . m)^5. */
static void integrate(double alpha, double cosine, double *out_whole, double *out_fifth)
{
    const double wo[3] = {sqrt(1 - cosine * cosine), 0, cosine};
    *out_whole = *out_fifth = 0;
    for (int i = 0; i < FACETS; i++) {
        const double u[2] = {(i + 0.5) / FACETS, (double)(i * STEP % FACETS) / FACETS};
        double m[3];
        gn_ggx_sample_facet(wo, alpha, u, m);
        double along = fmin(wo[0] * m[0] + wo[2] * m[2], 1);
        const double wi[3] = {2 * along * m[0] - wo[0], 2 * along * m[1], 2 * along * m[2] - wo[2]};
        double share = wi[2] > 0 ? gn_ggx_get_unmasked(wo, wi, alpha) / FACETS : 0;
        *out_whole += share;
        *out_fifth += share * (1 - along) * square(square(1 - along));
    }
}

static double get_whole(double alpha, double share)
{
    double x = fmax(share, 1e-4);
    double whole;
    double fifth;
    integrate(alpha, fmin(alpha * x / (1 + alpha - x), 1), &whole, &fifth);
    return whole;
}

static double get_fifth(double alpha, double x)
{
    double whole;
    double fifth;
    integrate(alpha, fmax(x * x, 1e-6), &whole, &fifth);
    return fifth / whole;
}

static void print_table(const char *name, double (*get)(double alpha, double x))
{
    printf("const float %s[GGX_NODES][GGX_NODES] = {\n", name);
    for (int a = 0; a < GGX_NODES; a++) {
        double root = (double)a / (GGX_NODES - 1);
        printf("{");
        for (int c = 0; c < GGX_NODES; c++)
            printf("%.7ef,", get(fmax(root * root, 1e-5), (double)c / (GGX_NODES - 1)));
        printf("},\n");
    }
    printf("};\n");
}

int main(void)
{
    printf("#include \"server/render/ggx_table.h\"\n");
    print_table("ggx_table_whole", get_whole);
    print_table("ggx_table_fifth", get_fifth);
    return ferror(stdout) ? 1 : 0;
}
