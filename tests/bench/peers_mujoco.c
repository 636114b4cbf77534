/* SPDX-License-Identifier: Apache-2.0 */
/*
 * MuJoCo as a peer. MuJoCo loads the robot as MJCF. Contacts are on only if the robot stands.
 * Constraints are on only if it stands or has couplings. The benchmark measures the time of
 * mj_forward or mj_step. A free joint of MuJoCo has its linear velocity in world axes and its
 * angular velocity in the body's.
 */
#include "tests/bench/peers.h"

#include "model/spatial.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <mujoco/mujoco.h>

/* The description of a model for MuJoCo. */
struct described {
    const struct robot *robot;
    const struct contact_config *contact; /* NULL = bodies alone */
    const int *body;                      /* index of the robot's body, by body of contact */
    bool coupled;                         /* with the robot's couplings */
};

struct engine {
    const struct robot *robot;
    bool standing;
    mjModel *model;
    mjData *data;
    int *q, *v; /* of each joint: where its position and its rate stand in MuJoCo's vectors */
    double *kept_q, *kept_v, *kept_f; /* PEER_SLOTS times nq, nv, nv */
};

static void put_numbers(FILE *out, const char *key, const double *value, size_t count)
{
    fprintf(out, " %s=\"", key);
    for (size_t i = 0; i < count; i++) {
        fprintf(out, "%s%.17g", i ? " " : "", value[i]);
    }
    fputc('"', out);
}

/* wxyz of a rotation, from the largest of its four elements */
static void quaternion_of(const double R[9], double q[4])
{
    double square[4] = {1.0 + R[0] + R[4] + R[8], 1.0 + R[0] - R[4] - R[8],
                        1.0 - R[0] + R[4] - R[8], 1.0 - R[0] - R[4] + R[8]};
    /* 4 q_m q_n for m < n */
    double product[4][4] = {{0.0, R[7] - R[5], R[2] - R[6], R[3] - R[1]},
                            {0.0, 0.0, R[1] + R[3], R[2] + R[6]},
                            {0.0, 0.0, 0.0, R[5] + R[7]}};
    int largest = 0;

    for (int m = 1; m < 4; m++) {
        largest = square[m] > square[largest] ? m : largest;
    }
    q[largest] = 0.5 * sqrt(square[largest]);
    for (int m = 0; m < 4; m++) {
        if (m != largest) {
            q[m] =
                product[m < largest ? m : largest][m < largest ? largest : m] / (4.0 * q[largest]);
        }
    }
}

/* Principal moments of a symmetric tensor, and its principal axes as the columns of R, by Jacobi's
 * method. MuJoCo's own diagonalization stops at about 1e-8. */
static void principal_axes(const double I[6], double moment[3], double R[9])
{
    double A[3][3] = {{I[0], I[1], I[2]}, {I[1], I[3], I[4]}, {I[2], I[4], I[5]}};

    mat3_identity(R);
    for (int sweep = 0; sweep < 12; sweep++) {
        for (int n = 0; n < 3; n++) {
            int a = n, b = (n + 1) % 3;
            double difference = A[a][a] - A[b][b];
            /* of the two angles the smaller: the larger swaps the axes and never ends */
            double angle = 0.5 * atan2(copysign(2.0, difference) * A[a][b], fabs(difference));
            double c = cos(angle), s = sin(angle);

            /* A <- G^T A G, R <- R G, G a rotation in the plane of a and b */
            for (int k = 0; k < 3; k++) {
                double x = A[k][a], y = A[k][b], u = R[3 * k + a], v = R[3 * k + b];

                A[k][a] = c * x + s * y;
                A[k][b] = c * y - s * x;
                R[3 * k + a] = c * u + s * v;
                R[3 * k + b] = c * v - s * u;
            }
            for (int k = 0; k < 3; k++) {
                double x = A[a][k], y = A[b][k];

                A[a][k] = c * x + s * y;
                A[b][k] = c * y - s * x;
            }
        }
    }
    for (int m = 0; m < 3; m++) {
        moment[m] = A[m][m];
    }
}

static void put_inertia(FILE *out, const struct robot_inertia *inertia)
{
    double moment[3], R[9], quaternion[4];

    principal_axes(inertia->I, moment, R);
    quaternion_of(R, quaternion);
    fputs("<inertial", out);
    put_numbers(out, "pos", inertia->com, 3);
    put_numbers(out, "quat", quaternion, 4);
    put_numbers(out, "mass", &inertia->mass, 1);
    put_numbers(out, "diaginertia", moment, 3);
    fputs("/>\n", out);
}

