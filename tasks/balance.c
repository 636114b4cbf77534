/* SPDX-License-Identifier: Apache-2.0 */
/* The balance controller. It distributes the load to the feet, computes the motors' references,
 * moves into the posture, and runs the control periods. */
#include "tasks/balance.h"

#include "base/portable_math.h"
#include "base/vec3.h"
#include "tasks/leg.h"

#include <math.h>
#include <string.h>

#define RAMP_S 1.5   /* duration of the ramp from the initial pose to the posture */
#define SETTLE_S 0.5 /* wait after the ramp, until the springs are at rest */
#define LOAD_S 0.3   /* duration in which the motors take over the weight */

/* Longest dead time (bus round trip plus loop period) for which the configured gains apply, ns */
#define ROUND_TRIP_NS 2e6

#define FOOT_S 0.15  /* time constant with which a landed foot's target moves to its place */
#define STOP_S 0.03  /* time constant of a landed foot's height, short because of ground contact */
#define SWING_S 0.01 /* time constant with which a foot in the air follows the plan */
#define RATE_S 0.004 /* time constant of the filter of the references' rates */
#define KNEE_MIN 0.15
#define KNEE_MAX 1.9

struct balance_leg {
    /* links by enum leg_joint; links in the order from the pelvis to the foot */
    int link[LEG_JOINTS], chain[LEG_JOINTS];
    size_t axis[LEG_JOINTS];
    struct leg_geometry geometry;
    double inertia_kg_m2;      /* inertia of the leg about its hip, in the posture */
    double sole_m[3];          /* origin of the sole in the foot's frame */
    struct gait_foothold foot; /* target of the sole */
    double touched_s;          /* time for which the foot has carried load */
    double turn[2];            /* compliant tilt of the foot: roll, pitch, rad */
    double stretch_m;          /* compliant length of the leg */
    double cop_m[2];           /* desired center of pressure in the sole's frame */
    double carries;
    double weight; /* desired share of the weight, 0 to 1 */
    double torque_nm[LEG_JOINTS];
    double motor_rad[LEG_JOINTS], rate_rad_s[LEG_JOINTS]; /* motor references */
};

struct balance {
    struct balance_config config;
    const struct body_model *model;
    struct host *host;
    struct servo *servo;
    struct estimator *estimator;
    struct gait gait;
    struct balance_leg leg[BODY_SIDES];
    const double *initial;
    struct servo_gains *gains; /* by axis */
    double *angle, *from;      /* by axis: link references; initial angles */
    struct body_pose *pose;    /* by link, at `angle` */
    double com_height_m, omega;
    double t_s;
    bool ready;
    double zmp[2];      /* desired zero-moment point */
    double ground_m;    /* smoothed ground height under the pelvis */
    double pelvis_m[3]; /* desired position of the pelvis */
};

/* ---- the feet ---- */

/* Fills the gait's measurements: footholds, contact, vertical forces, center of mass and DCM. */
static void balance_measure(struct balance *balance, struct gait_measured *measured, double dt_s)
{
    const struct estimate *estimate = estimator_read(balance->estimator);
    const struct gait_config *gait = &balance->config.gait;

    for (int i = 0; i < BODY_SIDES; i++) {
        struct balance_leg *leg = &balance->leg[i];
        const struct estimate_foot *foot = &estimate->foot[i];
        const double *R = foot->sole.R;
        double turns = round((balance->gait.now.yaw - foot->yaw_rad) / (2 * M_PI));

        leg->touched_s = foot->force_n[2] > balance->config.touch_n ? leg->touched_s + dt_s : 0;
        /* Unwrap the yaw to within half a turn of the planned yaw */
        measured->foot[i] = (struct gait_foothold){
            .p = {foot->anchor[0], foot->anchor[1], foot->anchor[2]},
            .yaw = foot->yaw_rad + 2 * M_PI * turns,
            .roll = portable_atan2(R[7], R[8]),
            .pitch = portable_asin(fmin(fmax(-R[6], -1), 1)),
        };
        measured->touches[i] = leg->touched_s > balance->config.touch_s;
        measured->force_n[i] = foot->force_n[2];
        /* A sole counts as flat if it carries load and its center of pressure is inside its edges.
         * If a sole stands on an edge, the center of pressure is at this edge */
        measured->flat[i] = foot->force_n[2] > balance->config.flat_n &&
                            foot->cop_m[0] < gait->sole_front_m - gait->sole_margin_m &&
                            foot->cop_m[0] > gait->sole_back_m + gait->sole_margin_m &&
                            fabs(foot->cop_m[1]) < gait->sole_side_m - gait->sole_margin_m;
    }
    for (int k = 0; k < 2; k++) {
        measured->com[k] = estimate->com_m[k];
        measured->dcm[k] = estimate->com_m[k] + estimate->com_m_s[k] / balance->omega;
    }
}

