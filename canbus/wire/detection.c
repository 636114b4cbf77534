/* SPDX-License-Identifier: Apache-2.0 */
/* Finds where in a frame an error is detected, by whom, and how long the error flags of all
 * nodes overlap. The frame's bits are written out in wire->bits[0]; a position is the index of a
 * bit. */
#include "canbus/wire/private.h"

enum {
    FLAG = WIRE_ERROR_FLAG_BITS,
    STUFF_ERROR = 6, /* equal bits */
};

void wire_keep_earliest(struct wire_detection *kept, const struct wire_detection *other)
{
    if (other->after_ns < kept->after_ns) {
        *kept = *other;
    }
}

int64_t wire_time_of_bits(const struct wire *wire, const struct wire_bits *bits, size_t n)
{
    size_t end = n < bits->slow ? n : bits->slow;
    size_t fast = end > bits->fast ? end - bits->fast : 0;

    return wire_length_ns(
        (struct wire_length){.nominal = (uint16_t)(n - fast), .data = (uint16_t)fast},
        wire->config.bitrate, wire->config.data_bitrate);
}

bool wire_any_error_active(const struct wire *wire, uint64_t nodes)
{
    size_t index;

    WIRE_FOR_EACH(index, nodes)
    {
        if (!wire_is_passive(&wire->node[index])) {
            return true;
        }
    }
    return false;
}

/* ---- overlapping flags ---- */

/* Returns the length of the run of bits equal to `value` that ends at `at`, whose own bit is
 * read as `seen`; at most 6. */
static unsigned wire_run_of_bits(const struct wire_bits *bits, size_t at, unsigned seen,
                                 unsigned value)
{
    unsigned length = seen == value;

    while (length && length < STUFF_ERROR && length <= at && bits->bit[at - length] == value) {
        length++;
    }
    return length;
}

/* Returns the bits of all error flags together when a sender finds an error at a bit and sends
 * its flag: the others answer once they have read six equal bits, the first of which may belong
 * to the frame. */
static unsigned wire_flag_bits_by_sender(const struct wire *wire, const struct wire_bits *bits,
                                         size_t at, unsigned seen)
{
    const bool active = wire_any_error_active(wire, wire->flight.senders);
    const unsigned run = wire_run_of_bits(bits, at, seen, active ? 0 : 1);

    if (wire_run_of_bits(bits, at, seen, seen) == STUFF_ERROR) {
        /* A stuff bit was hit: all nodes find the error at once */
        return FLAG;
    }
    /* Without an error active receiver nobody answers; a passive flag ends only after six equal
     * bits */
    return active && !wire_any_error_active(wire, wire_listeners(wire)) ? FLAG : 2 * FLAG - run;
}

/* Returns the bits of all error flags together when a receiver finds an error at a bit: the
 * sender answers after the first recessive bit that it cannot send, the other receivers after
 * six dominant ones. Behind the ACK field all answer at once. */
static unsigned wire_flag_bits_by_receiver(const struct wire_bits *bits, size_t at)
{
    unsigned sender = 0, others;

    if (at >= bits->ack) {
        return FLAG + 1;
    }
    while (sender < FLAG && at + 1 + sender < bits->count && !bits->bit[at + 1 + sender]) {
        sender++;
    }
    others = FLAG - wire_run_of_bits(bits, at, bits->bit[at], 0);
    return FLAG + (sender + 1 > others ? sender + 1 : others);
}

/* ---- who finds what ---- */

struct wire_detection wire_detect_by_sender(const struct wire *wire, size_t at, unsigned seen)
{
    return (struct wire_detection){
        .after_ns = wire_time_of_bits(wire, &wire->bits[0], at + 1),
        .flag_bits = wire_flag_bits_by_sender(wire, &wire->bits[0], at, seen),
        .error = WIRE_BIT_ERROR,
    };
}

/* Describes an error that a receiver finds at a bit: behind the ACK field it is one of form. */
static struct wire_detection wire_detect_by_receiver(const struct wire *wire, size_t at,
                                                     size_t receiver)
{
    return (struct wire_detection){
        .after_ns = wire_time_of_bits(wire, &wire->bits[0], at + 1),
        .flag_bits = wire_flag_bits_by_receiver(&wire->bits[0], at),
        .error = at >= wire->bits[0].ack ? WIRE_FORM_ERROR : WIRE_BIT_ERROR,
        .first = WIRE_BIT(receiver),
    };
}

struct wire_detection wire_detect_missing_ack(const struct wire *wire)
{
    const struct wire_bits *bits = &wire->bits[0];

    return (struct wire_detection){
        .after_ns = wire_time_of_bits(wire, bits, bits->ack + 1),
        .flag_bits = FLAG,
        .error = WIRE_ACK_ERROR,
        .unacknowledged = true,
    };
}

/* Finds where a receiver that reads one bit wrong notices it: at six equal bits, else by the
 * CRC, which is judged behind the ACK field. */
size_t wire_misread_detected_at(struct wire_bits *bits, size_t wrong)
{
    size_t found = bits->ack + 1;
    unsigned run = 0;

    bits->bit[wrong] ^= 1;
    for (size_t i = 0; i < bits->crc_end; i++) {
        run = i && bits->bit[i] == bits->bit[i - 1] ? run + 1 : 1;
        if (run == STUFF_ERROR && i >= wrong) {
            found = i;
            break;
        }
    }
    bits->bit[wrong] ^= 1;
    return found;
}

/* Finds where a receiver of another bit rate detects an error. It samples at 80 % of its own
 * bits, from the edge of SOF on, without resynchronizing. */
size_t wire_mismatch_detected_at(const struct wire *wire, const struct wire_bits *bits,
                                 int64_t bitrate)
{
    /* Sample by sample, until it has read six equal bits or the frame is over */
    const double period_ns = 1e9 / (double)bitrate;
    unsigned run = 0, last = 2;
    size_t at = 0;

    for (size_t sample = 0;; sample++) {
        const int64_t time_ns = (int64_t)(((double)sample + 0.8) * period_ns);

        while (at <= bits->ack && wire_time_of_bits(wire, bits, at + 1) <= time_ns) {
            at++;
        }
        if (at > bits->ack) {
            return bits->ack + 1;
        }
        run = bits->bit[at] == last ? run + 1 : 1;
        last = bits->bit[at];
        if (run == STUFF_ERROR) {
            return at;
        }
    }
}

/* Returns after how many bits of the bus the receivers of a sender of another bit rate have read
 * six equal ones; behind its frame the line is recessive. */
int64_t wire_foreign_rate_detected_after(const struct wire *wire, const struct wire_bits *bits,
                                         int64_t bitrate)
{
    unsigned run = 0, last = 2;

    for (int64_t sample = 0;; sample++) {
        const double time = ((double)sample + 0.8) / (double)wire->config.bitrate;
        const size_t at = (size_t)(time * (double)bitrate);
        const unsigned bit = at < bits->count ? bits->bit[at] : 1;

        run = bit == last ? run + 1 : 1;
        last = bit;
        if (run == STUFF_ERROR) {
            return sample + 1;
        }
    }
}

/* Applies a receiver's wrong reading: an error active one destroys the frame, a passive one only
 * misses it. */
void wire_misread_by_receiver(struct wire *wire, size_t receiver, size_t found_at,
                              struct wire_detection *kept)
{
    if (wire_is_passive(&wire->node[receiver])) {
        wire->flight.blind |= WIRE_BIT(receiver);
    } else {
        struct wire_detection found = wire_detect_by_receiver(wire, found_at, receiver);

        wire_keep_earliest(kept, &found);
    }
}
