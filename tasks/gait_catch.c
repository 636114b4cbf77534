/* SPDX-License-Identifier: Apache-2.0 */
/* The step that catches a standing robot that is pushed (capture step). */
#include "tasks/gait_private.h"

#include <math.h>
#include <string.h>

#define SETTLE_S 0.1     /* wait after a step: the foot that came down bounces */
#define LOAD_S 0.05      /* duration in which the standing foot takes over the weight */
#define FOLLOW_S 0.03    /* time constant with which the foothold follows the DCM */
#define ACROSS_PART 0.45 /* fraction of the swing in which it does so across ... */
#define ALONG_PART 0.63  /* ... and along: later the leg's own way moves the DCM */
#define ON_PART 0.6      /* fraction of the way to the new foot: beyond it the other follows */
#define ON_TRANSFER_S 0.12
#define CALM_S 0.3    /* at rest means: it has stood for so long ... */
#define CALM_M 0.025  /* ... and the DCM is this near to its plan */
#define BESIDE_M 0.03 /* feet this near to side by side need no further step */

/* Returns the distance between two points in the plane, m. */
static double gait_apart(const double a[2], const double b[2])
{
    double x = a[0] - b[0], y = a[1] - b[1];

    return sqrt(x * x + y * y);
}

/* Returns how far (m) the DCM is ahead of or behind where the center of pressure can be,
 * negative inside: the reach of a sole on the line between the feet, where that line is nearest
 * to the DCM. Sideways no step helps that does not cross the legs: the foot on that side carries
 * the weight, and the other one would have to pass it. */
static double gait_beyond_soles(const struct gait *gait, const double dcm[2])
{
    const struct gait_config *config = &gait->config;
    const struct gait_foothold *foot = gait->now.foot;
    struct gait_foothold sole = {.yaw = gait->now.yaw};
    double left = fmin(fmax(gait_left_share(gait, dcm), 0), 1), in[2];

    for (int k = 0; k < 2; k++) {
        sole.p[k] = foot[BODY_RIGHT].p[k] + left * (foot[BODY_LEFT].p[k] - foot[BODY_RIGHT].p[k]);
    }
    gait_into_foot(&sole, dcm, in);
    return fmax(in[0] - config->sole_front_m, config->sole_back_m - in[0]) + config->sole_margin_m;
}

bool gait_must_catch(const struct gait *gait, const struct gait_measured *measured)
{
    enum gait_phase phase = gait->now.phase;
    bool stands = phase == GAIT_STAND ||
                  (phase == GAIT_TRANSFER && gait->closing && gait->elapsed_s > SETTLE_S);

    return gait->config.catch_swing_s > 0 && stands &&
           gait_beyond_soles(gait, measured->dcm) > -gait->config.catch_margin_m;
}

void gait_begin_catch(struct gait *gait, const struct gait_measured *measured)
{
    struct gait_reference *now = &gait->now;
    double apart[BODY_SIDES];
    int swing;

    /* The foot nearer to the DCM stands */
    for (int i = 0; i < BODY_SIDES; i++) {
        apart[i] = gait_apart(measured->dcm, now->foot[i].p);
    }
    now->stance = apart[BODY_RIGHT] < apart[BODY_LEFT] ? BODY_RIGHT : BODY_LEFT;
    swing = gait_other(now->stance);
    /* The swing begins without a transfer: remember the load of the standing foot for its ramp */
    gait->bore = now->share[now->stance];
    gait->catches = true;
    gait->closing = gait->landed = false;
    gait->apart = true;
    /* The foothold begins beside the standing foot; gait_place_catch moves it outward */
    gait->lift = now->foot[swing];
    gait_foothold_of(gait, swing, &now->foot[now->stance], true, &gait->next);
    memset(gait->shift, 0, sizeof gait->shift);
    gait_begin(gait, GAIT_SWING, gait->config.catch_swing_s);
}

