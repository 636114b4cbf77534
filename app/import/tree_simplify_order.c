/* SPDX-License-Identifier: Apache-2.0 */
/* Finds the tree of links and its moving joints. */
#include "app/import/tree_simplify_private.h"

#include "base/text.h"
#include "base/vec3.h"
#include "rig/rig.h"

/* ---- the tree ---- */

void simplify_find_parents(struct simplifier *r)
{
    const struct import_model *model = r->model;

    for (size_t i = 0; i < model->nlink; i++) {
        r->above[i] = -1;
    }
    for (size_t j = 0; j < model->njoint; j++) {
        const struct import_joint *joint = &model->joint[j];
        const int above = r->above[joint->child_link];

        if (above >= 0) {
            import_error(r->error, joint->file, joint->line,
                         "found link \"%.63s\" as the child of joint \"%.63s\" and of \"%.63s\" "
                         "(line %d), expected one joint: loops are not imported; remove one of the "
                         "two and drive the open tree",
                         joint->child, joint->name, model->joint[above].name,
                         model->joint[above].line);
        }
        r->above[joint->child_link] = (int)j;
    }
}

void simplify_find_root(struct simplifier *r)
{
    const struct import_model *model = r->model;

    r->root = -1;
    for (size_t i = 0; i < model->nlink; i++) {
        const struct import_link *link = &model->link[i];

        /* A second root means that the trees are separate */
        if (r->above[i] < 0 && r->root >= 0) {
            import_error(r->error, link->file, link->line,
                         "found link \"%.63s\" on no joint beside \"%.63s\" (line %d), expected "
                         "one tree: join the two, or import them one by one",
                         link->name, model->link[r->root].name, model->link[r->root].line);
        }
        r->root = r->above[i] < 0 ? (int)i : r->root;
    }
    if (r->root < 0) {
        import_error(r->error, model->joint[0].file, model->joint[0].line,
                     "found every link on a joint, expected one on none: the joints form a loop");
    }
}

/* Checks whether a joint lets an object float in a world without mass. */
static bool simplify_is_object(const struct simplifier *r, size_t j)
{
    const struct import_joint *joint = &r->model->joint[j];

    return joint->type == IMPORT_FLOATING && joint->child_link != r->root &&
           r->above[joint->parent_link] < 0 && !r->model->link[joint->parent_link].has_inertia;
}

/* Counts the joints that turn or slide in each tree on the root: only those with an actuator, if
 * the file has any. count[j] receives the number behind joint j, if joint j is on the root. */
static void world_count_joints(const struct simplifier *r, size_t *count)
{
    const struct import_model *model = r->model;

    for (size_t j = 0; j < model->njoint; j++) {
        const struct import_joint *joint = &model->joint[j];
        size_t top = j;

        if (joint->type == IMPORT_FIXED || joint->type == IMPORT_FLOATING ||
            (model->actuated && !joint->driven)) {
            continue;
        }
        while (model->joint[top].parent_link != r->root) {
            top = (size_t)r->above[model->joint[top].parent_link];
        }
        count[top]++;
    }
}

void simplify_enter_world(struct simplifier *r)
{
    const struct import_model *model = r->model;
    size_t *count = simplify_alloc(r, model->njoint + 1, sizeof *count), still = 0, best = 0;
    const struct import_joint *floating = NULL;

    /* Find the floating joint of the tree with most joints, on a root without mass */
    if (!count || model->link[r->root].has_inertia) {
        return;
    }
    world_count_joints(r, count);
    for (size_t j = 0; j < model->njoint; j++) {
        const struct import_joint *joint = &model->joint[j];

        if (joint->parent_link == r->root && joint->type != IMPORT_FLOATING) {
            still += count[j];
        } else if (joint->parent_link == r->root && (!floating || count[j] > best)) {
            floating = joint;
            best = count[j];
        }
    }
    r->floats = floating && still <= best;

    /* Parts with fewer joints than the robot are objects: free bodies and, beside a robot that
     * floats, parts on joints in the world */
    for (size_t j = 0; floating && j < model->njoint; j++) {
        const struct import_joint *other = &model->joint[j];
        const bool object = r->floats ? other->type != IMPORT_FIXED && (count[j] < best || !best)
                                      : other->type == IMPORT_FLOATING;

        if (other->parent_link != r->root || (r->floats ? other == floating : !object)) {
            continue;
        }
        if (!object && other->type != IMPORT_FIXED &&
            TEXT_INDEX(r->options->lock, r->options->nlock, other->name) < 0) {
            import_error(r->error, other->file, other->line,
                         "found joint \"%.63s\" on the root \"%.63s\" beside the floating joint "
                         "\"%.63s\" (line %d), expected that alone: one robot floats; --lock "
                         "leaves what does not matter in the world",
                         other->name, model->link[r->root].name, floating->name, floating->line);
        }
        import_note_add(r->notes, IMPORT_DROPPED, other->file, other->line,
                        "link \"%.63s\", with all that hangs on it: it %s", other->child,
                        object ? "is an object beside the robot, which has more joints"
                               : "stays in the world in which the robot floats");
    }
    r->root = r->floats ? floating->child_link : r->root;
}

