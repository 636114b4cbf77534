/* SPDX-License-Identifier: Apache-2.0 */
/*
 * usage: test_import_dump FOLDER <LIST
 *
 * Imports each file that a line of LIST names into FOLDER, and prints one line of JSON for each:
 * the robot as read back, random states with their accelerations, the report, or the error.
 * generated/judge.mjs compares it with MuJoCo.
 */
#include "app/import/import.h"
#include "base/random.h"
#include "base/vec3.h"
#include "model/dynamics.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { STATES = 5 };

#define ARENA ((size_t)1 << 30)

static struct random_stream dice;

static double draw(double most)
{
    return most * (2.0 * random_uniform(&dice) - 1.0);
}

static void put_reals(const char *name, const double *value, size_t count)
{
    printf("\"%s\":[", name);
    for (size_t i = 0; i < count; i++) {
        printf("%s%.17g", i ? "," : "", value[i]);
    }
    fputs("]", stdout);
}

static void put_text(const char *name, const char *text)
{
    printf("\"%s\":\"", name);
    for (; *text; text++) {
        printf(*text == '"' || *text == '\\' ? "\\%c"
               : (unsigned char)*text < ' '  ? " "
                                             : "%c",
               *text);
    }
    fputs("\"", stdout);
}

static void put_place(const struct robot_frame *frame, const struct body_motion *bodies)
{
    const struct body_motion *body = &bodies[frame->body];
    double p[3], R[9];

    mat3_apply(body->R, frame->position, p);
    vec3_add_scaled(p, 1.0, body->p, p);
    mat3_mul(body->R, frame->rotation, R);
    fputs("{", stdout);
    put_text("name", frame->name);
    fputs(",", stdout);
    put_reals("p", p, 3);
    fputs(",", stdout);
    put_reals("R", R, 9);
    fputs("}", stdout);
}

/* Bodies and frames where they are in the world in the first state. */
static void put_bodies(const struct robot *robot, const double *q, struct arena *arena)
{
    static const double origin[3], upright[4] = {1, 0, 0, 0};
    struct body_motion *bodies = arena_alloc(arena, robot->nbody, sizeof *bodies);

    robot_place_bodies(robot, robot->floating ? q : origin, robot->floating ? q + 3 : upright,
                       q + robot->nq - robot->njoint, bodies);
    fputs(",\"bodies\":[", stdout);
    for (size_t b = 0; b < robot->nbody; b++) {
        const struct robot_inertia *own = &robot->body[b].inertia;
        double com[3], I[6];

        mat3_apply(bodies[b].R, own->com, com);
        vec3_add_scaled(com, 1.0, bodies[b].p, com);
        memcpy(I, own->I, sizeof I);
        sym3_rotate(bodies[b].R, I);
        printf("%s{\"mass\":%.17g,", b ? "," : "", own->mass);
        put_text("name", robot->body[b].name);
        fputs(",", stdout);
        put_reals("com", com, 3);
        fputs(",", stdout);
        put_reals("I", I, 6);
        fputs("}", stdout);
    }
    fputs("],\"frames\":[", stdout);
    for (size_t f = 0; f < robot->nframe; f++) {
        fputs(f ? "," : "", stdout);
        put_place(&robot->frame[f], bodies);
    }
    printf("],\"imu\":%d,\"ft\":[", robot->imu_frame);
    for (size_t f = 0; f < robot->nft; f++) {
        printf("%s{\"frame\":%d,", f ? "," : "", robot->ft[f].frame);
        put_text("name", robot->ft[f].name);
        fputs("}", stdout);
    }
    fputs("]", stdout);
}

static void put_joints(const struct robot *robot)
{
    fputs(",\"joints\":[", stdout);
    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_joint *joint = &robot->joint[j];
        const struct robot_coupling *coupling = robot_find_coupling(robot, j);

        fputs(j ? ",{" : "{", stdout);
        put_text("name", joint->name);
        printf(",\"lower\":%.17g,\"upper\":%.17g,\"stop\":%s,\"limit\":%.17g,\"driven\":%s,"
               "\"armature\":%.17g,\"damping\":%.17g,\"stiffness\":%.17g,\"rest\":%.17g,"
               "\"friction\":%.17g",
               joint->lower, joint->upper, joint->stop.stiffness > 0.0 ? "true" : "false",
               joint->torque_limit, joint->sea.present ? "true" : "false", joint->sea.J,
               joint->sea.present ? joint->sea.Dm : joint->passive.damping,
               joint->passive.stiffness, joint->passive.rest,
               joint->sea.effects ? joint->sea.effects->coulomb : 0.0);
        if (coupling) {
            printf(",\"multiplier\":%.17g,\"offset\":%.17g,", coupling->multiplier,
                   coupling->offset);
            put_text("leader", robot->joint[coupling->leader].name);
        }
        fputs("}", stdout);
    }
    fputs("],\"poses\":[", stdout);
    for (size_t p = 0; p < robot->npose; p++) {
        fputs(p ? ",{" : "{", stdout);
        put_text("name", robot->pose[p].name);
        fputs(",", stdout);
        put_reals("joint", robot->pose[p].joint, robot->njoint);
        fputs("}", stdout);
    }
    fputs("]", stdout);
}

