/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The numeric dynamics against Simbody, an independent program: the same tree is built from
 * Simbody's mobilizers, and all that model/dynamics.h promises is compared with its operators.
 */
#include <SimTKsimbody.h>

#include <cstdarg>
#include <csetjmp>
#include <cstddef>
#include <cstdint>

extern "C" {

#include "tests/unit/model/random_robot.h"
}

#include "tests/unit/model/simbody_tree.h"
#include "tests/test.h"

using namespace SimTK;
using simbody_tree::put;
using simbody_tree::vec3;

namespace
{

enum { TREES = 400, COMAN_STATES = 200 };

constexpr double tolerance = 1e-10;

/* The robot as Simbody sees it; a fixed base is Simbody's ground. */
class Oracle
{
  public:
    explicit Oracle(const struct robot &described)
        : robot(described), matter(system), body(simbody_tree::build(described, matter)),
          state(system.realizeTopology())
    {
    }

    void set(const double *q, const double *v)
    {
        simbody_tree::set(robot, body, state, q, v);
        system.realize(state, Stage::Dynamics);
    }

    /* Our order and frames: linear, then angular, components in the base frame */
    std::vector<double> forward(const double *tau, const struct wrench *ext, Vector &udot,
                                Vector_<SpatialVec> &A) const
    {
        std::vector<double> vdot(robot.nv);

        matter.calcAcceleration(state, simbody_tree::mobility(robot, body, state, tau), forces(ext),
                                udot, A);
        simbody_tree::accelerations(robot, body, state, A[body[0].getMobilizedBodyIndex()], udot,
                                    vdot.data());
        return vdot;
    }

    std::vector<double> inverse(const Vector &udot, const struct wrench *ext) const
    {
        std::vector<double> f(robot.nv);
        Vector residual;

        matter.calcResidualForceIgnoringConstraints(state, Vector(), forces(ext), udot, residual);
        if (robot.floating) {
            const Rotation &R = body[0].getBodyRotation(state);
            Vec3 moment, force;

            for (int m = 0; m < 3; m++) {
                moment[m] = body[0].getOneFromUPartition(state, m, residual);
                force[m] = body[0].getOneFromUPartition(state, m + 3, residual);
            }
            put(~R * force, &f[0]);
            put(~R * moment, &f[3]);
        }
        for (size_t j = 0; j < robot.njoint; j++) {
            f[robot.nv - robot.njoint + j] = body[j + 1].getOneFromUPartition(state, 0, residual);
        }
        return f;
    }

    double kinetic() const
    {
        return matter.calcKineticEnergy(state);
    }

    double potential() const
    {
        double sum = 0.0;

        for (size_t b = 0; b < robot.nbody; b++) {
            const Vec3 center = body[b].getBodyTransform(state) * vec3(robot.body[b].inertia.com);

            sum -= robot.body[b].inertia.mass * (~vec3(robot.gravity) * center);
        }
        return sum;
    }

    const struct robot &robot;
    MultibodySystem system;
    SimbodyMatterSubsystem matter;
    std::vector<MobilizedBody> body;
    State state;

  private:
    /* Wrenches and weights in Simbody's frames */
    Vector_<SpatialVec> forces(const struct wrench *ext) const
    {
        Vector_<SpatialVec> F(matter.getNumBodies());

        F = SpatialVec(Vec3(0), Vec3(0));
        for (size_t b = robot.floating ? 0 : 1; b < robot.nbody; b++) {
            const Rotation &R = body[b].getBodyRotation(state);
            const Vec3 weight = robot.body[b].inertia.mass * vec3(robot.gravity);
            SpatialVec &sum = F[body[b].getMobilizedBodyIndex()];

            sum[0] = R * vec3(ext[b].moment) + (R * vec3(robot.body[b].inertia.com)) % weight;
            sum[1] = R * vec3(ext[b].force) + weight;
        }
        return F;
    }
};

/* |a - b| / |b|, Euclidean norms */
double relative(const double *a, const double *b, size_t n)
{
    double difference = 0.0, size = 0.0;

    for (size_t i = 0; i < n; i++) {
        difference += (a[i] - b[i]) * (a[i] - b[i]);
        size += b[i] * b[i];
    }
    return difference == 0.0 ? 0.0 : std::sqrt(difference / size);
}

struct Differences {
    double acceleration = 0.0, force = 0.0, energy = 0.0, place = 0.0, velocity = 0.0, body = 0.0;

    void check(double limit) const
    {
        assert_true(acceleration <= limit);
        assert_true(force <= limit);
        assert_true(energy <= limit);
        assert_true(place <= limit);
        assert_true(velocity <= limit);
        assert_true(body <= limit);
    }

    void raise(const Differences &other)
    {
        acceleration = std::max(acceleration, other.acceleration);
        force = std::max(force, other.force);
        energy = std::max(energy, other.energy);
        place = std::max(place, other.place);
        velocity = std::max(velocity, other.velocity);
        body = std::max(body, other.body);
    }

