/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The description of a robot: a tree of rigid bodies joined by revolute and prismatic joints on a
 * fixed or floating base, with its drives, springs, sensors and named frames. It is read from YAML
 * and never changed afterwards.
 *
 * Conventions. Right-handed frames, x forward, y left, z up. Body 0 is the base; joint j (from 0)
 * moves body j + 1, and parents come before children. The frame of a moved body lies on its joint
 * axis: child = Trans(origin) * R(rpy) * Rot(axis, q) (or Trans(axis q) for a prismatic joint).
 *
 * Generalized coordinates, always in this order:
 *
 *  q  (nq): [base position xyz in the world (m), base quaternion wxyz (body to world)], joint
 *           positions (rad or m);
 *  v  (nv): [base linear velocity of its origin (m/s), base angular velocity (rad/s), both in the
 *           base frame], joint rates.
 *
 * The parts in brackets exist only with a floating base. enum base_q_part and enum base_v_part give
 * the offsets. Accelerations are the time derivatives of the components of v. So the base's linear
 * part is the derivative in the moving frame, without the omega x v term.
 */
#ifndef MODEL_ROBOT_H
#define MODEL_ROBOT_H

#include "base/arena.h"
#include "base/error.h"
#include "base/motion.h"
#include "base/yaml.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Offsets of a floating base's parts in q, and the number of its coordinates. */
enum base_q_part { BASE_Q_POSITION = 0, BASE_Q_QUATERNION = 3, BASE_Q_COUNT = 7 };

/* Offsets of a floating base's parts in v, and their number. */
enum base_v_part { BASE_V_LINEAR = 0, BASE_V_ANGULAR = 3, BASE_V_COUNT = 6 };

enum joint_type { JOINT_REVOLUTE, JOINT_PRISMATIC };

/* Mass properties in a body's frame. */
struct robot_inertia {
    double mass;   /* kg */
    double com[3]; /* m */
    double I[6];   /* kg m2 about the center of mass: xx xy xz yy yz zz, tensor elements */
};

struct robot_body {
    const char *name;
    int parent; /* index of the parent body; -1 for the base */
    struct robot_inertia inertia;
    /* the body has a frame or a capsule, so its kinematics are needed in every step */
    bool observed;
};

/* A mechanical stop, model/stop.h; stiffness 0 = none. */
struct robot_stop {
    double stiffness; /* N m/rad or N/m */
    double damping;   /* N m s/rad or N s/m */
};

/* A sine of the motor's angle: amplitude sin(per_turn N qm + phase). */
struct robot_harmonic {
    /* per_turn: periods per motor turn; amplitude in rad or N m; phase in rad */
    double per_turn, amplitude, phase;
};

enum { ROBOT_HARMONICS = 4 };

/* Thermal model with two bodies: the winding, heated by all of R I^2, and the housing with the
 * magnets. */
struct robot_thermal {
    /* thermal resistances to the housing, to the air, K/W; 0 = no temperatures */
    double winding_k_w, housing_k_w;
    double winding_j_k, housing_j_k; /* heat capacities */
    double ambient_c;                /* deg C */
    /* relative changes per K from 25 deg C; R with the winding's temperature, Kt with the
     * housing's */
    double R_per_k, Kt_per_k;
};

/* Gear friction from the torques that the gear carries, from the motor and from the load. Terms: a
 * share of each torque at any speed; an additional share near rest; a share of the squares if the
 * two torques oppose each other. Zero = off. */
struct robot_load_friction {
    double motor, external; /* shares at each speed, 1 */
    /* additional shares at rest, which fall with the Stribeck curve, 1 */
    double motor_stribeck, external_stribeck;
    double motor_quadratic, external_quadratic; /* shares of the squares at rest, 1/(N m) */
};

