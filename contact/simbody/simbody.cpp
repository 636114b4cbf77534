/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Contact engine "simbody": the paper's coupling (section 5.3, Fig. 7). Each contact body has a
 * free 6-DOF shadow body in a Simbody world. An evaluation sets poses and velocities, realizes the
 * world once, and reads back the forces of Simbody's CompliantContactSubsystem. There is no
 * integrator and no gravity.
 *
 * This is the only C++ of the tree, and no exception leaves it. Never build it with NDEBUG;
 * CMakeLists.txt in this folder gives the reason.
 */
extern "C" {
#include "contact/friction_slope.h"
#include "contact/simbody/module.h"
#include "contact/tangent.h"
}

#include <Simbody.h>

#include <cstdio>
#include <exception>
#include <new>
#include <stdexcept>
#include <vector>

using namespace SimTK;

namespace
{

const int no_pair = -1;

/* Owns the memory of one of our meshes while it is passed to Simbody. */
class ScratchArena
{
  public:
    ScratchArena() = default;
    ScratchArena(const ScratchArena &) = delete;
    ScratchArena &operator=(const ScratchArena &) = delete;
    ~ScratchArena()
    {
        arena_fini(&arena);
    }

    struct arena arena = {};
};

/* Indices in q and u of a shadow body's pose and velocity. */
struct Shadow {
    MobilizedBodyIndex body;
    int q, u;
};

/* Constants of the law for the two materials of a pair. */
struct Law {
    double static_friction, viscous_friction;
    double dissipation; /* damping force over (elastic force times rate of depth) */
    double exponent;    /* exponent of the depth in the elastic force */
};

struct Engine : contact_world {
    explicit Engine(const struct contact_config &config);

    void evaluate(const struct body_motion *motion, struct contact_wrench *wrench);
    void impose_motion(const struct body_motion *motion);
    void add_patch(const ContactForce &force, const Contact &contact,
                   const struct body_motion *motion, struct contact_wrench *wrench);
    size_t tangents(struct contact_tangent *tangent, size_t max);

    size_t nbody, nsurface;
    MultibodySystem system;
    SimbodyMatterSubsystem matter;
    ContactTrackerSubsystem tracker;
    CompliantContactSubsystem forces;
    State state;
    std::vector<Shadow> shadow;  /* shadow of each body */
    std::vector<int> surface_of; /* our index of each Simbody surface */
    std::vector<int> body_of;    /* body of each of our surfaces */
    std::vector<int> pair_of;    /* pair of surfaces [a * nsurface + b], or no_pair */
    std::vector<struct contact_pair> pair;
    std::vector<Law> law; /* law of each pair */
    std::vector<struct contact_patch> patches;
    std::vector<ContactId> touching; /* contact of each patch */
    char failure[512] = "";
};

Vec3 to_vec3(const double v[3])
{
    return Vec3(v[0], v[1], v[2]);
}

Mat33 to_mat33(const double m[9])
{
    return Mat33(m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8]);
}

void add_vec3(double sum[3], const Vec3 &v)
{
    for (int i = 0; i < 3; i++) {
        sum[i] += v[i];
    }
}

/* ---- building the world ---- */

ContactGeometry mesh_geometry(const struct mesh &mesh)
{
    Array_<Vec3> vertices;
    Array_<int> corners;

    vertices.reserve(static_cast<unsigned>(mesh.nvertex));
    corners.reserve(static_cast<unsigned>(3 * mesh.nface));
    for (size_t v = 0; v < mesh.nvertex; v++) {
        vertices.push_back(to_vec3(mesh.vertex[v]));
    }
    for (size_t f = 0; f < mesh.nface; f++) {
        for (int i = 0; i < 3; i++) {
            corners.push_back(mesh.face[f][i]);
        }
    }
    return ContactGeometry::TriangleMesh(vertices, corners);
}

