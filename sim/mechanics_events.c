/* SPDX-License-Identifier: Apache-2.0 */
/* Watches the robot's mechanics for events: limits, stops, falls. */
#include "sim/mechanics_events.h"

#include "base/portable_math.h"
#include "base/ring.h"
#include "base/vec3.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { EVENT_SLOTS = 256 };

#define TILTED 0.5 /* cosine of 60 degrees */
/* part of the height at the start below which the base has sunk */
#define SUNK 0.5
/* part of the deflection at the stop below which the spring is off the stop */
#define SPRING_BACK 0.9

/* The watch's state of a joint: whether it is past a limit, and whether its series spring is at
 * its stop. */
struct watch_joint {
    bool past, told;
    /* time at which it passed the limit, and last time near the limit */
    int64_t since_ns, near_ns;
    double depth, limit; /* largest depth since then, and the limit, rad or m */
    bool spring;
    int64_t spring_near_ns;
};

struct watch {
    const struct rig *rig;
    struct plant *plant;
    double up[3];
    struct watch_joint *joint;
    struct contact_patch *patch;
    size_t npatch;

    /* Falls */
    bool falls;     /* the robot has a floating base, and there is gravity */
    bool *limb_end; /* by body */
    bool *stands;   /* by body: the robot stood on it at the start */
    bool fallen;
    /* time of the last clamp or start; last time with a fall criterion true */
    int64_t released_ns, calm_ns;
    double base_up[3]; /* up direction at that time, in the base's frame */
    /* height of the base above the lowest observed body at that time, m */
    double height;

    struct ring events;
};

/* ---- joints and springs ---- */

/* Tracks a joint past its limit, and emits one event per occurrence with the largest depth. */
static void watch_joint_limit(struct watch *watch, int64_t now_ns, size_t j, double q)
{
    const struct robot_joint *joint = &watch->rig->robot->joint[j];
    struct watch_joint *seen = &watch->joint[j];
    double above = q - joint->upper, below = joint->lower - q;
    double depth = above > below ? above : below;

    /* Usual case: within its limits, now and before */
    if (depth <= -WATCH_BACK && !seen->past && !seen->told) {
        return;
    }

    /* Detects passing the limit, and a return for long enough */
    if (!seen->past && depth > WATCH_PAST) {
        seen->past = true;
        seen->since_ns = now_ns;
        seen->depth = 0.0;
    }
    if (depth > -WATCH_BACK) {
        seen->near_ns = now_ns;
    } else if (seen->told && now_ns - seen->near_ns >= WATCH_QUIET_NS) {
        seen->past = seen->told = false;
    }

    /* Emits the event when the depth stops growing, or WATCH_RISE_NS after the start */
    if (seen->past && !seen->told) {
        if (depth > seen->depth) {
            seen->depth = depth;
            seen->limit = q > joint->upper ? joint->upper : joint->lower;
        }
        if (depth < seen->depth || now_ns - seen->since_ns >= WATCH_RISE_NS) {
            const struct watch_event event = {.time_ns = seen->since_ns,
                                              .kind = WATCH_JOINT,
                                              .index = j,
                                              .value = seen->depth,
                                              .limit = seen->limit};

            seen->told = true;
            ring_push(&watch->events, &event); /* if the ring is full, the log line is lost */
        }
    }
}

/* Tracks a joint's series spring to its stop, and emits one event per occurrence. */
static void watch_spring(struct watch *watch, int64_t now_ns, size_t j,
                         const struct motor_sense *motor)
{
    const struct robot_sea *sea = &watch->rig->robot->joint[j].sea;
    double deflection = fabs(motor->qm - motor->q);
    struct watch_joint *seen = &watch->joint[j];

    if (plant_command(watch->plant)->motor[j].condition & DRIVE_SPRING_BREAK) {
        seen->spring = false;
    } else if (deflection > sea->deflection && !seen->spring) {
        const struct watch_event event = {
            .time_ns = now_ns, .kind = WATCH_SPRING, .index = j, .value = sea->deflection};

        seen->spring = true;
        ring_push(&watch->events, &event);
    }
    if (deflection > SPRING_BACK * sea->deflection) {
        seen->spring_near_ns = now_ns;
    } else if (now_ns - seen->spring_near_ns >= WATCH_QUIET_NS) {
        seen->spring = false;
    }
}

/* ---- falls ---- */

/* Returns the cosine of the angle between up and the base's axis that pointed up at the start. */
static double base_uprightness(const struct watch *watch, const double quaternion[4])
{
    double R[9], axis[3];

    mat3_from_quaternion(quaternion, R);
    mat3_apply(R, watch->base_up, axis);
    return vec3_dot(axis, watch->up);
}

