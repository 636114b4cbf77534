/* SPDX-License-Identifier: Apache-2.0 */
/* The state machine of the leg, once a millisecond. */
#include "leg.h"

#include "control.h"

enum {
    ASK_AGAIN_TICKS = 20,
    CONFIGURE_TICKS = 50,
    OFFSET_TICKS = 32,
    ENABLE_TICKS = 20,
#ifdef BUG_SLOW
    SILENCE_TICKS = 100,
#else
    SILENCE_TICKS = 10, /* without STATUS: a board is lost */
#endif
    SAFE_TICKS = 50,
    HOME_TICKS = 300,
    CREEP_URAD = 300, /* 0.3 rad/s */
    INDEX_TICKS = 230 /* a turn of the rotor, 0.063 rad, and some more */
};

/* Where a joint goes when its index is found, and how far it may be sent. */
static const struct {
    int16_t home_mrad, lower_mrad, upper_mrad;
    int8_t creep; /* direction in which the index is looked for */
} joints[BOARDS] = {
    {-100, -1500, 400, -1}, {0, -200, 600, 1}, {0, -500, 500, 1},
    {200, 50, 1800, 1},     {0, -250, 250, 1}, {-100, -900, 500, -1},
};

static const char *const state_words[] = {"discovery",    "configuration", "current offsets",
                                          "bridges on",   "index search",  "control",
                                          "safe, all off"};
static const char *const cause_words[] = {
    "", "board silent", "bus silent", "bus-off", "board fault", "no index", "stopped"};

struct leg leg;

static struct control controls[BOARDS];
static struct {
    bool waits;
    int16_t to_mrad;
    uint16_t ticks;
} moves[BOARDS];
static int32_t offset_sums[BOARDS];
static volatile bool stop_waits;
static bool bus_off_waits;
static uint32_t now;

/* ---- reports ---- */

static void leg_print(void)
{
    console_print("[");
    console_print_number((int32_t)now);
    console_print(" ms] ");
    console_print(state_words[leg.state]);
    if (leg.state == LEG_SAFE) {
        console_print(": ");
        console_print(cause_words[leg.cause]);
        console_print(" (");
        if (leg.cause == LEG_BUS_SILENT || leg.cause == LEG_BUS_OFF) {
            console_print(leg.where ? "CAN 1" : "CAN 0");
        } else if (leg.cause != LEG_STOPPED) {
            console_print(boards[leg.where].joint);
        }
        console_print(")");
    }
    console_print("\n");
}

static void leg_enter(enum leg_state state)
{
    leg.state = state;
    leg.since = 0;
    leg_print();
}

static void leg_make_safe(enum leg_cause cause, unsigned where)
{
    leg.cause = cause;
    leg.where = where;
    leg.faults = 0;
    for (unsigned i = 0; i < BOARDS; i++) {
        leg.faults |= boards[i].faults;
    }
    leg_enter(LEG_SAFE);
}

/* ---- what boards say ---- */

static bool boards_are_in(enum board_mode mode)
{
    for (unsigned i = 0; i < BOARDS; i++) {
        if (boards[i].mode != mode || boards[i].silence > 1) {
            return false;
        }
    }
    return true;
}

#ifndef BUG_TIMEOUT
static bool bus_is_silent(unsigned controller)
{
    for (unsigned i = 0; i < BOARDS; i++) {
        if (boards[i].controller == controller && boards[i].silence <= SILENCE_TICKS / 2) {
            return false;
        }
    }
    return true;
}
#endif

/* Whether all is well; else the leg is made safe. */
static bool leg_watch(enum board_mode mode)
{
    for (unsigned i = 0; i < BOARDS; i++) {
        const struct board *board = &boards[i];

#ifndef BUG_TIMEOUT
        if (board->silence > SILENCE_TICKS) {
            bool bus = bus_is_silent(board->controller);

            leg_make_safe(bus ? LEG_BUS_SILENT : LEG_BOARD_SILENT, bus ? board->controller : i);
            return false;
        }
#endif
        if (board->mode != mode) {
            leg_make_safe(LEG_BOARD_FAULT, i);
            return false;
        }
    }
    return true;
}

/* ---- states ---- */

static void leg_discover(void)
{
    bool all = true;

    if (leg.since % ASK_AGAIN_TICKS == 0) {
        boards_forget();
        for (unsigned c = 0; c < CAN_CONTROLLERS; c++) {
            for (unsigned a = 1; a <= BOARD_ADDRESSES; a++) {
                boards_request_version(c, a);
            }
        }
        return;
    }
    for (unsigned i = 0; i < BOARDS; i++) {
        all = all && boards[i].answered && boards[i].silence <= 1;
    }
    if (all && !boards_have_stranger()) {
        leg_enter(LEG_CONFIGURE);
    }
}

/* Who has kept its settings through a fault is only made idle: it has kept its index, too. */
static void leg_configure(void)
{
    if (leg.since == 0) {
        for (unsigned i = 0; i < BOARDS; i++) {
            if (boards[i].mode == MODE_NOT_CONFIGURED) {
                board_configure(&boards[i]);
            } else {
                board_set_mode(&boards[i], MODE_FORCE_IDLE);
            }
            offset_sums[i] = 0;
        }
    } else if (leg.since > 2 && boards_are_in(MODE_IDLE)) {
        leg_enter(LEG_OFFSETS);
    } else if (leg.since > CONFIGURE_TICKS) {
        leg_enter(LEG_DISCOVER);
    }
}

