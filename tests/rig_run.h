/* SPDX-License-Identifier: Apache-2.0 */
/* A simulator of a rig that ships: load the rig, change it, open the simulator, close. */
#ifndef TESTS_RIG_RUN_H
#define TESTS_RIG_RUN_H

#include "sim/simulator.h"
#include "tests/test.h"

/* Copies a rig of config/rigs to where the test may change it. */
static inline void rig_run_load(const char *name, struct arena *arena, struct rig *rig)
{
    const struct rig *loaded;
    struct error error;
    char path[512];

    snprintf(path, sizeof path, "%s/config/rigs/%s.yaml", HIL_SOURCE_DIR, name);
    if (arena_init(arena, (size_t)1 << 30, &error) || rig_load(path, arena, &loaded, &error)) {
        fail_msg("%s", error.text);
    }
    *rig = *loaded;
}

static inline void rig_run_without_contact(struct rig *rig)
{
    rig->contact_engine = RIG_CONTACT_NONE;
    rig->contact = (struct contact_config){0};
    rig->nlisted_pair = 0;
}

/* Creates and starts; ports: a guest on every bus, NULL: none. */
static inline struct simulator *rig_run_open(const struct simulator_config *config,
                                             struct arena *arena, struct bus_ports *ports)
{
    struct simulator *simulator;
    struct realtime_report report;
    struct error error;
    char notice[256];

    if (simulator_create(config, arena, &simulator, notice, &error) ||
        (ports && simulator_join(simulator, ports, &error)) ||
        simulator_start(simulator, &report, &error)) {
        fail_msg("%s", error.text);
    }
    return simulator;
}

static inline void rig_run_close(struct simulator *simulator, struct arena *arena,
                                 struct bus_ports *ports)
{
    if (ports) {
        bus_ports_close(ports);
    }
    simulator_destroy(simulator);
    arena_fini(arena);
}

#endif
