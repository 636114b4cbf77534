/* SPDX-License-Identifier: Apache-2.0 */
/* Assumes drives and gains, by the rules in drive.h. */
#include "app/import/drive.h"

#include "app/import/shapes.h"
#include "app/import/joint_inertia.h"
#include "base/array.h"
#include "base/vec3.h"
#include "model/dynamics.h"

#include <math.h>

#define GRAVITY 9.81 /* m/s2 */
/* an effort above this multiple of the gravity load is a placeholder */
#define PLACEHOLDER_TIMES 20.0
/* lever of the robot's weight. A smaller load, as of a wheel, does not limit the effort */
#define WEIGHT_ARM_M 0.1
#define STRENGTH_TIMES 3.0 /* ratio of the assumed strength to the gravity load */
#define WHEEL_SHARE 0.5    /* least ratio of a wheel's strength to the robot's largest load */
#define CARRY_TIMES 1.5    /* least ratio of strength to the torque in a pose */
/* smallest ratio of the loop's stiffness to the tipping stiffness */
#define UPRIGHT_TIMES 1.5
#define STUCK_RAD 5e-3       /* largest error that the file's dry friction leaves in a loop */
#define FOOT_M 0.02          /* a body whose lowest point is this close to the ground is a foot */
#define STRENGTH_MOST_NM 1e6 /* largest strength that a robot file may have */
#define TRAIL_M 2e-3         /* least trail of a castor */
#define CASTOR_SQUARE 0.9    /* least sine between a castor's axle and swivel */
#define SPEED_RAD_S (2.0 * M_PI) /* assumed speed */
#define SPEED_MOST_RAD_S 100.0   /* a higher speed in the file is a placeholder */
#define GEAR 100.0               /* assumed reduction ratio */
/* smallest ratio of J to the damping from feedback, which the buses delay */
#define DELAYED_DAMPING_S 0.010

/* Computes the worst gravity load of each joint, with all bodies behind it stretched out
 * horizontally. For a floating robot, whose legs may carry it, the load is at least half of its
 * weight at the end of the leg. load is in N m, or N for a prismatic joint; reach is the distance
 * of the farthest body behind, m. The caller sets both to 0 first. */
static void robot_find_loads(const struct robot *robot, double *reach, double *load)
{
    for (size_t b = 1; b < robot->nbody; b++) {
        double arm = vec3_norm(robot->body[b].inertia.com);

        /* Walk up to the base: each joint on the way carries this body at the body's distance */
        for (int up = (int)b; up > 0; up = robot->body[up].parent) {
            const struct robot_joint *joint = &robot->joint[up - 1];
            double lever = joint->type == JOINT_PRISMATIC ? 1.0 : arm;

            load[up - 1] += GRAVITY * robot->body[b].inertia.mass * lever;
            reach[up - 1] = fmax(reach[up - 1], arm);
            arm += vec3_norm(joint->origin);
        }
    }
    for (size_t j = 0; j < robot->njoint && robot->floating; j++) {
        if (robot->joint[j].type == JOINT_REVOLUTE) {
            load[j] = fmax(load[j], 0.5 * GRAVITY * robot->total_mass * reach[j]);
        }
    }
}

/* Computes, by inverse dynamics, the largest gravity torque of each joint in the robot's poses, N
 * m, with a fixed base. Raises bears to this torque. */
