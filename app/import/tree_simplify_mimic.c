/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Handles joints that follow others: chains, the treatment of each follower, and rest positions.
 * The first joint of a chain is the leader of all others. The equations of the joints between are
 * substituted into the multiplier and offset of the last one.
 */
#include "app/import/tree_simplify_private.h"

#include "model/coupling.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Bounds of multipliers and offsets in a robot file. */
#define MULTIPLIER_LEAST 1e-6
#define MULTIPLIER_MOST 1e3
#define OFFSET_MOST 1e3

/* ---- pinions ---- */

/* Least radius of a pinion, m. A longer rack has a larger one, so that it turns by no more than
 * PINION_TURNS_RAD either way. */
#define PINION_RADIUS_M 0.01
#define PINION_TURNS_RAD 12.0

/* Mass, kg, and inertia, kg m2, of a pinion: almost none. The drive has the rotor's. */
#define PINION_MASS 1e-9

/* Adds the pinion of one joint at the end of the lists, which have room. Converts effort, velocity
 * and resistance to motion to the pinion's axis. */
static void pinion_add(struct import_model *model, struct import_joint *rack, struct arena *arena,
                       struct import_notes *notes)
{
    const double farthest = fmax(fabs(rack->lower), fabs(rack->upper));
    const double radius = fmax(PINION_RADIUS_M, farthest / PINION_TURNS_RAD);
    struct import_joint *joint = &model->joint[model->njoint++];
    char name[80];

    snprintf(name, sizeof name, "%.55s-pinion", rack->name);
    *joint = *rack;
    joint->name = joint->child = arena_strdup(arena, name);
    joint->child_link = (int)model->nlink;
    joint->type = IMPORT_REVOLUTE;
    joint->lower = rack->lower / radius;
    joint->upper = rack->upper / radius;
    joint->effort = rack->effort * radius;
    joint->velocity = rack->velocity / radius;
    joint->friction = rack->friction * radius;
    joint->armature = rack->armature * radius * radius;
    joint->damping = rack->damping * radius * radius;
    joint->stiffness = joint->rest = 0.0;
    model->link[model->nlink++] = (struct import_link){
        .name = joint->name,
        .file = rack->file,
        .line = rack->line,
        .has_inertia = true,
        .inertia = {.mass = PINION_MASS, .I = {PINION_MASS, 0, 0, PINION_MASS, 0, PINION_MASS}}};

    /* The rack follows the pinion, without what the pinion has now */
    rack->mimic = joint->name;
    rack->mimic_file = rack->file;
    rack->mimic_line = rack->line;
    rack->multiplier = radius;
    rack->racked = true;
    rack->friction = rack->damping = 0.0;
    import_note_add(notes, IMPORT_ASSUMED, rack->file, rack->line,
                    "joint \"%.63s\" slides by a pinion of radius %g m: the drive is that of joint "
                    "\"%s\"",
                    rack->name, radius, name);

    /* A pose gives the pinion's angle by the place of the rack */
    for (size_t p = 0; p < model->npose; p++) {
        struct import_pose *pose = &model->pose[p];
        const size_t count = pose->nvalue;

        for (size_t i = 0; i < count && joint->name; i++) {
            if (!strcmp(pose->value[i].joint, rack->name)) {
                pose->value[pose->nvalue] = pose->value[i];
                pose->value[pose->nvalue].joint = joint->name;
                pose->value[pose->nvalue++].value /= radius;
            }
        }
    }
}

/* Returns a copy of a list with room for more. Without memory returns NULL. */
static void *list_extend(struct arena *arena, const void *list, size_t count, size_t more,
                         size_t size)
{
    void *copy = arena_alloc(arena, count + more + 1, size);

    return copy && count ? memcpy(copy, list, count * size) : copy;
}

enum error_code import_add_pinions(struct import_model *model, struct arena *arena,
                                   struct import_notes *notes, struct error *error)
{
    const size_t njoint = model->njoint;
    bool room = true;

