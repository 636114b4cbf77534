/* SPDX-License-Identifier: Apache-2.0 */
/* Makes the robot's bodies and joints. The steps before are in tree_simplify_order.c and
 * tree_simplify_mimic.c, the steps after in tree_simplify_frames.c. */
#include "app/import/tree_simplify_private.h"

#include "base/array.h"
#include "base/portable_math.h"
#include "base/text.h"
#include "base/vec3.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

/* Mass of a body without mass in the file, because robot files require more than 0. */
#define NO_MASS_KG 1e-15

enum { NAME_TRIES = 64 };

/* Bounds for poses and inertias in a robot file, see coman-hil-robot(5). */
#define PLACE_MAX_M 1e3
#define INERTIA_MAX_KG_M2 1e6

void *simplify_alloc(const struct simplifier *r, size_t count, size_t size)
{
    void *memory = arena_alloc(r->arena, count, size);

    if (!memory) {
        error_set(r->error, ERROR_MEMORY, "%.200s: no memory left for this robot", r->model->file);
    }
    return memory;
}

/* Checks whether a part of the file has this name, or a part of this kind has received it. */
static bool simplify_name_is_taken(const struct simplifier *r, const char *what, const char *name)
{
    bool taken = import_find_link(r->model, name) >= 0 || import_find_joint(r->model, name) >= 0;

    for (size_t i = 0; i < r->nmade && !taken; i++) {
        taken = !strcmp(r->made[i].what, what) && !strcmp(r->made[i].name, name);
    }
    return taken;
}

const char *simplify_name(struct simplifier *r, const char *file, int line, const char *what,
                          const char *name)
{
    char clean[64], made[64];
    struct simplify_made *list;
    size_t length = strlen(name);

    if (text_is_name(name) && strcmp(name, "spare") != 0) {
        char *copy = simplify_alloc(r, length + 1, 1);

        return copy ? strcpy(copy, name) : "";
    }

    /* Refuse a name that is too long or reserved, because replacing characters does not help */
    if (length > 63 || !strcmp(name, "spare") || !strcmp(name, ".") || !strcmp(name, "..")) {
        import_error(r->error, file, line,
                     "found %s name \"%.80s\", expected at most 63 letters, digits and _ - . (and "
                     "not \"spare\")",
                     what, name);
        return "";
    }
    for (size_t i = 0; i <= length; i++) {
        const char letter[2] = {name[i], '\0'};

        clean[i] = name[i] == '\0' || name[i] == '.' || text_is_name(letter) ? name[i] : '_';
    }

    /* Continue with the next number, so that few tries are enough */
    strcpy(made, clean);
    for (int i = 0; i < NAME_TRIES && simplify_name_is_taken(r, what, made); i++) {
        snprintf(made, sizeof made, "%.42s-%zu", clean, r->nmade + 2 + (size_t)i);
    }
    if (simplify_name_is_taken(r, what, made)) {
        import_error(r->error, file, line,
                     "found %s name \"%.63s\", expected letters, digits and _ - . only: too many "
                     "names are like it",
                     what, name);
        return "";
    }
    import_note_add(r->notes, IMPORT_CHANGED, file, line, "%s \"%.63s\" is named \"%.63s\"", what,
                    name, made);
    list = import_grow(r->arena, r->made, r->nmade, &r->made_capacity, sizeof *list);
    name = arena_strdup(r->arena, made);
    if (!list || !name) {
        simplify_alloc(r, SIZE_MAX, 1);
        return "";
    }
    r->made = list;
    r->made[r->nmade++] = (struct simplify_made){what, name};
    return name;
}

/* ---- inertias ---- */

/* Diagonalizes a symmetric tensor by Jacobi rotations: I = V^T diag(moment) V, so that the rows of
 * V are the principal axes. */