static enum error_code robot_find_statics(const struct robot *robot, struct arena *arena,
                                          double *bears, struct error *error)
{
    const size_t n = robot->njoint + BASE_Q_COUNT, first = robot->nv - robot->njoint;
    double *q = arena_alloc(arena, n, sizeof *q), *v = arena_alloc(arena, n, sizeof *v);
    double *vdot = arena_alloc(arena, n, sizeof *vdot), *f = arena_alloc(arena, n, sizeof *f);
    struct dynamics d;
    enum error_code code;

    if (!q || !v || !vdot || !f) {
        return error_set(error, ERROR_MEMORY, "no memory for the drives");
    }
    code = dynamics_generic(robot, arena, &d, error);
    if (code) {
        return code;
    }

    /* For rest in a pose, inverse dynamics gives the torques that hold the robot */
    for (size_t p = 0; p < robot->npose; p++) {
        if (robot->floating) {
            q[BASE_Q_QUATERNION] = 1.0;
        }
        for (size_t j = 0; j < robot->njoint; j++) {
            q[robot->nq - robot->njoint + j] = robot->pose[p].joint[j];
        }
        d.ops->inverse(&d, q, v, vdot, NULL, f);
        import_lead(robot, IMPORT_LEAD_TORQUES, f + first);
        for (size_t j = 0; j < robot->njoint; j++) {
            bears[j] = fmax(bears[j], fabs(f[first + j]));
        }
    }
    return ERROR_NONE;
}

/* Chooses the strength, N m, and the speed, rad/s, of a joint. Uses the file's values, or assumed
 * values if these are missing, placeholders or too weak for a pose. load is the gravity load of the
 * joint, most_load the largest gravity load of the robot. */
static void drive_choose_limits(const struct import_robot *from, size_t j, double load,
                                double most_load, double bears, struct import_notes *notes,
                                double *strength, double *speed)
{
    const struct import_joint *source = from->source[j];
    const char *file = source->file;
    const bool wheel =
        from->rolls && source->type == IMPORT_CONTINUOUS && from->robot->body[j + 1].parent == 0;

    *strength = source->effort;
    *speed = source->velocity;

    /* A velocity of 0, or a very large one, is a placeholder */
    if (source->type != IMPORT_PRISMATIC && (!(*speed > 0.0) || *speed > SPEED_MOST_RAD_S)) {
        *speed = SPEED_RAD_S;
        import_note_add(notes, IMPORT_ASSUMED, file, source->line,
                        "joint \"%.63s\" is as fast as %.3g rad/s: the file's velocity %g %s",
                        source->name, *speed, source->velocity,
                        source->velocity > 0.0 ? "is a placeholder" : "is none");
    }

    /* An effort of 0, or far above all loads, is a placeholder. The joint is strong enough to reach
     * its speed against its damping */
    if (!(*strength > 0.0) || *strength > PLACEHOLDER_TIMES * most_load) {
        *strength =
            fmax(fmax(STRENGTH_TIMES * load, (wheel ? WHEEL_SHARE : 0.02) * most_load), 1e-3);
        *strength += source->friction;
        *strength += source->damping * *speed;
        import_note_add(notes, IMPORT_ASSUMED, file, source->line,
                        "joint \"%.63s\" is as strong as %.3g N m: the file's effort %g %s",
                        source->name, *strength, source->effort,
                        source->effort > 0.0 ? "is a placeholder" : "is none");
    }

    /* The strength must hold the joint in the robot's poses, with a reserve to move */
    if (*strength < CARRY_TIMES * bears) {
        import_note_add(notes, IMPORT_ASSUMED, file, source->line,
                        "joint \"%.63s\" is as strong as %.3g N m: it bears %.3g N m in a pose, "
                        "and with %.3g it could not move",
                        source->name, CARRY_TIMES * bears, bears, *strength);
        *strength = CARRY_TIMES * bears;
    }
}

/* Fills a joint with an assumed electric drive, by the rules in drive.h, on the link side. */
static void drive_assume(const struct import_joint *source, double strength, double speed,
                         double supply_v, struct robot_joint *joint)
{
    double free_speed = 1.5 * speed, NKt = supply_v / free_speed;
    double R = NKt * supply_v / (3.0 * strength);

    joint->sea = (struct robot_sea){
        .present = true,
        .J = source->armature > 0.0 ? source->armature : strength * 0.020 / free_speed,
        .Dm = source->damping > 0.0 ? source->damping : 0.02 * strength / free_speed,
        .Ks = strength / 0.010,
        .Ds = 5e-4 * strength / 0.010,
        .N = source->gear > 0.0 ? source->gear : GEAR,
        .Kt = NKt,
        .Kw = NKt,
        .R = R,
        .L = 5e-4 * R,
    };
}

