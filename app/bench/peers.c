/* SPDX-License-Identifier: Apache-2.0 */
/* Finds and loads the module with the other simulators. */
#include "app/bench/peers.h"

#include "base/config.h"

#include <dlfcn.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* Loads a module into library->handle. Refuses a module from another build. */
static enum error_code peers_load_module(const char *path, struct peers_library *library,
                                         struct error *error)
{
    const struct peers *(*entry)(void);
    void *symbol;

    /* Never unload it, because C++ libraries may crash when they are unloaded */
    library->handle = dlopen(path, RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
    if (!library->handle) {
        return error_set(error, ERROR_UNSUPPORTED, "%s", dlerror());
    }
    symbol = dlsym(library->handle, "hil_peers");
    if (symbol) {
        memcpy(&entry, &symbol, sizeof entry);
        library->peers = entry();
    }
    if (!library->peers || library->peers->abi != PEERS_ABI ||
        library->peers->robot_size != sizeof(struct robot)) {
        peers_close(library);
        return error_set(error, ERROR_UNSUPPORTED, "%s: found a module of another build", path);
    }
    return ERROR_NONE;
}

enum error_code peers_open(const char *path, struct peers_library *library, struct error *error)
{
    static const char *const places[] = {"", "/tests"};
    char folder[PATH_MAX], file[PATH_MAX + sizeof "/tests/" PEERS_FILE];

    *library = (struct peers_library){0};
    if (path) {
        return peers_load_module(path, library, error);
    }
    config_program_folder(folder);

    /* Search beside the program and in the build's folder for tests */
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        snprintf(file, sizeof file, "%s%s/" PEERS_FILE, folder, places[i]);
        if (access(file, F_OK) == 0) {
            return peers_load_module(file, library, error);
        }
    }
    return error_set(error, ERROR_UNSUPPORTED,
                     "found no " PEERS_FILE " in %s or %s/tests: it is built with the tests where "
                     "libsimbody-dev, libmujoco-dev or libode-dev is installed",
                     folder, folder);
}

void peers_close(struct peers_library *library)
{
    if (library->handle) {
        dlclose(library->handle);
    }
    *library = (struct peers_library){0};
}
