/* SPDX-License-Identifier: Apache-2.0 */
/* Reproduces the paper's Fig. 12: WALK-MAN squats. */
#include "app/bench/bench.h"

#include "base/array.h"
#include "base/vec3.h"
#include "boards/icub/protocol.h"
#include "canbus/candump.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define STAND_S 1.0 /* time for which the task stands still after its last cycle */
#define ROW_MS 20   /* period of the recorded rows, virtual time */

/* Columns of the recording. */
enum { TIME, KNEE_TORQUE, FOOT_RIGHT, FOOT_LEFT, BASE, JOINTS = BASE + 7 };

/* Series derived from the recording. All arrays have its length, except the arrays of the board. */
struct squat {
    const struct rig *rig;
    size_t count;
    double *time; /* time since the first cycle began, s */
    double *const *value;
    /* Set point and angle of the right hip, rad; torque of the right knee, N m; height of the base,
     * m. */
    double *reference, *hip, *knee, *height;
    double *feet, *newton; /* contact force of both feet; m (g + a) of the center of mass, N */
    double *board_time, *board_force; /* frames of the right F/T board */
    size_t nboard;
};

/* Computes the hip's set point, rad, from the law of cosines: the hips sink vertically above the
 * ankles. top: height of the hip above the ankle at the start, m. */
static double hip_reference(const struct squat_config *squat, double top, double t)
{
    double a = squat->thigh_m, b = squat->shank_m, height = top, knee;

    if (t > 0.0 && t < squat->period_s * squat->cycles) {
        height -= squat->depth_m / 2.0 * (1.0 - cos(2.0 * M_PI * t / squat->period_s));
    }
    knee = M_PI - acos((a * a + b * b - height * height) / (2.0 * a * b));
    return -asin(b * sin(knee) / height);
}

/* Computes heights of base and center of mass, angles and forces of every row. Returns false
 * without memory. */
static bool squat_derive_series(struct squat *squat, struct arena *arena)
{
    const struct robot *robot = squat->rig->robot;
    struct body_motion *body = arena_alloc(arena, robot->nbody, sizeof *body);
    double **array[] = {&squat->reference, &squat->hip,  &squat->knee,
                        &squat->height,    &squat->feet, &squat->newton};
    double *q = arena_alloc(arena, robot->njoint, sizeof *q);
    double *mass_height = arena_alloc(arena, squat->count + 1, sizeof *mass_height);
    int hip = robot_find_joint(robot, "RHipSag"), knee = robot_find_joint(robot, "RKneeSag");
    const struct squat_config *task = &squat->rig->squat;
    double bent = squat->rig->joint[knee], step = 1e-3 * ROW_MS, top;
    enum { HALF = 2 }; /* rows on each side of an acceleration */

    for (size_t i = 0; i < ARRAY_COUNT(array); i++) {
        *array[i] = arena_alloc(arena, squat->count + 1, sizeof(double));
        if (!*array[i]) {
            return false;
        }
    }
    if (!body || !q || !mass_height) {
        return false;
    }

    /* Compute the kinematics of every row; the set point starts from the height of the bent legs */
    top = sqrt(task->thigh_m * task->thigh_m + task->shank_m * task->shank_m +
               2.0 * task->thigh_m * task->shank_m * cos(bent));
    for (size_t i = 0; i < squat->count; i++) {
        double base[7];

        for (int k = 0; k < 7; k++) {
            base[k] = squat->value[BASE + k][i];
        }
        for (size_t j = 0; j < robot->njoint; j++) {
            q[j] = squat->value[JOINTS + j][i];
        }
        robot_place_bodies(robot, base, base + 3, q, body);
        for (size_t b = 0; b < robot->nbody; b++) {
            double com[3];

            mat3_apply(body[b].R, robot->body[b].inertia.com, com);
            mass_height[i] +=
                robot->body[b].inertia.mass / robot->total_mass * (body[b].p[2] + com[2]);
        }
        squat->height[i] = base[2];
        squat->reference[i] = hip_reference(task, top, squat->time[i]);
        squat->hip[i] = q[hip];
        squat->knee[i] = -squat->value[KNEE_TORQUE][i]; /* positive when it straightens */
        squat->feet[i] = squat->value[FOOT_RIGHT][i] + squat->value[FOOT_LEFT][i];
    }

    /* m (g + a), from second differences of the height of the center of mass */
    for (size_t i = 0; i < squat->count; i++) {
        squat->newton[i] = NAN;
        if (i >= HALF && i + HALF < squat->count) {
            double second = mass_height[i + HALF] - 2.0 * mass_height[i] + mass_height[i - HALF];

            squat->newton[i] =
                robot->total_mass * (second / (HALF * step * HALF * step) - robot->gravity[2]);
        }
    }
    return true;
}

