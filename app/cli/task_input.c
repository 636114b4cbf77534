/* SPDX-License-Identifier: Apache-2.0 */
/* Reads the options of the tasks sweep, excite and follow, and writes their reports: tables, Bode
 * plots, a page. */
#include "app/cli/cli.h"
#include "app/report/report.h"

#include <math.h>
#include <stdlib.h>

/* Columns of values for the plots: magnitude, phase and coherence of each response. */
enum { SWEEP_COLUMNS = 3 * SWEEP_RESPONSES, PANELS = 3 };

static const char *const sweep_name[SWEEP_RESPONSES] = {"link", "rotor", "torque"};

/* Checks whether a response was measured; the cells of others stay empty. */
static bool sweep_was_heard(const struct sweep_response *response)
{
    return response->coherence > 0;
}

/* Writes the table of all points: gain, phase and coherence of link, rotor and torque. */
static void sweep_write_table(struct report *report, const struct sweep_point *point, size_t count)
{
    const char *in = point->by_angle ? "rad" : "V";

    /* Columns and units depend on the input of the drive: an angle or a voltage */
    report_table(
        report, "sweep", "Responses of the drive, a unit of what drives it.",
        point->by_angle
            ? "frequency_hz|input_rad|link_rad_per_rad|link_deg|link_coherence|rotor_rad_per_rad|"
              "rotor_deg|rotor_coherence|torque_nm_per_rad|torque_deg|torque_coherence"
            : "frequency_hz|input_v|link_rad_per_v|link_deg|link_coherence|rotor_rad_per_v|rotor_"
              "deg|rotor_coherence|torque_nm_per_v|torque_deg|torque_coherence");
    for (size_t i = 0; i < count; i++) {
        char cell[SWEEP_RESPONSES][96];

        for (int k = 0; k < SWEEP_RESPONSES; k++) {
            const struct sweep_response *response = &point[i].response[k];

            if (sweep_was_heard(response)) {
                snprintf(cell[k], sizeof cell[k], "%.9g|%.6f|%.6f", response->magnitude,
                         response->phase_rad * 180 / M_PI, response->coherence);
            } else {
                snprintf(cell[k], sizeof cell[k], "||");
            }
        }
        report_row(report, "%.9g|%.9g|%s|%s|%s", point[i].frequency_hz, point[i].input, cell[0],
                   cell[1], cell[2]);
    }

    /* Explanation for the reader */
    report_text(report,
                "The input is in %s; link and rotor are angles at the link's side of the gear; a "
                "phase is positive when the response leads. The coherence is the part of a "
                "signal's variance that is its response: below 0.9, give more amplitude.",
                in);
}

/* Draws the Bode plots; value has room for all columns and the frequencies. */
static void sweep_draw(struct report *report, const struct sweep_point *point, size_t count,
                       double *value)
{
    static const char *const angle_label[] = {"angle, rad/V", "phase, degrees", "coherence"};
    static const char *const torque_label[] = {"torque, N m/V", "phase, degrees", "coherence"};
    double *frequency = value + SWEEP_COLUMNS * count;
    struct svg_series series[2 * PANELS][2];
    struct svg_plot panel[2 * PANELS];

    for (size_t i = 0; i < count; i++) {
        frequency[i] = point[i].frequency_hz;
    }
    for (int k = 0; k < SWEEP_RESPONSES; k++) {
        double *column = value + (size_t)k * PANELS * count;
        double *magnitude = column, *phase = column + count, *coherence = column + 2 * count;
        const double none = (double)NAN;
        double turns = 0, last = none;

        /* Fill the columns of a response: magnitude, phase unwrapped to steps below half a
         * turn, coherence; NAN if it was not measured */
        for (size_t i = 0; i < count; i++) {
            const struct sweep_response *response = &point[i].response[k];
            double degrees = response->phase_rad * 180 / M_PI;
            bool heard = sweep_was_heard(response);

            if (heard && !isnan(last)) {
                turns -= rint((degrees + 360 * turns - last) / 360);
            }
            magnitude[i] = heard ? response->magnitude : none;
            phase[i] = heard ? degrees + 360 * turns : none;
            coherence[i] = heard ? response->coherence : none;
            last = heard ? phase[i] : last;
        }
    }

    /* Angles are in one row of panels, the torque in another */
    for (size_t p = 0; p < 2 * PANELS; p++) {
        bool torque = p >= PANELS;
        size_t kind = p % PANELS;

        panel[p] = svg_panel("", "frequency, Hz", torque ? torque_label[kind] : angle_label[kind],
                             series[p], torque ? 1 : 2);
        panel[p].x.logarithmic = true;
        panel[p].y.logarithmic = kind == 0;
        if (point->by_angle && kind == 0) {
            panel[p].y.label = torque ? "torque, N m/rad" : "angle, rad/rad";
        }
        for (size_t s = 0; s < panel[p].nseries; s++) {
            size_t k = torque ? SWEEP_TORQUE : s;

            series[p][s] = svg_line(sweep_name[k], frequency, value + (k * PANELS + kind) * count,
                                    count, SVG_LINE_MARKERS);
        }
    }
    report_figure(report, "bode-angle", "Angles of link and rotor.", panel, PANELS);
    if (sweep_was_heard(&point->response[SWEEP_TORQUE])) {
        report_figure(report, "bode-torque", "Torque of the joint.", panel + PANELS, PANELS);
    }
}

