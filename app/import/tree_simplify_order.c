/* SPDX-License-Identifier: Apache-2.0 */
/* Finds the tree of links and its moving joints. */
#include "app/import/tree_simplify_private.h"

#include "base/vec3.h"
#include "rig/rig.h"

#include <math.h>
#include <string.h>

/* ---- the tree ---- */

/* Refuses a link that is the child of two joints. */
static enum error_code simplify_refuse_loop(struct simplifier *r, const struct import_joint *joint,
                                            const struct import_joint *other)
{
    return import_error(r->error, joint->file, joint->line,
                        "found link \"%.63s\" as the child of joint \"%.63s\" and of \"%.63s\" "
                        "(line %d), expected one joint: loops are not imported; remove one of the "
                        "two and drive the open tree",
                        joint->child, joint->name, other->name, other->line);
}

/* Finds the joint that each link is the child of; refuses loops. */
static enum error_code simplify_find_parents(struct simplifier *r)
{
    const struct import_model *model = r->model;

    for (size_t i = 0; i < model->nlink; i++) {
        r->above[i] = -1;
    }
    for (size_t j = 0; j < model->njoint; j++) {
        const struct import_joint *joint = &model->joint[j];
        int *above = &r->above[joint->child_link];

        if (*above >= 0) {
            return simplify_refuse_loop(r, joint, &model->joint[*above]);
        }
        *above = (int)j;
    }
    return ERROR_NONE;
}

/* Finds the root: the only link that is no joint's child. */
static enum error_code simplify_find_root(struct simplifier *r)
{
    const struct import_model *model = r->model;

    r->root = -1;
    for (size_t i = 0; i < model->nlink; i++) {
        if (r->above[i] >= 0) {
            continue;
        }

        /* A second root means separate trees */
        if (r->root >= 0) {
            return import_error(r->error, model->link[i].file, model->link[i].line,
                                "found link \"%.63s\" on no joint beside \"%.63s\" (line %d), "
                                "expected one tree: join the two, or import them one by one",
                                model->link[i].name, model->link[r->root].name,
                                model->link[r->root].line);
        }
        r->root = (int)i;
    }
    if (r->root < 0) {
        return import_error(r->error, model->joint[0].file, model->joint[0].line,
                            "found every link on a joint, expected one on none: the joints form a "
                            "loop");
    }
    return ERROR_NONE;
}

/* Checks whether --lock names a joint. */
static bool option_locks_joint(const struct import_options *options, const char *name)
{
    for (size_t i = 0; i < options->nlock; i++) {
        if (!strcmp(options->lock[i], name)) {
            return true;
        }
    }
    return false;
}

/* Checks whether the root is the world: it has no mass, and a floating joint is attached to it.
 * Then the base is that joint's child. All other parts of that world must be fixed, and are left
 * out. */
static enum error_code simplify_enter_world(struct simplifier *r)
{
    const struct import_model *model = r->model;
    const struct import_joint *floating = NULL;

    /* The first floating joint on a root without mass is the robot's */
    for (size_t j = 0; j < model->njoint && !model->link[r->root].has_inertia; j++) {
        if (model->joint[j].parent_link == r->root && model->joint[j].type == IMPORT_FLOATING) {
            floating = floating ? floating : &model->joint[j];
        }
    }

    /* All other joints on that root must be fixed */
    for (size_t j = 0; floating && j < model->njoint; j++) {
        const struct import_joint *other = &model->joint[j];

        if (other->parent_link != r->root || other == floating) {
            continue;
        }
        if (other->type != IMPORT_FIXED && !option_locks_joint(r->options, other->name)) {
            return import_error(
                r->error, other->file, other->line,
                "found joint \"%.63s\" on the root \"%.63s\" beside the floating joint "
                "\"%.63s\" (line %d), expected that alone: one robot floats; --lock "
                "leaves what does not matter in the world",
                other->name, model->link[r->root].name, floating->name, floating->line);
        }
        import_note_add(r->notes, IMPORT_DROPPED, other->file, other->line,
                        "link \"%.63s\", with all that hangs on it: it stays in the world in which "
                        "the robot floats",
                        other->child);
    }
    if (floating) {
        r->root = floating->child_link;
        r->floats = true;
    }
    return ERROR_NONE;
}

/* Orders links by a walk down the tree: parents before children, children in the order of their
 * joints in the file. */
