/* SPDX-License-Identifier: Apache-2.0 */
/* Seals of compiled modules. */
#include "model/symbolic/seal.h"

#include "base/hash.h"

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { CHUNK = 65536 };

/* The last bytes of a module. */
struct seal {
    char mark[8];
    uint64_t size; /* bytes before the seal */
    uint64_t hash; /* their hash */
};

static const char seal_mark[8] = "hil-seal";

/* Computes the hash of the first size bytes of a file; returns false when there are fewer. */
static bool seal_hash_file(int descriptor, uint64_t size, uint64_t *hash)
{
    char chunk[CHUNK];

    *hash = HASH_START;
    while (size > 0) {
        ssize_t count = read(descriptor, chunk, size < CHUNK ? (size_t)size : CHUNK);

        if (count < 0 && errno == EINTR) {
            continue;
        }
        if (count <= 0) {
            return false;
        }
        *hash = hash_bytes(*hash, chunk, (size_t)count);
        size -= (uint64_t)count;
    }
    return true;
}

enum error_code seal_write(const char *path, struct error *error)
{
    struct seal seal;
    struct stat status;
    enum error_code code = ERROR_NONE;
    int descriptor = open(path, O_RDWR | O_CLOEXEC);

    if (descriptor < 0) {
        return error_set_errno(error, errno, "%s", path);
    }
    errno = EIO; /* of what ends before its size */
    memcpy(seal.mark, seal_mark, sizeof seal.mark);
    if (fstat(descriptor, &status) ||
        !seal_hash_file(descriptor, seal.size = (uint64_t)status.st_size, &seal.hash) ||
        write(descriptor, &seal, sizeof seal) != (ssize_t)sizeof seal || fsync(descriptor)) {
        code = error_set_errno(error, errno, "%s", path);
    }
    close(descriptor);
    return code;
}

bool seal_is_whole(const char *path)
{
    int descriptor = open(path, O_RDONLY | O_CLOEXEC);
    struct seal seal;
    struct stat status;
    uint64_t size, hash;
    bool whole;

    if (descriptor < 0) {
        return false;
    }
    whole = !fstat(descriptor, &status) && S_ISREG(status.st_mode) &&
            status.st_size > (off_t)sizeof seal;
    size = whole ? (uint64_t)status.st_size - sizeof seal : 0;
    whole = whole && pread(descriptor, &seal, sizeof seal, (off_t)size) == (ssize_t)sizeof seal &&
            !memcmp(seal.mark, seal_mark, sizeof seal.mark) && seal.size == size &&
            seal_hash_file(descriptor, size, &hash) && hash == seal.hash;
    close(descriptor);
    return whole;
}
