/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Checks that identifiers of a protocol file do not overlap on every bus: those of two frames of
 * one board, or of the host and a board. Overlaps that depend on the addresses of boards are found
 * where the rig is read (rig/described_ids.c).
 */
#include "boards/described/load.h"

/* Returns the first number of a frame; addresses begin with 1. */
static unsigned described_first_number(const struct described_frame *frame)
{
    return frame->by == DESCRIBED_BY_ADDRESS;
}

/* Returns whether numbers of two frames are always of one board, or one of the frames has no
 * number. */
static bool described_always_meet(const struct described_frame *a, unsigned na,
                                  const struct described_frame *b, unsigned nb)
{
    return a->by == DESCRIBED_BY_NONE || b->by == DESCRIBED_BY_NONE || (a->by == b->by && na == nb);
}

/* Finds the numbers by which two frames have one identifier on every bus. */
static bool described_find_meeting(const struct described_frame *a, const struct described_frame *b,
                                   unsigned *na, unsigned *nb)
{
    uint32_t fixed = ~(a->mask | b->mask);

    for (*na = described_first_number(a); *na <= a->most; ++*na) {
        for (*nb = described_first_number(b); *nb <= b->most; ++*nb) {
            if (!((described_id(a, *na) ^ described_id(b, *nb)) & fixed) &&
                described_always_meet(a, *na, b, *nb)) {
                return true;
            }
        }
    }
    return false;
}

/* Returns whether two frames are of boards of different kinds, so of different boards: their
 * identifiers depend on the rig. */
static bool described_of_other_boards(const struct described_frame *a,
                                      const struct described_frame *b)
{
    return !a->from_host && !b->from_host && !(a->of & b->of);
}

/* Refuses two frames with one identifier that nobody tells apart. */
static enum error_code described_check_pair(struct described_loader *l, size_t first, size_t second)
{
    const struct described_frame *a = &l->made->frame[first], *b = &l->made->frame[second];
    const struct yaml_mark *mark = &l->raw->frame[second].id_mark;
    unsigned na, nb;

    if ((a->flags ^ b->flags) & FRAME_EXTENDED || described_of_other_boards(a, b) ||
        described_told_apart(a, b) || !described_find_meeting(a, b, &na, &nb)) {
        return ERROR_NONE;
    }
    if (a->from_host == b->from_host) {
        return yaml_error(l->error, mark,
                          "found identifier 0x%x of frame \"%s\" again, which frame \"%s\" (line "
                          "%d) has and takes all frames of: expected another identifier, another "
                          "length, or constants that tell it apart in the first of the two",
                          (unsigned)described_id(b, nb), b->name, a->name,
                          l->raw->frame[first].mark.line);
    }
    return yaml_error(l->error, mark,
                      "found identifier 0x%x of frame \"%s\" from the %s, which frame \"%s\" (line "
                      "%d) from the %s has (number %u): expected identifiers of their own",
                      (unsigned)described_id(b, nb), b->name, b->from_host ? "host" : "board",
                      a->name, l->raw->frame[first].mark.line, a->from_host ? "host" : "board", na);
}

enum error_code described_check_ids(struct described_loader *l)
{
    enum error_code code = ERROR_NONE;

    for (size_t second = 0; second < l->made->nframe && !code; second++) {
        for (size_t first = 0; first < second && !code; first++) {
            code = described_check_pair(l, first, second);
        }
    }
    return code;
}
