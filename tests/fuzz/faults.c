/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Lines of faults, one fault a line: each is refused in a sentence or reads the same again and has
 * its values in range; those that were taken run for a while, and sensors that are broken in any of
 * these ways never show the boards what is no number.
 */
#include "faults/faults.h"

#include "boards/sensing/sensing.h"
#include "tests/fuzz/fuzz.h"
#include "tests/unit/faults/names.h"

#include <math.h>
#include <string.h>

enum { JOINTS = 4, FTS = 2, LINES = 16, TICKS = 60, LINE = 400 };

static void check_fault(const struct fault *fault)
{
    static const size_t most[] = {
        [FAULT_SENSOR] =
            JOINTS * SENSOR_JOINT_CHANNELS + FTS * SENSOR_FT_CHANNELS + SENSOR_IMU_CHANNELS,
        [FAULT_BOARD] = 2,
        [FAULT_MOTOR] = JOINTS,
        [FAULT_BUS] = 2,
        [FAULT_SUPPLY] = 1,
        [FAULT_VALVE] = JOINTS,
        [FAULT_HYDRAULIC_SUPPLY] = 1,
    };
    struct fault again;
    struct error error;

    fuzz_require(fault->target <= FAULT_HYDRAULIC_SUPPLY && fault->kind <= FAULT_RELIEF_SHUT, "%s",
                 fault->text);
    fuzz_require(fault->index + (fault->target == FAULT_SENSOR ? fault->channels : 1) <=
                     most[fault->target],
                 "%s: index %zu", fault->text, fault->index);
    fuzz_require(
        fault->from_ns >= 0 && (fault->to_ns > fault->from_ns || fault->from_ns == INT64_MAX),
        "%s: from %lld to %lld", fault->text, (long long)fault->from_ns, (long long)fault->to_ns);
    for (int i = 0; i < FAULT_PARAMETERS; i++) {
        fuzz_require(isfinite(fault->value[i]), "%s: %g", fault->text, fault->value[i]);
    }
    fuzz_require(memchr(fault->name, '\0', sizeof fault->name) &&
                     memchr(fault->text, '\0', sizeof fault->text) && !fault->active,
                 "no end");
    fuzz_require(fault_parse(fault->text, &names, &again, &error) == ERROR_NONE, "%s: %s",
                 fault->text, error.text);
    fuzz_require(memcmp(fault, &again, sizeof again) == 0, "%s", fault->text);
}

/* Whether the line is a fault. */
static bool read_line(const char *line, struct fault *fault)
{
    struct error error = {0};

    if (fault_parse(line, &names, fault, &error)) {
        fuzz_require(fuzz_is_sentence(error.text) && error.code != ERROR_NONE, "%s", error.text);
        fuzz_tally.refused++;
        return false;
    }
    check_fault(fault);
    fuzz_tally.taken++;
    return true;
}

static void check_sensors(const struct plant_sensors *shown)
{
    for (size_t j = 0; j < JOINTS; j++) {
        const struct motor_sense *s = &shown->motor[j];

        fuzz_require(isfinite(s->q) && isfinite(s->qd) && isfinite(s->qm) && isfinite(s->qmd) &&
                         isfinite(s->current_a) && isfinite(s->torque_nm) && isfinite(s->winding_c),
                     "%g %g %g %g %g %g %g", s->q, s->qd, s->qm, s->qmd, s->current_a, s->torque_nm,
                     s->winding_c);
    }
    for (size_t f = 0; f < FTS; f++) {
        for (int i = 0; i < 3; i++) {
            fuzz_require(isfinite(shown->ft[f].force_n[i]) && isfinite(shown->ft[f].torque_nm[i]),
                         "%g N, %g Nm", shown->ft[f].force_n[i], shown->ft[f].torque_nm[i]);
            fuzz_require(isfinite(shown->imu.gyro_rad_s[i]) && isfinite(shown->imu.accel_m_s2[i]),
                         "%g rad/s", shown->imu.gyro_rad_s[i]);
        }
    }
}

