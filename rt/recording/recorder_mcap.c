/* SPDX-License-Identifier: Apache-2.0 */
/* Writes a recording's messages as JSON into the MCAP file. */
#include "rt/recording/recorder_mcap.h"

#include "base/json_text.h"
#include "rt/clock.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

/* JSON Schemas of the channels. The foxglove.* schemas describe only the fields that the recorder
 * writes. */
/* clang-format off */
#define OBJECT(properties) "{\"type\":\"object\",\"properties\":{" properties "}}"
#define LIST(items) "{\"type\":\"array\",\"items\":" items "}"
#define KEY(name, type) "\"" name "\":" type
#define NUMBER "{\"type\":\"number\"}"
#define COUNT "{\"type\":\"integer\",\"minimum\":0}"
#define TEXT "{\"type\":\"string\"}"
#define TRUTH "{\"type\":\"boolean\"}"
#define EMPTY LIST("{\"type\":\"object\"}")

#define TIME OBJECT(KEY("sec", COUNT) "," KEY("nsec", COUNT))
#define VECTOR OBJECT(KEY("x", NUMBER) "," KEY("y", NUMBER) "," KEY("z", NUMBER))
#define QUATERNION \
    OBJECT(KEY("x", NUMBER) "," KEY("y", NUMBER) "," KEY("z", NUMBER) "," KEY("w", NUMBER))
#define COLOR \
    OBJECT(KEY("r", NUMBER) "," KEY("g", NUMBER) "," KEY("b", NUMBER) "," KEY("a", NUMBER))
#define POSE OBJECT(KEY("position", VECTOR) "," KEY("orientation", QUATERNION))

#define SOLID KEY("pose", POSE) "," KEY("size", VECTOR) "," KEY("color", COLOR)
#define ARROW \
    KEY("pose", POSE) "," KEY("shaft_length", NUMBER) "," KEY("shaft_diameter", NUMBER) "," \
    KEY("head_length", NUMBER) "," KEY("head_diameter", NUMBER) "," KEY("color", COLOR)
#define CYLINDER SOLID "," KEY("bottom_scale", NUMBER) "," KEY("top_scale", NUMBER)
#define TRIANGLES \
    KEY("pose", POSE) "," KEY("points", LIST(VECTOR)) "," KEY("color", COLOR) "," \
    KEY("colors", LIST(COLOR)) "," KEY("indices", LIST(COUNT))

static const char schema_frame[] = OBJECT(
    KEY("timestamp", TIME) "," KEY("bus", TEXT) "," KEY("id", COUNT) "," KEY("extended", TRUTH) ","
    KEY("fd", TRUTH) "," KEY("remote", TRUTH) "," KEY("error", TRUTH) "," KEY("length", COUNT) ","
    KEY("data", TEXT));

static const char schema_log[] = OBJECT(
    KEY("timestamp", TIME) "," KEY("level", COUNT) "," KEY("message", TEXT) "," KEY("name", TEXT)
    "," KEY("file", TEXT) "," KEY("line", COUNT));

static const char schema_transforms[] = OBJECT(KEY("transforms", LIST(OBJECT(
    KEY("timestamp", TIME) "," KEY("parent_frame_id", TEXT) "," KEY("child_frame_id", TEXT) ","
    KEY("translation", VECTOR) "," KEY("rotation", QUATERNION)))));

const char recorder_schema_scene[] = OBJECT(
    KEY("deletions", EMPTY) "," KEY("entities", LIST(OBJECT(
    KEY("timestamp", TIME) "," KEY("frame_id", TEXT) "," KEY("id", TEXT) "," KEY("lifetime", TIME)
    "," KEY("frame_locked", TRUTH) "," KEY("metadata", EMPTY) ","
    KEY("arrows", LIST(OBJECT(ARROW))) "," KEY("cubes", LIST(OBJECT(SOLID))) ","
    KEY("spheres", LIST(OBJECT(SOLID))) "," KEY("cylinders", LIST(OBJECT(CYLINDER))) ","
    KEY("triangles", LIST(OBJECT(TRIANGLES))) ","
    KEY("lines", EMPTY) "," KEY("texts", EMPTY) "," KEY("models", EMPTY)))));
/* clang-format on */

enum {
    STAMP_SIZE = 96,  /* "timestamp":{...}, with its comma */
    POSE_SIZE = 256,  /* numbers and keys of a transform */
    FRAME_SIZE = 512, /* a message without the name of its bus */
    TOPIC_SIZE = 64,  /* "/can/" and a name */
    KEY_PART = 3,     /* quotes and colon */
    SCHEMA_PART = 24, /* {"type":"number"} and punctuation of one signal in its schema */
    CHUNK_AGE_NS = 1000000000,
};

