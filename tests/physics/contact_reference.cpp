/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The coupling against Simbody used the documented way: bodies that have mass and move by
 * themselves, meshes through Simbody's own OBJ reader, no cliques, poses set through the
 * mobilizers. What it says of the contact is read twice: from the forces it applies to the bodies
 * and, by Newton and Euler, from the accelerations that it integrates.
 */
extern "C" {
#include "tests/physics/contact_scene.h"
#include "tests/mesh_write.h"
}

#include <Simbody.h>

#include <csetjmp>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <unistd.h>

extern "C" {
}

#include "tests/physics/near.h"

using namespace SimTK;

namespace
{

const double mass = 2, inertia[3] = {0.02, 0.03, 0.04};

/* One surface with the mesh of an OBJ file, or a sphere, on each of two free bodies. */
struct Reference {
    MultibodySystem system;
    SimbodyMatterSubsystem matter{system};
    ContactTrackerSubsystem tracker{system};
    CompliantContactSubsystem contact{system, tracker};
    MobilizedBody::Free body[2];
    State state;

    static ContactGeometry read(const std::string &path)
    {
        PolygonalMesh mesh;

        mesh.loadObjFile(path.c_str());
        return ContactGeometry::TriangleMesh(mesh);
    }

    static ContactSurface surface(const ContactGeometry &shape, const contact_material &m)
    {
        return ContactSurface(shape,
                              ContactMaterial(m.young_pa, m.dissipation_s_per_m, m.static_friction,
                                              m.dynamic_friction, m.viscous_friction),
                              m.thickness_m);
    }

    Reference(const ContactSurface &first, const ContactSurface &second)
    {
        const ContactSurface *surface[2] = {&first, &second};
        const Inertia about_center(inertia[0], inertia[1], inertia[2]);

        contact.setTransitionVelocity(SCENE_TRANSITION_M_S);
        for (int b = 0; b < 2; ++b) {
            Body::Rigid rigid(MassProperties(mass, Vec3(0), about_center));

            rigid.addContactSurface(Transform(), *surface[b]);
            body[b] = MobilizedBody::Free(matter.Ground(), Transform(), rigid, Transform());
        }
        state = system.realizeTopology();
    }

    void set(const body_motion *motion)
    {
        for (int b = 0; b < 2; ++b) {
            const body_motion &m = motion[b];
            const Mat33 R(m.R[0], m.R[1], m.R[2], m.R[3], m.R[4], m.R[5], m.R[6], m.R[7], m.R[8]);

            body[b].setQToFitTransform(state, Transform(Rotation(R), Vec3(m.p[0], m.p[1], m.p[2])));
        }
        system.realize(state, Stage::Position);
        for (int b = 0; b < 2; ++b) {
            const body_motion &m = motion[b];

            body[b].setUToFitVelocity(
                state, SpatialVec(Vec3(m.w[0], m.w[1], m.w[2]), Vec3(m.v[0], m.v[1], m.v[2])));
        }
        system.realize(state, Stage::Acceleration);
    }

    /* Moment and force about the body's origin, as applied. */
    SpatialVec applied(int b) const
    {
        return system.getRigidBodyForces(state, Stage::Dynamics)[body[b].getMobilizedBodyIndex()];
    }

    /* The same from F = m a and M = d(I w)/dt. */
    SpatialVec from_motion(int b) const
    {
        const Rotation &R = body[b].getBodyRotation(state);
        const SpatialVec A = body[b].getBodyAcceleration(state);
        const Vec3 w = body[b].getBodyAngularVelocity(state);
        const Mat33 I = R * Mat33(inertia[0], 0, 0, 0, inertia[1], 0, 0, 0, inertia[2]) * ~R;

        return SpatialVec(I * A[0] + w % (I * w), mass * A[1]);
    }
};

void compare(const contact_wrench &wrench, const SpatialVec &reference, double relative)
{
    const double force = reference[1].norm(), moment = reference[0].norm() + 0.05 * force;

    for (int i = 0; i < 3; ++i) {
        assert_near(wrench.force[i], reference[1][i], relative * force);
        assert_near(wrench.moment[i], reference[0][i], relative * moment);
    }
}

/* A scene's two bodies at a height apart, wobbling: every wrench against the reference. */
void sweep(const scene &scene, Reference &reference, double apart)
{
    contact_world *world = nullptr;
    struct error error = {};
    uint64_t seed = 19;
    int touching = 0;

    if (contact_simbody_create(&scene.config, &world, &error) != ERROR_NONE) {
        fail_msg("%s", error.text);
    }
    for (int i = 0; i < 60; ++i) {
        body_motion motion[2];
        contact_wrench wrench[2];

        for (int b = 0; b < 2; ++b) {
            scene_place(&motion[b], 0.02 * random_number(&seed), 0.02 * random_number(&seed),
                        b * (apart + 0.002 * random_number(&seed)));
            scene_random_rotation(&seed, 0.05, motion[b].R);
            for (int axis = 0; axis < 3; ++axis) {
                motion[b].w[axis] = random_number(&seed);
                motion[b].v[axis] = 0.02 * random_number(&seed);
            }
        }
        assert_int_equal(world->ops->evaluate(world, motion, NULL, wrench), ERROR_NONE);
        reference.set(motion);
        for (int b = 0; b < 2; ++b) {
            /* Newton and Euler add the rounding of a solved equation of motion */
            compare(wrench[b], reference.applied(b), 1e-12);
            compare(wrench[b], reference.from_motion(b), 1e-11);
        }
        touching += vec3_norm(wrench[0].force) > 0;
    }
    assert_true(touching > 40);
    world->ops->destroy(world);
}

/* Writes the mesh to a file that Simbody reads, for the time of the test. */
struct ObjFile {
    char path[64] = "/tmp/contact_reference_XXXXXX.obj";