/* Returns the height of the base above the lowest observed body, m. */
static double base_height(const struct watch *watch, const double position[3])
{
    const struct robot *robot = watch->rig->robot;
    const struct body_motion *motion = plant_motion(watch->plant);
    double base = vec3_dot(position, watch->up), height = 0.0;

    for (size_t b = 0; b < robot->nbody; b++) {
        if (robot->body[b].observed) {
            double above = base - vec3_dot(motion[b].p, watch->up);

            height = above > height ? above : height;
        }
    }
    return height;
}

/* Checks whether contact body c has contact, by its wrench. */
static bool body_is_touched(const struct watch *watch, size_t c)
{
    const double *force = plant_contact_wrenches(watch->plant)[c].force;

    return vec3_dot(force, force) > 0.0;
}

/* Returns the robot's body that has a surface; -1 = none: the world or a free body. */
static int robot_body_of_surface(const struct watch *watch, int surface)
{
    int motion = watch->rig->contact.surface[surface].body;
    int body = motion < 0 ? -1 : watch->rig->contact_body[motion];

    return body < (int)watch->rig->robot->nbody ? body : -1;
}

/* Finds a body of the robot that touches the world and is neither the end of a limb nor a body
 * that it stood on. During the first phase (standing), marks such bodies as stood on instead. */
static bool find_touching_body(struct watch *watch, bool standing, struct watch_event *event)
{
    const struct contact_config *contact = &watch->rig->contact;
    size_t count = plant_patches(watch->plant, watch->patch, watch->npatch);

    for (size_t i = 0; i < count && i < watch->npatch; i++) {
        const struct contact_pair *pair = &contact->pair[watch->patch[i].pair];
        int surface = contact->surface[pair->a].body < 0 ? pair->a : pair->b;
        int body = robot_body_of_surface(watch, surface == pair->a ? pair->b : pair->a);
        const double *force = watch->patch[i].force;

        if (contact->surface[surface].body >= 0 || body < 0 || watch->limb_end[body] ||
            vec3_dot(force, force) == 0.0) {
            continue;
        }
        if (standing) {
            watch->stands[body] = true;
        } else if (!watch->stands[body]) {
            event->kind = WATCH_TOUCH;
            event->index = (size_t)body;
            event->surface = (size_t)surface;
            return true;
        }
    }
    return false;
}

/* Checks the same, but computes the patches only if a relevant body has contact. */
static bool robot_touches_world(struct watch *watch, bool standing, struct watch_event *event)
{
    const struct rig *rig = watch->rig;

    for (size_t c = 0; c < rig->contact.nbody; c++) {
        int body = rig->contact_body[c];

        if (body < (int)rig->robot->nbody && !watch->limb_end[body] && !watch->stands[body] &&
            body_is_touched(watch, c)) {
            return find_touching_body(watch, standing, event);
        }
    }
    return false;
}

/* Stores the robot's present posture as the reference of tilt and height. */
static void remember_standing(struct watch *watch, const double *base, int64_t now_ns)
{
    double R[9];

    mat3_from_quaternion(base + BASE_Q_QUATERNION, R);
    mat3_apply_transposed(R, watch->up, watch->base_up);
    watch->height = base_height(watch, base + BASE_Q_POSITION);
    watch->released_ns = now_ns;
    watch->fallen = false;
    memset(watch->stands, 0, watch->rig->robot->nbody * sizeof *watch->stands);
}

/* Detects a fall by contact, tilt or height. Emits one event until the robot was up for
 * WATCH_CALM_NS. */
static void watch_fall(struct watch *watch, int64_t now_ns)
{
    bool standing = now_ns - watch->released_ns < WATCH_STANDS_NS;
    struct watch_event event = {.time_ns = now_ns};
    size_t count;
    const double *base = plant_values(watch->plant, &count);
    double upright = base_uprightness(watch, base + BASE_Q_QUATERNION);
    double height = base_height(watch, base + BASE_Q_POSITION);
    bool down;

    /* Contact is detected first, then tilt, then height */
    down = robot_touches_world(watch, standing, &event);
    if (!down && upright < TILTED) {
        event.kind = WATCH_TILT;
        event.value = portable_acos(fmax(-1.0, upright));
        down = true;
    } else if (!down && height < SUNK * watch->height) {
        event.kind = WATCH_SINK;
        event.value = height;
        event.limit = watch->height;
        down = true;
    }

    if (down && !watch->fallen) {
        ring_push(&watch->events, &event);
    }
    if (down) {
        watch->fallen = true;
        watch->calm_ns = now_ns;
    } else if (watch->fallen) {
        watch->fallen = now_ns - watch->calm_ns < WATCH_CALM_NS;
    }
}

