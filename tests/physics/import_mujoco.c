/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What import makes of a URDF beside what MuJoCo makes of the same file: masses, centers of mass
 * and inertias of every body, accelerations in random states. The files are made here, with all
 * that a tree can have. With arguments it compares one file by hand:
 *
 *     test_import_mujoco FILE.urdf robots/NAME.yaml
 *
 * in which shapes are left out and links that MuJoCo finds no joint for are not compared; then once
 * more with the inertias of the robot in both, which shows what import has repaired.
 */
#include "app/import/import.h"
#include "base/random.h"
#include "base/vec3.h"
#include "model/plant.h"
#include "tests/test.h"

#include <libxml/parser.h>
#include <math.h>
#include <mujoco/mujoco.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { TREES = 40, LINKS_MOST = 25, STATES = 5 };

static struct arena arena;
static struct random_stream dice;

static double draw(double low, double high)
{
    return low + (high - low) * random_uniform(&dice);
}

/* ---- a random file ---- */

static void put_triple(FILE *out, const char *name, double size)
{
    fprintf(out, " %s=\"%.17g %.17g %.17g\"", name, draw(-size, size), draw(-size, size),
            draw(-size, size));
}

static void put_place(FILE *out)
{
    fputs("<origin", out);
    put_triple(out, "xyz", 0.5);
    put_triple(out, "rpy", 3.0);
    fputs("/>", out);
}

/* Inertia of three pairs of points on random axes: one that a body can have. */
static void put_link(FILE *out, const char *name, bool massless)
{
    double mass = draw(0.1, 5.0), I[6] = {0};

    fprintf(out, "<link name=\"%s\">", name);
    if (!massless) {
        for (int p = 0; p < 4; p++) {
            double r[3] = {draw(-0.2, 0.2), draw(-0.2, 0.2), draw(-0.2, 0.2)};
            double square = vec3_dot(r, r);

            for (int a = 0; a < 3; a++) {
                for (int b = a; b < 3; b++) {
                    I[sym3_index[a][b]] += mass * ((a == b ? square : 0.0) - r[a] * r[b]);
                }
            }
        }
        fputs("<inertial>", out);
        put_place(out);
        fprintf(out,
                "<mass value=\"%.17g\"/><inertia ixx=\"%.17g\" ixy=\"%.17g\" ixz=\"%.17g\" "
                "iyy=\"%.17g\" iyz=\"%.17g\" izz=\"%.17g\"/></inertial>",
                mass, I[0], I[1], I[2], I[3], I[4], I[5]);
    }
    fputs("</link>\n", out);
}

/* MuJoCo lets things float in its world only. */
static const char *link_name(int i, char name[16])
{
    if (i == 0) {
        return "world";
    }
    snprintf(name, 16, "l%d", i);
    return name;
}

/* Joint i moves link i; a floating one is the first, below a root without mass. */
static void put_joint(FILE *out, int i, bool floats)
{
    static const char *const type[] = {"revolute", "continuous", "prismatic", "fixed"};
    char parent[16];
    int kind = floats ? 0 : (int)draw(0, 4);

    fprintf(out, "<joint name=\"j%d\" type=\"%s\"><parent link=\"%s\"/><child link=\"l%d\"/>", i,
            floats ? "floating" : type[kind], link_name(i > 1 ? (int)draw(1, i) : 0, parent), i);
    put_place(out);
    fputs("<axis", out);
    put_triple(out, "xyz", 2.0);
    fputs("/><limit lower=\"-100\" upper=\"100\" effort=\"20\" velocity=\"3\"/></joint>\n", out);
}

static void put_robot(const char *path, int links, bool floats)
{
    FILE *out = fopen(path, "w");
    char name[16];

    assert_non_null(out);
    fputs("<robot name=\"tree\">\n", out);
    for (int i = 0; i < links; i++) {
        put_link(out, link_name(i, name), i == 0);
    }
    for (int i = 1; i < links; i++) {
        put_joint(out, i, floats && i == 1);
    }
    /* Something that moves, whatever the dice say */
    fprintf(out,
            "<link name=\"end\"><inertial><mass value=\"1\"/><inertia ixx=\"0.1\" iyy=\"0.1\" "
            "izz=\"0.1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>"
            "<joint name=\"last\" type=\"revolute\"><parent link=\"l%d\"/><child link=\"end\"/>"
            "<axis xyz=\"0 1 0\"/><limit lower=\"-100\" upper=\"100\" effort=\"20\" "
            "velocity=\"3\"/></joint></robot>\n",
            links - 1);
    assert_int_equal(fclose(out), 0);
}

/* ---- the file as MuJoCo shall read it ---- */

static void read_triple(const xmlNode *node, const char *name, double value[3])
{
    xmlChar *text = node ? xmlGetProp(node, (const xmlChar *)name) : NULL;

    value[0] = value[1] = value[2] = 0.0;
    if (text) {
        assert_int_equal(sscanf((const char *)text, "%lf %lf %lf", value, value + 1, value + 2), 3);
    }
    xmlFree(text);
}

static xmlNode *find_child(const xmlNode *node, const char *name)
{
    xmlNode *child = node->children;

    while (child && strcmp((const char *)child->name, name) != 0) {
        child = child->next;
    }
    return child;
}

static void set_real(xmlNode *node, const char *name, double value)
{
    char text[64];

    snprintf(text, sizeof text, "%.17g", value);
    xmlSetProp(node, (const xmlChar *)name, (const xmlChar *)text);
}

