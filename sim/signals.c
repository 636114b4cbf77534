/* SPDX-License-Identifier: Apache-2.0 */
/* Lists the signals of a run and gathers their values, for signals.csv and for subscribers. */
#include "sim/simulator_private.h"

#include "base/array.h"

enum {
    SIGNALS_PER_JOINT = 5,
    SIGNALS_PER_CONTACT = 13,
    SIGNALS_PER_PAIR = 6,
    SIGNALS_BASE = 7,
    SIGNALS_PER_FREE = 7,
    SIGNALS_SENSED_JOINT = 4,
    SIGNALS_HYDRAULIC_JOINT = 3,
    SIGNALS_PER_FT = 6,
    SIGNALS_PER_IMU = 13,
    SIGNALS_PER_BUS = 2
};
enum { TITLE_SIZE = 192 };
enum { STREAM_ROWS = 1024 }; /* rows of a stream: one second at 1 kHz */

/* ---- rows ---- */

/* Writes force/torque and inertial sensors, true or measured; returns the address after the last
 * value. */
static double *signals_fill_sensors(const struct robot *robot, const struct plant_sensors *sensors,
                                    double *to)
{
    const struct imu_sense *imu = &sensors->imu;

    for (size_t f = 0; f < robot->nft; f++) {
        memcpy(to, sensors->ft[f].force_n, sizeof sensors->ft[f].force_n);
        memcpy(to + 3, sensors->ft[f].torque_nm, sizeof sensors->ft[f].torque_nm);
        to += SIGNALS_PER_FT;
    }
    if (robot->imu_frame >= 0) {
        memcpy(to, imu->gyro_rad_s, sizeof imu->gyro_rad_s);
        memcpy(to + 3, imu->accel_m_s2, sizeof imu->accel_m_s2);
        memcpy(to + 6, imu->magnetic_t, sizeof imu->magnetic_t);
        memcpy(to + 9, imu->quaternion, sizeof imu->quaternion);
        to += SIGNALS_PER_IMU;
    }
    return to;
}

/* Writes pressures (Pa) and valve openings of hydraulic joints, and the pressure of their
 * supply. */
static double *signals_fill_hydraulics(const struct simulator *simulator, double *to)
{
    const struct robot *robot = simulator->config.rig->robot;
    const struct plant_sensors *sensors = plant_sensors(simulator->plant);

    if (robot->hydraulic_supply.pressure == 0.0) {
        return to;
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        if (robot->joint[j].hydraulic.present) {
            *to++ = sensors->motor[j].pressure_pa[0];
            *to++ = sensors->motor[j].pressure_pa[1];
            *to++ = sensors->motor[j].valve_opening;
        }
    }
    *to++ = sensors->oil_pa;
    return to;
}

size_t simulator_contact_column(const struct simulator *simulator, size_t contact)
{
    return simulator->config.rig->robot->njoint * SIGNALS_PER_JOINT + contact * SIGNALS_PER_CONTACT;
}

/* Writes the columns in the order of signals_make_titles; returns the address after the last
 * value. */
