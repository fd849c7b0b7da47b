/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Prints penrose_table.c: ninja -C build server/light/penrose-table, then run it. */
#include <stdio.h>

#include "server/light/penrose_relax.h"

int main(void)
{
    puts("/* SPDX-FileCopyrightText: 2026 the Gnomon authors */\n"
         "/* SPDX-License-Identifier: ISC */\n"
         "/* Printed by penrose-table (penrose_table_print.c); not edited by hand. */\n"
         "#include \"server/light/penrose.h\"\n\n"
         "// clang-format off\n"
         "const float gn_penrose_table[GN_PENROSE_INDICES][GN_PENROSE_INDICES][2] = {");
    for (int phase = 0; phase < GN_PENROSE_INDICES; phase++) {
        float row[GN_PENROSE_INDICES][2];
        if (gn_penrose_relax_phase(phase, GN_PENROSE_RELAX_ITERATIONS, row) < 0) {
            fprintf(stderr, "penrose-table: no memory\n");
            return 1;
        }
        printf("    {");
        for (int k = 0; k < GN_PENROSE_INDICES; k++)
            printf("{%.4ff, %.4ff}%s", (double)row[k][0], (double)row[k][1],
                   k == GN_PENROSE_INDICES - 1 ? "},\n"
                   : k % 4 == 3                ? ",\n     "
                                               : ", ");
    }
    puts("};");
    return 0;
}
