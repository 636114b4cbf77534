/* SPDX-License-Identifier: Apache-2.0 */
/* Parses messages of clients: JSON, checked key by key. */
#include "viewer/message.h"

#include "base/array.h"
#include "viewer/viewer.h"

#include <string.h>

#define OF(member) offsetof(struct viewer_message, member)

static const char *const commands[] = {
    [VIEWER_ENTER] = "enter", [VIEWER_WATCH] = "watch",   [VIEWER_SEND] = "send",
    [VIEWER_SEEK] = "seek",   [VIEWER_SERIES] = "series",
};

static const struct request_key keys[] = {
    {VIEWER_ENTER, "token", KEY_TEXT, true, OF(token), 0, 0},
    {VIEWER_ENTER, "stay", KEY_SWITCH, false, OF(stay), 0, 0},
    {VIEWER_WATCH, "rate_hz", KEY_REAL, true, OF(rate_hz), 0, VIEWER_RATE_HZ},
    {VIEWER_WATCH, "signals", KEY_NAMES, false, OF(signals), 0, CONTROL_PATTERNS_MAX},
    {VIEWER_WATCH, "trace", KEY_SWITCH, false, OF(trace), 0, 0},
    {VIEWER_WATCH, "rows", KEY_SWITCH, false, OF(rows), 0, 0},
    {VIEWER_SEND, "bus", KEY_TEXT, true, OF(bus), 0, 0},
    {VIEWER_SEND, "frame_id", KEY_WHOLE, true, OF(count), 0, 0x1fffffff},
    {VIEWER_SEND, "extended", KEY_SWITCH, false, OF(extended), 0, 0},
    {VIEWER_SEND, "fd", KEY_SWITCH, false, OF(fd), 0, 0},
    {VIEWER_SEND, "brs", KEY_SWITCH, false, OF(brs), 0, 0},
    {VIEWER_SEND, "data", KEY_TEXT, true, OF(data), 0, 0},
    {VIEWER_SEEK, "time_s", KEY_REAL, true, OF(from_s), -VIEWER_TIME_S, VIEWER_TIME_S},
    {VIEWER_SERIES, "signals", KEY_NAMES, false, OF(signals), 0, CONTROL_PATTERNS_MAX},
    {VIEWER_SERIES, "from_s", KEY_REAL, true, OF(from_s), -VIEWER_TIME_S, VIEWER_TIME_S},
    {VIEWER_SERIES, "to_s", KEY_REAL, true, OF(to_s), -VIEWER_TIME_S, VIEWER_TIME_S},
    {VIEWER_SERIES, "points", KEY_WHOLE, true, OF(points), 2, VIEWER_POINTS},
};

static const struct request_table messages = {commands, ARRAY_COUNT(commands), keys,
                                              ARRAY_COUNT(keys)};

/* Parses data bytes: two hexadecimal digits each, with optional blanks between bytes. Returns false
 * for other text, or for more bytes than a frame can hold. */
static bool message_read_bytes(const char *text, struct bus_frame *frame)
{
    for (const char *at = text; *at;) {
        const int high = hex_value(*at), low = high < 0 ? -1 : hex_value(at[1]);

        if (*at == ' ') {
            at++;
            continue;
        }
        if (low < 0 || frame->len == sizeof frame->data) {
            return false;
        }
        frame->data[frame->len++] = (uint8_t)(high << 4 | low);
        at += 2;
    }
    return true;
}

/* Makes the CAN frame of a `send` message: identifier, format and data. */
static enum error_code message_make_frame(struct viewer_message *message, struct error *error)
{
    struct bus_frame *frame = &message->frame;

    *frame = (struct bus_frame){
        .id = (uint32_t)message->count,
        .flags = (uint8_t)((message->extended ? FRAME_EXTENDED : 0) | (message->fd ? FRAME_FD : 0) |
                           (message->brs ? FRAME_BRS : 0)),
    };
    if (!message_read_bytes(message->data, frame)) {
        return error_set(error, ERROR_INPUT,
                         "send: key \"data\": expected two hexadecimal digits a byte, at most %d "
                         "bytes",
                         message->fd ? 64 : 8);
    }
    if (message->fd) {
        frame->len = frame_fd_length(frame->len);
    }
    return frame_valid(frame)
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "send: found no frame that a bus could carry: identifiers have 11 bits, "
                           "29 when extended, and classic frames 8 bytes");
}

enum error_code viewer_message_parse(const char *text, size_t size, struct viewer_message *message,
                                     struct error *error)
{
    enum error_code code;
    int command;

    *message = (struct viewer_message){.command = VIEWER_CONTROL};
    /* The control socket reads lines, so the text must not contain a line end */
    if (memchr(text, '\n', size) || memchr(text, '\r', size)) {
        return error_set(error, ERROR_INPUT, "found an end of line, expected JSON in one line");
    }
    message->root = json_loadb(text, size, JSON_REJECT_DUPLICATES, NULL);
    if (json_is_number(json_object_get(message->root, "id")) ||
        json_string_length(json_object_get(message->root, "id")) > 0) {
        message->id = json_object_get(message->root, "id");
    }
    command = request_find_command(&messages, message->root);
    if (command < 0) {
        struct control_request request;

        /* Parse a request for the control socket with the socket's parser */
        code = control_parse(text, size, 1, &request, error);

        /* Clients without the right to control can send commands that only read */
        message->harmless =
            !code && (request.command == CONTROL_HELLO || request.command == CONTROL_STATUS ||
                      request.command == CONTROL_STATISTICS || request.command == CONTROL_LIST ||
                      request.command == CONTROL_GET);
        message->control = request.command;
        message->value = request.value;
        message->count = request.count;
        control_request_clear(&request);
        return code;
    }
    message->command = (enum viewer_command)command;
    code = request_read_keys(&messages, command, message->root, message, error);
    /* The binary answer to `series` has 32 bits for the id */
    if (!code && command == VIEWER_SERIES &&
        (!json_is_integer(message->id) || json_integer_value(message->id) < 0 ||
         json_integer_value(message->id) > UINT32_MAX)) {
        return error_set(error, ERROR_INPUT,
                         "series: key \"id\": expected a whole number, 0 to 4294967295");
    }
    return !code && command == VIEWER_SEND ? message_make_frame(message, error) : code;
}

void viewer_message_clear(struct viewer_message *message)
{
    json_decref(message->root);
    *message = (struct viewer_message){.root = NULL};
}