/* Effects of a real drive beyond eqs (2)-(4), model/drives/effects.h; zero = off. Link side. */
struct robot_effects {
    /* friction of the gear, N m: F at high speed; F(0) */
    double coulomb, breakaway;
    /* speed of the transition from breakaway to coulomb, rad/s; 0 = F is F(0) at all speeds */
    double stribeck;
    /* exponent of the speed in the Stribeck curve; 0 = 2 */
    double stribeck_exponent;
    /* stiffness of the gear's contacts before they slide, N m/rad; 0 = rigid */
    double presliding;
    /* additional friction from the torques carried */
    struct robot_load_friction load;
    double backlash;                                /* total play behind the gear, rad */
    double hysteresis, hysteresis_stiffness;        /* Dahl: z_max, N m; sigma, N m/rad */
    struct robot_harmonic error[ROBOT_HARMONICS];   /* kinematic error of the gear, rad */
    struct robot_harmonic cogging[ROBOT_HARMONICS]; /* cogging torque, N m */
    size_t nerror, ncogging;
    struct robot_thermal thermal;
    double dead_time, pwm; /* of the bridge, s and Hz; pwm 0 = no ripple */
    double switching;      /* time of a transistor to switch on and off, s */
    double bridge_ohm;     /* resistance of the transistors in the current path, ohm */
    /* true: with the bridge off, the current flows through the diodes; false: it stops
     * immediately */
    bool freewheel;
    double diode;      /* voltage of each of the two diodes, V */
    double saturation; /* current at which Kt and Kw fall to 1/sqrt(2), A; 0 = never */
    double iron;       /* viscous drag of the motor's iron, N m s/rad per A^2 */
    double skin;       /* resistance of the skin effect at 1 rad/s, ohm; grows as sqrt(speed) */
    double standby;    /* power of the drive's electronics, W */
};

/* Series elastic DC drive of a joint, paper eqs (2)-(4); all on the link side of the gear. */
struct robot_sea {
    bool present;
    double J;               /* reflected motor inertia, kg m2 */
    double Dm;              /* mechanical motor damping, N m s/rad, without back-EMF */
    double Ks;              /* series spring stiffness, N m/rad */
    double Ds;              /* series spring damping, N m s/rad */
    double N;               /* gear ratio */
    double Kt;              /* torque constant times N, N m/A (the paper's K_t) */
    double Kw;              /* back-EMF constant times N, V s/rad (the paper's K_omega) */
    double R;               /* winding resistance, ohm */
    double L;               /* winding inductance, H */
    double deflection;      /* |qm - q| at which the spring meets its stop, rad */
    struct robot_stop stop; /* parallel to the spring, beyond that deflection */
    double current_loop_hz; /* bandwidth of the drive's own current controller; 0 = the default */
    double command_filter_s, command_delay_s; /* of commanded currents; of all its commands */
    const struct robot_effects *effects;      /* NULL = none: only eqs (2)-(4) */
};

/* Hydraulic drive of a revolute joint, model/hydraulics/hydraulic.h. */
struct robot_hydraulic {
    bool present;
    double A1, A2;       /* areas of the piston: piston side, rod side, m2 */
    double stroke, dead; /* stroke, m; dead volume of each side, m3 */
    /* distances from the joint to the cylinder's pin and to the rod's pin, m */
    double base, arm;
    double offset;        /* the angle between them is q + offset, rad */
    double closed;        /* length between the pins with the piston retracted, m */
    double valve_w;       /* natural frequency of the valve's spool, rad/s */
    double valve_damping; /* damping ratio of the spool, below 1 */
    double valve_v;       /* voltage that opens the valve fully */
    double K;             /* flow of a fully open port, m3/s per sqrt(Pa) */
    double lap;           /* overlap: share of the opening that the spool covers */
    double beta;          /* bulk modulus of the oil, Pa */
    double leakage;       /* leakage past the piston, m3/s per Pa */
    double viscous;       /* viscous friction, N s/m */
    double coulomb;       /* Coulomb friction, N */
    double coulomb_speed; /* speed scale on which Coulomb friction changes its sign, m/s */
};

/* The supply of all hydraulic joints of a robot; accumulator 0 = constant pressure. */
struct robot_hydraulic_supply {
    double pressure, back; /* pressure at the start, pressure of the return, Pa */
    double pump;           /* flow of the pump, m3/s */
    double accumulator;    /* volume of the accumulator's gas at precharge, m3 */
    double precharge;      /* Pa */
    double line;           /* volume of oil between pump and valves, m3 */
    /* opening pressure of the relief valve, Pa; its flow, m3/s per Pa above that */
    double relief, relief_flow;
};

/* Parallel unilateral spring of a joint, paper eq. (5) with x = p - r s q: for x < 0 the joint
 * torque is s r (k_p x + d_p x'). */
struct robot_parallel_spring {
    bool present;
    bool enabled;
    double k_p; /* N/m */
    double d_p; /* N s/m */
    double r;   /* pulley radius, m */
    double s;   /* +1 or -1: sense of the joint in which the rope engages */
};

/* Spring and damper between the two bodies of a joint, model/stop.h; all 0 = none. */
struct robot_passive {
    double stiffness; /* N m/rad or N/m */
    double damping;   /* N m s/rad or N s/m */
    double rest;      /* position at which the spring is relaxed, rad or m */
};

