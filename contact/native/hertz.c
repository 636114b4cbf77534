/* SPDX-License-Identifier: Apache-2.0 */
/* Sphere on sphere and sphere on half-space in the native engine: Hertz's law (contact.h). */
#include "contact/native/pairs.h"

#include "base/vec3.h"

#include <float.h>
#include <math.h>

void native_hertz(const double radius[2], const struct native_law *law,
                  const struct native_relative *relative, struct native_scratch *scratch,
                  struct native_sum *sum)
{
    struct native_batch *b = &scratch->batch;
    double d[3], depth, apart, relative_radius, force;

    /* Normal, penetration depth and relative radius, for a half-space and for a sphere */
    if (isinf(radius[1])) {
        for (int k = 0; k < 3; k++) {
            d[k] = relative->R[3 * k + 2];
        }
        depth = radius[0] + vec3_dot(d, relative->p);
        relative_radius = radius[0];
    } else {
        apart = vec3_norm(relative->p);
        depth = radius[0] + radius[1] - apart;
        relative_radius = radius[0] * radius[1] / (radius[0] + radius[1]);
        for (int k = 0; k < 3; k++) {
            /* Between equal centers there is no direction; any will do */
            d[k] = apart > DBL_MIN ? -relative->p[k] / apart : k == 2;
        }
    }
    if (depth <= 0) {
        return;
    }

    /* One spring, from the first's surface inward by its share of the depth */
    native_law_make_room(b, 1, law, relative, sum);
    force = 4.0 / 3 * law->hertz * sqrt(relative_radius * depth) * depth;
    for (int k = 0; k < 3; k++) {
        b->p[k][b->n] = (law->hertz_share * depth - radius[0]) * d[k];
        b->d[k][b->n] = d[k];
    }
    b->force[b->n] = force;
    b->rate[b->n] = 1.5 * force / depth;
    b->depth[b->n] = 0.8 * depth; /* two fifths of force times depth are stored */
    b->n++;
    native_law_sum(b, law, relative, sum);
    sum->area += 3.14159265358979323846 * relative_radius * depth;
    sum->depth = depth;
}
