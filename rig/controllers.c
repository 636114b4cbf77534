/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the configuration of a host from a rig. */
#include "rig/rig.h"

#include <math.h>

struct host_config rig_host_config(const struct rig *rig, struct can_port **port, bool lockstep)
{
    return (struct host_config){
        .nbus = rig->nbus,
        .port = port,
        .bus = rig->host_bus,
        .naxis = rig->naxis,
        .axis = rig->axis,
        .nft = rig->nft,
        .ft = rig->ft,
        .imu = rig->imu,
        .supply_v = rig->supply_v,
        .period_ns = rig->tick_ns,
        .lockstep = lockstep,
        .lockstep_bus = rig->lockstep.bus,
        .step_id = rig->lockstep.step_id,
        .done_id = rig->lockstep.done_id,
    };
}

enum error_code rig_read_trajectory(const struct rig *rig, const char *path,
                                    enum trajectory_interpolation interpolation,
                                    struct arena *arena, const struct trajectory **trajectory,
                                    struct error *error)
{
    struct trajectory_limit *limit = arena_alloc(arena, rig->naxis, sizeof *limit);
    struct csv *csv;

    if (!limit) {
        return error_set(error, ERROR_MEMORY, "no memory for a trajectory");
    }
    for (size_t i = 0; i < rig->naxis; i++) {
        const struct servo_gains *gains = &rig->servo.gains[i];
        double volts = gains->limit_v > 0 ? fmin(gains->limit_v, rig->supply_v) : rig->supply_v;

        limit[i] = (struct trajectory_limit){
            .joint = rig->axis[i].joint,
            .lower_rad = rig->axis[i].lower_rad,
            .upper_rad = rig->axis[i].upper_rad,
            .rate_rad_s = gains->kw_v_s_per_rad > 0 ? volts / gains->kw_v_s_per_rad : 0,
        };
    }
    return csv_open(path, &csv, error)
               ? error->code
               : trajectory_read(csv, interpolation, limit, rig->naxis, arena, trajectory, error);
}
