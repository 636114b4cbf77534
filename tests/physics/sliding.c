/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Bodies that slide on the native contact engine by the implicit integrator at its default step:
 * Coulomb's law holds for the impulses of every tick, and the way is the closed form's.
 */
#include "base/array.h"

#include "tests/physics/contact_scene.h"
#include "tests/physics/free_rig.h"
#include "tests/physics/near.h"

enum { SECOND = 1000, STARTS = 500, RESTING = 100 /* last ticks of a run */ };

static const double pi = 3.14159265358979323846, gravity = 9.81;

/* A body of 3 kg on a slope, 0.2 m wide; the height of a sphere or capsule is its diameter. */
struct slide {
    enum contact_shape shape;
    double height;
    double stiffness, dissipation, mu; /* of the layers in series, Pa/m; s/m */
    double slope, speed;               /* rad; m/s down the slope */
    double above;                      /* start above the equilibrium depth, m */
    bool on_mesh;                      /* the ground is a box, else a half space */
};

/* What the ground does to it in a run. */
struct slid {
    double way;     /* m */
    double excess;  /* largest mean T/(mu N) - 1 in a tick */
    double speed;   /* largest one in the last ticks, m/s */
    double chatter; /* largest change of the mean N between the last ticks, over N */
};

static double gyration2(const struct slide *s)
{
    return (0.04 + s->height * s->height) / 12;
}

static double depth_at_rest(const struct slide *s)
{
    const double push = 3 * gravity * cos(s->slope);

    const double k = s->stiffness, R = s->height / 2;

    switch (s->shape) {
    case CONTACT_SPHERE: /* Hertz, two materials of 2e-3 k */
        return pow(0.75 * push / (2e-3 * k / pow(2, 1.5) * sqrt(R)), 2.0 / 3);
    case CONTACT_CAPSULE: /* the segment of a disc below the plane, for small depths */
        return pow(0.75 * push / (k * 0.2 * sqrt(2 * R)), 2.0 / 3);
    default:
        return push / (k * 0.04);
    }
}

static void start(const struct slide *s, struct free_rig *rig)
{
    const struct contact_material material = {
        2e-3 * s->stiffness, 1e-3, s->dissipation, s->mu, s->mu, 0, 0};
    const double I = 3 * gyration2(s);
    const double along_x[9] = {0, 0, 1, 0, 1, 0, -1, 0, 0};
    struct contact_surface *surface;
    struct contact_world *world;
    struct plant_free_body *body;
    struct error error;
    struct scene scene;

    free_rig_post(rig, 1, 1000000);
    body = &rig->body[0];
    body->inertia = (struct robot_inertia){.mass = 3, .I = {I, 0, 0, I, 0, 3 * 0.08 / 12}};
    body->position[2] = s->height / 2 - depth_at_rest(s) + s->above;
    body->v[0] = s->speed;
    rig->toy.robot.gravity[0] = gravity * sin(s->slope);
    rig->toy.robot.gravity[1] = 0;
    rig->toy.robot.gravity[2] = -gravity * cos(s->slope);
    scene_init(&scene, 1);
    if (s->on_mesh) {
        surface = scene_add_box(&scene, -1, 3, 0.5, 0.5, 1, &material);
        surface->position[2] = -0.5;
    } else {
        scene_add(&scene, -1, CONTACT_HALF_SPACE, &material);
    }
    if (s->shape == CONTACT_BOX) {
        surface = scene_add_box(&scene, 0, 0.1, 0.1, s->height / 2, 7, &material);
    } else {
        surface = scene_add(&scene, 0, s->shape, &material);
        surface->radius_m = s->height / 2;
        surface->length_m = s->shape == CONTACT_CAPSULE ? 0.2 : 0;
        memcpy(surface->rotation, along_x, sizeof along_x);
    }
    scene_add_pair(&scene, 0, 1);
    scene.config.friction = CONTACT_FRICTION_STICKING;
    assert_no_error(contact_native_create(&scene.config, &rig->arena, &world, &error), error.text);
    rig->contact_body[0] = (int)rig->toy.robot.nbody;
    rig->config.contact = world;
    rig->config.ncontact = 1;
    rig->config.integrator = PLANT_IMPLICIT;
    free_rig_start(rig);
}

static struct slid run(const struct slide *s, int ticks)
{
    struct slid slid = {.excess = -1};
    struct free_rig rig;
    double from, last = 0;