void simplify_order_links(struct simplifier *r)
{
    const struct import_model *model = r->model;
    int *next = simplify_alloc(r, model->nlink + 1, sizeof *next); /* a stack of links */
    size_t depth = 0;

    if (next) {
        next[depth++] = r->root;
    }
    while (depth > 0) {
        int link = next[--depth];

        r->order[r->norder++] = link;

        /* Push in reverse order, so that links are popped in file order */
        for (size_t j = model->njoint; j-- > 0;) {
            if (model->joint[j].parent_link == link && !simplify_is_object(r, j)) {
                next[depth++] = model->joint[j].child_link;
            }
        }
    }
}

void simplify_check_cycles(struct simplifier *r)
{
    const struct import_model *model = r->model;

    for (size_t j = 0; j < model->njoint; j++) {
        /* More steps up than links mean a cycle */
        int link = model->joint[j].child_link;

        for (size_t step = 0; r->above[link] >= 0 && step <= model->nlink; step++) {
            link = model->joint[r->above[link]].parent_link;
        }
        if (r->above[link] >= 0) {
            import_error(r->error, model->joint[j].file, model->joint[j].line,
                         "found joint \"%.63s\" in a loop of joints that does not hang on the root "
                         "\"%.63s\", expected a tree",
                         model->joint[j].name, model->link[r->root].name);
        }
    }
}

/* ---- which joints move ---- */

void simplify_place_child(const struct import_joint *joint, double q, struct import_place *place)
{
    double turn[9], slide[3], axis[3], length = vec3_norm(joint->axis);

    *place = joint->place;
    if (q == 0.0) {
        return;
    }
    for (int m = 0; m < 3; m++) {
        axis[m] = joint->axis[m] / length;
    }
    if (joint->type == IMPORT_PRISMATIC) {
        mat3_apply(joint->place.R, axis, slide);
        vec3_add_scaled(place->xyz, q, slide, place->xyz);
    } else {
        mat3_about_axis(axis, q, turn);
        mat3_mul(joint->place.R, turn, place->R);
    }
}

void simplify_fix_joint(struct simplifier *r, size_t j, double at, const char *why)
{
    const struct import_joint *joint = &r->model->joint[j];

    r->out->fixed[j] = true;
    r->at[j] = at;
    import_note_add(r->notes, IMPORT_CHANGED, joint->file, joint->line,
                    "joint \"%.63s\" is fixed at %g %s: %s", joint->name, at,
                    joint->type == IMPORT_PRISMATIC ? "m" : "rad", why);
}

/* Checks the limits of revolute and prismatic joints. Refuses reversed limits. Equal
 * limits fix the joint. */
static void simplify_check_limit(struct simplifier *r, size_t j)
{
    const struct import_joint *joint = &r->model->joint[j];

    if (joint->type != IMPORT_REVOLUTE && joint->type != IMPORT_PRISMATIC) {
        return;
    }
    if (joint->lower > joint->upper) {
        import_error(r->error, joint->file, joint->line,
                     "found joint \"%.63s\" with lower limit %g above its upper limit %g, expected "
                     "it below",
                     joint->name, joint->lower, joint->upper);
    } else if (joint->lower == joint->upper) {
        simplify_fix_joint(r, j, joint->lower, "both limits are there");
    } else if ((joint->lower > 0.0 || joint->upper < 0.0) && !simplify_is_coupled(r, j)) {
        /* Limits that exclude 0 change the rest position */
        import_note_add(r->notes, IMPORT_CHANGED, joint->file, joint->line,
                        "joint \"%.63s\" rests at %g: its limits %g to %g exclude 0", joint->name,
                        simplify_rest(r, j), joint->lower, joint->upper);
    }
}