    explicit ObjFile(const mesh *mesh)
    {
        int fd = mkstemps(path, 4);
        FILE *file = fd >= 0 ? fdopen(fd, "w") : nullptr;

        assert_non_null(file);
        mesh_write_obj(mesh, file);
        fclose(file);
    }
    ObjFile(const ObjFile &) = delete;
    ObjFile &operator=(const ObjFile &) = delete;
    ~ObjFile()
    {
        unlink(path);
    }
};

struct Meshes {
    struct arena arena = {};
    const mesh *large = nullptr, *small = nullptr, *foot = nullptr;

    Meshes()
    {
        const double big[3] = {0.075, 0.075, 0.075}, little[3] = {0.05, 0.04, 0.05};
        const char *path = HIL_SOURCE_DIR "/config/meshes/coman-foot-right.obj";

        assert_int_equal(arena_init(&arena, 1 << 20, nullptr), ERROR_NONE);
        assert_int_equal(mesh_box(big, 7, &arena, &large, nullptr), ERROR_NONE);
        assert_int_equal(mesh_box(little, 5, &arena, &small, nullptr), ERROR_NONE);
        assert_int_equal(solid_store_read_obj(path, &arena, &foot, nullptr), ERROR_NONE);
    }
    Meshes(const Meshes &) = delete;
    Meshes &operator=(const Meshes &) = delete;
    ~Meshes()
    {
        arena_fini(&arena);
    }
};

TEST(sphere_on_box_agrees_with_a_plain_simbody_model)
{
    Meshes meshes;
    ObjFile large(meshes.large);
    scene scene;

    scene_init(&scene, 2);
    scene_add_box(&scene, 0, 0.075, 0.075, 0.075, 7, &scene_ground);
    scene_add(&scene, 1, CONTACT_SPHERE, &scene_foot)->radius_m = 0.05;
    scene_add_pair(&scene, 0, 1);

    Reference reference(Reference::surface(Reference::read(large.path), scene_ground),
                        Reference::surface(ContactGeometry::Sphere(0.05), scene_foot));

    sweep(scene, reference, 0.118);
}

TEST(box_on_box_agrees_with_a_plain_simbody_model)
{
    Meshes meshes;
    ObjFile large(meshes.large), small(meshes.small);
    scene scene;

    scene_init(&scene, 2);
    scene_add_box(&scene, 0, 0.075, 0.075, 0.075, 7, &scene_ground);
    scene_add_box(&scene, 1, 0.05, 0.04, 0.05, 5, &scene_foot);
    scene_add_pair(&scene, 1, 0);

    Reference reference(Reference::surface(Reference::read(large.path), scene_ground),
                        Reference::surface(Reference::read(small.path), scene_foot));

    sweep(scene, reference, 0.122);
}

TEST(foot_on_box_agrees_with_a_plain_simbody_model)
{
    Meshes meshes;
    ObjFile large(meshes.large), foot(meshes.foot);
    scene scene;

    scene_init(&scene, 2);
    scene_add(&scene, 0, CONTACT_MESH, &scene_ground)->mesh = meshes.large;
    scene_add(&scene, 1, CONTACT_MESH, &scene_foot)->mesh = meshes.foot;
    scene_add_pair(&scene, 0, 1);

    Reference reference(Reference::surface(Reference::read(large.path), scene_ground),
                        Reference::surface(Reference::read(foot.path), scene_foot));

    sweep(scene, reference, 0.075 + 0.0932 - 0.003);
}

} // namespace