/* Returns the force-torque board of the right foot, or NULL. */
static const struct board_config *foot_board(const struct rig *rig)
{
    for (size_t i = 0; i < rig->boards.nboard; i++) {
        const struct board_config *board = &rig->boards.board[i];

        if (board->kind == BOARD_FT && !strcmp(rig->robot->ft[board->ft].name, "r_leg_ft")) {
            return board;
        }
    }
    return NULL;
}

/* Reads the vertical forces of the right foot's force-torque board, N, from the recorded frames. */
static enum error_code squat_read_force_board(struct squat *squat, const char *path, double begin,
                                              struct arena *arena, struct error *error)
{
    const struct board_config *board = foot_board(squat->rig);
    const char *bus = board ? squat->rig->bus[board->bus].interface : "";
    uint32_t id = board ? icub_id(ICUB_PERIODIC_ANALOG, board->address, ICUB_FORCE) : 0;
    size_t most = squat->count * ROW_MS + 1;
    struct candump_reader reader;
    struct bus_frame frame;
    char name[16];
    bool end = false;
    enum error_code code;

    squat->board_time = arena_alloc(arena, most, sizeof(double));
    squat->board_force = arena_alloc(arena, most, sizeof(double));
    if (!board || !squat->board_time || !squat->board_force) {
        return error_set(error, board ? ERROR_MEMORY : ERROR_INPUT,
                         "%s: no force-torque board of the right foot", squat->rig->file);
    }
    code = candump_open(&reader, path, error);
    if (code) {
        return code;
    }

    /* The board sends the forces in one message, with z in bytes 4 and 5 */
    while (!code && !end && squat->nboard < most) {
        code = candump_next(&reader, &frame, name, &end, error);
        if (!code && !end && frame.id == id && frame.len >= ICUB_STRAIN_LENGTH &&
            !strcmp(name, bus)) {
            int raw = frame.data[4] | frame.data[5] << 8;

            squat->board_time[squat->nboard] = 1e-9 * (double)frame.time_ns - begin;
            squat->board_force[squat->nboard++] =
                (double)(raw - ICUB_STRAIN_ZERO) * board->full_scale[2] / ICUB_STRAIN_ZERO;
        }
    }
    candump_close(&reader);
    return code;
}

/* Computes the RMS difference of two series over the rows with from <= time < to. Skips rows where
 * one of the series is not finite. */
static double rms_error(const struct squat *squat, const double *a, const double *b, double from,
                        double to)
{
    double sum = 0.0;
    size_t n = 0;

    for (size_t i = 0; i < squat->count; i++) {
        if (squat->time[i] >= from && squat->time[i] < to && isfinite(a[i]) && isfinite(b[i])) {
            sum += (a[i] - b[i]) * (a[i] - b[i]);
            n++;
        }
    }
    return sqrt(sum / (double)n);
}

/* Adds Fig. 12: height of the waist, hip, foot and knee. */
static void squat_put_figure(struct report *report, const struct squat *squat)
{
    static const char time[] = "time since the first cycle began, s";
    const double *t = squat->time;
    const size_t n = squat->count;
    const struct svg_series hip[] = {svg_line("simulated", t, squat->hip, n, SVG_LINE),
                                     svg_line("reference", t, squat->reference, n, SVG_DASHED)};
    const struct svg_series knee[] = {svg_line("right knee", t, squat->knee, n, SVG_LINE)};
    const struct svg_series foot[] = {
        svg_line("F/T board, as sent on the bus", squat->board_time, squat->board_force,
                 squat->nboard, SVG_LINE),
        svg_line("ground on the foot", t, squat->value[FOOT_RIGHT], n, SVG_DASHED)};
    const struct svg_series height[] = {svg_line("waist", t, squat->height, n, SVG_LINE)};
    const struct svg_plot panels[] = {
        svg_panel("Height of the waist", time, "height, m", height, 1),
        svg_panel("Hip pitch, right", time, "angle, rad", hip, 2),
        svg_panel("Right foot, vertical force", time, "vertical force, N", foot, 2),
        svg_panel("Knee torque", time, "torque that straightens the knee, N m", knee, 1),
    };

    report_figure(
        report, "figure-12",
        "Paper: photograph; hip tracking; vertical force of the foot's sensor; knee torque; "
        "simulated and measured on the robot. Here: the depth in place of the photograph, then "
        "the same three, simulated; the reference comes from the law of cosines, not from the "
        "controller. The measured curves are not published as numbers.",
        panels, 4);
}

