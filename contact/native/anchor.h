/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The anchor of a pair's bristles, for sticking friction (contact.h): a point and an axis fixed in
 * one of the surfaces, and a radius. It stays in place while the contact patch rocks about it. A
 * patch that rolls on drags it along. Each function names its frame; SI units. Pure functions;
 * nothing fails; RT-safe.
 */
#ifndef CONTACT_NATIVE_ANCHOR_H
#define CONTACT_NATIVE_ANCHOR_H

#include "contact/contact.h"
#include "contact/variant.h"

struct native_anchor {
    double point[3], axis[3]; /* point, m; unit vector */
    double radius;            /* m; 0 for a patch that is a point: then there is no anchor */
};

/* Reads the anchor from a pair's bristle state, in the frame of the surface that it is fixed in.
 * Returns false when the state has none. */
bool native_anchor_read(const double y[CONTACT_BRISTLE], struct native_anchor *anchor);

/* Writes the anchor to a bristle state; shear and twist are unchanged. */
void native_anchor_write(const struct native_anchor *anchor, double y[CONTACT_BRISTLE]);

/* Drags an anchor until it is within its play about the contact area (touch: centroid, mean normal
 * and RMS radius in the same frame). Returns whether it moved. */
bool native_anchor_drag(const struct native_anchor *touch, struct native_anchor *anchor);

#endif
