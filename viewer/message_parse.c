/* SPDX-License-Identifier: Apache-2.0 */
/* Parses messages of clients: JSON, checked key by key. */
#include "viewer/message.h"

#include "base/array.h"
#include "viewer/viewer.h"

#include <ctype.h>
#include <math.h>
#include <string.h>

/* ---- keys ---- */

/* Refuses keys that the command does not have. */
static enum error_code message_check_keys(const json_t *root, const char *command,
                                          const char *const *known, size_t count,
                                          struct error *error)
{
    const char *name;
    json_t *value;

    json_object_foreach((json_t *)(uintptr_t)root, name, value)
    {
        bool found = strcmp(name, "id") == 0 || strcmp(name, "cmd") == 0;

        for (size_t i = 0; i < count && !found; i++) {
            found = strcmp(name, known[i]) == 0;
        }
        if (!found) {
            return error_set(error, ERROR_INPUT, "%s: found unknown key \"%.60s\"", command, name);
        }
    }
    return ERROR_NONE;
}

/* Reads a key that is true or false; false if it is missing. */
static enum error_code message_read_switch(const json_t *root, const char *command, const char *key,
                                           bool *to, struct error *error)
{
    const json_t *value = json_object_get(root, key);

    if (value && !json_is_boolean(value)) {
        return error_set(error, ERROR_INPUT, "%s: key \"%s\": expected true or false", command,
                         key);
    }
    *to = json_is_true(value);
    return ERROR_NONE;
}

/* ---- commands ---- */

/* Reads an enter: token, stay. */
static enum error_code message_read_enter(struct viewer_message *message, struct error *error)
{
    static const char *const known[] = {"token", "stay"};
    enum error_code code =
        message_read_switch(message->root, "enter", "stay", &message->stay, error);

    if (code) {
        return code;
    }
    message->token = json_string_value(json_object_get(message->root, "token"));
    if (!message->token) {
        return error_set(error, ERROR_INPUT, "enter: expected key \"token\" with a string");
    }
    return message_check_keys(message->root, "enter", known, ARRAY_COUNT(known), error);
}

/* Checks that the signals are an array of names, or missing. */
static enum error_code message_read_signals(const struct viewer_message *message,
                                            const char *command, struct error *error)
{
    for (size_t i = 0; i < json_array_size(message->signals); i++) {
        if (!json_is_string(json_array_get(message->signals, i))) {
            return error_set(error, ERROR_INPUT, "%s: key \"signals\": expected names", command);
        }
    }
    if (message->signals && !json_is_array(message->signals)) {
        return error_set(error, ERROR_INPUT, "%s: key \"signals\": expected an array", command);
    }
    return ERROR_NONE;
}

/* Reads a watch: rate, signals, trace, rows. */
static enum error_code message_read_watch(struct viewer_message *message, struct error *error)
{
    static const char *const known[] = {"rate_hz", "signals", "trace", "rows"};
    const json_t *rate = json_object_get(message->root, "rate_hz");
    enum error_code code =
        message_check_keys(message->root, "watch", known, ARRAY_COUNT(known), error);

    message->rate_hz = json_number_value(rate);
    message->signals = json_object_get(message->root, "signals");
    code =
        code ? code : message_read_switch(message->root, "watch", "trace", &message->trace, error);
    code = code ? code : message_read_switch(message->root, "watch", "rows", &message->rows, error);
    if (code) {
        return code;
    }
    if (!json_is_number(rate) || !(message->rate_hz >= 0 && message->rate_hz <= VIEWER_RATE_HZ)) {
        return error_set(error, ERROR_INPUT, "watch: key \"rate_hz\": expected a number, 0 to %d",
                         VIEWER_RATE_HZ);
    }
    return message_read_signals(message, "watch", error);
}

/* ---- of a recording ---- */

/* Reads a time in seconds. */
static enum error_code message_read_time(const json_t *root, const char *command, const char *key,
                                         double *to, struct error *error)
{
    const json_t *value = json_object_get(root, key);

    *to = json_number_value(value);
    if (!json_is_number(value) || !(fabs(*to) <= VIEWER_TIME_S)) {
        return error_set(error, ERROR_INPUT, "%s: key \"%s\": expected seconds", command, key);
    }
    return ERROR_NONE;
}

/* Reads a seek: the time to show. */
static enum error_code message_read_seek(struct viewer_message *message, struct error *error)
{
    static const char *const known[] = {"time_s"};
    enum error_code code =
        message_check_keys(message->root, "seek", known, ARRAY_COUNT(known), error);

    return code ? code
                : message_read_time(message->root, "seek", "time_s", &message->from_s, error);
}

/* Reads a series: signals, span of time, points, and an id of 32 bits, which the binary answer
 * carries. */
static enum error_code message_read_series(struct viewer_message *message, struct error *error)
{
    static const char *const known[] = {"signals", "from_s", "to_s", "points"};
    const json_t *points = json_object_get(message->root, "points");
    enum error_code code =
        message_check_keys(message->root, "series", known, ARRAY_COUNT(known), error);

    if (code ||
        (code = message_read_time(message->root, "series", "from_s", &message->from_s, error)) ||
        (code = message_read_time(message->root, "series", "to_s", &message->to_s, error))) {
        return code;
    }
    message->points = json_integer_value(points);
    if (!json_is_integer(points) || message->points < 2 || message->points > VIEWER_POINTS) {
        return error_set(error, ERROR_INPUT,
                         "series: key \"points\": expected a whole number, 2 to %d", VIEWER_POINTS);
    }
    if (!json_is_integer(message->id) || json_integer_value(message->id) < 0 ||
        json_integer_value(message->id) > UINT32_MAX) {
        return error_set(error, ERROR_INPUT,
                         "series: key \"id\": expected a whole number, 0 to 4294967295");
    }
    message->signals = json_object_get(message->root, "signals");
    return message_read_signals(message, "series", error);
}

