/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Words from outside, by the first byte: numbers and names, a command line, the environment of a
 * service manager, the simulator's side of lockstep, and text that goes into markup.
 */
#include "base/text.h"

#include "base/array.h"

#include "canbus/lockstep.h"
#include "base/markup.h"
#include "app/cli/cli.h"
#include "base/options.h"
#include "tests/fuzz/fuzz.h"
#include "tests/unit/base/try_command.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

enum { TEXT = 512, ARGUMENTS = 16, WORDS = 6, STEPS_MAX = 4096 };

/* ---- numbers and names ---- */

static void check_real(const char *text)
{
    double value = -7.0, again;
    char printed[64];

    if (!text_to_double(text, &value)) {
        fuzz_require(value == -7.0, "%s: changed to %g", text, value);
        return;
    }
    fuzz_require(isfinite(value) && value == strtod(text, NULL) && !strpbrk(text, "xXnN \t\n"),
                 "%s: %g", text, value);
    snprintf(printed, sizeof printed, "%.17g", value);
    fuzz_require(text_to_double(printed, &again) && memcmp(&again, &value, sizeof value) == 0, "%s",
                 printed);
}

static void check_int(const char *text, int64_t min, int64_t max)
{
    int64_t value = -7, again;
    char printed[64];

    if (!text_to_int(text, min, max, &value)) {
        fuzz_require(value == -7, "%s: changed to %" PRId64, text, value);
        return;
    }
    fuzz_require(value >= min && value <= max, "%s: %" PRId64, text, value);
    snprintf(printed, sizeof printed, "%" PRId64, value);
    fuzz_require(text_to_int(printed, min, max, &again) && again == value, "%s", printed);
}

static void check_word(const char *text)
{
    static const char *const words[WORDS] = {"kp", "stiffness_nm_rad", "mass_kg", "", "name", "x"};
    const char *nearest = text_nearest(text, words, WORDS);
    bool known = false;

    for (int i = 0; i < WORDS; i++) {
        known = known || nearest == words[i];
    }
    fuzz_require(!nearest || known, "%s", nearest);
    if (text_is_name(text)) {
        fuzz_require(strlen(text) <= 63 && !strpbrk(text, "/ \n\"'\\$;") && strcmp(text, "..") != 0,
                     "%s", text);
    }
}

/* ---- a command line: arguments end with a newline ---- */

static void check_command_line(char *text)
{
    bool help = false;
    const char *file = NULL, *const *other = NULL;
    const struct operand_spec operands[] = {{"FILE", "x", true, .value = &file},
                                            {"OTHER", "x", false, .list = &other}};
    const struct command_spec spec = {.name = "try",
                                      .summary = "Try.",
                                      .option = try_options,
                                      .noption = ARRAY_COUNT(try_options),
                                      .operand = operands,
                                      .noperand = 2,
                                      .many = true};
    char name[] = "try", *arguments[ARGUMENTS + 1] = {name};
    struct error error = {0};
    int narguments = 1;

    given = try_defaults;
    while (text && narguments < ARGUMENTS) {
        arguments[narguments++] = strsep(&text, "\n");
    }
    if (options_parse(&spec, narguments, arguments, &help, &error)) {
        fuzz_require(error.code == ERROR_INPUT && fuzz_is_sentence(error.text), "%s", error.text);
        return;
    }
    fuzz_require(help || file, "nothing missing");
    fuzz_require(given.duration >= 0.0 && given.duration <= 1e6, "%g", given.duration);
    fuzz_require(given.count >= -5 && given.count <= 9007199254740992, "%" PRId64, given.count);
    fuzz_require(given.clock >= 0 && given.clock <= 2 && given.buses.count <= OPTION_LIST_MAX, "%d",
                 given.clock);
    for (size_t i = 0; i < given.buses.count; i++) {
        fuzz_require(given.buses.item[i] && *given.buses.item[i], "an empty item");
    }
}

/* ---- the service manager's environment: socket, time, process, a line each ---- */

static void set_variable(const char *name, char **text)
{
    const char *value = strsep(text, "\n");

    if (value) {
        setenv(name, value, 1);
    } else {
        unsetenv(name);
    }
}

