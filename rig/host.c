/* SPDX-License-Identifier: Apache-2.0 */
/* What a rig tells the host on the other side of its buses. */
#include "rig/rig.h"

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
