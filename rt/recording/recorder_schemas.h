/* SPDX-License-Identifier: Apache-2.0 */
/* JSON Schemas of the messages in a recording's MCAP file: those of the recorder's own channels,
 * and the schema of scenes. RT-safe: constants. */
#ifndef RT_RECORDING_RECORDER_SCHEMAS_H
#define RT_RECORDING_RECORDER_SCHEMAS_H

extern const char recorder_schema_frame[];      /* coman_hil.Frame */
extern const char recorder_schema_log[];        /* foxglove.Log */
extern const char recorder_schema_transforms[]; /* foxglove.FrameTransforms */
extern const char recorder_schema_scene[];      /* foxglove.SceneUpdate */

#endif
