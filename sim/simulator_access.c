/* SPDX-License-Identifier: Apache-2.0 */
/* Gives access to what others may see of a simulator, and to its parts. */
#include "sim/simulator_private.h"

enum error_code simulator_join(struct simulator *simulator, struct bus_ports *ports,
                               struct error *error)
{
    return buses_join(&simulator->buses, simulator->arena, ports, error);
}

uint64_t simulator_beat(const struct simulator *simulator)
{
    return loop_beat(simulator->loop);
}

bool simulator_read(const struct simulator *simulator, struct simulator_status *status)
{
    return snapshot_read(simulator->published, status) > 0;
}

size_t simulator_signals(const struct simulator *simulator)
{
    return simulator->nsignal;
}

const char *const *simulator_signal_names(const struct simulator *simulator)
{
    return simulator->title;
}

struct stream *simulator_stream(const struct simulator *simulator)
{
    return simulator->stream;
}

void simulator_watch_interfaces(struct simulator *simulator, int64_t now_ns)
{
    interfaces_watch(&simulator->interfaces, now_ns);
    buses_seek(&simulator->buses, now_ns);
}

const struct simulator_config *simulator_configuration(const struct simulator *simulator)
{
    return &simulator->config;
}

const struct loop_stats *simulator_stats(const struct simulator *simulator)
{
    return loop_stats(simulator->loop);
}

struct can_port *simulator_port(const struct simulator *simulator, size_t bus)
{
    return simulator->ports.port[bus];
}

struct boards *simulator_boards(const struct simulator *simulator)
{
    return simulator->boards;
}

struct faults *simulator_faults(const struct simulator *simulator)
{
    return simulator->faults;
}

struct plant *simulator_plant(const struct simulator *simulator)
{
    return simulator->plant;
}

const struct plant_sensors *simulator_measured(const struct simulator *simulator)
{
    return simulator->measured;
}

struct gateway *simulator_gateway(const struct simulator *simulator)
{
    return simulator->gateway;
}

const struct task_runner *simulator_task_runner(const struct simulator *simulator)
{
    return simulator->task;
}

const char *simulator_failure(const struct simulator *simulator)
{
    return simulator->failure;
}

const struct settled *simulator_settled(const struct simulator *simulator)
{
    return simulator->config.settle ? &simulator->settled : NULL;
}

const struct stimulus *simulator_stimulus(const struct simulator *simulator)
{
    return simulator->config.stimulus ? &simulator->stimulus : NULL;
}

const char *simulator_dynamics(const struct simulator *simulator)
{
    return simulator->dynamics_notice.text;
}

bool simulator_can_controller_state(const struct simulator *simulator, size_t bus, char *text,
                                    size_t size)
{
    return interfaces_describe(&simulator->interfaces, bus, text, size);
}

const struct wire *simulator_wire(const struct simulator *simulator, size_t bus)
{
    return simulator->buses.wire[bus];
}

struct requests *simulator_requests(const struct simulator *simulator)
{
    return simulator->requests;
}

size_t simulator_checkpoint_size(const struct simulator *simulator)
{
    return simulator->robot_requests ? robot_requests_checkpoint_size(simulator->robot_requests)
                                     : 0;
}

bool simulator_is_local(const struct simulator *simulator)
{
    return simulator->buses.local;
}

const struct plant_contact_cost *simulator_contact_cost(const struct simulator *simulator)
{
    return plant_contact_cost(simulator->plant);
}
