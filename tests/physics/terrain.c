/* SPDX-License-Identifier: Apache-2.0 */
/*
 * COMAN on the ground of the walk-* rigs: where the mesh is level it carries as a half-space does.
 * (A foot on the bump: contact_terrain.c.)
 */

#include "base/vec3.h"
#include "tests/physics/near.h"
#include "tests/physics/rig_scene.h"

enum { FEET = 2, SECOND = 1000 };

/* What the ground does to a foot: force (N) and center of pressure (m), from all its patches. */
struct foot_load {
    double force[3], cop[3], depth;
};

static void find_load(const struct rig_scene *scene, int foot, struct foot_load *load)
{
    static struct contact_patch patch[64];
    const char *name = foot ? "left_foot" : "right_foot";
    size_t n = plant_patches(scene->plant, patch, 64);

    *load = (struct foot_load){.depth = 0};
    for (size_t i = 0; i < n; i++) {
        const struct contact_pair *pair = &scene->rig->contact.pair[patch[i].pair];
        bool first = strcmp(scene->rig->contact.surface[pair->a].name, name) == 0;

        if (!first && strcmp(scene->rig->contact.surface[pair->b].name, name) != 0) {
            continue;
        }
        vec3_add_scaled(load->force, first ? -1 : 1, patch[i].force, load->force);
        memcpy(load->cop, patch[i].center, sizeof load->cop);
        load->depth = patch[i].penetration_m;
    }
}

/* Force on both feet and gravity: what is left over, N. */
static double imbalance(const struct rig_scene *scene)
{
    double sum[3] = {0, 0, 0};

    for (int f = 0; f < FEET; f++) {
        struct foot_load load;

        find_load(scene, f, &load);
        vec3_add_scaled(sum, 1, load.force, sum);
    }
    vec3_add_scaled(sum, scene->robot->total_mass, scene->robot->gravity, sum);
    return vec3_norm(sum);
}

/* The level plate before bump and ramp is the half-space, foot by foot: its depth is exact but near
 * points where sides of more than three directions meet (contact/mesh/field.h). */
TEST(level_mesh_carries_as_a_half_space)
{
    static const char *const files[] = {"walk-flat.yaml", "walk-bump-3cm.yaml",
                                        "walk-bump-9cm.yaml", "walk-slope.yaml"};
    struct foot_load load[4][FEET];

    for (int r = 0; r < 4; r++) {
        static struct rig_scene scene;

        const struct rig_scene_choice choice = {
            .file = files[r], .integrator = PLANT_IMPLICIT, .substep_ns = 1000000};

        rig_scene_init(&scene, &choice);
        rig_scene_settle(&scene);
        for (int k = 0; k < SECOND / 4; k++) {
            rig_scene_hold(&scene);
        }
        assert_true(imbalance(&scene) < 1e-6);
        for (int f = 0; f < FEET; f++) {
            find_load(&scene, f, &load[r][f]);
            print_message("# %s: %.4f N at %.3f %.3f mm, %.4f mm deep\n", files[r],
                          load[r][f].force[2], 1e3 * load[r][f].cop[0], 1e3 * load[r][f].cop[1],
                          1e3 * load[r][f].depth);
            assert_near(load[r][f].force[2], load[0][f].force[2], 1e-4 * load[0][f].force[2]);
            assert_near(load[r][f].cop[0], load[0][f].cop[0], 0.2e-3);
            assert_near(load[r][f].cop[1], load[0][f].cop[1], 0.2e-3);
            assert_near(load[r][f].depth, load[0][f].depth, 0.01 * load[0][f].depth);
        }
        rig_scene_fini(&scene);
    }
}
