/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Executes requests of other threads on a robot: faults, pushes, tunables and checkpoints, for its
 * plant, boards, sensors and buses. It implements the interface rt/request_machine.h, which
 * rt/loop_requests.c calls. SI units, world frame, virtual times in ns.
 *
 * Tunables (each exists only if the rig has its part):
 *   joint.NAME.SETTING       a gain or limit of the joint's board (boards/board.h)
 *   joint.NAME.pretension_m  pretension of the parallel spring; its winch moves at
 *                            ROBOT_REQUESTS_WINCH_M_S
 *   supply_v                 voltage of the source, without load and sag
 *   sensing.noise_scale      factor on all sensor noise
 *   TASK.SETTING             a setting of a task in this process (tasks/task.h), for example
 *                            walk.forward_m_s
 * Tunables are part of a checkpoint.
 */
#ifndef SIM_ROBOT_REQUESTS_H
#define SIM_ROBOT_REQUESTS_H

#include "boards/sensing/sensing.h"
#include "model/plant.h"
#include "rt/request_machine.h"
#include "sim/checkpoint.h"
#include "sim/fault_injection.h"
#include "tasks/task.h"

#define ROBOT_REQUESTS_WINCH_M_S 0.1

struct robot_requests_config {
    const struct rig *rig;
    struct plant *plant;
    struct boards *boards;
    struct sensing *sensing;
    struct faults *faults;
    struct fault_injection *injection;
    struct buses *buses;
    struct task *task; /* NULL = no task in this process */
    /* Other memory that changes in virtual time, and its holes, which other threads write; borrowed
     * for the call */
    const struct span *moving, *hole;
    size_t nmoving, nhole;
    size_t own;   /* number of bus participants in the loop's thread; they join first */
    bool one_way; /* no return to an earlier time: a task runs in its own thread */
    /* As in struct request_machine; pace may be NULL */
    void *context;
    void (*publish)(void *context, int64_t now_ns, const struct loop_stats *stats);
    void (*pace)(void *context, double speed, bool paused);
};

struct robot_requests;

/* Creates the executor of requests with its checkpoint copies, in memory from arena. Keeps
 * pointers to the parts. Destroy *requests with requests_destroy. ERROR_MEMORY, ERROR_SYSTEM. Not
 * RT-safe. */
enum error_code robot_requests_create(const struct robot_requests_config *config,
                                      struct arena *arena, struct robot_requests **robot_requests,
                                      struct requests **requests, struct error *error);

#endif