static void tensor_diagonalize(const double I[6], double moment[3], double V[9])
{
    double A[6];

    memcpy(A, I, sizeof A);
    mat3_identity(V);
    for (int sweep = 0; sweep < 50; sweep++) {
        for (int p = 0; p < 2; p++) {
            for (int q = p + 1; q < 3; q++) {
                double off = A[sym3_index[p][q]], R[9], T[9];
                double apart = A[sym3_index[q][q]] - A[sym3_index[p][p]];
                double angle = 0.5 * portable_atan2(copysign(2.0, apart) * off, fabs(apart));

                /* Rotate in the plane of p and q until their product is 0. Use the smaller of the
                 * two angles; the larger one swaps the axes and never converges */
                mat3_identity(R);
                R[4 * p] = R[4 * q] = portable_cos(angle);
                R[3 * p + q] = -portable_sin(angle);
                R[3 * q + p] = portable_sin(angle);
                sym3_rotate(R, A);
                mat3_mul(R, V, T);
                memcpy(V, T, sizeof T);
            }
        }
    }
    moment[0] = A[0];
    moment[1] = A[3];
    moment[2] = A[5];
}

/* Checks a body's inertia. With --repair-inertia corrects an impossible inertia, otherwise refuses
 * it. */
static void simplify_check_inertia(struct simplifier *r, const struct import_link *link,
                                   struct robot_inertia *inertia)
{
    const int line = link->inertia_line ? link->inertia_line : link->line;
    double moment[3], V[9], back[9];
    struct error why, again;

    if (!robot_check_inertia(inertia, &why)) {
        return;
    }
    if (!r->options->repair_inertia) {
        import_error(r->error, link->file, line,
                     "found link \"%.63s\" with what is fixed to it: %s; correct the file, or give "
                     "--repair-inertia to raise the moments that are too small",
                     link->name, why.text);
        return;
    }

    /* Raise the principal moments, and rotate the tensor back to the link's frame */
    tensor_diagonalize(inertia->I, moment, V);

    /* Raise principal moments that are too small: to a thousandth of the largest one, then until
     * the two smaller ones sum up to the largest (triangle inequality) */
    int large = 0;
    double missing;

    for (int m = 1; m < 3; m++) {
        large = moment[m] > moment[large] ? m : large;
    }
    for (int m = 0; m < 3; m++) {
        moment[m] = fmax(moment[m], 1e-3 * moment[large]);
    }
    missing = 2.0 * moment[large] - (moment[0] + moment[1] + moment[2]);
    for (int m = 0; m < 3; m++) {
        moment[m] += m != large && missing > 0.0 ? 0.5 * missing : 0.0;
    }

    memset(inertia->I, 0, sizeof inertia->I);
    inertia->I[0] = moment[0];
    inertia->I[3] = moment[1];
    inertia->I[5] = moment[2];
    mat3_transpose(V, back);
    sym3_rotate(back, inertia->I);
    import_note_add(r->notes, IMPORT_CHANGED, link->file, line,
                    "inertia of link \"%.63s\" with what is fixed to it has now the moments %g, "
                    "%g, %g kg m2: %s",
                    link->name, moment[0], moment[1], moment[2], why.text);
    if (robot_check_inertia(inertia, &again)) {
        import_error(r->error, link->file, link->line,
                     "found an inertia of link \"%.63s\" that cannot be repaired", link->name);
    }
}

/* ---- bodies and joints ---- */

