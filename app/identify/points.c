/* SPDX-License-Identifier: Apache-2.0 */
/* Computes steady states from two known quantities, and draws drive/back-drive diagrams. */

#include "app/identify/identify.h"

#include "base/array.h"
#include "model/drives/effects.h"
#include "model/drives/steady.h"

#include <math.h>
#include <string.h>

/* Points per line of a diagram; most points of a bench in one diagram. */
enum { DIAGRAM_STEPS = 101, DIAGRAM_POINTS = 64 };

double point_compute(const struct robot_sea *sea, const struct bench_point *point)
{
    const double *known = point->known;
    const int sense = point->backdriven ? -1 : 1;
    double q[POINT_QUANTITIES];

    memcpy(q, known, sizeof q);

    /* Compute the speed and the motor torque */
    if (isnan(known[POINT_SPEED])) {
        q[POINT_SPEED] = steady_speed(sea, q[POINT_VOLTAGE], q[POINT_LOAD]);
    }
    if (!isnan(known[POINT_VOLTAGE])) {
        q[POINT_CURRENT] = steady_current(sea, q[POINT_VOLTAGE], (double)sense * q[POINT_SPEED]);
    }
    if (!isnan(known[POINT_VOLTAGE]) || !isnan(known[POINT_CURRENT])) {
        q[POINT_MOTOR] = sea->Kt * effects_saturation(sea, q[POINT_CURRENT]) * q[POINT_CURRENT];
    } else if (isnan(known[POINT_MOTOR])) {
        q[POINT_MOTOR] = steady_motor(sea, q[POINT_LOAD], q[POINT_SPEED], sense);
    }

    /* Compute the quantities that depend on them */
    if (isnan(known[POINT_LOAD])) {
        q[POINT_LOAD] = steady_load(sea, q[POINT_MOTOR], q[POINT_SPEED], sense);
    }
    q[POINT_CURRENT] = effects_current(sea, q[POINT_MOTOR]);
    q[POINT_VOLTAGE] =
        (sea->R + effects_skin(sea, q[POINT_SPEED])) * q[POINT_CURRENT] +
        (double)sense * sea->Kw * effects_saturation(sea, q[POINT_CURRENT]) * q[POINT_SPEED];
    q[POINT_LOSS] = q[POINT_VOLTAGE] * q[POINT_CURRENT] -
                    (double)sense * q[POINT_LOAD] * q[POINT_SPEED] +
                    (sea->effects ? sea->effects->standby : 0.0);
    return q[point->find];
}

void point_simulate(const struct trial_robot *trial, const struct recording *recording,
                    struct simulated *out)
{
    const struct robot_sea sea = trial_drive(trial);

    out->diverged = false;
    for (size_t i = 0; i < recording->count; i++) {
        const double load = recording->goal[i];
        struct bench_point point = {
            .known = {NAN, NAN, NAN, recording->voltage[i], fabs(load), NAN},
            .backdriven = load < 0.0,
            .find = POINT_LOSS};
        double loss = point_compute(&sea, &point);

        /* Beside a load that friction holds, the motor turns forward */
        if (isnan(loss) && point.backdriven) {
            point.backdriven = false;
            point.known[POINT_LOAD] = load;
            loss = point_compute(&sea, &point);
        }
        out->signal[SIGNAL_LOSS][i] = isfinite(loss) ? loss / recording->time[i] : 0.0;
        out->diverged |= !isfinite(loss);
    }
}

double point_loss_error(const struct recording *recording, const double *found)
{
    const double *measured = recording->signal[SIGNAL_LOSS];
    double low = 0.0, high = simulation_compare(measured, found, recording->count).worst;

    while (high - low > 1e-9 * high) {
        const double middle = 0.5 * (low + high);
        size_t within = 0;

        for (size_t i = 0; i < recording->count; i++) {
            within += fabs(found[i] - measured[i]) <= middle;
        }
        *(2 * within >= recording->count ? &high : &low) = middle;
    }
    return high;
}

double point_efficiency_error(const struct recording *recording, const double *found)
{
    double sum = 0.0, count = 0.0;

    for (size_t i = 0; i < recording->count; i++) {
        const double power = recording->goal[i] * recording->voltage[i], loss = recording->time[i];
        const double ours = loss * found[i];

        if (power > 0.0) {
            sum += fabs(power / (power + ours) - power / (power + loss));
            count++;
        } else if (-power > loss) {
            sum += fabs(ours - loss) / -power;
            count++;
        }
    }
    return count > 0.0 ? sum / count : 0.0;
}

/* Copies the bench's points for one line of the diagram: those at rest with a known motor torque.
 * backdriven selects the line. */
static size_t take_points(const struct bench *bench, bool backdriven, double *motor, double *load)
{
    size_t count = 0;

    for (size_t i = 0; i < bench->npoint && count < DIAGRAM_POINTS; i++) {
        const struct bench_point *point = &bench->point[i];

        if (!isnan(point->known[POINT_MOTOR]) && point->known[POINT_SPEED] == 0.0 &&
            point->find == POINT_LOAD && point->backdriven == backdriven) {
            motor[count] = point->known[POINT_MOTOR];
            load[count++] = point->value;
        }
    }
    return count;
}

void point_diagram(struct report *report, const char *id, const struct robot_sea *sea,
                   const struct bench *bench)
{
    double motor[DIAGRAM_STEPS], turned[DIAGRAM_STEPS], back[DIAGRAM_STEPS];
    double x[2][DIAGRAM_POINTS], y[2][DIAGRAM_POINTS];
    const size_t count[2] = {take_points(bench, false, x[0], y[0]),
                             take_points(bench, true, x[1], y[1])};

    for (size_t i = 0; i < DIAGRAM_STEPS; i++) {
        motor[i] = bench->diagram_nm * (double)i / (DIAGRAM_STEPS - 1);
        turned[i] = steady_load(sea, motor[i], 0.0, 1);
        back[i] = steady_load(sea, motor[i], 0.0, -1);
    }

    const struct svg_series series[] = {
        svg_line("turned by the motor", motor, turned, DIAGRAM_STEPS, SVG_LINE),
        svg_line("turns it back", motor, back, DIAGRAM_STEPS, SVG_LINE),
        svg_line("no friction", motor, motor, DIAGRAM_STEPS, SVG_DASHED),
        svg_line("turned, published", x[0], y[0], count[0], SVG_MARKERS),
        svg_line("turns back, published", x[1], y[1], count[1], SVG_MARKERS),
    };
    struct svg_plot panel = svg_panel("", "torque of the motor, N m", "load, N m", series,
                                      count[0] + count[1] > 0 ? ARRAY_COUNT(series) : 3);

    panel.x.fixed = panel.y.fixed = true;
    panel.x.max = panel.y.max = bench->diagram_nm;
    report_figure(report, id,
                  "Loads at rest: below the first line the motor turns the load, above "
                  "the second the load turns it back, between them nothing moves",
                  &panel, 1);
}
