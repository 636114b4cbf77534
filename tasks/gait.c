/* SPDX-License-Identifier: Apache-2.0 */
/* Updates the gait: the phases of the steps, the footholds, and the plan of the zero-moment point
 * and of the DCM. */
#include "tasks/gait.h"

#include "base/portable_math.h"

#include <math.h>
#include <string.h>

/* Number of planned footholds after the next foothold. Later footholds would change the DCM by less
 * than exp(-omega 2 T), a thousandth. */
enum { PREVIEW = 3 };

#define ADJUST_S 0.03    /* time constant of the foothold's adjustment */
#define TIME_CHANGE 0.06 /* largest relative change of a step's duration */
#define EARLIEST 0.5     /* fraction of a swing after which a load counts as a landing */

/* Constants of the step that catches a pushed robot */
#define CATCH_LATE_S 0.1    /* longest extension of a swing without ground contact */
#define CATCH_LOWER_M_S 0.3 /* speed at which the foot is lowered in the extension */
#define CATCH_COM_S 0.05    /* time constant of the planned center of mass */
#define SETTLE_S 0.1        /* wait after a step, because the landed foot bounces */
#define LOAD_S 0.05         /* duration in which the standing foot takes over the weight */
#define FOLLOW_S 0.03       /* time constant with which the foothold follows the DCM */
#define ACROSS_PART 0.45    /* fraction of the swing in which the foothold follows sideways, */
#define ALONG_PART 0.63     /* and lengthwise; later the leg's motion disturbs the DCM */
#define ON_PART 0.6         /* other foot follows if the DCM is beyond this part of the way */
#define ON_TRANSFER_S 0.12
#define CALM_S 0.3    /* at rest: has stood for this time, */
#define CALM_M 0.025  /* with the DCM this close to its plan */
#define BESIDE_M 0.03 /* offset of the feet from side by side that needs no further step */

/* ---- the divergent component of motion ---- */

void dcm_add(struct dcm_plan *plan, double duration_s, const double from[2], const double to[2])
{
    if (plan->nline < DCM_LINES && duration_s > 0) {
        plan->line[plan->nline++] =
            (struct dcm_line){duration_s, {from[0], from[1]}, {to[0], to[1]}};
    }
}

/* Computes xi at the time left_s before the end of a line, from xi at the end (see gait.h). */
static void dcm_line_back(const struct dcm_line *line, double omega, double left_s,
                          const double end[2], double dcm[2])
{
    double decay = portable_exp(-omega * left_s);

    for (int k = 0; k < 2; k++) {
        double rate = (line->to[k] - line->from[k]) / line->duration_s;
        double zmp = line->to[k] - rate * left_s;

        dcm[k] = zmp + rate / omega + decay * (end[k] - line->to[k] - rate / omega);
    }
}

/* Computes xi at the end of the first line. Starts at the end of the plan, where xi is at rest, and
 * goes backward. */
static void dcm_first_end(const struct dcm_plan *plan, double end[2])
{
    const struct dcm_line *last = &plan->line[plan->nline - 1];

    end[0] = last->to[0];
    end[1] = last->to[1];
    for (size_t i = plan->nline; i-- > 1;) {
        double begin[2];

        dcm_line_back(&plan->line[i], plan->omega, plan->line[i].duration_s, end, begin);
        end[0] = begin[0];
        end[1] = begin[1];
    }
}

void dcm_begin_at(struct dcm_plan *plan, const double dcm[2])
{
    struct dcm_line *first = &plan->line[0];
    double lasts = plan->omega * first->duration_s, decay = portable_exp(-lasts), end[2];

    dcm_first_end(plan, end);
    /* Solve the equation of gait.h for r0, with r' = (r1 - r0) / T */
    for (int k = 0; k < 2; k++) {
        first->from[k] =
            (dcm[k] - first->to[k] * (1 - decay) / lasts - decay * (end[k] - first->to[k])) /
            (1 - (1 - decay) / lasts);
    }
}