/* Distributes the desired zero-moment point to the feet. The position along the line between the
 * feet gives the shares of the weight. The position across the line gives the centers of pressure,
 * which are limited to the soles. */
static void balance_share(struct balance *balance)
{
    const struct balance_config *config = &balance->config;
    const struct gait_reference *plan = &balance->gait.now;
    double at[BODY_SIDES][2], line[2], left = plan->share[BODY_LEFT], rest[2];
    double side_m = config->gait.sole_side_m - config->gait.sole_margin_m;

    /* Compute the line from the right foot's to the left foot's zero-moment point */
    for (int i = 0; i < BODY_SIDES; i++) {
        gait_foot_zmp(&balance->gait, i, &plan->foot[i], at[i]);
    }
    line[0] = at[BODY_LEFT][0] - at[BODY_RIGHT][0];
    line[1] = at[BODY_LEFT][1] - at[BODY_RIGHT][1];
    /* With both feet on the ground, project the desired point onto the line */
    if (plan->phase != GAIT_SWING) {
        left = ((balance->zmp[0] - at[BODY_RIGHT][0]) * line[0] +
                (balance->zmp[1] - at[BODY_RIGHT][1]) * line[1]) /
               (line[0] * line[0] + line[1] * line[1]);
        left = fmin(fmax(left, 0), 1);
    }
    balance->leg[BODY_LEFT].weight = left;
    balance->leg[BODY_RIGHT].weight = 1 - left;
    /* Move both centers of pressure by the remainder, which is across the line */
    for (int k = 0; k < 2; k++) {
        rest[k] = balance->zmp[k] - (at[BODY_RIGHT][k] + left * line[k]);
    }
    for (int i = 0; i < BODY_SIDES; i++) {
        struct balance_leg *leg = &balance->leg[i];
        double point[2] = {at[i][0] + rest[0], at[i][1] + rest[1]};

        gait_into_foot(&plan->foot[i], point, leg->cop_m);
        /* Limit the center of pressure to the sole minus its margin */
        leg->cop_m[0] =
            fmin(fmax(leg->cop_m[0], config->gait.sole_back_m + config->gait.sole_margin_m),
                 config->gait.sole_front_m - config->gait.sole_margin_m);
        leg->cop_m[1] = fmin(fmax(leg->cop_m[1], -side_m), side_m);
    }
}

/* Makes the feet compliant with leaky integrators: moment errors tilt the soles, and the error of
 * the force difference changes the leg lengths. */
static void balance_yield(struct balance *balance, double dt_s)
{
    const struct balance_config *config = &balance->config;
    const struct estimate *estimate = estimator_read(balance->estimator);
    double weight = balance->model->mass_kg * balance->model->gravity_m_s2;
    /* Error of the vertical force difference, left minus right, N */
    double difference =
        weight * (balance->leg[BODY_LEFT].weight - balance->leg[BODY_RIGHT].weight) -
        (estimate->foot[BODY_LEFT].force_n[2] - estimate->foot[BODY_RIGHT].force_n[2]);

    for (int i = 0; i < BODY_SIDES; i++) {
        struct balance_leg *leg = &balance->leg[i];
        const struct estimate_foot *foot = &estimate->foot[i];
        double force = foot->loaded ? foot->force_n[2] : 0;
        double leak = 1 - config->cop_leak_per_s * dt_s;
        double sign = i == BODY_LEFT ? 1 : -1, light = 1 - leg->carries;
        double pitch =
            config->cop_pitch_rad_s_nm * leg->carries + config->land_turn_rad_s_nm * light;
        double roll = config->cop_roll_rad_s_nm * leg->carries + config->land_turn_rad_s_nm * light;

        /* Turn up the side of the foot with too much pressure */
        leg->turn[0] = leg->turn[0] * leak + roll * force * (foot->cop_m[1] - leg->cop_m[1]) * dt_s;
        leg->turn[1] =
            leg->turn[1] * leak - pitch * force * (foot->cop_m[0] - leg->cop_m[0]) * dt_s;
        /* Limit tilt to 0.2 rad and length to 0.03 m, so that the legs stay within reach */
        for (int k = 0; k < 2; k++) {
            leg->turn[k] = fmin(fmax(leg->turn[k], -0.2), 0.2);
        }
        leg->stretch_m = leg->stretch_m * (1 - config->force_leak_per_s * dt_s);
        if (balance->gait.now.phase != GAIT_SWING) {
            leg->stretch_m += sign * config->force_m_s_n * difference * dt_s;
        }
        leg->stretch_m = fmin(fmax(leg->stretch_m, -0.03), 0.03);
    }
}

