/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives without effects under their own current controllers (model/drives/current_loop.h) in the
 * spans of the implicit integrator. Their flows are computed when a span first needs them, and
 * again after a change of a gain. A drive whose rotor oscillates too fast takes implicit Euler
 * steps of a stage, as drives at a voltage do.
 */
#include "model/implicit/private.h"

#include <math.h>
#include <string.h>

void implicit_switch_loop(struct plant *plant, size_t d)
{
    plant->implicit->lane_bridge[d] = BRIDGE_UNKNOWN;
    memset(&plant->implicit->loop_flows[d], 0, sizeof plant->implicit->loop_flows[d]);
}

/* Discards the flows of drive d if bandwidth, filter or gains of the last command have changed. */
static void check_loop_flows(struct plant *plant, size_t d)
{
    struct loop_flows *flows = &plant->implicit->loop_flows[d];
    const struct current_loop *loop = &plant->loop[d];
    struct loop_row row;

    loop_fill_row(&plant->sea[d], loop, &loop->command[1], LOOP_FREE, &row);
    if (memcmp(&row, &flows->row, sizeof row) != 0) {
        memset(flows, 0, sizeof *flows);
        flows->row = row;
    }
}

struct sea_state implicit_follow_loop(struct plant *plant, size_t d,
                                      const struct implicit_part *part,
                                      const struct sea_state *drive, double q, double rate,
                                      struct sea_state *slope)
{
    const struct current_loop *loop = &plant->loop[d];
    const struct loop_command *last = &loop->command[1],
                              *first = loop_command_at(loop, part->begin_s);
    const double h = part->step_s, stage = IMPLICIT_GAMMA * h;
    const double length = part->span == SPAN_STAGE ? stage : h - stage;
    struct robot_sea sea = plant->sea[d];
    struct sea_state end = *drive;
    struct loop_span span = {.loop = loop, .begin = part->begin_s, .q = q, .rate = rate};

    if (part->law == SPRING_PRESSED) {
        sea.Ks += sea.stop.stiffness;
        sea.Ds += sea.stop.damping;
        span.shift = implicit_stop_shift(&plant->sea[d], drive->qm - q);
    }
    span.sea = &sea;
    if (drive_swings_fast(sea.Ks + sea.Kt * fmax(first->stiffness, last->stiffness), sea.J,
                          stage)) {
        span.length = stage;
        loop_step_implicit(&span, length, &end, slope);
        return end;
    }
    check_loop_flows(plant, d);
    span.length = length;
    const bool known_gains = first->stiffness == last->stiffness && first->damping == last->damping;

    for (int kind = 0; kind < LOOP_KINDS && known_gains; kind++) {
        struct loop_flow *known =
            &plant->implicit->loop_flows[d].of[part->law][part->level][part->span][kind];

        /* The flow of a limit only if it has been needed or is needed at the start */
        if (kind == LOOP_FREE || known->t > 0.0 ||
            (int)loop_find_regime(&span, span.begin, drive).kind == kind) {
            if (known->t == 0.0) {
                struct loop_row row;

                loop_fill_row(&sea, loop, last, (enum loop_kind)kind, &row);
                loop_flow_make(&sea, &row, length, known);
            }
            span.flow[kind] = known;
        }
    }
    loop_advance(&span, &end, slope);
    return end;
}
