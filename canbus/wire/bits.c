/* SPDX-License-Identifier: Apache-2.0 */
/* Counts the bits of a frame with stuff bits, eight at a time with tables. Writes single bits only
 * for faults (ISO 11898-1). */
#include "canbus/wire/bits.h"

enum {
    STUFF_AFTER = 5, /* number of equal bits before a stuff bit */
    CRC15_POLYNOMIAL = 0x4599,
    CRC17_POLYNOMIAL = 0x1685B, /* without the leading x^17 */
    CRC21_POLYNOMIAL = 0x102899,
    CRC17_LAST = 16,                      /* most bytes with CRC-17; longer frames have CRC-21 */
    TRAILER_BITS = 1 + 2 + WIRE_EOF_BITS, /* CRC delimiter, ACK slot and delimiter, EOF */
};

/* ---- fields ---- */

/* Returns the data length code of a frame. */
static inline unsigned wire_dlc(const struct bus_frame *frame)
{
    if (frame->len <= 8) {
        return frame->len;
    }
    return frame->len <= 24 ? 9u + (frame->len - 12u) / 4u : 11u + frame->len / 16u;
}

/* The bits from SOF to DLC without stuff bits, right-aligned; SOF is the leading 0. */
struct wire_header {
    uint64_t bits;
    unsigned count;
    unsigned arbitration; /* arbitration bits behind SOF */
};

/* Makes the header of a frame: SOF, arbitration field and control field. */
static inline struct wire_header wire_make_header(const struct bus_frame *frame, bool extended,
                                                  bool fd)
{
    const uint64_t remote = frame->flags & FRAME_REMOTE ? 1 : 0;
    struct wire_header header;

    /* The arbitration field. IDE is part of it in the extended format and follows it in the
     * standard format */
    if (extended) {
        /* Base identifier, SRR = 1, IDE = 1, identifier extension (18 bits), RTR (FD: RRS = 0) */
        header.bits = (uint64_t)(frame->id >> 18) << 21 | UINT64_C(3) << 19 |
                      (uint64_t)(frame->id & 0x3FFFF) << 1 | remote;
        header.arbitration = 32;
    } else {
        header.bits = (uint64_t)frame->id << 1 | remote;
        header.arbitration = 12;
    }
    header.count = 1 + header.arbitration;
    if (!extended) {
        header.bits <<= 1; /* IDE = 0 */
        header.count += 1;
    }

    /* The control field */
    if (fd) {
        /* FDF = 1, res = 0, BRS, ESI */
        header.bits = header.bits << 4 | 8u | (frame->flags & FRAME_BRS ? 2u : 0u) |
                      (frame->flags & FRAME_ESI ? 1u : 0u);
        header.count += 4;
    } else {
        /* r0 = 0; an extended frame has r1 before it */
        header.bits <<= extended ? 2 : 1;
        header.count += extended ? 2 : 1;
    }
    header.bits = header.bits << 4 | wire_dlc(frame);
    header.count += 4;
    return header;
}

/* Returns how many data bytes are on the wire: none in a remote frame. */
static unsigned wire_data_bytes(const struct bus_frame *frame)
{
    return frame->flags & FRAME_REMOTE ? 0 : frame->len;
}

uint32_t wire_priority(const struct bus_frame *frame)
{
    const uint32_t remote = frame->flags & FRAME_REMOTE ? 1 : 0;

    if (frame->flags & FRAME_EXTENDED) {
        return (frame->id >> 18) << 21 | 3u << 19 | (frame->id & 0x3FFFF) << 1 | remote;
    }
    return frame->id << 21 | remote << 20;
}

/* ---- counting ---- */

/* Numbers a run of equal bits by the value of the bit and the length of the run (1 to 4): one of
 * 8 states. */
static unsigned wire_run_state(unsigned bit, unsigned length)
{
    return bit * 4 + length - 1;
}

/* Bits of a stuff table entry. The next byte finds its entry at (entry & ENTRY_STATE) | byte.
 * Bits 8 to 10 hold the next state, bit 11 whether a stuff bit follows the last of the eight
 * bits, bits 12 and up the number of stuff bits. */
enum { ENTRY_STATE = 7 << 8, ENTRY_LAST = 1 << 11, ENTRY_STUFFED = 12 };

