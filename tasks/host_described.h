/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the parts of the host of described protocols share: host_described.c writes its frames,
 * host_described_read.c reads those of the boards. RT-safe.
 */
#ifndef TASKS_HOST_DESCRIBED_H
#define TASKS_HOST_DESCRIBED_H

#include "tasks/host_private.h"

#include "boards/described/protocol.h"

static inline const struct described_protocol *described_line_protocol(const struct host *host,
                                                                       size_t bus)
{
    return host->config.bus[bus].described;
}

static inline unsigned described_node_kind(const struct host_node *node)
{
    return node->kind == HOST_MOTOR_BOARD      ? DESCRIBED_MOTOR
           : node->kind == HOST_FT_BOARD       ? DESCRIBED_FT
           : node->kind == HOST_INERTIAL_BOARD ? DESCRIBED_INERTIAL
                                               : 0;
}

/* Reads a frame that has arrived (struct host_ops). */
void host_described_read(struct host *host, size_t bus, const struct bus_frame *frame);

#endif
