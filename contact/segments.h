/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Distance between two straight segments, the axes of capsules, in closed form. Units are the
 * caller's. Pure; RT-safe.
 */
#ifndef CONTACT_SEGMENTS_H
#define CONTACT_SEGMENTS_H

#include "base/vec3.h"

#define SEGMENT_NONE 1e-300 /* squared length up to which a segment is a point */

/* A straight segment from the point `from` along the vector `by`. */
struct segment {
    double from[3], by[3];
};

static inline double segment_clamp(double x)
{
    return x < 0 ? 0 : x > 1 ? 1 : x;
}

/* Returns the squared distance of two segments. Finds the parameters s and t of the nearest points
 * of their lines and clamps them to the ends (Ericson, Real-Time Collision Detection, 5.1.9). */
static inline double segments_distance2(const struct segment *p, const struct segment *q)
{
    double between[3], to[3];
    double s = 0, t = 0, pp = vec3_dot(p->by, p->by), qq = vec3_dot(q->by, q->by);

    vec3_sub(p->from, q->from, between);
    if (qq <= SEGMENT_NONE) {
        s = pp > SEGMENT_NONE ? segment_clamp(-vec3_dot(p->by, between) / pp) : 0;
    } else if (pp <= SEGMENT_NONE) {
        t = segment_clamp(vec3_dot(q->by, between) / qq);
    } else {
        double pq = vec3_dot(p->by, q->by), pb = vec3_dot(p->by, between);
        double qb = vec3_dot(q->by, between), square = pp * qq - pq * pq;

        /* Nearest points of the lines, clamped to the second segment, then to the first. For
         * parallel segments any s is right */
        s = square > 1e-14 * pp * qq ? segment_clamp((pq * qb - pb * qq) / square) : 0;
        t = (pq * s + qb) / qq;
        if (t < 0 || t > 1) {
            t = segment_clamp(t);
            s = segment_clamp((pq * t - pb) / pp);
        }
    }
    vec3_add_scaled(between, s, p->by, to);
    vec3_add_scaled(to, -t, q->by, to);
    return vec3_dot(to, to);
}

#endif
