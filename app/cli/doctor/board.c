/* SPDX-License-Identifier: Apache-2.0 */
/* Examines what only machines with ARM processors have, and words fixes for them. */
#include "app/cli/doctor/private.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BOARD_SENSORS_MAX = 32, BOARD_PROCESSORS_MAX = 64 };

bool doctor_is_arm(const struct doctor *d)
{
    char text[64];

    return doctor_read_entry(d, "/proc/cpuinfo", "CPU implementer", text, sizeof text);
}

/* Checks whether the machine is a Raspberry Pi. */
static bool doctor_is_raspberry_pi(const struct doctor *d)
{
    char model[DOCTOR_TEXT];

    return doctor_read_line(d, model, sizeof model, "/proc/device-tree/model") &&
           strncmp(model, "Raspberry Pi", strlen("Raspberry Pi")) == 0;
}

bool doctor_is_virtual_arm(const struct doctor *d)
{
    char text[DOCTOR_TEXT];

    /* ARM has no processor flag for it: a hypervisor says so in the device tree, or has a board of
     * its own */
    if (doctor_read_line(d, text, sizeof text, "/proc/device-tree/hypervisor/compatible") ||
        doctor_read_line(d, text, sizeof text, "/sys/hypervisor/type")) {
        return true;
    }
    if (doctor_read_line(d, text, sizeof text, "/proc/device-tree/compatible") &&
        strcmp(text, "linux,dummy-virt") == 0) {
        return true;
    }
    return doctor_read_line(d, text, sizeof text, "/sys/class/dmi/id/sys_vendor") &&
           (strcmp(text, "QEMU") == 0 || strcmp(text, "Amazon EC2") == 0);
}

const char *doctor_realtime_kernel(const struct doctor *d)
{
    if (doctor_is_raspberry_pi(d)) {
        return "apt install linux-image-rpi-v8-rt; add kernel=kernel8_rt.img to "
               "/boot/firmware/config.txt; reboot";
    }
    return doctor_is_arm(d) ? "apt install linux-image-rt-arm64 && reboot"
                            : "apt install linux-image-rt-amd64 && reboot";
}

const char *doctor_command_line(const struct doctor *d)
{
    return doctor_is_raspberry_pi(d) ? "/boot/firmware/cmdline.txt" : "the kernel's command line";
}

/* Examines whether the loop's processor is a fast one, on chips with processors of several speeds:
 * the kernel gives the relative capacity of each. */
static void examine_capacity(struct doctor *d)
{
    int cpu = d->config->rig->realtime.cpu, fastest = -1;
    long own = 0, best = 0;
    char text[64], fix[160];

    for (int i = 0; i < BOARD_PROCESSORS_MAX; i++) {
        long capacity;

        if (!doctor_read_line(d, text, sizeof text, "/sys/devices/system/cpu/cpu%d/cpu_capacity",
                              i)) {
            continue;
        }
        capacity = strtol(text, NULL, 10);
        own = i == cpu ? capacity : own;
        if (capacity > best) {
            best = capacity;
            fastest = i;
        }
    }

    /* Without such a file all processors are alike */
    if (cpu < 0 || own <= 0 || best <= 0) {
        return;
    }
    snprintf(fix, sizeof fix, "name a fast one in the rig: realtime: {cpu: %d}", fastest);
    if (own < best) {
        doctor_add_finding(d, DOCTOR_WARN, "processor type", fix,
                           "number %d has %.0f %% of the speed of number %d", cpu,
                           100.0 * (double)own / (double)best, fastest);
    } else {
        doctor_add_finding(d, DOCTOR_OK, "processor type", "", "none is faster than number %d",
                           cpu);
    }
}

/* Examines the supply of a Raspberry Pi, which lowers its clock when the voltage sags; the alarm
 * stays until it is read. */
static void examine_supply(struct doctor *d)
{
    char text[64];

    for (int i = 0; i < BOARD_SENSORS_MAX; i++) {
        if (!doctor_read_line(d, text, sizeof text, "/sys/class/hwmon/hwmon%d/name", i) ||
            strcmp(text, "rpi_volt") != 0 ||
            !doctor_read_line(d, text, sizeof text, "/sys/class/hwmon/hwmon%d/in0_lcrit_alarm",
                              i)) {
            continue;
        }
        if (strcmp(text, "0") == 0) {
            doctor_add_finding(d, DOCTOR_OK, "supply", "", "voltage is high enough");
        } else {
            doctor_add_finding(d, DOCTOR_WARN, "supply",
                               "use a supply and a cable for what the board and its hats draw",
                               "under-voltage: the firmware lowers the clock of the processors");
        }
        return;
    }
}

void doctor_examine_board(struct doctor *d)
{
    if (!doctor_is_arm(d)) {
        return;
    }
    examine_capacity(d);
    examine_supply(d);
}