static void leg_measure_offsets(void)
{
    if (!leg_watch(MODE_IDLE)) {
        return;
    }
    for (unsigned i = 0; i < BOARDS; i++) {
        offset_sums[i] += boards[i].current_ma;
    }
    if (leg.since + 1 < OFFSET_TICKS) {
        return;
    }
    for (unsigned i = 0; i < BOARDS; i++) {
        leg.offset_ma[i] = (int16_t)(offset_sums[i] / OFFSET_TICKS);
    }
    leg_enter(LEG_ENABLE);
}

static void leg_enable(void)
{
    if (leg.since == 0) {
        for (unsigned i = 0; i < BOARDS; i++) {
            board_set_mode(&boards[i], MODE_OPEN_LOOP);
            control_hold(&controls[i], boards[i].position_icubdeg);
        }
    } else if (boards_are_in(MODE_OPEN_LOOP)) {
        leg_enter(LEG_INDEX);
    } else if (leg.since > ENABLE_TICKS) {
        leg_enter(LEG_DISCOVER);
    }
}

static void leg_control(void)
{
    for (unsigned i = 0; i < BOARDS; i++) {
        boards[i].target = control_step(&controls[i], boards[i].position_icubdeg);
    }
}

static void leg_find_index(void)
{
    uint8_t indexed = 0;

    if (!leg_watch(MODE_OPEN_LOOP)) {
        return;
    }
    for (unsigned i = 0; i < BOARDS; i++) {
        if (!(boards[i].encoder & ENCODER_NOT_CALIBRATED)) {
            indexed |= (uint8_t)(1 << i);
        } else if (leg.since > INDEX_TICKS) {
            leg_make_safe(LEG_NO_INDEX, i);
            return;
        } else {
            control_creep(&controls[i], joints[i].creep * CREEP_URAD);
        }
    }
    leg.indexed = indexed;
    leg_control();
    if (indexed == (1 << BOARDS) - 1) {
        for (unsigned i = 0; i < BOARDS; i++) {
            control_move(&controls[i], joints[i].home_mrad, HOME_TICKS);
            moves[i].waits = false;
        }
        leg_enter(LEG_RUN);
    }
}

static void leg_run(void)
{
    if (!leg_watch(MODE_OPEN_LOOP)) {
        return;
    }
    for (unsigned i = 0; i < BOARDS; i++) {
        if (moves[i].waits) {
            moves[i].waits = false;
            control_move(&controls[i], moves[i].to_mrad, moves[i].ticks);
        }
    }
    leg_control();
}

/* Off, and again as long as it is not heard; then the way back, where there is one. */
static void leg_stay_safe(void)
{
    for (unsigned i = 0; i < BOARDS; i++) {
        boards[i].target = 0;
#ifndef BUG_NOT_IDLE
        if (leg.since < SILENCE_TICKS) {
            board_set_mode(&boards[i], MODE_FORCE_IDLE);
        }
#endif
    }
    if (leg.since < SAFE_TICKS) {
        return;
    }
#ifndef BUG_FAULT_BITS
    if (leg.faults & ~FAULTS_PASSING) {
        return; /* a person has to look */
    }
#endif
    switch (leg.cause) {
    case LEG_BUS_SILENT:
    case LEG_BUS_OFF:
#ifndef BUG_BUS_OFF
        can_start(leg.where);
        leg_enter(LEG_DISCOVER);
#endif
        break;
    case LEG_BOARD_SILENT:
    case LEG_BOARD_FAULT:
#ifndef BUG_NEVER_ENABLED
        leg_enter(LEG_DISCOVER);
#endif
        break;
    default:
        break; /* stopped, no index: a person again */
    }
}

/* ---- one tick ---- */

void leg_init(void)
{
    leg.state = LEG_DISCOVER;
    leg_print();
}

void leg_step(uint32_t tick)
{
    static void (*const step[])(void) = {
        [LEG_DISCOVER] = leg_discover,       [LEG_CONFIGURE] = leg_configure,
        [LEG_OFFSETS] = leg_measure_offsets, [LEG_ENABLE] = leg_enable,
        [LEG_INDEX] = leg_find_index,        [LEG_RUN] = leg_run,
        [LEG_SAFE] = leg_stay_safe,
    };
    enum leg_state before = leg.state;

    now = tick;
    boards_count_silence();
#ifdef BUG_STOP
    stop_waits = stop_waits && leg.state != LEG_SAFE;
#endif
    if (stop_waits) {
        stop_waits = false;
        leg_make_safe(LEG_STOPPED, 0);
    }
    if (bus_off_waits && leg.state != LEG_SAFE) {
        leg_make_safe(LEG_BUS_OFF, leg.where);
    }
    bus_off_waits = false;

    /* A state that is entered begins in the next tick; the safe one at once */
    before = leg.state;
    step[leg.state]();
    if (leg.state == LEG_SAFE && before != LEG_SAFE) {
        leg_stay_safe();
        before = LEG_SAFE;
    }
    boards_send_targets();
    leg.since = leg.state == before ? leg.since + 1 : 0;
}

/* ---- commands ---- */

bool leg_move(unsigned joint, int16_t to_mrad, uint16_t ms)
{
    if (joint >= BOARDS || ms == 0) {
        return false;
    }
#ifndef BUG_RANGE
    if (to_mrad < joints[joint].lower_mrad || to_mrad > joints[joint].upper_mrad) {
        return false;
    }
#endif
    moves[joint].waits = true;
    moves[joint].to_mrad = to_mrad;
    moves[joint].ticks = ms;
    return true;
}

void leg_stop(void)
{
    stop_waits = true;
}

void leg_bus_off(void)
{
    bus_off_waits = true;
}
