/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A rig: a robot, its scene, the buses with their boards, and the time settings. rig_load reads it
 * from YAML (config/rigs/). The result has the configurations of the robot, of contact with its
 * meshes, of the boards, and of the controller's side of the buses. A rig does not change after
 * rig_load. SI units, times in ns, bit rates in bit/s. The functions are not RT-safe, except
 * rig_bus_bits.
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

/* Limits of a rig: buses, movable joints of the robot, and bodies with contact surfaces. */
enum { RIG_BUSES_MAX = 32, RIG_JOINTS_MAX = 128, RIG_CONTACTS_MAX = 128 };

enum rig_contact_engine { RIG_CONTACT_NONE, RIG_CONTACT_SIMBODY, RIG_CONTACT_NATIVE };

/* When the robot's links are released from the clamp at the start (plant_clamp). */
enum rig_hold {
    RIG_HOLD_NONE,    /* no clamp: without a controller the robot falls */
    RIG_HOLD_ENABLED, /* when every driven axis has had its motor on once */
    RIG_HOLD_ALWAYS,
};

enum rig_dynamics {
    RIG_DYNAMICS_FASTEST, /* generated code if it exists, else generic code with a notice */
    RIG_DYNAMICS_GENERIC,
};

/* Words for values in rig files and options. rig_wire_words are for `timed` in struct rig_wire. */
extern const struct word rig_integrator_words[], rig_dynamics_words[], rig_engine_words[];
extern const struct word rig_hold_words[], rig_wire_words[];

struct rig_bus {
    const char *name;
    const char *interface; /* SocketCAN interface: "can0" */
    int64_t bitrate;       /* bit/s */
    bool fd;               /* the bus carries CAN FD frames */
    int64_t data_bitrate;  /* bit/s in the data phase of FD frames with a bit rate switch */
    bool configure;        /* the simulator configures the interface (sim/interfaces.h) */
    double sample_point;   /* sample point of a bit, for `configure`; 0 = the driver's choice */
    /* delay of the kernel's restart after bus-off, with `configure`; 0 = the simulator restarts
     * it */
    int64_t restart_ms;
    const struct protocol *protocol;            /* protocol of the boards */
    const struct described_protocol *described; /* from a file or a built-in text; NULL = none */
    size_t first_board, nboard;                 /* range of the boards in boards.board */
    size_t naxis;                               /* number of joints that boards on this bus drive */
};

/* Timing of frames. Each member is 0 or 1. */
struct rig_wire {
    /* Local buses: 1 = frames take time on a wire in virtual time (canbus/wire/wire.h), 0 = frames
     * arrive immediately */
    int timed;
    int paced; /* SocketCAN: 1 = send the boards' frames at the times of a timed wire */
    int fifo;  /* 1 = a controller sends frames in order, 0 = by priority of the identifier */
};

struct rig_realtime {
    int priority; /* SCHED_FIFO priority, 1-99; 0 = none */
    int cpu;      /* processor of the loop's thread; -1 = any */
    bool lock_memory;
    enum loop_overrun overrun;
};

struct rig_record {
    const char *directory; /* relative to the working directory; NULL = no recording */
    struct yaml_mark mark; /* place in the file */
    unsigned format;       /* formats of the rows: enum recorder_format */
};

struct rig_page {
    const char *listen;    /* address of the viewer's page, "[HOST:]PORT"; NULL = no viewer */
    struct yaml_mark mark; /* place in the file */
};

/* Why two surfaces of the robot have no contact with each other. */
enum rig_left_why {
    RIG_LEFT_BY_FILE, /* the file excludes the pair; a reason is optional */
    RIG_LEFT_JOINED,  /* a joint connects the bodies; its end stops keep the surfaces apart */
    RIG_LEFT_ALWAYS,  /* the surfaces overlap in every pose of the robot and in the rig's pose */
    RIG_LEFT_IN_POSE, /* the surfaces overlap in some pose, and a slack is not possible */
};
struct rig_left_pair {
    int a, b; /* indices of the surfaces */
    enum rig_left_why why;
    /* by `why`: the file's reason or NULL; name of the joint; NULL; name of the pose */
    const char *what;
};

struct rig {
    const char *file, *name;
    const struct yaml_old_key *old_key; /* keys with an old name, for a warning; NULL = none */
    /* hash of the rig's file and of all files that it refers to; for a mesh, of its vertices and
     * faces instead of its file */
    uint64_t hash;
    const char *variant; /* variant of the robot; "" = the default */
    const struct robot *robot;

    enum loop_clock clock;
    int64_t tick_ns, substep_ns; /* tick_ns = substeps * substep_ns exactly */
    size_t substeps;
    enum plant_integrator integrator;
    double tolerance; /* relative and absolute tolerance of the integrator dopri5 */
    enum rig_dynamics dynamics;
    double supply_v;

    /* Arguments of plant_reset. `joint` has robot->njoint entries. */
    const char *pose;
    double base_position[3], base_quaternion[4];
    const double *joint;
    enum rig_hold hold;
    bool settle; /* find static equilibrium after the reset (plant_settle) */

    /* The scene. contact_body has contact.nbody entries: for each contact motion, the index of its
     * body in the plant. Indices below robot->nbody are bodies of the robot; higher ones are free
     * bodies. Static bodies are part of the world. With RIG_CONTACT_NONE, `contact` is empty, even
     * if the file lists surfaces. */
    const struct plant_free_body *free;
    size_t nfree;
    enum rig_contact_engine contact_engine;
    struct contact_config contact;
    /* Number of pairs in `contact` that the file lists. The robot's own pairs follow them. */
    size_t nlisted_pair;
    const struct rig_left_pair *left; /* the robot's own pairs without contact (nleft) */
    size_t nleft;
    const int *contact_body;