double *simulator_fill_signals(const struct simulator *simulator, double *to)
{
    const struct rig *rig = simulator->config.rig;
    const struct plant_sensors *sensors = plant_sensors(simulator->plant);
    const struct contact_wrench *wrench = plant_contact_wrenches(simulator->plant);

    /* Joints */
    for (size_t j = 0; j < rig->robot->njoint; j++) {
        const struct motor_sense *motor = &sensors->motor[j];

        *to++ = motor->q;
        *to++ = motor->qm;
        *to++ = motor->torque_nm;
        *to++ = motor->current_a;
        *to++ = motor->voltage_v;
    }

    /* Contact, by body and by pair */
    for (size_t c = 0; c < rig->contact.nbody; c++) {
        struct contact_wrench mean;

        plant_contact_mean(simulator->plant, c, &mean);
        memcpy(to, wrench[c].force, sizeof wrench[c].force);
        memcpy(to + 3, wrench[c].moment, sizeof wrench[c].moment);
        to[6] = plant_contact_peaks(simulator->plant)[c];
        memcpy(to + 7, mean.force, sizeof mean.force);
        memcpy(to + 10, mean.moment, sizeof mean.moment);
        to += SIGNALS_PER_CONTACT;
    }

    /* Writes force and moment of each listed pair of surfaces on its second surface; the moment is
     * about the middle of the patch. The bodies' wrenches also include other pairs of the robot's
     * surfaces. */
    size_t npair = simulator->config.rig->nlisted_pair, count;

    memset(to, 0, npair * SIGNALS_PER_PAIR * sizeof *to);
    count = npair ? plant_patches(simulator->plant, simulator->patch, simulator->npatch) : 0;
    for (size_t i = 0; i < count && i < simulator->npatch; i++) {
        const struct contact_patch *patch = &simulator->patch[i];
        double *row = to + (size_t)patch->pair * SIGNALS_PER_PAIR;

        for (int k = 0; k < 3 && (size_t)patch->pair < npair; k++) {
            row[k] += patch->force[k];
            row[3 + k] += patch->moment[k];
        }
    }
    to += rig->nlisted_pair * SIGNALS_PER_PAIR;

    /* Poses of the base and of free bodies */
    if (rig->robot->floating) {
        memcpy(to, simulator->status.base, sizeof simulator->status.base);
        to += SIGNALS_BASE;
    }
    for (size_t i = 0; i < rig->nfree; i++) {
        plant_free_pose(simulator->plant, i, to);
        to += SIGNALS_PER_FREE;
    }

    /* Writes the true values of the robot's sensors outside the joints, then all measured values of
     * the boards */
    const struct robot *robot = simulator->config.rig->robot;
    const struct plant_sensors *seen = simulator->measured;

    to = signals_fill_sensors(robot, plant_sensors(simulator->plant), to);
    for (size_t j = 0; j < robot->njoint; j++) {
        *to++ = seen->motor[j].q;
        *to++ = seen->motor[j].qm;
        *to++ = seen->motor[j].torque_nm;
        *to++ = seen->motor[j].current_a;
    }
    to = signals_fill_sensors(robot, seen, to);
    to = signals_fill_hydraulics(simulator, to);

    /* Estimates and plans of an inline task; a task in its own thread is not read */
    if (simulator->task_inline) {
        task_read_signals(simulator->task->task, to);
        to += simulator->task->nsignal;
    }
    return to;
}

void simulator_fill_stream(const struct simulator *simulator, double *to)
{
    const struct simulator_status *status = &simulator->status;

    to = simulator_fill_signals(simulator, to);
    for (size_t b = 0; b < simulator->config.rig->nbus; b++) {
        *to++ = (double)status->bus[b].rx_frames;
        *to++ = (double)status->bus[b].tx_frames;
    }
}

/* Fills a row of each stream that is due; gathers the values once per tick for all readers. */
void simulator_stream_row(struct simulator *simulator)
{
    const struct simulator_status *status = &simulator->status;
    struct stream *const stream[] = {simulator->stream, simulator->view_stream};
    const double *value = simulator_view_signals(simulator);

    for (size_t i = 0; i < ARRAY_COUNT(stream); i++) {
        double *to = stream[i] ? stream_begin(stream[i], status->tick, status->time_ns) : NULL;

        if (!to) {
            continue;
        }
        if (value) {
            memcpy(to, value, simulator->nsignal * sizeof *to);
        } else {
            simulator_fill_stream(simulator, to);
        }
        value = to;
        stream_commit(stream[i]);
    }
}

/* ---- titles ---- */

/* The list of titles under construction. */
struct title_list {
    struct arena *arena;
    const char **title;
    size_t count;
    bool good; /* false = no memory, or a name is too long */
};

/* Appends a title: the format with name instead of its '*'. */
static void title_add(struct title_list *list, const char *format, const char *name)
{
    char text[TITLE_SIZE];
    const char *hole = strchr(format, '*');
    int size =
        hole ? snprintf(text, sizeof text, "%.*s%s%s", (int)(hole - format), format, name, hole + 1)
             : snprintf(text, sizeof text, "%s", format);

    if (list->good) {
        list->title[list->count] = size < TITLE_SIZE ? arena_strdup(list->arena, text) : NULL;
        list->good = list->title[list->count++] != NULL;
    }
}