/* ---- the joints ---- */

/* Computes the joint angles of a leg from the poses of pelvis and sole in the world. Returns false
 * if the sole is out of reach; the angles are then the nearest possible. */
static bool balance_leg_angles(const struct balance_leg *leg, const double pelvis_R[9],
                               const double pelvis_p[3], const double sole_R[9],
                               const double sole_p[3], double angle[LEG_JOINTS])
{
    struct body_pose foot;
    double ankle[3], back[9], away[3];

    mat3_apply(sole_R, leg->sole_m, ankle);
    vec3_sub(sole_p, ankle, ankle);
    vec3_sub(ankle, pelvis_p, away);
    mat3_apply_transposed(pelvis_R, away, foot.p);
    mat3_transpose(pelvis_R, back);
    mat3_mul(back, sole_R, foot.R);
    return leg_inverse(&leg->geometry, &foot, KNEE_MIN, KNEE_MAX, angle);
}

/* Computes the vector from the pelvis to the center of mass at the reference angles. R: rotation of
 * the pelvis in the frame of the result. */
static void balance_com_offset(struct balance *balance, const double R[9], double offset[3])
{
    double com[3];

    body_place(balance->model, balance->angle, balance->pose);
    body_center_of_mass(balance->model, balance->pose, com);
    mat3_apply(R, com, offset);
}

/* Computes the poses of pelvis and feet for this period, then the joint angles of the legs. */
static void balance_pose_legs(struct balance *balance, double dt_s)
{
    const struct balance_config *config = &balance->config;
    const struct estimate *estimate = estimator_read(balance->estimator);
    const struct gait_reference *plan = &balance->gait.now;
    double error[2] = {estimate->roll_rad, estimate->pitch_rad - config->lean_rad};
    double weight = balance->model->mass_kg * balance->model->gravity_m_s2;
    double askew = estimate->yaw_rad - plan->yaw;
    double upright[9], offset[3], ground = 0;
    const double rpy[3] = {0, config->lean_rad, plan->yaw};

    /* Place the pelvis under the planned center of mass, upright except for the lean */
    mat3_from_rpy(rpy, upright);
    balance_com_offset(balance, upright, offset);
    for (int i = 0; i < BODY_SIDES; i++) {
        const struct gait_foothold *to = &plan->foot[i];
        struct gait_foothold *foot = &balance->leg[i].foot;
        bool swings = plan->phase == GAIT_SWING && plan->stance != i;
        bool lands = swings && balance->gait.landed;
        double share = swings && !lands ? dt_s / SWING_S : dt_s / FOOT_S;
        double up = swings ? plan->height_m : 0;

        /* Move the target of a foot toward the plan. If the foot has landed elsewhere, the
         * target moves with the time constant FOOT_S, because a jump would press the legs
         * against each other. */
        for (int k = 0; k < 2; k++) {
            foot->p[k] += fmin(share, 1) * (to->p[k] - foot->p[k]);
        }
        foot->p[2] += (lands ? dt_s / STOP_S : fmin(share, 1)) * (to->p[2] + up - foot->p[2]);
        foot->yaw += fmin(share, 1) * (to->yaw - foot->yaw);
        foot->roll += fmin(share, 1) * (to->roll - foot->roll);
        foot->pitch += fmin(share, 1) * (to->pitch - foot->pitch);
        ground += 0.5 * plan->foot[i].p[2];
    }
    /* Wrap the error of the heading to -pi to pi */
    askew -= 2 * M_PI * round(askew / (2 * M_PI));
    /* Let the pelvis's height follow the smoothed mean height of the planned footholds */
    balance->pelvis_m[0] = plan->com[0] - offset[0];
    balance->pelvis_m[1] = plan->com[1] - offset[1];
    balance->ground_m += (ground - balance->ground_m) * dt_s / (config->height_s + dt_s);
    balance->pelvis_m[2] = balance->ground_m + config->pelvis_height_m;

    for (int i = 0; i < BODY_SIDES; i++) {
        struct balance_leg *leg = &balance->leg[i];
        /* Load of the foot, 0 to 1; 1 = at least 30 % of the weight */
        double load = fmin(fmax(estimate->foot[i].force_n[2] / (0.3 * weight), 0), 1);
        double carries = leg->carries +=
            (load - leg->carries) * dt_s / (balance->config.carry_s + dt_s);
        double R[9], sole_R[9], sole_p[3], angle[LEG_JOINTS];
        /* A loaded leg uses the planned attitude of the pelvis, so that the foot corrects attitude
         * errors. A leg in the air uses the measured attitude, so that the foot reaches its planned
         * place */
        double led[3] = {(1 - carries) * error[0], config->lean_rad + (1 - carries) * error[1],
                         plan->yaw + (1 - carries) * askew};
        double sole[3] = {leg->foot.roll + leg->turn[0], leg->foot.pitch + leg->turn[1],
                          leg->foot.yaw};
        double pelvis[3];

        mat3_from_rpy(led, R);
        /* Add the compliance to the sole's pose: tilt and leg length */
        mat3_from_rpy(sole, sole_R);
        memcpy(sole_p, leg->foot.p, sizeof sole_p);
        sole_p[2] -= leg->stretch_m;
        memcpy(pelvis, balance->pelvis_m, sizeof pelvis);
        pelvis[2] += (1 - carries) * config->swing_follow * (estimate->pelvis_m[2] - pelvis[2]);
        balance_leg_angles(leg, R, pelvis, sole_R, sole_p, angle);
        for (int j = 0; j < LEG_JOINTS; j++) {
            balance->angle[leg->axis[j]] = angle[j];
        }
    }
}