/* A <- G^T A G and V <- V G with G in the plane of a and b, so that A[a][b] becomes 0. */
static void rotate_plane(double A[3][3], double V[9], int a, int b)
{
    double apart = A[a][a] - A[b][b];
    double angle = 0.5 * atan2(copysign(2.0, apart) * A[a][b], fabs(apart));
    double c = cos(angle), s = sin(angle);

    for (int k = 0; k < 3; k++) {
        double x = A[k][a], y = A[k][b], u = V[3 * k + a], v = V[3 * k + b];

        A[k][a] = c * x + s * y;
        A[k][b] = c * y - s * x;
        V[3 * k + a] = c * u + s * v;
        V[3 * k + b] = c * v - s * u;
    }
    for (int k = 0; k < 3; k++) {
        double x = A[a][k], y = A[b][k];

        A[a][k] = c * x + s * y;
        A[b][k] = c * y - s * x;
    }
}

/* Moments of the links, which MuJoCo gets after it has read the file. */
static struct {
    char link[128];
    double moment[3];
} noted[512];
static size_t nnoted;

/* Turns A onto its principal axes, the columns of V. */
static void find_principal_axes(double A[3][3], double V[9])
{
    mat3_identity(V);
    for (int sweep = 0; sweep < 12; sweep++) {
        rotate_plane(A, V, 0, 1);
        rotate_plane(A, V, 1, 2);
        rotate_plane(A, V, 2, 0);
    }
}

static void note_moments(const xmlNode *inertial, double A[3][3])
{
    xmlChar *name = xmlGetProp(inertial->parent, (const xmlChar *)"name");

    assert_true(nnoted < sizeof noted / sizeof *noted);
    snprintf(noted[nnoted].link, sizeof noted->link, "%s", (const char *)name);
    for (int a = 0; a < 3; a++) {
        noted[nnoted].moment[a] = A[a][a];
    }
    nnoted++;
    xmlFree(name);
}

static void give_moments(mjModel *m)
{
    for (size_t i = 0; i < nnoted; i++) {
        int id = mj_name2id(m, mjOBJ_BODY, noted[i].link);

        /* What has no mass has no inertia */
        for (int a = 0; id > 0 && a < 3; a++) {
            m->body_inertia[3 * id + a] = m->body_mass[id] > 0 ? noted[i].moment[a] : 0.0;
        }
    }
}

/* MuJoCo finds the principal axes of a full tensor to some 1e-6 only (it stops at an angle whose
 * cosine is 1 within 1e-12), and refuses moments that no body has, to the last bit. So the file
 * gets spheres in the frames of the principal axes, and the model their moments. */
static void diagonalize_inertial(xmlNode *inertial)
{
    static const char *const element[3][3] = {
        {"ixx", "ixy", "ixz"}, {"ixy", "iyy", "iyz"}, {"ixz", "iyz", "izz"}};
    xmlNode *tensor = find_child(inertial, "inertia"), *origin = find_child(inertial, "origin");
    double A[3][3], V[9], R[9], turned[9], rpy[3];
    char text[128];

    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++) {
            xmlChar *value = xmlGetProp(tensor, (const xmlChar *)element[a][b]);

            A[a][b] = value ? strtod((const char *)value, NULL) : 0.0;
            xmlFree(value);
        }
    }
    find_principal_axes(A, V);
    note_moments(inertial, A);
    for (int a = 0; a < 3; a++) {
        for (int b = a; b < 3; b++) {
            set_real(tensor, element[a][b], a == b ? 1.0 : 0.0);
        }
    }
    read_triple(origin, "rpy", rpy);
    mat3_from_rpy(rpy, R);
    mat3_mul(R, V, turned);
    import_rpy(turned, rpy);
    origin = origin ? origin : xmlNewChild(inertial, NULL, (const xmlChar *)"origin", NULL);
    snprintf(text, sizeof text, "%.17g %.17g %.17g", rpy[0], rpy[1], rpy[2]);
    xmlSetProp(origin, (const xmlChar *)"rpy", (const xmlChar *)text);
}

/* Shapes need files that MuJoCo cannot read or does not find. */
static void prepare_node(xmlNode *node)
{
    static const char *const dropped[] = {"visual", "collision", "gazebo", "transmission",
                                          "mujoco"};

    for (xmlNode *next, *child = node->children; child; child = next) {
        bool drop = false;

        next = child->next;
        for (size_t i = 0; i < sizeof dropped / sizeof *dropped; i++) {
            drop |= !strcmp((const char *)child->name, dropped[i]);
        }
        if (drop) {
            xmlUnlinkNode(child);
            xmlFreeNode(child);
        } else if (!strcmp((const char *)child->name, "inertial")) {
            diagonalize_inertial(child);
        } else {
            prepare_node(child);
        }
    }
}

/* Writes the file so that MuJoCo keeps every link as a body, which leaves sums to us. */
static void prepare_file(const char *path, const char *prepared)
{
    xmlDoc *document = xmlReadFile(path, NULL, XML_PARSE_NONET);
    xmlNode *root, *compiler;

    assert_non_null(document);
    root = xmlDocGetRootElement(document);
    prepare_node(root);
    compiler = xmlNewChild(xmlNewChild(root, NULL, (const xmlChar *)"mujoco", NULL), NULL,
                           (const xmlChar *)"compiler", NULL);
    xmlSetProp(compiler, (const xmlChar *)"fusestatic", (const xmlChar *)"false");
    xmlSaveFile(prepared, document);
    xmlFreeDoc(document);
}