/* Appends the titles of one joint, body, pair or bus. */
static void title_add_group(struct title_list *list, const char *const *format, size_t count,
                            const char *name)
{
    for (size_t i = 0; i < count; i++) {
        title_add(list, format[i], name);
    }
}

/* Appends the titles of the robot's sensors outside the joints, true or measured. */
static void title_add_sensors(struct title_list *list, const struct robot *robot, bool sensed)
{
    static const char *const ft[][SIGNALS_PER_FT] = {
        {"ft_fx_*_n", "ft_fy_*_n", "ft_fz_*_n", "ft_tx_*_nm", "ft_ty_*_nm", "ft_tz_*_nm"},
        {"sensed_ft_fx_*_n", "sensed_ft_fy_*_n", "sensed_ft_fz_*_n", "sensed_ft_tx_*_nm",
         "sensed_ft_ty_*_nm", "sensed_ft_tz_*_nm"}};
    static const char *const imu[SIGNALS_PER_IMU] = {"*imu_gyro_x_rad_s",
                                                     "*imu_gyro_y_rad_s",
                                                     "*imu_gyro_z_rad_s",
                                                     "*imu_accel_x_m_s2",
                                                     "*imu_accel_y_m_s2",
                                                     "*imu_accel_z_m_s2",
                                                     "*imu_magnetic_x_t",
                                                     "*imu_magnetic_y_t",
                                                     "*imu_magnetic_z_t",
                                                     "*imu_qw",
                                                     "*imu_qx",
                                                     "*imu_qy",
                                                     "*imu_qz"};

    for (size_t f = 0; f < robot->nft; f++) {
        title_add_group(list, ft[sensed], SIGNALS_PER_FT, robot->ft[f].name);
    }
    if (robot->imu_frame >= 0) {
        title_add_group(list, imu, SIGNALS_PER_IMU, sensed ? "sensed_" : "");
    }
}

/* Appends the titles of hydraulic joints and of their supply. */
static void title_add_hydraulics(struct title_list *list, const struct robot *robot)
{
    static const char *const joint[SIGNALS_HYDRAULIC_JOINT] = {
        "piston_pressure_*_pa", "rod_pressure_*_pa", "valve_opening_*"};

    if (robot->hydraulic_supply.pressure == 0.0) {
        return;
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        if (robot->joint[j].hydraulic.present) {
            title_add_group(list, joint, SIGNALS_HYDRAULIC_JOINT, robot->joint[j].name);
        }
    }
    title_add(list, "hydraulic_supply_pa", "");
}

