/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Runs a fuzz target without libFuzzer, as a normal test: every input of its corpus, then a fixed
 * number of seeded mutations of them, the same every time.
 *
 *     fuzz_TARGET CORPUS MUTATIONS [DICTIONARY]      the test; prints TAP
 *     fuzz_TARGET FILE                               one input again, for a debugger
 *
 * An input that fails is written to crash-TARGET in the working directory.
 */
#include "tests/fuzz/fuzz.h"

#include "base/array.h"

#include <dirent.h>
#include <fcntl.h>
#include <inttypes.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <unistd.h>

enum {
    INPUT_MAX = 1 << 16,
    INPUTS_MAX = 4096,
    WORDS_MAX = 512,
    SECONDS_MAX = 10, /* of the processor, for one input; by far more than any is to take */
};

struct input {
    char *name;
    uint8_t *data;
    size_t size;
};

static struct input inputs[INPUTS_MAX], words[WORDS_MAX];
static size_t ninput, nword;

/* what is being run, for the messages of a failure */
static char crash_file[256];
static char doing[512];
static const uint8_t *current;
static size_t current_size;

/* ---- a failure ---- */

static void keep_input(void)
{
    const int file = open(crash_file, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    const size_t length = strlen(doing);

    if (write(STDOUT_FILENO, doing, length) != (ssize_t)length || file < 0 ||
        write(file, current, current_size) != (ssize_t)current_size) {
        return;
    }
    close(file);
}

static void on_signal(int number)
{
    keep_input();
    signal(number, SIG_DFL);
    raise(number);
}

/* the sanitizers' */
void __sanitizer_set_death_callback(void (*callback)(void)) __attribute__((weak));

static void watch(void)
{
    static const int signals[] = {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGPROF};

    if (__sanitizer_set_death_callback) {
        __sanitizer_set_death_callback(keep_input);
    }
    for (size_t i = 0; i < ARRAY_COUNT(signals); i++) {
        signal(signals[i], on_signal);
    }
}

static void limit_time(int seconds)
{
    const struct itimerval time = {.it_value = {.tv_sec = seconds}};

    setitimer(ITIMER_PROF, &time, NULL);
}

static void run(const uint8_t *data, size_t size, int test, const char *what)
{
    /* exactly as long as the input, so that a sanitizer sees a read beyond it */
    uint8_t *exact = malloc(size ? size : 1);

    fuzz_require(exact, "no memory");
    memcpy(exact, data, size);
    current = exact;
    current_size = size;
    snprintf(doing, sizeof doing, "not ok %d - %s\n# the input is in %s\nBail out!\n", test, what,
             crash_file);
    limit_time(SECONDS_MAX);
    LLVMFuzzerTestOneInput(exact, size);
    limit_time(0);
    current = NULL;
    current_size = 0;
    free(exact);
}

/* ---- files ---- */

static bool read_input(const char *path, struct input *input)
{
    FILE *file = fopen(path, "rb");

    input->data = malloc(INPUT_MAX);
    input->name = strdup(path);
    if (!file || !input->data || !input->name) {
        return false;
    }
    input->size = fread(input->data, 1, INPUT_MAX, file);
    fclose(file);
    return true;
}

static int by_name(const struct dirent **a, const struct dirent **b)
{
    return strcmp((*a)->d_name, (*b)->d_name);
}

static bool read_corpus(const char *path)
{
    struct dirent **entry;
    char file[1024];
    int count = scandir(path, &entry, NULL, by_name);

    for (int i = 0; i < count; i++) {
        if (entry[i]->d_name[0] != '.' && ninput < INPUTS_MAX) {
            snprintf(file, sizeof file, "%s/%s", path, entry[i]->d_name);
            if (!read_input(file, &inputs[ninput++])) {
                return false;
            }
        }
        free(entry[i]);
    }
    if (count >= 0) {
        free(entry);
    }
    return ninput > 0;
}

/* A word of a dictionary: what stands between the first quote and the last, with \\ \" \xNN. */
static bool read_word(const char *line, struct input *word)
{
    const char *at = strchr(line, '"'), *end = strrchr(line, '"');

    if (!at || end == at || *line == '#') {
        return false;
    }
    word->data = malloc(strlen(line));
    word->size = 0;
    while (word->data && ++at < end) {
        unsigned byte = (unsigned char)*at;

        if (*at == '\\' && at[1] == 'x') {
            sscanf(at + 2, "%2x", &byte);
            at += 3;
        } else if (*at == '\\') {
            byte = (unsigned char)*++at;
        }
        word->data[word->size++] = (uint8_t)byte;
    }
    return word->data && word->size > 0;
}

static bool read_dictionary(const char *path)
{
    FILE *file = fopen(path, "r");
    char line[256];

    while (file && fgets(line, sizeof line, file)) {
        if (nword < WORDS_MAX && read_word(line, &words[nword])) {
            nword++;
        }
    }
    if (file) {
        fclose(file);
    }
    return nword > 0;
}

static void free_inputs(void)
{
    for (size_t i = 0; i < ninput; i++) {
        free(inputs[i].name);
        free(inputs[i].data);
    }
    for (size_t i = 0; i < nword; i++) {
        free(words[i].data);
    }
}

/* ---- mutations ---- */

static uint64_t random_state = 20141118;

/* SplitMix64 */
static size_t random_below(size_t limit)
{
    uint64_t z = random_state += UINT64_C(0x9e3779b97f4a7c15);

    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    return (size_t)((z ^ z >> 31) % limit);
}

/* Puts size bytes of with in the place of cut bytes at `at`. */
static void replace(struct input *input, size_t at, size_t cut, const uint8_t *with, size_t size)
{
    cut = cut < input->size - at ? cut : input->size - at;
    if (input->size - cut + size > INPUT_MAX) {
        return;
    }
    memmove(input->data + at + size, input->data + at + cut, input->size - at - cut);
    memcpy(input->data + at, with, size);
    input->size += size - cut;
}

/* One small change: a byte, a bit, a digit, a word, a piece gone, moved or from elsewhere. */
static void mutate(struct input *input)
{
    static const char digits[] = "0123456789";
    const struct input *other = &inputs[random_below(ninput)];
    const size_t at = random_below(input->size + 1), length = 1 + random_below(24);
    uint8_t byte = (uint8_t)random_below(256), piece[32] = {0};
    size_t from;

    switch (random_below(nword ? 9 : 7)) {
    case 0:
        replace(input, at, 1, &byte, 1);
        break;
    case 1:
        replace(input, at, 0, &byte, 1);
        break;
    case 2:
        replace(input, at, length, piece, 0);
        break;
    case 3:
        if (at < input->size) {
            input->data[at] ^= (uint8_t)(1u << byte % 8);
        }
        break;
    case 4: /* still a number where there was one */
        for (size_t i = at; i < input->size; i++) {
            if (input->data[i] && memchr(digits, input->data[i], 10)) {
                input->data[i] = (uint8_t)digits[byte % 10];
                break;
            }
        }
        break;
    case 5:
    case 6:
        if (other->size > length) {
            from = random_below(other->size - length);
            memcpy(piece, other->data + from, length);
            replace(input, at, byte & 1 ? length : 0, piece, length);
        }
        break;
    default:
        other = &words[random_below(nword)];
        replace(input, at, random_below(other->size + 1), other->data, other->size);
        break;
    }
}

static void run_mutations(unsigned long count)
{
    struct input input = {.data = malloc(INPUT_MAX)};
    char what[300];

    fuzz_require(input.data, "no memory");
    for (unsigned long i = 0; i < count; i++) {
        const struct input *from = &inputs[random_below(ninput)];

        memcpy(input.data, from->data, from->size);
        input.size = from->size;
        for (size_t edits = 1 + random_below(4); edits > 0; edits--) {
            mutate(&input);
        }
        snprintf(what, sizeof what, "mutation %lu, of %s", i, from->name);
        run(input.data, input.size, 2, what);
    }
    free(input.data);
}

/* ---- the test ---- */

static int replay(const char *corpus, unsigned long mutations, const char *dictionary)
{
    struct fuzz_tally tally;
    bool both;

    printf("1..3\n");
    if (!read_corpus(corpus) || (dictionary && !read_dictionary(dictionary))) {
        printf("Bail out! cannot read %s%s%s\n", corpus, dictionary ? " or " : "",
               dictionary ? dictionary : "");
        return 1;
    }
    for (size_t i = 0; i < ninput; i++) {
        run(inputs[i].data, inputs[i].size, 1, inputs[i].name);
    }
    printf("ok 1 - %zu inputs of the corpus\n", ninput);
    run_mutations(mutations);
    printf("ok 2 - %lu mutations of them\n", mutations);

    /* where a target takes and refuses, some inputs went each way */
    tally = fuzz_tally;
    both = (tally.taken > 0) == (tally.refused > 0);
    printf("%s 3 - %" PRIu64 " taken, %" PRIu64 " refused\n", both ? "ok" : "not ok", tally.taken,
           tally.refused);
    return both ? 0 : 1;
}

int main(int argc, char **argv)
{
    const char *name = strrchr(argv[0], '/');
    struct stat status;
    int result = 0;

    if (argc < 2 || stat(argv[1], &status)) {
        fprintf(stderr, "usage: %s CORPUS MUTATIONS [DICTIONARY] | FILE\n", argv[0]);
        return 2;
    }
    setvbuf(stdout, NULL, _IOLBF, 0);
    snprintf(crash_file, sizeof crash_file, "crash-%s", name ? name + 1 : argv[0]);
    watch();
    if (!S_ISDIR(status.st_mode)) {
        fuzz_require(read_input(argv[1], &inputs[ninput++]), "cannot read %s", argv[1]);
        run(inputs[0].data, inputs[0].size, 1, argv[1]);
    } else {
        result =
            replay(argv[1], argc > 2 ? strtoul(argv[2], NULL, 10) : 0, argc > 3 ? argv[3] : NULL);
    }
    free_inputs();
    return result;
}
