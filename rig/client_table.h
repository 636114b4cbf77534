/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The client table of a rig: what a client needs to command the joints by name on buses of any
 * protocol. It is a text with one row a line; a space separates two words. A run sends it over its
 * gateway, and `coman-hil dbc` writes it beside the DBC files. The client libraries read it; they
 * contain no protocol. Not RT-safe.
 *
 *   rig NAME
 *   joint NAME BUS                     in the order of the rig
 *   sensor NAME BUS                    a force-torque sensor
 *   bus NAME INTERFACE PROTOCOL STEP DONE REFRESH
 *       begins the rows of a bus. STEP, DONE: identifiers of lockstep, hexadecimal; STEP ffffffff =
 *       on another bus. REFRESH 1 = set points are sent every tick
 *   name NUMBER TEXT                   name of a mode
 *   frame ID FORMAT DATA CHECKSUM BYTE COUNTER FIELD
 *       a frame from the host; its number counts from 0 on the bus. A value written to its data
 *       stays there. ID: 8 digits = extended. FORMAT: c = classic, f = FD, r = remote. DATA: "-" =
 *       none. CHECKSUM, BYTE: kind (enum described_checksum) and place. COUNTER: number of the
 *       counter, -1 = none; frames with one number share it. FIELD: place of the counter
 *   setup STAGE FRAME                  makes boards report; two ticks separate stages
 *   cycle FRAME JOINT                  sent every refresh after the setup; while JOINT is off, or
 *                                      "-" = always
 *   switch JOINT QUANTITY STAGE FRAME FIELD COUNT
 *       switches for set points of QUANTITY, or "off"; sends FRAME with COUNT in FIELD
 *   set JOINT QUANTITY FRAME FIELD SCALE OFFSET LOW HIGH MODE
 *       a set point; the first quantity of a joint is the usual one. value = count * SCALE + OFFSET
 *       in SI units, within LOW to HIGH. MODE: name of the mode that applies it
 *   ask JOINT QUANTITY FRAME           a question; the board answers with the loop's gains
 *   report ID FORMAT LENGTH ID_MASK DATA_MASK DATA
 *       a frame from a board; its number counts from 0 on the bus. LENGTH: the shortest
 *   value NAME QUANTITY REPORT FIELD SCALE OFFSET
 *       a measured value of a joint or a sensor, in SI units
 *   messages BUS                       begins the messages of the bus's DBC
 *   message ID FORMAT LENGTH NAME
 *   signal FIELD SCALE OFFSET SELECTOR LENGTH NAME
 *       of the last message. SELECTOR: value of byte 0 with which it is there; -1 = always, -2 = it
 *       is the selector. LENGTH: of its frame
 *
 * FIELD is START|BITS@ORDER as in a DBC (1+ little-endian unsigned, 0- big-endian signed, 1f
 * float). Bits from 512 on are those of the identifier.
 */
#ifndef RIG_CLIENT_TABLE_H
#define RIG_CLIENT_TABLE_H

#include "rig/rig.h"

#include <stdio.h>

/* Writes the client table of a rig. Write errors stay in `out`. */
enum error_code rig_client_table(const struct rig *rig, FILE *out, struct error *error);

#endif
