/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A rig: a robot, its scene, the buses with their boards, and the settings of time. It is read from
 * YAML (config/rigs/) into the configurations of the parts of a run: the robot, contact with its
 * meshes, the boards, and the controller's map of the buses. Immutable after rig_load. SI units,
 * times in ns, bit rates in bit/s. The functions are not RT-safe, except rig_bus_bits.
 */
#ifndef RIG_RIG_H
#define RIG_RIG_H

#include "base/arena.h"
#include "base/error.h"
#include "base/enum_names.h"
#include "base/yaml.h"
#include "boards/board.h"
#include "boards/sensing/sensing.h"
#include "contact/contact.h"
#include "faults/faults.h"
#include "model/plant.h"
#include "model/robot.h"
#include "rt/timing.h"
#include "tasks/task.h"
#include "tasks/trajectory.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Limits of a rig. Joints: the robot's movable joints. Contacts: bodies that can touch. */
enum { RIG_BUSES_MAX = 32, RIG_JOINTS_MAX = 128, RIG_CONTACTS_MAX = 128 };

enum rig_contact_engine { RIG_CONTACT_NONE, RIG_CONTACT_SIMBODY, RIG_CONTACT_NATIVE };

/* When the clamp of the robot's links ends (plant_clamp). */
enum rig_hold {
    RIG_HOLD_NONE,    /* no clamp: without a controller the robot falls */
    RIG_HOLD_ENABLED, /* when every driven axis has had its motor on */
    RIG_HOLD_ALWAYS,
};

enum rig_dynamics {
    RIG_DYNAMICS_FASTEST, /* generated code if it exists, else generic with a notice */
    RIG_DYNAMICS_GENERIC,
};

/* Words of enums in rig files and options; for the wire: 0 ideal, 1 timed. */
extern const struct word rig_integrator_words[], rig_dynamics_words[], rig_engine_words[];
extern const struct word rig_hold_words[], rig_wire_words[];

struct rig_bus {
    const char *name;
    const char *interface; /* of SocketCAN: "can0" */
    int64_t bitrate;       /* bit/s */
    bool fd;               /* carries CAN FD frames */
    int64_t data_bitrate;  /* bit/s, for FD frames with a bit rate switch */
    bool configure;        /* the simulator configures the interface (sim/interfaces.h) */
    double sample_point;   /* sample point of a bit, for configure; 0 = the driver's choice */
    /* the kernel's restart delay after bus-off, for configure; 0 = the simulator restarts */
    int64_t restart_ms;
    const struct protocol *protocol;            /* protocol of its boards */
    const struct described_protocol *described; /* for a protocol that a file describes */
    size_t first_board, nboard;                 /* range of its boards in struct boards_config */
    size_t naxis;                               /* number of joints driven from this bus */
};

/* The timing of frames; each member is 0 or 1. */
struct rig_wire {
    /* local buses: frames pass a wire in virtual time (canbus/wire/wire.h); 0 = immediate
     * delivery */
    int timed;
    int paced; /* SocketCAN: the boards' frames are sent at the times of such a wire */
    int fifo;  /* controllers send frames in order; 0 = by priority of the identifier */
};

struct rig_realtime {
    int priority; /* SCHED_FIFO, 1-99; 0 = not requested */
    int cpu;      /* processor for the loop's thread; -1 = any */
    bool lock_memory;
    enum loop_overrun overrun;
};

struct rig_record {
    const char *directory; /* relative to the program's working directory; NULL = none */
    struct yaml_mark mark; /* place in the file */
    unsigned format;       /* formats of rows: enum recorder_format */
};

struct rig_page {
    const char *listen;    /* "[HOST:]PORT" of the viewer's page; NULL = none */
    struct yaml_mark mark; /* place in the file */
};

/* Why a pair of the robot's surfaces has no contact. */
enum rig_left_why {
    RIG_LEFT_BY_FILE, /* the file excludes it, with an optional reason */
    RIG_LEFT_JOINED,  /* a joint connects the bodies; its end stops keep them apart */
    RIG_LEFT_ALWAYS,  /* they overlap in each pose of the robot and in the rig's pose */
    RIG_LEFT_IN_POSE, /* they overlap in one pose and cannot have a slack */
};
struct rig_left_pair {
    int a, b; /* indices of the surfaces */
    enum rig_left_why why;
    const char *what; /* the file's reason or NULL; name of the joint; name of the pose */
};

struct rig {
    const char *file, *name;
    const struct yaml_old_key *old_key; /* keys with an old name, for a warning; NULL = none */
    /* hash of the bytes of its file and of all files that it refers to; for meshes, of vertices
     * and faces */
    uint64_t hash;
    const char *variant; /* variant of the robot; "" = the default */
    const struct robot *robot;

    enum loop_clock clock;
    int64_t tick_ns, substep_ns; /* tick_ns = substeps * substep_ns exactly */
    size_t substeps;
    enum plant_integrator integrator;
    double tolerance; /* relative and absolute tolerance of dopri5 */
    enum rig_dynamics dynamics;
    double supply_v;

    /* Arguments of plant_reset; joint has robot->njoint entries */
    const char *pose;
    double base_position[3], base_quaternion[4];
    const double *joint;
    enum rig_hold hold;
    bool settle; /* then settle into static equilibrium (plant_settle) */

