/* SPDX-License-Identifier: Apache-2.0 */
/* A robot built from Simbody's mobilizers, for tests and benchmarks that compare with Simbody. C++;
 * include after SimTKsimbody.h, with model/robot.h as C. */
#ifndef TESTS_UNIT_MODEL_SIMBODY_TREE_H
#define TESTS_UNIT_MODEL_SIMBODY_TREE_H

#include <vector>

namespace simbody_tree
{

inline SimTK::Vec3 vec3(const double *x)
{
    return SimTK::Vec3(x[0], x[1], x[2]);
}

inline void put(const SimTK::Vec3 &x, double *out)
{
    for (int m = 0; m < 3; m++) {
        out[m] = x[m];
    }
}

inline SimTK::Rotation rotation(const double R[9])
{
    return SimTK::Rotation(SimTK::Mat33(R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8]),
                           true);
}

inline SimTK::Body::Rigid rigid(const struct robot_inertia &inertia)
{
    const double *I = inertia.I;
    const SimTK::Vec3 com = vec3(inertia.com);
    const SimTK::Inertia central(I[0], I[3], I[5], I[1], I[2], I[4]);

    return SimTK::Body::Rigid(
        SimTK::MassProperties(inertia.mass, com, central.shiftFromMassCenter(com, inertia.mass)));
}

inline SimTK::MobilizedBody mobilizer(const struct robot &robot, size_t b,
                                      SimTK::MobilizedBody &parent)
{
    const struct robot_joint &joint = robot.joint[b - 1];
    const bool pin = joint.type == JOINT_REVOLUTE;
    const SimTK::Rotation align(SimTK::UnitVec3(vec3(joint.axis)),
                                pin ? SimTK::CoordinateAxis(SimTK::ZAxis)
                                    : SimTK::CoordinateAxis(SimTK::XAxis));
    const SimTK::Transform inboard(rotation(joint.rotation) * align, vec3(joint.origin));
    const SimTK::Body::Rigid body = rigid(robot.body[b].inertia);

    if (pin) {
        return SimTK::MobilizedBody::Pin(parent, inboard, body, SimTK::Transform(align));
    }
    return SimTK::MobilizedBody::Slider(parent, inboard, body, SimTK::Transform(align));
}

/* The robot's bodies in matter, in our order; a fixed base is Simbody's ground. */
inline std::vector<SimTK::MobilizedBody> build(const struct robot &robot,
                                               SimTK::SimbodyMatterSubsystem &matter)
{
    std::vector<SimTK::MobilizedBody> body(1, matter.Ground());

    if (robot.floating) {
        body[0] = SimTK::MobilizedBody::Free(matter.Ground(), SimTK::Transform(),
                                             rigid(robot.body[0].inertia), SimTK::Transform());
    }
    for (size_t b = 1; b < robot.nbody; b++) {
        body.push_back(mobilizer(robot, b, body[robot.body[b].parent]));
    }
    return body;
}

/* Our coordinates into state. */
inline void set(const struct robot &robot, const std::vector<SimTK::MobilizedBody> &body,
                SimTK::State &state, const double *q, const double *v)
{
    if (robot.floating) {
        const SimTK::Rotation R(SimTK::Quaternion(SimTK::Vec4(q[3], q[4], q[5], q[6])));

        body[0].setQToFitTransform(state, SimTK::Transform(R, vec3(q)));
        body[0].setUToFitVelocity(state, SimTK::SpatialVec(R * vec3(v + 3), R * vec3(v)));
    }
    for (size_t j = 0; j < robot.njoint; j++) {
        body[j + 1].setOneQ(state, 0, q[robot.nq - robot.njoint + j]);
        body[j + 1].setOneU(state, 0, v[robot.nv - robot.njoint + j]);
    }
}

/* Joint forces as Simbody's mobility forces. */
inline SimTK::Vector mobility(const struct robot &robot,
                              const std::vector<SimTK::MobilizedBody> &body,
                              const SimTK::State &state, const double *tau)
{
    SimTK::Vector f(state.getNU(), 0.0);

    for (size_t j = 0; j < robot.njoint; j++) {
        body[j + 1].updOneFromUPartition(state, 0, f) = tau[j];
    }
    return f;
}

/* vdot in our order and frames (linear, then angular, components in the base frame) from the
 * base's acceleration in ground, a state realized to Velocity and udot. */
inline void accelerations(const struct robot &robot, const std::vector<SimTK::MobilizedBody> &body,
                          const SimTK::State &state, const SimTK::SpatialVec &base,
                          const SimTK::Vector &udot, double *vdot)
{
    if (robot.floating) {
        const SimTK::SpatialVec &V = body[0].getBodyVelocity(state);
        const SimTK::Rotation &R = body[0].getBodyRotation(state);

        put(~R * (base[1] - V[0] % V[1]), vdot);
        put(~R * base[0], vdot + 3);
    }
    for (size_t j = 0; j < robot.njoint; j++) {
        vdot[robot.nv - robot.njoint + j] = body[j + 1].getOneFromUPartition(state, 0, udot);
    }
}

} // namespace simbody_tree

#endif
