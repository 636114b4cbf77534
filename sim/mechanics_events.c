/* SPDX-License-Identifier: Apache-2.0 */
/* Watches the robot's mechanics for events: limits, stops, falls. */
#include "sim/mechanics_events.h"

#include "base/portable_math.h"
#include "base/ring.h"
#include "base/vec3.h"

#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

enum { EVENT_SLOTS = 256 };

#define TILTED 0.5 /* cosine of 60 degrees */
/* fraction of the height at the start; below it the base has sunk */
#define SUNK 0.5
/* fraction of the stop's deflection; below it the spring is off the stop */
#define SPRING_BACK 0.9

/* Penetration beyond the layers' thickness that counts as an error, m. */
#define WATCH_DEEP_M 0.02

/* The watch's state of a joint: whether it is past a limit, and whether its series spring is at
 * its stop. */
struct watch_joint {
    bool past, told;
    /* time of passing the limit, and last time near the limit */
    int64_t since_ns, near_ns;
    double depth, limit; /* largest depth since then, and the limit passed, rad or m */
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
    bool *stands;   /* by body: it supported the robot at the start */
    bool fallen;
    /* time of the last clamp or start; last time with a fall criterion true */
    int64_t released_ns, calm_ns;
    double base_up[3]; /* up direction at that time, in the base's frame */
    /* height of the base above the lowest observed body at that time, m */
    double height;

    /* Energy and depth: times of the next check (energy_ns, depth_ns) and of the last finding
     * (created_ns, deep_ns; -1 = none) */
    int64_t energy_ns, created_ns, depth_ns, deep_ns;
    _Atomic bool found_energy;

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

