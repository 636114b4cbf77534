/* SPDX-License-Identifier: Apache-2.0 */
/* Sends the periodic frames of a motor board in their slots. */
#include "boards/icub/motor_private.h"

/* Returns whether the policy asks for a type of frame. */
static bool motor_board_broadcasts(const struct motor_board *motor, enum icub_motor_type type)
{
    return motor->policy >> (type - 1) & 1;
}

/* Builds a frame from its row and sends it. */
static void motor_board_send_frame(struct board *board, struct frame_sink *sink,
                                   enum icub_motor_type type, const int64_t *values)
{
    const struct icub_frame_type *row = &icub_motor_frames[type];
    uint8_t data[8];

    fields_encode(row->fields, values, data);
    board_send(board, sink, icub_id(ICUB_PERIODIC_MOTOR, board->address, type), row->length, data);
}

/* Sends a frame of up to four values if the policy asks for it. */
static void motor_board_send_if_wanted(struct board *board, struct frame_sink *sink,
                                       enum icub_motor_type type, int64_t v0, int64_t v1,
                                       int64_t v2, int64_t v3)
{
    if (motor_board_broadcasts(motor_board_of(board), type)) {
        motor_board_send_frame(board, sink, type, (const int64_t[]){v0, v1, v2, v3});
    }
}

/* Returns an error counter as STATUS has it: its change since the last one, as far as a byte
 * goes. */
static int64_t can_counter_change(unsigned counter, int *reported)
{
    int64_t change = control_clamp((int64_t)counter - *reported, INT8_MIN, INT8_MAX);

    *reported += (int)change;
    return change & 0xff;
}

/* Sends STATUS and forgets what is reported once. */
static void motor_board_send_status(struct board *board, struct frame_sink *sink)
{
    struct motor_board *motor = motor_board_of(board);
    struct motor_axis *a = &motor->axis[0], *b = &motor->axis[1];

    motor_board_send_frame(
        board, sink, ICUB_STATUS,
        (const int64_t[]){a->faults | a->faults_once, a->mode, b->faults | b->faults_once, b->mode,
                          motor->can | motor_board_can_status(board) |
                              (board->lost_in_status ? ICUB_CAN_TX_OVERFLOW : 0),
                          a->heat | b->heat << 1,
                          can_counter_change(board->can.tec, &motor->reported_tec),
                          can_counter_change(board->can.rec, &motor->reported_rec)});
    a->faults_once = b->faults_once = 0;
    motor->can = 0;
    motor->can_reported = motor_board_can_status(board);
    motor->status_due = board->lost_in_status = false;
}

/* Sends STATUS and ADDITIONAL_STATUS when they are due: periodically, on changes, while a fault
 * lasts. */
static void motor_board_transmit_status(struct board *board, struct frame_sink *sink,
                                        int64_t now_ms)
{
    struct motor_board *motor = motor_board_of(board);
    struct motor_axis *a = &motor->axis[0], *b = &motor->axis[1];
    bool periodic = now_ms - motor->status_ms >= ICUB_STATUS_PERIOD_MS;
    uint8_t lasting = (a->faults | b->faults) &
                      (ICUB_FAULT_UNDER_VOLTAGE | ICUB_FAULT_OVER_VOLTAGE | ICUB_FAULT_EXTERNAL);
    bool now = motor->status_due || periodic || lasting || board->lost_in_status;

    if (!motor_board_broadcasts(motor, ICUB_STATUS) || board->can.bus_off) {
        return; /* in bus-off it would be lost */
    }
    if (now) {
        motor_board_send_status(board, sink);
        motor->status_ms = periodic ? now_ms : motor->status_ms;
    }
    if (now || motor->additional_due) {
        motor_board_send_frame(board, sink, ICUB_ADDITIONAL_STATUS,
                               (const int64_t[]){a->parameter[ICUB_P_INTERACTION] |
                                                 b->parameter[ICUB_P_INTERACTION] << 4});
        motor->additional_due = false;
    }
}

