/* SPDX-License-Identifier: Apache-2.0 */
/* JSON Schemas of the recorder's channels. The foxglove.* schemas describe only the fields that the
 * recorder writes. */
#include "rt/recording/recorder_schemas.h"

/* clang-format off */
#define OBJECT(properties) "{\"type\":\"object\",\"properties\":{" properties "}}"
#define LIST(items) "{\"type\":\"array\",\"items\":" items "}"
#define KEY(name, type) "\"" name "\":" type
#define NUMBER "{\"type\":\"number\"}"
#define COUNT "{\"type\":\"integer\",\"minimum\":0}"
#define TEXT "{\"type\":\"string\"}"
#define TRUTH "{\"type\":\"boolean\"}"
#define EMPTY LIST("{\"type\":\"object\"}")

#define TIME OBJECT(KEY("sec", COUNT) "," KEY("nsec", COUNT))
#define VECTOR OBJECT(KEY("x", NUMBER) "," KEY("y", NUMBER) "," KEY("z", NUMBER))
#define QUATERNION \
    OBJECT(KEY("x", NUMBER) "," KEY("y", NUMBER) "," KEY("z", NUMBER) "," KEY("w", NUMBER))
#define COLOR \
    OBJECT(KEY("r", NUMBER) "," KEY("g", NUMBER) "," KEY("b", NUMBER) "," KEY("a", NUMBER))
#define POSE OBJECT(KEY("position", VECTOR) "," KEY("orientation", QUATERNION))

#define SOLID KEY("pose", POSE) "," KEY("size", VECTOR) "," KEY("color", COLOR)
#define ARROW \
    KEY("pose", POSE) "," KEY("shaft_length", NUMBER) "," KEY("shaft_diameter", NUMBER) "," \
    KEY("head_length", NUMBER) "," KEY("head_diameter", NUMBER) "," KEY("color", COLOR)
#define CYLINDER SOLID "," KEY("bottom_scale", NUMBER) "," KEY("top_scale", NUMBER)
#define TRIANGLES \
    KEY("pose", POSE) "," KEY("points", LIST(VECTOR)) "," KEY("color", COLOR) "," \
    KEY("colors", LIST(COLOR)) "," KEY("indices", LIST(COUNT))

const char recorder_schema_frame[] = OBJECT(
    KEY("timestamp", TIME) "," KEY("bus", TEXT) "," KEY("id", COUNT) "," KEY("extended", TRUTH) ","
    KEY("fd", TRUTH) "," KEY("remote", TRUTH) "," KEY("error", TRUTH) "," KEY("length", COUNT) ","
    KEY("data", TEXT));

const char recorder_schema_log[] = OBJECT(
    KEY("timestamp", TIME) "," KEY("level", COUNT) "," KEY("message", TEXT) "," KEY("name", TEXT)
    "," KEY("file", TEXT) "," KEY("line", COUNT));

const char recorder_schema_transforms[] = OBJECT(KEY("transforms", LIST(OBJECT(
    KEY("timestamp", TIME) "," KEY("parent_frame_id", TEXT) "," KEY("child_frame_id", TEXT) ","
    KEY("translation", VECTOR) "," KEY("rotation", QUATERNION)))));

const char recorder_schema_scene[] = OBJECT(
    KEY("deletions", EMPTY) "," KEY("entities", LIST(OBJECT(
    KEY("timestamp", TIME) "," KEY("frame_id", TEXT) "," KEY("id", TEXT) "," KEY("lifetime", TIME)
    "," KEY("frame_locked", TRUTH) "," KEY("metadata", EMPTY) ","
    KEY("arrows", LIST(OBJECT(ARROW))) "," KEY("cubes", LIST(OBJECT(SOLID))) ","
    KEY("spheres", LIST(OBJECT(SOLID))) "," KEY("cylinders", LIST(OBJECT(CYLINDER))) ","
    KEY("triangles", LIST(OBJECT(TRIANGLES))) ","
    KEY("lines", EMPTY) "," KEY("texts", EMPTY) "," KEY("models", EMPTY)))));
/* clang-format on */
