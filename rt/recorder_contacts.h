/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Contact wrenches as the primitives of a foxglove.SceneUpdate: an arrow along each force, from its
 * center of pressure, and a ball there. On the ground the center of pressure is the point of the
 * plane about which the wrench has no moment along the plane (Sardain and Bessonnet 2004, "Forces
 * acting on a biped robot"); elsewhere that point of the wrench's axis which is nearest to the
 * body's origin. World frame, SI units. RT-safe.
 */
#ifndef RT_RECORDER_CONTACTS_H
#define RT_RECORDER_CONTACTS_H

#include "rt/recorder.h"

enum {
    RECORDER_ARROWS = 64,      /* contacts beyond are not shown */
    RECORDER_ARROW_SIZE = 1024 /* bytes of a contact's arrow and ball in JSON */
};

struct recorder_arrow {
    double at[3]; /* the center of pressure */
    double along[3];
    double length_m;
};

/* Those of a row that touch, in their order: value and pose as of recorder_row; how many. */
size_t recorder_find_arrows(const struct recorder_contacts *contacts, const double *value,
                            const double *pose, struct recorder_arrow arrow[RECORDER_ARROWS]);

/* Lists without their brackets; return where the next byte goes. */
char *recorder_print_arrows(const struct recorder_arrow *arrow, size_t count, char *at);
char *recorder_print_pressures(const struct recorder_arrow *arrow, size_t count, char *at);

#endif