void dcm_evaluate(const struct dcm_plan *plan, double elapsed_s, double zmp[2], double dcm[2],
                  double dcm_end[2])
{
    const struct dcm_line *first = &plan->line[0];
    double share = fmin(fmax(elapsed_s / first->duration_s, 0), 1), end[2];

    dcm_first_end(plan, end);
    dcm_line_back(first, plan->omega, (1 - share) * first->duration_s, end, dcm);
    for (int k = 0; k < 2; k++) {
        zmp[k] = first->from[k] + share * (first->to[k] - first->from[k]);
        dcm_end[k] = end[k];
    }
}

void dcm_advance(double omega, double duration_s, const double zmp[2], const double dcm[2],
                 double after[2])
{
    double growth = portable_exp(omega * duration_s);

    for (int k = 0; k < 2; k++) {
        after[k] = zmp[k] + growth * (dcm[k] - zmp[k]);
    }
}

/* ---- footholds ---- */

static int gait_other(int side)
{
    return BODY_SIDES - 1 - side;
}

/* Returns the sign of y away from the other foot: +1 for the left foot, -1 for the right foot. */
static double gait_outward(int side)
{
    return side == BODY_LEFT ? 1 : -1;
}

static void gait_offset(const struct gait_foothold *from, double ahead, double left, double to[2])
{
    to[0] = from->p[0] + portable_cos(from->yaw) * ahead - portable_sin(from->yaw) * left;
    to[1] = from->p[1] + portable_sin(from->yaw) * ahead + portable_cos(from->yaw) * left;
}

void gait_into_foot(const struct gait_foothold *foot, const double point[2], double in[2])
{
    double x = point[0] - foot->p[0], y = point[1] - foot->p[1];

    in[0] = portable_cos(foot->yaw) * x + portable_sin(foot->yaw) * y;
    in[1] = -portable_sin(foot->yaw) * x + portable_cos(foot->yaw) * y;
}

void gait_foot_zmp(const struct gait *gait, int side, const struct gait_foothold *foot,
                   double zmp[2])
{
    gait_offset(foot, gait->config.zmp_ahead_m, -gait_outward(side) * gait->config.zmp_inward_m,
                zmp);
}

/* Computes the zero-moment point of standing: midway between the zero-moment points of the feet. */
static void gait_middle_zmp(const struct gait *gait, const struct gait_foothold foot[BODY_SIDES],
                            double zmp[2])
{
    double side[BODY_SIDES][2];

    for (int i = 0; i < BODY_SIDES; i++) {
        gait_foot_zmp(gait, i, &foot[i], side[i]);
    }
    zmp[0] = (side[0][0] + side[1][0]) / 2;
    zmp[1] = (side[0][1] + side[1][1]) / 2;
}

/* Computes the next foothold of foot `side` from the commanded velocity, while the other foot
 * stands. close: put the foot beside the standing foot. */
static void gait_foothold_of(const struct gait *gait, int side, const struct gait_foothold *stance,
                             bool close, struct gait_foothold *to)
{
    const struct gait_config *config = &gait->config;
    double period = config->swing_s + config->transfer_s, out = gait_outward(side);
    double ahead = close ? 0 : gait->command.forward_m_s * period;
    double left = out * config->width_m + (close ? 0 : gait->command.left_m_s * period);
    double turn = close ? 0 : gait->command.turn_rad_s * period;
    struct gait_foothold center = *stance;
    double middle[2], away[2];

    /* Keep the minimum distance, so that the feet do not collide */
    if (out * left < config->least_width_m) {
        left = out * config->least_width_m;
    }
    /* Rotate about the midpoint of the feet */
    gait_offset(stance, 0, out * config->width_m / 2, middle);
    memcpy(center.p, middle, sizeof middle);
    center.yaw = stance->yaw + turn;
    gait_offset(&center, ahead, left - out * config->width_m / 2, to->p);
    to->yaw = center.yaw;
    /* Predict height and tilt: assume that the plane of the standing sole continues */
    gait_into_foot(stance, to->p, away);
    to->roll = config->ground_follow * stance->roll;
    to->pitch = config->ground_follow * stance->pitch;
    to->p[2] = stance->p[2] - portable_tan(to->pitch) * away[0] + portable_tan(to->roll) * away[1];
}