/* Returns the center and the half sides of the box about a surface's shape, in its own frame. */
static void box_about(const struct contact_surface *surface, double center[3], double half[3])
{
    double low[3], high[3];

    memset(center, 0, 3 * sizeof *center);
    memcpy(half, surface->half_extent_m, 3 * sizeof *half);
    for (size_t i = 0; surface->shape == CONTACT_MESH && i < surface->mesh->nvertex; i++) {
        for (int k = 0; k < 3; k++) {
            const double x = surface->mesh->vertex[i][k];

            low[k] = i == 0 || x < low[k] ? x : low[k];
            high[k] = i == 0 || x > high[k] ? x : high[k];
            center[k] = 0.5 * (low[k] + high[k]);
            half[k] = 0.5 * (high[k] - low[k]);
        }
    }
}

/* Writes a surface as a geom. Only geoms that stop others and those that are stopped meet, so that
 * a robot touches the ground but not itself. */
static void put_surface(FILE *out, const struct contact_surface *surface)
{
    const double round[2] = {surface->radius_m, 0.5 * surface->length_m};
    double center[3] = {0.0}, half[3], position[3], quaternion[4];

    if (surface->shape == CONTACT_HALF_SPACE) {
        fputs("<geom type=\"plane\" size=\"0 0 1\" contype=\"1\" conaffinity=\"0\"", out);
    } else if (surface->shape == CONTACT_CYLINDER ||
               (surface->shape == CONTACT_CAPSULE && surface->length_m > 0.0)) {
        fprintf(out, "<geom type=\"%s\" contype=\"0\" conaffinity=\"1\"",
                surface->shape == CONTACT_CYLINDER ? "cylinder" : "capsule");
        put_numbers(out, "size", round, 2);
    } else if (surface->shape == CONTACT_CAPSULE || surface->shape == CONTACT_SPHERE) {
        fputs("<geom type=\"sphere\" contype=\"0\" conaffinity=\"1\"", out);
        put_numbers(out, "size", round, 1);
    } else {
        box_about(surface, center, half);
        fputs("<geom type=\"box\" contype=\"0\" conaffinity=\"1\"", out);
        put_numbers(out, "size", half, 3);
    }
    mat3_apply(surface->rotation, center, position);
    for (int k = 0; k < 3; k++) {
        position[k] += surface->position[k];
    }
    quaternion_of(surface->rotation, quaternion);
    put_numbers(out, "pos", position, 3);
    put_numbers(out, "quat", quaternion, 4);
    fputs("/>\n", out);
}

/* Writes the surfaces of a body that are in a pair, each once; of the world: b < 0. */
static void put_surfaces(FILE *out, const struct described *what, int b)
{
    for (size_t s = 0; what->contact && s < what->contact->nsurface; s++) {
        const struct contact_surface *surface = &what->contact->surface[s];
        bool paired = false;

        for (size_t i = 0; i < what->contact->npair; i++) {
            paired =
                paired || what->contact->pair[i].a == (int)s || what->contact->pair[i].b == (int)s;
        }
        if (paired && (surface->body < 0 ? -1 : what->body[surface->body]) == b) {
            put_surface(out, surface);
        }
    }
}

/* Writes the joint above a body, with its spring where the robot stands. */
static void put_joint(FILE *out, const struct described *what, size_t j)
{
    const struct robot_joint *joint = &what->robot->joint[j];

    fprintf(out, "<joint name=\"j%zu\" type=\"%s\"", j,
            joint->type == JOINT_REVOLUTE ? "hinge" : "slide");
    put_numbers(out, "axis", joint->axis, 3);
    if (what->contact) {
        put_numbers(out, "stiffness", &joint->passive.stiffness, 1);
        put_numbers(out, "damping", &joint->passive.damping, 1);
        put_numbers(out, "springref", &joint->passive.rest, 1);
    }
    fputs("/>\n", out);
}