    start(s, &rig);
    from = rig.free[0];
    for (int t = 0; t < ticks; t++) {
        const double *v = rig.free + PLANT_FREE_VELOCITY;
        struct contact_wrench mean;
        const double *f = mean.force;

        assert_no_error(plant_step(rig.plant, 1), plant_failure(rig.plant));
        assert_ok(plant_sample(rig.plant));
        plant_contact_mean(rig.plant, 0, &mean);
        if (f[2] > 1e-9) {
            slid.excess = fmax(slid.excess, hypot(f[0], f[1]) / (s->mu * f[2]) - 1);
        }
        if (t >= ticks - RESTING) {
            slid.speed = fmax(slid.speed, sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]));
            slid.chatter = fmax(slid.chatter, fabs(f[2] / last - 1));
        }
        last = f[2];
    }
    slid.way = rig.free[0] - from;
    free_rig_fini(&rig);
    return slid;
}

/* Way of a block in a plane in two seconds from rest, by a small constant step: its layer presses
 * with k d (1 + c d'), and its base has Coulomb friction, with bristles of five times the layer's
 * stiffness, or rigid. */
static double planar_way(const struct slide *s, bool bristles)
{
    const double h = 1e-5, m = 3, I = m * gyration2(s), shear = 5 * s->stiffness * 0.04;
    const double weight[2] = {m * gravity * sin(s->slope), -m * gravity * cos(s->slope)};
    double x = 0, z = s->height / 2 - depth_at_rest(s), angle = 0, v[2] = {0, 0}, w = 0, bent = 0;

    for (int t = 0; t < 200000; t++) {
        double N = 0, moment = 0, T, slip, least;

        for (int i = 0; i < 20; i++) {
            const double along = (2 * i - 19) / 200.0, down = s->height / 2;
            const double arm = along * cos(angle) - down * sin(angle);
            const double depth = along * sin(angle) + down * cos(angle) - z;
            const double f = s->stiffness * 0.002 * fmax(0, depth) *
                             fmax(0, 1 - s->dissipation * (v[1] - w * arm));

            N += f;
            moment -= arm * f;
        }
        slip = v[0] - w * z;
        if (bristles) {
            bent += h * slip;
            T = -shear * (bent + 0.5e-3 * slip);
            bent = fmax(-s->mu * N / shear, fmin(bent, s->mu * N / shear));
        } else {
            least = slip + h * (weight[0] / m - z * moment / I);
            T = -least / h / (1 / m + z * z / I);
        }
        T = fmax(-s->mu * N, fmin(T, s->mu * N));
        v[0] += h * (weight[0] + T) / m;
        v[1] += h * (weight[1] + N) / m;
        w += h * (moment - z * T) / I;
        x += h * v[0];
        z += h * v[1];
        angle += h * w;
    }
    return x;
}

/* From rest: at low speed, where a block crept, and with a high friction coefficient, where it
 * rocks on an edge. A rigid block's closed form has no layer into which the block first tips. */
TEST(a_block_slides_as_in_a_plane)
{
    const struct slide row[] = {
        {CONTACT_BOX, 0.1, 5e7, 1, 0.4, 22.5 * pi / 180, 0, 0, false},
        {CONTACT_BOX, 0.1, 5e7, 0.1, 0.4, 22.5 * pi / 180, 0, 0, false},
        {CONTACT_BOX, 0.1, 8.3e7, 0.3, 0.4, 24 * pi / 180, 0, 0, false},
        {CONTACT_BOX, 0.1, 5e7, 10, 0.8, 40 * pi / 180, 0, 0, false},
        {CONTACT_BOX, 0.3, 5e7, 1, 0.4, 22.5 * pi / 180, 0, 0, false},
        {CONTACT_BOX, 0.02, 1e6, 1, 0.1, 7 * pi / 180, 0, 0, false},
    };

    for (size_t i = 0; i < ARRAY_COUNT(row); i++) {
        const struct slid slid = run(&row[i], 2 * SECOND);
        const double way = planar_way(&row[i], true);

        print_message("# way %.4f m; in a plane %.4f m, with rigid friction %.4f m; of a rigid "
                      "block %.4f m; T over mu N by %.1e\n",
                      slid.way, way, planar_way(&row[i], false),
                      2 * gravity * (sin(row[i].slope) - row[i].mu * cos(row[i].slope)),
                      slid.excess);
        assert_near(slid.way, way, 0.01 * way);
        assert_true(slid.excess < 3e-6);
    }
}

