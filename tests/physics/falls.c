/* SPDX-License-Identifier: Apache-2.0 */
/*
 * COMAN and WALK-MAN without power, dropped in random poses: they come to lie on the ground with no
 * part in it or in another, their joints within 0.02 rad of the limits, and what they have stored
 * never grows. HIL_FALLS says how many falls of
 * COMAN there are (48 unless given, 1,000 at a release; of WALK-MAN, and of each kind of COMAN's
 * hard falls, an eighth), HIL_FALL the first one.
 */

#include "model/stop.h"
#include "tests/physics/near.h"
#include "tests/physics/rig_scene.h"
#include "tests/unit/contact/random_number.h"

enum { FALLS = 48, FALL_MS = 2000, REST_MS = 200, PATCHES = 96 };

/* Falls in which friction once stored more than it had taken: bristles that yield or turn at an
 * impact, or that lift and touch again. */
static const uint64_t hard[] = {143, 227, 270, 274, 309};

/* Falls of WALK-MAN in which rotors come fast to the stops of their springs, which once made up to
 * 0.9 J. */
static const uint64_t struck[] = {9, 71, 87};

static const struct rig_scene_choice coman = {
    .file = "coman.yaml", .integrator = PLANT_IMPLICIT, .substep_ns = 1000000};
static const struct rig_scene_choice coman_on_slope = {.file = "coman.yaml",
                                                       .integrator = PLANT_IMPLICIT,
                                                       .substep_ns = 1000000,
                                                       .slope_rad = 0.17453292519943295};
static const struct rig_scene_choice coman_on_bump = {
    .file = "walk-bump-9cm.yaml", .integrator = PLANT_IMPLICIT, .substep_ns = 1000000};
static const struct rig_scene_choice walkman = {
    .file = "walkman.yaml", .integrator = PLANT_IMPLICIT, .substep_ns = 1000000};

/* How robots are dropped: their capsules over the ground, m; speed and rate of each component, m/s
 * and rad/s. */
struct drop {
    double low, high;
    double speed, rate;
};
static const struct drop from_low = {0.04, 0.2, 1, 1}, from_high = {0.8, 0.8, 2, 6};

/* What a fall was like. */
struct fall {
    double deepest, lying;   /* of any capsule in the ground, at any time and at the end, m */
    double foot;             /* of the feet's meshes, at the end, m */
    double own;              /* of one part of the robot in another, at any time, m */
    double past;             /* of any joint past its limit, rad */
    double growth;           /* of what is stored, within a millisecond, J */
    double beyond;           /* the same beyond what pressure fields may not have told, J */
    const char *what;        /* was deepest */
    const char *one, *other; /* of its own */
};

/* How far the lowest point of a capsule would be below the ground with the base at height 0. */
static double lowest_of(const struct rig_scene *scene, const struct body_motion *body)
{
    double lowest = 1e9;

    for (size_t c = 0; c < scene->robot->ncapsule; c++) {
        const struct robot_capsule *capsule = &scene->robot->capsule[c];
        const double z[3] = {capsule->rotation[2], capsule->rotation[5], capsule->rotation[8]};
        const double *R = body[capsule->body].R;
        double middle = body[capsule->body].p[2] + vec3_dot(R + 6, capsule->position);

        lowest =
            fmin(lowest, middle - capsule->length / 2 * fabs(vec3_dot(R + 6, z)) - capsule->radius);
    }
    return lowest;
}

static void turn_at_random(uint64_t *seed, double quaternion[4])
{
    double size = 0;

    for (int i = 0; i < 4; i++) {
        quaternion[i] = random_number(seed) + (i == 0) * 0.5;
        size += quaternion[i] * quaternion[i];
    }
    for (int i = 0; i < 4; i++) {
        quaternion[i] /= sqrt(size);
    }
}

/* Every joint somewhere within the middle part of its range, the base turned at random over the
 * ground, whose highest place is at top, with some speed. */
static void place_at_random(struct rig_scene *scene, const struct drop *drop, double top,
                            uint64_t *seed)
{
    const struct robot *robot = scene->robot;
    double joint[RIG_SCENE_JOINTS], position[3] = {0, 0, 0}, quaternion[4], *state;
    double middle_height = (drop->low + drop->high) / 2;
    struct body_motion body[64];
    size_t count;

    for (size_t j = 0; j < robot->njoint; j++) {
        double middle = (robot->joint[j].lower + robot->joint[j].upper) / 2;

        joint[j] = middle + 0.6 * random_number(seed) * (robot->joint[j].upper - middle);
    }
    turn_at_random(seed, quaternion);
    robot_place_bodies(robot, position, quaternion, joint, body);
    position[0] = top > 0 ? 1.3 : 0; /* the bump's middle */
    position[2] = top + middle_height - lowest_of(scene, body) +
                  (drop->high - middle_height) * random_number(seed);
    assert_ok(plant_reset(scene->plant, position, quaternion, joint));
    state = plant_state(scene->plant, &count);
    for (size_t i = 0; i < 6; i++) {
        state[robot->nq + i] = (i < 3 ? drop->speed : drop->rate) * random_number(seed);
    }
    assert_ok(plant_restart_energy(scene->plant));
}

