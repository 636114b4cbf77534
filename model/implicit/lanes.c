/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The drives of the implicit integrator side by side, two per vector register. This file handles
 * drives without effects whose springs stay far from their stops, which is the usual case. Each
 * lane repeats the operations of model/implicit/actuators.c for one drive, so that results are
 * bit-identical. All other drives use the functions there.
 *
 * The drives' flows are stored by lanes, and filled again when a bridge switches or a condition
 * changes.
 */
#include "model/implicit/private.h"

#include <math.h>

/* ---- constants of a step ---- */

/* Fills a drive's lane: parameters, flows, and the inertia that the drive adds to the joint. The
 * inertia is the slope of the spring's torque against the rate at the stage, times the stage's
 * length. */
static void fill_lane(const struct plant *plant, size_t d, int lane, struct drive_group *group)
{
    const struct robot_sea *sea = &plant->sea[d];
    double stage_h = IMPLICIT_GAMMA * 1e-9 * (double)plant->config.substep_ns;

    group->Ks[lane] = sea->Ks;
    group->Ds[lane] = sea->Ds;
    group->room[lane] = sea->effects || plant->loop[d].on ? -1.0
                        : sea->stop.stiffness > 0.0       ? STOP_NEAR * sea->deflection
                                                          : (double)INFINITY;
    for (int level = 0; level < STEP_LEVELS; level++, stage_h *= 0.25) {
        const struct drive_flow *flow =
            plant->implicit->flows[d]->of[SPRING_FREE][plant->bridge_on[d]][level];
        const struct drive_flow *stage = &flow[SPAN_STAGE];

        for (int span = 0; span < SPANS; span++) {
            /* Copy the drive's flow into its lane */
            struct drive_lane_flow *lanes = &group->flow[level][span];

            lanes->t[lane] = flow[span].t;
            for (int k = 0; k < FLOW_INPUTS; k++) {
                lanes->qm[k][lane] = flow[span].qm[k];
                lanes->qmd[k][lane] = flow[span].qmd[k];
                lanes->I[k][lane] = flow[span].I[k];
            }
        }
        group->extra[level][lane] = -(sea->Ks * (stage->qm[FLOW_RATE] - stage_h) +
                                      sea->Ds * (stage->qmd[FLOW_RATE] - 1.0)) *
                                    stage_h;
    }
}

void implicit_hold_lanes(struct plant *plant)
{
    struct implicit *im = plant->implicit;

    for (size_t g = 0; g < im->ngroup; g++) {
        struct drive_group *group = &im->group[g];
        const size_t *d = group->drive;
        bool stale = false;

        group->V = (drive_lanes){plant->voltage[d[0]], plant->voltage[d[1]]};
        /* Fill a group again if a bridge of its drives has switched */
        for (int l = 0; l < DRIVE_LANES; l++) {
            stale |= im->lane_bridge[d[l]] != plant->bridge_on[d[l]];
        }
        for (int l = 0; stale && l < DRIVE_LANES; l++) {
            fill_lane(plant, d[l], l, group);
        }
        im->lane_bridge[d[0]] = (signed char)plant->bridge_on[d[0]];
        im->lane_bridge[d[1]] = (signed char)plant->bridge_on[d[1]];
    }
}

/* ---- through a span ---- */

/* The state of the drives of a group. */
struct lane_state {
    drive_lanes qm, qmd, I;
};

/* Returns the state of a group's drives after a flow. rate: rates of their joints. */
static struct lane_state advance_lanes(const struct drive_group *group,
                                       const struct drive_lane_flow *flow, drive_lanes rate)
{
    const drive_lanes input[FLOW_INPUTS] = {group->twist, group->qmd, group->I, rate, group->V};
    struct lane_state end = {group->qm, group->qmd, group->I};

    for (int k = 0; k < FLOW_INPUTS; k++) {
        end.qm += flow->qm[k] * input[k];
        end.qmd += flow->qmd[k] * input[k];
        end.I += flow->I[k] * input[k];
    }
    return end;
}

/* Returns a mask of the drives without effects whose springs cannot reach their stops within a
 * span. */
