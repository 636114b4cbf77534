/* SPDX-License-Identifier: Apache-2.0 */
/* Private to canbus: words of the DBC format that no name may be and that the writer needs.
 * Not RT-safe. */
#ifndef CANBUS_DBC_PRIVATE_H
#define CANBUS_DBC_PRIVATE_H

#define DBC_NOBODY "Vector__XXX" /* the format's word for no node */

/* Symbols of the format, listed in its head (NS_). */
enum { DBC_SYMBOLS = 27 };
extern const char *const dbc_symbols[DBC_SYMBOLS];

#endif
