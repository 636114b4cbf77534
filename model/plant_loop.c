/* SPDX-License-Identifier: Apache-2.0 */
/* The drives' own current controllers: their commands, delays and filters over the substeps. */
#include "model/implicit/implicit.h"
#include "model/plant_private.h"

#include <math.h>
#include <string.h>

/* Supply below which a controller has no voltage, V. */
#define LEAST_SUPPLY_V 1e-6

/* Filters with at most this time constant are left out, s. */
#define SHORTEST_FILTER_S 1e-9

/* A delay counts as whole substeps if it differs from them by at most this share of a substep. */
#define WHOLE_SUBSTEP 1e-9

/* Largest product of a controller's bandwidth (rad/s) and the substep with rk4, which is stable up
 * to 2.78. */
#define RK4_DECAY 2.0

/* Returns the whole substeps in the delay of a drive's commands. *rest receives the remainder, s.
 * */
static size_t delay_substeps(const struct plant *plant, size_t d, double *rest)
{
    const double h = 1e-9 * (double)plant->config.substep_ns;
    const double delay = plant->sea[d].command_delay_s, whole = floor(delay / h + WHOLE_SUBSTEP);

    *rest = fmax(0.0, delay - whole * h);
    return (size_t)whole;
}

bool plant_loop_create(struct plant *plant, struct arena *arena)
{
    for (size_t d = 0; d < plant->ndrive; d++) {
        double rest;

        plant->ndelayed[d] = delay_substeps(plant, d, &rest) + 2;
        plant->delayed[d] = arena_alloc(arena, plant->ndelayed[d], sizeof *plant->delayed[d]);
        if (!plant->delayed[d]) {
            return false;
        }
    }
    return true;
}

/* Returns a number, or 0 if it is not finite. */
static double finite_or_0(double x)
{
    return isfinite(x) ? x : 0.0;
}

void plant_loop_hold(struct plant *plant, size_t d, double supply)
{
    const struct motor_command *motor = &plant->command.motor[plant->drive_joint[d]];
    const struct sea_state drive = plant_drive_state(plant, plant->state, d);
    const struct robot_sea *sea = &plant->sea[d];
    const struct current_law *law = &motor->law;
    struct current_loop *loop = &plant->loop[d];
    const bool on = law->on && plant->bridge_on[d] && !(motor->condition & DRIVE_SHORT);
    const double hz = sea->current_loop_hz > 0.0 ? sea->current_loop_hz : CURRENT_LOOP_HZ;

    if (on != loop->on) {
        /* A controller starts at the present current, and without commands under way */
        loop->filtered = drive.I;
        memset(plant->delayed[d], 0, plant->ndelayed[d] * sizeof *plant->delayed[d]);
        if (plant->implicit) {
            implicit_switch_loop(plant, d);
        }
    }
    loop->on = on;
    plant->has_loops = plant->has_loops || on;
    if (!on) {
        return;
    }
    loop->bandwidth = law->bandwidth_rad_s > 0.0 ? law->bandwidth_rad_s : 2.0 * M_PI * hz;
    if (plant->config.integrator == PLANT_RK4) {
        loop->bandwidth = fmin(loop->bandwidth, RK4_DECAY * 1e9 / (double)plant->config.substep_ns);
    }
    loop->filter_s = sea->command_filter_s > SHORTEST_FILTER_S ? sea->command_filter_s : 0.0;
    loop->supply = fmax(supply * (1.0 - law->unused), LEAST_SUPPLY_V);

    /* Errors of the reading shift the position target */
    const double reading = finite_or_0(drive.qm - law->reading_rad);
    const double limit = law->limit_a > 0.0 ? law->limit_a : 0.0;

    loop->given = (struct loop_command){
        .current = fmax(fmin(finite_or_0(law->current_a), limit), -limit),
        .position = finite_or_0(law->position_rad) + reading,
        .speed = finite_or_0(law->speed_rad_s),
        .stiffness = fmax(0.0, finite_or_0(law->stiffness_a_rad)),
        .damping = fmax(0.0, finite_or_0(law->damping_a_s_rad)),
        .limit = limit,
    };
}

void plant_loops_begin(struct plant *plant)
{
    for (size_t d = 0; d < plant->ndrive; d++) {
        struct current_loop *loop = &plant->loop[d];
        struct loop_command *delayed = plant->delayed[d];
        const size_t n = plant->ndelayed[d];

        if (loop->on) {
            const size_t at = plant->substeps % n,
                         whole = delay_substeps(plant, d, &loop->switch_s);

            delayed[at] = loop->given;
            loop->command[1] = delayed[(at + n - whole) % n];
            loop->command[0] = delayed[(at + n - whole - 1) % n];
        }
    }
}

void plant_loops_end(struct plant *plant, double h)
{
    plant->within_s = h;
    plant->substeps++;
    for (size_t d = 0; d < plant->ndrive; d++) {
        if (plant->loop[d].on) {
            plant->voltage[d] = plant_drive_voltage(plant, plant->state, d);
            if (plant->has_effects) {
                plant->bridge[d].voltage = plant->voltage[d];
            }
            plant->loop[d].filtered = loop_filtered(&plant->loop[d], h);
        }
    }
}

double plant_drive_voltage(const struct plant *plant, const double *state, size_t d)
{
    const struct current_loop *loop = &plant->loop[d];
    const struct robot_sea *sea = &plant->sea[d];
    const struct sea_state drive = plant_drive_state(plant, state, d);
    double steady = sea->R * drive.I + sea->Kw * drive.qmd, target, V;

    if (!loop->on) {
        return plant->voltage[d];
    }
    target = loop_target(loop, plant->within_s, drive.qm, drive.qmd, NULL);
    if (sea->effects) {
        const struct effects_state effects = plant_effects_state(plant, state, d);

        steady = effects_steady_voltage(sea, &effects, &plant->bridge[d]);
    }
    V = steady + sea->L * loop->bandwidth * (target - drive.I);
    return fmax(fmin(V, loop->supply), -loop->supply);
}
