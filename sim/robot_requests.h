/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Requests of other threads carried out on a robot: faults, pushes, tunables and checkpoints, on
 * its plant, boards, sensors and buses. It is the machine (rt/request_machine.h) that the loop's
 * part, rt/loop_requests.c, drives. SI units, world frame, virtual times in ns.
 *
 * Tunables, each where there is such a thing:
 *   joint.NAME.SETTING       the gains and limits of the joint's board (boards/board.h)
 *   joint.NAME.pretension_m  of the parallel spring; its winch moves at ROBOT_REQUESTS_WINCH_M_S
 *   supply_v                 of the source, without load and sag
 *   sensing.noise_scale      factor on all sensor noise
 *   TASK.SETTING             what a task in this process has (tasks/task.h), walk.forward_m_s
 * They are part of a checkpoint.
 */
#ifndef SIM_ROBOT_REQUESTS_H
#define SIM_ROBOT_REQUESTS_H

#include "boards/sensing/sensing.h"
#include "model/plant.h"
#include "rt/request_machine.h"
#include "sim/buses.h"
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
    struct task *task; /* NULL = none in this process */
    /* Everything else that changes in virtual time, and what lies in it that other threads write;
     * borrowed for the call. */
    const struct span *moving, *hole;
    size_t nmoving, nhole;
    size_t own;   /* participants of the buses, the first to join, that run in the loop's thread */
    bool one_way; /* time cannot go back: a task runs in a thread of its own */
    /* As in struct request_machine; pace may be NULL. */
    void *context;
    void (*publish)(void *context, int64_t now_ns, const struct loop_stats *stats);
    void (*pace)(void *context, double speed, bool paused);
};

struct robot_requests;

/* Creates what carries out requests, in memory from arena, the copies for checkpoints included;
 * keeps pointers to the parts. *requests is to be destroyed with requests_destroy. ERROR_MEMORY,
 * ERROR_SYSTEM. Not RT-safe. */
enum error_code robot_requests_create(const struct robot_requests_config *config,
                                      struct arena *arena, struct robot_requests **robot_requests,
                                      struct requests **requests, struct error *error);

#endif
