/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The anchor of sticking friction and its play. It is a play operator: it moves only as far as
 * needed to stay within a distance. When a body rocks, the centroid of its contact area and the
 * mean normal move back and forth. Meanwhile the anchor stays in place, so rocking causes no
 * sliding. The state is the radius times point and axis. So a fading anchor keeps its place, and a
 * new one starts at the contact area.
 */
#include "contact/native/anchor.h"

#include "base/vec3.h"

#include <float.h>
#include <math.h>

#define RADIUS_MOST 1.25       /* largest radius of the anchor over the radius of the area */
#define HEIGHT_MOST (1.0 / 64) /* largest distance along the normal, over the radius */
#define TILT_MOST (1.0 / 16)   /* largest sine of the angle between axis and normal */

bool native_anchor_read(const double y[CONTACT_BRISTLE], struct native_anchor *anchor)
{
    const double radius = vec3_norm(y + BRISTLE_AXIS);

    if (!(radius > DBL_MIN)) {
        return false;
    }
    anchor->radius = radius;
    for (int k = 0; k < 3; k++) {
        anchor->point[k] = y[BRISTLE_POINT + k] / radius;
        anchor->axis[k] = y[BRISTLE_AXIS + k] / radius;
    }
    return true;
}

void native_anchor_write(const struct native_anchor *anchor, double y[CONTACT_BRISTLE])
{
    for (int k = 0; k < 3; k++) {
        y[BRISTLE_POINT + k] = anchor->radius * anchor->point[k];
        y[BRISTLE_AXIS + k] = anchor->radius * anchor->axis[k];
    }
}

/* Drags the axis to within TILT_MOST of the normal n. Returns whether it moved. */
static bool drag_axis(const double n[3], double axis[3])
{
    const double along = vec3_dot(n, axis);
    double across[3] = {axis[0], axis[1], axis[2]}, tilt;

    vec3_add_scaled(across, -along, n, across);
    tilt = vec3_norm(across);
    if (along > 0 && tilt <= TILT_MOST) {
        return false;
    }
    for (int k = 0; k < 3; k++) {
        axis[k] = n[k] * sqrt(1 - TILT_MOST * TILT_MOST) +
                  (tilt > DBL_MIN ? across[k] * (TILT_MOST / tilt) : 0);
    }
    return true;
}

/* Drags the point to within radius of the area's centroid c across the normal n, and within radius
 * times HEIGHT_MOST along it. Returns whether it moved. */
static bool drag_point(const double c[3], const double n[3], double radius, double point[3])
{
    const double most = radius * HEIGHT_MOST;
    double from[3], along, height, distance;

    vec3_sub(point, c, from);
    along = vec3_dot(n, from);
    height = fmin(most, fmax(-most, along));
    vec3_add_scaled(from, -along, n, from);
    distance = vec3_norm(from);
    if (distance <= radius && height == along) {
        return false;
    }
    for (int k = 0; k < 3; k++) {
        point[k] = c[k] + height * n[k] + from[k] * (distance > radius ? radius / distance : 1);
    }
    return true;
}

bool native_anchor_drag(const struct native_anchor *touch, struct native_anchor *anchor)
{
    const double radius = fmin(RADIUS_MOST * touch->radius, fmax(touch->radius, anchor->radius));
    bool dragged = radius != anchor->radius;

    anchor->radius = radius;
    dragged |= drag_axis(touch->axis, anchor->axis);
    dragged |= drag_point(touch->point, touch->axis, touch->radius, anchor->point);
    return dragged;
}
