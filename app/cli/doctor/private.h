/* SPDX-License-Identifier: Apache-2.0 */
/* Shared by the files of doctor: findings, and files below the root. Not RT-safe. */
#ifndef APP_CLI_DOCTOR_PRIVATE_H
#define APP_CLI_DOCTOR_PRIVATE_H

#include "app/cli/doctor/doctor.h"

enum { DOCTOR_TEXT = 512, DOCTOR_PATH = 512 };

/* Numbers of capabilities, as in linux/capability.h. */
enum { CAP_NET_ADMIN = 12, CAP_IPC_LOCK = 14, CAP_SYS_NICE = 23 };

/* An examination under way. */
struct doctor {
    const struct doctor_config *config;
    struct doctor_finding *findings;
    size_t count, max;
};

/* Adds a finding while there is room; format tells what was found. */
void doctor_add_finding(struct doctor *d, enum doctor_verdict verdict, const char *subject,
                        const char *fix, const char *format, ...)
    __attribute__((format(printf, 5, 6)));

/* Reads the first line of a file below the root, without its end; false when it cannot be read. */
bool doctor_read_line(const struct doctor *d, char *text, size_t size, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* Reads the rest of the line that begins with key in a file; false when there is none. */
bool doctor_read_entry(const struct doctor *d, const char *name, const char *key, char *text,
                       size_t size);

/* Check whether this process may write a file, and whether it has a capability. */
bool doctor_may_write(const struct doctor *d, const char *name);
bool doctor_has_capability(const struct doctor *d, int capability);

/* Returns the soft limit of a row of /proc/self/limits; -1 = unlimited, -2 = unknown. */
long long doctor_limit_of(const struct doctor *d, const char *row);

/* Check the machine whose files these are, not that of the program: board.c. */
bool doctor_is_arm(const struct doctor *d);
bool doctor_is_virtual_arm(const struct doctor *d);

/* Return how to get a real-time kernel there, and where the kernel's parameters are written. */
const char *doctor_realtime_kernel(const struct doctor *d);
const char *doctor_command_line(const struct doctor *d);

/* Examine kernel, rights and processors (machine.c), what only ARM has (board.c), CAN interfaces
 * and loads (buses.c), and real boards on the buses (external.c). */
void doctor_examine_machine(struct doctor *d);
void doctor_examine_board(struct doctor *d);
void doctor_examine_buses(struct doctor *d);
void doctor_examine_external(struct doctor *d);

#endif
