/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The program under test: bends the left elbow by half a radian in half a second and holds it. When
 * the elbow stands still under a large current for 50 ms, the program switches the motor off.
 *
 * `coman-hil test --program` sets COMAN_HIL_GATEWAY to HOST:PORT of the simulator and ends the
 * program with the run.
 */
#include <coman_hil_client.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PERIOD_TICKS = 4, JAM_TICKS = 48 };

static const double BEND_RAD = -0.5, SPEED_RAD_S = -1.0;
static const double STIFFNESS_V_PER_RAD = 40.0, DAMPING_V_S_PER_RAD = 0.5;
static const double TICK_S = 1e-3, JAM_CURRENT_A = 2.0, JAM_MOTION_RAD = 1e-3;

/* Returns the code of the first call that failed; HIL_CLIENT_OK after a jam was found. */
static enum hil_client_code control(struct hil_client *client)
{
    const char *name = "LElbj";
    const enum hil_client_code enabled = hil_client_enable(client, &name, 1, HIL_CLIENT_VOLTAGE);
    const int joint = hil_client_find_joint(client, name);
    struct hil_client_joint elbow;

    if (enabled) {
        return enabled;
    }
    hil_client_read(client, joint, &elbow);

    const double start_rad = elbow.motor_position_rad;
    double last_rad = start_rad, way_rad = 0.0;
    int still_ticks = 0;

    while (still_ticks < JAM_TICKS) {
        hil_client_read(client, joint, &elbow);

        const double motion_rad = elbow.motor_position_rad - last_rad;
        const double speed_rad_s = motion_rad / (PERIOD_TICKS * TICK_S);
        const double error_rad = start_rad + way_rad - elbow.motor_position_rad;
        const double volts = STIFFNESS_V_PER_RAD * error_rad - DAMPING_V_S_PER_RAD * speed_rad_s;

        way_rad = fmax(BEND_RAD, way_rad + SPEED_RAD_S * PERIOD_TICKS * TICK_S);
        hil_client_command(client, joint, HIL_CLIENT_VOLTAGE, volts);
        still_ticks = fabs(elbow.current_a) > JAM_CURRENT_A && fabs(motion_rad) < JAM_MOTION_RAD
                          ? still_ticks + PERIOD_TICKS
                          : 0;
        last_rad = elbow.motor_position_rad;

        const enum hil_client_code code = hil_client_step(client, PERIOD_TICKS);

        if (code) {
            return code;
        }
    }
    printf("LElbj is jammed: the motor is switched off\n");
    return hil_client_enable(client, &name, 1, HIL_CLIENT_OFF);
}

int main(void)
{
    const char *gateway = getenv("COMAN_HIL_GATEWAY");
    const char *port = gateway ? strrchr(gateway, ':') : NULL;

    if (!port) {
        fprintf(stderr, "usage: COMAN_HIL_GATEWAY=127.0.0.1:PORT controller\n");
        return 2;
    }

    const struct hil_client_options options = {.port = (uint16_t)atoi(port + 1), .lockstep = true};
    struct hil_client client;
    enum hil_client_code code = hil_client_open(&client, &options);

    code = code ? code : control(&client);
    while (!code) { /* the robot goes on without a motor */
        code = hil_client_step(&client, PERIOD_TICKS);
    }
    fprintf(stderr, "controller: %s\n", client.message);
    hil_client_close(&client);
    return code != HIL_CLIENT_OK;
}