/* ---- the whole watch ---- */

void watch_step(struct watch *watch, int64_t now_ns)
{
    const struct robot *robot = watch->rig->robot;
    const struct motor_sense *motor = plant_sensors(watch->plant)->motor;
    size_t count;

    for (size_t j = 0; j < robot->njoint; j++) {
        watch_joint_limit(watch, now_ns, j, motor[j].q);
        if (robot->joint[j].sea.present && robot->joint[j].sea.stop.stiffness > 0.0) {
            watch_spring(watch, now_ns, j, &motor[j]);
        }
    }
    if (watch->falls && plant_is_clamped(watch->plant)) {
        remember_standing(watch, plant_values(watch->plant, &count), now_ns);
    } else if (watch->falls) {
        watch_fall(watch, now_ns);
    }
}

/* Finds the ends of limbs: bodies without children. */
static void find_limb_ends(struct watch *watch)
{
    const struct robot *robot = watch->rig->robot;

    for (size_t b = 0; b < robot->nbody; b++) {
        watch->limb_end[b] = true;
    }
    for (size_t b = 1; b < robot->nbody; b++) {
        watch->limb_end[robot->body[b].parent] = false;
    }
}

enum error_code watch_create(const struct rig *rig, struct plant *plant, struct arena *arena,
                             struct watch **out, struct error *error)
{
    const struct robot *robot = rig->robot;
    double gravity = vec3_norm(robot->gravity);
    struct watch *watch = arena_alloc(arena, 1, sizeof *watch);
    void *slots = arena_alloc(arena, EVENT_SLOTS, sizeof(struct watch_event));
    size_t count;

    if (!watch || !slots) {
        return error_set(error, ERROR_MEMORY, "no memory left for the log of the robot");
    }

    /* An engine may split a pair's patch into two */
    watch->rig = rig;
    watch->plant = plant;
    watch->npatch = 2 * rig->contact.npair;
    watch->joint = arena_alloc(arena, robot->njoint + 1, sizeof *watch->joint);
    watch->patch = arena_alloc(arena, watch->npatch + 1, sizeof *watch->patch);
    watch->limb_end = arena_alloc(arena, robot->nbody, sizeof *watch->limb_end);
    watch->stands = arena_alloc(arena, robot->nbody, sizeof *watch->stands);
    if (!watch->joint || !watch->patch || !watch->limb_end || !watch->stands) {
        return error_set(error, ERROR_MEMORY, "no memory left for the log of the robot");
    }
    ring_init(&watch->events, slots, sizeof(struct watch_event), EVENT_SLOTS);
    find_limb_ends(watch);

    /* The reference for falls: up, and the posture at the start */
    watch->falls = robot->floating && gravity > 0.0;
    for (int i = 0; watch->falls && i < 3; i++) {
        watch->up[i] = -robot->gravity[i] / gravity;
    }
    if (watch->falls) {
        remember_standing(watch, plant_values(plant, &count), plant_time_ns(plant));
    }
    *out = watch;
    return ERROR_NONE;
}

const struct ring *watch_event_ring(const struct watch *watch)
{
    return &watch->events;
}

bool watch_next_event(struct watch *watch, struct watch_event *event)
{
    return ring_pop(&watch->events, event);
}

void watch_event_format(const struct watch *watch, const struct watch_event *event, char *text,
                        size_t size)
{
    const struct robot *robot = watch->rig->robot;
    double seconds = (double)event->time_ns * 1e-9;

    switch (event->kind) {
    case WATCH_JOINT:
        snprintf(text, size, "%.6f s: joint %s past its limit of %.4g %s by %.4f %s", seconds,
                 robot->joint[event->index].name, event->limit,
                 robot->joint[event->index].type == JOINT_REVOLUTE ? "rad" : "m", event->value,
                 robot->joint[event->index].type == JOINT_REVOLUTE ? "rad" : "m");
        break;
    case WATCH_SPRING:
        snprintf(text, size, "%.6f s: spring of %s at its stop, %.3g rad", seconds,
                 robot->joint[event->index].name, event->value);
        break;
    case WATCH_TILT:
        snprintf(text, size, "%.6f s: fell: base %s tilted by %.0f degrees", seconds,
                 robot->body[0].name, event->value * 57.29577951308232);
        break;
    case WATCH_SINK:
        snprintf(text, size,
                 "%.6f s: fell: base %s %.3f m above the lowest body, at the start %.3f m", seconds,
                 robot->body[0].name, event->value, event->limit);
        break;
    case WATCH_TOUCH:
        snprintf(text, size, "%.6f s: fell: body %s touched %s", seconds,
                 robot->body[event->index].name, watch->rig->contact.surface[event->surface].name);
        break;
    }
}
