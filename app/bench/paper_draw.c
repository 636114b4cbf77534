/* SPDX-License-Identifier: Apache-2.0 */
/* Records runs of the manipulation task, and draws the robot from them. */
#include "app/bench/paper_grasp.h"
#include "model/spatial.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MOMENTS = 3, POINTS_MAX = 512, VIEWS = 2 };

enum error_code paper_grasp_run(const struct paper *paper, const char *rig, struct paper_run *run,
                                struct grasp_result *result, struct error *error)
{
    static const char *const title[GRASP_SIGNALS - 1] = {"q_RShSag_rad",
                                                         "q_RShLat_rad",
                                                         "q_RShYaw_rad",
                                                         "q_RElbj_rad",
                                                         "qm_RElbj_rad",
                                                         "fz_box_n",
                                                         "fy_right_wrist_on_box_n",
                                                         "fy_left_wrist_on_box_n",
                                                         "fz_right_wrist_on_box_n",
                                                         "fz_left_wrist_on_box_n",
                                                         "fz_ground_on_right_foot_n",
                                                         "fz_ground_on_left_foot_n",
                                                         "my_right_wrist_on_box_nm",
                                                         "my_left_wrist_on_box_nm",
                                                         "box_x_m",
                                                         "box_y_m",
                                                         "box_z_m",
                                                         "base_x_m",
                                                         "base_y_m",
                                                         "base_z_m",
                                                         "base_qw",
                                                         "base_qx",
                                                         "base_qy",
                                                         "base_qz"};
    const struct paper_order order = {.rig = rig,
                                      .task = "grasp",
                                      .clock = LOOP_CLOCK_LOCKSTEP,
                                      .title = title,
                                      .ntitle = GRASP_SIGNALS - 1,
                                      .joints = true,
                                      .row_ms = 2};
    enum error_code code = paper_run(paper, &order, run, error);
    const struct grasp_config *grasp = &run->rig.grasp;
    double begin;

    if (code) {
        return code;
    }

    /* The arms began to move when the path and the hold after it were still to come */
    begin = run->seconds - grasp->hold_s - grasp->phase[grasp->nphase - 1].until_s;
    *result = (struct grasp_result){.rig = &run->rig,
                                    .count = run->signals.count,
                                    .time = run->signals.value[0],
                                    .value = run->signals.value,
                                    .touch = NAN,
                                    .box_kg = run->rig.free[0].inertia.mass,
                                    .rest_height = run->rig.free[0].position[2],
                                    .gravity = -run->rig.robot->gravity[2]};

    /* Count times from there, make pressing positive on both sides, and find the first touch */
    for (size_t i = 0; i < result->count; i++) {
        result->time[i] -= begin;
        result->value[PRESS_LEFT][i] = -result->value[PRESS_LEFT][i];
        if (isnan(result->touch) && result->value[PRESS_RIGHT][i] > 0.0) {
            result->touch = result->time[i];
        }
    }
    return ERROR_NONE;
}

/* ---- drawings ---- */

/* A line from point to point, with breaks, in both views: from the right side x and z, from the
 * front y and z. */
struct drawing {
    double across[VIEWS][POINTS_MAX], up[POINTS_MAX];
    size_t count;
};

/* Adds a point, m, to both views; NULL breaks the line. */
static void put_point(struct drawing *drawing, const double point[3])
{
    if (drawing->count < POINTS_MAX) {
        drawing->across[0][drawing->count] = point ? point[0] : (double)NAN;
        drawing->across[1][drawing->count] = point ? point[1] : (double)NAN;
        drawing->up[drawing->count++] = point ? point[2] : (double)NAN;
    }
}

/* Adds a line between two points. */
static void put_segment(struct drawing *drawing, const double from[3], const double to[3])
{
    put_point(drawing, from);
    put_point(drawing, to);
    put_point(drawing, NULL);
}

/* Adds the outline of an upright box, as seen from the side and from the front. */
static void put_box(struct drawing *drawing, const double middle[3], const double half[3])
{
    static const double corner[5][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}, {-1, -1}};

    for (size_t i = 0; i < 5; i++) {
        const double point[3] = {middle[0] + corner[i][0] * half[0],
                                 middle[1] + corner[i][0] * half[1],
                                 middle[2] + corner[i][1] * half[2]};

        put_point(drawing, point);
    }
    put_point(drawing, NULL);
}

/* Adds the spheres of the wrists, as lines from the body's origin to them. */
static void draw_wrists(struct drawing *drawing, const struct rig *rig, double (*place)[3],
                        double (*turn)[9])
{
    for (size_t i = 0; i < rig->contact.nsurface; i++) {
        const struct contact_surface *surface = &rig->contact.surface[i];
        int body = surface->body < 0 ? -1 : rig->contact_body[surface->body];
        double offset[3], end[3];

        if (body < 0 || (size_t)body >= rig->robot->nbody || surface->shape != CONTACT_SPHERE) {
            continue;
        }
        mat3_apply(turn[body], surface->position, offset);
        for (int k = 0; k < 3; k++) {
            end[k] = place[body][k] + offset[k];
        }
        put_segment(drawing, place[body], end);
    }
}

