/* SPDX-License-Identifier: Apache-2.0 */
/* Makes the broad phase: allocates memory and sorts pairs into rows. */
#include "contact/broad_phase.h"

#define FAR 1e12 /* m; beyond all places that an engine accepts (1e9) */

/* Returns the surface whose row gets a pair: its half-space if it has one, else the lower
 * index. */
static int pair_row_surface(const struct contact_config *config, const struct contact_pair *pair)
{
    if (config->surface[pair->b].shape == CONTACT_HALF_SPACE) {
        return pair->b;
    }
    if (config->surface[pair->a].shape == CONTACT_HALF_SPACE) {
        return pair->a;
    }
    return pair->a < pair->b ? pair->a : pair->b;
}

enum error_code broad_phase_make(const struct contact_config *config, struct arena *arena,
                                 struct broad_phase *broad, struct error *error)
{
    size_t padded = (config->nsurface / BROAD_LANES + 1) * BROAD_LANES;
    struct broad_row *row = arena_alloc(arena, config->npair + 1, sizeof *row);
    double **array[] = {&broad->ball.x, &broad->ball.y, &broad->ball.z, &broad->ball.reach,
                        &broad->then.x, &broad->then.y, &broad->then.z};
    bool made;

    /* One element more, since an empty scene needs memory too */
    broad->capsule = arena_alloc(arena, config->nsurface + 1, sizeof *broad->capsule);
    broad->capsule_then = arena_alloc(arena, config->nsurface + 1, sizeof *broad->capsule_then);
    broad->candidate = arena_alloc(arena, config->npair + 1, sizeof *broad->candidate);
    made = row && broad->capsule && broad->capsule_then && broad->candidate;
    for (size_t i = 0; i < sizeof array / sizeof *array; i++) {
        *array[i] = arena_alloc(arena, padded, sizeof **array[i]);
        made = made && *array[i];
    }
    if (!made) {
        return error_set(error, ERROR_MEMORY, "contact: no memory for the broad phase");
    }

    /* Padding balls are so far away that nothing meets them */
    for (size_t s = 0; s < padded; s++) {
        broad->ball.x[s] = broad->ball.y[s] = broad->ball.z[s] = FAR;
    }

    /* The list can be kept only if no half-space moves, because list_moved does not measure the
     * motion of planes */
    broad->keeps = true;
    for (size_t s = 0; s < config->nsurface; s++) {
        broad->keeps &=
            config->surface[s].shape != CONTACT_HALF_SPACE || config->surface[s].body < 0;
    }

    /* Sorts the pairs into rows */
    broad->nsurface = config->nsurface;
    broad->found = false;
    broad->row = row;
    broad->nrow = 0;
    broad->nword = (config->npair + 63) / 64;
    for (size_t i = 0; i < config->npair; i++) {
        /* Add a pair to the row of its surfaces; begin a row if there is none */
        const struct contact_pair *pair = &config->pair[i];
        int surface = pair_row_surface(config, pair);
        int other = pair->a == surface ? pair->b : pair->a;
        int first = other / BROAD_LANES * BROAD_LANES;
        size_t r = 0;

        while (r < broad->nrow && (row[r].surface != surface || row[r].first != first)) {
            r++;
        }
        if (r == broad->nrow) {
            row[broad->nrow++] = (struct broad_row){
                .surface = surface,
                .first = first,
                .plane = config->surface[surface].shape == CONTACT_HALF_SPACE,
            };
        }
        row[r].wanted |= 1u << (other - first);
        row[r].pair[other - first] = (int)i;
        row[r].slack[other - first] = pair->slack_m;
    }
    return ERROR_NONE;
}