static drive_lanes_mask find_free_lanes(const struct drive_group *group,
                                        const struct drive_lane_flow *flow, drive_lanes rate)
{
    const drive_lanes_mask sign = {INT64_MIN, INT64_MIN};
    const drive_lanes twist = (drive_lanes)((drive_lanes_mask)group->twist & ~sign);
    const drive_lanes speed = (drive_lanes)((drive_lanes_mask)(group->qmd - rate) & ~sign);

    return (drive_lanes_mask)(twist + flow->t * speed < group->room);
}

/* Loads the state of a group's drives from base. Returns the rates of their joints. */
static drive_lanes take_lanes(const struct plant *plant, const size_t d[DRIVE_LANES],
                              struct drive_group *group)
{
    const double *base = plant->implicit->base;
    const double *y0 = base + plant_drive_offset(plant, d[0]);
    const double *y1 = base + plant_drive_offset(plant, d[1]);
    const size_t j0 = plant->drive_joint[d[0]], j1 = plant->drive_joint[d[1]];

    group->q =
        (drive_lanes){plant_joint_position(plant, base, j0), plant_joint_position(plant, base, j1)};
    group->qm = (drive_lanes){y0[DRIVE_MOTOR_POSITION], y1[DRIVE_MOTOR_POSITION]};
    group->qmd = (drive_lanes){y0[DRIVE_MOTOR_SPEED], y1[DRIVE_MOTOR_SPEED]};
    group->I = (drive_lanes){y0[DRIVE_CURRENT], y1[DRIVE_CURRENT]};
    group->twist = group->qm - group->q;
    return (drive_lanes){plant_joint_rate(plant, base, j0), plant_joint_rate(plant, base, j1)};
}

void implicit_linearize_drives(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    const drive_lanes h = {im->stage_h, im->stage_h};

    for (size_t g = 0; g < im->ngroup; g++) {
        struct drive_group *group = &im->group[g];
        const struct drive_lane_flow *flow = &group->flow[im->level][SPAN_STAGE];
        const size_t *d = group->drive;
        const drive_lanes rate = take_lanes(plant, d, group), extra = group->extra[im->level];
        const struct lane_state end = advance_lanes(group, flow, rate);
        const drive_lanes torque =
            group->Ks * (end.qm - (group->q + h * rate)) + group->Ds * (end.qmd - rate);

        /* Compute the spring's torque and its slope in the predicted state, if the joint keeps its
         * rate */
        group->is_free = find_free_lanes(group, flow, rate);
        for (int l = 0; l < DRIVE_LANES; l++) {
            const size_t j = plant->drive_joint[d[l]];

            im->law[d[l]] = SPRING_FREE;
            im->torque[j] = torque[l];
            im->extra[j] = extra[l];
            if (!group->is_free[l]) {
                im->torque[j] = im->extra[j] = 0.0;
                implicit_linearize_drive(plant, d[l]);
            }
        }
    }
}

void implicit_advance_drives(struct plant *plant, enum implicit_span span, const double *rates)
{
    struct implicit *im = plant->implicit;

    for (size_t g = 0; g < im->ngroup; g++) {
        const struct drive_group *group = &im->group[g];
        const struct drive_lane_flow *flow = &group->flow[im->level][span];
        const size_t *d = group->drive;
        const drive_lanes rate = {rates[plant->drive_joint[d[0]]], rates[plant->drive_joint[d[1]]]};
        const struct lane_state end = advance_lanes(group, flow, rate);
        const drive_lanes_mask is_free =
            span == SPAN_STAGE ? group->is_free : find_free_lanes(group, flow, rate);

        /* Handle other drives, and all drives if energies are accounted, one by one */
        for (int l = 0; l < DRIVE_LANES && DRIVE_LANES * g + (size_t)l < plant->ndrive; l++) {
            double *y = im->base + plant_drive_offset(plant, d[l]);

            if (plant->accounts || !is_free[l]) {
                implicit_advance_drive(plant, d[l], span, rate[l]);
                continue;
            }
            y[DRIVE_MOTOR_POSITION] = end.qm[l];
            y[DRIVE_MOTOR_SPEED] = end.qmd[l];
            y[DRIVE_CURRENT] = end.I[l];
        }
    }
}
