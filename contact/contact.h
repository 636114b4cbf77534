/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Compliant contact (penalty method) and friction between surfaces on moving bodies and the ground:
 * elastic foundation, paper eqs (6), (7). Input: poses and velocities of the bodies. Output: the
 * wrench on each body. SI units, world frame unless a comment says otherwise. Creating a world and
 * checking its configuration are not RT-safe; each engine says below whether its evaluation is
 * RT-safe. C only: no exception and no C++ type crosses this header.
 *
 * Law at a surface element of area A with penetration depth x into the other surface. x' is the
 * rate of x; indices 1 and 2 are the two surfaces (Sherman, Seth, Delp 2011; Simbody's
 * CompliantContactSubsystem):
 *
 *     normal     f_n = k A x (1 + c x'), never negative
 *                k = k1 k2/(k1 + k2), k_i = young_i/thickness_i
 *                c = s1 c1 + s2 c2, s_i the share of x by which surface i is compressed:
 *                s1 = k2/(k1 + k2), s2 = 1 - s1
 *     friction   (regularized) f_t = mu(v) f_n, opposite to the sliding velocity v. mu falls from
 *                static to dynamic friction (Stribeck). v_t is the transition velocity, u = v/v_t,
 *                mu = us S(u) + uv v                          for u < 1
 *                mu = us - (us - ud) S((u - 1)/2) + uv v      for 1 <= u < 3
 *                mu = ud + uv v                               for 3 <= u
 *                S(x) = 10 x^3 - 15 x^4 + 6 x^5. us, ud, uv are the harmonic means of the
 *                coefficients of the two surfaces.
 *     energy     stored: k A x^2/2. Dissipated power: (f_n - k A x) x' + mu f_n v. It equals
 *                c k A x x'^2 + mu f_n v, except where surfaces part faster than layers expand
 *                (f_n = 0). Neither is ever negative.
 *
 * An elastic layer has an end: the linear law holds only for x well below the thickness. Beyond it,
 * the material behind the layers adds stiffness. With K = K1 K2/(K1 + K2), K_i = backing_pa_per_m
 * of surface i, and h the sum of both thicknesses:
 *
 *     normal     f_n = A (k x + K max(x - h, 0)) (1 + c x'), A K max(x - h, 0)^2/2 is stored too
 *
 * If K_i is 0 for either surface, the layers have no end, as in the paper. Only the engine "native"
 * has backing, and Hertz's law has none. For a mesh on a sphere, the backing's overlap is the
 * overlap of the mesh with a sphere that is smaller by h.
 *
 * Elements are the triangles of a mesh. x is the distance from the centroid to the nearest point of
 * the other surface. Force and velocities are taken at the point that divides this distance by s1
 * and s2. Between two meshes, the result is half of the sum over both meshes. The engine "native"
 * can use the pressure field of one of them instead (below).
 *
 * A sphere on a half-space or on a sphere is one element with Hertz's law instead: f_n = 4/3 E
 * sqrt(R) x^1.5 (1 + 1.5 c x'), R the relative radius, E = (K1 K2/(K1 + K2))^1.5 with K_i =
 * young_i^(2/3), shares s_i from K_i. The thickness has no effect, and 2/5 of the elastic force
 * times x is stored.
 *
 * A capsule always uses the elastic foundation with k as above. Its contact changes smoothly from a
 * point to a line as the capsule lies down. On a half-space, the elastic force is k times the
 * volume below the plane and acts at the center of that volume. The stored energy is k times the
 * integral of the depth over it (like buoyancy). So a capsule of length 0 behaves as a sphere made
 * of a mesh, not as Hertz's. On another capsule or a sphere, let x = R1 + R2 - the distance from a
 * point of one axis to the nearest point of the other, and R = R1 R2/(R1 + R2). The common volume
 * is
 *
 *     V = 1/2 integral of 4/3 sqrt(2 R) x^1.5 ds over both axes + 1/4 sum of pi R x^2 over all ends
 *
 * A sphere has two ends in one place. For small x, V is the volume between paraboloids for axes
 * that cross at any angle (pi x^2 sqrt(R1 R2)/sin) or are parallel. For a tip on the middle of a
 * side, V is 12 % too small at equal radii; for two tips it is half. Each term is the gradient of
 * an energy that depends on the pose only, so a closed path gains no energy.
 *
 * Sticking friction (stiction): each pair has bristles, tangential springs between the surfaces of
 * a and b. The motion of b relative to a bends them. They yield where they would bear more than mu
 * f_n. The state of a pair, kept by the integrator, is y = (shear y_s, twist y_n) in J^0.5, and the
 * anchor of the bristles. The anchor is a point c and an axis u, fixed in the surface that does not
 * define the normals, and a radius r. Stiffness and anchor depend on the area in touch, never on
 * the load. Symbols: n the mean normal, c_A the centroid of the area in touch on the anchor's
 * surface, r_A the RMS distance of that area from the axis through c_A along n, v the sliding
 * velocity of b against a at c, w their relative angular velocity.
 *
 *     anchor     (c_A, n, r_A) at first touch. Then it is dragged along only to keep it within its
 *                play: r_A <= r <= 1.25 r_A, distance of c from c_A at most r_A across n and
 *                r_A/64 along n, sine of the angle between u and n at most 1/16
 *     twist      w_n = w . (n + u)/(1 + n . u): the rate of an angle that depends only on the
 *                relative orientation of a and b. w . n is not such a rate.
 *     stiffness  s = 5 k A_0, a constant of the pair, as for rubber soles in shear
 *                (docs/contact.md). A_0 is the largest side of the box about the smaller surface,
 *                or the cap of a sphere or capsule whose depth is a quarter of its radius. With
 *                Hertz's law s = 5 E R
 *     rate       y_s' = sqrt(s) v + W x y_s - q y_s, W the spin about n of the surface that defines
 *                the normals
 *                y_n' = sqrt(s) r w_n - q y_n
 *     whole      F = -sqrt(s) (y_s + t_d y_s') at c, M = -sqrt(s) r (y_n + t_d y_n') about
 *                (n + u)/(1 + n . u), y' without W and q: the patch as one spring
 *     demand     x = sqrt(|F|^2 + (M_p/r_p)^2)/(mu N), N the sum of the f_n, M_p the moment about
 *                the center of pressure, r_p the RMS distance of the pressure from it. x = 1 on an
 *                ellipsoid that approximates the forces at which the patch slides (Howe, Cutkosky
 *                1996)
 *     elements   f_t = -sqrt(s) e min(alpha, l/|e|), e = g + sqrt(s) t_d v, alpha the element's
 *                share of the area, g = y_s + y_n n x (p - c)/r at p, less its part along the
 *                element's normal, l = mu(v) f_n/sqrt(s). mu is as above, but us S(u) = us below
 *                v_t, so that elements hold at rest. If no element is at its limit and c = c_A,
 *                r = r_A, the elements together equal the whole
 *     friction   the whole for x <= 0.80, the elements for x >= 0.95, a blend by S between them
 *     yield      q = 0 for x <= 0.80, else max(q_1, q_2, 0) with
 *                q_1 = (1 - b)/t_y, b the scale at which b y would have sum min(alpha |g|, l)|g| =
 *                0.998 sum l |g|: 99.8 % of the friction of sliding in that direction
 *                q_2 = (y . y' without q - power of friction)/|y|^2
 *                A patch that yields gets a new anchor: (c, u, r) goes to (c_A, n, r_A) at rate q
 *     energy     stored: |y|^2/2. Dissipated: the rest of the power that friction takes
 *
 * with t_d = t_y = 0.5 ms. A patch that shrinks keeps its y. A pair that does not touch loses y and
 * its anchor at the rate 1/t_y.
 *
 * Properties: below the friction limit nothing yields. While the area moves within the play of the
 * anchor, the force depends on the pose only. So nothing creeps when the load varies or edges lift.
 * In pure translation all elements yield at once. During sliding, y follows the sliding motion and
 * f_t is Coulomb friction at each element.
 *
 * The stored energy depends on y only. The power of the whole is y . y' plus the loss by the
 * retardation t_d, for any motion of the anchor. q_2 limits the growth of the stored energy to the
 * work of the elements.
 * So friction is passive under any change of normal force, patch or normals (docs/contact.md). The
 * elements are the elasto-plastic bristle of Dupont, Hayward, Armstrong, Altpeter (2002), with one
 * rigid motion for all bristles of a patch.
 */
#ifndef CONTACT_CONTACT_H
#define CONTACT_CONTACT_H

#include "base/arena.h"
#include "base/error.h"
#include "base/motion.h"
#include "contact/mesh/mesh.h"

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
    double young_pa;                          /* Young's modulus of the elastic layer */
    double thickness_m;                       /* thickness of the elastic layer */
    double dissipation_s_per_m;               /* c: damping coefficient of the normal force */
    double static_friction, dynamic_friction; /* dimensionless */
    double viscous_friction;                  /* s/m */
    /* stiffness of the material behind the layer; 0 = the layer never ends */
    double backing_pa_per_m;
};

/* A surface fixed to a body or to the world. */
struct contact_surface {
    const char *name;
    int body; /* index into the motions given to evaluate; -1 = the fixed world */
    enum contact_shape shape;
    double position[3]; /* origin of the surface frame in the body (or world) frame, m */
    double rotation[9]; /* surface frame to body frame, row-major */
    double radius_m;    /* spheres and capsules only */
    /* capsules only: length of the axis without the half-spheres; 0 or more */
    double length_m;
    double half_extent_m[3]; /* boxes only */
    int cells_per_edge;      /* boxes only; 7 gives Simbody's 588 faces */
    const struct mesh *mesh; /* meshes only; must outlive the world */
    struct contact_material material;
};

/* Two surfaces that may touch. Only configured pairs interact. slack_m is the overlap that capsules
 * may have before they touch, for capsules wider than the part that they enclose. Each surface then
 * counts as thinner by half of the slack. */
struct contact_pair {
    int a, b; /* indices of surfaces */
    /* only between two capsules, or a capsule and a sphere; less than either diameter */
    double slack_m;
};

/* How engine "native" computes the contact force between two meshes (or boxes). */
enum contact_mesh_law {
    CONTACT_PRESSURE_FIELD,     /* force is the gradient of a potential: conservative */
    CONTACT_ELASTIC_FOUNDATION, /* the paper's law: mean of the sums over both meshes */
};

/* Friction laws: see the top of this file. */
enum contact_friction {
    CONTACT_FRICTION_REGULARIZED, /* depends on the sliding velocity only, as in the paper */
    CONTACT_FRICTION_STICKING,    /* bristles that hold at rest; engine native only */
};

/* Input for creating an engine. */
struct contact_config {
    size_t nbody;
    size_t nsurface;
    const struct contact_surface *surface;
    size_t npair;
    const struct contact_pair *pair;
    double transition_velocity_m_s; /* transition velocity v_t of the friction law, > 0 */
    enum contact_mesh_law mesh_law;
    enum contact_friction friction;
};

/* Force and moment on a body; world frame, about the body's origin. */
struct contact_wrench {
    double force[3];  /* N */
    double moment[3]; /* N m */
};

/* Contact patch: one pair in contact; world frame. The force acts on the body of surface b; the
 * opposite force acts on the body of a. */
struct contact_patch {
    int pair;
    double center[3];     /* where the force acts, m */
    double force[3];      /* N */
    double moment[3];     /* about the center, N m */
    double area_m2;       /* 0 if the engine does not report it */
    double penetration_m; /* largest depth; 0 if the engine does not report it */
    double potential_j;   /* stored in the elastic layers */
    double dissipation_w; /* dissipated power */
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

/* Packed symmetric 6x6 matrix: the upper triangle by rows. CONTACT_TANGENT_SIZE is the number of
 * its elements, CONTACT_TANGENT_AT the index of (row, column), row <= column. */
#define CONTACT_TANGENT_SIZE 21
#define CONTACT_TANGENT_AT(row, column) ((row) * (11 - (row)) / 2 + (column))

/* Tangent stiffness and damping of one pair in contact, world frame. A small motion of b relative
 * to a at center, displacement X and velocity V (linear, angular), changes the wrench on b there by
 * about -(K X + D V). Both are positive semidefinite. They are meant for implicit integration,
 * which stays stable if they are too large. So regularized friction uses an upper bound of its
 * slope. The terms for the rotation of normals and for the growth of friction with the normal force
 * are left out. D includes the bristles, because the velocity bends them during the time ahead. The
 * shear changes by bristle_per_m_s times the velocity across the normal at bristle_arm. The twist
 * changes by bristle_per_rad_s times the angular velocity along bristle_axis. The integrator needs
 * the bristles' own wrench and their share of D, because the work of friction bounds the stored
 * energy. It needs friction_max, because the normal force bounds friction. */
struct contact_tangent {
    int pair;
    int body_a, body_b; /* indices into the motions, -1 = the fixed world */
    double center[3];
    double K[CONTACT_TANGENT_SIZE]; /* N/m, N, N m */
    double D[CONTACT_TANGENT_SIZE]; /* N s/m, N s, N m s */
    /* mean direction in which b is pushed; 0 without bristles */
    double normal[3];
    double bristle_per_m_s, bristle_per_rad_s; /* change of the bend per velocity, J^0.5 */
    double bristle_arm[3];                     /* from center to the anchor of the bristles */
    double bristle_axis[3];                    /* axis of the twist, close to normal */
    double friction[CONTACT_AXES];             /* wrench of the bristles on b at center; N, N m */
    double friction_D[CONTACT_TANGENT_SIZE];   /* share of D from the bristles */
    /* sum of the normal forces, N; 0 without bristles */
    double pressing;
    double friction_max; /* largest ratio of friction to pressing at the present velocity */
    /* Share of friction that is at its limit, 0 to 1. It is proportional to the normal force, and
     * constant along the sliding direction. slide_D would be its damping along that direction: it
     * ends friction together with the velocity. It is no part of friction_D and D. */
    double sliding;
    double slide_D[CONTACT_TANGENT_SIZE];
};

/* Parts of the bristle state of a pair. The shear y_s (J^0.5) is in the world frame, for the
 * motion of b against a. The twist y_n (J^0.5) is about the mean normal. The anchor is stored as r
 * c (m2) and r u (m), both in the frame of the surface in which c and u are fixed. All parts are 0
 * before the surfaces touch. */
enum contact_bristle_part {
    BRISTLE_SHEAR = 0,
    BRISTLE_TWIST = 3,
    BRISTLE_BENT = 4, /* number of parts that bend and store energy */
    BRISTLE_POINT = 4,
    BRISTLE_AXIS = 7,
    CONTACT_BRISTLE = 10, /* number of all parts */
};

/* Bristle state for an evaluation: the state of pair i begins at y[CONTACT_BRISTLE i]. With ahead_s
 * > 0, an implicit integrator's step: the present velocities bend the bristles for that time,
 * friction is evaluated in the bent state, and rate leads to that state. Only listed pairs cost
 * time. The caller lists each pair with a nonzero state once. evaluate appends the pairs that
 * touch. */
struct contact_bristles {
    const double *y; /* world->nbristle numbers; 0 for a pair that is not listed */
    double ahead_s;  /* >= 0 */
    /* output: mean rates of the listed pairs over ahead_s, J^0.5/s. NULL = not wanted; then
     * evaluate appends no pairs */
    double *rate;
    int *pair; /* indices of listed pairs; room for all pairs */
    size_t npair;
};

/* Checks a configuration. Returns ERROR_INPUT for too many bodies, surfaces or pairs, and for pairs
 * of two half-spaces. The reader of a rig has checked the rest, which the engines require: indices
 * in range; names; finite numbers in the ranges above; dynamic friction not above static friction;
 * right-handed orthonormal rotations; sound meshes; two bodies in each pair; no pair twice. Not
 * RT-safe. */
enum error_code contact_config_check(const struct contact_config *config, struct error *error);

/* Checks the numbers of n motions: finite and within 1e9. Otherwise returns ERROR_INPUT and writes
 * the first invalid number to failure (size bytes). RT-safe. */
enum error_code contact_check_motions(const struct body_motion *motion, size_t n, char *failure,
                                      size_t size);

struct contact_world;

/* Functions of an engine. */
struct contact_ops {
    const char *name;
    /* Computes contact and friction: overwrites the wrenches of all nbody bodies. bristles may be
     * NULL: all bristles are relaxed, and a world without bristles requires NULL. Returns
     * ERROR_NONE, ERROR_INPUT for invalid numbers, or the engine's failure; wrench and rates are
     * then undefined. R must be a rotation; an engine need not check it. */
    enum error_code (*evaluate)(struct contact_world *world, const struct body_motion *motion,
                                struct contact_bristles *bristles, struct contact_wrench *wrench);
    /* Writes at most max patches of the last evaluation; returns the number of patches. */
    size_t (*patches)(struct contact_world *world, struct contact_patch *patch, size_t max);
    /* Computes at most max tangents at the last evaluation; returns the number of tangents. May be
     * NULL: then the world cannot be integrated implicitly. */
    size_t (*tangents)(struct contact_world *world, struct contact_tangent *tangent, size_t max);
    /* Returns the engine's message after a failed evaluate. */
    const char *(*failure)(const struct contact_world *world);
    void (*destroy)(struct contact_world *world);
};

/* Base of an engine: the first member of the engine's private struct. */
struct contact_world {
    const struct contact_ops *ops;
    size_t nbristle; /* size of the bristle state y; 0 without sticking friction */
};

/* Creates the engine "simbody": Simbody's CompliantContactSubsystem with one free shadow body per
 * contact body (paper Fig. 7). Each evaluation sets all shadows and realizes the system to
 * Dynamics once. The result depends on the motion only. Only the given pairs interact. Evaluation
 * allocates, so it is not RT-safe. The caller owns the world and destroys it with
 * world->ops->destroy.
 *
 * Differences of Simbody's results from the law above:
 * - A triangle counts fully or not at all, by the position of its centroid. For mesh on mesh,
 *   Simbody does not take half of both sums. It scales each sum so that the overlapping triangles
 *   cover the mean of both meshes' areas. So coarse meshes push too hard: a box on a flat table of
 *   12 faces pushes 1.4 to 41 times too hard, and more on a larger table.
 * - A face below a half-space pushes along the half-space's normal even if the face is vertical.
 *   So the sides of a box add force once the box is deeper than their first centroids.
 * - A sphere smaller than the cells of a mesh can touch between centroids without any force.
 * - Force patches have neither area nor depth.
 * - Layers have no end: there is no backing.
 *
 * Capsules and sticking friction are not available: ERROR_UNSUPPORTED. */
enum error_code contact_simbody_create(const struct contact_config *config,
                                       struct contact_world **world, struct error *error);

/* Finds the module file of the engine "simbody", which the first created world loads. Writes its
 * path and returns true. If there is no file, writes the expected path and returns false; creating
 * a world then returns ERROR_UNSUPPORTED. Not RT-safe. */
bool contact_simbody_find(char *path, size_t size);

/* Creates the engine "native", which runs in real time. All operations of its world are RT-safe.
 * Memory from arena, which must outlive the world; destroy does nothing.
 *
 * The engine integrates over the true overlap of two surfaces. So the wrench is continuous in the
 * pose, and does not depend on the triangulation of a flat side. It converges as curved surfaces
 * are refined:
 * - A bed of parallel springs stands on a plane. Each spring is as long as the overlap is deep at
 *   that point. The elastic force of a bed is k times the overlap volume. Coplanar triangles that
 *   form a convex polygon are one facet.
 * - Mesh on half-space: springs along the plane's normal. A facet that is vertical or faces away
 *   adds nothing (in Simbody both push).
 * - Mesh on mesh, CONTACT_PRESSURE_FIELD: one mesh is the carrier, the other the visitor. Each
 *   point inside the carrier has a depth x (contact/mesh/field.h), and k x is a pressure (after
 *   Elandt, Drumwright, Sherman, Ruina 2019). The elastic potential U is k times the integral of x
 *   over the common volume V. x is 0 on the carrier's surface, so U changes only by the volume
 *   that the visitor's surface sweeps. The wrench on the visitor is minus the gradient of U, with
 *   n its outward normal:
 *
 *       f = -k integral of x n dA,  m = -k integral of r x n dA  over the visitor's surface in V
 *
 *   The opposite wrench acts on the carrier. So any closed path returns the stored energy, for any
 *   field and any triangulation. On a flat side U does not depend on the position along the side,
 *   so there is no force along it. f is k times the volume under the side, as on a half-space (k A
 *   x flat on flat). Within a distance x of the carrier's edges, x is the depth under the
 *   nearer side. Friction and dissipation use the gradient direction of x as the normal. The part
 *   of f across it is 0 in sum on a flat side; it has neither damping nor friction. The reported
 *   stored energy is k A x^2/2. This is U on flat sides; near edges and on curved carriers it
 *   differs, over a thin edge by half.
 *   The carrier is the larger mesh (by the diagonals of the boxes; if equal, the pair's a). Let d
 *   be the carrier's largest depth. If the visitor is deeper, as a body on a plate is, U also has k
 *   times the integral of the visitor's depth beyond d. So the force vanishes only when the middle
 *   of the body has passed through the plate, not at the plate's thickness.
 *
 * - Mesh on mesh, CONTACT_ELASTIC_FOUNDATION: springs between each two facets that face each
 *   other, along the mean of their normals. Both sums of eq (6) are over the same overlap, so one
 *   of them equals half of both. A tilted block is pushed sideways by half of its tilt, as by
 *   Simbody's mean of both sums. Closed paths gain or lose energy. The force fades out as the
 *   normals approach a right angle (full up to 60 degrees, none from 84). It also fades out where a
 *   spring would run along the overlap instead of across it.
 * - Sphere on mesh: springs over each facet along its normal to the far side of the sphere. On a
 *   flat side the force is k times the volume of the cap, at any place. A facet no longer holds a
 *   sphere that has sunk below it by a diameter. Sphere on half-space or sphere: Hertz's law.
 * - Capsule on mesh: a mesh of 256 triangles (mesh_capsule). In a pressure field the capsule is
 *   always the visitor, and its own depth is never used.
 * - Velocity, dissipation and friction are evaluated at three points between a facet's centroid
 *   and each edge of the overlap. A facet that is small against the smaller mesh has three points
 *   in all, a patch of a sphere four. In a pressure field, each part of a facet in a cell is cut
 *   into triangles with three points each. The triangles are no wider than 0.6 of the smaller
 *   mesh's radius. In a shell (contact/mesh/field.h), each part up to this width has three points.
 *
 * Pairs whose bounding balls are apart cost a few instructions; several pairs are tested at a
 * time. No state is kept between evaluations (the caller owns the bristles), so the same motion
 * gives the same bits on the same machine. The kernels are compiled for several instruction sets,
 * and the engine uses the best one of the machine. All add up in the same order (contact/lanes.h)
 * and give the same bits.
 *
 * Worst-case work for a half-space or a sphere is the number of facets. In a pressure field it is
 * the number of intersecting pairs of facet and cell, which grows as the number of facets even for
 * meshes inside each other. With CONTACT_ELASTIC_FOUNDATION it is the product of both numbers of
 * facets. Where surfaces only touch, as for a robot, the work depends on the size of the patch: a
 * walk down the trees to the common box, then the facets in it. tests/bench/contact_instructions.sh
 * measures the work over random poses of a foot, a box or a sphere in contact: the largest is
 * within three times the median. */
enum error_code contact_native_create(const struct contact_config *config, struct arena *arena,
                                      struct contact_world **world, struct error *error);

#endif