/* Adds the body of a link that a joint moves, and the joint. */
static void simplify_add_body(struct simplifier *r, int link, const struct import_joint *from)
{
    struct robot *robot = r->out->robot;
    const struct import_link *source = &r->model->link[link];
    struct robot_joint *joint = &robot->joint[robot->njoint];
    const size_t own = (size_t)(from - r->model->joint);
    double length = vec3_norm(from->axis);
    struct import_place place;

    robot->body[robot->nbody].parent = r->out->body[from->parent_link];
    robot->body[robot->nbody].name =
        simplify_name(r, source->file, source->line, "body", source->name);
    joint->name = simplify_name(r, from->file, from->line, "joint", from->name);
    r->out->body[link] = (int)robot->nbody++;
    import_place_identity(&r->out->place[link]);

    /* Set the joint's pose in the parent's body, and record its rest position */
    r->out->source[robot->njoint] = from;
    r->out->rest[robot->njoint] =
        simplify_is_coupled(r, own) ? simplify_follow(r, own) : simplify_rest(r, own);
    import_place_compose(&r->out->place[from->parent_link], &from->place, &place);
    memcpy(joint->origin, place.xyz, sizeof joint->origin);
    memcpy(joint->rotation, place.R, sizeof joint->rotation);
    joint->type = from->type == IMPORT_PRISMATIC ? JOINT_PRISMATIC : JOINT_REVOLUTE;
    for (int m = 0; m < 3; m++) {
        joint->axis[m] = from->axis[m] / length;
    }
    joint->lower = from->lower;
    joint->upper = from->upper;

    /* Give a joint without limits a range that no run exceeds */
    if (!from->has_limit || from->type == IMPORT_CONTINUOUS) {
        joint->lower = -2.0 * M_PI * SIMPLIFY_TURNS_MAX;
        joint->upper = 2.0 * M_PI * SIMPLIFY_TURNS_MAX;
        import_note_add(r->notes, IMPORT_CHANGED, from->file, from->line,
                        "joint \"%.63s\" turns for ever: it has the range of %g turns either way, "
                        "without stops",
                        from->name, SIMPLIFY_TURNS_MAX);
    }
    robot->njoint++;
}

/* Finds the body of each link, and the link's pose in the body. Parents come first, so a link on a
 * rigid joint belongs to its parent's body. */
static void simplify_place_links(struct simplifier *r)
{
    const struct import_model *model = r->model;
    struct robot *robot = r->out->robot;
    int *body = r->out->body;

    for (size_t i = 0; i < r->norder; i++) {
        const int at = r->order[i], above = r->above[at];
        const struct import_joint *joint = i == 0 ? NULL : &model->joint[above];
        const struct import_link *link = &model->link[at];
        struct import_place place;

        /* The root is the base. The child of a rigid joint belongs to its parent's body. Other
         * children get a body */
        if (!joint) {
            robot->nbody = 1;
            robot->body[0].parent = -1;
            import_place_identity(&r->out->place[at]);
            body[at] = 0;
            robot->body[0].name = simplify_name(r, link->file, link->line, "body", link->name);
        } else if (!simplify_is_rigid(r, (size_t)above)) {
            simplify_add_body(r, at, joint);
        } else {
            simplify_place_child(joint, r->at[above], &place);
            body[at] = body[joint->parent_link];
            import_place_compose(&r->out->place[joint->parent_link], &place, &r->out->place[at]);
            if (link->has_inertia) {
                import_note_add(r->notes, IMPORT_MERGED, link->file, link->line,
                                "link \"%.63s\" (%g kg) is part of body \"%.63s\"", link->name,
                                link->inertia.mass, robot->body[body[at]].name);
            }
        }
    }
}

/* Names the robot. Sums mass and inertia of the links of each body, and checks the sums. */
static void simplify_sum_inertias(struct simplifier *r)
{
    const struct import_model *model = r->model;
    struct robot *robot = r->out->robot;

    robot->file = model->file;
    robot->name = simplify_name(r, model->file, 1, "robot", model->name);
    robot->gravity[2] = -9.81;
    robot->imu_frame = -1;
    for (size_t i = 0; i < r->norder; i++) {
        int link = r->order[i];

        import_add_inertia(&robot->body[r->out->body[link]].inertia, &model->link[link].inertia,
                           &r->out->place[link]);
    }
    for (size_t i = 0; i < r->norder; i++) {
        int link = r->order[i];
        const struct import_link *source = &model->link[link];
        struct robot_inertia *inertia = &robot->body[r->out->body[link]].inertia;

        /* Messages name a body by its first link */
        if (i > 0 && simplify_is_rigid(r, (size_t)r->above[link])) {
            continue;
        }
        simplify_check_inertia(r, source, inertia);
        if (inertia->mass == 0.0) {
            inertia->mass = NO_MASS_KG;
            import_note_add(r->notes, IMPORT_ASSUMED, source->file, source->line,
                            "body \"%.63s\" has no mass: %g kg stand for it", source->name,
                            NO_MASS_KG);
        }
    }
}