/* ---- the comparison ---- */

struct differences {
    double mass, com, inertia, acceleration;
    int bodies, joints;
};

static double difference(double a, double b, double scale)
{
    return fabs(a - b) / fmax(scale, 1.0);
}

/* Mass, first moments and inertia about the origin of a frame. */
struct moments {
    double mass, first[3], I[6];
};

/* Adds what a body of MuJoCo weighs with all that is fixed to it, placed so in a frame. */
static void sum_fixed(const mjModel *m, int id, const double xyz[3], const double rotation[9],
                      struct moments *sum)
{
    const double *moment = m->body_inertia + 3 * id, mass = m->body_mass[id];
    double I[6] = {moment[0], 0, 0, moment[1], 0, moment[2]}, R[9], at[3], square;

    mat3_from_quaternion(m->body_iquat + 4 * id, R);
    sym3_rotate(R, I);
    sym3_rotate(rotation, I);
    mat3_apply(rotation, m->body_ipos + 3 * id, at);
    vec3_add_scaled(at, 1.0, xyz, at);
    square = vec3_dot(at, at);
    sum->mass += mass;
    for (int a = 0; a < 3; a++) {
        sum->first[a] += mass * at[a];
        for (int b = a; b < 3; b++) {
            int k = sym3_index[a][b];

            sum->I[k] += I[k] + mass * ((a == b ? square : 0.0) - at[a] * at[b]);
        }
    }
    for (int child = id + 1; child < m->nbody; child++) {
        double place[3], turned[9];

        if (m->body_parentid[child] == id && m->body_jntnum[child] == 0) {
            mat3_apply(rotation, m->body_pos + 3 * child, place);
            vec3_add_scaled(place, 1.0, xyz, place);
            mat3_from_quaternion(m->body_quat + 4 * child, R);
            mat3_mul(rotation, R, turned);
            sum_fixed(m, child, place, turned, sum);
        }
    }
}

static void compare_body(const mjModel *m, int id, const struct robot_body *body,
                         struct differences *d)
{
    static const double here[3], upright[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    const struct robot_inertia *own = &body->inertia;
    double square = vec3_dot(own->com, own->com);
    struct moments sum = {0};

    sum_fixed(m, id, here, upright, &sum);
    d->bodies++;
    if (sum.mass == 0.0) {
        return;
    }
    d->mass = fmax(d->mass, fabs(sum.mass - own->mass) / sum.mass);
    for (int a = 0; a < 3; a++) {
        d->com = fmax(d->com, fabs(sum.first[a] / sum.mass - own->com[a]));
        for (int b = a; b < 3; b++) {
            int k = sym3_index[a][b];
            double I =
                own->I[k] + own->mass * ((a == b ? square : 0.0) - own->com[a] * own->com[b]);

            d->inertia = fmax(d->inertia, fabs(I - sum.I[k]) / (sum.I[0] + sum.I[3] + sum.I[5]));
        }
    }
}

/* Masses, centers and inertias of the robot for MuJoCo, those of what is fixed to a link with it:
 * then accelerations differ by arithmetic alone, whatever import has repaired. */
static void give_inertias(mjModel *m, mjData *data, const struct robot *robot)
{
    for (int id = 1; id < m->nbody; id++) {
        m->body_mass[id] = 0.0;
        memset(m->body_inertia + 3 * id, 0, 3 * sizeof *m->body_inertia);
    }
    for (size_t b = 0; b < robot->nbody; b++) {
        const struct robot_inertia *own = &robot->body[b].inertia;
        int id = mj_name2id(m, mjOBJ_BODY, robot->body[b].name);
        double A[3][3], V[9];

        if (id <= 0 || (b == 0 && !robot->floating)) {
            continue;
        }
        for (int i = 0; i < 9; i++) {
            A[i / 3][i % 3] = own->I[sym3_index[i / 3][i % 3]];
        }
        find_principal_axes(A, V);
        m->body_mass[id] = own->mass;
        memcpy(m->body_ipos + 3 * id, own->com, 3 * sizeof *own->com);
        mju_mat2Quat(m->body_iquat + 4 * id, V);
        for (int a = 0; a < 3; a++) {
            m->body_inertia[3 * id + a] = A[a][a];
        }
    }
    mj_setConst(m, data);
}

/* One state: random positions, rates and torques into both, accelerations out of both. */
static void compare_state(const mjModel *m, mjData *data, const struct dynamics *dynamics,
                          struct differences *d)
{
    const struct robot *robot = dynamics->robot;
    double *q = calloc(robot->nq, sizeof *q), *v = calloc(robot->nv, sizeof *v);
    double *tau = calloc(robot->njoint + 1, sizeof *tau), *vdot = calloc(robot->nv, sizeof *vdot);
    double R[9] = {0}, largest = 1.0, a[3] = {0}, spin[3];
    size_t q0 = robot->nq - robot->njoint, v0 = robot->nv - robot->njoint;