/* Uses the same triangles as the other engine for this box. */
ContactGeometry box_geometry(const struct contact_surface &s)
{
    ScratchArena scratch;
    const struct mesh *mesh = nullptr;
    struct error error = {};
    size_t faces =
        12 * static_cast<size_t>(s.cells_per_edge) * static_cast<size_t>(s.cells_per_edge);

    if (arena_init(&scratch.arena, 4096 + 64 * faces, &error) != ERROR_NONE ||
        mesh_box(s.half_extent_m, s.cells_per_edge, &scratch.arena, &mesh, &error) != ERROR_NONE) {
        throw std::runtime_error(error.text);
    }
    return mesh_geometry(*mesh);
}

ContactGeometry surface_geometry(const struct contact_surface &s)
{
    switch (s.shape) {
    case CONTACT_HALF_SPACE:
        return ContactGeometry::HalfSpace();
    case CONTACT_SPHERE:
        return ContactGeometry::Sphere(s.radius_m);
    case CONTACT_BOX:
        return box_geometry(s);
    case CONTACT_MESH:
        return mesh_geometry(*s.mesh);
    case CONTACT_CAPSULE: /* refused by the check of the configuration */
        break;
    }
    throw std::logic_error("shape without a geometry");
}

/* Returns the pose of Simbody's geometry in the body. Its half-space is solid at x > 0, ours at z
 * < 0. */
Transform surface_placement(const struct contact_surface &s)
{
    Rotation frame(to_mat33(s.rotation));
    const Rotation down(Mat33(0, 0, 1, 0, 1, 0, -1, 0, 0), true);

    if (s.shape == CONTACT_HALF_SPACE) {
        frame = frame * down;
    }
    return Transform(frame, to_vec3(s.position));
}

ContactSurface make_surface(const struct contact_surface &s)
{
    const struct contact_material &m = s.material;

    return ContactSurface(surface_geometry(s),
                          ContactMaterial(m.young_pa, m.dissipation_s_per_m, m.static_friction,
                                          m.dynamic_friction, m.viscous_friction),
                          m.thickness_m);
}

/* Disables the contact of each two surfaces that are not a pair, by a clique for the two. Simbody
 * would test all surfaces against each other. Surfaces of one body never touch anyway. */
void separate_unpaired(std::vector<ContactSurface> &surfaces, const std::vector<int> &body_of,
                       const std::vector<int> &pair_of)
{
    size_t n = surfaces.size();

    for (size_t a = 0; a < n; a++) {
        for (size_t b = a + 1; b < n; b++) {
            if (pair_of[a * n + b] == no_pair && body_of[a] != body_of[b]) {
                ContactCliqueId clique = ContactSurface::createNewContactClique();

                surfaces[a].joinClique(clique);
                surfaces[b].joinClique(clique);
            }
        }
    }
}

double harmonic_mean(double a, double b)
{
    return a + b > 0 ? 2 * a * b / (a + b) : 0;
}

bool has_mesh(const struct contact_surface &s)
{
    return s.shape == CONTACT_BOX || s.shape == CONTACT_MESH;
}

/* Returns the stiffness that determines a surface's share of the depth. */
double material_rigidity(const struct contact_material &m, bool foundation)
{
    return foundation ? m.young_pa / m.thickness_m : std::cbrt(m.young_pa * m.young_pa);
}

Law pair_law(const struct contact_surface &a, const struct contact_surface &b)
{
    const bool foundation = has_mesh(a) || has_mesh(b);
    const double ka = material_rigidity(a.material, foundation),
                 kb = material_rigidity(b.material, foundation);
    const double c =
        (kb * a.material.dissipation_s_per_m + ka * b.material.dissipation_s_per_m) / (ka + kb);

    return {harmonic_mean(a.material.static_friction, b.material.static_friction),
            harmonic_mean(a.material.viscous_friction, b.material.viscous_friction),
            foundation ? c : 1.5 * c, foundation ? 1.0 : 1.5};
}

