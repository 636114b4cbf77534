/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The client table: whatever stands in it, it is refused with file and line, or every number of it
 * lies within its frame and what is put into a frame is found in it again.
 */
#include "client/coman_hil_client.c"

#include "tests/fuzz/fuzz.h"

#include <limits.h>

/* Puts each end of a field's range into a frame and reads it there. */
static void check_field(const struct field *field)
{
    struct message *message = field->message;
    const uint64_t all = UINT64_MAX >> (64 - field->bits);
    int64_t count;

    fuzz_require(field->bits >= 1 && field->bits <= 64 && field->end <= IMAGE_SIZE, "%u bits, %u",
                 field->bits, field->end);
    memset(message->data, 0, sizeof message->data);
    message->heard = IMAGE_SIZE;
    message->time_ns = 0;
    for (int i = 0; i < 2; i++) {
        field_put(field, message->data, i ? all : 0);
        fuzz_require(field_get(field, &count) && ((uint64_t)count & all) == (i ? all : 0),
                     "%" PRId64, count);
    }
    field_value(field);
    field_encode(field, 1e300);
}

static void check_joint(struct hil_client *client, int joint)
{
    struct hil_client_joint state;

    fuzz_require(hil_client_read(client, joint, &state) == HIL_CLIENT_OK, "joint %d", joint);
    fuzz_require(hil_client_find_joint(client, hil_client_joint_name(client, joint)) <= joint,
                 "joint %d", joint);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct hil_client client = {.core = calloc(1, sizeof *client.core)};
    struct hil_client_wrench wrench;
    enum hil_client_code code;
    char path[PATH_MAX];

    fuzz_require(client.core, "no memory");
    client.core->gateway = -1;
    fuzz_write_file("a.joints", data, size);
    snprintf(path, sizeof path, "%s/a.joints", fuzz_folder());
    code = table_read_file(&client, path);
    if (code) {
        fuzz_require(fuzz_is_sentence(client.message) && code == HIL_CLIENT_TABLES, "%s",
                     client.message);
        fuzz_tally.refused++;
    } else {
        fuzz_tally.taken++;
        for (size_t i = 0; i < client.core->nsignal; i++) {
            check_field(&client.core->signal[i].field);
        }
        for (size_t i = 0; i < client.core->nrow; i++) {
            if (client.core->row[i].kind == SET || client.core->row[i].kind == VALUE) {
                check_field(&client.core->row[i].field);
            }
        }
        for (size_t i = 0; i < client.core->njoint; i++) {
            check_joint(&client, (int)i);
        }
        for (size_t i = 0; i < client.core->nsensor; i++) {
            hil_client_read_wrench(&client, (int)i, &wrench);
        }
    }
    hil_client_close(&client);
    return 0;
}
