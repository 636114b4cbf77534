/* SPDX-License-Identifier: Apache-2.0 */
/* Runs one derivation: its memory, and which equations. */
#include "model/symbolic/derive_private.h"

#include <stdlib.h>
#include <string.h>

/* Runs the derivation of d->function. */
static void derive_equations(struct derive *d)
{
    switch (d->function) {
    case DERIVE_INVERSE:
        derive_inverse(d);
        break;
    case DERIVE_KINEMATICS:
    case DERIVE_VELOCITIES:
    case DERIVE_ACCELERATION:
        derive_motion(d);
        break;
    case DERIVE_ENERGY:
        derive_energy(d);
        break;
    default:
        derive_forward(d);
        break;
    }
}

enum error_code derive(enum derive_function function, const struct tree *tree, bool inertia_inputs,
                       struct graph *graph, struct derivation *out, struct error *error)
{
    struct derive d = {.function = function,
                       .inertia_inputs = inertia_inputs,
                       .g = graph,
                       .tree = tree,
                       .out = out};
    enum error_code code = ERROR_NONE;
    int observed = 0;

    /* At most 27 outputs a body: its motion, and 9 of its pose */
    memset(out, 0, sizeof *out);
    out->output = calloc(27 * tree->nbody + 12, sizeof *out->output);
    d.state = calloc(tree->ngroup, sizeof *d.state);
    d.observed = calloc(tree->nbody, sizeof *d.observed);
    if (!out->output || !d.state || !d.observed) {
        code = error_set(error, ERROR_MEMORY, "no memory for the equations of %zu bodies",
                         tree->nbody);
        goto done;
    }

    /* Observed bodies have numbers of their own */
    for (size_t b = 0; b < tree->nbody; b++) {
        d.observed[b] = tree->body[b].observed ? observed++ : -1;
    }
    derive_equations(&d);
    if (graph->failed) {
        code = error_set(error, ERROR_MEMORY, "no memory for the expression graph");
    }

done:
    free(d.state);
    free(d.observed);
    if (code) {
        derivation_fini(out);
    }
    return code;
}

void derivation_fini(struct derivation *derivation)
{
    free(derivation->output);
    memset(derivation, 0, sizeof *derivation);
}