static enum error_code simplify_order_links(struct simplifier *r)
{
    const struct import_model *model = r->model;
    int *next = arena_alloc(r->arena, model->nlink + 1, sizeof *next); /* a stack of links */
    size_t depth = 0, count = 0;

    if (!next) {
        return simplify_no_memory(r);
    }
    next[depth++] = r->root;
    while (depth > 0) {
        int link = next[--depth];

        r->order[count++] = link;

        /* Pushed in reverse, so that they are popped in file order */
        for (size_t j = model->njoint; j-- > 0;) {
            if (model->joint[j].parent_link == link) {
                next[depth++] = model->joint[j].child_link;
            }
        }
    }
    r->norder = count;
    return ERROR_NONE;
}

/* Refuses joints that form a cycle without a root. */
static enum error_code simplify_check_cycles(struct simplifier *r)
{
    const struct import_model *model = r->model;

    for (size_t j = 0; j < model->njoint; j++) {
        /* A walk up with more steps than links is a cycle */
        int link = model->joint[j].child_link;

        for (size_t step = 0; r->above[link] >= 0 && step <= model->nlink; step++) {
            link = model->joint[r->above[link]].parent_link;
        }
        if (r->above[link] >= 0) {
            return import_error(r->error, model->joint[j].file, model->joint[j].line,
                                "found joint \"%.63s\" in a loop of joints that does not hang on "
                                "the root \"%.63s\", expected a tree",
                                model->joint[j].name, model->link[r->root].name);
        }
    }
    return ERROR_NONE;
}

enum error_code simplify_find_tree(struct simplifier *r)
{
    enum error_code code;

    r->above = arena_alloc(r->arena, r->model->nlink, sizeof *r->above);
    r->order = arena_alloc(r->arena, r->model->nlink, sizeof *r->order);
    r->at = arena_alloc(r->arena, r->model->njoint + 1, sizeof *r->at);
    r->out->fixed = arena_alloc(r->arena, r->model->njoint + 1, sizeof *r->out->fixed);
    if (!r->above || !r->order || !r->at || !r->out->fixed) {
        return simplify_no_memory(r);
    }
    if ((code = simplify_find_parents(r)) || (code = simplify_find_root(r)) ||
        (code = simplify_check_cycles(r)) || (code = simplify_enter_world(r))) {
        return code;
    }
    return simplify_order_links(r);
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

/* Checks the limits of revolute and prismatic joints: refuses missing or reversed limits; equal
 * limits fix the joint. */
static enum error_code simplify_check_limit(struct simplifier *r, size_t j)
{
    const struct import_joint *joint = &r->model->joint[j];

    if (joint->type != IMPORT_REVOLUTE && joint->type != IMPORT_PRISMATIC) {
        return ERROR_NONE;
    }
    if (!joint->has_limit) {
        return import_error(r->error, joint->file, joint->line,
                            "found joint \"%.63s\" without the limits lower and upper, expected "
                            "them; a joint that turns for ever is \"continuous\", one that does "
                            "not move \"fixed\"",
                            joint->name);
    }
    if (joint->lower > joint->upper) {
        return import_error(r->error, joint->file, joint->line,
                            "found joint \"%.63s\" with lower limit %g above its upper limit %g, "
                            "expected it below",
                            joint->name, joint->lower, joint->upper);
    }

