/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the leg does: from power-up by discovery and calibration to control, and from every fault to
 * a state in which no bridge is on. See README.md for the states and frames.
 */
#ifndef LEG_H
#define LEG_H

#include "boards.h"

enum leg_state {
    LEG_DISCOVER,  /* asks for all boards, until all have answered */
    LEG_CONFIGURE, /* until all are idle */
    LEG_OFFSETS,   /* measures what the current sensors say of no current */
    LEG_ENABLE,    /* switches on, until all bridges are */
    LEG_INDEX,     /* moves each joint until its encoder has seen its index */
    LEG_RUN,
    LEG_SAFE, /* all off */
};

enum leg_cause {
    LEG_NO_CAUSE,
    LEG_BOARD_SILENT,
    LEG_BUS_SILENT,
    LEG_BUS_OFF,
    LEG_BOARD_FAULT,
    LEG_NO_INDEX,
    LEG_STOPPED, /* by a command */
};

struct leg {
    enum leg_state state;
    enum leg_cause cause; /* of the last LEG_SAFE */
    unsigned where;       /* board or controller */
    uint32_t faults;      /* of all boards when it began: being switched off clears them there */
    uint32_t since;       /* ticks in this state */
    int16_t offset_ma[BOARDS];
    uint8_t indexed; /* a bit for each board */
};

extern struct leg leg;

void leg_init(void);

/* One tick: what was heard has been taken; targets are sent. */
void leg_step(uint32_t tick);

/* Commands; a move waits for its tick, one out of the joint's range is refused. */
bool leg_move(unsigned joint, int16_t to_mrad, uint16_t ms);
void leg_stop(void);
void leg_bus_off(void);

#endif