/* Adds the outlines of the soles. */
static void draw_feet(struct drawing *drawing, const struct rig *rig, double (*place)[3],
                      double (*turn)[9])
{
    for (size_t i = 0; i < rig->contact.nsurface; i++) {
        const struct contact_surface *surface = &rig->contact.surface[i];
        int body = surface->body < 0 ? -1 : rig->contact_body[surface->body];
        double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
        double middle[3], half[3];

        if (body < 0 || (size_t)body >= rig->robot->nbody || surface->shape != CONTACT_MESH) {
            continue;
        }

        /* The box around the vertices in the world */
        for (size_t v = 0; v < surface->mesh->nvertex; v++) {
            double local[3], world[3];

            mat3_apply(surface->rotation, surface->mesh->vertex[v], local);
            for (int k = 0; k < 3; k++) {
                local[k] += surface->position[k];
            }
            mat3_apply(turn[body], local, world);
            for (int k = 0; k < 3; k++) {
                low[k] = fmin(low[k], place[body][k] + world[k]);
                high[k] = fmax(high[k], place[body][k] + world[k]);
            }
        }
        for (int k = 0; k < 3; k++) {
            middle[k] = 0.5 * (low[k] + high[k]);
            half[k] = 0.5 * (high[k] - low[k]);
        }
        put_box(drawing, middle, half);
    }
}

/* Draws the robot in a row of the recording: lines between joints, wrists, feet, and the box. */
static void draw_robot(struct drawing *drawing, const struct grasp_result *result, size_t row)
{
    const struct robot *robot = result->rig->robot;
    double place[SIGNALS_MAX][3], turn[SIGNALS_MAX][9], q[SIGNALS_MAX], base[7], box[3];
    static const double half[3] = {0.075, 0.075, 0.075};

    for (int k = 0; k < 7; k++) {
        base[k] = result->value[BASE + k][row];
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        q[j] = result->value[GRASP_SIGNALS + j][row];
    }
    paper_place_bodies(robot, base, q, place, turn);
    for (size_t b = 1; b < robot->nbody; b++) {
        put_segment(drawing, place[robot->body[b].parent], place[b]);
    }
    draw_wrists(drawing, result->rig, place, turn);
    draw_feet(drawing, result->rig, place, turn);
    for (int k = 0; k < 3; k++) {
        box[k] = result->value[BOX_X + k][row];
    }
    put_box(drawing, box, half);
}

/* Draws the boxes that stand in the world: the table. */
static void draw_table(struct drawing *drawing, const struct rig *rig)
{
    for (size_t i = 0; i < rig->contact.nsurface; i++) {
        const struct contact_surface *surface = &rig->contact.surface[i];

        if (surface->body < 0 && surface->shape == CONTACT_BOX) {
            put_box(drawing, surface->position, surface->half_extent_m);
        }
    }
}

/* Returns the first row at a time or after it; the last one when there is none. */
static size_t row_at(const struct grasp_result *result, double time)
{
    size_t row = 0;

    while (row + 1 < result->count && result->time[row] < time) {
        row++;
    }
    return row;
}

void paper_draw_grasp(struct report *report, const struct grasp_result *result)
{
    static const char *const views[VIEWS] = {"From the right", "From the front"};
    static const char *const across[VIEWS] = {"x, m", "y, m"};
    static const char *const names[MOMENTS + 1] = {"at the start", "wrists touch", "box held",
                                                   "table"};
    struct drawing *drawing = calloc(MOMENTS + 1, sizeof *drawing);
    struct svg_series series[VIEWS][MOMENTS + 1];
    struct svg_plot panel[VIEWS];

    report_section(report, "scene", "Fig. 8: COMAN takes a box from a table");
    if (!drawing) {
        return;
    }

    /* Draw three moments, and the table that is in all of them */
    draw_robot(&drawing[0], result, 0);
    draw_robot(&drawing[1], result, row_at(result, result->touch));
    draw_robot(&drawing[2], result, result->count - 1);
    draw_table(&drawing[3], result->rig);

    /* A panel for each view */
    for (size_t v = 0; v < VIEWS; v++) {
        for (size_t i = 0; i <= MOMENTS; i++) {
            series[v][i] = (struct svg_series){.name = names[i],
                                               .x = drawing[i].across[v],
                                               .y = drawing[i].up,
                                               .count = drawing[i].count,
                                               .style = i == 0 ? SVG_DASHED : SVG_LINE};
        }
        /* The same scale on both axes: 404 x 520 px of drawing area for 0.8 m x 1.03 m */
        panel[v] =
            (struct svg_plot){.title = views[v],
                              .x = {.label = across[v],
                                    .fixed = true,
                                    .min = v ? -0.40 : -0.35,
                                    .max = v ? 0.40 : 0.45},
                              .y = {.label = "z, m", .fixed = true, .min = -0.03, .max = 1.0},
                              .series = series[v],
                              .nseries = MOMENTS + 1,
                              .width = 520,
                              .height = 648};
    }
    report_figure(
        report, "figure-8",
        "Paper: pictures of the task, and of COMAN walking over a bump. Here: the robot as the "
        "lines between its joints, its soles and the box, at three moments of the run. The "
        "walk is not reproduced: its controller is another paper's.",
        panel, VIEWS);
    free(drawing);
}
