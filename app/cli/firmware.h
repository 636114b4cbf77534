/* SPDX-License-Identifier: Apache-2.0 */
/* Writes the firmware that hosts have downloaded into the boards' bootloaders. Not RT-safe. */
#ifndef APP_CLI_FIRMWARE_H
#define APP_CLI_FIRMWARE_H

#include "sim/simulator.h"

/* Writes DIRECTORY/firmware-BOARD.bin after the run for every board that has kept a download (rig
 * key keep_firmware): program memory, then data memory, 65536 words of 16 bits each, low byte
 * first, 0xffff where nothing came. A '/' in the board's name becomes '-'. ERROR_SYSTEM. */
enum error_code firmware_write(const struct simulator *simulator, const char *directory,
                               struct error *error);

#endif
