/* SPDX-License-Identifier: Apache-2.0 */
/* Compiles and loads a generated module, for benchmarks and tests. */
#include "model/symbolic/symbolic.h"

#include <dlfcn.h>
#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Writes, compiles and loads a module in a folder of its own. */
static enum error_code compile_in(const char *folder, const struct robot *robot,
                                  const struct symbolic_options *options, const char *level,
                                  struct symbolic_library *library, struct error *error)
{
    char source[PATH_MAX], output[PATH_MAX], command[3 * PATH_MAX], symbol[SYMBOLIC_SYMBOL];
    const struct dynamics_module *(*entry)(void);
    enum error_code code;
    FILE *file;
    void *found;
    int status;

    snprintf(source, sizeof source, "%s/module.c", folder);
    snprintf(output, sizeof output, "%s/module.so", folder);
    if (!(file = fopen(source, "w"))) {
        return error_set_errno(error, errno, "%s", source);
    }
    code = symbolic_generate(robot, options, file, NULL, error);
    fclose(file);
    snprintf(command, sizeof command,
             "cc -std=gnu11 %s -fno-math-errno -ffp-contract=off -fPIC -shared -o '%s' '%s' -lm",
             level, output, source);
    status = code ? 0 : system(command);
    library->handle = code || status ? NULL : dlopen(output, RTLD_NOW | RTLD_LOCAL);

    /* Remove the files; a loaded module does not need them */
    unlink(source);
    unlink(output);
    symbolic_symbol(robot, symbol);
    if (code) {
        return code;
    }
    if (!library->handle || !(found = dlsym(library->handle, symbol))) {
        return error_set(error, ERROR_UNSUPPORTED,
                         "the compiler (cc) made no module: wait status %d", status);
    }
    memcpy(&entry, &found, sizeof entry);
    library->module = dynamics_module_used(entry());
    return ERROR_NONE;
}

enum error_code symbolic_compile(const struct robot *robot, const struct symbolic_options *options,
                                 const char *level, struct symbolic_library *library,
                                 struct error *error)
{
    const char *place = getenv("TMPDIR");
    char folder[PATH_MAX - 16];
    enum error_code code;

    memset(library, 0, sizeof *library);
    snprintf(folder, sizeof folder, "%s/coman-hil-module-XXXXXX", place ? place : "/tmp");
    if (!mkdtemp(folder)) {
        return error_set_errno(error, errno, "%s", folder);
    }
    code = compile_in(folder, robot, options, level, library, error);
    rmdir(folder);
    return code;
}

void symbolic_close(struct symbolic_library *library)
{
    if (library->handle) {
        dlclose(library->handle);
    }
    memset(library, 0, sizeof *library);
}