void gait_start(struct gait *gait, const struct gait_config *config, double omega,
                const struct gait_foothold foot[BODY_SIDES], const double com[2])
{
    memset(gait, 0, sizeof *gait);
    gait->config = *config;
    gait->omega = omega;
    memcpy(gait->now.foot, foot, sizeof gait->now.foot);
    memcpy(gait->now.com, com, sizeof gait->now.com);
    gait->now.share[0] = gait->now.share[1] = 0.5;
    gait->now.yaw = (foot[0].yaw + foot[1].yaw) / 2;
    gait_middle_zmp(gait, foot, gait->now.zmp);
    memcpy(gait->now.dcm, gait->now.zmp, sizeof gait->now.dcm);
}

/* Returns the position of a point along the line from the right foot's planned zero-moment point
 * (0) to the left foot's (1). */
static double gait_left_share(const struct gait *gait, const double point[2])
{
    double side[BODY_SIDES][2], along[2], square;

    for (int i = 0; i < BODY_SIDES; i++) {
        gait_foot_zmp(gait, i, &gait->now.foot[i], side[i]);
    }
    along[0] = side[BODY_LEFT][0] - side[BODY_RIGHT][0];
    along[1] = side[BODY_LEFT][1] - side[BODY_RIGHT][1];
    square = along[0] * along[0] + along[1] * along[1];
    return ((point[0] - side[BODY_RIGHT][0]) * along[0] +
            (point[1] - side[BODY_RIGHT][1]) * along[1]) /
           square;
}

/* ---- the plan ---- */

/* Appends the plan after the present swing: transfers and swings over the next footholds, then the
 * line to the midpoint of the feet, where the DCM comes to rest. */
static void gait_plan_future(const struct gait *gait, struct dcm_plan *plan)
{
    const struct gait_config *config = &gait->config;
    int swing = gait_other(gait->now.stance);
    struct gait_foothold foot[BODY_SIDES];
    bool closing = gait->closing;
    double from[2], to[2];

    foot[gait->now.stance] = gait->now.foot[gait->now.stance];
    foot[swing] = gait->next;
    gait_foot_zmp(gait, gait->now.stance, &foot[gait->now.stance], from);
    /* Alternate steps at the commanded velocity, until the command is to stand */
    for (int i = 0; i < PREVIEW && !closing; i++) {
        int stance = swing;

        gait_foot_zmp(gait, stance, &foot[stance], to);
        dcm_add(plan, config->transfer_s, from, to);
        dcm_add(plan, config->swing_s, to, to);
        memcpy(from, to, sizeof from);
        swing = gait_other(stance);
        closing = !gait->command.step;
        gait_foothold_of(gait, swing, &foot[stance], closing, &foot[swing]);
    }
    gait_middle_zmp(gait, foot, to);
    dcm_add(plan, config->start_s, from, to);
}

/* Fills the plan with lines of the zero-moment point, from the beginning of the present phase. */
static void gait_plan(const struct gait *gait, struct dcm_plan *plan)
{
    double stance[2], to[2];

    plan->omega = gait->omega;
    plan->nline = 0;
    gait_foot_zmp(gait, gait->now.stance, &gait->now.foot[gait->now.stance], stance);
    switch (gait->now.phase) {
    /* Standing: the zero-moment point stays at the midpoint; the duration is arbitrary */
    case GAIT_STAND:
        gait_middle_zmp(gait, gait->now.foot, to);
        dcm_add(plan, 1, to, to);
        return;
    /* Transfer: from the present point to the next standing foot, or to the midpoint at the end */
    case GAIT_TRANSFER:
        if (gait->closing) {
            gait_middle_zmp(gait, gait->now.foot, to);
            dcm_add(plan, gait->duration_s, gait->zmp_from, to);
            return;
        }
        dcm_add(plan, gait->duration_s, gait->zmp_from, stance);
        dcm_add(plan, gait->config.swing_s, stance, stance);
        break;
    /* Swing: the point stays under the standing foot */
    case GAIT_SWING:
        dcm_add(plan, gait->duration_s, stance, stance);
        break;
    }
    gait_plan_future(gait, plan);
}