/* ---- the base ---- */

/* Counts the limbs on the base that have two joints or more. wheels: counts the limbs that are one
 * continuous joint instead. */
static size_t robot_count_limbs(const struct import_robot *out, bool wheels)
{
    const struct robot *robot = out->robot;
    size_t limbs = 0;

    for (size_t b = 1; b < robot->nbody; b++) {
        size_t joints = 0;

        if (robot->body[b].parent != 0) {
            continue;
        }

        /* Count the bodies of the limb that starts with body b */
        for (size_t c = b; c < robot->nbody; c++) {
            int up = (int)c;

            while (up > 0 && up != (int)b) {
                up = robot->body[up].parent;
            }
            joints += up == (int)b;
        }
        limbs +=
            wheels ? joints == 1 && out->source[b - 1]->type == IMPORT_CONTINUOUS : joints >= 2;
    }
    return limbs;
}

/* Decides whether the base floats, in this order: the option, a floating joint, the SRDF, the
 * root's name or missing mass, the numbers of limbs and wheels. */
static void simplify_choose_base(struct simplifier *r)
{
    const struct import_model *model = r->model;
    const struct import_link *root = &model->link[r->root];
    struct robot *robot = r->out->robot;
    const char *why = NULL;

    r->out->rolls = robot_count_limbs(r->out, true) >= 2;
    /* The user or the files decide */
    if (r->options->base != IMPORT_BASE_GUESS) {
        robot->floating = r->options->base == IMPORT_BASE_FLOATING;
        return;
    }
    if (r->floats) {
        robot->floating = true;
        return;
    }
    if (model->floating_base || model->fixed_base) {
        robot->floating = model->floating_base;
        return;
    }

    /* Otherwise guess, and add a note. A base floats if it has at least two limbs or two wheels */
    if (!strcmp(root->name, "world") || robot->body[0].inertia.mass <= NO_MASS_KG) {
        robot->floating = false;
        why = "the root has no mass or is the world";
    } else {
        robot->floating = r->out->rolls || robot_count_limbs(r->out, false) >= 2;
        why = r->out->rolls     ? "two wheels or more hang on it"
              : robot->floating ? "two limbs or more hang on it"
                                : "one limb at most hangs on it";
    }
    import_note_add(r->notes, IMPORT_ASSUMED, root->file, root->line,
                    "the base \"%.63s\" %s (%s); --base says otherwise", root->name,
                    robot->floating ? "floats" : "is fixed in the world", why);
}

/* Allocates memory for the reduction and for the robot. Links without a body have -1. */
static void simplify_make_room(struct simplifier *r)
{
    const size_t joints = r->model->njoint + 1, links = r->model->nlink;
    struct import_robot *out = r->out;

    *out = (struct import_robot){.model = r->model};
    r->above = simplify_alloc(r, links, sizeof *r->above);
    r->order = simplify_alloc(r, links, sizeof *r->order);
    r->at = simplify_alloc(r, joints, sizeof *r->at);
    r->mimic = simplify_alloc(r, joints, sizeof *r->mimic);
    r->lower = simplify_alloc(r, joints, sizeof *r->lower);
    r->upper = simplify_alloc(r, joints, sizeof *r->upper);
    out->robot = simplify_alloc(r, 1, sizeof *out->robot);
    out->source = simplify_alloc(r, joints, sizeof *out->source);
    out->rest = simplify_alloc(r, joints, sizeof *out->rest);
    out->fixed = simplify_alloc(r, joints, sizeof *out->fixed);
    out->body = simplify_alloc(r, links, sizeof *out->body);
    out->place = simplify_alloc(r, links, sizeof *out->place);
    if (r->error->code) {
        return;
    }
    out->robot->body = simplify_alloc(r, joints, sizeof *out->robot->body);
    out->robot->joint = simplify_alloc(r, joints, sizeof *out->robot->joint);
    for (size_t i = 0; i < links; i++) {
        out->body[i] = -1;
    }
}

