/* SPDX-License-Identifier: Apache-2.0 */
/* The motor boards of a leg, as docs/protocol/foc.md describes them: three on each of two buses. */
#ifndef BOARDS_H
#define BOARDS_H

#include "can.h"

enum { BOARDS = 6, BOARD_ADDRESSES = 4 };

enum board_mode {
    MODE_IDLE = 0x00,
    MODE_FORCE_IDLE = 0x09, /* a command only */
    MODE_OPEN_LOOP = 0x50,  /* targets are voltages */
    MODE_HARDWARE_FAULT = 0xa0,
    MODE_NOT_CONFIGURED = 0xb0,
};

enum { ENCODER_NOT_CALIBRATED = 1 << 4 };

/* Faults that pass by themselves: low supply (bit 6), what the CAN controller has met (10-13, 15,
 * 27-31), set-point expired (14). Any other one is for a person to look at. */
#define FAULTS_PASSING UINT32_C(0xf800fc40)

enum { ICUBDEG_PER_TURN = 65536, TARGET_FULL = 32000 /* the supply */ };

struct board {
    const char *joint;
    uint8_t controller, address;
    bool answered; /* the request for its version, as what it should be */
    uint8_t mode, encoder;
    uint32_t faults;
    int32_t position_icubdeg;
    int16_t current_ma;
    uint32_t silence; /* ticks since it was heard */
    int16_t target;   /* of the next set-points */
};

extern struct board boards[BOARDS];

/* Forgets what was heard. */
void boards_forget(void);

/* Takes a frame of a bus; false when it is none of theirs. */
bool boards_take(unsigned controller, const struct can_frame *frame);

/* Ends the reception of a tick. */
void boards_count_silence(void);

/* A frame with the targets of all boards of each bus. */
void boards_send_targets(void);

void boards_request_version(unsigned controller, unsigned address);

/* Motor, limits of the current, and the law that holds them. */
void board_configure(const struct board *board);

void board_set_mode(const struct board *board, enum board_mode mode);

/* Whether something answers at the address that has no board. */
bool boards_have_stranger(void);

#endif