enum error_code task_report_write(const struct task *task, const char *folder, struct error *error)
{
    const struct sweep_point *point;
    const struct follow_error *joint;
    size_t points = task_sweep_points(task, &point), joints = task_follow_errors(task, &joint);
    struct report report;
    enum error_code code;
    double *value;

    if (!folder || points + joints == 0) {
        return ERROR_NONE;
    }

    /* Columns of all responses, followed by the frequencies */
    value = malloc((SWEEP_COLUMNS + 1) * (points + 1) * sizeof *value);
    if (!value) {
        return error_set(error, ERROR_MEMORY, "no memory for the report");
    }
    code = report_open(&report, folder, points ? "Frequency response" : "Tracking errors", error);
    if (!code) {
        report_section(&report, "result", task_message(task));
        if (points) {
            sweep_draw(&report, point, points, value);
            sweep_write_table(&report, point, points);
        } else {
            /* Write the table of tracking errors, one row per joint */
            report_table(&report, "follow", "Measured less wanted angles of the links.",
                         "joint|in_file|samples|rms_rad|worst_rad|worst_at_s");
            for (size_t i = 0; i < joints; i++) {
                report_row(&report, "%s|%s|%zu|%.6g|%.6g|%.3f", joint[i].joint,
                           joint[i].moves ? "yes" : "no", joint[i].count, joint[i].rms_rad,
                           joint[i].worst_rad, joint[i].worst_s);
            }
        }
        code = report_close(&report, error);
    }
    free(value);
    return code;
}

const struct word task_interpolation_words[] = {
    {"cubic", TRAJECTORY_CUBIC}, {"linear", TRAJECTORY_LINEAR}, {0}};

/* Refuses an option that the task does not have; the error names the tasks that have it. */
static enum error_code task_input_refuse(const char *option, const char *task, struct error *error)
{
    return error_set(error, ERROR_INPUT, "found %s with %s%s, expected it with %s only", option,
                     task ? "the task " : "no task", task ? task : "",
                     strcmp(option, "--joint") == 0    ? "sweep and excite"
                     : strcmp(option, "--report") == 0 ? "sweep and follow"
                                                       : "follow");
}

enum error_code task_input_read(const struct task_options *options, const char *task,
                                const struct rig *rig, struct arena *arena,
                                struct task_input *input, struct error *error)
{
    bool sweep = task && strcmp(task, "sweep") == 0, follow = task && strcmp(task, "follow") == 0;
    bool excite = task && strcmp(task, "excite") == 0;

    *input = (struct task_input){.joint = options->joint};
    if (options->joint && !sweep && !excite) {
        return task_input_refuse("--joint", task, error);
    }
    if (options->trajectory && !follow) {
        return task_input_refuse("--trajectory", task, error);
    }
    if (options->interpolation && !follow) {
        return task_input_refuse("--interpolation", task, error);
    }
    if (options->report && !sweep && !follow) {
        return task_input_refuse("--report", task, error);
    }
    return options->trajectory
               ? rig_read_trajectory(rig, options->trajectory,
                                     (enum trajectory_interpolation)options->interpolation, arena,
                                     &input->trajectory, error)
               : ERROR_NONE;
}