/* Computes the static torques of the legs. Each foot carries its share of the weight at its desired
 * center of pressure. The force points to the center of mass. */
static void balance_load_legs(struct balance *balance)
{
    const struct estimate *estimate = estimator_read(balance->estimator);
    double weight = balance->model->mass_kg * balance->model->gravity_m_s2;
    double down[3], plumb[3] = {0, 0, -1}, R[9];
    const double rpy[3] = {0, balance->config.lean_rad, balance->gait.now.yaw};

    mat3_from_rpy(rpy, R);
    mat3_apply_transposed(R, plumb, down);
    for (int i = 0; i < BODY_SIDES; i++) {
        struct balance_leg *leg = &balance->leg[i];
        struct body_pose sole;
        double point[3], force[3], world[3], cop[3] = {leg->cop_m[0], leg->cop_m[1], 0};

        /* Point of force: the desired center of pressure, in the pelvis's frame */
        body_place_frame(&balance->model->sole[i], &balance->pose[leg->chain[LEG_JOINTS - 1]],
                         &sole);
        mat3_apply(sole.R, cop, point);
        vec3_add_scaled(point, 1, sole.p, point);
        /* Force on the foot: its share of the weight, inclined like the pendulum; slope at most
         * 0.2 */
        for (int k = 0; k < 2; k++) {
            double lean = (estimate->com_m[k] - balance->zmp[k]) / balance->com_height_m;

            world[k] = leg->weight * weight * fmin(fmax(lean, -0.2), 0.2);
        }
        world[2] = leg->weight * weight;
        mat3_apply_transposed(R, world, force);
        /* Each joint carries the links from itself to the foot */
        for (int j = 0; j < LEG_JOINTS; j++) {
            leg->torque_nm[leg->geometry.chain[j]] =
                body_static_torque(balance->model, balance->pose, leg->chain + j,
                                   (size_t)(LEG_JOINTS - j), force, point, down);
        }
    }
}

/* Sets the references of all motors: link angle plus the spring's deflection under load. take: the
 * fraction of the load that is compensated, 0 to 1. loose: the fraction of the way from the initial
 * pose, 0 to 1. */
