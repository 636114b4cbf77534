/* SPDX-License-Identifier: Apache-2.0 */
/* A generated module behind struct dynamics_ops. */
#include "model/symbolic/symbolic.h"

#include "base/instruction_set.h"

#include <inttypes.h>
#include <string.h>

_Static_assert(sizeof(struct wrench) == 6 * sizeof(double), "a wrench is 6 numbers");
_Static_assert(sizeof(struct body_motion) == 18 * sizeof(double), "a motion is 18 numbers");
_Static_assert(sizeof(struct added_inertia) == 21 * sizeof(double),
               "an added inertia is 21 numbers");
_Static_assert(sizeof(struct body_acceleration) == 6 * sizeof(double),
               "an acceleration is 6 numbers");

static const struct dynamics_module *module_of(const struct dynamics *d)
{
    return *(const struct dynamics_module *const *)d->work;
}

static void generated_forward(const struct dynamics *d, const double *q, const double *v,
                              const double *tau, const struct wrench *ext, double *vdot)
{
    module_of(d)->forward(q, v, tau, (const double *)ext, vdot);
}

static void generated_implicit(const struct dynamics *d, const double *q, const double *v,
                               const double *tau, const struct wrench *ext, const double *extra,
                               const struct added_inertia *added, double *vdot)
{
    module_of(d)->implicit(q, v, tau, ext->force, extra, added->A, vdot);
}

static void generated_inverse(const struct dynamics *d, const double *q, const double *v,
                              const double *vdot, const struct wrench *ext, double *f)
{
    module_of(d)->inverse(q, v, vdot, (const double *)ext, f);
}

static void generated_kinematics(const struct dynamics *d, const double *q, const double *v,
                                 struct body_motion *motion)
{
    module_of(d)->kinematics(q, v, (double *)motion);
}

static void generated_acceleration(const struct dynamics *d, const double *q, const double *v,
                                   const double *vdot, struct body_acceleration *acceleration)
{
    module_of(d)->acceleration(q, v, vdot, (double *)acceleration);
}

static void generated_energy(const struct dynamics *d, const double *q, const double *v,
                             double *kinetic, double *potential)
{
    double energy[2];

    module_of(d)->energy(q, v, energy);
    *kinetic = energy[0];
    *potential = energy[1];
}

static const struct dynamics_ops generated_ops = {
    .name = "generated",
    .forward = generated_forward,
    .implicit = generated_implicit,
    .inverse = generated_inverse,
    .kinematics = generated_kinematics,
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

enum error_code dynamics_generated(const struct robot *robot, const struct dynamics_module *module,
                                   struct arena *arena, struct dynamics *out, struct error *error)
{
    const struct dynamics_module **work;

    if (module->abi != DYNAMICS_MODULE_ABI) {
        return error_set(error, ERROR_UNSUPPORTED,
                         "the generated module has interface %" PRIu32 ", expected %d", module->abi,
                         DYNAMICS_MODULE_ABI);
    }
    if (module->robot_hash != robot->hash || module->nv != robot->nv ||
        module->nbody != robot->nbody) {
        return error_set(error, ERROR_UNSUPPORTED,
                         "the generated module of %s (hash %016" PRIx64
                         ") was made from another robot than %s (hash %016" PRIx64 ")",
                         module->robot, module->robot_hash, robot->name, robot->hash);
    }
    work = arena_alloc(arena, 1, sizeof *work);
    if (!work) {
        return error_set(error, ERROR_MEMORY, "no memory for the generated dynamics");
    }
    *work = module;
    *out = (struct dynamics){.ops = &generated_ops, .robot = robot, .work = work};
    return ERROR_NONE;
}