/* Returns the highest nominal voltage of the chosen catalogue drives. Without any, returns the
 * lowest usual voltage at which the strongest joint needs at most 25 A. */
static double drive_choose_supply(const struct import_robot *from, const double *strength,
                                  const double *speed)
{
    static const double usual[] = {24.0, 48.0, 80.0, 150.0, 300.0, 600.0, 1000.0};
    double power = 0.0, supply_v = 0.0;
    size_t i = 0;

    for (size_t j = 0; j < from->robot->njoint; j++) {
        supply_v = from->drive[j] ? fmax(supply_v, from->drive[j]->supply_v) : supply_v;
        if (from->robot->joint[j].type == JOINT_REVOLUTE) {
            power = fmax(power, strength[j] * 1.5 * speed[j]);
        }
    }
    while (i + 1 < ARRAY_COUNT(usual) && power > 25.0 * usual[i]) {
        i++;
    }
    return supply_v > 0.0 ? supply_v : usual[i];
}

/* Sets a joint's drive from the catalogue. Adds a note if it is too weak for a pose, or made for
 * another voltage. */
static void drive_take(const struct import_robot *from, size_t j, double bears, double supply_v,
                       struct import_notes *notes)
{
    const struct robot_drive *drive = from->drive[j];
    const struct import_joint *source = from->source[j];
    const char *file = source->file;
    double most = import_drive_torque(drive);

    from->robot->joint[j].sea = drive->sea;
    import_note_add(notes, IMPORT_ASSUMED, file, source->line,
                    "drive of joint \"%.63s\": %.63s of the catalogue, %.3g N m, %.3g rad/s at %g "
                    "V; the file's effort %g and velocity %g are not used",
                    source->name, drive->name, most, drive->speed, drive->supply_v, source->effort,
                    source->velocity);
    if (most < bears) {
        import_note_add(notes, IMPORT_CHANGED, file, source->line,
                        "joint \"%.63s\" bears %.3g N m in a pose, its drive %.63s gives %.3g",
                        source->name, bears, drive->name, most);
    }
    if (drive->supply_v > 0.0 && drive->supply_v != supply_v) {
        import_note_add(notes, IMPORT_CHANGED, file, source->line,
                        "joint \"%.63s\" has a drive for %g V, %.63s, on a supply of %g V",
                        source->name, drive->supply_v, drive->name, supply_v);
    }
}

/* ---- castors ---- */

/* Counts the bodies that hang on body b. *child receives the last of them. */
static size_t body_count_children(const struct robot *robot, size_t b, size_t *child)
{
    size_t count = 0;

    for (size_t c = b + 1; c < robot->nbody; c++) {
        if (robot->body[c].parent == (int)b) {
            count++;
            *child = c;
        }
    }
    return count;
}

/* Marks the joints of castors of a robot that rolls: a swivel on the base, and a wheel on it that
 * trails behind the swivel's axis. Both turn for ever, without an actuator in the file, and the
 * wheel's axle is no higher than the highest axle of the wheels on the base. */
