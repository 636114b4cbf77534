/* SPDX-License-Identifier: Apache-2.0 */
/*
 * STRAIN boards: six channels, commands in class 2, telemetry in class 3. The channels of a
 * force-torque board are fx fy fz tx ty tz of its sensor; those of a pseudo-STRAIN board are the
 * torques of up to six joints.
 *
 * A channel is converted to 16 bits offset binary: 0x8000 = 0, 0x8000 counts = full scale.
 * Calibrated telemetry is matrix * (counts + calibration tare) + current tare. The matrix is in
 * 1/32767, initially the identity. A reading below 1000 or above 64000 is saturated. Frames are
 * then seven bytes long and name the channel, and calibrated frames repeat the last good values.
 *
 * Settings in the EEPROM survive a restart; transmit mode, period and current tare do not.
 */
#include "boards/icub/board.h"

#include <string.h>

enum { MATRIX_ONE = 32767, HALF = BOARD_CHANNELS / 2 };

enum saturation { SATURATED_NOT, SATURATED_LOW, SATURATED_HIGH };

struct strain_board {
    struct icub_board icub;
    int32_t adc[BOARD_CHANNELS]; /* readings, counts from zero */
    /* held: calibrated values of the last tick without a saturated channel. They are computed only
     * when needed, from the readings `good` of the same tick. good_due: `held` is not yet
     * computed */
    int32_t held[BOARD_CHANNELS], good[BOARD_CHANNELS];
    bool good_due;
    uint8_t saturated[BOARD_CHANNELS]; /* enum saturation */
    uint8_t mode;                      /* enum icub_strain_transmit; other values = no telemetry */
    int64_t period_ns, next_ns;
    int16_t matrix[BOARD_CHANNELS][BOARD_CHANNELS];
    int16_t calibration_tare[BOARD_CHANNELS], current_tare[BOARD_CHANNELS];
    /* stored for the host, without effect */
    uint16_t dac[BOARD_CHANNELS], full_scale[BOARD_CHANNELS];
    uint8_t matrix_gain;
    uint8_t serial[ICUB_SERIAL_LENGTH];
    bool saved, powered;
};

static struct strain_board *strain_board_of(const struct board *board)
{
    return container_of(board, struct strain_board, icub.board);
}

/* Resets the state that a restart loses (struct board_ops). */
static void strain_board_power_up(struct board *board)
{
    struct strain_board *strain = strain_board_of(board);

    /* A new board has this EEPROM: serial number, identity matrix, full scales of the rig */
    if (!strain->powered) {
        char serial[ICUB_SERIAL_LENGTH + 1];

        snprintf(serial, sizeof serial, "SIM%02X%02X", (unsigned)board->config.bus & 0xff,
                 (unsigned)board->address & 0xff);
        memcpy(strain->serial, serial, sizeof strain->serial);
        for (int i = 0; i < BOARD_CHANNELS; i++) {
            int32_t scale = 0;

            strain->matrix[i][i] = MATRIX_ONE;
            control_quantize(board->config.full_scale[i], &scale);
            strain->full_scale[i] = (uint16_t)scale;
        }
        strain->saved = strain->powered = true;
    }
    memset(strain->current_tare, 0, sizeof strain->current_tare);
    memset(strain->held, 0, sizeof strain->held);
    strain->good_due = false;
    strain->mode = board->config.transmit_at_start ? ICUB_STRAIN_CALIBRATED : ICUB_STRAIN_SILENT;
    strain->period_ns = board->config.period_ns > 0 ? board->config.period_ns : MS;
    strain->next_ns = board->boards->now_ns + strain->period_ns;
}

/* ---- values ---- */

/* Adds the calibration tares to the readings of all channels, counts. */
static void strain_board_add_calibration_tares(const struct strain_board *strain,
                                               const int32_t adc[BOARD_CHANNELS],
                                               int32_t counts[BOARD_CHANNELS])
{
    for (int i = 0; i < BOARD_CHANNELS; i++) {
        counts[i] =
            (int32_t)control_clamp(adc[i] + strain->calibration_tare[i], INT16_MIN, INT16_MAX);
    }
}