Engine::Engine(const struct contact_config &config)
    : contact_world{}, nbody(config.nbody), nsurface(config.nsurface), matter(system),
      tracker(system), forces(system, tracker), pair_of(nsurface * nsurface, no_pair),
      pair(config.pair, config.pair + config.npair)
{
    /* Pairs: index by surfaces, and law */
    for (size_t p = 0; p < pair.size(); p++) {
        size_t a = static_cast<size_t>(pair[p].a), b = static_cast<size_t>(pair[p].b);

        pair_of[a * nsurface + b] = pair_of[b * nsurface + a] = static_cast<int>(p);
    }
    for (const struct contact_pair &p : pair) {
        law.push_back(pair_law(config.surface[p.a], config.surface[p.b]));
    }
    /* Reserve now: no allocation of ours during an evaluation */
    patches.reserve(pair.size());
    touching.reserve(pair.size());

    /* Surfaces; only those of a pair may touch */
    std::vector<ContactSurface> surfaces;

    for (size_t i = 0; i < nsurface; i++) {
        surfaces.push_back(make_surface(config.surface[i]));
        body_of.push_back(config.surface[i].body);
    }
    separate_unpaired(surfaces, body_of, pair_of);

    /* Bodies with their surfaces: Ground first, then each body, in the order of Simbody's
     * numbering */
    const MassProperties unit(1, Vec3(0), UnitInertia(1));

    forces.setTransitionVelocity(config.transition_velocity_m_s);
    for (int body = -1; body < static_cast<int>(nbody); body++) {
        Body::Rigid shape(unit);

        for (size_t i = 0; i < nsurface; i++) {
            if (body_of[i] != body) {
                continue;
            }
            Transform where = surface_placement(config.surface[i]);

            if (body < 0) {
                matter.Ground().updBody().addContactSurface(where, surfaces[i]);
            } else {
                shape.addContactSurface(where, surfaces[i]);
            }
            surface_of.push_back(static_cast<int>(i));
        }
        if (body >= 0) {
            MobilizedBody::Free mobilized(matter.Ground(), Transform(), shape, Transform());

            shadow.push_back({mobilized.getMobilizedBodyIndex(), 0, 0});
        }
    }

    /* A state for poses and velocities */
    state = system.realizeTopology();
    system.realizeModel(state);
    for (Shadow &s : shadow) {
        s.q = matter.getMobilizedBody(s.body).getFirstQIndex(state);
        s.u = matter.getMobilizedBody(s.body).getFirstUIndex(state);
    }
}

/* ---- evaluating ---- */

/* Sets the motions of the shadow bodies. A free mobilizer on Ground has q (quaternion, origin) and
 * u (angular velocity, velocity of the origin), all in Ground's frame. */
void Engine::impose_motion(const struct body_motion *motion)
{
    Vector &q = state.updQ();
    Vector &u = state.updU();

    for (size_t b = 0; b < nbody; b++) {
        const struct body_motion &m = motion[b];
        const Quaternion turn = Rotation(to_mat33(m.R), true).convertRotationToQuaternion();

        for (int i = 0; i < 4; i++) {
            q[shadow[b].q + i] = turn[i];
        }
        for (int i = 0; i < 3; i++) {
            q[shadow[b].q + 4 + i] = m.p[i];
            u[shadow[b].u + i] = m.w[i];
            u[shadow[b].u + 3 + i] = m.v[i];
        }
    }
}