static void robot_mark_castors(const struct import_robot *from, const struct body_motion *bodies,
                               bool *castor)
{
    const struct robot *robot = from->robot;
    double high = -INFINITY;
    size_t wheel = 0;

    for (size_t b = 1; b < robot->nbody; b++) {
        if (robot->body[b].parent == 0 && from->source[b - 1]->type == IMPORT_CONTINUOUS &&
            body_count_children(robot, b, &wheel) == 0) {
            high = fmax(high, bodies[b].p[2]);
        }
    }
    for (size_t b = 1; b < robot->nbody && from->rolls; b++) {
        double up[3], axle[3], ahead[3], arm[3], across;

        if (robot->body[b].parent != 0 || from->source[b - 1]->type != IMPORT_CONTINUOUS ||
            body_count_children(robot, b, &wheel) != 1 ||
            from->source[wheel - 1]->type != IMPORT_CONTINUOUS ||
            body_count_children(robot, wheel, &(size_t){0}) != 0 || from->source[b - 1]->driven ||
            from->source[wheel - 1]->driven) {
            continue;
        }
        mat3_apply(bodies[b].R, robot->joint[b - 1].axis, up);
        mat3_apply(bodies[wheel].R, robot->joint[wheel - 1].axis, axle);
        vec3_cross(axle, up, ahead);
        vec3_sub(bodies[wheel].p, bodies[b].p, arm);
        across = vec3_norm(ahead);
        if (across > CASTOR_SQUARE && fabs(vec3_dot(arm, ahead)) > TRAIL_M * across &&
            bodies[wheel].p[2] <= high + 1e-3) {
            castor[b - 1] = castor[wheel - 1] = true;
        }
    }
}

/* Checks whether joint j has no drive. This is so if it is a castor's, or all actuators of the file
 * are for other joints, and no --drive option names the joint. */
static bool is_passive(const struct import_robot *from, const bool *castor, size_t j)
{
    return (castor[j] ||
            (from->model->actuated && !from->model->drives_others && !from->source[j]->driven)) &&
           !from->drive[j];
}

enum error_code import_assume_drives(struct import_robot *from, struct arena *arena,
                                     struct import_notes *notes, double *supply_v,
                                     struct error *error)
{
    struct robot *robot = from->robot;
    const size_t n = robot->njoint + 1;
    double *reach = arena_alloc(arena, n, sizeof *reach),
           *load = arena_alloc(arena, n, sizeof *load);
    double *strength = arena_alloc(arena, n, sizeof *strength);
    double *speed = arena_alloc(arena, n, sizeof *speed);
    double *bears = arena_alloc(arena, n, sizeof *bears), most = 0.0;
    double *zero = arena_alloc(arena, n, sizeof *zero);
    struct body_motion *bodies = arena_alloc(arena, n, sizeof *bodies);
    bool *castor = arena_alloc(arena, n, sizeof *castor);
    enum error_code code;

    if (!reach || !load || !strength || !speed || !bears || !zero || !bodies || !castor) {
        return error_set(error, ERROR_MEMORY, "%.200s: no memory for the drives",
                         from->model->file);
    }
    code = robot_find_statics(robot, arena, bears, error);
    if (code) {
        return code;
    }
    robot_place_bodies(robot, (const double[3]){0}, (const double[4]){1}, zero, bodies);
    robot_mark_castors(from, bodies, castor);
    robot_find_loads(robot, reach, load);
    import_lead(robot, IMPORT_LEAD_LOADS, load);
    most = WEIGHT_ARM_M * GRAVITY * robot->total_mass;
    for (size_t j = 0; j < robot->njoint; j++) {
        most = fmax(most, load[j]);
    }

    /* Find strengths and speeds first: the supply depends on the strongest joint, and the drives on
     * the supply */
    for (size_t j = 0; j < robot->njoint; j++) {
        if (robot_find_coupling(robot, j)) {
            continue;
        }
        if (from->drive[j] && !import_takes_cylinder(from, j)) {
            strength[j] = import_drive_torque(from->drive[j]);
        } else if (!from->drive[j]) {
            drive_choose_limits(from, j, load[j], most, bears[j], notes, &strength[j], &speed[j]);
        }
    }
    *supply_v = drive_choose_supply(from, strength, speed);
    code = import_take_cylinders(from, bears, notes, error);
    if (code) {
        return code;
    }

