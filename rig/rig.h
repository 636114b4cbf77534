/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A rig: a robot, the scene it stands in, the buses with their boards, and how time runs. Read
 * from YAML (config/rigs/) into the configurations of the parts that run: the robot, contact with
 * its meshes, the boards, the controller's map of the buses. Immutable after rig_load. SI units,
 * times in ns, bit rates in bit/s. The functions are not RT-safe, but for rig_bus_bits.
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

/* Limits of a bench; joints are those of the robot that move, contacts bodies that can touch. */
enum { RIG_BUSES_MAX = 32, RIG_JOINTS_MAX = 128, RIG_CONTACTS_MAX = 128 };

enum rig_contact_engine { RIG_CONTACT_NONE, RIG_CONTACT_SIMBODY, RIG_CONTACT_NATIVE };

/* End of the time in which the robot's links are clamped (plant_clamp). */
enum rig_hold {
    RIG_HOLD_NONE,    /* free from the start: without a controller it falls */
    RIG_HOLD_ENABLED, /* until every driven axis has its motor on for the first time */
    RIG_HOLD_ALWAYS,
};

enum rig_dynamics {
    RIG_DYNAMICS_FASTEST, /* generated code where there is some, else generic with a notice */
    RIG_DYNAMICS_GENERIC,
};

/* Words of enums in rig files and options; of the wire: 0 ideal, 1 timed. */
extern const struct word rig_integrator_words[], rig_dynamics_words[], rig_engine_words[];
extern const struct word rig_hold_words[], rig_wire_words[];

struct rig_bus {
    const char *name;
    const char *interface; /* of SocketCAN: "can0" */
    int64_t bitrate;       /* bit/s */
    bool fd;               /* carries CAN FD frames */
    int64_t data_bitrate;  /* bit/s, of FD frames with a bit rate switch */
    bool configure;        /* the simulator sets the interface (sim/interfaces.h) */
    double sample_point;   /* of a bit, for configure; 0 = the driver's choice */
    int64_t restart_ms;    /* by the kernel after bus-off, for configure; 0 = by the simulator */
    const struct protocol *protocol;            /* what its boards speak */
    const struct described_protocol *described; /* of a protocol that a file describes */
    size_t first_board, nboard;                 /* of struct boards_config */
    size_t naxis;                               /* joints driven from this bus */
};

/* Time that frames take. */
struct rig_wire {
    bool timed; /* local buses: over a wire in virtual time (canbus/wire/wire.h), not at once */
    bool paced; /* SocketCAN: the boards' frames leave when such a wire would have carried them */
    bool fifo;  /* controllers send in order, not the most urgent frame first */
};

struct rig_realtime {
    int priority; /* SCHED_FIFO, 1-99; 0 = do not ask for it */
    int cpu;      /* to be pinned to; -1 = any */
    bool lock_memory;
    enum loop_overrun overrun;
};

struct rig_record {
    const char *directory; /* relative to where the program runs; NULL = none */
    struct yaml_mark mark; /* where it stands */
    unsigned format;       /* of rows: enum recorder_format */
};

struct rig_page {
    const char *listen;    /* "[HOST:]PORT" of the page that shows the run; NULL = none */
    struct yaml_mark mark; /* where it stands */
};

/* Why two surfaces of the robot are not watched. */
enum rig_left_why {
    RIG_LEFT_BY_FILE, /* for the reason that it gives, if any */
    RIG_LEFT_JOINED,  /* by a joint, the end stops of which hold them apart */
    RIG_LEFT_ALWAYS,  /* overlap in every pose of the robot, and in that of the rig */
    RIG_LEFT_IN_POSE, /* overlap in one, and cannot count as thinner */
};
struct rig_left_pair {
    int a, b; /* surfaces */
    enum rig_left_why why;
    const char *what; /* the reason, or NULL; the joint's name; the pose's */
};

struct rig {
    const char *file, *name;
    uint64_t hash; /* of the bytes of its file and of all that it refers to; of meshes, of their
                    * vertices and faces */
    const char *variant; /* of the robot; "" = the default */
    const struct robot *robot;

    enum loop_clock clock;
    int64_t tick_ns, substep_ns; /* tick_ns = substeps * substep_ns exactly */
    size_t substeps;
    enum plant_integrator integrator;
    double tolerance; /* of dopri5, relative and absolute */
    enum rig_dynamics dynamics;
    double supply_v;

    /* For plant_reset; joint has robot->njoint entries */
    const char *pose;
    double base_position[3], base_quaternion[4];
    const double *joint;
    enum rig_hold hold;
    bool settle; /* into static equilibrium from there (plant_settle) */

    /* The scene; contact_body has contact.nbody entries: the body of each motion as in struct
     * plant_config, one of the robot or, from robot->nbody on, a free one. Static bodies are part
     * of the world. With RIG_CONTACT_NONE contact is empty, whatever surfaces the file lists. */
    const struct plant_free_body *free;
    size_t nfree;
    enum rig_contact_engine contact_engine;
    struct contact_config contact;
    size_t nlisted_pair; /* the first of contact's, which the file lists; the robot's own follow */
    const struct rig_left_pair *left; /* nleft pairs of the robot's surfaces that do not touch */
    size_t nleft;
    const int *contact_body;