    /* The scene. contact_body has contact.nbody entries: the body of each motion as in struct
     * plant_config, one of the robot's or, from robot->nbody on, a free body. Static bodies are
     * part of the world. With RIG_CONTACT_NONE contact is empty, even if the file lists
     * surfaces. */
    const struct plant_free_body *free;
    size_t nfree;
    enum rig_contact_engine contact_engine;
    struct contact_config contact;
    /* number of contact's pairs that the file lists; the robot's own pairs follow */
    size_t nlisted_pair;
    const struct rig_left_pair *left; /* nleft pairs of the robot's surfaces without contact */
    size_t nleft;
    const int *contact_body;

    size_t nbus;
    const struct rig_bus *bus;
    struct boards_config boards; /* in the order of the buses, and of the boards on each bus */

    /* What a controller knows: driven joints in the order of the boards; initial_rad (naxis) are
     * their angles at the start */
    size_t naxis, nft;
    const struct host_bus *host_bus; /* nbus */
    const struct host_axis *axis;
    const struct host_ft *ft;
    struct host_imu imu;
    const double *initial_rad;
    struct servo_config servo;
    struct squat_config squat;
    struct grasp_config grasp; /* nphase 0: none in the file */
    struct hold_config hold_task;
    const struct walk_config *walk; /* NULL: none in the file */
    struct body_model body;         /* model of the robot for tasks */

    struct rig_wire wire;
    struct loop_lockstep lockstep;
    struct rig_realtime realtime;
    struct rig_record record;
    struct rig_page page;

    uint64_t seed;                 /* seed of noise and faults */
    struct sensing_config sensing; /* without faults */
    const struct yaml_name *fault; /* fault lines (faults/faults.h), in order */
    size_t nfault;
    double supply_ohm;            /* resistance of the source */
    struct supply_bus supply_bus; /* bus behind the source */
};

/* Reads a rig file and the files that it refers to (robot, meshes); path may be the name of an
 * installed rig (base/config.h). The arena owns all memory. Errors have file:line:column. */
enum error_code rig_load(const char *path, struct arena *arena, const struct rig **rig,
                         struct error *error);

/* Reads a rig from memory. name is used as its file name, also to find files with relative paths.
 * rig->hash covers these files, but not the text itself. Numbers in the text may stand in quotes,
 * as parameters of a scenario do. */
enum error_code rig_load_text(const char *name, const char *text, size_t size, struct arena *arena,
                              const struct rig **rig, struct error *error);

/* Returns the name of the body of a contact motion. */
const char *rig_contact_name(const struct rig *rig, size_t motion);

/* Returns the index of a bus by name, or -1. */
int rig_find_bus(const struct rig *rig, const char *name);

/* Returns the configuration of a host that knows the rig's boards, on its own ports, one per bus.
 * All arguments are borrowed. */
struct host_config rig_host_config(const struct rig *rig, struct can_port **port, bool lockstep);

/* Reads a trajectory (tasks/trajectory.h) for the driven joints. Angles must be within their
 * limits, and rates within the speed of a drive at the supply's voltage, if the servo's gains
 * (kw_v_s_per_rad) give it. Not RT-safe. */
enum error_code rig_read_trajectory(const struct rig *rig, const char *path,
                                    enum trajectory_interpolation interpolation,
                                    struct arena *arena, const struct trajectory **trajectory,
                                    struct error *error);

/* Returns the traffic of a port in both directions in bit times of the bus's nominal rate, without
 * stuff bits. */
double rig_bus_bits(const struct rig_bus *bus, const struct can_counters *counters);

/* Computes the worst-case load of a bus in bit times of its nominal rate per second, so that
 * load / bitrate is the busy share, also with CAN FD. Stuff bits and interframe spaces are
 * included.
 *
 * Telemetry: icub motors at the host's default broadcast policy (0x7f); foc, compact and cia402
 * motors once per tick; described boards as in their protocol; STRAIN and F/T boards at their
 * periods. Commands: for icub, one voltage per axis each command_period_ns; for the others, all
 * set points of the bus once per tick, cia402 with a SYNC. The shortest period is a
 * millisecond. */
void rig_bus_load(const struct rig *rig, size_t bus, int64_t command_period_ns,
                  double *telemetry_bit_s, double *command_bit_s);

/* Returns whether the worst-case periodic traffic of a bus exceeds its bit rate; if so, writes
 * this to text with remedies. */
bool rig_bus_over_budget(const struct rig *rig, size_t bus, char *text, size_t size);

/* ---- faults of a run: the lines of the section `faults`, and those of the command line ---- */

/* Reads all lines; extra (nextra) has the lines of --fault. wire: by bus, whether it is a wire in
 * virtual time. Errors begin with file:line:column or --fault. Memory from arena. Not RT-safe. */
enum error_code rig_faults_create(const struct rig *rig, const char *const *extra, size_t nextra,
                                  uint64_t seed, const bool *wire, struct arena *arena,
                                  struct faults **faults, struct error *error);

/* Lists all possible faults of a rig (faults_list); each bus may be a wire. Not RT-safe. */
enum error_code rig_list_faults(const struct rig *rig, fault_list_put put, void *context,
                                struct error *error);

/* Checks one line of another file, such as a scenario; each bus may be a wire. fault receives the
 * result. Errors begin with file:line:column. Not RT-safe. */
enum error_code rig_check_fault(const struct rig *rig, const struct yaml_name *line,
                                struct fault *fault, struct error *error);

#endif
