/* SPDX-License-Identifier: Apache-2.0 */
/* The folder where compiled dynamics are kept between runs. Not RT-safe. */
#ifndef SIM_MODULE_CACHE_H
#define SIM_MODULE_CACHE_H

#include <stdbool.h>
#include <stddef.h>

/* Path of the folder, made when missing, readable by this user alone: $CACHE_DIRECTORY (set by
 * systemd), else coman-hil below $XDG_CACHE_HOME or $HOME/.cache. False when there is none. */
bool module_cache_folder(char *path, size_t size);

#endif