/* Returns the product of one row of the calibration matrix and the counts. */
static int32_t strain_board_apply_matrix(const struct strain_board *strain,
                                         const int32_t counts[BOARD_CHANNELS], int channel)
{
    int64_t sum = 0;

    for (int i = 0; i < BOARD_CHANNELS; i++) {
        sum += (int64_t)strain->matrix[channel][i] * counts[i];
    }
    return (int32_t)control_clamp(sum / MATRIX_ONE, INT16_MIN, INT16_MAX);
}

/* Returns a calibrated channel without the current tare. */
static int32_t strain_board_calibrate(const struct strain_board *strain, int channel)
{
    int32_t counts[BOARD_CHANNELS];

    strain_board_add_calibration_tares(strain, strain->adc, counts);
    return strain_board_apply_matrix(strain, counts, channel);
}

/* Returns a value plus the current tare of a channel. */
static int32_t strain_board_add_tare(const struct strain_board *strain, int32_t value, int channel)
{
    return (int32_t)control_clamp(value + strain->current_tare[channel], INT16_MIN, INT16_MAX);
}

/* Returns whether a reading is saturated, and at which end of the range. */
static enum saturation strain_board_saturation(int32_t counts)
{
    return counts < ICUB_STRAIN_LOW - ICUB_STRAIN_ZERO    ? SATURATED_LOW
           : counts > ICUB_STRAIN_HIGH - ICUB_STRAIN_ZERO ? SATURATED_HIGH
                                                          : SATURATED_NOT;
}

/* Converts a channel to counts from zero. Checks whether the value, or its peak within the tick,
 * saturates. A value that is not finite keeps the old counts. */
static void strain_board_convert(struct board *board, int channel, double value, double peak)
{
    struct strain_board *strain = strain_board_of(board);
    const double full_scale = board->config.full_scale[channel];
    int32_t counts;

    if (!control_quantize(value / full_scale * ICUB_STRAIN_ZERO, &counts)) {
        return;
    }
    strain->adc[channel] = (int32_t)control_clamp(counts, INT16_MIN, INT16_MAX);
    strain->saturated[channel] = strain_board_saturation(counts);
    if (peak != value && strain->saturated[channel] == SATURATED_NOT &&
        control_quantize(peak / full_scale * ICUB_STRAIN_ZERO, &counts)) {
        strain->saturated[channel] = strain_board_saturation(counts);
    }
}

/* Returns whether any channel is saturated. */
static bool strain_board_is_saturated(const struct strain_board *strain)
{
    for (int i = 0; i < BOARD_CHANNELS; i++) {
        if (strain->saturated[i]) {
            return true;
        }
    }
    return false;
}

/* Computes `held` from the readings `good` if good_due is set. Called before a frame is sent and
 * before a command changes the calibration, instead of every tick. */
static void strain_board_calibrate_held(struct strain_board *strain)
{
    int32_t counts[BOARD_CHANNELS];

    if (!strain->good_due) {
        return;
    }
    strain->good_due = false;
    strain_board_add_calibration_tares(strain, strain->good, counts);
    for (int i = 0; i < BOARD_CHANNELS; i++) {
        strain->held[i] =
            strain_board_add_tare(strain, strain_board_apply_matrix(strain, counts, i), i);
    }
}

/* Converts the six channels of a force-torque sensor (struct board_ops). */
static void strain_board_sample_ft(struct board *board, const struct plant_sensors *sensors)
{
    const struct ft_sense *sense = &sensors->ft[board->config.ft];

    for (int i = 0; i < HALF; i++) {
        strain_board_convert(board, i, sense->force_n[i], sense->peak_n[i]);
        strain_board_convert(board, HALF + i, sense->torque_nm[i], sense->peak_nm[i]);
    }
}

/* Converts the torques of up to six joints (struct board_ops). */
static void strain_board_sample_torque(struct board *board, const struct plant_sensors *sensors)
{
    for (int i = 0; i < BOARD_CHANNELS; i++) {
        int joint = board->config.torque_joint[i];

        if (joint >= 0) {
            const double torque = sensors->motor[joint].torque_nm;

            strain_board_convert(board, i, torque, torque);
        }
    }
}