/* Whether surfaces meet in the pressure field of a mesh: of what it stores, which is less than its
 * force times its depth, only a part is told (docs/contact.md). */
static bool have_field(const struct contact_surface *a, const struct contact_surface *b)
{
    return (a->shape == CONTACT_MESH || b->shape == CONTACT_MESH) &&
           a->shape != CONTACT_HALF_SPACE && b->shape != CONTACT_HALF_SPACE;
}

/* The deepest of the patches on the ground (surface 0), and of the robot's own. Returns the most
 * that pressure fields store, J. */
static double note_patches(const struct rig_scene *scene, int ms, struct fall *fall)
{
    const struct contact_config *contact = &scene->rig->contact;
    struct contact_patch patch[PATCHES];
    size_t count = plant_patches(scene->plant, patch, PATCHES);
    double stored = 0;

    assert_true(count <= PATCHES);
    for (size_t i = 0; i < count; i++) {
        const struct contact_pair *pair = &contact->pair[patch[i].pair];
        double depth = patch[i].penetration_m;

        if (have_field(&contact->surface[pair->a], &contact->surface[pair->b])) {
            stored += sqrt(vec3_dot(patch[i].force, patch[i].force)) * depth;
        }
        if (pair->a != 0 && pair->b != 0) {
            if (depth > fall->own) {
                fall->own = depth;
                fall->one = contact->surface[pair->a].name;
                fall->other = contact->surface[pair->b].name;
            }
            continue;
        }
        if (contact->surface[pair->a + pair->b].shape != CONTACT_CAPSULE) {
            fall->foot = ms >= FALL_MS - REST_MS ? fmax(fall->foot, depth) : 0;
            continue;
        }
        if (depth > fall->deepest) {
            fall->deepest = depth;
            fall->what = contact->surface[pair->a + pair->b].name;
        }
        if (ms >= FALL_MS - REST_MS) {
            fall->lying = fmax(fall->lying, depth);
        }
    }
    return stored;
}

static struct fall run_fall(struct rig_scene *scene, const struct drop *drop, double top,
                            uint64_t seed)
{
    struct fall fall = {.what = "nothing", .one = "nothing", .other = "nothing"};
    struct plant_energy energy;
    double before = 0, fields_before = 0;

    /* A place where nothing touches */
    for (int i = 0; i < 10; i++) {
        random_number(&seed);
    }
    do {
        place_at_random(scene, drop, top, &seed);
    } while (plant_patches(scene->plant, NULL, 0) > 0);
    for (int ms = 0; ms < FALL_MS; ms++) {
        enum error_code code = plant_step(scene->plant, scene->steps);
        double fields;

        if (code) {
            fail_msg("fall %llu, %d ms: %s", (unsigned long long)seed, ms,
                     plant_failure(scene->plant));
        }
        assert_ok(plant_energy(scene->plant, &energy));
        if (!isfinite(energy.stored)) {
            fail_msg("fall %llu, %d ms: the energy is not finite", (unsigned long long)seed, ms);
        }
        fields = note_patches(scene, ms, &fall);
        size_t count;
        const struct robot *robot = scene->robot;
        const double *q = plant_state(scene->plant, &count) + robot->nq - robot->njoint;

        for (size_t j = 0; j < robot->njoint; j++) {
            const struct robot_joint *joint = &robot->joint[j];

            fall.past = fmax(fall.past, fabs(stop_depth(joint->lower, joint->upper, q[j])));
        }
        if (ms > 0) {
            fall.growth = fmax(fall.growth, energy.stored - before);
            fall.beyond = fmax(fall.beyond, energy.stored - before - fmax(fields, fields_before));
        }
        before = energy.stored;
        fields_before = fields;
    }
    return fall;
}

static long long from_environment(const char *name, long long otherwise)
{
    const char *given = getenv(name);

    return given ? atoll(given) : otherwise;
}

