/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Writes the appearance of a rig's bodies and world as a foxglove.SceneUpdate in JSON. It has one
 * entity per frame ("world" or a body's name), valid for the whole recording. Surfaces are drawn as
 * collision shapes (meshes, capsules, boxes, spheres, the ground). A body without surfaces is drawn
 * as an ellipsoid. The ellipsoid has the body's mass, the density of water, and the body's ratios
 * of moments of inertia about the axes of its frame. Not RT-safe.
 */
#ifndef SIM_SCENE_MESSAGE_H
#define SIM_SCENE_MESSAGE_H

#include "base/memory_file.h"
#include "rig/rig.h"

/* Writes the scene to a text, which the caller frees. ERROR_MEMORY. */
enum error_code scene_message_make(const struct rig *rig, struct memory_file *text,
                                   struct error *error);

#endif
