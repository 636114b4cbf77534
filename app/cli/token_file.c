/* SPDX-License-Identifier: Apache-2.0 */
/* Keeps the tokens of a page in a file. */
#include "app/cli/cli.h"

#include "base/hash.h"
#include "base/whole_file.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

enum { TOKEN_FILE_SIZE = 256 };

bool token_file_default(char *path, size_t size)
{
    const char *state = getenv("XDG_STATE_HOME"), *home = getenv("HOME");
    bool own = state && state[0] == '/';
    char folder[PATH_MAX];
    int count;

    if ((!own && !(home && home[0] == '/')) || !getcwd(folder, sizeof folder)) {
        return false;
    }
    count = snprintf(path, size, "%s%s/coman-hil/pages/%016" PRIx64, own ? state : home,
                     own ? "" : "/.local/state", hash_bytes(HASH_START, folder, strlen(folder)));
    return count > 0 && (size_t)count < size;
}

/* ---- reading ---- */

/* Checks whether a text is a token: the right number of hexadecimal digits. */
static bool token_is_valid(const char *token)
{
    return strlen(token) == VIEWER_TOKEN - 1 &&
           strspn(token, "0123456789abcdef") == VIEWER_TOKEN - 1;
}

/* Parses the three lines of the file. Returns false if the format differs from
 * token_file_write's. */
static bool token_file_parse(const char *text, struct page_tokens *tokens)
{
    char look[VIEWER_TOKEN + 1], control[VIEWER_TOKEN + 1];
    unsigned port;
    int end = 0;

    if (sscanf(text, "port %5u\nlook %33s\ncontrol %33s\n%n", &port, look, control, &end) != 3 ||
        text[end] || port == 0 || port > UINT16_MAX || !token_is_valid(look) ||
        !token_is_valid(control)) {
        return false;
    }
    memcpy(tokens->token[0], look, VIEWER_TOKEN);
    memcpy(tokens->token[1], control, VIEWER_TOKEN);
    tokens->port = (uint16_t)port;
    return true;
}

enum error_code token_file_read(const char *path, struct page_tokens *tokens, struct error *error)
{
    char text[TOKEN_FILE_SIZE];
    struct stat status;
    ssize_t size;
    int file = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);

    *tokens = (struct page_tokens){.port = 0};
    if (file < 0) {
        return errno == ENOENT
                   ? ERROR_NONE
                   : error_set_errno(error, errno, "--token-file: cannot open %s", path);
    }

    /* Another user who can read or write the file could control the page */
    if (fstat(file, &status) || !S_ISREG(status.st_mode) || status.st_uid != geteuid() ||
        status.st_mode & 077) {
        close(file);
        return error_set(error, ERROR_INPUT,
                         "--token-file: %s: expected a file of yours that nobody else may read or "
                         "write, mode 0600",
                         path);
    }
    size = read(file, text, sizeof text - 1);
    close(file);
    text[size > 0 ? size : 0] = '\0';
    return token_file_parse(text, tokens)
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "--token-file: %s: expected port, look and control, as a run has "
                           "written them; without the file they are made anew",
                           path);
}

/* ---- writing ---- */

enum error_code token_file_write(const char *path, const struct page_tokens *tokens,
                                 struct error *error)
{
    struct whole_file file;
    enum error_code code;
    char folder[PATH_MAX];

    /* Create the missing folders above a file, for the owner only */
    snprintf(folder, sizeof folder, "%s", path);
    for (char *at = strchr(folder + 1, '/'); at; at = strchr(at + 1, '/')) {
        *at = '\0';
        mkdir(folder, 0700);
        *at = '/';
    }
    code = whole_file_open(&file, path, error);
    if (code) {
        return error_prefix(error, "--token-file");
    }
    if (fchmod(fileno(file.out), S_IRUSR | S_IWUSR)) {
        code = error_set_errno(error, errno, "--token-file: cannot write %s", path);
    }
    fprintf(file.out, "port %u\nlook %s\ncontrol %s\n", tokens->port, tokens->token[0],
            tokens->token[1]);
    return whole_file_close(&file, code, error);
}