static void put_body(FILE *out, const struct described *what, size_t b)
{
    const struct robot *robot = what->robot;

    if (b == 0 && robot->floating) {
        fputs("<body name=\"b0\"><freejoint/>\n", out);
        put_inertia(out, &robot->body[0].inertia);
    } else if (b > 0) {
        const struct robot_joint *joint = &robot->joint[b - 1];
        double quaternion[4];

        quaternion_of(joint->rotation, quaternion);
        fprintf(out, "<body name=\"b%zu\"", b);
        put_numbers(out, "pos", joint->origin, 3);
        put_numbers(out, "quat", quaternion, 4);
        fputs(">\n", out);
        put_joint(out, what, b - 1);
        put_inertia(out, &robot->body[b].inertia);
    }
    put_surfaces(out, what, b == 0 && !robot->floating ? -1 : (int)b);
    for (size_t child = b + 1; child < robot->nbody; child++) {
        if (robot->body[child].parent == (int)b) {
            put_body(out, what, child);
        }
    }
    if (b > 0 || robot->floating) {
        fputs("</body>\n", out);
    }
}

/* The robot as MuJoCo's XML in *text, from the heap. */
static bool describe(const struct described *what, char **text, size_t *size)
{
    FILE *out = open_memstream(text, size);

    if (!out) {
        return false;
    }
    fputs("<mujoco>\n<compiler angle=\"radian\" balanceinertia=\"true\" boundmass=\"1e-9\" "
          "boundinertia=\"1e-12\"/>\n<option",
          out);
    put_numbers(out, "gravity", what->robot->gravity, 3);
    fputs(what->contact   ? "/>\n<worldbody>\n"
          : what->coupled ? "><flag contact=\"disable\"/></option>\n<worldbody>\n"
                          : "><flag constraint=\"disable\" contact=\"disable\"/></option>\n"
                            "<worldbody>\n",
          out);
    if (what->robot->floating) {
        put_surfaces(out, what, -1);
    }
    put_body(out, what, 0);
    fputs("</worldbody>\n<equality>\n", out);
    for (size_t i = 0; what->coupled && i < what->robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &what->robot->coupling[i];
        const double line[5] = {coupling->offset, coupling->multiplier};

        fprintf(out, "<joint joint1=\"j%zu\" joint2=\"j%zu\"", (size_t)coupling->follower,
                (size_t)coupling->leader);
        put_numbers(out, "polycoef", line, 5);
        fputs("/>\n", out);
    }
    fputs("</equality>\n</mujoco>\n", out);
    return fclose(out) == 0;
}

static mjModel *compile(const char *text, size_t size, char *message, size_t room)
{
    static const char name[] = "robot.xml";
    mjVFS *vfs = malloc(sizeof *vfs);
    mjModel *model = NULL;

    if (!vfs) {
        return NULL;
    }
    mj_defaultVFS(vfs);
    if (mj_makeEmptyFileVFS(vfs, name, (int)size) == 0) {
        memcpy(vfs->filedata[mj_findFileVFS(vfs, name)], text, size);
        model = mj_loadXML(name, vfs, message, (int)room);
    }
    mj_deleteVFS(vfs);
    free(vfs);
    return model;
}

static void destroy(void *memory)
{
    struct engine *engine = memory;

    if (engine->data) {
        mj_deleteData(engine->data);
    }
    if (engine->model) {
        mj_deleteModel(engine->model);
    }
    free(engine->q);
    free(engine->v);
    free(engine->kept_q);
    free(engine->kept_v);
    free(engine->kept_f);
    free(engine);
}

/* MuJoCo orders bodies depth first; joints are found by name. */
static bool fill(struct engine *engine)
{
    const struct robot *robot = engine->robot;

    engine->data = mj_makeData(engine->model);
    engine->q = calloc(robot->njoint + 1, sizeof *engine->q);
    engine->v = calloc(robot->njoint + 1, sizeof *engine->v);
    engine->kept_q = calloc(PEER_SLOTS * robot->nq, sizeof *engine->kept_q);
    engine->kept_v = calloc(PEER_SLOTS * robot->nv, sizeof *engine->kept_v);
    engine->kept_f = calloc(PEER_SLOTS * robot->nv, sizeof *engine->kept_f);
    if (!engine->data || !engine->q || !engine->v || !engine->kept_q || !engine->kept_v ||
        !engine->kept_f) {
        return false;
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        char name[32];
        int id;

        snprintf(name, sizeof name, "j%zu", j);
        id = mj_name2id(engine->model, mjOBJ_JOINT, name);
        engine->q[j] = engine->model->jnt_qposadr[id];
        engine->v[j] = engine->model->jnt_dofadr[id];
    }
    return true;
}