/* ---- commands ---- */

/* Finds the channel or row in the low half of a byte. Returns false if it does not exist. The high
 * half selects the regulation set; it is ignored, because this board has one set. */
static bool strain_board_split_channel(int64_t byte, unsigned *channel)
{
    *channel = byte & 0xf;
    return *channel < BOARD_CHANNELS;
}

/* Sets one tare to a given value, or all tares: to 0, or so that each result of `value` becomes 0.
 * Returns false for an unknown channel. */
static bool strain_board_set_tare(const struct strain_board *strain, int16_t *tare,
                                  const int64_t *request,
                                  int32_t (*value)(const struct strain_board *strain, int channel))
{
    unsigned channel;

    if (request[0] == ICUB_TARE_VALUE) {
        if (!strain_board_split_channel(request[1], &channel)) {
            return false;
        }
        tare[channel] = (int16_t)request[2];
        return true;
    }
    for (int i = 0; i < BOARD_CHANNELS; i++) {
        tare[i] = request[0] == ICUB_TARE_AUTOMATIC
                      ? (int16_t)control_clamp(-(int64_t)value(strain, i), INT16_MIN, INT16_MAX)
                      : 0;
    }
    return true;
}

/* Returns the reading of a channel, counts from zero. */
static int32_t strain_board_reading(const struct strain_board *strain, int channel)
{
    return strain->adc[channel];
}

/* Obeys the commands that set a tare. */
static bool strain_board_command_tare(struct strain_board *strain, const struct bus_frame *frame,
                                      const int64_t *request)
{
    bool of_value = request[0] == ICUB_TARE_VALUE;

    if (frame->len != 5 && (frame->len != 2 || of_value)) {
        return false;
    }
    if (frame->data[0] == ICUB_STRAIN_SET_CALIBRATION_TARE) {
        bool set =
            strain_board_set_tare(strain, strain->calibration_tare, request, strain_board_reading);

        strain->saved = strain->saved && !set;
        return set;
    }
    /* The current tare has no regulation set, so the byte is the channel */
    return (!of_value || request[1] < BOARD_CHANNELS) &&
           strain_board_set_tare(strain, strain->current_tare, request, strain_board_calibrate);
}

/* Obeys SET and GET of EEPROM data: one value per channel, or per element of the matrix. */
static bool strain_board_command_channel(struct strain_board *strain, unsigned code,
                                         const int64_t *request, int64_t *reply)
{
    unsigned channel;

    if (!strain_board_split_channel(request[0], &channel)) {
        return false;
    }
    reply[0] = request[0];
    switch (code) {
    case ICUB_STRAIN_SET_MATRIX:
        strain->matrix[channel][request[1]] = (int16_t)request[2];
        strain->saved = false;
        break;
    case ICUB_STRAIN_GET_MATRIX:
        reply[1] = request[1];
        reply[2] = strain->matrix[channel][request[1]];
        break;
    case ICUB_STRAIN_SET_FULL_SCALE:
        strain->full_scale[channel] = (uint16_t)request[1];
        strain->saved = false;
        break;
    case ICUB_STRAIN_SET_DAC:
        strain->dac[channel] = (uint16_t)request[1];
        strain->saved = false;
        break;
    case ICUB_STRAIN_GET_FULL_SCALE:
        reply[1] = strain->full_scale[channel];
        break;
    case ICUB_STRAIN_GET_DAC:
        reply[1] = strain->dac[channel];
        break;
    default: /* GET_CALIBRATION_TARE */
        reply[1] = strain->calibration_tare[channel];
        break;
    }
    return true;
}