/* The worst of count falls. */
static struct fall run_falls(const struct rig_scene_choice *choice, const struct drop *drop,
                             double top, long long count)
{
    static struct rig_scene scene;
    const long long first = from_environment("HIL_FALL", 1);
    struct fall worst = {.what = "nothing"};

    rig_scene_init(&scene, choice);
    for (long long seed = first; seed < first + count; seed++) {
        struct fall fall = run_fall(&scene, drop, top, (uint64_t)seed);

        if (fall.deepest > worst.deepest || fall.growth > worst.growth || fall.own > worst.own ||
            fall.lying > worst.lying || fall.foot > worst.foot) {
            print_message(
                "# fall %lld: %.2f mm deep at worst (%s), %.2f mm at rest (foot %.2f mm), "
                "own %.2f mm (%s in %s), stored grows by %.3g J at most\n",
                seed, 1e3 * fall.deepest, fall.what, 1e3 * fall.lying, 1e3 * fall.foot,
                1e3 * fall.own, fall.one, fall.other, fall.growth);
        }
        worst.own = fmax(worst.own, fall.own);
        worst.deepest = fmax(worst.deepest, fall.deepest);
        worst.lying = fmax(worst.lying, fall.lying);
        worst.foot = fmax(worst.foot, fall.foot);
        worst.growth = fmax(worst.growth, fall.growth);
        worst.beyond = fmax(worst.beyond, fall.beyond);
        worst.past = fmax(worst.past, fall.past);
    }
    print_message("# %lld falls: %.2f mm deep at worst, %.2f mm at rest (corners of the feet %.2f "
                  "mm), %.2f mm in itself, stored grew by %.3g J in a millisecond at most, by %.3g "
                  "J beyond pressure fields, %.4f rad past a limit\n",
                  count, 1e3 * worst.deepest, 1e3 * worst.lying, 1e3 * worst.foot, 1e3 * worst.own,
                  worst.growth, worst.beyond, worst.past);
    rig_scene_fini(&scene);
    assert_true(worst.past > 0 && worst.past < 0.02);
    return worst;
}

TEST(coman_comes_to_lie_on_the_ground)
{
    struct fall worst = run_falls(&coman, &from_low, 0, from_environment("HIL_FALLS", FALLS));

    assert_true(worst.lying < 2.5e-3);
    assert_true(worst.deepest < 5e-3);
    assert_true(worst.foot < 5e-3);
    assert_true(worst.own < 5e-3);
    /* What a step of 1 ms errs by at an impact may show in a few of many falls */
    assert_true(worst.beyond < 1e-3);
}

TEST(coman_lies_at_rest_for_a_minute)
{
    static struct rig_scene scene;
    const long long seed = from_environment("HIL_FALL", 1);
    const double *state;
    size_t count;

    rig_scene_init(&scene, &coman);
    run_fall(&scene, &from_low, 0, (uint64_t)seed);
    /* The residual of the contact solver consists of rounding errors and must not grow */
    for (int ms = 0; ms < 60000; ms++) {
        enum error_code code = plant_step(scene.plant, scene.steps);

        if (code) {
            fail_msg("fall %lld, %d ms at rest: %s", seed, ms, plant_failure(scene.plant));
        }
    }
    state = plant_state(scene.plant, &count) + scene.robot->nq;
    for (size_t i = 0; i < scene.robot->nv; i++) {
        assert_true(fabs(state[i]) < 1e-6);
    }
    rig_scene_fini(&scene);
}

static void coman_falls_hard(const struct rig_scene_choice *choice, double top)
{
    struct fall worst =
        run_falls(choice, &from_high, top, from_environment("HIL_FALLS", FALLS) / 8);

    assert_true(worst.deepest < 5e-3);
    assert_true(worst.lying < 5e-3);
    assert_true(worst.foot < 5e-3);
    assert_true(worst.own < 5e-3);
    assert_true(worst.beyond < 1e-3);
}

TEST(coman_falls_hard_on_flat_ground)
{
    coman_falls_hard(&coman, 0);
}

TEST(coman_falls_hard_on_a_slope)
{
    coman_falls_hard(&coman_on_slope, 0);
}

TEST(coman_falls_hard_on_a_bump)
{
    coman_falls_hard(&coman_on_bump, 0.09);
}

CLOSED_BENCH(rig_scene, struct rig_scene, rig_scene_fini)

TEST_ON(friction_stores_no_more_than_it_takes, rig_scene, scene)
{
    rig_scene_init(scene, &coman);
    for (size_t i = 0; i < sizeof hard / sizeof hard[0]; i++) {
        struct fall fall = run_fall(scene, &from_low, 0, hard[i]);

        print_message("# fall %llu: stored grows by %.3g J at most\n", (unsigned long long)hard[i],
                      fall.growth);
        assert_true(fall.growth < 1e-4);
    }
}

TEST_ON(rotors_gain_nothing_at_the_stops_of_their_springs, rig_scene, scene)
{
    rig_scene_init(scene, &walkman);
    for (size_t i = 0; i < sizeof struck / sizeof struck[0]; i++) {
        struct fall fall = run_fall(scene, &from_low, 0, struck[i]);

        print_message("# fall %llu: stored grows by %.3g J at most\n",
                      (unsigned long long)struck[i], fall.growth);
        assert_true(fall.growth < 1e-2);
    }
}

TEST(walkman_comes_to_lie_on_the_ground)
{
    struct fall worst = run_falls(&walkman, &from_low, 0, from_environment("HIL_FALLS", FALLS) / 8);

    /* Four times COMAN's weight on the same ground; corners of the feet carry up to 250 N */
    assert_true(worst.lying < 2.5e-3);
    assert_true(worst.deepest < 5e-3);
    assert_true(worst.foot < 5e-3);
    /* The corner of a foot in the shell of the other ankle */
    assert_true(worst.own < 1e-2);
    assert_true(worst.beyond < 1e-3);
}