static void balance_drive(struct balance *balance, double take, double loose, double dt_s)
{
    const struct host_config *host = host_configuration(balance->host);

    /* Move joints outside the legs to their angles, without compensation */
    for (size_t i = 0; i < host->naxis; i++) {
        servo_set(balance->servo, i,
                  balance->from[i] + loose * (balance->angle[i] - balance->from[i]), 0);
    }
    for (int side = 0; side < BODY_SIDES; side++) {
        struct balance_leg *leg = &balance->leg[side];

        for (int j = 0; j < LEG_JOINTS; j++) {
            size_t axis = leg->axis[j];
            double load = take * leg->torque_nm[j];
            double link =
                balance->from[axis] + loose * (balance->angle[axis] - balance->from[axis]);
            double motor = link + load / host->axis[axis].drive.spring_nm_rad;
            double rate;

            /* Let ankles partly follow the measured angle, so that the sole adapts to the ground */
            if (balance->ready && (j == LEG_ANKLE_ROLL || j == LEG_ANKLE_PITCH)) {
                double follow = balance->config.ankle_follow * fmin(leg->weight / 0.3, 1);

                motor += follow * (host_joint(balance->host, axis)->joint_rad - link);
            }
            /* Feed-forward: the filtered rate of the reference */
            rate = dt_s > 0 ? (motor - leg->motor_rad[j]) / dt_s : 0;

            leg->rate_rad_s[j] += (rate - leg->rate_rad_s[j]) * dt_s / (RATE_S + dt_s);
            leg->motor_rad[j] = motor;
            servo_set(balance->servo, axis, motor, leg->rate_rad_s[j]);
            servo_set_load(balance->servo, axis, load);
        }
    }
}

/* ---- creation ---- */

/* Computes the standing posture, with the center of mass above the midpoint of the soles. Returns
 * false if the legs cannot reach the posture. */
static bool balance_find_posture(struct balance *balance)
{
    const struct gait_config *gait = &balance->config.gait;
    const double rpy[3] = {0, balance->config.lean_rad, 0};
    double R[9], flat[9], offset[3], pelvis[3] = {0, 0, balance->config.pelvis_height_m};
    bool reached = true;

    mat3_from_rpy(rpy, R);
    mat3_identity(flat);
    /* Iterate to a fixed point: the center of mass depends on the leg angles, the leg angles depend
     * on the pelvis, and the pelvis depends on the center of mass */
    memcpy(balance->angle, balance->initial,
           host_configuration(balance->host)->naxis * sizeof *balance->angle);
    for (int round = 0; round < 30; round++) {
        balance_com_offset(balance, R, offset);
        pelvis[0] = gait->zmp_ahead_m - offset[0];
        pelvis[1] = -offset[1];
        /* Compute joint angles for soles flat on the ground, width_m apart */
        for (int side = 0; side < BODY_SIDES; side++) {
            struct balance_leg *leg = &balance->leg[side];
            double sole[3] = {0, (side == BODY_LEFT ? 0.5 : -0.5) * gait->width_m, 0};
            double angle[LEG_JOINTS];

            reached = balance_leg_angles(leg, R, pelvis, flat, sole, angle) && reached;
            for (int j = 0; j < LEG_JOINTS; j++) {
                balance->angle[leg->axis[j]] = angle[j];
            }
        }
    }
    /* Compute each leg's inertia about the hip's pitch axis, with the links as point masses */
    for (int side = 0; side < BODY_SIDES; side++) {
        struct balance_leg *leg = &balance->leg[side];

        leg->inertia_kg_m2 = 0;
        for (int j = 0; j < LEG_JOINTS; j++) {
            const struct body_link *link = &balance->model->link[leg->link[j]];
            double arm[3];

            mat3_apply(balance->pose[leg->link[j]].R, link->com_m, arm);
            vec3_add_scaled(arm, 1, balance->pose[leg->link[j]].p, arm);
            vec3_sub(arm, leg->geometry.hip, arm);
            leg->inertia_kg_m2 += link->mass_kg * (arm[0] * arm[0] + arm[2] * arm[2]);
        }
    }
    /* Derive the pendulum from the posture: height of the center of mass, omega = sqrt(g /
     * height) */
    balance->com_height_m = pelvis[2] + offset[2];
    balance->omega = sqrt(balance->model->gravity_m_s2 / balance->com_height_m);
    return reached;
}

enum error_code balance_create(const struct balance_config *config, const struct body_model *model,
                               const double *initial_rad, struct host *host, struct servo *servo,
                               struct arena *arena, struct balance **out, struct error *error)
{
    size_t naxis = host_configuration(host)->naxis;
    struct balance *balance = arena_alloc(arena, 1, sizeof *balance);
    double *angle = arena_alloc(arena, naxis, sizeof *angle);
    double *from = arena_alloc(arena, naxis, sizeof *from);
    struct body_pose *pose = arena_alloc(arena, model->nlink, sizeof *pose);
    struct servo_gains *gains = arena_alloc(arena, naxis, sizeof *gains);
    enum error_code code;

