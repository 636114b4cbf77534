/* SPDX-License-Identifier: Apache-2.0 */
/* Turns contact wrenches into arrows at their centers of pressure. */
#include "sim/contact_arrows.h"

#include "base/vec3.h"
#include "rt/clock.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* Length of the shortest and of the longest arrow, m. */
#define LEAST_M 0.004
#define LONGEST_M 0.9

/* A wrench counts as a ground contact within these limits: largest height of the body's origin
 * above the ground (m), largest distance of the center of pressure from the origin (m), and
 * smallest part of the force along the normal. */
#define NEAR_GROUND_M 0.3
#define FARTHEST_M 0.6
#define PRESSING 0.2

/* Diameters of shaft, head and ball, m. */
#define SHAFT_M 0.012
#define HEAD_M 0.03
#define BALL_M 0.015

/* ---- points of action ---- */

/* Finds the center of pressure on the ground: the point of the plane about which the wrench has no
 * moment parallel to the plane. Returns false if the body is not near the ground or does not press
 * on it. */
static bool wrench_meets_ground(const struct contact_arrows *arrows, const double origin[3],
                                const double wrench[6], double at[3])
{
    const double *normal = arrows->ground_normal, *force = wrench;
    double above[3], moment[3], pressing, height;

    if (!arrows->has_ground) {
        return false;
    }
    vec3_sub(origin, arrows->ground_point, above);
    height = vec3_dot(above, normal);
    pressing = vec3_dot(force, normal);
    if (!(fabs(pressing) > PRESSING * vec3_norm(force)) || height > NEAR_GROUND_M) {
        return false;
    }

    /* Shifts the wrench to the foot of the body's origin on the plane, then cancels its moment
     * parallel to the plane */
    memcpy(at, origin, 3 * sizeof *at);
    vec3_add_scaled(at, -height, normal, at);
    vec3_sub(origin, at, above);
    vec3_cross(above, force, moment);
    vec3_add_scaled(moment, 1.0, wrench + 3, moment);
    vec3_cross(normal, moment, above);
    vec3_add_scaled(at, 1.0 / pressing, above, at);
    return true;
}

size_t contact_arrows_find(const struct contact_arrows *arrows, const double *value,
                           const double *pose, struct contact_arrow arrow[CONTACT_ARROWS])
{
    size_t count = 0;

    for (size_t c = 0; c < arrows->ncontact && count < CONTACT_ARROWS; c++) {
        const double *wrench = value + arrows->contact[c].signal;
        const double *origin = pose + RECORDER_POSE * arrows->contact[c].body;
        struct contact_arrow *next = &arrow[count];
        double force = vec3_norm(wrench), far[3];

        /* An arrow's length is proportional to the force, within bounds */
        next->length_m = fmin(LONGEST_M, force * arrows->arrow_m_per_n);
        if (!(isfinite(force) && next->length_m > LEAST_M)) {
            continue;
        }
        for (int k = 0; k < 3; k++) {
            next->along[k] = wrench[k] / force;
        }
        if (!wrench_meets_ground(arrows, origin, wrench, next->at)) {
            /* Finds the point of the axis nearest to the body's origin: r = f x m / (f . f) */
            double arm[3];

            vec3_cross(wrench, wrench + 3, arm);
            vec3_add_scaled(origin, 1.0 / vec3_dot(wrench, wrench), arm, next->at);
        }

        /* A nearly pure moment has a distant axis, so its arrow starts at the body's origin */
        vec3_sub(next->at, origin, far);
        if (!(vec3_norm(far) < FARTHEST_M)) {
            memcpy(next->at, origin, sizeof next->at);
        }
        count++;
    }
    return count;
}

/* ---- primitives ---- */

/* Computes the quaternion (wxyz) that rotates the x axis to the unit vector `along`. For the
 * opposite direction, it is half a turn about z. */
static void quaternion_of_arrow(const double along[3], double q[4])
{
    double length = sqrt(2.0 * (1.0 + along[0]));

    if (!(length > 1e-6)) {
        memcpy(q, (const double[4]){0.0, 0.0, 0.0, 1.0}, 4 * sizeof *q);
        return;
    }
    q[0] = 0.5 * length;
    q[1] = 0.0;
    q[2] = -along[2] / length;
    q[3] = along[1] / length;
}