void wire_tables_make(struct wire_tables *tables)
{
    for (unsigned byte = 0; byte < 256; byte++) {
        unsigned crc = byte << 7;

        for (int i = 0; i < 8; i++) {
            crc = crc << 1 ^ (crc & 0x4000 ? CRC15_POLYNOMIAL : 0);
        }
        tables->crc15[byte] = (uint16_t)(crc & 0x7FFF);
        for (unsigned state = 0; state < 8; state++) {
            /* Compute the stuff table entry of a byte that follows a run of equal bits */
            unsigned bit = state / 4, length = state % 4 + 1, stuffed = 0, last = 0;

            for (int i = 7; i >= 0; i--) {
                unsigned next = byte >> i & 1;

                length = next == bit ? length + 1 : 1;
                bit = next;
                last = length == STUFF_AFTER;
                if (last) {
                    stuffed++;
                    bit = !bit;
                    length = 1;
                }
            }
            tables->stuff[state << 8 | byte] =
                (uint16_t)(wire_run_state(bit, length) << 8 | (last ? ENTRY_LAST : 0) |
                           stuffed << ENTRY_STUFFED);
        }
    }
}

struct wire_counting {
    const struct wire_tables *tables;
    unsigned entry; /* stuff table entry of the last byte (ENTRY_STATE, ENTRY_LAST) */
    unsigned stuffed;
};

/* Counts the stuff bits of the next byte. */
static inline void wire_count_byte(struct wire_counting *counting, unsigned byte)
{
    counting->entry = counting->tables->stuff[(counting->entry & ENTRY_STATE) | byte];
    counting->stuffed += counting->entry >> ENTRY_STUFFED;
}

/* Counts the stuff bits of `count` right-aligned bits. To count by whole bytes, it puts alternating
 * fill bits in front of SOF. The last fill bit is 1, so SOF starts a new run, and fill bits cause
 * no stuff bit. */
static inline struct wire_counting wire_count_header(const struct wire_tables *tables,
                                                     uint64_t bits, unsigned count)
{
    const unsigned whole = (count + 7) / 8 * 8;
    struct wire_counting counting = {tables, wire_run_state(0, 1) << 8, 0};

    if (whole > count) {
        unsigned fill = whole - count;

        bits |= (uint64_t)(0x55u & ((1u << fill) - 1)) << count;
        /* The run before the first fill bit has the other value */
        counting.entry = wire_run_state(fill % 2 ? 0 : 1, 1) << 8;
    }
    for (unsigned shift = whole; shift > 0; shift -= 8) {
        wire_count_byte(&counting, bits >> (shift - 8) & 0xFF);
    }
    return counting;
}

/* Computes the length of a classic frame with its stuff bits. This is the inner loop of wire mode.
 * It is inlined for each format, so that the loops over the header have constant ends and all
 * values stay in registers. */
static inline struct wire_length wire_classic_length(const struct wire_tables *tables,
                                                     const struct bus_frame *frame, bool extended)
    __attribute__((always_inline));

static inline struct wire_length wire_classic_length(const struct wire_tables *tables,
                                                     const struct bus_frame *frame, bool extended)
{
    const struct wire_header header = wire_make_header(frame, extended, false);
    const unsigned bytes = wire_data_bytes(frame);
    const struct wire_counting counted = wire_count_header(tables, header.bits, header.count);
    unsigned crc = 0, entry = counted.entry, stuffed = counted.stuffed;

    /* CRC-15 of the header; its leading zeros do not change it, as the register starts at 0 */
    for (unsigned shift = (header.count + 7) / 8 * 8; shift > 0; shift -= 8) {
        crc = (crc << 8 ^ tables->crc15[(crc >> 7 ^ (header.bits >> (shift - 8) & 0xFF)) & 0xFF]) &
              0x7FFF;
    }
    /* Data: CRC and stuff bits in one pass */
    for (unsigned i = 0; i < bytes; i++) {
        const unsigned byte = frame->data[i];

        crc = crc << 8 ^ tables->crc15[(crc >> 7 ^ byte) & 0xFF];
        entry = tables->stuff[(entry & ENTRY_STATE) | byte];
        stuffed += entry >> ENTRY_STUFFED;
    }
    crc &= 0x7FFF;
    /* Append a 16th bit, the complement of the CRC's last bit, so that it completes no run */
    crc = crc << 1 | (~crc & 1);
    entry = tables->stuff[(entry & ENTRY_STATE) | crc >> 8];
    stuffed += entry >> ENTRY_STUFFED;
    stuffed += tables->stuff[(entry & ENTRY_STATE) | (crc & 0xFF)] >> ENTRY_STUFFED;
    return (struct wire_length){
        .nominal = (uint16_t)(header.count + 8 * bytes + 15 + stuffed + TRAILER_BITS),
    };
}

