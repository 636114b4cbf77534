/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A hundred thousand impacts of bodies thrown at random: none may leave with more energy than it
 * came with. Each throw begins where the body is about to touch and ends as soon as it has left, so
 * that all the time is spent in contact.
 */

#include "tests/physics/contact_bodies.h"
#include "tests/physics/near.h"

#define RADIUS 0.05
#define HALF 0.075 /* of the cubes */

/* What is thrown at what. */
struct game {
    const char *name;
    void (*build)(struct scene *scene, const struct contact_material *material);
    void (*aim)(struct body_motion *motion, uint64_t *seed);
    double mass, inertia, step;
    int throws;
};

static void cube_at_half_space(struct scene *scene, const struct contact_material *material)
{
    cube_on_ground(scene, false, material);
}

static void cube_at_table(struct scene *scene, const struct contact_material *material)
{
    cube_on_ground(scene, true, material);
}

static void sphere_at_half_space(struct scene *scene, const struct contact_material *material)
{
    scene_init(scene, 1);
    scene_add(scene, -1, CONTACT_HALF_SPACE, material);
    scene_add(scene, 0, CONTACT_SPHERE, material)->radius_m = RADIUS;
    scene_add_pair(scene, 0, 1);
}

static void sphere_at_box(struct scene *scene, const struct contact_material *material)
{
    scene_init(scene, 1);
    scene_add_box(scene, -1, HALF, HALF, HALF, 7, material);
    scene_add(scene, 0, CONTACT_SPHERE, material)->radius_m = RADIUS;
    scene_add_pair(scene, 0, 1);
}

static void give_velocity(struct body_motion *m, uint64_t *seed)
{
    for (int i = 0; i < 3; i++) {
        m->w[i] = 3 * random_number(seed);
        m->v[i] = 0.3 * random_number(seed) - (i == 2 ? 0.4 : 0);
    }
}

static void aim_cube(struct body_motion *m, uint64_t *seed)
{
    scene_place(m, 0.1 * random_number(seed), 0.1 * random_number(seed), 0);
    scene_random_rotation(seed, 3.2, m->R);
    m->p[2] = HALF * (fabs(m->R[6]) + fabs(m->R[7]) + fabs(m->R[8])) + 1e-6;
    give_velocity(m, seed);
}

static void aim_sphere(struct body_motion *m, uint64_t *seed)
{
    scene_place(m, 0.1 * random_number(seed), 0.1 * random_number(seed), RADIUS + 1e-6);
    give_velocity(m, seed);
}

/* From any side at faces, edges and corners: flies on in a straight line until it almost
 * touches. */
static void aim_sphere_at_box(struct body_motion *m, uint64_t *seed)
{
    double from[3], to[3], way[3], apart = 1;

    for (int i = 0; i < 3; i++) {
        from[i] = random_number(seed);
        to[i] = 0.9 * HALF * random_number(seed);
    }
    for (int i = 0; i < 3; i++) {
        from[i] *= 0.3 / vec3_norm(from);
    }
    for (int i = 0; i < 3; i++) {
        way[i] = to[i] - from[i];
    }
    scene_place(m, from[0], from[1], from[2]);
    for (int n = 0; n < 100 && apart > 1e-6; n++) {
        double out[3];

        for (int i = 0; i < 3; i++) {
            out[i] = fmax(fabs(m->p[i]) - HALF, 0);
        }
        apart = vec3_norm(out) - RADIUS;
        for (int i = 0; i < 3; i++) {
            m->p[i] += fmax(apart, 0) * way[i] / vec3_norm(way);
        }
    }
    for (int i = 0; i < 3; i++) {
        m->w[i] = 3 * random_number(seed);
        m->v[i] = 0.5 * way[i] / vec3_norm(way) + 0.1 * random_number(seed);
    }
}

/* Follows a throw until the body flies off. Returns the energy that it has then over what it had.
 */
static double throw(struct bodies * b, const struct game *game, uint64_t *seed)
{
    bool touched = false;
    double before;

    game->aim(&b->motion[0], seed);
    before = kinetic(b);
    for (int n = 0; n < 4000; n++) {
        size_t patches;

        step(b, game->step);
        patches = b->world->ops->patches(b->world, NULL, 0);
        if (patches == 0 && (touched || n > 16)) {
            break;
        }
        touched = touched || patches > 0;
    }
    return (kinetic(b) + stored(b)) / before;
}

static struct bodies begin(const struct game *game, const struct contact_material *material)
{
    struct scene scene;
    struct bodies b;

    game->build(&scene, material);
    b = make(&scene, game->mass);
    b.inertia[0] = game->inertia;
    return b;
}

#define CUBE 1.5, 1.5 * 4 * HALF *HALF / 6
#define BALL 0.2, 0.2 * 0.4 * RADIUS *RADIUS

TEST(no_impact_gains_energy)
{
    static const struct game games[] = {
        {"sphere at half-space", sphere_at_half_space, aim_sphere, BALL, 1e-3, 82000},
        {"sphere at box", sphere_at_box, aim_sphere_at_box, BALL, 1e-3, 16000},
        {"cube at half-space", cube_at_half_space, aim_cube, CUBE, 5e-4, 1500},
        {"cube at table", cube_at_table, aim_cube, CUBE, 5e-4, 500},
    };
    uint64_t seed = 17;
    int throws = 0;

    for (size_t g = 0; g < sizeof games / sizeof *games; g++) {
        struct bodies b = begin(&games[g], &plain);
        double most = 0, mean = 0;

        for (int i = 0; i < games[g].throws; ++i, ++throws) {
            double ratio = throw(&b, &games[g], &seed);

            most = fmax(most, ratio);
            mean += ratio / games[g].throws;
        }
        print_message("%s: energy after over before, mean %.3f, largest 1%+.1e\n", games[g].name,
                      mean, most - 1);
        /* Those that lift off before they touch keep all of it */
        assert_true(most < 1 + 1e-9 && mean < 0.95);
    }
    assert_int_equal(throws, 100000);
}

TEST(without_loss_an_impact_keeps_its_energy)
{
    static const struct contact_material lossless = {1e6, 1, 0, 0, 0, 0, 0};
    static const struct game games[] = {
        {"sphere at half-space", sphere_at_half_space, aim_sphere, BALL, 2e-4, 300},
        {"cube at half-space", cube_at_half_space, aim_cube, CUBE, 2.5e-4, 200},
    };
    uint64_t seed = 23;

    for (size_t g = 0; g < sizeof games / sizeof *games; g++) {
        struct bodies b = begin(&games[g], &lossless);

        for (int i = 0; i < games[g].throws; i++) {
            assert_near(throw(&b, &games[g], &seed), 1, 1e-3);
        }
    }
}

TEST_GROUP(set_up, tear_down)
