/* SPDX-License-Identifier: Apache-2.0 */
/* Drives a joint by name with each kind of set point that its board takes, without any table of
 * the client's own, and prints what the joint reports. client.py judges.
 *
 * client_joints READY JOINT [BUS,MESSAGE,SIGNAL,VALUE] QUANTITY=VALUE... */
#include "coman_hil_client.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const words[] = {"off", "voltage", "current", "position", "velocity", "torque"};

/* Prints what a joint reports, after a word. */
static void print_joint(const struct hil_client *client, int joint, const char *word)
{
    struct hil_client_joint state;

    hil_client_read(client, joint, &state);
    printf("%s %lld %.9g %.9g %.9g %.9g %.9g %u %d %s\n", word, (long long)client->tick,
           state.position_rad, state.motor_position_rad, state.motor_velocity_rad_s,
           state.current_a, state.torque_nm, (unsigned)state.faults, state.is_on, state.mode);
}

int main(int argc, char **argv)
{
    const struct hil_client_options options = {.ready = argv[1], .lockstep = true};
    struct hil_client client;
    int failed = 0;
    uint64_t count;

    if (argc < 3 || hil_client_open(&client, &options)) {
        fprintf(stderr, "client_joints: %s\n", argc < 3 ? "usage" : client.message);
        return 1;
    }
    for (int i = 3; i < argc; i++) {
        struct hil_client_value sent;
        char bus[33], message[65], signal[65];

        /* Send a message of the DBC */
        if (sscanf(argv[i], "%32[^,],%64[^,],%64[^,],%lf", bus, message, signal, &sent.value) ==
            4) {
            sent.signal = signal;
            failed += hil_client_send(&client, bus, message, &sent, 1);
            failed += hil_client_step(&client, 2);
            continue;
        }

        const int joint = hil_client_find_joint(&client, argv[2]);
        const char *names[] = {argv[2]}, *value = strchr(argv[i], '=');
        struct hil_client_joint state;
        int q = 1;

        while (q < 5 && strncmp(words[q], argv[i], strlen(words[q])) != 0) {
            q++;
        }
        if (hil_client_enable(&client, names, 1, q)) {
            printf("refused %s: %s\n", words[q], client.message);
            continue;
        }
        print_joint(&client, joint, "enabled");
        hil_client_step(&client, 50);
        hil_client_read(&client, joint, &state);
        failed += hil_client_command(&client, joint, q,
                                     strtod(value + 1, NULL) +
                                         (q == HIL_CLIENT_POSITION ? state.motor_position_rad : 0));
        failed += hil_client_step(&client, 60);
        print_joint(&client, joint, words[q]);
        printf("tripped %d\n", hil_client_find_tripped(&client, 0) == joint);
        failed += hil_client_enable(&client, names, 1, HIL_CLIENT_OFF);
        print_joint(&client, joint, "off");
    }
    failed += hil_client_read_dropped(&client, &count);
    printf("dropped %llu %s\n", (unsigned long long)count, client.message);
    hil_client_close(&client);
    return failed;
}