/* Returns the bits at the data rate without dynamic stuff bits: ESI, DLC, data, stuff count, CRC
 * and its delimiter. */
static unsigned wire_fd_fast_bits(uint8_t len)
{
    /* Stuff count and CRC have a fixed stuff bit before each four bits */
    const unsigned check = 4 + (len <= CRC17_LAST ? 17 : 21);

    return 5 + 8u * len + check + (check + 3) / 4 + 1;
}

struct wire_length wire_frame_length(const struct wire_tables *tables,
                                     const struct bus_frame *frame)
{
    if (frame->flags & FRAME_FD) {
        /* Compute the length of an FD frame, split into bits at the nominal and at the data rate */
        const struct wire_header header =
            wire_make_header(frame, frame->flags & FRAME_EXTENDED, frame->flags & FRAME_FD);
        const unsigned slow = header.count - 5 + TRAILER_BITS - 1,
                       fast = wire_fd_fast_bits(frame->len);
        struct wire_counting counting = wire_count_header(tables, header.bits, header.count);
        unsigned early;

        for (unsigned i = 0; i < frame->len; i++) {
            wire_count_byte(&counting, frame->data[i]);
        }
        /* A stuff bit behind the last data bit is replaced by the first fixed stuff bit */
        counting.stuffed -= counting.entry & ENTRY_LAST ? 1 : 0;
        if (!(frame->flags & FRAME_BRS)) {
            return (struct wire_length){.nominal = (uint16_t)(slow + fast + counting.stuffed)};
        }
        /* Stuff bits at the nominal rate: SOF to BRS. BRS starts a new run, so no stuff bit follows
         * it */
        early = wire_count_header(tables, header.bits >> 5, header.count - 5).stuffed;
        return (struct wire_length){
            .nominal = (uint16_t)(slow + early),
            .data = (uint16_t)(fast + counting.stuffed - early),
        };
    }
    return frame->flags & FRAME_EXTENDED ? wire_classic_length(tables, frame, true)
                                         : wire_classic_length(tables, frame, false);
}

struct wire_length wire_worst_length(uint8_t flags, uint8_t len)
{
    const struct bus_frame frame = {.flags = flags, .len = len};
    const struct wire_header header =
        wire_make_header(&frame, flags & FRAME_EXTENDED, flags & FRAME_FD);
    const unsigned bytes = wire_data_bytes(&frame);
    unsigned bits, stuffed, early, slow;

    /* In the worst case a stuff bit follows the fifth bit and then every fourth */
    if (!(flags & FRAME_FD)) {
        bits = header.count + 8 * bytes + 15;
        return (struct wire_length){.nominal = (uint16_t)(bits + (bits - 1) / 4 + TRAILER_BITS)};
    }
    stuffed = (header.count + 8 * bytes - 1) / 4;
    early = (header.count - 5 - 1) / 4;
    slow = header.count - 5 + TRAILER_BITS - 1 + 1; /* the receiver's delay */
    if (!(flags & FRAME_BRS)) {
        return (struct wire_length){.nominal = (uint16_t)(slow + wire_fd_fast_bits(len) + stuffed)};
    }
    return (struct wire_length){
        .nominal = (uint16_t)(slow + early),
        .data = (uint16_t)(wire_fd_fast_bits(len) + stuffed - early),
    };
}

/* Returns the time of a number of bits, rounded to whole ns. */
static int64_t wire_rounded_ns(int64_t bits, int64_t bitrate)
{
    return (bits * 1000000000 + bitrate / 2) / bitrate;
}

int64_t wire_length_ns(struct wire_length length, int64_t bitrate, int64_t data_bitrate)
{
    return wire_rounded_ns(length.nominal, bitrate) +
           (length.data ? wire_rounded_ns(length.data, data_bitrate) : 0);
}

/* ---- writing ---- */

/* State during the writing of a frame's bits. */
struct wire_writing {
    struct wire_bits *bits;
    unsigned run;     /* length of the last run of equal bits */
    unsigned stuffed; /* number of stuff bits so far */
};

/* Appends a bit without stuffing. */
static void wire_put_bit(struct wire_writing *writing, unsigned bit)
{
    writing->bits->bit[writing->bits->count++] = (uint8_t)bit;
}

/* Appends a bit, and before it a stuff bit if the last five bits are equal. */
static void wire_put_stuffed_bit(struct wire_writing *writing, unsigned bit)
{
    struct wire_bits *bits = writing->bits;

    if (writing->run == STUFF_AFTER) {
        wire_put_bit(writing, !bits->bit[bits->count - 1]);
        writing->run = 1;
        writing->stuffed++;
    }
    writing->run = bits->count && bits->bit[bits->count - 1] == bit ? writing->run + 1 : 1;
    wire_put_bit(writing, bit);
}