    mj_resetData(m, data);
    if (robot->floating) {
        for (int i = 0; i < 7; i++) {
            data->qpos[i] = q[i] = draw(-1, 1);
        }
        mju_normalize4(q + 3);
        memcpy(data->qpos, q, 7 * sizeof *q);
        mat3_from_quaternion(q + 3, R);
        for (int i = 0; i < 6; i++) {
            v[i] = draw(-1, 1);
        }
        mat3_apply(R, v, data->qvel);
        memcpy(data->qvel + 3, v + 3, 3 * sizeof *v);
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        int id = mj_name2id(m, mjOBJ_JOINT, robot->joint[j].name);

        assert_true(id >= 0);
        q[q0 + j] = draw(-2, 2);
        data->qpos[m->jnt_qposadr[id]] = q[q0 + j] + m->qpos0[m->jnt_qposadr[id]];
        data->qvel[m->jnt_dofadr[id]] = v[v0 + j] = draw(-2, 2);
        data->qfrc_applied[m->jnt_dofadr[id]] = tau[j] = draw(-5, 5);
    }
    mj_forward(m, data);
    dynamics->ops->forward(dynamics, q, v, tau, NULL, vdot);

    /* MuJoCo's base accelerates in the world, ours is the derivative in the moving frame */
    if (robot->floating) {
        mat3_apply_transposed(R, data->qacc, a);
        vec3_cross(v + 3, v, spin);
        vec3_sub(a, spin, a);
        for (int i = 0; i < 3; i++) {
            largest = fmax(largest, fmax(fabs(a[i]), fabs(data->qacc[3 + i])));
        }
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        int at = m->jnt_dofadr[mj_name2id(m, mjOBJ_JOINT, robot->joint[j].name)];

        largest = fmax(largest, fabs(data->qacc[at]));
    }
    for (int i = 0; i < 3 && robot->floating; i++) {
        d->acceleration = fmax(d->acceleration, difference(vdot[i], a[i], largest));
        d->acceleration =
            fmax(d->acceleration, difference(vdot[3 + i], data->qacc[3 + i], largest));
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        int at = m->jnt_dofadr[mj_name2id(m, mjOBJ_JOINT, robot->joint[j].name)];

        d->acceleration = fmax(d->acceleration, difference(vdot[v0 + j], data->qacc[at], largest));
    }
    free(q);
    free(v);
    free(tau);
    free(vdot);
}

/* Everything of the robot that MuJoCo has too, which has read path. */
static struct differences compare_files(const char *path, const struct robot *robot, int states,
                                        bool own_inertias)
{
    const char prepared[] = "/tmp/hil-import-mujoco.urdf";
    char why[512] = "";
    struct differences d = {0};
    struct dynamics dynamics;
    mjData *data;
    mjModel *m;

    nnoted = 0;
    if (strstr(path, ".urdf")) {
        prepare_file(path, prepared);
        path = prepared;
    }
    m = mj_loadXML(path, NULL, why, sizeof why);
    unlink(prepared);

    if (!m) {
        fail_msg("MuJoCo: %s", why);
    }
    give_moments(m);
    memset(m->dof_damping, 0, (size_t)m->nv * sizeof *m->dof_damping);
    memset(m->dof_frictionloss, 0, (size_t)m->nv * sizeof *m->dof_frictionloss);
    memset(m->dof_armature, 0, (size_t)m->nv * sizeof *m->dof_armature);
    memset(m->jnt_stiffness, 0, (size_t)m->njnt * sizeof *m->jnt_stiffness);
    m->opt.disableflags |= mjDSBL_CONSTRAINT | mjDSBL_CONTACT | mjDSBL_ACTUATION;
    for (size_t b = robot->floating ? 0 : 1; b < robot->nbody; b++) {
        int id = mj_name2id(m, mjOBJ_BODY, robot->body[b].name);

        /* Frames of ours sit on the joints, and a body with two has one of ours for each */
        if (id >= 0 && m->body_jntnum[id] == 1 &&
            vec3_norm(m->jnt_pos + 3 * m->body_jntadr[id]) == 0.0) {
            compare_body(m, id, &robot->body[b], &d);
        }
    }
    data = mj_makeData(m);
    assert_non_null(data);
    if (own_inertias) {
        give_inertias(m, data, robot);
    }
    assert_ok(dynamics_generic(robot, &arena, &dynamics, NULL));
    d.joints = m->njnt;
    for (int i = 0; i < states; i++) {
        compare_state(m, data, &dynamics, &d);
    }
    mj_deleteData(data);
    mj_deleteModel(m);
    return d;
}

/* ---- tests ---- */

static char folder[64];

FIXTURE(open_folder)
{
    strcpy(folder, "/tmp/hil-import-mujoco-XXXXXX");
    return arena_init(&arena, (size_t)1 << 30, NULL) == ERROR_NONE && mkdtemp(folder) ? 0 : -1;
}

FIXTURE(close_folder)
{
    char command[96];

    arena_fini(&arena);
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    return system(command);
}

static const char *path_of(const char *name)
{
    static char path[160];

    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static void write_text(const char *name, const char *text)
{
    FILE *out = fopen(path_of(name), "w");

    assert_non_null(out);
    fputs(text, out);
    assert_int_equal(fclose(out), 0);
}

/* Returns what becomes of a file of the folder. */
static struct robot *import_file(const char *name, struct import_options options,
                                 const char *protocol)
{
    const struct import_request request = {.file = path_of(name),
                                           .folder = folder,
                                           .options = options,
                                           .protocol = protocol,
                                           .force = true};
    struct import_result result;
    struct robot *robot;
    struct error error;

    if (import_run(&request, &arena, &result, &error) ||
        robot_copy(result.loaded, &arena, &robot, &error)) {
        fail_msg("%s: %s", name, error.text);
    }
    return robot;
}

TEST_WITH(random_trees_are_those_of_mujoco, open_folder, close_folder)
{
    struct differences worst = {0};

    for (int tree = 0; tree < TREES; tree++) {
        bool floats = tree % 2;
        const struct robot *robot;
        struct differences d;

        dice = random_named(1000 + (uint64_t)tree, "tree");
        put_robot(path_of("tree.urdf"), 3 + tree % (LINKS_MOST - 3), floats);
        robot = import_file(
            "tree.urdf",
            (struct import_options){.base = floats ? IMPORT_BASE_FLOATING : IMPORT_BASE_FIXED,
                                    .free_slides = true},
            "compact-fd");
        assert_true(robot->floating == floats);
        d = compare_files(path_of("tree.urdf"), robot, STATES, false);
        worst.mass = fmax(worst.mass, d.mass);
        worst.com = fmax(worst.com, d.com);
        worst.inertia = fmax(worst.inertia, d.inertia);
        worst.acceleration = fmax(worst.acceleration, d.acceleration);
    }
    print_message("# masses %.1e, centers %.1e m, inertias %.1e, accelerations %.1e\n", worst.mass,
                  worst.com, worst.inertia, worst.acceleration);
    assert_true(worst.mass <= 1e-12);
    assert_true(worst.com <= 1e-12);
    assert_true(worst.inertia <= 1e-12);
    assert_true(worst.acceleration <= 1e-10);
}

/* Default classes, two joints to a body, anchors, angles in degrees that count from elsewhere, all
 * ways to turn a body, inertias of geoms. */
static const char toy[] =
    "<mujoco model='toy'>\n<compiler angle='degree' autolimits='true' eulerseq='zyx'/>\n"
    "<option><flag constraint='disable' contact='disable'/></option>\n"
    "<default><joint damping='0.5'/><default class='leg'>"
    "<joint armature='0.02' range='-90 60' limited='true'/>"
    "<geom type='capsule' size='0.03' density='500'/>"
    "<default class='shin'><joint axis='0 1 0' range='-120 -10'/></default></default></default>\n"
    "<worldbody><geom type='plane' size='1 1 1'/>\n"
    "<body name='torso' pos='0 0 1' euler='10 20 30'><freejoint/>\n"
    "<geom type='box' size='0.2 0.15 0.1' mass='5' pos='0.01 0.02 0' quat='1 0.1 0.2 0.3'/>\n"
    "<site name='imu' pos='0.1 0 0'/>\n"
    "<body name='thigh' pos='0.1 0.1 -0.1' xyaxes='1 0.2 0 0 1 0.3' childclass='leg'>\n"
    "<joint name='roll' axis='1 0 0' pos='0 0 0.05'/><joint name='pitch' axis='0 2 0' pos='0 0.02 "
    "0.05'/>\n<geom fromto='0 0 0 0.05 0 -0.4'/>\n"
    "<body name='shin' pos='0.05 0 -0.4' axisangle='0 0 1 15'><joint name='knee' class='shin' "
    "ref='-45'/>\n<inertial pos='0.01 0.02 -0.2' quat='1 0.2 0.3 0.1' mass='1.5' "
    "diaginertia='0.02 0.021 0.004'/><geom type='cylinder' size='0.04 0.2' pos='0 0 -0.2'/>\n"
    "<body name='toe' pos='0.1 0 -0.4' euler='0 90 0'><geom type='cylinder' size='0.03 0.05'/>"
    "</body></body></body>\n"
    "<body name='arm' pos='0 -0.2 0.1'><joint name='slide' type='slide' axis='0 0 1' range='-0.1 "
    "0.2' limited='true'/><geom type='sphere' size='0.05'/></body></body></worldbody>\n"
    "<sensor><gyro site='imu'/></sensor>\n"
    "<actuator><motor joint='roll' gear='10' ctrlrange='-4 4'/><position joint='knee' "
    "forcerange='-30 30'/></actuator>\n"
    "<keyframe><key name='stand' qpos='0 0 1 1 0 0 0 0.1 0.2 -1 0.05'/></keyframe></mujoco>\n";

TEST_WITH(bodies_of_mjcf_are_those_of_mujoco, open_folder, close_folder)
{
    const struct robot *robot;
    struct differences d;

    write_text("toy.xml", toy);
    robot = import_file("toy.xml", (struct import_options){.free_slides = true}, "icub");
    assert_true(robot->floating);
    assert_int_equal(robot->njoint, 4);
    assert_true(robot->imu_frame >= 0);
    dice = random_named(1, "toy");
    d = compare_files(path_of("toy.xml"), robot, 50, false);
    print_message("# MJCF: %d bodies, masses %.1e, centers %.1e m, inertias %.1e, accelerations "
                  "%.1e\n",
                  d.bodies, d.mass, d.com, d.inertia, d.acceleration);
    assert_true(d.bodies == 3);
    assert_true(d.mass <= 1e-12 && d.com <= 1e-12 && d.inertia <= 1e-12);
    assert_true(d.acceleration <= 1e-10);

    /* Numbers of the drives, limits and the pose, by hand */
    assert_true(fabs(robot->joint[0].sea.J - 0.02) <= 1e-9);
    assert_true(fabs(robot->joint[0].torque_limit - 40.0) <= 1e-9);
    assert_true(fabs(robot->joint[2].torque_limit - 30.0) <= 1e-9);
    assert_true(fabs(robot->joint[2].lower - (45.0 - 120.0) * M_PI / 180.0) <= 1e-12);
    assert_int_equal(robot_find_pose(robot, "stand"), 1);
    assert_true(fabs(robot->pose[1].joint[2] - (-1.0 + M_PI / 4.0)) <= 1e-12);
}

/* ---- couplings ---- */

/* A finger whose tip follows its root, and a slide that does; to MuJoCo they are tendons, whose
 * springs it has, as equalities it would make them as stiff as its solver likes. */
static const char hand[] =
    "<mujoco model='hand'><compiler angle='radian'/>\n<option integrator='RK4' timestep='4e-6'>"
    "<flag constraint='disable' contact='disable'/></option>\n<worldbody>\n"
    "<body name='palm' pos='0 0 1'><inertial pos='0.02 0.01 0.1' mass='0.9' "
    "diaginertia='0.004 0.005 0.003'/><joint name='wrist' axis='0 1 0.2'/>\n"
    "<body name='root' pos='0 0.05 0.1'><inertial pos='0 0.01 0.08' mass='0.3' "
    "diaginertia='6e-4 5e-4 2e-4'/><joint name='root' axis='1 0 0'/>\n"
    "<body name='tip' pos='0 0 0.15'><inertial pos='0.01 0 0.04' mass='0.2' "
    "diaginertia='2e-4 2e-4 5e-5'/><joint name='tip' axis='1 0.1 0'/></body></body>\n"
    "<body name='slide' pos='0 -0.05 0.1'><inertial pos='0 0 0.05' mass='0.25' "
    "diaginertia='3e-4 2e-4 2e-4'/><joint name='slide' type='slide' axis='0 1 0' "
    "range='-1 1' limited='true'/></body>\n"
    "</body></worldbody>\n<tendon><fixed name='tip' springlength='0.1'><joint joint='tip' "
    "coef='1'/><joint joint='root' coef='-0.7'/></fixed>\n<fixed name='slide' "
    "springlength='0.02'><joint joint='slide' coef='1'/><joint joint='root' coef='-0.05'/></fixed>"
    "</tendon>\n<equality><joint joint1='tip' joint2='root' polycoef='0.1 0.7 0 0 0'/>"
    "<joint joint1='slide' joint2='root' polycoef='0.02 0.05 0 0 0'/></equality></mujoco>\n";

enum { HAND_JOINTS = 4, HAND_MS = 300 };

/* Where MuJoCo's joints of those names are after so long, its tendons those couplings. */
static void mujoco_move_hand(const char *path, const struct robot *robot, const double *q,
                             const double *v, double *end)
{
    char why[512] = "";
    mjModel *m = mj_loadXML(path, NULL, why, sizeof why);
    mjData *data;

    if (!m) {
        fail_msg("MuJoCo: %s", why);
    }
    data = mj_makeData(m);
    for (size_t i = 0; i < robot->ncoupling; i++) {
        int id = mj_name2id(m, mjOBJ_TENDON, robot->joint[robot->coupling[i].follower].name);

        assert_true(id >= 0);
        m->tendon_stiffness[id] = robot->coupling[i].stiffness;
        m->tendon_damping[id] = robot->coupling[i].damping;
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        int id = mj_name2id(m, mjOBJ_JOINT, robot->joint[j].name);

        data->qpos[m->jnt_qposadr[id]] = q[j];
        data->qvel[m->jnt_dofadr[id]] = v[j];
    }
    for (int k = 0; k < HAND_MS * 250; k++) {
        mj_step(m, data);
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        end[j] = data->qpos[m->jnt_qposadr[mj_name2id(m, mjOBJ_JOINT, robot->joint[j].name)]];
    }
    mj_deleteData(data);
    mj_deleteModel(m);
}

/* The same of our plant. */
static void plant_move_hand(const struct robot *robot, enum plant_integrator integrator,
                            const double *q, const double *v, double *end)
{
    struct plant_config config = {.robot = robot,
                                  .integrator = integrator,
                                  .rtol = 1e-10,
                                  .atol = 1e-12,
                                  .substep_ns = 1000000,
                                  .supply_v = 1.0};
    struct dynamics dynamics;
    struct plant *plant;
    struct error error;
    double *state;
    size_t count;

    config.dynamics = &dynamics;
    assert_ok(dynamics_generic(robot, &arena, &dynamics, &error));
    assert_ok(plant_create(&config, &arena, &plant, &error));
    assert_ok(plant_reset(plant, NULL, NULL, q));
    state = plant_state(plant, &count);
    memcpy(state + robot->nq, v, robot->nv * sizeof *v);
    assert_ok(plant_step(plant, HAND_MS));
    memcpy(end, state, robot->njoint * sizeof *end);
}

/* Without its drives and stops the robot moves as MuJoCo's joints do, whose first one counts from
 * an angle. */
static void compare_motion(const char *name, struct robot *robot, const double *q, const double *v,
                           double from, double exactly, double implicitly)
{
    double start[HAND_JOINTS], exact[HAND_JOINTS], end[HAND_JOINTS];

    for (size_t j = 0; j < robot->njoint; j++) {
        robot->joint[j].sea.present = false;
        robot->joint[j].stop = (struct robot_stop){0};
        start[j] = q[j] + (j == 0 ? from : 0.0);
    }
    mujoco_move_hand(path_of(name), robot, start, v, exact);
    exact[0] -= from;
    for (int i = 0; i < 2; i++) {
        double worst = 0.0;

        plant_move_hand(robot, i ? PLANT_IMPLICIT : PLANT_DOPRI5, q, v, end);
        for (size_t j = 0; j < robot->njoint; j++) {
            worst = fmax(worst, fabs(end[j] - exact[j]));
        }
        print_message("# %s: %.1e rad or m from MuJoCo after %d ms\n", name, worst, HAND_MS);
        assert_true(worst <= (i ? implicitly : exactly));
    }
}

/* From a state in which nothing follows quite. */
TEST_WITH(couplings_move_joints_as_tendons_of_mujoco_do, open_folder, close_folder)
{
    const double q[HAND_JOINTS] = {0.3, 0.4, 0.3802, 0.0401};
    const double v[HAND_JOINTS] = {1.0, -2.0, -1.41, -0.1};
    struct robot *robot;

    write_text("hand.xml", hand);
    robot = import_file("hand.xml", (struct import_options){.mimic = IMPORT_MIMIC_COUPLE}, "icub");
    assert_int_equal(robot->njoint, HAND_JOINTS);
    assert_int_equal(robot->ncoupling, 2);
    compare_motion("hand.xml", robot, q, v, 0.0, 1e-10, 5e-5);
}

/* ---- springs ---- */

/* A leg whose joints spring back, as two without an actuator and one with; angles in degrees, of
 * which one counts from elsewhere. The last has no damping, which would be its motor's. */
static const char spring_leg[] =
    "<mujoco model='leg'>\n<option integrator='RK4' timestep='4e-6'>"
    "<flag constraint='disable' contact='disable'/></option>\n<worldbody>\n"
    "<body name='thigh' pos='0 0 1'><inertial pos='0.02 0.01 -0.1' mass='0.9' "
    "diaginertia='0.004 0.005 0.003'/><joint name='hip' axis='0 1 0.2' stiffness='20' ref='10' "
    "springref='35' damping='0.3'/>\n"
    "<body name='shin' pos='0 0.05 -0.2'><inertial pos='0 0.01 -0.08' mass='0.3' "
    "diaginertia='6e-4 5e-4 2e-4'/><joint name='knee' axis='0 1 0' stiffness='4' damping='0.05'/>\n"
    "<body name='toe' pos='0 0 -0.15'><inertial pos='0.04 0 0' mass='0.2' "
    "diaginertia='2e-4 2e-4 5e-5'/><joint name='toe' axis='0.1 1 0' stiffness='1.5' "
    "springref='-20'/></body></body></body></worldbody>\n"
    "<actuator><motor joint='toe'/></actuator></mujoco>\n";

enum { LEG_JOINTS = 3 };

TEST_WITH(springs_move_joints_as_those_of_mujoco, open_folder, close_folder)
{
    const double q[LEG_JOINTS] = {0.3, -0.4, 0.5}, v[LEG_JOINTS] = {1.0, -2.0, 3.0};
    struct robot *robot;

    write_text("leg.xml", spring_leg);
    robot = import_file("leg.xml", (struct import_options){0}, "icub");
    assert_int_equal(robot->njoint, LEG_JOINTS);
    for (size_t j = 0; j < robot->njoint; j++) {
        assert_int_equal(robot->joint[j].sea.present, j == 2);
    }
    compare_motion("leg.xml", robot, q, v, 10.0 * M_PI / 180.0, 1e-9, 1e-3);
}

/* ---- included files ---- */

/* A robot in four files, all of whose bodies weigh what their geoms do: every solid, many to a
 * body, by density and by mass, some in a group that does not count; a convex mesh and one with a
 * notch. */
static const char suite_main[] =
    "<mujoco model='suite'>\n<include file='common.xml'/>\n<worldbody>\n"
    "<body name='torso' pos='0 0 1'><freejoint/>\n"
    "<inertial pos='9 9 9' mass='99' diaginertia='99 99 99'/>\n"
    "<geom type='ellipsoid' size='0.2 0.15 0.1' euler='10 20 30'/>\n"
    "<geom type='box' size='0.1 0.2 0.05' pos='0.1 0 0.2' density='700'/>\n"
    "<geom type='sphere' size='0.3' group='4'/>\n"
    "<include file='parts/leg.xml'/></body></worldbody>\n"
    "<worldbody><geom type='plane' size='1 1 1'/></worldbody></mujoco>\n";
static const char suite_common[] =
    "<mujocoinclude><compiler inertiafromgeom='true' inertiagrouprange='0 3' meshdir='stl' %s/>\n"
    "<option><flag constraint='disable' contact='disable'/></option>\n"
    "<default><geom density='800'/><default class='heavy'><geom mass='2.5'/></default></default>\n"
    "<default><joint axis='0 1 0'/></default>\n"
    "<asset><mesh file='convex.obj' scale='1 2 0.5'/></asset>\n"
    "<asset><mesh name='notched' file='notched.obj'/></asset></mujocoinclude>\n";
static const char suite_leg[] =
    "<mujoco><body name='thigh' pos='0.1 0.1 -0.1'><joint name='hip'/>\n"
    "<geom type='capsule' fromto='0 0 0 0.05 0.1 -0.4' size='0.03'/>\n"
    "<geom type='mesh' mesh='convex' pos='0.1 0.2 0.3' quat='1 0.2 0.1 0.3' %s/>\n"
    "<include file='parts/shin.xml'/></body></mujoco>\n";
static const char suite_shin[] =
    "<mujoco><body name='shin' pos='0.05 0 -0.4'><joint name='knee' axis='1 0 0.3'/>\n"
    "<geom type='cylinder' size='0.04 0.2' class='heavy' pos='0 0 -0.2'/>\n"
    "<geom type='mesh' mesh='notched' euler='0 40 0' mass='1.2'/></body></mujoco>\n";
static const char convex[] = "v 0.3 0 0\nv 0 0.2 0\nv 0 0 0.25\nv -0.1 -0.1 -0.1\n"
                             "f 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n";

/* An L of three cubes of 0.1 m, drawn out by 0.1 m. */
static const char notched[] =
    "v 0 0 0\nv 0.2 0 0\nv 0.2 0.1 0\nv 0.1 0.1 0\nv 0.1 0.2 0\nv 0 0.2 0\n"
    "v 0 0 0.1\nv 0.2 0 0.1\nv 0.2 0.1 0.1\nv 0.1 0.1 0.1\nv 0.1 0.2 0.1\nv 0 0.2 0.1\n"
    "f 1 4 2\nf 2 4 3\nf 1 6 4\nf 4 6 5\nf 7 8 10\nf 8 9 10\nf 7 10 12\nf 10 11 12\n"
    "f 1 2 8\nf 1 8 7\nf 2 3 9\nf 2 9 8\nf 3 4 10\nf 3 10 9\nf 4 5 11\nf 4 11 10\n"
    "f 5 6 12\nf 5 12 11\nf 6 1 7\nf 6 7 12\n";

/* MuJoCo keeps corners of meshes in single precision, and finds principal axes to 1e-6. Without
 * exactmeshinertia version 2.2 multiplies the density not with the volume of a mesh but with that
 * of the box of the same inertia (a tetrahedron weighs 1.4 times what it does), which is not
 * followed: meshes are given their masses then. */
TEST_WITH(included_files_and_inertias_of_geoms_are_those_of_mujoco, open_folder, close_folder)
{
    static const char *const how[] = {"", "exactmeshinertia='true'"};
    static const char *const mass[] = {"mass='3'", ""};
    const struct robot *robot = NULL;
    char text[1024];
    struct differences d;

    assert_int_equal(mkdir(path_of("parts"), 0700), 0);
    assert_int_equal(mkdir(path_of("stl"), 0700), 0);
    write_text("suite.xml", suite_main);
    write_text("parts/shin.xml", suite_shin);
    write_text("stl/convex.obj", convex);
    write_text("stl/notched.obj", notched);
    for (int exact = 0; exact < 2; exact++) {
        snprintf(text, sizeof text, suite_common, how[exact]);
        write_text("common.xml", text);
        snprintf(text, sizeof text, suite_leg, mass[exact]);
        write_text("parts/leg.xml", text);
        robot = import_file("suite.xml", (struct import_options){0}, "icub");
        dice = random_named(1, "suite");
        d = compare_files(path_of("suite.xml"), robot, 50, false);
        print_message("# geoms%s: %d bodies, masses %.1e, centers %.1e m, inertias %.1e, "
                      "accelerations %.1e\n",
                      exact ? ", exact" : "", d.bodies, d.mass, d.com, d.inertia, d.acceleration);
        assert_int_equal(d.bodies, 3);
        assert_true(d.mass <= 1e-6 && d.com <= 1e-6 && d.inertia <= 1e-6);
        assert_true(d.acceleration <= 1e-5);
    }

    /* By hand: the L has 3e-3 m3, and what the torso weighs is its ellipsoid and its box */
    assert_true(fabs(robot->body[0].inertia.mass -
                     (800.0 * 4.0 / 3.0 * M_PI * 0.2 * 0.15 * 0.1 + 700.0 * 8.0 * 0.001)) <= 1e-9);
}

/* ---- by hand ---- */

static const char *hand_file, *hand_robot;

static void file_is_that_of_mujoco(void **state)
{
    const struct robot *robot;
    struct differences d;
    struct error error;

    (void)state;
    assert_no_error(robot_load(hand_robot, NULL, &arena, &robot, &error), error.text);
    for (int own = 0; own < 2; own++) {
        dice = random_named(1, "hand");
        d = compare_files(hand_file, robot, 100, own);
        print_message("# %d bodies, %d joints: masses %.1e, centers %.1e m, inertias %.1e, "
                      "accelerations %.1e%s\n",
                      d.bodies, d.joints, d.mass, d.com, d.inertia, d.acceleration,
                      own ? " with the robot's inertias in both" : "");
    }
}

/* A comparison by hand: HIL_MUJOCO_FILE=FILE HIL_MUJOCO_ROBOT=ROBOT test_import_mujoco file_* */
static void __attribute__((constructor)) register_by_hand(void)
{
    hand_file = getenv("HIL_MUJOCO_FILE");
    hand_robot = getenv("HIL_MUJOCO_ROBOT");
    if (hand_file && hand_robot) {
        test_register(__LINE__, (struct CMUnitTest)cmocka_unit_test_setup_teardown(
                                    file_is_that_of_mujoco, open_folder, close_folder));
    }
}