    /* Add electric drives to all revolute joints that do not follow others; prismatic joints only
     * get their strength */
    for (size_t j = 0; j < robot->njoint; j++) {
        struct robot_joint *joint = &robot->joint[j];
        const struct import_joint *source = from->source[j];

        if (import_takes_cylinder(from, j)) {
            continue;
        }
        if (robot_find_coupling(robot, j)) {
            joint->passive = (struct robot_passive){
                .stiffness = source->stiffness, .damping = source->damping, .rest = source->rest};
            continue;
        }
        if (source->friction > 0.0 &&
            (from->drive[j] || joint->type != JOINT_REVOLUTE || is_passive(from, castor, j))) {
            import_note_add(notes, IMPORT_DROPPED, source->file, source->line,
                            "dry friction %g of joint \"%.63s\": only assumed drives have it",
                            source->friction, source->name);
        }
        joint->torque_limit = strength[j];
        joint->passive =
            (struct robot_passive){.stiffness = source->stiffness, .rest = source->rest};
        if (joint->type != JOINT_REVOLUTE || is_passive(from, castor, j)) {
            joint->passive.damping = source->damping; /* motors have their own damping */
            if (joint->type == JOINT_REVOLUTE && !(source->stiffness > 0.0)) {
                import_note_add(
                    notes, IMPORT_CHANGED, source->file, source->line,
                    "joint \"%.63s\" has no actuator: it turns freely; --drive gives it a drive",
                    source->name);
            }
            continue;
        }
        if (from->drive[j]) {
            drive_take(from, j, bears[j], *supply_v, notes);
            continue;
        }
        drive_assume(source, strength[j], speed[j], *supply_v, joint);
        import_note_add(notes, IMPORT_ASSUMED, source->file, source->line,
                        "drive of joint \"%.63s\": J %.3g kg m2%s, Ks %.3g N m/rad, N Kt %.3g N "
                        "m/A, R %.3g ohm, gear %g%s",
                        source->name, joint->sea.J, source->armature > 0.0 ? " (the file's)" : "",
                        joint->sea.Ks, joint->sea.Kt, joint->sea.R, joint->sea.N,
                        source->gear > 0.0 ? " (the file's)" : "");
    }

    /* Limit the strength of a follower to what its leader can transmit */
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];

        robot->joint[coupling->follower].torque_limit =
            fmin(robot->joint[coupling->leader].torque_limit / fabs(coupling->multiplier),
                 STRENGTH_MOST_NM);
    }
    return import_stiffen_couplings(from, arena, notes, error);
}

/* ---- gains ---- */

/* Computes the tipping stiffness of each joint above the robot's feet, N m/rad: weight times height
 * of the center of mass above the joint, divided by the number of feet. With less stiffness the
 * robot tips over the joint. tips stays 0 for other joints. */
static enum error_code robot_find_tipping(const struct robot *robot, const double *joint,
                                          struct arena *arena, double *tips, struct error *error)
{
    struct body_motion *bodies = arena_alloc(arena, robot->nbody, sizeof *bodies);
    bool *foot = arena_alloc(arena, robot->nbody, sizeof *foot);
    const double mass = robot->total_mass;
    double lowest, moment = 0.0;
    int feet = 0;

    if (!bodies || !foot) {
        return error_set(error, ERROR_MEMORY, "no memory for the gains");
    }
    if (!import_find_lowest(robot, joint, bodies, &lowest)) {
        return ERROR_NONE;
    }
    /* Feet are the bodies whose capsules reach the ground */
    for (size_t c = 0; c < robot->ncapsule; c++) {
        bool down = import_capsule_bottom(&robot->capsule[c], bodies) < lowest + FOOT_M;

        feet += down && !foot[robot->capsule[c].body];
        foot[robot->capsule[c].body] |= down;
    }
    /* Compute the mass times the height of the center of mass */
    for (size_t b = 0; b < robot->nbody; b++) {
        double com[3];

        mat3_apply(bodies[b].R, robot->body[b].inertia.com, com);
        moment += robot->body[b].inertia.mass * (bodies[b].p[2] + com[2]);
    }
    /* Every joint between a foot and the base must hold the robot upright */
    for (size_t b = 1; b < robot->nbody; b++) {
        for (int up = (int)b; foot[b] && up > 0; up = robot->body[up].parent) {
            double height = moment / mass - bodies[up].p[2];

            tips[up - 1] = fmax(tips[up - 1], GRAVITY * mass * height / feet);
        }
    }
    return ERROR_NONE;
}