/* Levels of foxglove.Log, by journal priority. */
static const int log_levels[] = {
    [JOURNAL_ERROR] = 4, [JOURNAL_WARNING] = 3, [JOURNAL_NOTICE] = 2, [JOURNAL_INFO] = 2};

struct recorder_mcap {
    const struct recorder_config *config;
    struct mcap *mcap;
    const char **key;  /* "NAME": for each signal */
    const char **body; /* "NAME" for each body */
    const char **bus;
    uint16_t signals, events, transforms; /* channels; 0 = none */
    uint16_t *frames;                     /* channel of each bus */
    uint16_t *channels;                   /* one per channel of the configuration */
    int64_t flushed_ns;                   /* wall time at the end of the last chunk */
};

/* ---- pieces of messages ---- */

/* Writes a time stamp in seconds and nanoseconds. Returns the end. */
static char *mcap_print_stamp(char *at, int64_t time_ns)
{
    return at + sprintf(at, "\"timestamp\":{\"sec\":%" PRId64 ",\"nsec\":%" PRId64 "}",
                        time_ns / CLOCK_SECOND, time_ns % CLOCK_SECOND);
}

/* Writes a number with enough digits to read back bit for bit. Writes null for a number that is not
 * finite, which JSON cannot express. */
static char *mcap_print_number(char *at, double value)
{
    return at + (isfinite(value) ? sprintf(at, "%.17g", value) : sprintf(at, "null"));
}

/* Writes text without quoting. Returns the end. */
static char *mcap_print_text(char *at, const char *text)
{
    size_t size = strlen(text);

    memcpy(at, text, size);
    return at + size;
}

/* Ends the message between `begin` and `end`. */
static void mcap_hand_over(struct recorder_mcap *mcap, uint16_t channel, int64_t time_ns,
                           const char *begin, const char *end)
{
    mcap_end_message(mcap->mcap, channel, time_ns, (size_t)(end - begin));
}

/* ---- messages ---- */

void recorder_mcap_frame(struct recorder_mcap *mcap, const struct frame_item *item)
{
    const struct bus_frame *frame = &item->frame;
    char *begin = mcap_begin_message(mcap->mcap), *at = begin;

    *at++ = '{';
    at = mcap_print_stamp(at, frame->time_ns);
    at += sprintf(at,
                  ",\"bus\":%s,\"id\":%" PRIu32 ",\"extended\":%s,\"fd\":%s,\"remote\":%s,"
                  "\"error\":%s,\"length\":%d,\"data\":\"",
                  mcap->bus[item->bus], frame->id, frame->flags & FRAME_EXTENDED ? "true" : "false",
                  frame->flags & FRAME_FD ? "true" : "false",
                  frame->flags & FRAME_REMOTE ? "true" : "false",
                  frame->flags & FRAME_ERROR ? "true" : "false", frame->len);
    for (int i = 0; i < frame->len && !(frame->flags & FRAME_REMOTE); i++) {
        at += sprintf(at, "%02X", frame->data[i]);
    }
    at = mcap_print_text(at, "\"}");
    mcap_hand_over(mcap, mcap->frames[item->bus], frame->time_ns, begin, at);
}

/* Writes the transform from a body to the world. pose: position (m), quaternion (wxyz). */
static char *mcap_print_transform(const struct recorder_mcap *mcap, char *at, int64_t time_ns,
                                  size_t body, const double *pose)
{
    static const char *const key[RECORDER_POSE] = {",\"translation\":{\"x\":",
                                                   ",\"y\":",
                                                   ",\"z\":",
                                                   "},\"rotation\":{\"w\":",
                                                   ",\"x\":",
                                                   ",\"y\":",
                                                   ",\"z\":"};

    *at++ = body ? ',' : '[';
    *at++ = '{';
    at = mcap_print_stamp(at, time_ns);
    at = mcap_print_text(at, ",\"parent_frame_id\":\"world\",\"child_frame_id\":");
    at = mcap_print_text(at, mcap->body[body]);
    for (int i = 0; i < RECORDER_POSE; i++) {
        at = mcap_print_number(mcap_print_text(at, key[i]), pose[i]);
    }
    return mcap_print_text(at, "}}");
}