/* Random positions, rates and torques, and the accelerations that they cause. */
static enum error_code put_states(const struct robot *robot, struct arena *arena,
                                  struct error *error)
{
    double *q = arena_alloc(arena, robot->nq + 1, sizeof *q);
    double *v = arena_alloc(arena, robot->nv + 1, sizeof *v);
    double *tau = arena_alloc(arena, robot->njoint + 1, sizeof *tau);
    double *vdot = arena_alloc(arena, robot->nv + 1, sizeof *vdot), length = 0.0;
    struct dynamics d;
    enum error_code code = dynamics_generic(robot, arena, &d, error);

    for (int s = 0; s < STATES && !code; s++) {
        for (size_t i = 0; i < robot->nq; i++) {
            q[i] = draw(1.5);
        }
        for (size_t i = 0; i < robot->nv; i++) {
            v[i] = draw(2.0);
        }
        for (size_t j = 0; j < robot->njoint; j++) {
            tau[j] = draw(5.0);
        }
        if (robot->floating) {
            length = sqrt(q[3] * q[3] + q[4] * q[4] + q[5] * q[5] + q[6] * q[6]);
        }
        for (int i = 3; i < 7 && robot->floating; i++) {
            q[i] /= length;
        }
        d.ops->forward(&d, q, v, tau, NULL, vdot);
        if (s == 0) {
            put_bodies(robot, q, arena);
        }
        fputs(s ? ",{" : ",\"states\":[{", stdout);
        put_reals("q", q, robot->nq);
        fputs(",", stdout);
        put_reals("v", v, robot->nv);
        fputs(",", stdout);
        put_reals("tau", tau, robot->njoint);
        fputs(",", stdout);
        put_reals("vdot", vdot, robot->nv);
        fputs("}", stdout);
    }
    fputs("]", stdout);
    return code;
}

static enum error_code put_file(const char *path, const char *folder, struct arena *arena,
                                struct error *error)
{
    static const char *const fate[] = {"dropped", "merged", "changed", "assumed",
                                       "missing", "shaped", "doubted"};
    struct import_request request = {
        .file = path,
        .folder = folder,
        .force = true,
        .options = {.mimic = IMPORT_MIMIC_COUPLE, .free_slides = true}};
    struct import_result result;
    enum error_code code = import_run(&request, arena, &result, error);

    for (size_t i = 0; i < result.notes.count; i++) {
        const struct import_note *note = &result.notes.note[i];

        printf(i ? ",[\"%s\",%d,{" : ",\"notes\":[[\"%s\",%d,{", fate[note->fate], note->line);
        put_text("text", note->text);
        fputs("}]", stdout);
    }
    fputs(result.notes.count ? "]" : "", stdout);
    if (code) {
        return code;
    }
    printf(",\"floating\":%s", result.loaded->floating ? "true" : "false");
    put_joints(result.loaded);
    return put_states(result.loaded, arena, error);
}

int main(int argc, char **argv)
{
    char path[PATH_MAX];

    while (argc == 2 && fgets(path, sizeof path, stdin)) {
        struct arena arena = {0};
        struct error error = {.code = ERROR_NONE};

        path[strcspn(path, "\n")] = '\0';
        dice = random_named(1, path + (strrchr(path, '/') ? strrchr(path, '/') - path : 0));
        fputs("{", stdout);
        put_text("file", path);
        if (arena_init(&arena, ARENA, &error) || put_file(path, argv[1], &arena, &error)) {
            fputs(",", stdout);
            put_text("error", error.text);
        }
        fputs("}\n", stdout);
        fflush(stdout);
        arena_fini(&arena);
    }
    return ferror(stdout) || argc != 2;
}