    size_t nbus;
    const struct rig_bus *bus;
    struct boards_config boards; /* in the order of the buses and of the boards on each */

    /* What a controller may know: driven joints in the order of the boards, initial_rad (naxis)
     * their angles at the start */
    size_t naxis, nft;
    const struct host_bus *host_bus; /* nbus */
    const struct host_axis *axis;
    const struct host_ft *ft;
    struct host_imu imu;
    const double *initial_rad;
    struct servo_config servo;
    struct squat_config squat;
    struct grasp_config grasp; /* nphase 0: the file has none */
    struct hold_config hold_task;
    const struct walk_config *walk; /* NULL: the file has none */
    struct body_model body;         /* of the robot, for tasks */

    struct rig_wire wire;
    struct loop_lockstep lockstep;
    struct rig_realtime realtime;
    struct rig_record record;
    struct rig_page page;

    uint64_t seed;                 /* of noise and faults */
    struct sensing_config sensing; /* without faults */
    const struct yaml_name *fault; /* lines (faults/faults.h), in order */
    size_t nfault;
    double supply_ohm;            /* of the source */
    struct supply_bus supply_bus; /* behind it */
};

/* Reads a rig file and the files that it names (robot, meshes); path may be the name of an
 * installed rig (base/config.h). Everything lives in arena. Errors carry file:line:column. */
enum error_code rig_load(const char *path, struct arena *arena, const struct rig **rig,
                         struct error *error);

/* Reads a rig from memory: name stands for the file, files that the text refers to are found
 * from there. rig->hash is that of these files, without the text itself. */
enum error_code rig_load_text(const char *name, const char *text, size_t size, struct arena *arena,
                              const struct rig **rig, struct error *error);

/* Returns the name of the body that a contact motion belongs to. */
const char *rig_contact_name(const struct rig *rig, size_t motion);

/* Returns the index of a bus by name, or -1. */
int rig_find_bus(const struct rig *rig, const char *name);

/* Returns the configuration of a host that knows the boards of the rig, on ports of its own, one
 * a bus; all borrowed. */
struct host_config rig_host_config(const struct rig *rig, struct can_port **port, bool lockstep);

/* Reads a trajectory (tasks/trajectory.h) for the driven joints: angles within their limits, rates
 * within what a drive reaches at the supply's voltage, where the servo's gains say it
 * (kw_v_s_per_rad). Not RT-safe. */
enum error_code rig_read_trajectory(const struct rig *rig, const char *path,
                                    enum trajectory_interpolation interpolation,
                                    struct arena *arena, const struct trajectory **trajectory,
                                    struct error *error);

/* Returns the traffic of a port in both directions, in bit times of the bus's nominal rate,
 * without stuff bits. */
double rig_bus_bits(const struct rig_bus *bus, const struct can_counters *counters);

/* Computes the worst-case load of a bus in bit times of its nominal rate a second (so that load
 * / bitrate is the share of its time, also with CAN FD), stuff bits and interframe spaces
 * included. Telemetry: icub motors at the host's default broadcast policy (0x7f), foc, compact
 * and cia402 motors once a tick, described boards as their protocol has it, STRAIN and F/T
 * boards at their periods. Commands: icub a voltage to every axis each command_period_ns, the
 * others all set-points of the bus once a tick, cia402 with a SYNC; these know no period below a
 * millisecond. */
void rig_bus_load(const struct rig *rig, size_t bus, int64_t command_period_ns,
                  double *telemetry_bit_s, double *command_bit_s);

/* Returns whether the periodic traffic of a bus exceeds its bit rate at the worst; text then
 * says so, with remedies. */
bool rig_bus_over_budget(const struct rig *rig, size_t bus, char *text, size_t size);

/* ---- faults of a run: the lines of the section `faults`, and those of the command line ---- */

/* Reads all lines, extra (nextra) being those of --fault. wire: by bus, whether it is a wire in
 * virtual time. Errors begin with file:line:column or --fault. Memory from arena. Not RT-safe. */
enum error_code rig_faults_create(const struct rig *rig, const char *const *extra, size_t nextra,
                                  uint64_t seed, const bool *wire, struct arena *arena,
                                  struct faults **faults, struct error *error);

/* Puts out all faults that a rig can have (faults_list); every bus may be a wire. Not RT-safe. */
enum error_code rig_list_faults(const struct rig *rig, fault_list_put put, void *context,
                                struct error *error);

/* Checks one line of a file other than the rig's, as a scenario; every bus may be a wire here.
 * fault: what it says. Errors begin with file:line:column. Not RT-safe. */
enum error_code rig_check_fault(const struct rig *rig, const struct yaml_name *line,
                                struct fault *fault, struct error *error);

#endif