    void print(const char *what) const
    {
        print_message("%s: acceleration %.1e, force %.1e, energy %.1e, place %.1e, velocity %.1e, "
                      "body acceleration %.1e\n",
                      what, acceleration, force, energy, place, velocity, body);
    }
};

void compare_motion(const Oracle &oracle, const struct dynamics &d, const double *q,
                    const double *v, const double *vdot, const Vector_<SpatialVec> &A,
                    Differences &difference)
{
    const struct robot &robot = oracle.robot;
    std::vector<struct body_motion> motion(robot.nbody);
    std::vector<struct body_acceleration> acceleration(robot.nbody);

    d.ops->kinematics(&d, q, v, motion.data());
    d.ops->acceleration(&d, q, v, vdot, acceleration.data());
    for (size_t b = robot.floating ? 0 : 1; b < robot.nbody; b++) {
        const MobilizedBody &body = oracle.body[b];
        const Transform &X = body.getBodyTransform(oracle.state);
        const SpatialVec &V = body.getBodyVelocity(oracle.state);
        const SpatialVec &a = A[body.getMobilizedBodyIndex()];
        const Mat33 R = X.R().asMat33();
        double place[12], velocity[6], change[6];

        for (int m = 0; m < 3; m++) {
            for (int n = 0; n < 3; n++) {
                place[3 * m + n] = R(m, n);
            }
            place[9 + m] = X.p()[m];
            velocity[m] = V[0][m];
            velocity[3 + m] = V[1][m];
            change[m] = a[0][m];
            change[3 + m] = a[1][m];
        }
        difference.place = std::max(difference.place, relative(motion[b].R, place, 12));
        difference.velocity = std::max(difference.velocity, relative(motion[b].w, velocity, 6));
        difference.body = std::max(difference.body, relative(acceleration[b].alpha, change, 6));
    }
}

Differences compare(Oracle &oracle, const struct dynamics &d, const struct random_state &state)
{
    const struct robot &robot = oracle.robot;
    std::vector<double> vdot(robot.nv), f(robot.nv);
    Differences difference;
    Vector udot;
    Vector_<SpatialVec> A;
    double energy[2];

    oracle.set(state.q, state.v);
    const std::vector<double> expected = oracle.forward(state.tau, state.ext, udot, A);
    d.ops->forward(&d, state.q, state.v, state.tau, state.ext, vdot.data());
    difference.acceleration = relative(vdot.data(), expected.data(), robot.nv);

    const std::vector<double> forces = oracle.inverse(udot, state.ext);
    d.ops->inverse(&d, state.q, state.v, expected.data(), state.ext, f.data());
    difference.force = relative(f.data(), forces.data(), robot.nv);

    const double energies[2] = {oracle.kinetic(), oracle.potential()};
    d.ops->energy(&d, state.q, state.v, &energy[0], &energy[1]);
    difference.energy = relative(energy, energies, 2);

    compare_motion(oracle, d, state.q, state.v, expected.data(), A, difference);
    return difference;
}

TEST(random_trees_move_as_in_simbody)
{
    struct arena arena;
    struct error error;
    uint64_t seed = 2026;
    Differences worst;

    for (int tree = 0; tree < TREES; tree++) {
        static struct random_tree random;
        struct random_state state;
        struct dynamics d;

        assert_int_equal(random_tree_make(&seed, &random, &error), ERROR_NONE);
        assert_int_equal(arena_init(&arena, 1 << 20, &error), ERROR_NONE);
        assert_int_equal(dynamics_generic(&random.robot, &arena, &d, &error), ERROR_NONE);
        random_state_make(&seed, &random.robot, &state);
        Oracle oracle(random.robot);
        worst.raise(compare(oracle, d, state));
        arena_fini(&arena);
    }
    worst.print("largest relative differences of 400 trees");
    worst.check(tolerance);
}

TEST(coman_moves_as_in_simbody)
{
    struct arena arena;
    struct error error;
    const struct robot *robot;
    struct random_state state;
    struct dynamics d;
    uint64_t seed = 29;
    Differences worst;
    double sum = 0.0;

    assert_int_equal(arena_init(&arena, 1 << 24, &error), ERROR_NONE);
    if (robot_load(HIL_SOURCE_DIR "/config/robots/coman.yaml", NULL, &arena, &robot, &error)) {
        fail_msg("%s", error.text);
    }
    assert_int_equal(dynamics_generic(robot, &arena, &d, &error), ERROR_NONE);
    Oracle oracle(*robot);
    for (int i = 0; i < COMAN_STATES; i++) {
        random_state_make(&seed, robot, &state);
        const Differences difference = compare(oracle, d, state);

        worst.raise(difference);
        sum += difference.acceleration;
    }
    worst.print("COMAN, largest of 200 states");
    print_message("COMAN, average relative difference of accelerations: %.2e\n",
                  sum / COMAN_STATES);
    worst.check(tolerance);
    arena_fini(&arena);
}

} // namespace