struct robot_joint {
    const char *name;
    enum joint_type type;
    int paper_index;        /* number of the generalized coordinate in the paper, 0 = none */
    double axis[3];         /* unit vector in the child frame */
    double origin[3];       /* origin of the child frame in the parent frame at q = 0, m */
    double rotation[9];     /* child to parent at q = 0, row-major (from rpy) */
    double lower, upper;    /* position limits, rad or m */
    struct robot_stop stop; /* stops at both limits */
    double torque_limit;    /* N m or N */
    struct robot_sea sea;
    struct robot_hydraulic hydraulic; /* hydraulic drive; a joint has sea or hydraulic, not both */
    struct robot_parallel_spring spring;
    struct robot_passive passive;
};

/* A gear, linkage or tendon by which one joint follows another, model/coupling.h. The follower's
 * position is multiplier times the leader's position + offset, plus the deflection of a massless
 * spring and damper. Units are the follower's. */
struct robot_coupling {
    int follower, leader; /* joints; a follower has one leader, no drive, and is not a leader */
    double multiplier;    /* follower's unit per leader's unit; never 0 */
    double offset;        /* rad or m */
    double stiffness;     /* N m/rad or N/m, > 0 */
    double damping;       /* N m s/rad or N s/m */
};

/* Largest number of couplings: two hands with 14 following joints each, and some more. */
enum { ROBOT_COUPLINGS_MAX = 32 };

/* A named frame on a body, for sensors and contact surfaces. */
struct robot_frame {
    const char *name;
    int body;
    double position[3]; /* in the body frame, m */
    double rotation[9]; /* frame to body, row-major */
};

/* A collision shape: a cylinder with a half-sphere at each end, a sphere if the length is 0, a
 * cylinder with flat ends, or a box. It encloses the body, and attached parts that move little
 * relative to it. The rig file gives the material. */
struct robot_capsule {
    const char *name;
    int body;
    double position[3]; /* its center, in the body frame, m */
    double rotation[9]; /* its axis is z; capsule to body, row-major */
    double radius;      /* m; 0 = a box */
    double length;      /* length of the axis, without the half-spheres, m */
    bool flat;          /* has flat ends */
    double half[3];     /* half extents of a box, m */
};

enum robot_visual_shape { VISUAL_MESH, VISUAL_BOX, VISUAL_SPHERE, VISUAL_CYLINDER, VISUAL_CAPSULE };

enum { ROBOT_VISUALS_MAX = 1024 };

/* The appearance of a body in a picture. It has no contact, and no equation depends on it. */
struct robot_visual {
    const char *name;
    int body;
    enum robot_visual_shape shape;
    double position[3]; /* origin of its own frame in the body frame, m */
    double rotation[9]; /* shape to body, row-major; a cylinder's and a capsule's axis is z */
    double half[3];     /* half the edge lengths of a box, m */
    double radius;      /* m */
    double length;      /* of a cylinder; for a capsule, of the axis without the ends, m */
    /* path of a mesh, a binary STL in m; NULL for other shapes and missing meshes */
    const char *file;
    const char *missing; /* text: reason why the mesh is missing; NULL = not missing */
    bool colored;
    double color[4]; /* sRGB and opacity, 0 to 1 */
};

/* Six-axis force-torque sensor. It measures the wrench that the distal part exerts through it, in
 * the sensor's frame. */
struct robot_ft_sensor {
    const char *name;
    int frame;
    struct robot_inertia distal; /* mass properties of the distal part, in the sensor frame */
};

struct robot_pose {
    const char *name;
    double base_position[3];   /* m, world */
    double base_quaternion[4]; /* wxyz */
    const double *joint;       /* njoint positions */
};

struct robot {
    const char *name;
    const char *file;
    /* hash of all data on which the equations of motion depend, and of the list of observed bodies.
     * It excludes names, poses, limits, drives and sensors */
    uint64_t hash;
    uint64_t massless_hash; /* like hash, without masses, centers of mass and inertias */
    uint64_t source_hash;   /* hash of the bytes of its file; 0 = built by hand */
    bool floating;
    double gravity[3]; /* m/s2, world */
    size_t nbody, njoint, nframe, ncapsule, nft, npose;
    size_t nq, nv;
    struct robot_body *body;
    struct robot_joint *joint; /* joint[j] moves body[j + 1] */
    struct robot_frame *frame;
    struct robot_capsule *capsule;
    struct robot_ft_sensor *ft;
    struct robot_pose *pose;
    int imu_frame; /* -1 = none */
    struct robot_hydraulic_supply hydraulic_supply;
    double total_mass;
    struct robot_coupling *coupling;
    size_t ncoupling;
    struct robot_visual *visual; /* appearance */
    size_t nvisual;
};