static void move(struct plant_sensors *truth, int tick)
{
    truth->time_ns = tick * INT64_C(50000000);
    truth->supply_v = 48.0;
    for (size_t j = 0; j < JOINTS; j++) {
        const double x = sin(0.1 * tick + (double)j);

        truth->motor[j] = (struct motor_sense){
            .q = x, .qd = x, .qm = x, .qmd = x, .current_a = 10.0 * x, .torque_nm = 30.0 * x};
    }
    for (size_t f = 0; f < FTS; f++) {
        for (int i = 0; i < 3; i++) {
            truth->ft[f].force_n[i] = 100.0 * i;
            truth->ft[f].torque_nm[i] = -10.0 * tick;
        }
    }
}

static void show_events(struct faults *faults, size_t count)
{
    struct fault_event event;
    char text[256];

    while (faults_next_event(faults, &event)) {
        fuzz_require(event.fault < count, "fault %zu", event.fault);
        fault_event_format(faults, &event, text, sizeof text);
        fuzz_require(fuzz_is_sentence(text), "%s", text);
    }
}

/* Sensors with every imperfection that there is. */
static void make_real(struct sensing_config *config)
{
    static const struct sensor_error error = {.gain_error = 0.01,
                                              .offset = 0.1,
                                              .noise_rms = 0.01,
                                              .drift_per_sqrt_s = 0.01,
                                              .ramp_per_s = 0.01,
                                              .full_scale = 50.0,
                                              .lsb = 0.001,
                                              .latency_ns = 120000000};
    static struct sensor_joint joint[JOINTS];
    static struct sensor_ft ft[FTS];

    for (size_t j = 0; j < JOINTS; j++) {
        joint[j] = (struct sensor_joint){.name = joints[j],
                                         .link_encoder = error,
                                         .motor_encoder = error,
                                         .current = error,
                                         .torque = error,
                                         .temperature = error,
                                         .incremental = true,
                                         .thermal = {20.0, 0.7, 2.0, 60.0}};
    }
    for (size_t f = 0; f < FTS; f++) {
        ft[f] =
            (struct sensor_ft){.name = fts[f], .force = error, .torque = error, .crosstalk = 0.02};
    }
    config->joint = joint;
    config->ft = ft;
    config->imu.gyro = config->imu.accel = error;
}

static void live_with(const struct fault *fault, size_t count, bool real)
{
    static struct motor_sense motor[JOINTS];
    static struct ft_sense ft[FTS];
    struct plant_sensors truth = {.njoint = JOINTS, .nft = FTS, .motor = motor, .ft = ft};
    struct sensing_config config = {.njoint = JOINTS, .nft = FTS, .tick_ns = 50000000, .seed = 1};
    struct arena *arena = fuzz_arena((size_t)16 << 20);
    struct faults *faults;
    struct sensing *sensing;
    struct error error = {0};

    if (faults_create(fault, count, 1, arena, &faults, &error)) {
        fuzz_require(error.code == ERROR_INPUT && fuzz_is_sentence(error.text), "%s", error.text);
        return; /* two of one name */
    }
    config.faults = faults;
    if (real) {
        make_real(&config);
    }
    fuzz_require(sensing_create(&config, arena, &sensing, &error) == ERROR_NONE, "%s", error.text);
    for (size_t i = 0; i < count; i++) {
        fuzz_require(faults_find(faults, faults_at(faults, i)->name) == (int)i, "%s",
                     faults_at(faults, i)->name);
    }
    for (int tick = 0; tick < TICKS; tick++) {
        const int64_t now_ns = tick * INT64_C(50000000);

        faults_step(faults, now_ns);
        if (tick % 7 == 0 && count) {
            faults_set(faults, now_ns, (size_t)tick % count, tick % 2);
        }
        move(&truth, tick);
        if (tick == 30) {
            sensing_restart_counter(sensing, 1);
        }
        check_sensors(sensing_sample(sensing, now_ns, &truth));
        show_events(faults, count);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const char *at = (const char *)data, *end = at + size;
    struct fault fault[LINES];
    char line[LINE];
    size_t count = 0;

    while (at < end && count < LINES) {
        const char *newline = memchr(at, '\n', (size_t)(end - at));
        const size_t length = (size_t)((newline ? newline : end) - at);

        snprintf(line, sizeof line, "%.*s", (int)length, at);
        count += read_line(line, &fault[count]);
        at += length + 1;
    }
    live_with(fault, count, size & 1);
    return 0;
}