/* Refuses a pose outside the range of robot files, with the line of the foreign file. */
static void simplify_check_place(const struct simplifier *r, const double xyz[3], const char *file,
                                 int line, const char *what, const char *name)
{
    for (int i = 0; i < 3; i++) {
        if (fabs(xyz[i]) > PLACE_MAX_M) {
            import_error(r->error, file, line, "found %g m in %s \"%.63s\", expected -%g to %g",
                         xyz[i], what, name, PLACE_MAX_M, PLACE_MAX_M);
        }
    }
}

/* Refuses poses and inertias outside the ranges of robot files, so that the error refers to the
 * user's file instead of the generated one. */
static void simplify_check_ranges(struct simplifier *r)
{
    const struct import_model *model = r->model;

    for (size_t j = 0; j < model->njoint; j++) {
        const struct import_joint *joint = &model->joint[j];

        simplify_check_place(r, joint->place.xyz, joint->file, joint->line, "the origin of joint",
                             joint->name);
    }
    for (size_t i = 0; i < model->nsensor; i++) {
        const struct import_sensor *sensor = &model->sensor[i];

        simplify_check_place(r, sensor->place.xyz, sensor->file, sensor->line,
                             "the place of sensor", sensor->name);
    }
    for (size_t i = 0; i < model->nlink; i++) {
        const struct import_link *link = &model->link[i];
        int line = link->inertia_line ? link->inertia_line : link->line;

        simplify_check_place(r, link->inertia.com, link->file, line, "the center of mass of link",
                             link->name);
        for (int k = 0; k < 6; k++) {
            if (fabs(link->inertia.I[k]) > INERTIA_MAX_KG_M2) {
                import_error(r->error, link->file, line,
                             "found an inertia of %g kg m2 of link \"%.63s\", expected -%g to %g",
                             link->inertia.I[k], link->name, INERTIA_MAX_KG_M2, INERTIA_MAX_KG_M2);
            }
        }
    }
}

enum error_code import_simplify_tree(const struct import_model *model,
                                     const struct import_options *options, struct arena *arena,
                                     struct import_notes *notes, struct import_robot *out,
                                     struct error *error)
{
    /* Tree and moving joints first: inertias need the poses of links, and the base needs the
     * inertias */
    static void (*const step[])(struct simplifier * r) = {
        simplify_make_room,        simplify_check_ranges,   simplify_find_parents,
        simplify_find_root,        simplify_check_cycles,   simplify_enter_world,
        simplify_order_links,      simplify_find_followers, simplify_check_joints,
        simplify_fix_named,        simplify_narrow_leaders, simplify_fix_massless,
        simplify_settle_followers, simplify_check_count,    simplify_place_links,
        simplify_add_couplings,    simplify_sum_inertias,   simplify_choose_base,
        simplify_add_frames,       simplify_add_poses,
    };
    struct simplifier r = {.model = model,
                           .options = options,
                           .arena = arena,
                           .notes = notes,
                           .out = out,
                           .error = error};

    error->code = ERROR_NONE;
    for (size_t i = 0; i < ARRAY_COUNT(step) && !error->code; i++) {
        step[i](&r);
    }
    return error->code;
}