void recorder_mcap_row(struct recorder_mcap *mcap, const double *row)
{
    const struct recorder_config *config = mcap->config;
    int64_t time_ns = (int64_t)row[0];
    const double *pose = row + 1 + config->nsignal;
    char *begin, *at;

    if (mcap->signals) {
        begin = at = mcap_begin_message(mcap->mcap);
        for (size_t i = 0; i < config->nsignal; i++) {
            *at++ = i ? ',' : '{';
            at = mcap_print_number(mcap_print_text(at, mcap->key[i]), row[1 + i]);
        }
        *at++ = '}';
        mcap_hand_over(mcap, mcap->signals, time_ns, begin, at);
    }
    if (mcap->transforms) {
        begin = mcap_begin_message(mcap->mcap);
        at = mcap_print_text(begin, "{\"transforms\":");
        for (size_t b = 0; b < config->nbody; b++) {
            at = mcap_print_transform(mcap, at, time_ns, b, pose + RECORDER_POSE * b);
        }
        at = mcap_print_text(at, "]}");
        mcap_hand_over(mcap, mcap->transforms, time_ns, begin, at);
    }
    for (size_t c = 0; c < config->nchannel; c++) {
        const struct recorder_channel *channel = &config->channel[c];

        begin = channel->print ? mcap_begin_message(mcap->mcap) : NULL;
        at = begin ? channel->print(channel->context, time_ns, row + 1, pose, begin) : NULL;
        if (at != begin) {
            mcap_hand_over(mcap, mcap->channels[c], time_ns, begin, at);
        }
    }
}

void recorder_mcap_event(struct recorder_mcap *mcap, const struct event_item *item)
{
    char *begin = mcap_begin_message(mcap->mcap), *at = begin;

    *at++ = '{';
    at = mcap_print_stamp(at, item->time_ns);
    at += sprintf(at, ",\"level\":%d,\"message\":", log_levels[item->priority]);
    at += json_text_quote(item->text, at);
    at = mcap_print_text(at, ",\"name\":\"coman-hil\",\"file\":\"\",\"line\":0}");
    mcap_hand_over(mcap, mcap->events, item->time_ns, begin, at);
}

/* ---- making it ---- */

/* Quotes each name and appends suffix; NULL = out of memory. Adds the lengths to *longest. */
static const char **mcap_quote_names(const char *const *name, size_t count, const char *suffix,
                                     struct arena *arena, size_t *longest)
{
    const char **quoted = arena_alloc(arena, count + 1, sizeof *quoted);

    for (size_t i = 0; quoted && i < count; i++) {
        char *text = arena_alloc(arena, JSON_TEXT_ROOM(strlen(name[i])) + strlen(suffix), 1);

        if (!text) {
            return NULL;
        }
        strcpy(text + json_text_quote(name[i], text), suffix);
        quoted[i] = text;
        *longest += strlen(text);
    }
    return quoted;
}

/* Returns the schema of the signals, {"type":"object","properties":{"NAME":{"type":"number"},...}};
 * NULL = out of memory. */
static const char *mcap_make_signal_schema(const struct recorder_mcap *mcap, struct arena *arena)
{
    size_t size = STAMP_SIZE;
    char *text, *at;

    for (size_t i = 0; i < mcap->config->nsignal; i++) {
        size += strlen(mcap->key[i]) + SCHEMA_PART;
    }
    text = arena_alloc(arena, size, 1);
    if (!text) {
        return NULL;
    }
    at = mcap_print_text(text, "{\"type\":\"object\",\"properties\":{");
    for (size_t i = 0; i < mcap->config->nsignal; i++) {
        at = mcap_print_text(mcap_print_text(at, i ? "," : ""), mcap->key[i]);
        at = mcap_print_text(at, "{\"type\":\"number\"}");
    }
    mcap_print_text(at, "}}");
    return text;
}

/* Adds the channels of this recording and their schemas; false = out of memory. */
static bool recorder_mcap_add_channels(struct recorder_mcap *mcap, struct arena *arena)
{
    const struct recorder_config *config = mcap->config;
    const char *signals = mcap_make_signal_schema(mcap, arena);
    struct mcap *to = mcap->mcap;
    uint16_t frame = mcap_add_schema(to, "coman_hil.Frame", schema_frame), schema = 0;

    if (!signals) {
        return false;
    }
    /* Signals, events and poses */
    if (config->nsignal) {
        mcap->signals =
            mcap_add_channel(to, mcap_add_schema(to, "coman_hil.Signals", signals), "/signals");
    }
    mcap->events = mcap_add_channel(to, mcap_add_schema(to, "foxglove.Log", schema_log), "/events");
    if (config->nbody) {
        mcap->transforms = mcap_add_channel(
            to, mcap_add_schema(to, "foxglove.FrameTransforms", schema_transforms), "/transforms");
    }
    /* Channels of the configuration; neighbors of one type share its schema */
    for (size_t c = 0; c < config->nchannel; c++) {
        const struct recorder_channel *channel = &config->channel[c];

        if (c == 0 || channel->schema != channel[-1].schema) {
            schema = mcap_add_schema(to, channel->type, channel->schema);
        }
        mcap->channels[c] = mcap_add_channel(to, schema, channel->topic);
        if (!mcap->channels[c]) {
            return false;
        }
    }
    /* A channel for each bus */
    for (size_t b = 0; b < config->nbus; b++) {
        char *topic = arena_alloc(arena, TOPIC_SIZE, 1);

        if (!topic) {
            return false;
        }
        snprintf(topic, TOPIC_SIZE, "/can/%s", config->bus[b]);
        mcap->frames[b] = mcap_add_channel(to, frame, topic);
        if (!mcap->frames[b]) {
            return false;
        }
    }
    return true;
}