/* Sends speeds and accelerations of the joints. */
static void motor_board_send_joint_speeds(struct board *board, struct frame_sink *sink)
{
    const struct motor_axis *a = &motor_board_of(board)->axis[0],
                            *b = &motor_board_of(board)->axis[1];
    const int64_t *p = a->parameter, *q = b->parameter;

    motor_board_send_if_wanted(
        board, sink, ICUB_VELOCITY, estimator_speed(&a->joint.speed, p[ICUB_P_JOINT_SPEED_SHIFT]),
        estimator_speed(&b->joint.speed, q[ICUB_P_JOINT_SPEED_SHIFT]),
        estimator_acceleration(&a->joint.speed,
                               p[ICUB_P_JOINT_SPEED_SHIFT] + p[ICUB_P_JOINT_ACCELERATION_SHIFT]),
        estimator_acceleration(&b->joint.speed,
                               q[ICUB_P_JOINT_SPEED_SHIFT] + q[ICUB_P_JOINT_ACCELERATION_SHIFT]));
}

/* Sends speeds and accelerations of the motors. */
static void motor_board_send_motor_speeds(struct board *board, struct frame_sink *sink)
{
    const struct motor_axis *a = &motor_board_of(board)->axis[0],
                            *b = &motor_board_of(board)->axis[1];
    const int64_t *p = a->parameter, *q = b->parameter;

    motor_board_send_if_wanted(
        board, sink, ICUB_MOTOR_SPEED,
        estimator_speed(&a->motor.speed, p[ICUB_P_MOTOR_SPEED_SHIFT]),
        estimator_speed(&b->motor.speed, q[ICUB_P_MOTOR_SPEED_SHIFT]),
        estimator_acceleration(&a->motor.speed,
                               p[ICUB_P_MOTOR_SPEED_SHIFT] + p[ICUB_P_MOTOR_ACCELERATION_SHIFT]),
        estimator_acceleration(&b->motor.speed,
                               q[ICUB_P_MOTOR_SPEED_SHIFT] + q[ICUB_P_MOTOR_ACCELERATION_SHIFT]));
}

/* Sends the frames of slot 3, as far as the policy asks for them. */
static void motor_board_transmit_slot_3(struct board *board, struct frame_sink *sink)
{
    const struct motor_axis *a = &motor_board_of(board)->axis[0],
                            *b = &motor_board_of(board)->axis[1];

    motor_board_send_if_wanted(board, sink, ICUB_CURRENT, motor_axis_current_ma(a),
                               motor_axis_current_ma(b), 0, 0);
    if (board->lost_in_overflow && motor_board_broadcasts(motor_board_of(board), ICUB_OVERFLOW)) {
        board->lost_in_overflow = false;
        motor_board_send_frame(board, sink, ICUB_OVERFLOW, NULL);
    }
    motor_board_send_joint_speeds(board, sink);
    motor_board_send_if_wanted(board, sink, ICUB_PID_ERROR, a->position_pid.error,
                               b->position_pid.error, a->torque_pid.error, b->torque_pid.error);
    motor_board_send_if_wanted(board, sink, ICUB_DEBUG, a->torque, b->torque, a->torque_reference,
                               b->torque_reference);
    motor_board_send_if_wanted(board, sink, ICUB_MOTOR_POSITION, a->motor.raw, b->motor.raw, 0, 0);
    motor_board_send_motor_speeds(board, sink);
}

void motor_board_transmit(struct board *board, struct ms_span span, struct frame_sink *sink)
{
    const struct motor_axis *a = &motor_board_of(board)->axis[0],
                            *b = &motor_board_of(board)->axis[1];
    unsigned slots = 0;

    /* A tick may complete several slots, or none */
    for (int64_t ms = span.from; ms < span.to && ms < span.from + ICUB_SLOTS; ms++) {
        slots |= 1u << ms % ICUB_SLOTS;
    }

    if (slots & 1u << 0) {
        motor_board_send_if_wanted(board, sink, ICUB_POSITION, motor_axis_position(a),
                                   motor_axis_position(b), 0, 0);
    }
    if (slots & 1u << 1) {
        motor_board_send_if_wanted(board, sink, ICUB_PID_VALUE, a->output, b->output, a->pwm,
                                   b->pwm);
    }
    if (slots & 1u << 2) {
        motor_board_transmit_status(board, sink, span.to);
    }
    if (slots & 1u << 3) {
        motor_board_transmit_slot_3(board, sink);
    }
}