/* Compares the squat with the paper, with the static torque and with Newton's law. */
static void squat_put_findings(struct report *report, const struct squat *squat)
{
    const struct squat_config *task = &squat->rig->squat;
    const struct robot *robot = squat->rig->robot;
    const double *t = squat->time, weight = -robot->total_mass * robot->gravity[2];
    size_t n = squat->count;
    const double end = task->period_s * task->cycles, last = t[n - 1] - 0.1;
    const struct paper_range knee = paper_over(t, squat->knee, n, 0.0, end);
    const struct paper_range feet = paper_over(t, squat->feet, n, 0.0, end);
    const struct paper_range board =
        paper_over(squat->board_time, squat->board_force, squat->nboard, end + 0.3, last);

    /* The motion */
    report_finding(report, true, "depth of the squat, mm|300|%.1f|",
                   1e3 * (paper_over(t, squat->height, n, -0.3, 0.0).mean -
                          paper_over(t, squat->height, n, 0.0, end).least));
    report_finding(report, false, "cycles of %g s|4|%d|%s", task->period_s, task->cycles,
                   task->cycles == 4 ? "" : "quick run");
    report_finding(report, true,
                   "hip, error against its reference, mrad RMS|\"properly tracks\"|%.1f|",
                   1e3 * rms_error(squat, squat->hip, squat->reference, 0.0, end));

    /* Torque and forces, compared with statics and Newton's law */
    report_finding(report, true,
                   "knee torque, N m|plotted only|%.1f to %.1f|Standing upright, and at the "
                   "bottom. It is what statics of the robot's masses ask for.",
                   knee.least, knee.most);
    report_finding(report, true,
                   "both feet, standing, N|plotted only|%.1f|The weight of %.1f kg is %.1f N.",
                   paper_over(t, squat->feet, n, -0.5, 0.0).mean, robot->total_mass, weight);
    report_finding(report, true,
                   "both feet less m (g + a) of the center of mass, N RMS|oscillates with the "
                   "center of mass's acceleration|%.2f|a: second differences of the recorded "
                   "motion; the feet's force moves between %.1f and %.1f N.",
                   rms_error(squat, squat->feet, squat->newton, 0.5, end), feet.least, feet.most);

    /* The force-torque sensor, and the start */
    report_finding(report, false,
                   "right foot's F/T board, standing, N|plotted only|%.1f|The ground pushes with "
                   "%.1f N; the sensor does not feel the %.2f kg below it.",
                   board.mean, paper_over(t, squat->value[FOOT_RIGHT], n, end + 0.3, last).mean,
                   robot->ft[foot_board(squat->rig)->ft].distal.mass);
    report_finding(report, false,
                   "relaxation at the start|fast, damped, in the first second|%.1f N above the "
                   "weight at most|The contacts relax, then the robot sways on its springs. run "
                   "--settle starts without.",
                   paper_over(t, squat->feet, n, t[0], 0.0).most - weight);
    report_compared(report);
}

/* Derives all series from a recorded run, and adds the figure and the findings. */
static enum error_code squat_put_section(struct paper *paper, struct paper_run *run,
                                         struct error *error)
{
    const struct squat_config *task = &run->rig.squat;
    struct squat squat = {.rig = &run->rig,
                          .count = run->signals.count,
                          .time = run->signals.value[0],
                          .value = run->signals.value};
    /* Compute the start of the first cycle backwards from the end of the run */
    double begin = run->seconds - STAND_S - task->period_s * task->cycles;
    char path[PATH_MAX];
    struct arena arena;
    enum error_code code = arena_init(&arena, (size_t)64 << 20, error);

    if (code) {
        return code;
    }
    for (size_t i = 0; i < squat.count; i++) {
        squat.time[i] -= begin;
    }
    paper_recorded_path(paper, "candump.log", path);
    code = squat_read_force_board(&squat, path, begin, &arena, error);
    if (!code && !squat_derive_series(&squat, &arena)) {
        code = error_set(error, ERROR_MEMORY, "no memory for the squat's figures");
    }
    if (!code) {
        squat_put_figure(&paper->report, &squat);
        squat_put_findings(&paper->report, &squat);
    }
    arena_fini(&arena);
    return code;
}

enum error_code paper_squat(struct paper *paper, struct error *error)
{
    const struct paper_order order = {.rig = "walkman",
                                      .task = "squat",
                                      .clock = LOOP_CLOCK_LOCKSTEP,
                                      .titles = "torque_RKneeSag_nm|fz_RFoot_n|fz_LFoot_n|base_x_m|"
                                                "base_y_m|base_z_m|base_qw|base_qx|base_qy|base_qz",
                                      .joints = true,
                                      .row_ms = ROW_MS,
                                      .one_cycle = paper->quick};
    struct paper_run run;
    enum error_code code;

    report_section(&paper->report, "squat", "Fig. 12: WALK-MAN squats");
    report_text(
        &paper->report,
        "coman-hil run config/rigs/walkman.yaml --task squat: the controller that squats COMAN "
        "squats WALK-MAN, 24 motors and four F/T boards on five CAN buses, in lockstep, implicit "
        "steps of 1 ms. The real robot's boards speak EtherCAT; CAN stands in for it.");
    paper_progress(paper, "WALK-MAN squats");
    code = paper_run(paper, &order, &run, error);
    if (!code) {
        code = squat_put_section(paper, &run, error);
    }
    paper_run_end(paper, &run);
    return code;
}
