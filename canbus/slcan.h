/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The text of Lawicel's protocol for CAN on a serial line (slcan), as SavvyCAN, python-can and
 * slcand use it, with CAN FD frames as in CANable's firmware. Pure functions; the server is
 * canbus/gateway.h. RT-safe. A command ends with a carriage return, which is omitted here:
 *
 *     tIIILDD..  TIIIIIIIILDD..  rIIIL  RIIIIIIIIL    classic frames, both ways
 *     dIIILDD..  DIIIIIIIILDD..  bIIILDD..  B...      FD frames, b and B with bit rate switch
 *     Sn  Yn  O  L  C  Zn  F  V  v  N  Xn  Wn  Mxxxxxxxx  mxxxxxxxx
 *
 * Identifiers and data are hexadecimal. L is one digit: the length, or the length code of an FD
 * frame. Received frames may have four more digits: milliseconds within a minute.
 */
#ifndef CANBUS_SLCAN_H
#define CANBUS_SLCAN_H

#include "canbus/frame.h"

enum slcan_command {
    SLCAN_FRAME,     /* frame */
    SLCAN_BIT_RATE,  /* value: bit/s */
    SLCAN_DATA_RATE, /* value: bit/s of FD frames with bit rate switch */
    SLCAN_OPEN,      /* value: 1 = listen only */
    SLCAN_CLOSE,
    SLCAN_TIME_STAMP, /* value: 0 = off, 1 = on */
    SLCAN_STATUS,
    SLCAN_VERSION,
    SLCAN_SERIAL,
    SLCAN_ACCEPTED, /* no effect here: automatic sending, a filter that accepts everything */
    SLCAN_WRONG,    /* unknown command or wrong arguments */
};

/* The longest command and the longest answer, carriage return included: an FD frame of 64 bytes. */
enum { SLCAN_TEXT_MAX = 160, SLCAN_MINUTE_MS = 60000 };

struct slcan_request {
    enum slcan_command command;
    int64_t value;
    struct bus_frame frame; /* SLCAN_FRAME; a valid frame with time_ns 0 */
};

/* Parses a command of size bytes, without its carriage return. */
void slcan_parse(const char *text, size_t size, struct slcan_request *request);

/* Writes a frame as the server sends it, with carriage return and terminating zero; with `stamped`,
 * also the milliseconds of frame->time_ns. Returns the length without the zero; 0 for error frames,
 * which slcan does not have. */
size_t slcan_format(const struct bus_frame *frame, bool stamped, char text[SLCAN_TEXT_MAX]);

#endif