/* Obeys commands that set data. Returns false for any other command. */
static bool strain_board_set(struct board *board, unsigned code, const int64_t *request)
{
    struct strain_board *strain = strain_board_of(board);

    switch (code) {
    /* Lost at a restart */
    case ICUB_STRAIN_SET_TRANSMIT_MODE:
        strain->mode = (uint8_t)request[0];
        return true;
    case ICUB_STRAIN_SET_PERIOD:
        strain->period_ns = request[0] * MS;
        strain->next_ns = board->boards->now_ns + strain->period_ns;
        return true;

    /* Kept in the EEPROM after SAVE */
    case ICUB_STRAIN_SET_MATRIX_GAIN:
        strain->matrix_gain = (uint8_t)request[0];
        break;
    case ICUB_STRAIN_SET_SERIAL:
        for (int i = 0; i < ICUB_SERIAL_LENGTH; i++) {
            strain->serial[i] = (uint8_t)request[i];
        }
        break;

    case ICUB_STRAIN_SET_ADDRESS:
        return board_set_address(board, (uint8_t)request[0]);
    /* accepted without effect: this board has no filter, multiplexer or amplifier */
    case ICUB_STRAIN_SET_FILTER:
    case ICUB_STRAIN_SET_CHANNELS:
    case ICUB_STRAIN_CALIBRATE:
        return true;
    default:
        return false;
    }
    strain->saved = false;
    return true;
}

/* Answers queries. Returns false for any other command. */
static bool strain_board_get(struct board *board, unsigned code, const int64_t *request,
                             int64_t *reply)
{
    struct strain_board *strain = strain_board_of(board);
    int32_t counts[BOARD_CHANNELS];

    switch (code) {
    /* State of the EEPROM */
    case ICUB_STRAIN_SAVE:
        strain->saved = true;
        reply[0] = 1;
        return true;
    case ICUB_STRAIN_EEPROM_SAVED:
        reply[0] = strain->saved;
        return true;

    /* Values of the channels */
    case ICUB_STRAIN_GET_ADC:
        reply[0] = request[0];
        reply[1] = request[1];
        strain_board_add_calibration_tares(strain, strain->adc, counts);
        reply[2] =
            ICUB_STRAIN_ZERO +
            (request[1]
                 ? strain_board_add_tare(strain, strain_board_calibrate(strain, (int)request[0]),
                                         (int)request[0])
                 : counts[request[0]]);
        return true;
    case ICUB_STRAIN_GET_MATRIX_GAIN:
        reply[0] = strain->matrix_gain;
        return true;
    case ICUB_STRAIN_GET_CURRENT_TARE:
        reply[0] = request[0];
        reply[1] = strain->current_tare[request[0]];
        return true;

    /* Identity of the board */
    case ICUB_STRAIN_GET_SERIAL:
        for (int i = 0; i < ICUB_SERIAL_LENGTH; i++) {
            reply[i] = strain->serial[i];
        }
        return true;
    case ICUB_STRAIN_GET_FIRMWARE:
        icub_board_report_firmware(board, ICUB_STRAIN_PROTOCOL_MAJOR, ICUB_STRAIN_PROTOCOL_MINOR,
                                   request[0] == ICUB_STRAIN_PROTOCOL_MAJOR &&
                                       request[1] <= ICUB_STRAIN_PROTOCOL_MINOR,
                                   reply);
        return true;
    default:
        return false;
    }
}

/* Obeys a command of class 2 (struct icub_board_ops). */
static bool strain_board_command(struct icub_board *icub, const struct bus_frame *frame,
                                 const int64_t *request, int64_t *reply, bool *answer)
{
    struct board *board = &icub->board;
    unsigned code = frame->data[0];

    (void)answer;
    strain_board_calibrate_held(strain_board_of(board));
    switch (code) {
    case ICUB_STRAIN_SET_CALIBRATION_TARE:
    case ICUB_STRAIN_SET_CURRENT_TARE:
        return strain_board_command_tare(strain_board_of(board), frame, request);
    case ICUB_STRAIN_SET_MATRIX:
    case ICUB_STRAIN_GET_MATRIX:
    case ICUB_STRAIN_SET_FULL_SCALE:
    case ICUB_STRAIN_GET_FULL_SCALE:
    case ICUB_STRAIN_SET_DAC:
    case ICUB_STRAIN_GET_DAC:
    case ICUB_STRAIN_GET_CALIBRATION_TARE:
        return strain_board_command_channel(strain_board_of(board), code, request, reply);
    default:
        return strain_board_get(board, code, request, reply) ||
               strain_board_set(board, code, request);
    }
}