TEST(a_block_that_brakes_stops_and_stays)
{
    const double stiffness[] = {1e6, 5e7, 1e9};

    for (int i = 0; i < 3; i++) {
        const struct slide s = {CONTACT_BOX, 0.1, stiffness[i], 0.3, 0.4, 0.08, 0.5, 0, false};
        const double braking = gravity * (0.4 * cos(0.08) - sin(0.08));
        const struct slid slid = run(&s, 2 * SECOND);

        assert_near(slid.way, 0.125 / braking, 0.01 * slid.way + 1e-4);
        assert_true(slid.excess < 3e-6);
        assert_true(slid.chatter < 0.01);
    }
}

/* Returns a number between two others, evenly on a logarithmic scale. */
static double draw_between(uint64_t *seed, double low, double high)
{
    return low * pow(high / low, 0.5 + 0.5 * random_number(seed));
}

/* Returns the share of the slope's tangent below which friction does not make a body roll: 1 for a
 * box. */
static double sliding_share(const struct slide *s)
{
    const double R = s->height / 2;

    return s->shape == CONTACT_BOX ? 1 : 1 / (1 + R * R / gyration2(s));
}

/* Bodies on slopes of 5 to 45 degrees: boxes of three heights, some of them on a mesh, spheres and
 * capsules; from rest and at speed; at the equilibrium depth and up to 1 mm above it. Half of them
 * slide on. The others have any coefficient of friction: they brake, roll or hold.
 *
 * Friction obeys Coulomb's law in every tick. The normal force of what rests does not chatter. The
 * way of what slides on is the closed form's, to 1 % and what the bristles and the layers allow
 * until they are bent: mu g/w with w^2 = s/m, where s is the stiffness against a tangential force
 * at the center of mass. Impacts that stop a body, and spheres that sink in, have no closed form.
 */
TEST(random_slides_obey_coulomb_in_every_tick)
{
    static const enum contact_shape shape[] = {CONTACT_BOX, CONTACT_BOX, CONTACT_BOX,
                                               CONTACT_SPHERE, CONTACT_CAPSULE};
    static const double height[] = {0.04, 0.1, 0.2};
    uint64_t seed = 49;
    double excess = -1, off = 0, chatter = 0;
    int judged = 0, resting = 0;

    for (int i = 0; i < STARTS; i++) {
        struct slide s = {.shape = shape[i % 5],
                          .on_mesh = i % 5 == 2,
                          .height = height[i % 3],
                          .stiffness = draw_between(&seed, 1e6, 1e10),
                          .dissipation = draw_between(&seed, 0.05, 30),
                          .slope = draw_between(&seed, 5, 45) * pi / 180,
                          .speed = i % 2 ? draw_between(&seed, 0.1, 1) : 0,
                          .above = i % 7 < 3 ? draw_between(&seed, 1e-6, 1e-3) : 0};
        const bool slides_on = i % 4 < 2;
        const double most = slides_on ? 0.9 * sliding_share(&s) * tan(s.slope) : 1.2;
        struct slid slid;
        double way, bent;

        s.mu = draw_between(&seed, fmin(0.05, 0.5 * most), most);
        slid = run(&s, SECOND / 2);
        excess = fmax(excess, slid.excess);
        if (slid.speed < 1e-4) {
            resting++;
            chatter = fmax(chatter, slid.chatter);
        }
        if (slides_on && depth_at_rest(&s) < 0.02 * s.height &&
            s.speed >= 4 * s.mu * sqrt(2 * gravity * s.above)) {
            way = 0.5 * s.speed + gravity * (sin(s.slope) - s.mu * cos(s.slope)) * 0.125;
            bent =
                s.mu * gravity * sqrt(3 * (0.2 + 75 * s.height * s.height) / (s.stiffness * 0.04));
            judged++;
            off = fmax(off, (fabs(slid.way - way) - 2 * bent) / way);
        }
    }
    print_message(
        "# T over mu N by %.1e at most; %d ways off by %.2f %%; N of %d at rest changes by "
        "%.1e in a tick\n",
        excess, judged, 100 * off, resting, chatter);
    assert_true(excess < 3e-6);
    assert_true(judged > STARTS / 4 && resting > STARTS / 12);
    assert_true(off < 0.01);
    assert_true(chatter < 0.01);
}
