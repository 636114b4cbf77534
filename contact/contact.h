/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Compliant contact (penalty method) and friction between surfaces on moving bodies and the ground:
 * elastic foundation, paper eqs (6), (7). Poses and velocities go in, the wrench on every body
 * comes out. SI units, world frame unless a comment says otherwise. Creating a world and checking
 * its configuration are not RT-safe; what an engine does with a world is where the engine says so.
 * C only: no exception and no C++ type crosses this header.
 *
 * Law at a surface element of area A with penetration depth x into the other surface, x' its rate
 * (Sherman, Seth, Delp 2011; Simbody's CompliantContactSubsystem), subscripts for the two surfaces:
 *
 *     normal     f_n = k A x (1 + c x'), never negative
 *                k = k1 k2/(k1 + k2), k_i = young_i/thickness_i
 *                c = s1 c1 + s2 c2, s_i the share of x that surface i gives:
 *                s1 = k2/(k1 + k2), s2 = 1 - s1
 *     friction   (regularized) f_t = mu(v) f_n against the sliding velocity v; mu falls from static
 *                to dynamic friction (Stribeck): u = v/v_t, v_t the transition velocity, and
 *                mu = us S(u) + uv v                          for u < 1
 *                mu = us - (us - ud) S((u - 1)/2) + uv v      for 1 <= u < 3
 *                mu = ud + uv v                               for 3 <= u
 *                S(x) = 10 x^3 - 15 x^4 + 6 x^5; us, ud, uv: harmonic means of the two surfaces'
 *     stored     k A x^2/2; dissipated (f_n - k A x) x' + mu f_n v, c k A x x'^2 + mu f_n v but
 *                where surfaces part faster than their layers follow (f_n = 0). Neither is ever
 *                negative.
 *
 * An elastic layer ends where it is compressed to nothing: a law that is linear in x holds for x
 * well below its thickness. With K = K1 K2/(K1 + K2), K_i = backing_pa_per_m of what is behind
 * layer i (0 on either side = layers without end, the paper's), and h the sum of both thicknesses,
 *
 *     normal     f_n = A (k x + K max(x - h, 0)) (1 + c x'), A K max(x - h, 0)^2/2 is stored too
 *
 * in engine "native"; Hertz's law has no layers. For a mesh on a sphere it is the volume that a
 * sphere smaller by h has in common with it.
 *
 * Elements are the triangles of a mesh. x is the distance of the centroid to the nearest point of
 * the other surface; force and velocities belong to the point between them that divides x by s1 and
 * s2. Where both surfaces are meshes, half of the sum over each counts, or, in the engine "native",
 * the pressure field of one of them (below). A sphere on a half-space or on a sphere is one element
 * with Hertz's law instead: f_n = 4/3 E sqrt(R) x^1.5 (1 + 1.5 c x'), R the relative radius,
 * E = (K1 K2/(K1 + K2))^1.5 with K_i = young_i^(2/3), shares s_i by K_i; thickness plays no part,
 * and 2/5 of the elastic force times x is stored.
 *
 * A capsule is always a foundation, with k as above, and passes smoothly from a point to a line as
 * it comes to lie down. On a half-space the elastic force is k times the volume below the plane, at
 * the center of that volume, and k times the integral of the depth over it is stored (a body's
 * buoyancy): a capsule without length is the sphere of a mesh, not Hertz's. On another capsule or a
 * sphere, with x = R1 + R2 - distance at a point of one axis to the nearest of the other, and
 * R = R1 R2/(R1 + R2), the volume in common is
 *
 *     V = 1/2 integral of 4/3 sqrt(2 R) x^1.5 ds over both axes + 1/4 sum of pi R x^2 over all ends
 *
 * a sphere has two ends in one place. For small x this is the volume between paraboloids for axes
 * that cross at any angle (pi x^2 sqrt(R1 R2)/sin) or lie side by side; for a tip on the middle of
 * a side it is 12 % under it at equal radii, for two tips half of it. Every term is the slope of an
 * energy that depends on the pose alone, so that a closed way through touching poses gains nothing.
 *
 * Sticking friction (stiction): each pair has bristles, tangential springs between the surfaces of
 * a and b that are bent by the motion of b relative to a, and yield where they bear more than
 * mu f_n. Their state in the pair, which the integrator keeps, is y = (shear y_s, twist y_n), of
 * the dimension of a root of energy, and the anchor that they stand on: a point c and an axis u,
 * fixed in the surface that the normals do not belong to, and a radius r. Stiffness and anchor
 * follow the area that touches, never the load: with n the mean normal, c_A the centroid of that
 * area on the same surface, r_A the RMS distance of the area from the axis through c_A along n, v
 * the sliding velocity of b against a at c, w their relative angular velocity,
 *
 *     anchor     (c_A, n, r_A) where surfaces come to touch, then dragged along no further than to
 *                where r_A <= r <= 1.25 r_A, c is r_A off c_A across n and r_A/64 along it, and
 *                the sine between u and n is 1/16
 *     twist      w_n = w . (n + u)/(1 + n . u): the rate of an angle that depends on how a and b
 *                stand alone, which w . n is not
 *     stiffness  s = 5 k A_0, a constant of the pair: that of soles of rubber in shear
 *                (docs/contact.md). A_0 is the largest side of the box about the smaller surface,
 *                or the cap of a sphere or capsule whose depth is a quarter of its radius; with
 *                Hertz s = 5 E R
 *     rate       y_s' = sqrt(s) v + W x y_s - q y_s, W the spin about n of the surface that the
 *                normals belong to
 *                y_n' = sqrt(s) r w_n - q y_n
 *     whole      F = -sqrt(s) (y_s + t_d y_s') at c, M = -sqrt(s) r (y_n + t_d y_n') about
 *                (n + u)/(1 + n . u), y' without W and q
 *     demand     x = sqrt(|F|^2 + (M_p/r_p)^2)/(mu N): N the sum of the f_n, M_p the moment about
 *                the center of pressure, r_p as r_A but of the pressure about it; 1 on the
 *                ellipsoid that stands for all forces with which the patch slides (Howe, Cutkosky
 *                1996)
 *     elements   f_t = -sqrt(s) e min(alpha, l/|e|), e = g + sqrt(s) t_d v, alpha the element's
 *                share of the area, g = y_s + y_n n x (p - c)/r at p, less its part along the
 *                element's normal, l = mu(v) f_n/sqrt(s), mu as above but us S(u) = us below v_t:
 *                it holds at rest. Where none is at its limit and c = c_A, r = r_A they bear what
 *                the whole does
 *     friction   that of the whole for x <= 0.80, of the elements for x >= 0.95, between them
 *                weighted by S
 *     yield      q = 0 for x <= 0.80, else max(q_1, q_2, 0) with
 *                q_1 = (1 - b)/t_y, b the scale at which b y would have sum min(alpha |g|, l)|g| =
 *                0.998 sum l |g|: all but two thousandths of what sliding that way would give
 *                q_2 = (y . y' without q - power of friction)/|y|^2
 *                What yields is anchored anew: (c, u, r) goes to (c_A, n, r_A) at the rate q
 *     stored     |y|^2/2; dissipated: what else friction takes from the motion
 *
 * with t_d = t_y = 0.5 ms. A patch that shrinks keeps its y; a pair that does not touch loses
 * y and the anchor at the rate 1/t_y. So while the load is inside what friction can hold nothing
 * yields, and as long as the area rocks within the anchor's play the force depends on places alone:
 * nothing creeps, however the load swings and edges lift. All elements yield at
 * once in a pure translation; sliding, y follows the sliding motion, and f_t is Coulomb's at every
 * element. The stored energy depends on y alone; the power of the whole is y . y' and what the
 * retardation t_d takes, whatever the anchor does, and q_2 lets it grow by no more than the work of
 * the elements: nothing that normal forces, patches and normals do in the meantime makes energy
 * (docs/contact.md). The elements are the elasto-plastic bristle of Dupont, Hayward, Armstrong,
 * Altpeter (2002) with one rigid motion for the bristles of a patch.
 */
#ifndef CONTACT_CONTACT_H
#define CONTACT_CONTACT_H

#include "base/arena.h"
#include "base/error.h"
#include "base/motion.h"
#include "contact/mesh/mesh.h"

#include <stdbool.h>
#include <stddef.h>

#define CONTACT_MAX_BODIES 1024
#define CONTACT_MAX_SURFACES 1024
#define CONTACT_MAX_PAIRS 16384

/* Shapes of surfaces. */
enum contact_shape {
    CONTACT_HALF_SPACE, /* solid below the surface frame's z = 0 plane, outward normal +z */
    CONTACT_SPHERE,     /* centered at the surface frame's origin */
    CONTACT_BOX,        /* centered, faces along the frame's axes, a mesh of its own */
    CONTACT_MESH,       /* closed triangle mesh in the surface frame */
    CONTACT_CAPSULE,    /* centered, its axis along the frame's z, a half-sphere at each end */
};

/* Material of a surface: elastic layer, dissipation and friction. */
struct contact_material {
    double young_pa;                          /* of the elastic layer */
    double thickness_m;                       /* of the elastic layer */
    double dissipation_s_per_m;               /* c: damping of the normal force */
    double static_friction, dynamic_friction; /* dimensionless */
    double viscous_friction;                  /* s/m */
    double backing_pa_per_m; /* of what is behind the layer; 0 = the layer never ends */
};

/* A surface fixed to a body or to the world. */
struct contact_surface {
    const char *name;
    int body; /* index into the motions given to evaluate; -1 = the fixed world */
    enum contact_shape shape;
    double position[3];      /* of the surface frame in the body (or world) frame, m */
    double rotation[9];      /* surface frame to body frame, row-major */
    double radius_m;         /* sphere, capsule */
    double length_m;         /* capsule: of its axis, without the ends; 0 or more */
    double half_extent_m[3]; /* box */
    int cells_per_edge;      /* box: 7 gives Simbody's 588 faces */
    const struct mesh *mesh; /* mesh; must outlive the world */
    struct contact_material material;
};

/* Two surfaces that may touch: only configured pairs interact. Capsules that are wider than what
 * they are drawn about may overlap by a slack before they touch: each counts as thinner by half of
 * it. */
struct contact_pair {
    int a, b;       /* indices of surfaces */
    double slack_m; /* of two capsules, or a capsule and a sphere: less than either's diameter */
};

/* How engine "native" computes the contact force between two meshes (or boxes). */
enum contact_mesh_law {
    CONTACT_PRESSURE_FIELD,     /* the gradient of a potential: conservative */
    CONTACT_ELASTIC_FOUNDATION, /* the paper's: the mean of both meshes' sums */
};

/* Laws of friction: see the top. */
enum contact_friction {
    CONTACT_FRICTION_REGULARIZED, /* by the sliding velocity alone: the paper's */
    CONTACT_FRICTION_STICKING,    /* with bristles that hold at rest; engine native only */
};

/* What an engine is created from. */
struct contact_config {
    size_t nbody;
    size_t nsurface;
    const struct contact_surface *surface;
    size_t npair;
    const struct contact_pair *pair;
    double transition_velocity_m_s; /* of the friction law, > 0 */
    enum contact_mesh_law mesh_law;
    enum contact_friction friction;
};

/* Force and moment on a body; world frame, about the body's origin. */
struct contact_wrench {
    double force[3];  /* N */
    double moment[3]; /* N m */
};

/* Contact patch: one pair in touch; world frame. Force on surface b's body; the opposite acts on
 * a's. */
struct contact_patch {
    int pair;
    double center[3];     /* where the force acts, m */
    double force[3];      /* N */
    double moment[3];     /* about the center, N m */
    double area_m2;       /* 0 where the engine does not say */
    double penetration_m; /* largest depth; 0 where the engine does not say */
    double potential_j;   /* stored in the elastic layers */
    double dissipation_w; /* being dissipated */
};

/* Rows and columns of a tangent: displacements (or velocities, forces), then rotations (angular
 * velocities, moments). */
enum contact_axis {
    CONTACT_MOVE_X,
    CONTACT_MOVE_Y,
    CONTACT_MOVE_Z,
    CONTACT_TURN_X,
    CONTACT_TURN_Y,
    CONTACT_TURN_Z,
    CONTACT_AXES
};

/* A symmetric 6x6 matrix is stored as its upper triangle by rows: the number of its elements, and
 * the index of the one at (row, column), row <= column. */
#define CONTACT_TANGENT_SIZE 21
#define CONTACT_TANGENT_AT(row, column) ((row) * (11 - (row)) / 2 + (column))

/* Tangent stiffness and damping of one pair in touch: a small motion of b relative to a at center,
 * displacement X and velocity V (linear, angular; world frame), changes the wrench on b there by
 * about -(K X + D V). Both are positive semidefinite. For implicit integration, which stays stable
 * when they err upward: regularized friction counts by a bound of its slope, and the terms by which
 * the normals turn or friction grows with the normal force are left out. Bristles count in D, since
 * they are bent by the velocity for the time ahead: the shear changes by bristle_per_m_s times the
 * part of the velocity at bristle_arm across the normal, the twist by bristle_per_rad_s times the
 * part of the angular velocity along bristle_axis. Their own wrench and part of D are given too:
 * the work that friction takes from a motion bounds the energy that they may store by it; and so is
 * what friction may be at most, of the sum of the normal forces. */
struct contact_tangent {
    int pair;
    int body_a, body_b; /* indices into the motions, -1 = the fixed world */
    double center[3];
    double K[CONTACT_TANGENT_SIZE];            /* N/m, N, N m */
    double D[CONTACT_TANGENT_SIZE];            /* N s/m, N s, N m s */
    double normal[3];                          /* mean, the way b is pushed; 0 without bristles */
    double bristle_per_m_s, bristle_per_rad_s; /* J^0.5 after the time ahead, per velocity */
    double bristle_arm[3];                     /* from center to where the bristles stand */
    double bristle_axis[3];                    /* that the twist turns about, along normal */
    double friction[CONTACT_AXES];             /* of bristles: on b at center; N, N m */
    double friction_D[CONTACT_TANGENT_SIZE];   /* their part of D */
    double pressing;                           /* sum of the normal forces, N; 0 without bristles */
    double friction_max; /* most that friction may be of it at the present velocity */
};

/* Parts of a pair's bristles: the shear y_s in the world frame, J^0.5, of b's motion against a, the
 * twist y_n about the mean normal, J^0.5, and the anchor: r c (m2) and r u (m), both in the frame
 * of the surface that c and u are fixed in; all 0 before the surfaces touch. */
enum contact_bristle_part {
    BRISTLE_SHEAR = 0,
    BRISTLE_TWIST = 3,
    BRISTLE_BENT = 4, /* number of those that bend and store energy */
    BRISTLE_POINT = 4,
    BRISTLE_AXIS = 7,
    CONTACT_BRISTLE = 10, /* number of all */
};

/* State of the bristles for an evaluation; those of pair i are y[CONTACT_BRISTLE i] and those that
 * follow. With a time ahead, friction is that of the bristles as the present velocities would have
 * bent them after that time, and rate leads there: the step of an implicit integrator. Only listed
 * pairs cost time: the caller lists all whose bristles are not 0, each once; evaluate appends those
 * that touch. */
struct contact_bristles {
    const double *y; /* the world's nbristle, J^0.5; 0 where a pair is not listed */
    double ahead_s;  /* >= 0 */
    double *rate;    /* of the listed pairs, overwritten: their mean rates over that time, J^0.5/s;
                      * NULL = not wanted, and nothing is listed further */
    int *pair;       /* with room for all pairs of the world */
    size_t npair;
};

/* Checks a configuration and refuses with ERROR_INPUT what no engine can work with: indices out of
 * range, numbers that are not finite or not in their range (dynamic friction over static too),
 * rotations that are not orthonormal and right-handed, unsound meshes, pairs of one body with
 * itself, of two half-spaces, or given twice. Not RT-safe. */
enum error_code contact_config_check(const struct contact_config *config, struct error *error);

/* Checks that an engine can take n motions: numbers within 1e9, and R a rotation within the error
 * that an integrator's stage may leave in it (1 %). Otherwise ERROR_INPUT, and the first that is
 * invalid is named in failure (size bytes). RT-safe. */
enum error_code contact_check_motions(const struct body_motion *motion, size_t n, char *failure,
                                      size_t size);

struct contact_world;

/* Functions of an engine. */
struct contact_ops {
    const char *name;
    /* Computes contact and friction: the wrenches on all nbody bodies (overwritten). bristles: NULL
     * = all relaxed, the only choice of a world without. Returns ERROR_NONE, ERROR_INPUT for
     * numbers that are not valid, or the engine's failure; wrench and rates are then undefined. R
     * has to be a rotation, which an engine need not check. */
    enum error_code (*evaluate)(struct contact_world *world, const struct body_motion *motion,
                                struct contact_bristles *bristles, struct contact_wrench *wrench);
    /* Writes at most max patches of the last evaluation; returns how many there are. */
    size_t (*patches)(struct contact_world *world, struct contact_patch *patch, size_t max);
    /* Computes at most max tangents at the last evaluation; returns how many there are. May be
     * NULL: then the world cannot be integrated implicitly. */
    size_t (*tangents)(struct contact_world *world, struct contact_tangent *tangent, size_t max);
    /* Returns the engine's message after a failed evaluate. */
    const char *(*failure)(const struct contact_world *world);
    void (*destroy)(struct contact_world *world);
};

/* An engine's private struct begins with this. */
struct contact_world {
    const struct contact_ops *ops;
    size_t nbristle; /* numbers of the bristles' state; 0 without sticking friction */
};

/* Engine "simbody": Simbody's CompliantContactSubsystem with one free shadow body per contact body
 * (paper Fig. 7), all set, then realized to Dynamics once an evaluation. The result depends on
 * nothing but the motion. Only the given pairs interact. Allocates while it evaluates, so it is
 * not RT-safe. The world is the caller's: destroy it with world->ops->destroy.
 *
 * Where Simbody's numbers differ from the law above:
 * - Triangles count whole, by their centroid: in or out, however little of them overlaps. Mesh on
 *   mesh, each mesh's sum is scaled so that the triangles that overlap at all cover the mean of
 *   both meshes' areas, not by one half: coarse meshes push too hard (a box on a flat table of 12
 *   faces 1.4 to 41 times, the more the larger the table).
 * - A face that has sunk below a half-space pushes along the half-space's normal, also one that
 *   stands upright: the sides of a box deeper than its first centroids add to the force.
 * - A sphere smaller than the mesh's cells can touch between centroids and feel nothing.
 * - Force patches give neither area nor depth.
 * - Layers never end: nothing backs them.
 * It has no capsules, and of friction the regularized law only: ERROR_UNSUPPORTED. */
enum error_code contact_simbody_create(const struct contact_config *config,
                                       struct contact_world **world, struct error *error);

/* Finds the module that holds the engine "simbody", which is loaded by the first world that is
 * created; writes its path, or where it was expected and returns false: then creating a world is
 * ERROR_UNSUPPORTED. Not RT-safe. */
bool contact_simbody_find(char *path, size_t size);

/* Engine "native": keeps real time. All that is done with its world is RT-safe; memory from
 * arena, which the world must not outlive; destroy does nothing. What is common to two surfaces
 * is integrated over their true overlap, so that the wrench is continuous in the pose, does not
 * depend on how finely a flat side is cut into triangles, and converges as curved ones are
 * refined:
 * - Springs are a bed: side by side on a plane, along one direction, as long as the overlap is
 *   deep there. The elastic force of a bed is k times the volume that it stands in. Coplanar
 *   triangles that make up a convex polygon are one facet.
 * - Mesh on half-space: along the plane's normal. A facet that stands upright or is turned away
 *   adds nothing (Simbody lets both push).
 * - Mesh on mesh, CONTACT_PRESSURE_FIELD: inside one of the two, the carrier, every point has a
 *   depth x under its surface (contact/mesh/field.h), and k x is a pressure (after Elandt,
 *   Drumwright, Sherman, Ruina 2019). The elastic potential U is k times the integral of x over the
 *   volume V that both have in common. As x is 0 on the carrier's part of V's surface, U changes
 *   with the pose of the other one, the visitor, by what its surface sweeps:
 *
 *       f = -k integral of x n dA,  m = -k integral of r x n dA  over the visitor's surface in V
 *
 *   act on it, n its outward normal, and the opposite on the carrier: minus the gradient of U. So
 *   what goes in comes out again along any closed path, whatever the field and however the meshes
 *   are cut. On a flat side U does not depend on where along it the visitor is: nothing pushes
 *   along the side, and f is k times the volume under it as on a half-space, k A x flat on flat.
 *   Within x of the carrier's edges x is the depth under the nearer side. Friction and dissipation
 *   take the way in which x grows for the normal; what of f is not along it, and adds up to nothing
 *   on a flat side, neither damps nor rubs. The energy stored is reported as k A x^2/2, which is U
 *   on flat sides, and off near edges and where the carrier is curved, by half over a thin edge.
 *   The carrier is the larger of the two (by the diagonals of their boxes; else the pair's a). If
 *   its depth is nowhere more than c and the other's is, as with a body on a plate, U also has k
 *   times the integral of what the other's depth is over c. So force does not vanish past the
 *   plate's thickness, but when the body's middle has come through.
 * - Mesh on mesh, CONTACT_ELASTIC_FOUNDATION: between each two facets that face each other, along
 *   the mean of their normals. The sums over either mesh in eq (6) are over the same overlap, so
 *   half of both is one of them. A tilted block is thus pushed sideways by half of its tilt, as in
 *   Simbody's mean of both sums, and closed paths gain or lose energy. The force fades out as the
 *   normals get near a right angle (full up to 60 degrees off, none from 84), and where a spring
 *   would run along the overlap instead of across it.
 * - Sphere on mesh: over each facet along its normal to the sphere's far side: k times the cap's
 *   volume on a flat side, wherever on it. A sphere that has sunk under a facet as deep as it is
 *   wide is no longer held by it. Sphere on half-space or sphere: Hertz's law, as above.
 * - Capsule on mesh: as a mesh of 256 triangles (mesh_capsule). In a pressure field it is the
 *   visitor, whatever its size, and its own depth never counts.
 * - Velocity, dissipation and friction are taken at three points between a facet's centroid and
 *   each edge of the overlap, at three in all on facets that are small against the smaller mesh
 *   (four points of a sphere's patch). In a pressure field at three in each triangle, no wider than
 *   0.6 of the smaller mesh's radius, that a facet in a cell of the field is cut into; in a shell's
 *   (contact/mesh/field.h) at three in each part no wider than that.
 * Pairs whose bounding balls are apart cost a few instructions, several pairs at a time.
 * Nothing is kept from one evaluation for the next (bristles are the caller's), so the same motion
 * always gives the same bits on the same machine. The kernels are compiled for several instruction
 * sets, of which the best that the machine can run is taken; all add up in the same order
 * (contact/lanes.h) and give the same bits.
 *
 * Work at worst: for a half-space or a sphere the number of facets; in a pressure field the number
 * of pairs of a facet and a cell that meet, which even for meshes that are all within each other
 * grows as their numbers of facets and not as the product of these; with
 * CONTACT_ELASTIC_FOUNDATION that product. It follows the patch where surfaces just touch, as those
 * of a robot do: a walk down the trees to the box that both have in common, then the facets in it.
 * tests/bench/contact_instructions.sh counts it: the worst of random poses of a foot, a box or a
 * sphere in touch stays within three times the median. */
enum error_code contact_native_create(const struct contact_config *config, struct arena *arena,
                                      struct contact_world **world, struct error *error);

#endif