static void check_environment(char *text)
{
    struct notify notify;

    set_variable("NOTIFY_SOCKET", &text);
    set_variable("WATCHDOG_USEC", &text);
    set_variable("WATCHDOG_PID", &text);
    notify_open(&notify);
    fuzz_require(notify.watchdog_ns >= 0 && notify.watchdog_ns % 1000 == 0, "%" PRId64,
                 notify.watchdog_ns);
    fuzz_require(notify.descriptor < 0 || notify.length <= sizeof notify.address, "%u",
                 (unsigned)notify.length);
    fuzz_require(!getenv("NOTIFY_SOCKET") && !getenv("WATCHDOG_USEC") && !getenv("WATCHDOG_PID"),
                 "still there");
    notify_close(&notify);
}

/* ---- lockstep, beside a counter of our own ---- */

static void check_lockstep(struct fuzz_bytes *bytes)
{
    struct lockstep lockstep;
    const struct lockstep_config config = {.step_id = 0x7f0, .done_id = 0x7f1, .silence_ns = 1000};
    uint32_t run = 0;
    int steps = 0;

    lockstep_init(&lockstep, &config);
    while (bytes->left > 0 && steps < STEPS_MAX) {
        struct bus_frame frame, done;
        enum lockstep_verdict verdict;

        fuzz_frame(bytes, &frame);
        frame.id = frame.id & 1 ? config.step_id : frame.id;
        verdict = lockstep_receive(&lockstep, &frame);
        fuzz_require((verdict == LOCKSTEP_RUN) ==
                         (frame.id == config.step_id && frame.len == 6 &&
                          !(frame.flags & (FRAME_EXTENDED | FRAME_ERROR | FRAME_REMOTE)) &&
                          get_u32_le(frame.data) == run),
                     "verdict %d", (int)verdict);
        if (verdict == LOCKSTEP_RUN) {
            bool last = false;

            for (; !last && steps < STEPS_MAX; steps++) {
                last = lockstep_advance(&lockstep, 0);
                run++;
            }
            if (!last) {
                return;
            }
        }
        done = lockstep_done(&lockstep, 0);
        fuzz_require(frame_valid(&done) && done.id == config.done_id && done.len == 6 &&
                         get_u32_le(done.data) == run,
                     "DONE of %u after %u", get_u32_le(done.data), run);
    }
}

/* ---- markup ---- */

static void check_markup(const char *text, unsigned flags)
{
    struct fuzz_text out;

    markup_put_flags(fuzz_text_open(&out), text, flags);
    fuzz_text_finish(&out);
    for (const char *at = out.text; *at; at++) {
        fuzz_require(!strchr("<>\"", *at) && (unsigned char)*at >= 0x20, "%s", out.text);
        fuzz_require(*at != '&' || strchr(at, ';'), "%s", out.text);
        fuzz_require(!(flags & MARKUP_ASCII) || (unsigned char)*at < 0x80, "%s", out.text);
        fuzz_require(text_utf8_length(at, strlen(at)) > 0 || ((unsigned char)*at & 0xc0) == 0x80,
                     "%s", out.text);
    }
    fuzz_text_free(&out);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fuzz_bytes bytes = {data, size};
    const uint8_t what = fuzz_u8(&bytes);
    const size_t length = bytes.left < TEXT ? bytes.left : TEXT - 1;
    char text[TEXT];

    memcpy(text, bytes.at, length);
    text[length] = '\0';
    switch (what & 7) {
    case 0:
        check_real(text);
        break;
    case 1:
        check_int(text, what & 8 ? -100 : INT64_MIN, what & 16 ? 255 : INT64_MAX);
        break;
    case 2:
        check_word(text);
        break;
    case 3:
        check_command_line(text);
        break;
    case 4:
        check_environment(text);
        break;
    case 5:
        check_lockstep(&bytes);
        break;
    default:
        check_markup(text, what >> 3 & (MARKUP_ASCII | MARKUP_LINE_BREAKS));
        break;
    }
    return 0;
}