    /* Make room for a pinion of each joint */
    model->joint = list_extend(arena, model->joint, njoint, njoint, sizeof *model->joint);
    model->link = list_extend(arena, model->link, model->nlink, njoint, sizeof *model->link);
    for (size_t p = 0; p < model->npose; p++) {
        struct import_pose *pose = &model->pose[p];

        pose->value = list_extend(arena, pose->value, pose->nvalue, njoint, sizeof *pose->value);
        room = room && pose->value;
    }
    if (!room || !model->joint || !model->link) {
        return error_set(error, ERROR_MEMORY, "%.200s: no memory for the pinions", model->file);
    }
    for (size_t j = 0; j < njoint; j++) {
        struct import_joint *joint = &model->joint[j];

        /* A joint gets a pinion if it slides, can move, follows no other, and has an actuator if
         * the file has any */
        if (joint->type == IMPORT_PRISMATIC && !joint->mimic && joint->lower < joint->upper &&
            (!model->actuated || model->drives_others || joint->driven)) {
            pinion_add(model, joint, arena, notes);
        }
    }
    return ERROR_NONE;
}

/* ---- followers ---- */

bool simplify_is_rigid(const struct simplifier *r, size_t j)
{
    return r->out->fixed[j] || r->model->joint[j].type == IMPORT_FIXED;
}

void simplify_find_followers(struct simplifier *r)
{
    const struct import_model *model = r->model;

    for (size_t j = 0; j < model->njoint; j++) {
        const struct import_joint *joint = &model->joint[j];

        r->mimic[j] = joint->mimic ? import_find_joint(model, joint->mimic) : -1;
        r->lower[j] = joint->has_limit ? joint->lower : -2.0 * M_PI * SIMPLIFY_TURNS_MAX;
        r->upper[j] = joint->has_limit ? joint->upper : 2.0 * M_PI * SIMPLIFY_TURNS_MAX;
    }

    /* Walk up from each joint: more steps than joints mean a cycle */
    for (size_t j = 0; j < model->njoint; j++) {
        int up = r->mimic[j];

        for (size_t step = 0; up >= 0 && step <= model->njoint; step++) {
            up = r->mimic[up];
        }
        if (up >= 0) {
            import_error(r->error, model->joint[j].mimic_file, model->joint[j].mimic_line,
                         "found joint \"%.63s\" that follows \"%.63s\", which ends in a circle, "
                         "expected a joint that follows none",
                         model->joint[j].name, model->joint[j].mimic);
        }
    }
}

/* Finds the leader of joint j: the first joint up the chain that follows none or is fixed; -1 =
 * none. position = *multiplier times the leader's position + *offset. */
static int find_leader(const struct simplifier *r, size_t j, double *multiplier, double *offset)
{
    int leader = r->mimic[j];

    *multiplier = r->model->joint[j].multiplier;
    *offset = r->model->joint[j].offset;

    /* The joints between are followers too: substitute their equations into the equation of j */
    while (leader >= 0 && r->mimic[leader] >= 0 && !simplify_is_rigid(r, (size_t)leader)) {
        *offset += *multiplier * r->model->joint[leader].offset;
        *multiplier *= r->model->joint[leader].multiplier;
        leader = r->mimic[leader];
    }
    return leader;
}

/* ---- rest ---- */

/* Distance from the limit at which a joint rests if 0 is out of range, as a share of the range; at
 * most 0.1 rad or m. */
#define REST_INSIDE 0.05

double simplify_rest(const struct simplifier *r, size_t j)
{
    const double lower = r->lower[j], upper = r->upper[j];
    double inside = fmin(REST_INSIDE * (upper - lower), 0.1);

    if (lower <= 0.0 && upper >= 0.0) {
        return 0.0;
    }
    return lower > 0.0 ? lower + inside : upper - inside;
}