    if (!balance || !angle || !from || !pose || !gains) {
        return error_set(error, ERROR_MEMORY, "no memory for the balance");
    }
    *balance = (struct balance){.config = *config,
                                .model = model,
                                .initial = initial_rad,
                                .host = host,
                                .servo = servo,
                                .angle = angle,
                                .from = from,
                                .pose = pose,
                                .gains = gains};
    /* Find boards, legs and posture; errors of the rig appear here */
    code = estimator_create(&config->estimate, model, host, arena, &balance->estimator, error);
    for (int side = 0; side < BODY_SIDES && !code; side++) {
        struct balance_leg *leg = &balance->leg[side];

        code = leg_find(model, side, leg->link, &leg->geometry, error);
        for (int j = 0; j < LEG_JOINTS && !code; j++) {
            leg->axis[j] = (size_t)model->link[leg->link[j]].axis;
            leg->chain[j] = leg->link[leg->geometry.chain[j]];
        }
        memcpy(leg->sole_m, model->sole[side].position, sizeof leg->sole_m);
    }
    if (code) {
        return code;
    }
    if (!balance_find_posture(balance)) {
        return error_set(error, ERROR_INPUT,
                         "a pelvis %g m over the soles is out of the legs' reach",
                         config->pelvis_height_m);
    }
    *out = balance;
    return ERROR_NONE;
}

void balance_start(struct balance *balance)
{
    const struct balance_config *config = &balance->config;
    double round_trip_ns = (double)host_round_trip_ns(balance->host), own;
    double share = fmin(1.0, ROUND_TRIP_NS / fmax(round_trip_ns, 1.0));

    /* On slow buses, lower the crossover frequency of the position loops in proportion, so that the
     * dead time costs the same phase. The ankle rolls have separate gains */
    for (size_t i = 0; i < host_configuration(balance->host)->naxis; i++) {
        balance->from[i] = host_joint(balance->host, i)->joint_rad;
        balance->gains[i] = config->gains[i];
        balance->gains[i].kp_v_per_rad *= share;
    }
    for (int side = 0; side < BODY_SIDES; side++) {
        struct balance_leg *leg = &balance->leg[side];

        for (int j = 0; j < LEG_JOINTS; j++) {
            leg->motor_rad[j] = host_joint(balance->host, leg->axis[j])->motor_rad;
        }
        own = fmax(config->ankle_roll_kp_v_per_rad,
                   config->gains[leg->axis[LEG_ANKLE_ROLL]].kp_v_per_rad);
        balance->gains[leg->axis[LEG_ANKLE_ROLL]].kp_v_per_rad =
            fmin(config->ankle_roll_kp_v_per_rad, share * own);
    }
    servo_use(balance->servo, balance->gains);
    estimator_start(balance->estimator);
    balance->t_s = 0;
    balance->ready = false;
}

/* ---- a period ---- */