/* ---- periodic frames ---- */

/* Sends three channels from `first` on. With saturation there is a seventh byte: a bit for any
 * saturated channel, then two bits per channel. */
static void strain_board_send_frame(struct board *board, struct frame_sink *sink,
                                    enum icub_analog_type type, const int32_t *counts, int first)
{
    const struct strain_board *strain = strain_board_of(board);
    int64_t values[HALF];
    uint8_t data[ICUB_STRAIN_SATURATED_LENGTH] = {0};
    uint8_t len = icub_analog_frames[type].length;

    for (int i = 0; i < HALF; i++) {
        values[i] = counts[first + i] + ICUB_STRAIN_ZERO;
    }
    fields_encode(icub_analog_frames[type].fields, values, data);
    if (strain_board_is_saturated(strain)) {
        data[len++] =
            (uint8_t)(1 | strain->saturated[first] << 2 | strain->saturated[first + 1] << 4 |
                      strain->saturated[first + 2] << 6);
    }
    board_send(board, sink, icub_id(ICUB_PERIODIC_ANALOG, board->address, type), len, data);
}

/* Passes a sent frame to the motor boards on the bus, because they use its torques (struct
 * board_ops). */
static void strain_board_sent(struct board *board, const struct bus_frame *frame)
{
    enum icub_analog_type type = (enum icub_analog_type)(frame->id & 0xf);

    if (frame->id >> 8 == ICUB_PERIODIC_ANALOG && (type == ICUB_FORCE || type == ICUB_TORQUE)) {
        icub_bus_hear_strain(board->bus, board->address, type, frame->data, board->boards->now_ns);
    }
}

/* Sends the frames of the transmit mode when due (struct board_ops). */
static void strain_board_transmit(struct board *board, struct ms_span span, struct frame_sink *sink)
{
    struct strain_board *strain = strain_board_of(board);
    bool raw = strain->mode == ICUB_STRAIN_UNCALIBRATED, both = strain->mode == ICUB_STRAIN_BOTH;
    int32_t counts[BOARD_CHANNELS];

    (void)span;
    /* Store the readings for `held`, unless a channel is saturated */
    if (!strain_board_is_saturated(strain)) {
        memcpy(strain->good, strain->adc, sizeof strain->good);
        strain->good_due = true;
    }
    if (!board_is_due(board, &strain->next_ns, strain->period_ns) ||
        (strain->mode != ICUB_STRAIN_CALIBRATED && !raw && !both)) {
        return;
    }
    strain_board_calibrate_held(strain);
    strain_board_add_calibration_tares(strain, strain->adc, counts);
    strain_board_send_frame(board, sink, ICUB_FORCE, raw ? counts : strain->held, 0);
    strain_board_send_frame(board, sink, ICUB_TORQUE, raw ? counts : strain->held, HALF);
    if (both) {
        strain_board_send_frame(board, sink, ICUB_UNCALIBRATED_FORCE, counts, 0);
        strain_board_send_frame(board, sink, ICUB_UNCALIBRATED_TORQUE, counts, HALF);
    }
}

/* Functions that force-torque and pseudo-STRAIN boards share */
#define STRAIN_BOARD(function)                                                                     \
    {                                                                                              \
        .base = {.size = sizeof(struct strain_board),                                              \
                 .identity = {.type = ICUB_BOARD_STRAIN, .major = 3, .minor = 0, .build = 5},      \
                 .periodic_max = 4,                                                                \
                 .power_up = strain_board_power_up,                                                \
                 .sample = function,                                                               \
                 .transmit = strain_board_transmit,                                                \
                 .sent = strain_board_sent},                                                       \
        .commands = icub_strain_commands, .command_count = ICUB_STRAIN_COMMANDS,                   \
        .command_class = ICUB_POLLING_ANALOG, .loader_type = ICUB_BOARD_STRAIN,                    \
        .command = strain_board_command                                                            \
    }

const struct icub_board_ops ft_icub_ops = STRAIN_BOARD(strain_board_sample_ft);
const struct icub_board_ops torque_icub_ops = STRAIN_BOARD(strain_board_sample_torque);
