/* SPDX-License-Identifier: Apache-2.0 */
/* Words of the DBC format that its writer and its reader share. */
#ifndef CANBUS_DBC_PRIVATE_H
#define CANBUS_DBC_PRIVATE_H

#define DBC_NOBODY "Vector__XXX" /* stands for no node */

#define DBC_NAME "DBName"
#define DBC_BUS_TYPE "BusType"
#define DBC_BITRATE "Baudrate"
#define DBC_DATA_BITRATE "BaudrateCANFD"
#define DBC_CYCLE "GenMsgCycleTime"
#define DBC_FORMAT "VFrameFormat"
#define DBC_LENGTH "FrameLength"

/* values of BusType and VFrameFormat */
#define DBC_BUS_CLASSIC "CAN"
#define DBC_BUS_FD "CAN FD"
enum { DBC_FORMAT_CLASSIC = 0, DBC_FORMAT_FD = 14 };

/* Symbols of the format, listed in its head (NS_). */
enum { DBC_SYMBOLS = 27 };
extern const char *const dbc_symbols[DBC_SYMBOLS];

/* The lines that define the attributes and their defaults, as they stand in every file. */
extern const char dbc_definitions[];

#endif