    /* Equal limits leave no motion; limits that exclude 0 move the rest position */
    if (joint->lower == joint->upper) {
        simplify_fix_joint(r, j, joint->lower, "both limits are there");
    } else if ((joint->lower > 0.0 || joint->upper < 0.0) && !simplify_is_coupled(r, j)) {
        import_note_add(r->notes, IMPORT_CHANGED, joint->file, joint->line,
                        "joint \"%.63s\" rests at %g: its limits %g to %g exclude 0", joint->name,
                        simplify_rest(r, j), joint->lower, joint->upper);
    }
    return ERROR_NONE;
}

/* Fixes a prismatic joint, which has no drive and would fall to its stop, or lets it slide freely
 * by option. */
static void simplify_fix_slide(struct simplifier *r, size_t j)
{
    const struct import_joint *joint = &r->model->joint[j];

    if (joint->type != IMPORT_PRISMATIC || r->out->fixed[j] || simplify_is_coupled(r, j)) {
        return;
    }
    if (r->options->free_slides) {
        import_note_add(r->notes, IMPORT_CHANGED, joint->file, joint->line,
                        "prismatic joint \"%.63s\" has no drive, for drives turn: it slides freely "
                        "(--prismatic free)",
                        joint->name);
        return;
    }
    simplify_fix_joint(r, j, simplify_rest(r, j),
                       "it slides, and drives turn; --prismatic free lets it slide without one");
}

/* Refuses planar joints, and floating ones except the base's. */
static enum error_code simplify_check_free(struct simplifier *r, const struct import_joint *joint)
{
    if (joint->type == IMPORT_PLANAR) {
        return import_error(r->error, joint->file, joint->line,
                            "found planar joint \"%.63s\", expected another type: write two "
                            "prismatic joints and a continuous one, or fix it (type \"fixed\")",
                            joint->name);
    }
    if (joint->type == IMPORT_FLOATING && (!r->floats || joint->child_link != r->root)) {
        return import_error(
            r->error, joint->file, joint->line,
            "found floating joint \"%.63s\" between two bodies, expected it between "
            "a root without mass and the base: nothing but the base floats",
            joint->name);
    }
    return ERROR_NONE;
}

/* Fixes joints without mass behind them, because their motion has no equation. */
static enum error_code simplify_fix_massless(struct simplifier *r)
{
    const struct import_model *model = r->model;
    double *mass = arena_alloc(r->arena, model->nlink, sizeof *mass);

    if (!mass) {
        return simplify_no_memory(r);
    }

    /* Children first, so that each link's mass is complete when it is added to its parent */
    for (size_t i = r->norder; i-- > 0;) {
        int link = r->order[i], above = r->above[link];

        mass[link] += model->link[link].inertia.mass;
        if (i == 0) {
            continue;
        }
        mass[model->joint[above].parent_link] += mass[link];
        if (mass[link] == 0.0 && !r->out->fixed[above] &&
            model->joint[above].type != IMPORT_FIXED) {
            simplify_fix_joint(r, (size_t)above, simplify_follow(r, (size_t)above),
                               "nothing that it moves has mass");
        }
    }
    return ERROR_NONE;
}

/* Fixes the joints that --lock names. */
static enum error_code simplify_fix_named(struct simplifier *r)
{
    const struct import_model *model = r->model;

    for (size_t i = 0; i < r->options->nlock; i++) {
        int j = import_find_joint(model, r->options->lock[i]);

        if (j < 0) {
            return error_set(r->error, ERROR_INPUT,
                             "--lock: found \"%.63s\", expected a joint of %.200s",
                             r->options->lock[i], model->file);
        }
        if (!r->out->fixed[j] && model->joint[j].type != IMPORT_FIXED) {
            simplify_fix_joint(r, (size_t)j, simplify_rest(r, (size_t)j), "--lock says so");
        }
    }
    return ERROR_NONE;
}

/* Refuses more moving joints than a rig supports. */
static enum error_code simplify_check_count(struct simplifier *r)
{
    const struct import_model *model = r->model;
    size_t count = 0;

    for (size_t j = 0; j < model->njoint; j++) {
        const struct import_joint *joint = &model->joint[j];

        if (!r->out->fixed[j] && joint->type != IMPORT_FIXED && joint->type != IMPORT_FLOATING &&
            ++count > RIG_JOINTS_MAX) {
            return import_error(r->error, joint->file, joint->line,
                                "found joint \"%.63s\", which is one more than the %d that may "
                                "move, expected fewer: --lock JOINT fixes what need not move, such "
                                "as fingers",
                                joint->name, RIG_JOINTS_MAX);
        }
    }
    return ERROR_NONE;
}

enum error_code simplify_fix_joints(struct simplifier *r)
{
    const struct import_model *model = r->model;
    enum error_code code = simplify_find_followers(r);

    /* Limits and --lock fix joints first; followers are decided when the moving leaders are
     * known */
    for (size_t j = 0; j < model->njoint && !code; j++) {
        if ((code = simplify_check_free(r, &model->joint[j])) ||
            (code = simplify_check_limit(r, j))) {
            return code;
        }
        simplify_fix_slide(r, j);
    }
    if (code || (code = simplify_fix_named(r)) || (code = simplify_narrow_leaders(r)) ||
        (code = simplify_fix_massless(r)) || (code = simplify_settle_followers(r))) {
        return code;
    }
    return simplify_check_count(r);
}