static void *create_engine(const struct described *what, char *message, size_t size)
{
    struct engine *engine = calloc(1, sizeof *engine);
    char *text = NULL;
    size_t length = 0;

    snprintf(message, size, "no memory");
    if (!engine) {
        return NULL;
    }
    engine->robot = what->robot;
    engine->standing = what->contact != NULL;
    if (describe(what, &text, &length)) {
        engine->model = compile(text, length, message, size);
    }
    free(text);
    if (!engine->model || !fill(engine)) {
        destroy(engine);
        return NULL;
    }
    return engine;
}

static void *create(const struct robot *robot, char *message, size_t size)
{
    return create_engine(&(struct described){.robot = robot}, message, size);
}

static void *create_moving(const struct robot *robot, const struct contact_config *contact,
                           const int *body, char *message, size_t size)
{
    const struct described what = {robot, contact, body, robot->ncoupling > 0};

    return create_engine(&what, message, size);
}

static void put(void *memory, size_t slot, const double *q, const double *v, const double *tau)
{
    struct engine *engine = memory;
    const struct robot *robot = engine->robot;
    double *qpos = engine->kept_q + slot * robot->nq, *qvel = engine->kept_v + slot * robot->nv;
    double *force = engine->kept_f + slot * robot->nv, R[9];

    if (robot->floating) {
        memcpy(qpos, q, 7 * sizeof *q);
        mat3_from_quaternion(q + 3, R);
        mat3_apply(R, v, qvel);
        memcpy(qvel + 3, v + 3, 3 * sizeof *v);
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        qpos[engine->q[j]] = q[robot->nq - robot->njoint + j];
        qvel[engine->v[j]] = v[robot->nv - robot->njoint + j];
        force[engine->v[j]] = tau[j];
    }
}

static void run(void *memory, size_t slot)
{
    struct engine *engine = memory;
    const struct robot *robot = engine->robot;

    memcpy(engine->data->qpos, engine->kept_q + slot * robot->nq, robot->nq * sizeof(double));
    memcpy(engine->data->qvel, engine->kept_v + slot * robot->nv, robot->nv * sizeof(double));
    memcpy(engine->data->qfrc_applied, engine->kept_f + slot * robot->nv,
           robot->nv * sizeof(double));
    mj_forward(engine->model, engine->data);
}

static void get(void *memory, double *vdot)
{
    const struct engine *engine = memory;
    const struct robot *robot = engine->robot;
    const mjtNum *qacc = engine->data->qacc;

    if (robot->floating) {
        double R[9], v[3], turned[3];

        /* d(R^T v)/dt = R^T a - w x (R^T v), w in the body frame */
        mat3_from_quaternion(engine->data->qpos + 3, R);
        mat3_apply_transposed(R, engine->data->qvel, v);
        vec3_cross(engine->data->qvel + 3, v, turned);
        mat3_apply_transposed(R, qacc, vdot);
        for (int m = 0; m < 3; m++) {
            vdot[m] -= turned[m];
            vdot[3 + m] = qacc[3 + m];
        }
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        vdot[robot->nv - robot->njoint + j] = qacc[engine->v[j]];
    }
}

/* Returns whether a robot that stands has its base within 5 cm of where it was put. */
static bool stood(const struct engine *engine, size_t slot)
{
    const double *begin = engine->kept_q + slot * engine->robot->nq;
    bool near = true;

    for (int k = 0; engine->standing && k < 3; k++) {
        near = near && fabs(engine->data->qpos[k] - begin[k]) < 0.05;
    }
    return near;
}

/* Euler's method, MuJoCo's default: rates first; or its method that is implicit in the rates. */
static bool step(void *memory, size_t slot, bool implicit, double dt, size_t steps)
{
    struct engine *engine = memory;

    mj_resetData(engine->model, engine->data);
    engine->model->opt.timestep = dt;
    engine->model->opt.integrator = implicit ? mjINT_IMPLICIT : mjINT_EULER;
    run(engine, slot);
    for (size_t i = 0; i < steps; i++) {
        mj_step(engine->model, engine->data);
    }
    return stood(engine, slot) && engine->data->warning[mjWARN_BADQPOS].number == 0 &&
           engine->data->warning[mjWARN_BADQVEL].number == 0 &&
           engine->data->warning[mjWARN_BADQACC].number == 0;
}

const struct peer_dynamics peer_mujoco = {
    "MuJoCo", PEERS_MUJOCO_VERSION, create, create_moving, destroy, put, run, get, step};