void balance_update(struct balance *balance, const struct gait_command *command, double dt_s)
{
    const struct estimate *estimate;
    const struct gait_reference *plan = &balance->gait.now;
    struct balance_leg *stance, *swing;
    struct gait_measured measured;
    struct gait_foothold *foot = measured.foot;
    double ramp = fmin(balance->t_s / RAMP_S, 1), ahead, torque, com[2];

    balance->t_s += dt_s;
    /* Estimate the state; the observer's bandwidth depends on the commanded speed */
    estimator_update(
        balance->estimator, command->step,
        sqrt(command->forward_m_s * command->forward_m_s + command->left_m_s * command->left_m_s),
        dt_s);
    /* Measure the feet; start the gait after the ramp and the settling of the springs */
    estimate = estimator_read(balance->estimator);
    balance_measure(balance, &measured, dt_s);
    if (!balance->ready && balance->t_s > RAMP_S + SETTLE_S) {
        /* Assume level ground until the soles have measured it */
        for (int i = 0; i < BODY_SIDES; i++) {
            foot[i].roll = foot[i].pitch = 0;
            balance->leg[i].foot = foot[i];
            balance->leg[i].carries = 1;
        }
        /* Start the plan at rest, with the center of mass above the midpoint of the feet */
        balance->ground_m = (foot[0].p[2] + foot[1].p[2]) / 2;
        com[0] = (foot[0].p[0] + foot[1].p[0]) / 2 + balance->config.gait.zmp_ahead_m;
        com[1] = (foot[0].p[1] + foot[1].p[1]) / 2;
        gait_start(&balance->gait, &balance->config.gait, balance->omega, foot, com);
        balance->ready = true;
    }
    /* Before the gait starts, load both feet equally, and move from the initial pose (smooth
     * step) */
    if (!balance->ready) {
        for (int i = 0; i < BODY_SIDES; i++) {
            balance->leg[i].weight = 0.5;
            balance->leg[i].cop_m[0] = balance->config.gait.zmp_ahead_m;
            balance->zmp[0] = estimate->com_m[0];
            balance->zmp[1] = estimate->com_m[1];
        }
        body_place(balance->model, balance->angle, balance->pose);
        balance_load_legs(balance);
        balance_drive(balance, fmin(balance->t_s / LOAD_S, 1), ramp * ramp * (3 - 2 * ramp), dt_s);
        return;
    }

    /* Plan, correct the DCM, distribute to the feet, add compliance, compute the poses, in this
     * order */
    gait_update(&balance->gait, command, &measured, dt_s);
    /* Desired zero-moment point: planned point plus feedback of the DCM's error */
    for (int k = 0; k < 2; k++) {
        double dcm = estimate->com_m[k] + estimate->com_m_s[k] / balance->omega;

        balance->zmp[k] =
            balance->gait.now.zmp[k] + balance->config.dcm_gain * (dcm - balance->gait.now.dcm[k]);
    }
    balance_share(balance);
    balance_yield(balance, dt_s);
    balance_pose_legs(balance, dt_s);
    /* Compute the torques in the new pose; the motor references compensate the springs with them */
    body_place(balance->model, balance->angle, balance->pose);
    balance_load_legs(balance);
    /* Add the hip torque that accelerates the swinging leg, a rod with the leg's inertia. The
     * standing leg's hip gets the opposite torque, so that the trunk gets none */
    stance = &balance->leg[plan->stance];
    swing = &balance->leg[BODY_SIDES - 1 - plan->stance];
    ahead =
        portable_cos(plan->yaw) * plan->foot_m_s2[0] + portable_sin(plan->yaw) * plan->foot_m_s2[1];
    torque = -balance->config.swing_torque * swing->inertia_kg_m2 * ahead /
             (swing->geometry.thigh_m + swing->geometry.shank_m);
    swing->torque_nm[LEG_HIP_PITCH] += torque;
    stance->torque_nm[LEG_HIP_PITCH] -= torque;
    balance_drive(balance, 1, 1, dt_s);
}

bool balance_ready(const struct balance *balance)
{
    return balance->ready;
}

const struct estimate *balance_estimate(const struct balance *balance)
{
    return estimator_read(balance->estimator);
}

const struct gait *balance_gait(const struct balance *balance)
{
    return &balance->gait;
}

/* ---- estimated and planned signals, for recordings ---- */

/* Names and values of the signals. The right foot comes first (BODY_RIGHT). The tilts of estimated
 * soles are computed from their rotation matrices. */
