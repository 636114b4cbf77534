/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sums over springs for contact/native/moments.h, LANES springs at a time. SI units. Pure; RT-safe.
 */
#ifndef CONTACT_NATIVE_MOMENTS_SUM_H
#define CONTACT_NATIVE_MOMENTS_SUM_H

#include "contact/lanes.h"
#include "contact/native/moments.h"

/* Adds the moments of n springs with these weights at r; each array is padded to full lanes. */
LANES_INLINE void moments_add_springs(const double *const r[3], const double *weight, size_t n,
                                      struct moments *m)
{
    lanes zeroth = {0}, first[3] = {{0}}, second[6] = {{0}};

    /* w, w r and w r r (xx xy xz yy yz zz), then the sums of the lanes */
    for (size_t i = 0; i < n; i += LANES) {
        lanes w = lanes_load(weight + i);
        lanes x = lanes_load(r[0] + i), y = lanes_load(r[1] + i), z = lanes_load(r[2] + i);
        lanes wx = w * x, wy = w * y, wz = w * z;

        zeroth += w;
        first[0] += wx;
        first[1] += wy;
        first[2] += wz;
        second[0] += wx * x;
        second[1] += wx * y;
        second[2] += wx * z;
        second[3] += wy * y;
        second[4] += wy * z;
        second[5] += wz * z;
    }
    m->zeroth += lanes_sum(zeroth);
    for (int k = 0; k < 3; k++) {
        m->first[k] += lanes_sum(first[k]);
    }
    for (int k = 0; k < 6; k++) {
        m->second[k] += lanes_sum(second[k]);
    }
}

#endif