/* Adds one contact to the wrenches of its two bodies, and to the patches. */
void Engine::add_patch(const ContactForce &force, const Contact &contact,
                       const struct body_motion *motion, struct contact_wrench *wrench)
{
    /* Finds the pair */
    const size_t first = static_cast<size_t>(surface_of[contact.getSurface1()]);
    const size_t second = static_cast<size_t>(surface_of[contact.getSurface2()]);
    const int number = pair_of[first * nsurface + second];
    const Vec3 &center = force.getContactPoint();
    const SpatialVec &on_second = force.getForceOnSurface2();

    if (number == no_pair) {
        throw std::logic_error("contact of two surfaces that are not a pair");
    }

    /* Adds its force to both bodies */
    for (int side = 0; side < 2; side++) {
        const int body = body_of[side == 0 ? first : second];
        const SpatialVec f = (side == 0 ? -1.0 : 1.0) * on_second;

        if (body >= 0) {
            const Vec3 arm = center - to_vec3(motion[body].p);

            add_vec3(wrench[body].force, f[1]);
            add_vec3(wrench[body].moment, f[0] + arm % f[1]);
        }
    }

    /* Adds the patch, with the wrench on the configured pair's b */
    struct contact_patch patch = {};
    const double sign = pair[static_cast<size_t>(number)].b == static_cast<int>(second) ? 1 : -1;

    patch.pair = number;
    add_vec3(patch.center, center);
    add_vec3(patch.force, sign * on_second[1]);
    add_vec3(patch.moment, sign * on_second[0]);
    patch.potential_j = force.getPotentialEnergy();
    patch.dissipation_w = force.getPowerDissipation();
    patches.push_back(patch);
    touching.push_back(force.getContactId());
}

void Engine::evaluate(const struct body_motion *motion, struct contact_wrench *wrench)
{
    patches.clear();
    touching.clear();
    for (size_t b = 0; b < nbody; b++) {
        wrench[b] = contact_wrench{};
    }
    impose_motion(motion);
    system.realize(state, Stage::Dynamics);

    const ContactSnapshot &contacts = tracker.getActiveContacts(state);
    const int n = forces.getNumContactForces(state);

    for (int i = 0; i < n; i++) {
        const ContactForce &force = forces.getContactForce(state, i);

        add_patch(force, contacts.getContactById(force.getContactId()), motion, wrench);
    }

    /* Keeps the number of each contact for the next evaluation: Simbody counts new contacts in an
     * int that a long run would overflow. The forces do not depend on the number. */
    state.autoUpdateDiscreteVariables();
}

/* Adds one element of Simbody's contact details. The elastic force is a power of the depth, and
 * the energy gives the depth. */
void tangent_add_detail(const ContactDetail &detail, const Law &law, double transition_velocity,
                        struct contact_tangent *tangent)
{
    const double depth = detail.getDeformation();
    const double elastic = (law.exponent + 1) * detail.getPotentialEnergy() / depth;
    const double damping = law.dissipation * elastic;
    const double normal = std::abs(dot(detail.getForceOnSurface2(), detail.getContactNormal()));
    struct contact_element element = {};

    add_vec3(element.point, detail.getContactPoint());
    add_vec3(element.normal, Vec3(detail.getContactNormal()));
    element.stiffness = law.exponent * normal / depth;
    element.damping = damping;
    element.friction =
        contact_friction_damping(law.static_friction, law.viscous_friction, transition_velocity,
                                 normal, detail.getSlipVelocity().norm());
    contact_tangent_add(tangent, &element);
}

size_t Engine::tangents(struct contact_tangent *tangent, size_t max)
{
    for (size_t i = 0; i < patches.size() && i < max; i++) {
        const struct contact_pair &p = pair[static_cast<size_t>(patches[i].pair)];
        struct contact_tangent &t = tangent[i];
        ContactPatch details;

        t = contact_tangent{};
        t.pair = patches[i].pair;
        t.body_a = body_of[static_cast<size_t>(p.a)];
        t.body_b = body_of[static_cast<size_t>(p.b)];
        add_vec3(t.center, to_vec3(patches[i].center));
        forces.calcContactPatchDetailsById(state, touching[i], details);
        for (int e = 0; e < details.getNumDetails(); e++) {
            tangent_add_detail(details.getContactDetail(e), law[static_cast<size_t>(t.pair)],
                               forces.getTransitionVelocity(), &t);
        }
    }
    return patches.size();
}