/* Reads a robot file. variant names one of its variants; NULL or "" is the default. The arena owns
 * all memory. Errors have file:line:column. Not RT-safe. */
enum error_code robot_load(const char *path, const char *variant, struct arena *arena,
                           const struct robot **robot, struct error *error);

/* Reads a robot file like robot_load. mark: place of the variant's name in another file, for
 * errors. */
enum error_code robot_load_named(const char *path, const char *variant,
                                 const struct yaml_mark *mark, struct arena *arena,
                                 const struct robot **robot, struct error *error);

/* A drive of the catalogue, electric (sea is present) or hydraulic. Ratings are on the link side;
 * 0 = not in the file. */
struct robot_drive {
    const char *name, *description, *source; /* source may be NULL */
    double supply_v;                         /* nominal */
    double torque, peak_torque;              /* continuous torque, short-time torque; N m */
    double speed;                            /* without load at supply_v, rad/s */
    double pressure;                         /* nominal supply pressure of a hydraulic drive, Pa */
    double mass;                             /* kg */
    struct robot_sea sea;
    /* without the triangle: base, arm, offset and closed are 0 */
    struct robot_hydraulic hydraulic;
};

/* Reads a drive file, which must be complete. The arena owns all memory. Errors have
 * file:line:column. Not RT-safe. */
enum error_code robot_load_drive(const char *path, struct arena *arena,
                                 const struct robot_drive **drive, struct error *error);

/* Reads the description in a drive file, and whether the drive is hydraulic. The file may be
 * incomplete. The arena owns all memory. Errors have file:line:column. Not RT-safe. */
enum error_code robot_describe_drive(const char *path, struct arena *arena,
                                     const char **description, bool *hydraulic,
                                     struct error *error);

/* Refuses a value that a key of an electric drive cannot have in a file. A key that is not required
 * can have 0, which is as none. Accepts NAN, and any value of other keys. */
enum error_code robot_check_number(const char *key, double value, struct error *error);

/* Fills the derived members: nq, nv, total_mass, the hashes, and observed for bodies with a frame
 * or a capsule. Refuses inertias that are physically impossible. Refuses a joint or a floating base
 * that could move without inertia, so that the dynamics are never singular. Does not check other
 * data; the readers of files do: parents first, axes of unit length, constants that are not
 * negative. Not RT-safe. */
enum error_code robot_finish(struct robot *robot, struct error *error);

/* Makes a copy that the caller may change. The copy has its own bodies, joints, frames, capsules
 * and visuals. It shares all other data. Memory from arena. Not RT-safe. */
enum error_code robot_copy(const struct robot *robot, struct arena *arena, struct robot **copy,
                           struct error *error);

/* Fixes a floating base at this position (m) and quaternion (wxyz, of unit length) in the world.
 * The base's frame becomes the world frame, and all parts fixed to the base are transformed to it.
 * Checks like robot_finish. Not RT-safe. */
enum error_code robot_fix_base(struct robot *robot, const double position[3],
                               const double quaternion[4], struct error *error);

/* Fills the nbody motions with the poses of the bodies in the world and zero velocities. position
 * (m) and quaternion (wxyz): pose of a floating base. joint: njoint positions. RT-safe. */
void robot_place_bodies(const struct robot *robot, const double position[3],
                        const double quaternion[4], const double *joint,
                        struct body_motion *motion);

/* Checks that mass properties are physically possible. The error gives the reason without a name.
 * Not RT-safe. */
enum error_code robot_check_inertia(const struct robot_inertia *inertia, struct error *error);

/* Returns whether a joint has an electric or hydraulic drive that a board can command. RT-safe. */
static inline bool robot_joint_is_driven(const struct robot_joint *joint)
{
    return joint->sea.present || joint->hydraulic.present;
}

/* Returns the coupling in which joint j is the follower, or NULL. RT-safe. */
const struct robot_coupling *robot_find_coupling(const struct robot *robot, size_t j);

/* Computes the pose of a body in its parent's frame with its joint at position q (rad or m). */
void robot_place_child(const struct robot_joint *joint, double q, double R[9], double p[3]);

/* Return the index of the entry with a name, or -1. Not RT-safe (linear search). */
int robot_find_body(const struct robot *robot, const char *name);
int robot_find_joint(const struct robot *robot, const char *name);
int robot_find_frame(const struct robot *robot, const char *name);
int robot_find_pose(const struct robot *robot, const char *name);

#endif