double simplify_follow(const struct simplifier *r, size_t j)
{
    const struct import_joint *joint = &r->model->joint[j];
    double multiplier, offset, at;
    int leader = find_leader(r, j, &multiplier, &offset);

    if (leader < 0) {
        return simplify_rest(r, j);
    }
    at = simplify_is_rigid(r, (size_t)leader) ? r->at[leader] : simplify_rest(r, (size_t)leader);
    at = multiplier * at + offset;
    return joint->has_limit ? fmin(fmax(at, joint->lower), joint->upper) : at;
}

/* ---- coupled joints ---- */

bool simplify_is_coupled(const struct simplifier *r, size_t j)
{
    return (r->options->mimic == IMPORT_MIMIC_COUPLE || r->model->joint[j].racked) &&
           r->mimic[j] >= 0 && !simplify_is_rigid(r, j);
}

/* Narrows a leader's range to the positions that its follower can follow, also at rest and in
 * poses. Refuses ranges that exclude each other. Refuses couplings that a robot file cannot
 * express: polynomials of higher order, and numbers outside its limits. */
static void narrow_leader(struct simplifier *r, size_t j, size_t leader, double multiplier,
                          double offset)
{
    const struct import_joint *joint = &r->model->joint[j];
    /* Convert the follower's limits to positions of its leader */
    const double end[2] = {(r->lower[j] - offset) / multiplier,
                           (r->upper[j] - offset) / multiplier};

    r->lower[leader] = fmax(r->lower[leader], fmin(end[0], end[1]));
    r->upper[leader] = fmin(r->upper[leader], fmax(end[0], end[1]));
    if (joint->bends) {
        import_error(r->error, joint->mimic_file, joint->mimic_line,
                     "found joint \"%.63s\" that follows \"%.63s\" by a polynomial, expected a "
                     "straight line (polycoef \"a b 0 0 0\"): --lock %.63s fixes it, --mimic free "
                     "lets all such joints move on their own",
                     joint->name, joint->mimic, joint->name);
    } else if (!(fabs(multiplier) >= MULTIPLIER_LEAST && fabs(multiplier) <= MULTIPLIER_MOST) ||
               !(fabs(offset) <= OFFSET_MOST)) {
        import_error(
            r->error, joint->mimic_file, joint->mimic_line,
            "found joint \"%.63s\" that follows with multiplier %g and offset %g, expected "
            "%g to %g, positive or negative, and an offset within %g",
            joint->name, multiplier, offset, MULTIPLIER_LEAST, MULTIPLIER_MOST, OFFSET_MOST);
    } else if (r->lower[leader] > r->upper[leader]) {
        import_error(
            r->error, joint->mimic_file, joint->mimic_line,
            "found joint \"%.63s\" with limits %g to %g that exclude where \"%.63s\" leads "
            "it, %g times that joint's position + %g, expected a place where both can be",
            joint->name, r->lower[j], r->upper[j], r->model->joint[leader].name, multiplier,
            offset);
    }
}

void simplify_narrow_leaders(struct simplifier *r)
{
    for (size_t j = 0; j < r->model->njoint; j++) {
        if (simplify_is_coupled(r, j)) {
            double multiplier, offset;
            const int leader = find_leader(r, j, &multiplier, &offset);

            if (!simplify_is_rigid(r, (size_t)leader) && multiplier != 0.0) {
                narrow_leader(r, j, (size_t)leader, multiplier, offset);
            }
        }
    }
}

/* ---- what becomes of them ---- */

/* Decides the treatment of a follower. A follower of a fixed joint is fixed. Others are locked,
 * free or coupled by --mimic, and refused by default. *couplings counts the coupled ones. */