/* Computes the gains of a position loop for a drive, by the rules in drive.h. I: inertia of the
 * joint with other joints free, kg m2. load: gravity load of the joint, N m. times: ratio of the
 * loop's stiffness to the load. tips: tipping stiffness of the joint, N m/rad. */
static struct import_gains gains_choose(const struct robot_sea *sea, double I, double load,
                                        double times, double tips)
{
    double own = sea->Dm + sea->Kt * sea->Kw / sea->R, most = own + sea->J / DELAYED_DAMPING_S;
    const double sticks = sea->effects ? sea->effects->coulomb / STUCK_RAD : 0.0;
    double least = fmax(fmax(times * load, UPRIGHT_TIMES * tips), fmax(30.0 * 30.0 * I, sticks));
    double K = fmin(least, 60.0 * 60.0 * I), D, stiff;
    const double holds = UPRIGHT_TIMES * fmax(load, tips);

    /* Above the resonance of the spring the loop moves only the rotor, which limits K. A light
     * rotor follows the spring there, with a gain of K over its stiffness or, if that is more, its
     * damping at the resonance */
    stiff = fmin(sea->Ks, sqrt(sea->Ks / sea->J) * (own + sea->Ds));
    K = fmin(K, fmin(most * most / I, fmax(100.0 * 100.0 * sea->J, 0.1 * stiff)));
    D = fmin(2.0 * sqrt(K * I), most) - own;
    return (struct import_gains){.kp_v_per_rad = K * sea->R / sea->Kt,
                                 .kd_v_s_per_rad = fmax(D, 0.0) * sea->R / sea->Kt,
                                 .kw_v_s_per_rad = own * sea->R / sea->Kt,
                                 .load_v_per_nm = sea->R / sea->Kt,
                                 .short_of = K < holds ? K / holds : 0.0};
}

enum error_code import_find_gains(const struct robot *robot, const double *joint, bool stands,
                                  struct arena *arena, struct import_gains *gains,
                                  struct error *error)
{
    const size_t n = robot->njoint + 1;
    double *reach = arena_alloc(arena, n, sizeof *reach),
           *load = arena_alloc(arena, n, sizeof *load), *tips = arena_alloc(arena, n, sizeof *tips);
    struct import_trial trial;
    enum error_code code;

    if (!reach || !load || !tips) {
        return error_set(error, ERROR_MEMORY, "no memory for the gains");
    }
    code = import_trial_make(robot, joint, arena, &trial, error);
    if (!code && stands) {
        code = robot_find_tipping(robot, joint, arena, tips, error);
    }
    if (code) {
        return code;
    }
    robot_find_loads(robot, reach, load);
    import_lead(robot, IMPORT_LEAD_STIFFNESSES, load);
    import_lead(robot, IMPORT_LEAD_STIFFNESSES, tips);
    /* Choose the gains of each joint by the kind of its drive */
    for (size_t j = 0; j < robot->njoint; j++) {
        double I = import_trial_inertia(&trial, j);

        if (robot->joint[j].sea.present && I > 0.0 && isfinite(I)) {
            gains[j] = gains_choose(&robot->joint[j].sea, I, load[j], robot->floating ? 5.0 : 20.0,
                                    tips[j]);
        } else if (robot->joint[j].hydraulic.present) {
            /* All bodies behind the joint oscillate on its oil. If a floating robot may stand on
             * the joint, half of its mass at the end of the leg does */
            I = import_trial_held_inertia(&trial, j);
            if (robot->floating) {
                I = fmax(I, 0.5 * robot->total_mass * reach[j] * reach[j]);
            }
            gains[j] = import_cylinder_gains(robot, j, joint[j], I);
        }
    }
    return ERROR_NONE;
}
