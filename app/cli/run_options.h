/* SPDX-License-Identifier: Apache-2.0 */
/* The command line of coman-hil run, and the simulator configuration that results. Not RT-safe. */
#ifndef APP_CLI_RUN_OPTIONS_H
#define APP_CLI_RUN_OPTIONS_H

#include "app/cli/task_input.h"
#include "base/options.h"
#include "canbus/gateway.h"
#include "sim/simulator.h"

enum { RUN_HOST_SIZE = 64 }; /* room for any numeric address */

/* The channels of --slcan, with the memory of their strings. */
struct run_slcan {
    size_t count;
    struct gateway_slcan channel[GATEWAY_SLCAN];
    char bus[GATEWAY_SLCAN][RUN_HOST_SIZE], host[GATEWAY_SLCAN][RUN_HOST_SIZE];
};

/* The options as given; strings belong to the command line. */
struct run_options {
    const char *rig, *task, *stimulus, *record, *gateway, *control, *http, *ready, *token_file;
    struct task_options input; /* of the task */
    struct option_list bus, fault, set, slcan;
    double duration_s;               /* INFINITY = not given */
    double http_linger_s;            /* -1 = not given */
    int64_t ticks, record_period_ms; /* ticks: 0 = not given */
    int64_t seed;                    /* -1 = the rig's */
    int clock, overrun, hold, wire;  /* -1 = the rig's */
    int transport;                   /* enum bus_transport */
    int record_format;               /* enum recorder_format; 0 = the rig's */
    bool settle, energy, force, quiet;
    bool trust; /* the rig may write and listen anywhere */
};

/* Reads the command line; returns false if the command must return *status now (options_read). */
bool run_options_read(int argc, char **argv, struct run_options *options, int *status);

/* Refuses two settings of a rig that is not installed, unless the command line trusts the rig or
 * overrides the setting: recording outside the working directory, and serving the page to other
 * machines. The error has file:line:column. */
enum error_code run_options_check_trust(const struct run_options *options, const struct rig *rig,
                                        struct error *error);

/* Reads the channels of --slcan. */
enum error_code run_options_read_slcan(const struct run_options *options, struct run_slcan *slcan,
                                       struct error *error);

/* Makes the simulator's configuration: the command line's settings, else the rig's. It points into
 * both, and has no gateway. */
enum error_code run_options_configure(const struct run_options *options, const struct rig *rig,
                                      struct simulator_config *config, struct error *error);

/* Checks whether a numeric address is reachable only from this machine. */
bool run_options_is_loopback(const char *host);

/* Parses "[HOST:]PORT", with an IPv6 address in brackets, as the value of an option. *given points
 * to host, or is NULL without one. example: text for the message. */
enum error_code run_options_parse_address(const char *option, const char *text, const char *example,
                                          char host[RUN_HOST_SIZE], const char **given,
                                          uint16_t *port, struct error *error);

/* Returns the address for the page from the command line or the rig; NULL = no page. */
const char *run_options_http(const struct run_options *given, const struct rig *rig);

#endif