static void settle_follower(struct simplifier *r, size_t j, size_t *couplings)
{
    const struct import_joint *joint = &r->model->joint[j];
    double multiplier, offset;
    int leader = find_leader(r, j, &multiplier, &offset);

    /* A follower of a fixed joint is fixed for any --mimic */
    if (leader < 0 || simplify_is_rigid(r, j)) {
        return;
    }
    if (simplify_is_rigid(r, (size_t)leader)) {
        simplify_fix_joint(r, j, simplify_follow(r, j), "it follows a joint that is fixed");
        return;
    }
    switch (joint->racked ? IMPORT_MIMIC_COUPLE : r->options->mimic) {
    case IMPORT_MIMIC_LOCK:
        simplify_fix_joint(r, j, simplify_follow(r, j),
                           "it follows another, and --mimic lock holds it there");
        return;
    case IMPORT_MIMIC_FREE:
        import_note_add(r->notes, IMPORT_CHANGED, joint->mimic_file, joint->mimic_line,
                        "joint \"%.63s\" no longer follows \"%.63s\": it moves on its own "
                        "(--mimic free)",
                        joint->name, joint->mimic);
        return;
    case IMPORT_MIMIC_COUPLE:
        if (multiplier == 0.0) {
            simplify_fix_joint(r, j, simplify_follow(r, j), "it follows another 0 times");
        } else if (++*couplings > ROBOT_COUPLINGS_MAX) {
            import_error(r->error, joint->mimic_file, joint->mimic_line,
                         "found joint \"%.63s\" that follows, which is one more than the %d that "
                         "may, expected fewer: --lock JOINT fixes what need not move",
                         joint->name, ROBOT_COUPLINGS_MAX);
        }
        return;
    default:
        import_error(r->error, joint->mimic_file, joint->mimic_line,
                     "found joint \"%.63s\" that follows \"%.63s\": give --mimic couple to have it "
                     "follow, driven by that joint's drive, --mimic lock to fix all such joints "
                     "where they rest, or --mimic free to let them move on their own",
                     joint->name, joint->mimic);
        return;
    }
}

void simplify_settle_followers(struct simplifier *r)
{
    size_t couplings = 0;

    for (size_t j = 0; j < r->model->njoint; j++) {
        settle_follower(r, j, &couplings);
    }
}

/* ---- the robot's couplings ---- */

void simplify_add_couplings(struct simplifier *r)
{
    const struct import_model *model = r->model;
    struct robot *robot = r->out->robot;

    robot->coupling = simplify_alloc(r, ROBOT_COUPLINGS_MAX, sizeof *robot->coupling);
    for (size_t j = 0; j < robot->njoint && robot->coupling; j++) {
        const struct import_joint *own = r->out->source[j];
        struct robot_coupling *coupling = &robot->coupling[robot->ncoupling];
        int leader;

        if (!simplify_is_coupled(r, (size_t)(own - model->joint))) {
            continue;
        }
        leader =
            find_leader(r, (size_t)(own - model->joint), &coupling->multiplier, &coupling->offset);
        coupling->follower = (int)j;
        coupling->leader = (int)robot->njoint;
        while (coupling->leader-- > 0 &&
               r->out->source[coupling->leader] != &model->joint[leader]) {
        }
        if (coupling->leader < 0) {
            import_error(r->error, own->mimic_file, own->mimic_line,
                         "found joint \"%.63s\" that follows \"%.63s\", which is no joint of the "
                         "robot's, expected one that turns or slides",
                         own->name, model->joint[leader].name);
        }
        /* placeholder; app/import/drive.h sets it when the drive is known */
        coupling->stiffness = 1.0;
        robot->ncoupling++;
    }
}

void simplify_align_pose(const struct simplifier *r, const struct import_pose *pose,
                         double *position)
{
    const struct robot *robot = r->out->robot;

    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];
        const double to = coupling->multiplier * position[coupling->leader] + coupling->offset;
        double *at = &position[coupling->follower];

        if (fabs(*at - to) > COUPLING_ALIGNED * fmax(1.0, fabs(to))) {
            import_note_add(r->notes, IMPORT_CHANGED, pose->file, pose->line,
                            "pose \"%.63s\": joint \"%.63s\" is at %g, where \"%.63s\" leads it, "
                            "not at %g",
                            pose->name, robot->joint[coupling->follower].name, to,
                            robot->joint[coupling->leader].name, *at);
        }
    }
    coupling_align(robot, position);
}