/* ---- the C side ---- */

/* Writes a message on one line: Simbody's messages have several lines. */
void copy_as_one_line(char *out, size_t size, const char *message)
{
    size_t n = 0;

    for (; *message && n + 1 < size; message++) {
        const char c = *message == '\n' ? ' ' : *message;

        if (c != ' ' || n == 0 || out[n - 1] != ' ') {
            out[n++] = c;
        }
    }
    out[n] = '\0';
}

enum error_code simbody_evaluate(struct contact_world *world, const struct body_motion *motion,
                                 struct contact_bristles *, struct contact_wrench *wrench)
{
    Engine *engine = static_cast<Engine *>(world);

    const enum error_code code =
        contact_check_motions(motion, engine->nbody, engine->failure, sizeof engine->failure);

    if (code != ERROR_NONE) {
        return code;
    }
    try {
        engine->evaluate(motion, wrench);
        return ERROR_NONE;
    } catch (const std::bad_alloc &) {
        copy_as_one_line(engine->failure, sizeof engine->failure,
                         "contact: no memory for an evaluation");
        return ERROR_MEMORY;
    } catch (const std::exception &e) {
        copy_as_one_line(engine->failure, sizeof engine->failure, e.what());
    } catch (...) {
        copy_as_one_line(engine->failure, sizeof engine->failure,
                         "Simbody failed without a message");
    }
    return ERROR_SYSTEM;
}

size_t simbody_patches(struct contact_world *world, struct contact_patch *patch, size_t max)
{
    const std::vector<struct contact_patch> &all = static_cast<Engine *>(world)->patches;

    for (size_t i = 0; i < all.size() && i < max; i++) {
        patch[i] = all[i];
    }
    return all.size();
}

/* Computes the tangents. A pair has none if Simbody cannot give its details. */
size_t simbody_tangents(struct contact_world *world, struct contact_tangent *tangent, size_t max)
{
    try {
        return static_cast<Engine *>(world)->tangents(tangent, max);
    } catch (...) {
        return 0;
    }
}

const char *simbody_failure(const struct contact_world *world)
{
    return static_cast<const Engine *>(world)->failure;
}

void simbody_destroy(struct contact_world *world)
{
    delete static_cast<Engine *>(world);
}

const struct contact_ops simbody_ops = {
    "simbody",        simbody_evaluate, simbody_patches,
    simbody_tangents, simbody_failure,  simbody_destroy,
};

/* Creates a world (contact_simbody_create). */
enum error_code simbody_create(const struct contact_config *config, struct contact_world **world,
                               struct error *error)
{
    for (size_t i = 0; i < config->nsurface; i++) {
        if (config->surface[i].shape == CONTACT_CAPSULE) {
            return error_set(error, ERROR_UNSUPPORTED,
                             "contact surface '%s': found a capsule, which engine simbody does not "
                             "have; expected engine native, or another shape",
                             config->surface[i].name);
        }
    }
    if (config->friction != CONTACT_FRICTION_REGULARIZED) {
        return error_set(error, ERROR_UNSUPPORTED,
                         "contact: engine simbody has no friction but the regularized one");
    }
    try {
        Engine *engine = new Engine(*config);

        engine->ops = &simbody_ops;
        *world = engine;
        return ERROR_NONE;
    } catch (const std::bad_alloc &) {
        return error_set(error, ERROR_MEMORY, "contact: no memory for the Simbody world");
    } catch (const std::exception &e) {
        char text[512];

        copy_as_one_line(text, sizeof text, e.what());
        return error_set(error, ERROR_SYSTEM, "contact: Simbody: %s", text);
    } catch (...) {
        return error_set(error, ERROR_SYSTEM, "contact: Simbody failed");
    }
}

} // namespace

extern "C" const struct simbody_module simbody_module;

const struct simbody_module simbody_module = {HIL_VERSION, SIMBODY_MODULE_SIZES, simbody_create};