/* ---- phases ---- */

static void gait_begin(struct gait *gait, enum gait_phase phase, double duration_s)
{
    gait->now.phase = phase;
    gait->elapsed_s = 0;
    gait->duration_s = duration_s;
}

/* Begins the next step with its transfer. stance: the foot that will stand while the other foot
 * swings. */
static void gait_begin_step(struct gait *gait, int stance, double transfer_s)
{
    int swing = gait_other(stance);

    memcpy(gait->zmp_from, gait->now.zmp, sizeof gait->zmp_from);
    gait->now.stance = stance;
    gait->closing = false;
    gait_foothold_of(gait, swing, &gait->now.foot[stance], !gait->command.step, &gait->next);
    memset(gait->shift, 0, sizeof gait->shift);
    gait_begin(gait, GAIT_TRANSFER, transfer_s);
}

/* Sets the foothold of the foot in the air to the foot's measured place. gait_feel_ground sets the
 * tilt. */
static void gait_land(struct gait *gait, const struct gait_measured *measured)
{
    int swing = gait_other(gait->now.stance);
    struct gait_foothold *foot = &gait->now.foot[swing];

    memcpy(foot->p, measured->foot[swing].p, sizeof foot->p);
    foot->yaw = measured->foot[swing].yaw;
    gait->now.height_m = 0;
    gait->next = *foot;
    gait->landed = true;
}

/* Returns whether the present phase is over. A swing is over when its time has passed, and the foot
 * has landed or is completely lowered. */
static bool gait_phase_over(const struct gait *gait)
{
    double late = gait->elapsed_s - gait->duration_s;

    if (gait->now.phase != GAIT_SWING) {
        return gait->elapsed_s >= gait->duration_s;
    }
    if (gait->catches) {
        return gait->landed || late >= CATCH_LATE_S;
    }
    return late >= 0 && (gait->landed || late * gait->config.lower_m_s >= gait->config.lower_m);
}

/* Changes the present transfer so that it starts from this DCM. */
static void gait_begin_at(struct gait *gait, const double dcm[2])
{
    struct dcm_plan plan;

    gait_plan(gait, &plan);
    dcm_begin_at(&plan, dcm);
    memcpy(gait->zmp_from, plan.line[0].from, sizeof gait->zmp_from);
}

/* Begins the first step from standing. Later steps begin at the present zero-moment point. The
 * first step chooses the point for which the DCM does not jump. */
static void gait_set_out(struct gait *gait, int stance)
{
    gait_begin_step(gait, stance, gait->config.start_s);
    gait_begin_at(gait, gait->now.dcm);
}

/* ---- the step that catches a pushed robot (capture step) ---- */

/* Returns the horizontal distance between two points, m. */
static double gait_apart(const double a[2], const double b[2])
{
    double x = a[0] - b[0], y = a[1] - b[1];

    return sqrt(x * x + y * y);
}

/* Returns the distance (m) of the DCM beyond the range of the center of pressure; negative inside.
 * The range is the reach of a sole around the point of the line between the feet that is nearest
 * to the DCM. A sideways fall gets no step: the foot on that side carries the weight, and the
 * other leg would have to cross this leg. */
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

