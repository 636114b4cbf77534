/* SPDX-License-Identifier: Apache-2.0 */
/* Converts SVG plots to PNG with an external program. */
#include "app/report/svg.h"

#include <errno.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

/* Runs rsvg-convert with these descriptors as standard input and output. Returns its wait status.
 * If the system cannot run it, returns 0 and sets *reason to errno. */
static int png_run_converter(int in, int out, int *reason)
{
    static char name[] = "rsvg-convert", format[] = "--format=png", zoom[] = "--zoom=2";
    char *const arguments[] = {name, format, zoom, NULL};
    posix_spawn_file_actions_t actions;
    int status = 0;
    pid_t process;

    *reason = posix_spawn_file_actions_init(&actions);
    if (*reason) {
        return 0;
    }
    posix_spawn_file_actions_adddup2(&actions, in, STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, out, STDOUT_FILENO);
    *reason = posix_spawnp(&process, name, &actions, NULL, arguments, environ);
    posix_spawn_file_actions_destroy(&actions);
    if (*reason) {
        return 0;
    }

    /* Wait again if a signal interrupts */
    while (waitpid(process, &status, 0) < 0) {
        if (errno != EINTR) {
            *reason = errno;
            return 0;
        }
    }
    return status;
}

enum error_code png_write_panels(const struct svg_plot *panel, size_t npanel, FILE *out,
                                 struct error *error)
{
    FILE *drawing = tmpfile();
    enum error_code code;
    int reason, status;

    if (!drawing) {
        return error_set_errno(error, errno, "cannot write a plot");
    }
    code = svg_write_panels(panel, npanel, drawing, error);
    if (!code) {
        rewind(drawing);
        fflush(out);
        status = png_run_converter(fileno(drawing), fileno(out), &reason);
        if (reason == ENOENT) {
            code = error_set(error, ERROR_UNSUPPORTED,
                             "PNG needs the program rsvg-convert (Debian: librsvg2-bin), which is "
                             "not there; SVG needs nothing");
        } else if (reason) {
            code = error_set_errno(error, reason, "cannot run rsvg-convert");
        } else if (status) {
            code = error_set(error, ERROR_SYSTEM, "rsvg-convert could not draw the plot");
        }
    }
    fclose(drawing);
    return code;
}