    size_t nbus;
    const struct rig_bus *bus;
    struct boards_config boards; /* in the order of the buses, then of the boards on each bus */

    /* Configuration of a controller. Driven joints are in the order of the boards. initial_rad has
     * naxis angles, at the start. */
    size_t naxis, nft;
    const struct host_bus *host_bus; /* nbus entries */
    const struct host_axis *axis;
    const struct host_ft *ft;
    struct host_imu imu;
    const double *initial_rad;
    struct servo_config servo;
    struct squat_config squat;
    struct grasp_config grasp; /* nphase = 0: the file has no grasp */
    struct hold_config hold_task;
    const struct walk_config *walk; /* NULL: the file has no walk */
    struct body_model body;         /* model of the robot, for tasks */

    struct rig_wire wire;
    struct loop_lockstep lockstep;
    struct rig_realtime realtime;
    struct rig_record record;
    struct rig_page page;

    uint64_t seed;                 /* seed of noise and faults */
    struct sensing_config sensing; /* errors of the sensors, without faults */
    const struct yaml_name *fault; /* fault lines (faults/faults.h) in their order */
    size_t nfault;
    double supply_ohm;            /* resistance of the source, ohm */
    struct supply_bus supply_bus; /* supply bus behind the source */
};

/* Reads a rig file and the files that it refers to, such as the robot and meshes. `path` may be the
 * name of an installed rig (base/config.h). The arena owns all memory. Errors have
 * file:line:column. */
enum error_code rig_load(const char *path, struct arena *arena, const struct rig **rig,
                         struct error *error);

/* Reads a rig from memory. `name` stands for the file's name in errors and for relative paths.
 * rig->hash covers the files that the text refers to, but not the text. Numbers in the text may be
 * in quotes, as in the parameters of a scenario. */
enum error_code rig_load_text(const char *name, const char *text, size_t size, struct arena *arena,
                              const struct rig **rig, struct error *error);

/* Returns the name of the body that belongs to a contact motion. */
const char *rig_contact_name(const struct rig *rig, size_t motion);

/* Returns the index of the bus with this name, or -1. */
int rig_find_bus(const struct rig *rig, const char *name);

/* Returns the configuration of a host for the rig's boards. `port` has the host's port on each bus.
 * The result refers to all arguments, which must outlive it. */
struct host_config rig_host_config(const struct rig *rig, struct can_port **port, bool lockstep);

/* Reads a trajectory (tasks/trajectory.h) for the driven joints. Angles must be inside the joint
 * limits. Rates must not exceed the drive's speed at its highest voltage. The servo gain
 * kw_v_s_per_rad defines this speed; without it, rates have no limit. Not RT-safe. */
enum error_code rig_read_trajectory(const struct rig *rig, const char *path,
                                    enum trajectory_interpolation interpolation,
                                    struct arena *arena, const struct trajectory **trajectory,
                                    struct error *error);

/* Returns the traffic of a port, sent and received, without stuff bits. The unit is bit times of
 * the bus's nominal rate. */
double rig_bus_bits(const struct rig_bus *bus, const struct can_counters *counters);

/* Computes the worst-case load of a bus, in bit times of its nominal rate per second. Thus load /
 * bitrate is the busy share of time, also with CAN FD. Stuff bits and interframe spaces are
 * included.
 *
 * Telemetry: icub motors at the host's default broadcast policy (0x7f); foc, compact and cia402
 * motors once per tick; described boards as their protocol says; STRAIN and F/T boards at their
 * periods.
 *
 * Commands: icub motors get one voltage per axis each command_period_ns. Other boards get all set
 * points of the bus once per tick, cia402 with a SYNC. The shortest period is 1 ms. */
void rig_bus_load(const struct rig *rig, size_t bus, int64_t command_period_ns,
                  double *telemetry_bit_s, double *command_bit_s);

/* Returns the number of axes that a bus carries if all are like its own and all frames have their
 * full length. Returns 0 for a bus without motors, or with sensors. */
size_t rig_bus_capacity(const struct rig *rig, size_t bus, int64_t command_period_ns);

/* Returns whether the worst-case periodic traffic of a bus exceeds its bit rate. If so, writes the
 * load and remedies to `text`. */
bool rig_bus_over_budget(const struct rig *rig, size_t bus, char *text, size_t size);

/* ---- faults of a run: the lines of the section `faults`, and those of the command line ---- */

/* Reads all fault lines of a run. `extra` has the nextra lines of --fault. `wire`: for each bus,
 * true for a wire in virtual time. Errors begin with file:line:column or --fault. The memory is
 * from arena. Not RT-safe. */
enum error_code rig_faults_create(const struct rig *rig, const char *const *extra, size_t nextra,
                                  uint64_t seed, const bool *wire, struct arena *arena,
                                  struct faults **faults, struct error *error);

/* Lists all possible faults of a rig (faults_list). Treats each bus as a wire. Not RT-safe. */
enum error_code rig_list_faults(const struct rig *rig, fault_list_put put, void *context,
                                struct error *error);

/* Checks a fault line of another file, such as a scenario, and writes the result to *fault. Treats
 * each bus as a wire. Errors begin with file:line:column. Not RT-safe. */
enum error_code rig_check_fault(const struct rig *rig, const struct yaml_name *line,
                                struct fault *fault, struct error *error);

#endif