/* Returns a CRC of `width` bits after one more bit. */
static uint32_t wire_crc_bit(uint32_t crc, unsigned bit, unsigned width, uint32_t polynomial)
{
    const uint32_t top = crc >> (width - 1) & 1;

    crc = crc << 1 & ((1u << width) - 1);
    return top ^ bit ? crc ^ polynomial : crc;
}

/* Appends the check field of an FD frame: the stuff count modulo 8 as a Gray code with even
 * parity, then the CRC over all bits so far (stuff bits included) and the stuff count, with a
 * fixed stuff bit before each four bits. */
static void wire_put_fd_check(struct wire_writing *writing, uint8_t len)
{
    const bool crc17 = len <= CRC17_LAST;
    const unsigned width = crc17 ? 17 : 21, modulo = writing->stuffed & 7;
    const uint32_t polynomial = crc17 ? CRC17_POLYNOMIAL : CRC21_POLYNOMIAL;
    const unsigned gray = modulo ^ modulo >> 1;
    const unsigned count = gray << 1 | ((gray ^ gray >> 1 ^ gray >> 2) & 1);
    struct wire_bits *bits = writing->bits;
    uint32_t crc = 1u << (width - 1);
    uint64_t check;

    /* The CRC, which starts with its top bit set */
    for (size_t i = 0; i < bits->count; i++) {
        crc = wire_crc_bit(crc, bits->bit[i], width, polynomial);
    }
    for (int i = 3; i >= 0; i--) {
        crc = wire_crc_bit(crc, count >> i & 1, width, polynomial);
    }
    /* Append both with fixed stuff bits, each the complement of the bit before it */
    check = (uint64_t)count << width | crc;
    for (unsigned i = 0; i < width + 4; i++) {
        if (i % 4 == 0) {
            wire_put_bit(writing, !bits->bit[bits->count - 1]);
        }
        wire_put_bit(writing, check >> (width + 3 - i) & 1);
    }
}

void wire_frame_encode(const struct bus_frame *frame, struct wire_bits *bits)
{
    const struct wire_header header =
        wire_make_header(frame, frame->flags & FRAME_EXTENDED, frame->flags & FRAME_FD);
    const bool fd = frame->flags & FRAME_FD;
    struct wire_writing writing = {bits, 0, 0};

    /* SOF to DLC; the arbitration field ends with RTR, and the data rate begins behind BRS */
    bits->count = 0;
    bits->fast = 0;
    for (unsigned i = header.count; i-- > 0;) {
        wire_put_stuffed_bit(&writing, header.bits >> i & 1);
        if (header.count - i == 1 + header.arbitration) {
            bits->control = bits->count;
        }
        if (i == 5) {
            bits->fast = bits->count;
        }
    }

    /* Data and check field */
    for (unsigned i = 0; i < 8 * wire_data_bytes(frame); i++) {
        wire_put_stuffed_bit(&writing, frame->data[i / 8] >> (7 - i % 8) & 1);
    }
    if (fd) {
        wire_put_fd_check(&writing, frame->len);
    } else {
        /* Append the CRC-15 over header and data before stuffing, with its stuff bits, including
         * one behind its last bit */
        uint32_t crc = 0;

        for (unsigned i = header.count; i-- > 0;) {
            crc = wire_crc_bit(crc, header.bits >> i & 1, 15, CRC15_POLYNOMIAL);
        }
        for (unsigned i = 0; i < 8 * wire_data_bytes(frame); i++) {
            crc = wire_crc_bit(crc, frame->data[i / 8] >> (7 - i % 8) & 1, 15, CRC15_POLYNOMIAL);
        }
        for (int i = 14; i >= 0; i--) {
            wire_put_stuffed_bit(&writing, crc >> i & 1);
        }
        if (writing.run == STUFF_AFTER) {
            wire_put_bit(&writing, !writing.bits->bit[writing.bits->count - 1]);
        }
    }

    /* CRC delimiter, ACK field and EOF: recessive, without stuff bits */
    bits->crc_end = bits->count;
    bits->slow = bits->count + 1;
    if (!(frame->flags & FRAME_BRS)) {
        bits->fast = bits->slow;
    }
    bits->ack = bits->count + 1;
    for (int i = 0; i < TRAILER_BITS; i++) {
        wire_put_bit(&writing, 1);
    }
}