#define SIGNALS                                                                                    \
    SIGNAL("estimate.roll_rad", e->roll_rad)                                                       \
    SIGNAL("estimate.pitch_rad", e->pitch_rad)                                                     \
    SIGNAL("estimate.yaw_rad", e->yaw_rad)                                                         \
    SIGNAL("estimate.pelvis_x_m", e->pelvis_m[0])                                                  \
    SIGNAL("estimate.pelvis_y_m", e->pelvis_m[1])                                                  \
    SIGNAL("estimate.pelvis_z_m", e->pelvis_m[2])                                                  \
    SIGNAL("estimate.com_x_m", e->com_m[0])                                                        \
    SIGNAL("estimate.com_y_m", e->com_m[1])                                                        \
    SIGNAL("estimate.com_z_m", e->com_m[2])                                                        \
    SIGNAL("estimate.com_vx_m_s", e->com_m_s[0])                                                   \
    SIGNAL("estimate.com_vy_m_s", e->com_m_s[1])                                                   \
    SIGNAL("estimate.com_vz_m_s", e->com_m_s[2])                                                   \
    SIGNAL("estimate.zmp_x_m", e->zmp_m[0])                                                        \
    SIGNAL("estimate.zmp_y_m", e->zmp_m[1])                                                        \
    SIGNAL("estimate.right_fz_n", e->foot[0].force_n[2])                                           \
    SIGNAL("estimate.left_fz_n", e->foot[1].force_n[2])                                            \
    SIGNAL("estimate.right_cop_x_m", e->foot[0].cop_m[0])                                          \
    SIGNAL("estimate.right_cop_y_m", e->foot[0].cop_m[1])                                          \
    SIGNAL("estimate.left_cop_x_m", e->foot[1].cop_m[0])                                           \
    SIGNAL("estimate.left_cop_y_m", e->foot[1].cop_m[1])                                           \
    SIGNAL("plan.zmp_x_m", plan->zmp[0])                                                           \
    SIGNAL("plan.zmp_y_m", plan->zmp[1])                                                           \
    SIGNAL("plan.dcm_x_m", plan->dcm[0])                                                           \
    SIGNAL("plan.dcm_y_m", plan->dcm[1])                                                           \
    SIGNAL("plan.com_x_m", plan->com[0])                                                           \
    SIGNAL("plan.com_y_m", plan->com[1])                                                           \
    SIGNAL("wanted.zmp_x_m", balance->zmp[0])                                                      \
    SIGNAL("wanted.zmp_y_m", balance->zmp[1])                                                      \
    SIGNAL("wanted.right_cop_x_m", right->cop_m[0])                                                \
    SIGNAL("wanted.right_cop_y_m", right->cop_m[1])                                                \
    SIGNAL("wanted.left_cop_x_m", left->cop_m[0])                                                  \
    SIGNAL("wanted.left_cop_y_m", left->cop_m[1])                                                  \
    SIGNAL("wanted.left_weight", left->weight)                                                     \
    SIGNAL("plan.phase", plan->phase)                                                              \
    SIGNAL("plan.stance", plan->stance)                                                            \
    SIGNAL("plan.right_z_m",                                                                       \
           plan->foot[0].p[2] + (plan->stance == BODY_LEFT ? plan->height_m : 0))                  \
    SIGNAL("plan.left_z_m",                                                                        \
           plan->foot[1].p[2] + (plan->stance == BODY_RIGHT ? plan->height_m : 0))                 \
    SIGNAL("plan.next_x_m", balance->gait.next.p[0])                                               \
    SIGNAL("plan.next_y_m", balance->gait.next.p[1])                                               \
    SIGNAL("plan.steps", balance->gait.steps)                                                      \
    SIGNAL("estimate.right_x_m", e->foot[0].sole.p[0])                                             \
    SIGNAL("estimate.right_y_m", e->foot[0].sole.p[1])                                             \
    SIGNAL("estimate.left_x_m", e->foot[1].sole.p[0])                                              \
    SIGNAL("estimate.left_y_m", e->foot[1].sole.p[1])                                              \
    SIGNAL("estimate.right_z_m", e->foot[0].sole.p[2])                                             \
    SIGNAL("estimate.left_z_m", e->foot[1].sole.p[2])                                              \
    SIGNAL("estimate.right_pitch_rad", portable_asin(fmin(fmax(-e->foot[0].sole.R[6], -1), 1)))    \
    SIGNAL("estimate.left_pitch_rad", portable_asin(fmin(fmax(-e->foot[1].sole.R[6], -1), 1)))     \
    SIGNAL("estimate.right_roll_rad", portable_atan2(e->foot[0].sole.R[7], e->foot[0].sole.R[8]))  \
    SIGNAL("estimate.left_roll_rad", portable_atan2(e->foot[1].sole.R[7], e->foot[1].sole.R[8]))   \
    SIGNAL("plan.right_pitch_rad", plan->foot[0].pitch)                                            \
    SIGNAL("plan.left_pitch_rad", plan->foot[1].pitch)                                             \
    SIGNAL("plan.right_roll_rad", plan->foot[0].roll)                                              \
    SIGNAL("plan.left_roll_rad", plan->foot[1].roll)                                               \
    SIGNAL("plan.landed", balance->gait.landed)

#define SIGNAL(name, value) name,
const char *const balance_signal_name[BALANCE_SIGNALS] = {SIGNALS};
#undef SIGNAL

void balance_signals(const struct balance *balance, double value[BALANCE_SIGNALS])
{
    const struct estimate *e = estimator_read(balance->estimator);
    const struct gait_reference *plan = &balance->gait.now;
    const struct balance_leg *right = &balance->leg[BODY_RIGHT], *left = &balance->leg[BODY_LEFT];
#define SIGNAL(name, value) value,
    const double now[BALANCE_SIGNALS] = {SIGNALS};

    memcpy(value, now, sizeof now);
}
