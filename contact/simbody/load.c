/* SPDX-License-Identifier: Apache-2.0 */
/* Finds and loads the module with the contact engine "simbody". */
#include "contact/simbody/module.h"

#include "base/array.h"
#include "base/config.h"

#include <dlfcn.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

bool contact_simbody_find(char *path, size_t size)
{
    /* Folders relative to the program's folder: of an installation, of a build, and of the build's
     * tests */
    static const char *const places[] = {("../" HIL_MODULE_FOLDER), "modules", "../modules"};
    char folder[PATH_MAX];

    config_program_folder(folder);
    for (size_t i = 0; i < ARRAY_COUNT(places); i++) {
        int length = snprintf(path, size, "%s/%s/" SIMBODY_MODULE_FILE, folder, places[i]);
        if (length > 0 && (size_t)length < size && access(path, R_OK) == 0) {
            return true;
        }
    }
    /* The installation folder of the build, for programs that are elsewhere */
    snprintf(path, size, "%s", HIL_MODULE_PATH "/" SIMBODY_MODULE_FILE);
    if (access(path, R_OK) == 0) {
        return true;
    }
    snprintf(path, size, "%s/%s/" SIMBODY_MODULE_FILE, folder, places[0]);
    return false;
}

/* Loads the module from a file if it is from the same build. The module stays loaded, because
 * unloading C++ libraries is not safe. */
static enum error_code simbody_load(const char *path, const struct simbody_module **module,
                                    struct error *error)
{
    void *handle = dlopen(path, RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
    const size_t size[] = {SIMBODY_MODULE_SIZES};

    if (!handle) {
        return error_set(error, ERROR_UNSUPPORTED, "contact: engine simbody: %.300s", dlerror());
    }
    *module = dlsym(handle, "simbody_module");
    if (!*module || strcmp((*module)->version, HIL_VERSION) != 0 ||
        (*module)->config_size != size[0] || (*module)->surface_size != size[1] ||
        (*module)->error_size != size[2]) {
        return error_set(error, ERROR_UNSUPPORTED,
                         "contact: engine simbody: found a module of another build, %.300s", path);
    }
    return ERROR_NONE;
}

enum error_code contact_simbody_create(const struct contact_config *config,
                                       struct contact_world **world, struct error *error)
{
    const struct simbody_module *module = NULL;
    char path[PATH_MAX];
    enum error_code code;

    if (!contact_simbody_find(path, sizeof path)) {
        return error_set(error, ERROR_UNSUPPORTED,
                         "contact: engine simbody: found no module %.300s, expected one (a build "
                         "with HIL_SIMBODY=ON installs it) or engine native",
                         path);
    }
    code = simbody_load(path, &module, error);
    return code ? code : module->create(config, world, error);
}
