/* SPDX-License-Identifier: Apache-2.0 */
/* Wraps a generated module as struct dynamics_ops. */
#include "model/symbolic/symbolic.h"

#include "base/instruction_set.h"
#include "model/symbolic/tree.h"

#include <inttypes.h>
#include <string.h>

_Static_assert(sizeof(struct wrench) == 6 * sizeof(double), "a wrench is 6 numbers");
_Static_assert(sizeof(struct body_motion) == 18 * sizeof(double), "a motion is 18 numbers");
_Static_assert(sizeof(struct added_inertia) == 21 * sizeof(double),
               "an added inertia is 21 numbers");
_Static_assert(sizeof(struct body_acceleration) == 6 * sizeof(double),
               "an acceleration is 6 numbers");

/* Working memory of struct dynamics: the module, the robot's mass properties if they are inputs,
 * and the pose of the last kinematics call. */
struct generated {
    const struct dynamics_module *module;
    const double *inertia;
    double *pose;
};

static void generated_forward(const struct dynamics *d, const double *q, const double *v,
                              const double *tau, const struct wrench *ext, double *vdot)
{
    const struct generated *g = d->work;

    g->module->forward(g->inertia, q, v, tau, (const double *)ext, vdot);
}

static void generated_implicit(const struct dynamics *d, const double *q, const double *v,
                               const double *tau, const struct wrench *ext, const double *extra,
                               const struct added_inertia *added, double *vdot)
{
    const struct generated *g = d->work;

    g->module->implicit(g->inertia, q, v, tau, ext->force, extra, added->A, vdot);
}

static void generated_inverse(const struct dynamics *d, const double *q, const double *v,
                              const double *vdot, const struct wrench *ext, double *f)
{
    const struct generated *g = d->work;

    g->module->inverse(g->inertia, q, v, vdot, (const double *)ext, f);
}

static void generated_kinematics(const struct dynamics *d, const double *q, const double *v,
                                 struct body_motion *motion)
{
    const struct generated *g = d->work;

    g->module->kinematics(q, v, g->pose, (double *)motion);
}

static void generated_velocities(const struct dynamics *d, const double *q, const double *v,
                                 struct body_motion *motion)
{
    const struct generated *g = d->work;

    (void)q;
    g->module->velocities(v, g->pose, (double *)motion);
}

static void generated_acceleration(const struct dynamics *d, const double *q, const double *v,
                                   const double *vdot, struct body_acceleration *acceleration)
{
    const struct generated *g = d->work;

    (void)q;
    g->module->acceleration(v, vdot, g->pose, (double *)acceleration);
}

static void generated_energy(const struct dynamics *d, const double *q, const double *v,
                             double *kinetic, double *potential)
{
    const struct generated *g = d->work;
    double energy[2];

    g->module->energy(g->inertia, q, v, energy);
    *kinetic = energy[0];
    *potential = energy[1];
}

static const struct dynamics_ops generated_ops = {
    .name = "generated",
    .forward = generated_forward,
    .implicit = generated_implicit,
    .inverse = generated_inverse,
    .kinematics = generated_kinematics,
    .velocities = generated_velocities,
    .acceleration = generated_acceleration,
    .energy = generated_energy,
};

const struct dynamics_module *dynamics_module_used(const struct dynamics_module *module)
{
    for (; module->plainer; module = module->plainer) {
        for (enum instruction_set set = INSTRUCTIONS_PLAIN; set <= instruction_set_used(); set++) {
            if (strcmp(module->variant, instruction_set_names[set]) == 0) {
                return module;
            }
        }
    }
    return module;
}

bool dynamics_module_fits(const struct dynamics_module *module, const struct robot *robot)
{
    return module->ninertia ? module->massless_hash == robot->massless_hash
                            : module->robot_hash == robot->hash;
}

/* Computes the robot's mass properties in the module's frames. These frames depend only on the
 * geometry, so this function computes them again. */
static enum error_code bind_inertia(const struct robot *robot, struct arena *arena,
                                    struct generated *generated, struct error *error)
{
    const struct dynamics_module *module = generated->module;
    double *inertia = arena_alloc(arena, module->ninertia, sizeof *inertia);
    enum error_code code;
    struct tree tree;

    if (!inertia) {
        return error_set(error, ERROR_MEMORY, "no memory for the mass properties of %s",
                         robot->name);
    }
    if ((code = tree_create(robot, (int)module->lanes, &tree, error))) {
        return code;
    }

    /* Fill the ninertia numbers with the mass properties. Each lane has its own numbers; gaps are
     * zero */
    memset(inertia, 0, tree.ninertia * sizeof *inertia);
    for (size_t g = 0; g < tree.ngroup; g++) {
        const struct tree_group *group = &tree.group[g];

        for (int p = 0; p < TREE_INERTIA; p++) {
            for (int l = 0; group->place[p] >= 0 && l < group->width; l++) {
                inertia[group->place[p] + l] = tree_inertia(&tree.body[group->body[l]], p);
            }
        }
    }
    generated->inertia = inertia;
    tree_destroy(&tree);
    return ERROR_NONE;
}

enum error_code dynamics_generated(const struct robot *robot, const struct dynamics_module *module,
                                   struct arena *arena, struct dynamics *out, struct error *error)
{
    struct generated *work;
    enum error_code code;

    if (!dynamics_module_fits(module, robot) || module->nv != robot->nv ||
        module->nbody != robot->nbody) {
        return error_set(error, ERROR_UNSUPPORTED,
                         "the generated module of %s (hash %016" PRIx64
                         ") was made from another robot than %s (hash %016" PRIx64 ")%s",
                         module->robot, module->robot_hash, robot->name, robot->hash,
                         module->ninertia ? ", not only with other masses" : "");
    }
    work = arena_alloc(arena, 1, sizeof *work);
    if (!work || !(work->pose = arena_alloc(arena, module->npose, sizeof *work->pose))) {
        return error_set(error, ERROR_MEMORY, "no memory for the generated dynamics");
    }
    work->module = module;
    if (module->ninertia && (code = bind_inertia(robot, arena, work, error))) {
        return code;
    }
    *out = (struct dynamics){.ops = &generated_ops, .robot = robot, .work = work};
    return ERROR_NONE;
}
