/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A robot file as it is read, before it is a robot, and what the parts of the reader share:
 * schema.c (keys and ranges), yaml.c (names, variants, the order of the work),
 * yaml_joints.c (bodies and joints), yaml_drive.c (drives and their catalogue),
 * yaml_hydraulic.c (hydraulic drives), yaml_effects.c (what drives do beside the
 * paper's equations), yaml_couplings.c (joints that follow others), yaml_frames.c
 * (frames, sensors, poses), yaml_visuals.c (what bodies look like).
 *
 * Units are in the keys of the file and the same here. Memory is the arena's. Functions return
 * ERROR_INPUT with file:line:column, or ERROR_MEMORY. Not RT-safe.
 */
#ifndef MODEL_DESCRIPTION_YAML_H
#define MODEL_DESCRIPTION_YAML_H

#include "model/robot.h"

/* Every struct below with a name begins like this. */
struct named {
    struct yaml_mark mark;
    const char *name;
};

struct inertia_yaml {
    struct yaml_mark mark;
    double mass, com[3], I[6];
};

struct body_yaml {
    struct yaml_mark mark;
    const char *name;
    double mass, com[3], I[6];
    struct yaml_mark inertia_mark;
};

struct place_yaml {
    struct yaml_mark mark;
    double xyz[3], rpy[3];
};

struct limits_yaml {
    struct yaml_mark mark;
    double lower_rad, upper_rad, torque_nm;
    double lower_m, upper_m, force_n;
    bool angular[3], linear[3]; /* which of the above are given */
};

/* A stop comes back with this time constant, s, where the file says nothing of it. */
#define STOP_RETURNS 1e-3

/* The numbers of a stop, for each type of joint. */
enum stop_parameter { STOP_STIFFNESS, STOP_DAMPING, STOP_PARAMETERS };

struct stops_yaml {
    struct yaml_mark mark;
    bool enabled, has_enabled;
    double value[2][STOP_PARAMETERS]; /* by enum joint_type */
    bool given[2][STOP_PARAMETERS];
};

/* The parameters of a drive in the order of their keys in the schema; those of struct robot_sea.
 * Those from PARAMETER_DEFLECTION on may be left out: those of the spring's stop, and from
 * PARAMETER_COULOMB on those of struct robot_effects. */
enum drive_parameter {
    PARAMETER_J,
    PARAMETER_DM,
    PARAMETER_KS,
    PARAMETER_DS,
    PARAMETER_N,
    PARAMETER_KT,
    PARAMETER_KW,
    PARAMETER_R,
    PARAMETER_L,
    PARAMETER_DEFLECTION,
    PARAMETER_STOP_KS,
    PARAMETER_STOP_DS,
    PARAMETER_COULOMB,
    PARAMETER_BREAKAWAY,
    PARAMETER_STRIBECK,
    PARAMETER_STRIBECK_EXPONENT,
    PARAMETER_LOAD_MOTOR,
    PARAMETER_LOAD_EXTERNAL,
    PARAMETER_LOAD_MOTOR_STRIBECK,
    PARAMETER_LOAD_EXTERNAL_STRIBECK,
    PARAMETER_LOAD_MOTOR_QUADRATIC,
    PARAMETER_LOAD_EXTERNAL_QUADRATIC,
    PARAMETER_BACKLASH,
    PARAMETER_HYSTERESIS,
    PARAMETER_HYSTERESIS_KS,
    PARAMETER_WINDING_K_W,
    PARAMETER_HOUSING_K_W,
    PARAMETER_WINDING_J_K,
    PARAMETER_HOUSING_J_K,
    PARAMETER_AMBIENT,
    PARAMETER_R_PER_K,
    PARAMETER_KT_PER_K,
    PARAMETER_DEAD_TIME,
    PARAMETER_PWM,
    PARAMETER_DIODE,
    PARAMETER_SWITCHING,
    PARAMETER_BRIDGE_OHM,
    PARAMETER_COUNT,
};

/* A sine of the cogging torque or of the gear's angle error. */
struct harmonic_yaml {
    struct yaml_mark mark;
    double per_turn, amplitude, phase;
};

/* The parameters of a hydraulic drive in the order of their keys in the schema, which follow those
 * of an electric one. Those from HYDRAULIC_LAP on may be left out, and those of the triangle, from
 * HYDRAULIC_BASE to HYDRAULIC_CLOSED, are the joint's and in no file of the catalogue. */
enum hydraulic_parameter {
    HYDRAULIC_BORE,
    HYDRAULIC_ROD,
    HYDRAULIC_STROKE,
    HYDRAULIC_DEAD,
    HYDRAULIC_BASE,
    HYDRAULIC_ARM,
    HYDRAULIC_OFFSET,
    HYDRAULIC_CLOSED,
    HYDRAULIC_VALVE_HZ,
    HYDRAULIC_VALVE_DAMPING,
    HYDRAULIC_VALVE_V,
    HYDRAULIC_VALVE_FLOW,
    HYDRAULIC_VALVE_DROP,
    HYDRAULIC_BETA,
    HYDRAULIC_LAP,
    HYDRAULIC_LEAKAGE,
    HYDRAULIC_VISCOUS,
    HYDRAULIC_COULOMB,
    HYDRAULIC_COULOMB_SPEED,
    HYDRAULIC_PARAMETERS,
};

/* A drive has keys of one kind. */
enum drive_kind { DRIVE_UNSAID, DRIVE_ELECTRIC, DRIVE_HYDRAULIC };

struct drive_yaml {
    struct yaml_mark mark;
    const char *file; /* of the catalogue, by name or path; NULL = none */
    struct yaml_mark file_mark;
    double value[PARAMETER_COUNT];
    bool given[PARAMETER_COUNT];
    struct yaml_mark value_mark[PARAMETER_COUNT];
    double cylinder[HYDRAULIC_PARAMETERS];
    bool has_cylinder[HYDRAULIC_PARAMETERS];
    struct yaml_mark cylinder_mark[HYDRAULIC_PARAMETERS];
    bool freewheel, has_freewheel;
    struct harmonic_yaml *error, *cogging;
    size_t nerror, ncogging;
    bool has_error, has_cogging;
};

/* Ratings of a drive, for people and for the importer; those before RATING_PRESSURE are of electric
 * drives, that is of hydraulic ones. */
enum drive_rating {
    RATING_SUPPLY,
    RATING_TORQUE,
    RATING_PEAK_TORQUE,
    RATING_SPEED,
    RATING_PRESSURE,
    RATING_MASS,
    RATINGS,
};

/* A drive of the catalogue. */
struct drive_file_yaml {
    struct yaml_mark mark;
    const char *name, *description, *source;
    double rating[RATINGS]; /* 0 = not given */
    struct yaml_mark rating_mark[RATINGS];
    struct drive_yaml drive;
};

struct spring_yaml {
    struct yaml_mark mark;
    bool enabled;
    double k_p, d_p, r;
    int64_t s;
    struct yaml_mark s_mark;
};

/* The numbers of a passive spring whose keys say the unit of the joint. */
enum passive_parameter { PASSIVE_STIFFNESS, PASSIVE_DAMPING, PASSIVE_REST, PASSIVE_PARAMETERS };

struct passive_yaml {
    struct yaml_mark mark;
    double value[2][PASSIVE_PARAMETERS]; /* by enum joint_type */
    bool given[2][PASSIVE_PARAMETERS];
};

struct hydraulic_supply_yaml {
    struct yaml_mark mark;
    double pressure, back, pump, accumulator, precharge, line, relief, relief_flow;
    bool has_line;
};

struct joint_yaml {
    struct yaml_mark mark;
    const char *name;
    int64_t paper_index;
    int type;
    const char *parent, *child;
    struct yaml_mark parent_mark, child_mark, axis_mark;
    double axis[3];
    struct place_yaml origin;
    struct limits_yaml limits;
    struct stops_yaml stops;
    struct drive_yaml drive, hydraulic; /* hydraulic: as drive, of that kind only */
    struct spring_yaml spring;
    struct passive_yaml passive;
    bool has_drive, has_hydraulic, has_spring, has_passive;
};

/* The numbers of a coupling whose keys say the unit of the follower. */
enum coupling_parameter {
    COUPLING_OFFSET,
    COUPLING_STIFFNESS,
    COUPLING_DAMPING,
    COUPLING_PARAMETERS
};

struct coupling_yaml {
    struct yaml_mark mark;
    const char *follower, *leader;
    struct yaml_mark follower_mark, leader_mark, multiplier_mark;
    double multiplier;
    double value[2][COUPLING_PARAMETERS]; /* by enum joint_type */
    bool given[2][COUPLING_PARAMETERS];
};

struct frame_yaml {
    struct yaml_mark mark;
    const char *name;
    const char *body;
    struct yaml_mark body_mark;
    double xyz[3], rpy[3];
};

struct capsule_yaml {
    struct yaml_mark mark;
    const char *name;
    const char *body;
    struct yaml_mark body_mark;
    double xyz[3], rpy[3], radius, length;
};

struct visual_yaml {
    struct yaml_mark mark;
    const char *name;
    const char *body;
    struct yaml_mark body_mark;
    int shape;
    double xyz[3], rpy[3], half_extents[3], radius, length, color[4];
    const char *file, *missing; /* NULL = not given */
    struct yaml_mark file_mark;
    bool has_half_extents, has_radius, has_length, has_color;
};

struct ft_yaml {
    struct yaml_mark mark;
    const char *name;
    const char *frame;
    struct yaml_mark frame_mark;
    struct inertia_yaml distal;
};

struct imu_yaml {
    struct yaml_mark mark;
    const char *frame;
    struct yaml_mark frame_mark;
};

struct pose_yaml {
    struct yaml_mark mark;
    const char *name;
    double base_xyz[3], base_rpy[3];
    bool has_xyz, has_rpy;
    struct yaml_real_entry *joint_rad, *joint_m;
    size_t njoint_rad, njoint_m;
};

struct base_yaml {
    struct yaml_mark mark;
    int floating;
    const char *body;
    struct yaml_mark body_mark;
};

struct variant_yaml {
    struct yaml_mark mark;
    const char *name;
    struct body_yaml *body;
    struct joint_yaml *joint;
    struct frame_yaml *frame;
    struct capsule_yaml *capsule;
    struct ft_yaml *ft;
    struct drive_yaml drive;
    struct passive_yaml passive;
    size_t nbody, njoint, nframe, ncapsule, nft;
    bool has_passive;
};

struct robot_yaml {
    struct yaml_mark mark;
    uint64_t hash; /* of the file's bytes */
    const char *name, *description, *source;
    double gravity[3];
    struct base_yaml base;
    struct drive_yaml drive, hydraulic;
    struct hydraulic_supply_yaml hydraulic_supply;
    struct stops_yaml stops;
    struct passive_yaml passive; /* of all revolute joints with a drive */
    struct body_yaml *body;
    struct joint_yaml *joint;
    struct coupling_yaml *coupling;
    struct frame_yaml *frame;
    struct capsule_yaml *capsule;
    struct visual_yaml *visual;
    struct ft_yaml *ft;
    struct imu_yaml imu;
    struct pose_yaml *pose;
    struct variant_yaml *variant;
    size_t nbody, njoint, ncoupling, nframe, ncapsule, nvisual, nft, npose, nvariant;
    bool has_imu, has_hydraulic_supply;
};

/* The schema of a whole file: fills a struct robot_yaml. */
extern const struct yaml_schema robot_file_schema;

/* The same of a drive's file: struct drive_file_yaml. */
extern const struct yaml_schema drive_file_schema;

/* Returns the key of a drive's parameter in the file. */
const char *robot_drive_key(enum drive_parameter parameter);

/* Return the keys of a hydraulic drive's parameter, and of a rating. */
const char *robot_hydraulic_key(enum hydraulic_parameter parameter);
const char *robot_rating_key(enum drive_rating rating);

/* The robot that is being built and what every step of that needs. */
struct robot_builder {
    struct robot_yaml file;
    struct robot *robot;
    struct arena *arena;
    struct error *error;
};

/* Returns the index of name in an array of named structs, each of stride bytes, or -1. */
int find_named_entry(const void *array, size_t count, size_t stride, const char *name);

/* Sets the error "found unknown WHAT", with the nearest of the names that there are, or that of an
 * arena that is used up; returns its code. */
enum error_code robot_unknown_name(struct robot_builder *b, const struct yaml_mark *mark,
                                   const char *what, const char *name, const void *array,
                                   size_t count, size_t stride);
enum error_code robot_no_memory(struct robot_builder *b);

/* Builds the mass properties of a body; refuses at mark those that no body has. */
enum error_code robot_build_inertia(struct robot_builder *b, const struct yaml_mark *mark,
                                    double mass, const double com[3], const double I[6],
                                    struct robot_inertia *inertia);

/* Returns the kind of a drive by its keys; DRIVE_UNSAID: it has none. */
enum drive_kind robot_drive_kind(const struct drive_yaml *drive);

/* Fills what drive leaves out from the file of the catalogue that it names, if it does. Keys of
 * both kinds are refused. */
enum error_code robot_take_drive(struct robot_builder *b, struct drive_yaml *drive);

/* Merges a variant's drive into the robot's own, which must be of the same kind; the variant's
 * numbers go first. */
enum error_code robot_change_drive(struct robot_builder *b, struct drive_yaml *change);

/* Refuses two hydraulic drives of the robot's own, by its keys drive and hydraulic. */
enum error_code robot_check_own_drives(struct robot_builder *b);

/* Builds the drive of a joint, if it has one: what the joint does not say, the robot's own drive
 * of its kind does. The joint's range is known. */
enum error_code robot_build_drive(struct robot_builder *b, struct joint_yaml *given,
                                  struct robot_joint *joint);

/* Builds a hydraulic drive of a joint in the same way. */
enum error_code robot_build_hydraulic(struct robot_builder *b, const struct joint_yaml *given,
                                      struct robot_joint *joint);

/* Builds a hydraulic drive of the catalogue, without a triangle. */
enum error_code robot_build_cylinder(struct robot_builder *b, const struct drive_yaml *drive,
                                     struct robot_hydraulic *cylinder);

/* Builds the supply of all hydraulic drives. */
enum error_code robot_build_hydraulic_supply(struct robot_builder *b);

/* Builds the effects of a joint's drive, from the joint's or else from the robot's own drive:
 * NULL if there are none. given's mark is where a message about them stands. */
enum error_code robot_build_effects(struct robot_builder *b, const struct drive_yaml *given,
                                    struct robot_sea *sea);

/* Build the parts of the robot: bodies and joints, in the order of the joints; then couplings,
 * frames, capsules, visuals, sensors, poses. */
enum error_code robot_build_tree(struct robot_builder *b);
enum error_code robot_build_couplings(struct robot_builder *b);
enum error_code robot_build_frames(struct robot_builder *b);
enum error_code robot_build_capsules(struct robot_builder *b);
enum error_code robot_build_visuals(struct robot_builder *b);
enum error_code robot_build_sensors(struct robot_builder *b);
enum error_code robot_build_poses(struct robot_builder *b);

#endif
