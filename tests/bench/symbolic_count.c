/* SPDX-License-Identifier: Apache-2.0 */
/* Evaluates COMAN's generated forward dynamics N times, for an instruction counter:
 * forward|wrenches|implicit N. Prints the variant. */
#include "model/symbolic/symbolic.h"

#include <stdlib.h>
#include <string.h>

enum { SIZE = 64 };

int main(int argc, char **argv)
{
    static double q[SIZE], v[SIZE], tau[SIZE], vdot[SIZE], extra[SIZE];
    static struct wrench ext[SIZE];
    static struct added_inertia added[SIZE];
    const struct dynamics_module *module;
    const struct robot *robot;
    struct dynamics d;
    struct error error;
    struct arena arena;
    long count;

    if (argc != 3 || arena_init(&arena, 1 << 26, &error) ||
        robot_load(HIL_SOURCE_DIR "/config/robots/coman.yaml", NULL, &arena, &robot, &error)) {
        return EXIT_FAILURE;
    }
    module = symbolic_builtin(robot);
    if (!module || module->nq > SIZE || dynamics_generated(robot, module, &arena, &d, &error)) {
        return EXIT_FAILURE;
    }
    for (int i = 0; i < SIZE; i++) {
        q[i] = v[i] = tau[i] = 0.01 * (i + 1);
    }
    count = strtol(argv[2], NULL, 10);
    for (long n = 0; n < count; n++) {
        if (strcmp(argv[1], "implicit") == 0) {
            d.ops->implicit(&d, q, v, tau, ext, extra, added, vdot);
        } else {
            d.ops->forward(&d, q, v, tau, strcmp(argv[1], "wrenches") == 0 ? ext : NULL, vdot);
        }
    }
    printf("%s\n", module->variant);
    arena_fini(&arena);
    return EXIT_SUCCESS;
}
