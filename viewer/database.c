/* SPDX-License-Identifier: Apache-2.0 */
/* Describes the meaning of the frames of each bus as JSON, from its DBC database (rig/dbc.h). */
#include "viewer/private.h"

#include "rig/dbc.h"

#define MEMORY ((size_t)64 << 20) /* reserved address space */

/* Lists the names of a signal's values, by number. */
static json_t *database_values(const struct dbc_signal *signal)
{
    json_t *values = json_object();

    for (const struct dbc_value *value = signal->value; value; value = value->next) {
        char key[24];

        snprintf(key, sizeof key, "%lld", (long long)value->number);
        json_object_set_new(values, key, json_string(value->text));
    }
    return values;
}

/* Describes a signal; omits default values. */
static json_t *database_signal(const struct dbc_signal *signal)
{
    json_t *object = json_pack("{s:s, s:i, s:i}", "name", signal->name, "start", (int)signal->start,
                               "bits", (int)signal->bits);

    if (signal->big_endian) {
        json_object_set_new(object, "big_endian", json_true());
    }
    if (signal->type != DBC_UNSIGNED) {
        json_object_set_new(object, "type",
                            json_string(signal->type == DBC_SIGNED ? "signed" : "float"));
    }
    if (signal->scale != 1.0 || signal->offset != 0.0) {
        json_object_set_new(object, "scale", control_number(signal->scale));
        json_object_set_new(object, "offset", control_number(signal->offset));
    }
    if (signal->unit && signal->unit[0]) {
        json_object_set_new(object, "unit", json_string(signal->unit));
    }
    if (signal->role == DBC_MULTIPLEXOR) {
        json_object_set_new(object, "multiplexor", json_true());
    }
    if (signal->role == DBC_MULTIPLEXED) {
        json_object_set_new(object, "selector", json_integer(signal->selector));
    }
    if (signal->value) {
        json_object_set_new(object, "values", database_values(signal));
    }
    return object;
}

/* Describes the messages of a bus with their signals. */
static json_t *database_bus(const struct dbc *dbc)
{
    json_t *messages = json_array();

    for (const struct dbc_message *message = dbc->message; message; message = message->next) {
        json_t *signals = json_array();

        for (const struct dbc_signal *signal = message->signal; signal; signal = signal->next) {
            json_array_append_new(signals, database_signal(signal));
        }
        json_array_append_new(
            messages,
            json_pack("{s:s, s:I, s:I, s:i, s:b, s:b, s:s, s:o}", "name", message->name, "id",
                      (json_int_t)(message->id & ~DBC_EXTENDED), "mask",
                      (json_int_t)message->id_mask, "length", (int)message->length, "extended",
                      (message->id & DBC_EXTENDED) != 0, "fd", message->fd, "sender",
                      message->sender >= 0 ? dbc->node[message->sender].name : "", "signals",
                      signals));
    }
    return messages;
}

bool viewer_make_database(struct viewer *viewer)
{
    json_t *all = json_array();
    struct arena arena;
    struct error error;
    bool good = true;

    if (viewer->database) {
        json_decref(all);
        return true;
    }
    if (arena_init(&arena, MEMORY, &error)) {
        json_decref(all);
        return false;
    }
    for (size_t b = 0; b < viewer->rig->nbus && good; b++) {
        struct dbc *dbc;

        good = rig_dbc(viewer->rig, b, &arena, &dbc, &error) == ERROR_NONE &&
               json_array_append_new(all, database_bus(dbc)) == 0;
    }
    viewer->database = good ? json_dumps(all, JSON_COMPACT | JSON_REAL_PRECISION(12)) : NULL;
    viewer->database_size = viewer->database ? strlen(viewer->database) : 0;
    json_decref(all);
    arena_fini(&arena);
    return viewer->database;
}