void simplify_check_joints(struct simplifier *r)
{
    for (size_t j = 0; j < r->model->njoint && !r->error->code; j++) {
        const struct import_joint *joint = &r->model->joint[j];

        if (joint->type == IMPORT_PLANAR) {
            import_error(r->error, joint->file, joint->line,
                         "found planar joint \"%.63s\", expected another type: write two prismatic "
                         "joints and a continuous one, or fix it (type \"fixed\")",
                         joint->name);
        }
        if (joint->type == IMPORT_FLOATING && joint->child_link != r->root &&
            !simplify_is_object(r, j)) {
            import_error(r->error, joint->file, joint->line,
                         "found floating joint \"%.63s\" between two bodies, expected it between a "
                         "root without mass and the base: nothing but the base floats",
                         joint->name);
        }
        simplify_check_limit(r, j);

        /* Without a drive, a prismatic joint would fall to its stop: fix it, or let it slide if the
         * option says so */
        if (joint->type != IMPORT_PRISMATIC || r->out->fixed[j] || simplify_is_coupled(r, j)) {
            continue;
        }
        if (r->options->free_slides) {
            import_note_add(r->notes, IMPORT_CHANGED, joint->file, joint->line,
                            "prismatic joint \"%.63s\" has no drive, for drives turn: it slides "
                            "freely (--prismatic free)",
                            joint->name);
        } else {
            simplify_fix_joint(
                r, j, simplify_rest(r, j),
                "it slides, and drives turn; --prismatic drive gives it one, free none");
        }
    }
}

void simplify_fix_massless(struct simplifier *r)
{
    const struct import_model *model = r->model;
    double *mass = simplify_alloc(r, model->nlink, sizeof *mass);

    /* Visit children first, so that a link's mass is complete when it is added to its parent */
    for (size_t i = r->norder; i-- > 0 && mass;) {
        int link = r->order[i], above = r->above[link];

        mass[link] += model->link[link].inertia.mass;
        if (i == 0) {
            if (mass[link] == 0.0) {
                import_error(r->error, model->link[link].file, model->link[link].line,
                             "found no mass in the whole robot, expected links with <inertial>: "
                             "without masses nothing has dynamics");
            }
            continue;
        }
        mass[model->joint[above].parent_link] += mass[link];
        if (mass[link] == 0.0 && !simplify_is_rigid(r, (size_t)above)) {
            simplify_fix_joint(r, (size_t)above, simplify_follow(r, (size_t)above),
                               "nothing that it moves has mass");
        }
    }
}

void simplify_fix_named(struct simplifier *r)
{
    for (size_t i = 0; i < r->options->nlock; i++) {
        int j = import_find_joint(r->model, r->options->lock[i]);

        if (j < 0) {
            error_set(r->error, ERROR_INPUT, "--lock: found \"%.63s\", expected a joint of %.200s",
                      r->options->lock[i], r->model->file);
            return;
        }
        if (!simplify_is_rigid(r, (size_t)j)) {
            simplify_fix_joint(r, (size_t)j, simplify_rest(r, (size_t)j), "--lock says so");
        }
    }
}

void simplify_check_count(struct simplifier *r)
{
    size_t count = 0;

    for (size_t j = 0; j < r->model->njoint; j++) {
        const struct import_joint *joint = &r->model->joint[j];

        count += !simplify_is_rigid(r, j) && joint->type != IMPORT_FLOATING;
        if (count > RIG_JOINTS_MAX) {
            import_error(r->error, joint->file, joint->line,
                         "found joint \"%.63s\", which is one more than the %d that may move, "
                         "expected fewer: --lock JOINT fixes what need not move, such as fingers",
                         joint->name, RIG_JOINTS_MAX);
        }
    }
}