/* Begins, without a transfer, the swing of the foot that is farther from the DCM. */
static void gait_begin_catch(struct gait *gait, const struct gait_measured *measured)
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
    /* Store the standing foot's share of the weight. Without a transfer, the ramp of the weight
     * starts from this share */
    gait->bore = now->share[now->stance];
    gait->catches = true;
    gait->closing = gait->landed = false;
    gait->apart = true;
    /* Start with a foothold beside the standing foot; gait_place_catch moves the foothold */
    gait->lift = now->foot[swing];
    gait_foothold_of(gait, swing, &now->foot[now->stance], true, &gait->next);
    memset(gait->shift, 0, sizeof gait->shift);
    gait_begin(gait, GAIT_SWING, gait->config.catch_swing_s);
}

/* Moves the foothold to the predicted DCM at landing. The foothold never moves closer: a step that
 * is too short tips the robot over, but a longer step does no harm. */
static void gait_place_catch(struct gait *gait, const double after[2], double dt_s)
{
    const struct gait_config *config = &gait->config;
    const struct gait_foothold *at = &gait->now.foot[gait->now.stance];
    double out = gait_outward(gait_other(gait->now.stance)), reach = config->catch_reach_m;
    double was[2], to[2], goal[2];

    /* In the heading of the standing foot, limit the foothold to its reach, and never move it
     * closer */
    gait_into_foot(at, gait->next.p, was);
    gait_into_foot(at, after, to);
    to[0] = fmin(fmax(to[0] - config->zmp_ahead_m, -reach), reach);
    to[1] = fmin(fmax(out * to[1], config->least_width_m), config->width_m + config->reach_out_m);
    to[0] = fabs(to[0]) < fabs(was[0]) ? was[0] : to[0];
    to[1] = out * fmax(to[1], out * was[1]);
    if (gait->elapsed_s > ACROSS_PART * gait->duration_s) {
        to[1] = was[1];
    }
    /* Transform back into the world, smoothed */
    gait_offset(at, to[0], to[1], goal);
    for (int k = 0; k < 2; k++) {
        gait->next.p[k] += (goal[k] - gait->next.p[k]) * fmin(dt_s / FOLLOW_S, 1);
    }
}

/* Computes zero-moment point, DCM and foothold of the catching swing. */
static void gait_plan_catch(struct gait *gait, const struct gait_measured *measured, double dt_s)
{
    const struct gait_config *config = &gait->config;
    struct gait_reference *now = &gait->now;
    const struct gait_foothold *at = &now->foot[now->stance];
    double side = config->sole_side_m - config->sole_margin_m, in[2], after[2];

    /* Move the center of pressure against the fall, as far as the standing sole reaches */
    gait_into_foot(at, measured->dcm, in);
    in[0] = fmin(fmax(in[0], config->sole_back_m + config->sole_margin_m),
                 config->sole_front_m - config->sole_margin_m);
    in[1] = fmin(fmax(in[1], -side), side);
    gait_offset(at, in[0], in[1], now->zmp);
    /* Set the plan to the measurement, so that the DCM feedback has no effect */
    memcpy(now->dcm, measured->dcm, sizeof now->dcm);

    dcm_advance(gait->omega, fmax(gait->duration_s - gait->elapsed_s, 0), now->zmp, measured->dcm,
                after);
    memcpy(gait->dcm_end, after, sizeof after);
    if (gait->elapsed_s <= ALONG_PART * gait->duration_s) {
        gait_place_catch(gait, after, dt_s);
    }
}

/* Returns whether the robot has come to rest with its feet apart. */
static bool gait_rests_apart(const struct gait *gait, const struct gait_measured *measured)
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

/* ---- from phase to phase ---- */

