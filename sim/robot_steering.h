/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What steers a simulator's parts: it carries out what rt/steering.h lets others ask for on plant,
 * boards, sensors, faults and buses, and knows what of them has to be copied to go back in time.
 *
 * Tunables, each where there is such a thing:
 *   joint.NAME.SETTING       the gains and limits of the joint's board (boards/board.h)
 *   joint.NAME.pretension_m  of the parallel spring; its winch gets there at STEERED_WINCH_M_S
 *   supply_v                 of the source, without load and sag
 *   sensing.noise_scale      factor on all sensor noise
 * They are part of what goes back.
 */
#ifndef SIM_STEERED_H
#define SIM_STEERED_H

#include "boards/sensing.h"
#include "model/plant.h"
#include "sim/buses.h"
#include "sim/checkpoint.h"
#include "sim/injection.h"
#include "rt/steering_machine.h"

#define STEERED_WINCH_M_S 0.1

struct steered_config {
    const struct rig *rig;
    struct plant *plant;
    struct boards *boards;
    struct sensing *sensing;
    struct faults *faults;
    struct injection *injection;
    struct buses *buses;
    /* Everything else that moves, and what lies in it that other threads write; borrowed. */
    const struct span *moving, *hole;
    size_t nmoving, nhole;
    size_t own;    /* participants of the buses, the first to join, that the loop's thread is */
    bool one_way;  /* something runs along that cannot go back: a task in its own thread */
    void *context; /* of the two below */
    /* struct steering_machine */
    void (*publish)(void *context, int64_t now_ns, const struct loop_stats *stats);
    /* Of what runs along at its own pace, which then must be one; likewise; NULL = nothing does. */
    void (*pace)(void *context, double speed, bool paused);
};

struct steered;

/* Memory from arena, copies of all that moves included. To be destroyed with steering_destroy. Not
 * RT-safe. */
enum error_code steered_create(const struct steered_config *config, struct arena *arena,
                               struct steered **steered, struct steering **steering,
                               struct error *error);

/* Bytes of one checkpoint. */
size_t steered_checkpoint_size(const struct steered *steered);

#endif
