/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Lines of the control socket: each is refused in a sentence, or it is a request whose values are
 * in range and that means the same when it is written out and read again. The first line is a
 * pattern for those that follow, too.
 */
#include "control/parse.h"

#include "rt/requests.h"
#include "tests/fuzz/fuzz.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { WORD = 24 };

static void check_numbers(const struct control_request *request)
{
    fuzz_require(request->command < CONTROL_COMMANDS && request->list < CONTROL_LISTS, "%d %d",
                 (int)request->command, (int)request->list);
    fuzz_require(isfinite(request->value) && request->time_s >= 0 && request->time_s <= 9e6 &&
                     request->count >= 0 && request->period_ms > 0 && request->period_ms <= 60000,
                 "%g %g %lld %g", request->value, request->time_s, (long long)request->count,
                 request->period_ms);
    for (int i = 0; i < 3; i++) {
        fuzz_require(fabs(request->force_n[i]) <= 1e6 && fabs(request->moment_nm[i]) <= 1e6,
                     "%g N, %g Nm", request->force_n[i], request->moment_nm[i]);
    }
    if (request->command == CONTROL_CHECKPOINT || request->command == CONTROL_RESTORE) {
        fuzz_require(request->count < CHECKPOINT_SLOTS, "slot %lld", (long long)request->count);
    }
}

static void check_texts(const struct control_request *request)
{
    bool named = request->command == CONTROL_GET || request->command == CONTROL_SET ||
                 request->command == CONTROL_FAULT || request->command == CONTROL_PUSH;

    fuzz_require(!named == !request->name, "%s", control_command_name(request->command));
    fuzz_require((request->command == CONTROL_SUBSCRIBE) == (json_array_size(request->signals) > 0),
                 "%zu signals", json_array_size(request->signals));
    fuzz_require(!request->id || json_is_number(request->id) ||
                     json_string_length(request->id) <= CONTROL_ID_MAX,
                 "id");
}

static void check_again(const struct control_request *request)
{
    char *text = json_dumps(request->root, JSON_COMPACT);
    struct control_request again;
    struct error error = {0};

    fuzz_require(text, "no text");
    fuzz_require(!strchr(text, '\n'), "%s", text);
    fuzz_require(control_parse(text, strlen(text), 1, &again, &error) == ERROR_NONE, "%s: %s", text,
                 error.text);
    fuzz_require(again.command == request->command && again.count == request->count &&
                     again.value == request->value && again.on == request->on &&
                     memcmp(again.force_n, request->force_n, sizeof again.force_n) == 0,
                 "%s", text);
    control_request_clear(&again);
    free(text);
}

static void read_line(const char *line, size_t size, uint64_t number)
{
    struct control_request request;
    struct error error = {0};
    json_t *message;

    if (control_parse(line, size, number, &request, &error)) {
        fuzz_require(error.code != ERROR_NONE && fuzz_is_sentence(error.text), "%s", error.text);
        message = control_text(error.text);
        fuzz_require(message, "%s", error.text);
        json_decref(message);
        fuzz_tally.refused++;
    } else {
        check_numbers(&request);
        check_texts(&request);
        check_again(&request);
        fuzz_tally.taken++;
    }
    control_request_clear(&request);
}

/* What a pattern means, said in another way. */
static bool means(const char *pattern, const char *name)
{
    if (*pattern == '*') {
        return means(pattern + 1, name) || (*name && means(pattern, name + 1));
    }
    return *name ? (*pattern == '?' || *pattern == *name) && means(pattern + 1, name + 1)
                 : *pattern == '\0';
}

static void check_pattern(const char *pattern, const char *line, size_t size)
{
    char name[WORD];
    size_t stars = 0;

    snprintf(name, sizeof name, "%.*s", (int)(size < WORD ? size : WORD - 1), line);
    for (const char *at = pattern; *at; at++) {
        stars += *at == '*';
    }
    /* the other way takes exponential time */
    fuzz_require(stars > 4 || control_matches(pattern, name) == means(pattern, name), "%s, %s",
                 pattern, name);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const char *at = (const char *)data, *end = at + size;
    char pattern[WORD] = "";

    for (uint64_t number = 1; at < end; number++) {
        const char *newline = memchr(at, '\n', (size_t)(end - at));
        size_t length = (size_t)((newline ? newline : end) - at);

        if (number == 1) {
            snprintf(pattern, sizeof pattern, "%.*s", (int)(length < WORD ? length : WORD - 1), at);
        }
        read_line(at, length, number);
        check_pattern(pattern, at, length);
        at += length + 1;
    }
    return 0;
}