/* Begins the next phase. The order is stand, transfer, swing, transfer, ..., stand. */
static void gait_end_phase(struct gait *gait, const struct gait_measured *measured)
{
    int swing = gait_other(gait->now.stance);
    double scale, left;

    switch (gait->now.phase) {
    /* Standing does not end here; gait_update begins a step */
    case GAIT_STAND:
        break;
    /* Stand after a closing transfer; otherwise begin the swing */
    case GAIT_TRANSFER:
        if (gait->closing) {
            gait->closing = false;
            gait_begin(gait, GAIT_STAND, 1);
            return;
        }
        /* Adopt the commanded duration of a step, with a change of at most TIME_CHANGE per step. At
         * the beginning of a swing, a change of later parts moves the planned DCM only by one or
         * two millimeters */
        if (gait->command.step_s > 0) {
            scale = gait->command.step_s / (gait->config.swing_s + gait->config.transfer_s);
            scale = fmin(fmax(scale, 1 - TIME_CHANGE), 1 + TIME_CHANGE);
            gait->config.swing_s *= scale;
            gait->config.transfer_s *= scale;
        }
        gait->lift = gait->now.foot[swing];
        gait->closing = !gait->command.step;
        gait->landed = gait->catches = false;
        gait_foothold_of(gait, swing, &gait->now.foot[gait->now.stance], gait->closing,
                         &gait->next);
        gait_begin(gait, GAIT_SWING, gait->config.swing_s);
        break;
    /* Treat the foot as landed, with or without contact. Transfer to it, or to the midpoint */
    case GAIT_SWING:
        gait->steps++;
        if (!gait->landed) {
            gait_land(gait, measured);
        }
        /* After a catching swing, the other foot follows with a step if the DCM has moved to the
         * new foot. Otherwise the feet stay apart */
        left = gait_left_share(gait, measured->dcm);
        if (gait->catches && (swing == BODY_LEFT ? left : 1 - left) > ON_PART) {
            gait->catches = false;
            gait_begin_step(gait, swing, ON_TRANSFER_S);
        } else if (gait->catches) {
            gait->catches = false;
            gait->closing = true;
            gait_begin(gait, GAIT_TRANSFER, gait->config.start_s);
            gait_begin_at(gait, measured->dcm);
        } else if (gait->closing) {
            memcpy(gait->zmp_from, gait->now.zmp, sizeof gait->zmp_from);
            gait_begin(gait, GAIT_TRANSFER, gait->config.start_s);
        } else {
            gait_begin_step(gait, swing, gait->config.transfer_s);
        }
        break;
    }
}

/* ---- the foot in the air ---- */

/* Moves the next foothold by the predicted error of the DCM at the end of the swing. */
static void gait_adjust_foothold(struct gait *gait, const double dcm[2], double dt_s)
{
    const struct gait_config *config = &gait->config;
    int stance = gait->now.stance, swing = gait_other(stance);
    const struct gait_foothold *at = &gait->now.foot[stance];
    double left_s = fmax(gait->duration_s - gait->elapsed_s, 0), out = gait_outward(swing);
    double lasts = gait->omega * config->transfer_s, follow = (1 - portable_exp(-lasts)) / lasts;
    double after[2], move[2], ahead, left, goal[2];
    double able = config->ankle_m * (portable_exp(gait->omega * left_s) - 1);
    struct gait_foothold plain;

    /* dcm_end is planned for the present foothold. A foothold that is 1 m farther moves the DCM at
     * the start of the transfer by `follow` meters. Divide the error by `follow` */
    dcm_advance(gait->omega, left_s, gait->now.zmp, dcm, after);
    gait_foothold_of(gait, swing, at, gait->closing, &plain);
    /* The center of pressure, which can move by at most ankle_m, removes a part of the error.
     * Compute the adjustment of the foothold that removes the rest */
    for (int k = 0; k < 2; k++) {
        double error = after[k] - (gait->dcm_end[k] - follow * gait->shift[k]);

        error = error > able ? error - able : error < -able ? error + able : 0;
        move[k] = plain.p[k] - at->p[k] + config->adjust * error / follow;
    }

    /* Limit the adjustment to the reach of the standing leg, in the foot's heading */
    ahead = portable_cos(at->yaw) * move[0] + portable_sin(at->yaw) * move[1];
    left = -portable_sin(at->yaw) * move[0] + portable_cos(at->yaw) * move[1];
    ahead = fmin(fmax(ahead, -config->reach_back_m), config->reach_ahead_m);
    left =
        out * fmin(fmax(out * left, config->least_width_m), config->width_m + config->reach_out_m);
    gait_offset(at, ahead, left, goal);
    /* Filter the adjustment, so that measurement noise does not move the foot */
    for (int k = 0; k < 2; k++) {
        gait->shift[k] += (goal[k] - plain.p[k] - gait->shift[k]) * fmin(dt_s / ADJUST_S, 1);
        gait->next.p[k] = plain.p[k] + gait->shift[k];
    }
}