/* Writes position and orientation (quaternion wxyz) of a primitive. */
static char *print_placed(char *at, const double position[3], const double q[4])
{
    return at + sprintf(at,
                        "{\"pose\":{\"position\":{\"x\":%.6g,\"y\":%.6g,\"z\":%.6g},"
                        "\"orientation\":{\"x\":%.6g,\"y\":%.6g,\"z\":%.6g,\"w\":%.6g}},",
                        position[0], position[1], position[2], q[1], q[2], q[3], q[0]);
}

char *contact_arrows_print(const struct contact_arrow *arrow, size_t count, char *at)
{
    for (size_t i = 0; i < count; i++) {
        double head = fmin(HEAD_M * 2.0, 0.5 * arrow[i].length_m), q[4];

        quaternion_of_arrow(arrow[i].along, q);
        at += sprintf(at, "%s", i ? "," : "");
        at = print_placed(at, arrow[i].at, q);
        at += sprintf(at,
                      "\"shaft_length\":%.6g,\"shaft_diameter\":%g,\"head_length\":%.6g,"
                      "\"head_diameter\":%g,\"color\":{\"r\":0.2,\"g\":0.5,\"b\":1,\"a\":1}}",
                      arrow[i].length_m - head, SHAFT_M, head, HEAD_M);
    }
    return at;
}

char *contact_arrows_print_pressures(const struct contact_arrow *arrow, size_t count, char *at)
{
    static const double upright[4] = {1.0, 0.0, 0.0, 0.0};

    for (size_t i = 0; i < count; i++) {
        at += sprintf(at, "%s", i ? "," : "");
        at = print_placed(at, arrow[i].at, upright);
        at += sprintf(at,
                      "\"size\":{\"x\":%g,\"y\":%g,\"z\":%g},"
                      "\"color\":{\"r\":1,\"g\":0.6,\"b\":0.1,\"a\":1}}",
                      BALL_M, BALL_M, BALL_M);
    }
    return at;
}

/* ---- the channel ---- */

/* Writes text unchanged; returns the address after it. */
static char *print_text(char *at, const char *text)
{
    size_t size = strlen(text);

    memcpy(at, text, size);
    return at + size;
}

/* Writes one entity, which replaces the entity of the last row; writes none if there is no
 * contact. */
static char *contact_arrows_print_message(void *context, int64_t time_ns, const double *value,
                                          const double *pose, char *at)
{
    struct contact_arrows *arrows = context;
    struct contact_arrow arrow[CONTACT_ARROWS];
    size_t count = contact_arrows_find(arrows, value, pose, arrow);

    if (count == 0 && arrows->touching == 0) {
        return at;
    }
    arrows->touching = count;
    at += sprintf(at,
                  "{\"deletions\":[],\"entities\":[{\"timestamp\":{\"sec\":%" PRId64
                  ",\"nsec\":%" PRId64 "},\"frame_id\":\"world\",\"id\":\"contacts\","
                  "\"lifetime\":{\"sec\":0,\"nsec\":0},\"frame_locked\":true,\"metadata\":[],"
                  "\"arrows\":[",
                  time_ns / CLOCK_SECOND, time_ns % CLOCK_SECOND);
    at = contact_arrows_print(arrow, count, at);
    at = print_text(at, "],\"cubes\":[],\"spheres\":[");
    at = contact_arrows_print_pressures(arrow, count, at);
    return print_text(at, "],\"cylinders\":[],\"lines\":[],\"triangles\":[],\"texts\":[],"
                          "\"models\":[]}]}");
}

struct recorder_channel contact_arrows_channel(struct contact_arrows *arrows)
{
    return (struct recorder_channel){
        .topic = "/contacts",
        .type = "foxglove.SceneUpdate",
        .schema = recorder_schema_scene,
        .longest = CONTACT_ARROW_SIZE * (CONTACT_ARROWS + 1),
        .print = contact_arrows_print_message,
        .context = arrows,
    };
}
