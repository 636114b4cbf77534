/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The springs of a facet that is completely below a plane, in closed form: depth and velocity are
 * linear over the facet, so the sums for sticking friction follow from the facet's moments. SI
 * units; frame of the facet's surface. RT-safe; nothing fails.
 */
#ifndef CONTACT_NATIVE_FACET_BELOW_PLANE_H
#define CONTACT_NATIVE_FACET_BELOW_PLANE_H

#include "contact/mesh/solid.h"
#include "contact/native/law.h"

/* A linear function over a facet: value at the center, slopes along the facet's axes. */
struct facet_linear {
    double center, slope[2];
};

/* Computes the penetration depth over a facet that has an outline. n: the plane's normal; height:
 * n . any point of the plane, m. Returns the depth with its largest and smallest value at a
 * corner. */
struct facet_linear facet_below_plane_depth(const struct solid *solid, const struct facet *facet,
                                            const double n[3], double height, double *deepest,
                                            double *shallowest);

/* Adds the springs of a facet completely below the plane to sum, for sticking friction. pressure:
 * spring stiffness per facet area, Pa/m. Returns false and adds nothing if some springs might not
 * push. */
bool facet_below_plane_gather(const struct solid *solid, const struct facet *facet,
                              const struct facet_linear *depth, const double n[3], double pressure,
                              const struct native_law *law, const struct native_relative *relative,
                              struct native_sum *sum);

#endif