/* Returns the minimum-jerk curve (quintic) from 0 to 1. Velocity and acceleration are 0 at both
 * ends. */
static double gait_ease(double s)
{
    s = fmin(fmax(s, 0), 1);
    return s * s * s * (10 - 15 * s + 6 * s * s);
}

/* Updates the pose and acceleration of the foot in the air from the progress of the swing. */
static void gait_swing_foot(struct gait *gait)
{
    int swing = gait_other(gait->now.stance);
    struct gait_foothold *foot = &gait->now.foot[swing];
    double s = gait->now.progress, way = (s - 0.05) / 0.85, along = gait_ease(way);
    /* The second derivative of gait_ease */
    double bend = way <= 0 || way >= 1 ? 0 : way * (60 + way * (-180 + 120 * way));
    double stretch = 1 / (0.85 * gait->duration_s);
    /* The foot rises in the first 45 % of the swing and falls in the second half. It moves
     * horizontally between 5 % and 90 % */
    double up = s < 0.5 ? gait_ease(s / 0.45) : 1 - gait_ease((s - 0.5) / 0.5);
    double late = fmax(gait->elapsed_s - gait->duration_s, 0);
    double high = gait->catches ? gait->config.catch_clearance_m : gait->config.clearance_m;
    double lower = gait->catches ? CATCH_LOWER_M_S : gait->config.lower_m_s;

    if (gait->landed) {
        return;
    }
    /* Interpolate between lift-off and the next foothold */
    for (int k = 0; k < 3; k++) {
        foot->p[k] = gait->lift.p[k] + along * (gait->next.p[k] - gait->lift.p[k]);
    }
    /* Compute the acceleration, the second derivative by time */
    for (int k = 0; k < 2; k++) {
        gait->now.foot_m_s2[k] = (gait->next.p[k] - gait->lift.p[k]) * stretch * stretch * bend;
    }
    foot->yaw = gait->lift.yaw + along * (gait->next.yaw - gait->lift.yaw);
    foot->roll = gait->lift.roll + along * (gait->next.roll - gait->lift.roll);
    foot->pitch = gait->lift.pitch + along * (gait->next.pitch - gait->lift.pitch);
    /* Lower a late foot further */
    gait->now.height_m = high * up - fmin(late * lower, gait->config.lower_m);
}

/* ---- the complete update ---- */

