/* SPDX-License-Identifier: Apache-2.0 */
/* Sticking friction, as many springs at a time as there are lanes. */
#include "contact/native_stick.h"

#include "contact/native_friction.h"

void native_stick_gather(const struct native_batch *b, const struct native_law *law,
                         const struct native_relative *relative, struct native_sum *sum)
{
    struct native_gather *out = sum->gather;
    const lanes zero = {0};
    lanes along[3] = {zero, zero, zero}, slip[3] = {zero, zero, zero};
    lanes turn[3] = {zero, zero, zero}, lever[3] = {zero, zero, zero};
    lanes moment[3] = {zero, zero, zero}, second[6] = {zero, zero, zero, zero, zero, zero};
    lanes normal = zero, potential = zero, power = zero;

    for (size_t i = b->start; i < b->n; i += LANES) {
        struct friction_spring s;
        lanes f[3], fp[3], depth = lanes_load(b->depth + i);

        friction_load_spring(b, i, law, relative, &s);
        for (int k = 0; k < 3; k++) {
            f[k] = s.normal * s.d[k];
            fp[k] = s.normal * s.p[k];
            along[k] += f[k];
            lever[k] += fp[k];
            slip[k] += s.normal * s.u[k];
        }
        moment[0] += s.p[1] * f[2] - s.p[2] * f[1];
        moment[1] += s.p[2] * f[0] - s.p[0] * f[2];
        moment[2] += s.p[0] * f[1] - s.p[1] * f[0];
        turn[0] += fp[1] * s.u[2] - fp[2] * s.u[1];
        turn[1] += fp[2] * s.u[0] - fp[0] * s.u[2];
        turn[2] += fp[0] * s.u[1] - fp[1] * s.u[0];
        second[0] += fp[0] * s.p[0];
        second[1] += fp[0] * s.p[1];
        second[2] += fp[0] * s.p[2];
        second[3] += fp[1] * s.p[1];
        second[4] += fp[1] * s.p[2];
        second[5] += fp[2] * s.p[2];
        normal += s.normal;
        potential += s.force * depth;
        power += (s.force - s.normal) * s.leaving;
    }

    for (int k = 0; k < 3; k++) {
        double push = lanes_sum(along[k]);

        sum->force[k] += push;
        sum->moment[k] += lanes_sum(moment[k]);
        sum->lever[k] += lanes_sum(lever[k]);
        out->along[k] += push;
        out->slip[k] += lanes_sum(slip[k]);
        out->turn[k] += lanes_sum(turn[k]);
    }
    for (int k = 0; k < 6; k++) {
        out->second[k] += lanes_sum(second[k]);
    }
    sum->normal += lanes_sum(normal);
    sum->potential += lanes_sum(potential) / 2;
    sum->power += lanes_sum(power);
}

void native_stick_hold(struct native_batch *b, const struct native_law *law,
                       const struct native_relative *relative, struct native_sum *sum)
{
    struct native_grip *grip = sum->grip;
    const lanes zero = {0};
    lanes force[3] = {zero, zero, zero}, moment[3] = {zero, zero, zero};
    lanes power = zero, held = zero, most = zero, open = zero;

    for (size_t i = b->start; i < b->n; i += LANES) {
        struct friction_spring s;
        struct friction_bend bend;
        lanes f[3], size, bound, share;

        friction_load_spring(b, i, law, relative, &s);
        friction_find_bend(&s, law, grip, &bend);
        if (grip->keeps) {
            lanes_store(bend.stiffness, b->held + i);
        }
        share = s.normal * grip->inverse_normal;

        /* The force */
        for (int k = 0; k < 3; k++) {
            f[k] = bend.stiffness * bend.e[k];
            force[k] -= f[k];
            power += f[k] * s.u[k];
        }
        moment[0] -= s.p[1] * f[2] - s.p[2] * f[1];
        moment[1] -= s.p[2] * f[0] - s.p[0] * f[2];
        moment[2] -= s.p[0] * f[1] - s.p[1] * f[0];

        /* How near the bristles alone are to what friction can bear */
        size = lanes_root(bend.square);
        bound = lanes_pick(lanes_less(size, bend.limit), size, bend.limit);
        held += share * bound * size;
        most += share * bend.limit * size;
        open += share * lanes_pick(lanes_less(size, bend.limit), bend.square, zero);
    }

    for (int k = 0; k < 3; k++) {
        sum->force[k] += lanes_sum(force[k]);
        sum->moment[k] += lanes_sum(moment[k]);
    }
    grip->power += lanes_sum(power);
    grip->held += lanes_sum(held);
    grip->most += lanes_sum(most);
    grip->open += lanes_sum(open);
}
