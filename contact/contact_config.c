/* SPDX-License-Identifier: Apache-2.0 */
/* Checks of configurations and motions, common to all contact engines. */
#include "contact/contact.h"

#include <math.h>
#include <stdio.h>

#define MOTION_LIMIT 1e9 /* for the numbers of a motion: m, rad/s, m/s */

enum error_code contact_check_motions(const struct body_motion *motion, size_t n, char *failure,
                                      size_t size)
{
    const double *number = (const double *)motion;
    const size_t each = sizeof *motion / sizeof *number;

    for (size_t i = 0; i < n * each; i++) {
        if (!(fabs(number[i]) <= MOTION_LIMIT)) {
            snprintf(failure, size,
                     "contact: found %g in the motion of body %zu, expected at most %g", number[i],
                     i / each, MOTION_LIMIT);
            return ERROR_INPUT;
        }
    }
    return ERROR_NONE;
}

enum error_code contact_config_check(const struct contact_config *config, struct error *error)
{
    if (config->nbody > CONTACT_MAX_BODIES || config->nsurface > CONTACT_MAX_SURFACES ||
        config->npair > CONTACT_MAX_PAIRS) {
        return error_set(error, ERROR_INPUT,
                         "contact: found %zu bodies, %zu surfaces and %zu pairs, expected at most "
                         "%d, %d and %d",
                         config->nbody, config->nsurface, config->npair, CONTACT_MAX_BODIES,
                         CONTACT_MAX_SURFACES, CONTACT_MAX_PAIRS);
    }
    for (size_t i = 0; i < config->npair; i++) {
        const struct contact_surface *a = &config->surface[config->pair[i].a];
        const struct contact_surface *b = &config->surface[config->pair[i].b];

        if (a->shape == CONTACT_HALF_SPACE && b->shape == CONTACT_HALF_SPACE) {
            return error_set(error, ERROR_INPUT,
                             "contact pair %zu: found two half-spaces ('%s' and '%s'), expected "
                             "one at most",
                             i, a->name, b->name);
        }
    }
    return ERROR_NONE;
}