void gait_update(struct gait *gait, const struct gait_command *command,
                 const struct gait_measured *measured, double dt_s)
{
    struct gait_reference *now = &gait->now;
    struct dcm_plan plan;
    double decay = portable_exp(-gait->omega * dt_s);
    bool stands;

    /* Start to walk, end a phase whose time is over, or step at once if the robot falls */
    gait->command = *command;
    gait->elapsed_s += dt_s;
    if (now->phase == GAIT_STAND && command->step) {
        gait_set_out(gait, command->left_m_s > 0 ? BODY_RIGHT : BODY_LEFT);
    } else if (gait_rests_apart(gait, measured)) {
        gait_set_out(gait, now->stance);
    } else if (gait_phase_over(gait)) {
        gait_end_phase(gait, measured);
    }
    stands = now->phase == GAIT_STAND ||
             (now->phase == GAIT_TRANSFER && gait->closing && gait->elapsed_s > SETTLE_S);
    if (gait->config.catch_swing_s > 0 && stands &&
        gait_beyond_soles(gait, measured->dcm) > -gait->config.catch_margin_m) {
        gait_begin_catch(gait, measured);
    }
    /* Measure the ground, press a landed foot, and land or steer a foot in the air */
    now->progress = gait->duration_s > 0 ? fmin(gait->elapsed_s / gait->duration_s, 1) : 0;

    /* Update the tilt of the footholds from soles that lie flat, with the time constant tilt_s */
    double share = dt_s / (gait->config.tilt_s + dt_s);

    for (int i = 0; i < BODY_SIDES; i++) {
        /* Only the foot that landed last can measure a new tilt */
        bool new = gait->now.phase == GAIT_SWING
                       ? i != gait->now.stance && gait->landed
                       : gait->now.phase == GAIT_TRANSFER &&i == gait->now.stance;

        if (new && measured->flat[i]) {
            gait->now.foot[i].roll += share * (measured->foot[i].roll - gait->now.foot[i].roll);
            gait->now.foot[i].pitch += share * (measured->foot[i].pitch - gait->now.foot[i].pitch);
        }
    }

    if (now->phase == GAIT_SWING && gait->landed) {
        /* Press a foot that landed early with a small force until the swing ends, so that it
         * neither bounces nor pushes the robot up */
        double lacks = 1 - measured->force_n[gait_other(now->stance)] / gait->config.press_n;

        now->foot[gait_other(now->stance)].p[2] -= gait->config.lower_m_s * fmax(lacks, -1) * dt_s;
    } else if (now->phase == GAIT_SWING) {
        if (now->progress > EARLIEST && measured->touches[gait_other(now->stance)]) {
            gait_land(gait, measured);
        } else if (gait->config.adjust > 0 && !gait->catches) {
            gait_adjust_foothold(gait, measured->dcm, dt_s);
        }
    }
    /* Renew the plan of the zero-moment point and the DCM; a catching step has its own plan */
    gait_plan(gait, &plan);
    dcm_evaluate(&plan, gait->elapsed_s, now->zmp, now->dcm, gait->dcm_end);
    if (now->phase == GAIT_SWING && gait->catches) {
        gait_plan_catch(gait, measured, dt_s);
    }
    /* Place the foot in the air */
    now->height_m = 0;
    memset(now->foot_m_s2, 0, sizeof now->foot_m_s2);
    /* Compute the shares of the weight. In a swing, one foot carries all; in a catching swing,
     * it takes the weight over gradually. Otherwise the zero-moment point's position gives the
     * shares */
    if (now->phase == GAIT_SWING) {
        gait_swing_foot(gait);
        now->share[now->stance] =
            gait->catches ? gait->bore + (1 - gait->bore) * fmin(gait->elapsed_s / LOAD_S, 1) : 1;
        now->share[gait_other(now->stance)] = 1 - now->share[now->stance];
    } else {
        now->share[BODY_LEFT] = fmin(fmax(gait_left_share(gait, now->zmp), 0), 1);
        now->share[BODY_RIGHT] = 1 - now->share[BODY_LEFT];
    }

    /* Let the center of mass follow the DCM: c' = omega (xi - c) */
    for (int k = 0; k < 2; k++) {
        now->com[k] = now->dcm[k] + decay * (now->com[k] - now->dcm[k]);
        if (now->phase == GAIT_SWING && gait->catches) {
            now->com[k] += (measured->com[k] - now->com[k]) * dt_s / CATCH_COM_S;
        }
        now->com_m_s[k] = gait->omega * (now->dcm[k] - now->com[k]);
    }
    /* The pelvis's heading is the mean of the feet's headings */
    now->yaw = (now->foot[0].yaw + now->foot[1].yaw) / 2;
}