/* Appends the titles of the columns of signals.csv: joints, contact, poses, sensors. */
static void title_add_recorded(struct title_list *list, const struct rig *rig)
{
    static const char *const joint[SIGNALS_PER_JOINT] = {"q_*_rad", "qm_*_rad", "torque_*_nm",
                                                         "current_*_a", "voltage_*_v"};
    static const char *const wrench[SIGNALS_PER_CONTACT] = {
        "fx_*_n",       "fy_*_n",       "fz_*_n",      "mx_*_nm",     "my_*_nm",
        "mz_*_nm",      "peak_*_n",     "mean_fx_*_n", "mean_fy_*_n", "mean_fz_*_n",
        "mean_mx_*_nm", "mean_my_*_nm", "mean_mz_*_nm"};
    static const char *const base[SIGNALS_BASE] = {"base_x_m", "base_y_m", "base_z_m", "base_qw",
                                                   "base_qx",  "base_qy",  "base_qz"};
    static const char *const free_body[SIGNALS_PER_FREE] = {"*_x_m", "*_y_m", "*_z_m", "*_qw",
                                                            "*_qx",  "*_qy",  "*_qz"};

    /* The order is that of the row's values: joints, wrenches of bodies and of pairs, poses */
    for (size_t j = 0; j < rig->robot->njoint; j++) {
        title_add_group(list, joint, SIGNALS_PER_JOINT, rig->robot->joint[j].name);
    }
    for (size_t c = 0; c < rig->contact.nbody; c++) {
        title_add_group(list, wrench, SIGNALS_PER_CONTACT, rig_contact_name(rig, c));
    }
    for (size_t p = 0; p < rig->nlisted_pair; p++) {
        const struct contact_pair *of = &rig->contact.pair[p];
        char name[TITLE_SIZE];

        snprintf(name, sizeof name, "%.63s_on_%.63s", rig->contact.surface[of->a].name,
                 rig->contact.surface[of->b].name);
        title_add_group(list, wrench, SIGNALS_PER_PAIR, name);
    }
    if (rig->robot->floating) {
        title_add_group(list, base, SIGNALS_BASE, "");
    }
    for (size_t i = 0; i < rig->nfree; i++) {
        title_add_group(list, free_body, SIGNALS_PER_FREE, rig->free[i].name);
    }

    /* Append the titles of all sensors: true values of those outside the joints, then measured
     * values */
    static const char *const measured[SIGNALS_SENSED_JOINT] = {
        "sensed_q_*_rad", "sensed_qm_*_rad", "sensed_torque_*_nm", "sensed_current_*_a"};

    title_add_sensors(list, rig->robot, false);
    for (size_t j = 0; j < rig->robot->njoint; j++) {
        title_add_group(list, measured, SIGNALS_SENSED_JOINT, rig->robot->joint[j].name);
    }
    title_add_sensors(list, rig->robot, true);
    title_add_hydraulics(list, rig->robot);
}

/* Makes the titles of the columns of signals.csv, then of those only in the stream; returns false
 * without memory. */
static bool signals_make_titles(struct simulator *simulator)
{
    static const char *const bus[SIGNALS_PER_BUS] = {"rx_*_frames", "tx_*_frames"};
    const struct rig *rig = simulator->config.rig;
    size_t count = rig->robot->njoint * (SIGNALS_PER_JOINT + SIGNALS_SENSED_JOINT) +
                   rig->robot->njoint * SIGNALS_HYDRAULIC_JOINT + 1 +
                   2 * (rig->robot->nft * SIGNALS_PER_FT + SIGNALS_PER_IMU) +
                   rig->contact.nbody * SIGNALS_PER_CONTACT + rig->nlisted_pair * SIGNALS_PER_PAIR +
                   (rig->robot->floating ? SIGNALS_BASE : 0) + rig->nfree * SIGNALS_PER_FREE +
                   rig->nbus * SIGNALS_PER_BUS +
                   (simulator->task_inline ? simulator->task->nsignal : 0);
    struct title_list list = {.arena = simulator->arena};

    list.title = arena_alloc(simulator->arena, count + 1, sizeof *list.title);
    list.good = list.title != NULL;
    title_add_recorded(&list, rig);

    /* Appends the titles of a task that the loop steps */
    if (simulator->task_inline) {
        title_add_group(&list, simulator->task->signal_name, simulator->task->nsignal, "");
    }
    simulator->nrecorded = list.count;
    for (size_t b = 0; b < rig->nbus; b++) {
        title_add_group(&list, bus, SIGNALS_PER_BUS, rig->bus[b].name);
    }
    simulator->nsignal = list.count;
    simulator->title = list.title;
    return list.good;
}

enum error_code simulator_create_signals(struct simulator *simulator, struct error *error)
{
    /* Allocates two patches per pair, because an engine may split a patch */
    simulator->npatch = 2 * simulator->config.rig->contact.npair;
    simulator->patch =
        arena_alloc(simulator->arena, simulator->npatch + 1, sizeof *simulator->patch);
    if (!simulator->patch || !signals_make_titles(simulator)) {
        return error_set(error, ERROR_MEMORY, "no memory left for the signals");
    }
    if (simulator->config.guests && !simulator->config.guests_inline &&
        stream_create(simulator->nsignal, STREAM_ROWS, simulator->arena, &simulator->view_stream,
                      error)) {
        return error->code;
    }
    return simulator->config.requests ? stream_create(simulator->nsignal, STREAM_ROWS,
                                                      simulator->arena, &simulator->stream, error)
                                      : ERROR_NONE;
}
