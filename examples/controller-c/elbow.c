/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A controller in C: turns motors by half a radian in a second, in lockstep with a simulator, and
 * says what they do. `make` builds it with the installed library, `make COPY=FOLDER` with a copy of
 * the library's two files.
 *
 *     elbow READY [JOINT...]
 *
 * READY: the file that `coman-hil run RIG --transport local --clock lockstep --gateway 0 --ready
 * READY` writes. With RIG.joints of `coman-hil dbc RIG -o FOLDER` instead, the buses are the rig's
 * SocketCAN interfaces. JOINT: LElbj unless others are named.
 */
#include <coman_hil_client.h>

#include <stdio.h>
#include <string.h>

enum { JOINTS_MAX = 16, TICKS = 1500, RAMP_TICKS = 1000, PERIOD = 4 };

/* One joint: where it has begun, and where it is to go. */
struct task {
    const char *name;
    int joint;
    double start_rad;
};

/* The angle of the motor, which every board reports. */
static double motor_position(const struct hil_client *client, int joint)
{
    struct hil_client_joint state;

    hil_client_read(client, joint, &state);
    return state.motor_position_rad;
}

/* Switches the motors on. */
static enum hil_client_code begin(struct hil_client *client, struct task *tasks, size_t count)
{
    const char *names[JOINTS_MAX];

    for (size_t i = 0; i < count; i++) {
        names[i] = tasks[i].name;
    }

    const enum hil_client_code code = hil_client_enable(client, names, count, HIL_CLIENT_VOLTAGE);

    for (size_t i = 0; i < count && !code; i++) {
        tasks[i].joint = hil_client_find_joint(client, tasks[i].name);
        tasks[i].start_rad = motor_position(client, tasks[i].joint);
    }
    return code;
}

/* Fails when the board of a motor has switched it off, which is no error of a step. */
static enum hil_client_code check(struct hil_client *client)
{
    const int tripped = hil_client_find_tripped(client, 0);
    struct hil_client_joint state;

    if (tripped < 0) {
        return HIL_CLIENT_OK;
    }
    hil_client_read(client, tripped, &state);
    snprintf(client->message, sizeof client->message, "%s has tripped: mode %s, faults 0x%x",
             hil_client_joint_name(client, tripped), state.mode, (unsigned)state.faults);
    return HIL_CLIENT_BOARD;
}

/* Computes the voltages of a period, for an angle that rises for a second, and lets it pass. */
static enum hil_client_code advance(struct hil_client *client, const struct task *tasks,
                                    size_t count, int tick)
{
    const double way = tick < RAMP_TICKS ? (double)tick / RAMP_TICKS : 1.0;

    for (size_t i = 0; i < count; i++) {
        const double target_rad = tasks[i].start_rad + 0.5 * way;
        const double volts = 40.0 * (target_rad - motor_position(client, tasks[i].joint));

        hil_client_command(client, tasks[i].joint, HIL_CLIENT_VOLTAGE, volts);
    }

    const enum hil_client_code code = hil_client_step(client, PERIOD);

    return code ? code : check(client);
}

static void report(const struct hil_client *client, const struct task *tasks, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        struct hil_client_joint state;

        hil_client_read(client, tasks[i].joint, &state);
        printf("tick %5lld  %s  %+.4f rad  %+.3f A  %+.2f N m  %s\n", (long long)client->tick,
               tasks[i].name, state.motor_position_rad - tasks[i].start_rad, state.current_a,
               state.torque_nm, state.mode);
    }
}

int main(int argc, char **argv)
{
    struct task tasks[JOINTS_MAX] = {{.name = "LElbj"}};
    size_t count = 1;
    struct hil_client client;
    enum hil_client_code code;

    if (argc < 2 || argc > 2 + JOINTS_MAX) {
        fprintf(stderr, "usage: elbow READY [JOINT...]\n");
        return 2;
    }
    for (int i = 2; i < argc; i++) {
        tasks[i - 2].name = argv[i];
        count = (size_t)i - 1;
    }

    const bool is_table = strstr(argv[1], ".joints");
    const struct hil_client_options options = {
        .table = argv[1], .ready = is_table ? NULL : argv[1], .lockstep = true};

    code = hil_client_open(&client, &options);
    code = code ? code : begin(&client, tasks, count);
    for (int tick = 0; tick < TICKS && !code; tick += PERIOD) {
        if (tick % 300 == 0) {
            report(&client, tasks, count);
        }
        code = advance(&client, tasks, count, tick);
    }
    if (code) {
        fprintf(stderr, "elbow: %s\n", client.message);
    } else {
        report(&client, tasks, count);
    }
    hil_client_close(&client);
    return code != HIL_CLIENT_OK;
}