    /* Detects the start of an event, and its end after long enough within the range */
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

/* ---- falls ---- */

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

/* Finds a body of the robot that touches the world and is neither the end of a limb nor a support.
 * In the first phase (standing), marks such bodies as supports instead. */
static bool find_touching_body(struct watch *watch, bool standing, struct watch_event *event)
{
    const struct contact_config *contact = &watch->rig->contact;
    size_t count = plant_patches(watch->plant, watch->patch, watch->npatch);

    for (size_t i = 0; i < count && i < watch->npatch; i++) {
        const struct contact_pair *pair = &contact->pair[watch->patch[i].pair];
        int surface = contact->surface[pair->a].body < 0 ? pair->a : pair->b;
        int motion = contact->surface[surface == pair->a ? pair->b : pair->a].body;
        int body = motion < 0 ? -1 : watch->rig->contact_body[motion];
        const double *force = watch->patch[i].force;

        /* The other surface must be one of the robot, not of the world or of a free body */
        if (contact->surface[surface].body >= 0 || body < 0 ||
            body >= (int)watch->rig->robot->nbody || watch->limb_end[body] ||
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

/* Calls find_touching_body, but only if the wrench of a relevant body is nonzero: finding the
 * patches costs time. */
static bool robot_touches_world(struct watch *watch, bool standing, struct watch_event *event)
{
    const struct rig *rig = watch->rig;

    for (size_t c = 0; c < rig->contact.nbody; c++) {
        const double *force = plant_contact_wrenches(watch->plant)[c].force;
        int body = rig->contact_body[c];

        if (body < (int)rig->robot->nbody && !watch->limb_end[body] && !watch->stands[body] &&
            vec3_dot(force, force) > 0.0) {
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

/* Detects a fall by contact, tilt or height. Emits one event per fall. A fall ends when no
 * criterion was true for WATCH_CALM_NS. */
static void watch_fall(struct watch *watch, int64_t now_ns)
{
    bool standing = now_ns - watch->released_ns < WATCH_STANDS_NS;
    struct watch_event event = {.time_ns = now_ns};
    size_t count;
    const double *base = plant_values(watch->plant, &count);
    double height = base_height(watch, base + BASE_Q_POSITION);
    double R[9], axis[3], upright;
    bool down;

    /* upright: cosine of the angle between up and the base's axis that pointed up at the start */
    mat3_from_quaternion(base + BASE_Q_QUATERNION, R);
    mat3_apply(R, watch->base_up, axis);
    upright = vec3_dot(axis, watch->up);

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

/* ---- energy ---- */

void watch_check_energy(struct watch *watch, int64_t now_ns)
{
    struct plant_created created;

    watch->energy_ns = now_ns + WATCH_ENERGY_NS;
    if (!plant_check_energy(watch->plant, &created)) {
        return;
    }
    if (watch->created_ns < 0 || now_ns - watch->created_ns >= WATCH_CALM_NS) {
        const struct watch_event event = {.time_ns = now_ns,
                                          .kind = WATCH_ENERGY,
                                          .index = created.contact,
                                          .span_ns = created.span_ns,
                                          .value = created.energy_j,
                                          .limit = created.turnover_j};

        ring_push(&watch->events, &event);
    }
    watch->created_ns = now_ns;
    atomic_store(&watch->found_energy, true);
}

/* ---- depth ---- */

/* Returns how far a surface reaches below a half-space of the world, m. */
static double depth_below(const struct watch *watch, const struct contact_surface *surface,
                          const struct contact_surface *plane)
{
    const struct body_motion *motion =
        &plant_motion(watch->plant)[watch->rig->contact_body[surface->body]];
    double normal[3], up[3], n[3], center[3], reach = surface->radius_m;

    /* Computes the plane's normal in the axes of body and surface, and the surface's position
     * relative to the plane */
    for (int k = 0; k < 3; k++) {
        normal[k] = plane->rotation[3 * k + 2];
    }
    mat3_apply_transposed(motion->R, normal, up);
    mat3_apply_transposed(surface->rotation, up, n);
    mat3_apply(motion->R, surface->position, center);
    for (int k = 0; k < 3; k++) {
        center[k] += motion->p[k] - plane->position[k];
    }
    if (surface->shape == CONTACT_CAPSULE) {
        reach += 0.5 * surface->length_m * fabs(n[2]);
    } else if (surface->shape == CONTACT_CYLINDER) {
        reach = reach * sqrt(n[0] * n[0] + n[1] * n[1]) + 0.5 * surface->length_m * fabs(n[2]);
    } else if (surface->shape == CONTACT_BOX) {
        reach = fabs(surface->half_extent_m[0] * n[0]) + fabs(surface->half_extent_m[1] * n[1]) +
                fabs(surface->half_extent_m[2] * n[2]);
    } else if (surface->shape == CONTACT_MESH) {
        reach = -(double)INFINITY;
        for (size_t i = 0; i < surface->mesh->nvertex; i++) {
            reach = fmax(reach, -vec3_dot(surface->mesh->vertex[i], n));
        }
    }
    return reach - vec3_dot(center, normal);
}

/* Returns the largest valid penetration of two surfaces, m: the thickness of both layers, plus the
 * larger of WATCH_DEEP_M and a quarter of a radius or half extent. */
static double watch_limit(const struct contact_surface *a, const struct contact_surface *b)
{
    const struct contact_surface *const side[2] = {a, b};
    double layers = 0.0, size = 0.0;

    for (int i = 0; i < 2; i++) {
        const double *half = side[i]->half_extent_m;

        layers += side[i]->material.thickness_m;
        size = fmax(size, side[i]->shape == CONTACT_BOX ? fmin(half[0], fmin(half[1], half[2]))
                                                        : side[i]->radius_m);
    }
    return layers + fmax(WATCH_DEEP_M, 0.25 * size);
}

/* Stores the depth of a pair in event, and its excess over the limit in *worst, if the excess is
 * larger than *worst. */
static void note_depth(const struct watch *watch, const struct contact_pair *pair, double depth,
                       double *worst, struct watch_event *event)
{
    const struct contact_surface *surface = watch->rig->contact.surface;
    const bool swap = surface[pair->a].body < 0;
    const double limit = watch_limit(&surface[pair->a], &surface[pair->b]);

    if (depth - limit > *worst) {
        *worst = depth - limit;
        event->index = (size_t)(swap ? pair->b : pair->a);
        event->surface = (size_t)(swap ? pair->a : pair->b);
        event->value = depth;
        event->limit = limit;
    }
}

/* Finds the pair with the largest excess over its limit, from the engine's patches. planes: also
 * checks surfaces below half-spaces, which an engine may not report. Returns false if no pair
 * exceeds its limit. */
static bool find_deepest(const struct watch *watch, bool planes, struct watch_event *event)
{
    const struct contact_config *contact = &watch->rig->contact;
    const size_t count = plant_patches(watch->plant, watch->patch, watch->npatch);
    double worst = 0.0;

    for (size_t i = 0; i < count && i < watch->npatch; i++) {
        note_depth(watch, &contact->pair[watch->patch[i].pair], watch->patch[i].penetration_m,
                   &worst, event);
    }
    for (size_t p = 0; planes && p < contact->npair; p++) {
        const struct contact_pair *pair = &contact->pair[p];
        const struct contact_surface *a = &contact->surface[pair->a],
                                     *b = &contact->surface[pair->b];

        if (a->body < 0 && a->shape == CONTACT_HALF_SPACE) {
            note_depth(watch, pair, depth_below(watch, b, a), &worst, event);
        } else if (b->body < 0 && b->shape == CONTACT_HALF_SPACE) {
            note_depth(watch, pair, depth_below(watch, a, b), &worst, event);
        }
    }
    return worst > 0.0;
}

/* Refuses a surface that starts too deep in a surface of the world (watch_limit). */
static enum error_code check_start(const struct watch *watch, struct error *error)
{
    const struct rig *rig = watch->rig;
    struct watch_event event;
    int body;

    if (rig->contact_engine == RIG_CONTACT_NONE || !find_deepest(watch, true, &event) ||
        rig->contact.surface[event.surface].body >= 0) {
        return ERROR_NONE;
    }
    body = rig->contact_body[rig->contact.surface[event.index].body];
    return error_set(error, ERROR_INPUT,
                     "%s: surface %s of body %s starts %.4g m deep in %s, expected at most %.2g m: "
                     "raise it by base_xyz_m or base_height_m",
                     rig->file, rig->contact.surface[event.index].name,
                     body < (int)rig->robot->nbody ? rig->robot->body[body].name
                                                   : rig->free[body - (int)rig->robot->nbody].name,
                     event.value, rig->contact.surface[event.surface].name, event.limit);
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
            const struct robot_sea *sea = &watch->rig->robot->joint[j].sea;
            double deflection = fabs(motor[j].qm - motor[j].q);
            struct watch_joint *seen = &watch->joint[j];

            /* Detect a joint's series spring at its stop, and emit one event per occurrence */
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
    }
    if (watch->falls && plant_is_clamped(watch->plant)) {
        remember_standing(watch, plant_values(watch->plant, &count), now_ns);
    } else if (watch->falls) {
        watch_fall(watch, now_ns);
    }
    if (now_ns >= watch->energy_ns) {
        watch_check_energy(watch, now_ns);
    }
    if (now_ns >= watch->depth_ns && watch->rig->contact_engine != RIG_CONTACT_NONE) {
        struct watch_event event = {.time_ns = now_ns, .kind = WATCH_DEEP};

        /* Emit one event when a pair is too deep, and the next only after no pair was for
         * WATCH_CALM_NS */
        watch->depth_ns = now_ns + WATCH_DEPTH_NS;
        if (find_deepest(watch, watch->rig->contact_engine == RIG_CONTACT_SIMBODY, &event)) {
            if (watch->deep_ns < 0 || now_ns - watch->deep_ns >= WATCH_CALM_NS) {
                ring_push(&watch->events, &event);
            }
            watch->deep_ns = now_ns;
        }
    }
}

bool watch_found_energy(const struct watch *watch)
{
    return atomic_load(&watch->found_energy);
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

    /* Allocates two patches per pair, because an engine may split a patch */
    watch->rig = rig;
    watch->plant = plant;
    watch->npatch = 2 * rig->contact.npair;
    watch->created_ns = watch->deep_ns = -1;
    watch->joint = arena_alloc(arena, robot->njoint + 1, sizeof *watch->joint);
    watch->patch = arena_alloc(arena, watch->npatch + 1, sizeof *watch->patch);
    watch->limb_end = arena_alloc(arena, robot->nbody, sizeof *watch->limb_end);
    watch->stands = arena_alloc(arena, robot->nbody, sizeof *watch->stands);
    if (!watch->joint || !watch->patch || !watch->limb_end || !watch->stands) {
        return error_set(error, ERROR_MEMORY, "no memory left for the log of the robot");
    }
    ring_init(&watch->events, slots, sizeof(struct watch_event), EVENT_SLOTS);
    /* The ends of limbs are the bodies without children */
    for (size_t b = 0; b < robot->nbody; b++) {
        watch->limb_end[b] = true;
    }
    for (size_t b = 1; b < robot->nbody; b++) {
        watch->limb_end[robot->body[b].parent] = false;
    }

    /* The reference for falls: up, and the posture at the start */
    watch->falls = robot->floating && gravity > 0.0;
    for (int i = 0; watch->falls && i < 3; i++) {
        watch->up[i] = -robot->gravity[i] / gravity;
    }
    if (watch->falls) {
        remember_standing(watch, plant_values(plant, &count), plant_time_ns(plant));
    }
    *out = watch;
    return check_start(watch, error);
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
    const struct contact_surface *surface = watch->rig->contact.surface;
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
                 robot->body[event->index].name, surface[event->surface].name);
        break;
    case WATCH_ENERGY:
        snprintf(text, size,
                 "%.6f s: energy from nowhere: %s gained %.3g J in %.4g s, with a turnover of "
                 "%.3g J: %s; shorten substep_s (%g)%s",
                 seconds, event->index ? "bodies in contact" : "the motion", event->value,
                 (double)event->span_ns * 1e-9, event->limit,
                 event->index ? "materials are too stiff for the steps" : "the integrator diverges",
                 (double)watch->rig->substep_ns * 1e-9,
                 event->index                               ? " or soften the materials"
                 : watch->rig->integrator == PLANT_IMPLICIT ? ""
                                                            : " or use integrator: implicit");
        break;
    case WATCH_DEEP:
        snprintf(text, size,
                 "%.6f s: %s is %.4g m deep in %s, more than layers and backing can mean (%.2g m)",
                 seconds, surface[event->index].name, event->value, surface[event->surface].name,
                 event->limit);
        break;
    }
}