static size_t longer_of(size_t a, size_t b)
{
    return a > b ? a : b;
}

/* Quotes the names. Returns the length of the longest message in bytes; 0 = out of memory. */
static size_t recorder_mcap_quote(struct recorder_mcap *mcap, struct arena *arena)
{
    const struct recorder_config *config = mcap->config;
    size_t signals = STAMP_SIZE + config->nsignal * RECORDER_NUMBER;
    size_t poses = STAMP_SIZE + config->nbody * (STAMP_SIZE + POSE_SIZE + KEY_PART);
    size_t frames = FRAME_SIZE, events = STAMP_SIZE + FRAME_SIZE, longest;

    mcap->key = mcap_quote_names(config->signal, config->nsignal, ":", arena, &signals);
    mcap->body = mcap_quote_names(config->body, config->nbody, "", arena, &poses);
    mcap->bus = mcap_quote_names(config->bus, config->nbus, "", arena, &frames);
    mcap->frames = arena_alloc(arena, config->nbus + 1, sizeof *mcap->frames);
    mcap->channels = arena_alloc(arena, config->nchannel + 1, sizeof *mcap->channels);
    if (!mcap->key || !mcap->body || !mcap->bus || !mcap->frames || !mcap->channels) {
        return 0;
    }
    events += JSON_TEXT_ROOM(RECORDER_EVENT_TEXT);
    longest = longer_of(longer_of(signals, poses), longer_of(frames, events));
    for (size_t c = 0; c < config->nchannel; c++) {
        const struct recorder_channel *channel = &config->channel[c];

        longest = longer_of(longest, channel->longest);
        longest = longer_of(longest, channel->first ? strlen(channel->first) : 0);
    }
    return longest;
}

enum error_code recorder_mcap_create(const struct recorder_config *config,
                                     void (*put)(void *context, const void *bytes, size_t size),
                                     void *context, struct arena *arena,
                                     struct recorder_mcap **mcap, struct error *error)
{
    struct recorder_mcap *made = arena_alloc(arena, 1, sizeof *made);
    struct mcap_config file = {.library = "coman-hil " HIL_VERSION, .put = put, .context = context};
    enum error_code code = ERROR_MEMORY;

    if (made) {
        made->config = config;
        file.longest = recorder_mcap_quote(made, arena);
    }
    if (file.longest && mcap_create(&file, arena, &made->mcap, error) == ERROR_NONE) {
        code = recorder_mcap_add_channels(made, arena) && !mcap_prepare(made->mcap, arena)
                   ? ERROR_NONE
                   : ERROR_MEMORY;
    }
    if (code) {
        recorder_mcap_destroy(made);
        return error_set(error, code, "no memory left for the MCAP file");
    }
    *mcap = made;
    return ERROR_NONE;
}

size_t recorder_mcap_longest(const struct recorder_mcap *mcap)
{
    return mcap_longest_piece(mcap->mcap);
}

/* ---- the file ---- */

void recorder_mcap_start(struct recorder_mcap *mcap)
{
    mcap_start(mcap->mcap);
    for (size_t c = 0; c < mcap->config->nchannel; c++) {
        const char *first = mcap->config->channel[c].first;

        if (first) {
            char *begin = mcap_begin_message(mcap->mcap);

            mcap_hand_over(mcap, mcap->channels[c], 0, begin, mcap_print_text(begin, first));
        }
    }
}

void recorder_mcap_tend(struct recorder_mcap *mcap, int64_t now_ns)
{
    if (now_ns - mcap->flushed_ns >= CHUNK_AGE_NS) {
        mcap->flushed_ns = now_ns;
        mcap_flush(mcap->mcap);
    }
}

void recorder_mcap_finish(struct recorder_mcap *mcap)
{
    mcap_finish(mcap->mcap);
}

void recorder_mcap_destroy(struct recorder_mcap *mcap)
{
    if (mcap) {
        mcap_destroy(mcap->mcap);
    }
}
