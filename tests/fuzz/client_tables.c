/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Tables of the client: whatever stands in a DBC file, it is refused with file and line, or every
 * signal of it lies within its message and what is put into a frame is found in it again.
 */
#include "client/coman_hil_client.c"

#include "tests/fuzz/fuzz.h"

/* Puts each end of a signal's range into a frame and reads it there. */
static void check_signal(const struct signal *signal)
{
    struct message *message = signal->message;
    const uint64_t all = UINT64_MAX >> (64 - signal->bits);
    int64_t count;

    fuzz_require(signal->bits >= 1 && signal->bits <= 64 && signal->end <= message->length,
                 "%s: %u bits, %u bytes", signal->name, signal->bits, signal->end);
    fuzz_require(isfinite(signal->scale) && isfinite(signal->offset), "%s", signal->name);
    memset(message->data, 0, sizeof message->data);
    message->heard = message->length;
    message->time_ns = 0;
    for (int i = 0; i < 2; i++) {
        signal_put(signal, message->data, i ? all : 0);
        if (signal->selector < 0 || message->data[0] == signal->selector) {
            fuzz_require(signal_get(signal, &count) && ((uint64_t)count & all) == (i ? all : 0),
                         "%s: %" PRId64, signal->name, count);
        }
    }
    signal_value_si(signal);
    signal_quantity(signal);
    fuzz_require(signal_encode(signal, 1e300, signal->scale, signal->offset) <= UINT64_MAX, "%s",
                 signal->name);
}

static void check_joint(struct hil_client *client, int joint)
{
    struct hil_client_joint state;

    joint_resolve(client->core, &client->core->joint[joint]);
    fuzz_require(hil_client_read(client, joint, &state) == HIL_CLIENT_OK, "joint %d", joint);
    fuzz_require(hil_client_find_joint(client, hil_client_joint_name(client, joint)) <= joint,
                 "joint %d", joint);
    for (int k = HIL_CLIENT_VOLTAGE; k < HIL_CLIENT_QUANTITIES; k++) {
        if (client->core->joint[joint].set_point[k].signal) {
            client->core->joint[joint].quantity = (enum hil_client_quantity)k;
            joint_set_point_bits(&client->core->joint[joint]);
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct hil_client client = {.core = calloc(1, sizeof *client.core)};
    enum hil_client_code code;

    fuzz_require(client.core, "no memory");
    client.core->gateway = -1;
    fuzz_write_file("a.dbc", data, size);
    code = tables_open(&client, fuzz_folder(), NULL);
    if (code) {
        fuzz_require(fuzz_is_sentence(client.message) && code == HIL_CLIENT_TABLES, "%s",
                     client.message);
        fuzz_tally.refused++;
    } else {
        fuzz_tally.taken++;
        for (size_t i = 0; i < client.core->nsignal; i++) {
            check_signal(&client.core->signal[i]);
        }
        for (size_t i = 0; i < client.core->njoint; i++) {
            check_joint(&client, (int)i);
        }
        for (size_t i = 0; i < client.core->nsensor; i++) {
            sensor_resolve(client.core, &client.core->sensor[i]);
        }
    }
    hil_client_close(&client);
    return 0;
}