/* Reads data bytes, two hexadecimal digits each, with blanks allowed between bytes; false =
 * something else, or more than a frame holds. */
static bool message_read_bytes(const char *text, struct bus_frame *frame)
{
    static const char digits[] = "0123456789abcdef";

    for (const char *at = text; *at;) {
        const char *high = *at == ' ' ? NULL : strchr(digits, tolower((unsigned char)*at));
        const char *low = high && at[1] ? strchr(digits, tolower((unsigned char)at[1])) : NULL;

        if (*at == ' ') {
            at++;
            continue;
        }
        if (!high || !low || frame->len == sizeof frame->data) {
            return false;
        }
        frame->data[frame->len++] = (uint8_t)((high - digits) << 4 | (low - digits));
        at += 2;
    }
    return true;
}

/* Reads a send: bus, identifier, format and data of a frame. */
static enum error_code message_read_send(struct viewer_message *message, struct error *error)
{
    static const char *const known[] = {"bus", "frame_id", "extended", "fd", "brs", "data"};
    const json_t *number = json_object_get(message->root, "frame_id");
    const char *data = json_string_value(json_object_get(message->root, "data"));
    double id = json_number_value(number);
    bool extended = false, fd = false, brs = false;
    enum error_code code =
        message_check_keys(message->root, "send", known, ARRAY_COUNT(known), error);

    if (code || (code = message_read_switch(message->root, "send", "extended", &extended, error)) ||
        (code = message_read_switch(message->root, "send", "fd", &fd, error)) ||
        (code = message_read_switch(message->root, "send", "brs", &brs, error))) {
        return code;
    }

    /* The frame */
    message->bus = json_string_value(json_object_get(message->root, "bus"));
    if (!message->bus) {
        return error_set(error, ERROR_INPUT, "send: expected key \"bus\" with a name");
    }
    if (!json_is_number(number) || !(id >= 0 && id <= 0x1fffffff) || id != floor(id)) {
        return error_set(error, ERROR_INPUT,
                         "send: key \"frame_id\": expected a whole number, 0 to %d",
                         extended ? 0x1fffffff : 0x7ff);
    }
    message->frame = (struct bus_frame){
        .id = (uint32_t)id,
        .flags = (uint8_t)((extended ? FRAME_EXTENDED : 0) | (fd ? FRAME_FD : 0) |
                           (brs ? FRAME_BRS : 0)),
    };
    if (!data || !message_read_bytes(data, &message->frame)) {
        return error_set(error, ERROR_INPUT,
                         "send: key \"data\": expected two hexadecimal digits a byte, at most %d "
                         "bytes",
                         fd ? 64 : 8);
    }
    if (fd) {
        message->frame.len = frame_fd_length(message->frame.len);
    }
    if (!frame_valid(&message->frame)) {
        return error_set(error, ERROR_INPUT,
                         "send: found no frame that a bus could carry: identifiers have 11 bits, "
                         "29 when extended, and classic frames 8 bytes");
    }
    return ERROR_NONE;
}

/* Checks whether a command only reads, so that clients that may only look can send it. */
static bool control_is_harmless(enum control_command command)
{
    return command == CONTROL_HELLO || command == CONTROL_STATUS || command == CONTROL_STATISTICS ||
           command == CONTROL_LIST || command == CONTROL_GET;
}

/* Parses a request for the control socket by the rules of that socket. */
static enum error_code message_read_control(const char *text, size_t size,
                                            struct viewer_message *message, struct error *error)
{
    struct control_request request;
    enum error_code code = control_parse(text, size, 1, &request, error);

    message->harmless = !code && control_is_harmless(request.command);
    message->control = request.command;
    message->value = request.value;
    message->count = request.count;
    control_request_clear(&request);
    return code;
}

enum error_code viewer_message_parse(const char *text, size_t size, struct viewer_message *message,
                                     struct error *error)
{
    const char *command;

    *message = (struct viewer_message){.command = VIEWER_CONTROL};

    /* The text will be a line of the control socket: it must not contain an end of line */
    if (memchr(text, '\n', size) || memchr(text, '\r', size)) {
        return error_set(error, ERROR_INPUT, "found an end of line, expected JSON in one line");
    }
    message->root = json_loadb(text, size, JSON_REJECT_DUPLICATES, NULL);
    command = json_string_value(json_object_get(message->root, "cmd"));
    if (json_is_number(json_object_get(message->root, "id")) ||
        json_string_length(json_object_get(message->root, "id")) > 0) {
        message->id = json_object_get(message->root, "id");
    }
    if (command && strcmp(command, "enter") == 0) {
        message->command = VIEWER_ENTER;
        return message_read_enter(message, error);
    }
    if (command && strcmp(command, "watch") == 0) {
        message->command = VIEWER_WATCH;
        return message_read_watch(message, error);
    }
    if (command && strcmp(command, "send") == 0) {
        message->command = VIEWER_SEND;
        return message_read_send(message, error);
    }
    if (command && strcmp(command, "seek") == 0) {
        message->command = VIEWER_SEEK;
        return message_read_seek(message, error);
    }
    if (command && strcmp(command, "series") == 0) {
        message->command = VIEWER_SERIES;
        return message_read_series(message, error);
    }
    return message_read_control(text, size, message, error);
}

void viewer_message_clear(struct viewer_message *message)
{
    json_decref(message->root);
    *message = (struct viewer_message){.root = NULL};
}