double gait_catch_share(const struct gait *gait)
{
    return gait->bore + (1 - gait->bore) * fmin(gait->elapsed_s / LOAD_S, 1);
}

/* Moves the foothold to where the DCM will be when the foot comes down. It moves only ever
 * further away: a foot that is drawn back throws the robot off, one that steps too far does no
 * harm. */
static void gait_place_catch(struct gait *gait, const double after[2], double dt_s)
{
    const struct gait_config *config = &gait->config;
    const struct gait_foothold *at = &gait->now.foot[gait->now.stance];
    double out = gait_outward(gait_other(gait->now.stance)), reach = config->catch_reach_m;
    double was[2], to[2], goal[2];

    /* In the heading of the standing foot: limit to its reach, and never closer than before */
    gait_into_foot(at, gait->next.p, was);
    gait_into_foot(at, after, to);
    to[0] = fmin(fmax(to[0] - config->zmp_ahead_m, -reach), reach);
    to[1] = fmin(fmax(out * to[1], config->least_width_m), config->width_m + config->reach_out_m);
    to[0] = fabs(to[0]) < fabs(was[0]) ? was[0] : to[0];
    to[1] = out * fmax(to[1], out * was[1]);
    if (gait->elapsed_s > ACROSS_PART * gait->duration_s) {
        to[1] = was[1];
    }
    /* Back into the world, smoothed */
    gait_offset(at, to[0], to[1], goal);
    for (int k = 0; k < 2; k++) {
        gait->next.p[k] += (goal[k] - gait->next.p[k]) * fmin(dt_s / FOLLOW_S, 1);
    }
}

void gait_plan_catch(struct gait *gait, const struct gait_measured *measured, double dt_s)
{
    const struct gait_config *config = &gait->config;
    struct gait_reference *now = &gait->now;
    const struct gait_foothold *at = &now->foot[now->stance];
    double side = config->sole_side_m - config->sole_margin_m, in[2], after[2];

    /* The center of pressure goes as far against the fall as the standing sole reaches */
    gait_into_foot(at, measured->dcm, in);
    in[0] = fmin(fmax(in[0], config->sole_back_m + config->sole_margin_m),
                 config->sole_front_m - config->sole_margin_m);
    in[1] = fmin(fmax(in[1], -side), side);
    gait_offset(at, in[0], in[1], now->zmp);
    /* The plan is the measurement, so that no feedback acts on top of it */
    memcpy(now->dcm, measured->dcm, sizeof now->dcm);

    dcm_advance(gait->omega, fmax(gait->duration_s - gait->elapsed_s, 0), now->zmp, measured->dcm,
                after);
    memcpy(gait->dcm_end, after, sizeof after);
    if (gait->elapsed_s <= ALONG_PART * gait->duration_s) {
        gait_place_catch(gait, after, dt_s);
    }
}

void gait_end_catch(struct gait *gait, const struct gait_measured *measured)
{
    int swing = gait_other(gait->now.stance);
    double left = gait_left_share(gait, measured->dcm);

    gait->catches = false;
    /* The DCM has gone on to the new foot: the other one follows with a step; else stay apart */
    if ((swing == BODY_LEFT ? left : 1 - left) > ON_PART) {
        gait_begin_step(gait, swing, ON_TRANSFER_S);
        return;
    }
    gait->closing = true;
    gait_begin(gait, GAIT_TRANSFER, gait->config.start_s);
    gait_begin_at(gait, measured->dcm);
}

bool gait_rests_apart(const struct gait *gait, const struct gait_measured *measured)
{
    const struct gait_reference *now = &gait->now;
    struct gait_foothold beside;

    if (!gait->apart || now->phase != GAIT_STAND || gait->elapsed_s <= CALM_S ||
        gait_apart(measured->dcm, now->dcm) >= CALM_M) {
        return false;
    }
    gait_foothold_of(gait, BODY_LEFT, &now->foot[BODY_RIGHT], true, &beside);
    return gait_apart(beside.p, now->foot[BODY_LEFT].p) > BESIDE_M;
}
