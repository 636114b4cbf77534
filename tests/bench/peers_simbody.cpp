/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Simbody as a peer, in the cheapest way that it offers: coordinates into the state, weights, then
 * the operator calcAcceleration. To realize a state with force subsystems to accelerations computes
 * the same and takes a tenth longer.
 */
#include <SimTKsimbody.h>

extern "C" {
#include "tests/bench/peers.h"
}

#include "tests/unit/model/simbody_tree.h"

#include <cstdio>
#include <memory>

using namespace SimTK;

namespace
{

class Engine
{
  public:
    explicit Engine(const struct robot &described)
        : robot(described), matter(system), body(simbody_tree::build(described, matter)),
          state(system.realizeTopology()), forces(matter.getNumBodies())
    {
        forces = SpatialVec(Vec3(0), Vec3(0));
        for (size_t b = 0; b < robot.nbody; b++) {
            com.push_back(simbody_tree::vec3(robot.body[b].inertia.com));
            weight.push_back(robot.body[b].inertia.mass * simbody_tree::vec3(robot.gravity));
        }
    }

    void put(size_t slot, const double *q, const double *v, const double *tau)
    {
        simbody_tree::set(robot, body, state, q, v);
        kept[slot].q = state.getQ();
        kept[slot].u = state.getU();
        kept[slot].f = simbody_tree::mobility(robot, body, state, tau);
    }

    void run(size_t slot)
    {
        state.updQ() = kept[slot].q;
        state.updU() = kept[slot].u;
        system.realize(state, Stage::Dynamics);
        for (size_t b = robot.floating ? 0 : 1; b < robot.nbody; b++) {
            const Vec3 arm = body[b].getBodyRotation(state) * com[b];

            forces[body[b].getMobilizedBodyIndex()] = SpatialVec(arm % weight[b], weight[b]);
        }
        matter.calcAcceleration(state, kept[slot].f, forces, udot, A);
    }

    void get(double *vdot) const
    {
        simbody_tree::accelerations(robot, body, state, A[body[0].getMobilizedBodyIndex()], udot,
                                    vdot);
    }

  private:
    const struct robot &robot;
    MultibodySystem system;
    SimbodyMatterSubsystem matter;
    std::vector<MobilizedBody> body;
    State state;
    std::vector<Vec3> com, weight;
    Vector_<SpatialVec> forces, A;
    Vector udot;
    struct {
        Vector q, u, f;
    } kept[PEER_SLOTS];
};

void *create(const struct robot *robot, char *message, size_t size)
{
    try {
        return new Engine(*robot);
    } catch (const std::exception &failure) {
        std::snprintf(message, size, "%s", failure.what());
        return nullptr;
    }
}

void destroy(void *engine)
{
    delete static_cast<Engine *>(engine);
}

void put(void *engine, size_t slot, const double *q, const double *v, const double *tau)
{
    static_cast<Engine *>(engine)->put(slot, q, v, tau);
}

void run(void *engine, size_t slot)
{
    static_cast<Engine *>(engine)->run(slot);
}

void get(void *engine, double *vdot)
{
    static_cast<Engine *>(engine)->get(vdot);
}

} // namespace

extern "C" const struct peer_dynamics peer_simbody = {
    "Simbody", PEERS_SIMBODY_VERSION, create, nullptr, destroy, put, run, get, nullptr};
