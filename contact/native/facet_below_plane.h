/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The bed of springs under a facet that is all below a plane, in closed form: depth and velocity
 * are linear over it, so all that sticking friction asks of its springs are the facet's moments. SI
 * units; in the frame of the facet's surface. RT-safe; nothing fails.
 */
#ifndef CONTACT_NATIVE_FACET_BELOW_PLANE_H
#define CONTACT_NATIVE_FACET_BELOW_PLANE_H

#include "contact/mesh/solid.h"
#include "contact/native/law.h"

/* What is linear over a facet: its value at the center, and its slopes along the facet's axes. */
struct facet_linear {
    double center, slope[2];
};

/* Computes the penetration depth over a facet with an outline; n: the plane's normal, height: n .
 * any of its points, m. Returns it with the greatest and the least at a corner. */
struct facet_linear facet_below_plane_depth(const struct solid *solid, const struct facet *facet,
                                            const double n[3], double height, double *deepest,
                                            double *shallowest);

/* Adds to sum, which gathers for sticking friction, what the springs of a facet would that is all
 * below; pressure: their stiffness over the facet's area, Pa/m. Returns false, with nothing added,
 * where some of them might not push. */
bool facet_below_plane_gather(const struct solid *solid, const struct facet *facet,
                              const struct facet_linear *depth, const double n[3], double pressure,
                              const struct native_law *law, const struct native_relative *relative,
                              struct native_sum *sum);

#endif
