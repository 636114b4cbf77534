/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Loads robots from YAML: applies the chosen variant, checks the names, and calls the steps that
 * build the robot in order. Each error has file:line:column.
 */
#include "model/description/yaml.h"

#include "base/text.h"

#include <string.h>

/* ---- names ---- */

/* Returns entry i of an array of named structs of stride bytes each. */
static const struct named *named_entry(const void *array, size_t stride, size_t i)
{
    return (const struct named *)((const char *)array + i * stride);
}

int find_named_entry(const void *array, size_t count, size_t stride, const char *name)
{
    return text_find(array, count, stride, offsetof(struct named, name), name);
}

enum error_code robot_no_memory(struct robot_builder *b)
{
    return error_set(b->error, ERROR_MEMORY, "%.200s: no memory left for this robot",
                     b->file.mark.file);
}

/* Checks that names are words and unique in their list. */
static enum error_code check_named(struct robot_builder *b, const char *what, const void *array,
                                   size_t count, size_t stride)
{
    for (size_t i = 0; i < count; i++) {
        const struct named *entry = named_entry(array, stride, i);
        int first = find_named_entry(array, i, stride, entry->name);

        /* Names appear in messages, logs and command lines, so they must be words */
        if (!text_is_name(entry->name)) {
            return yaml_error(b->error, &entry->mark,
                              "found %s name \"%.63s\", expected letters, digits and _ - . only",
                              what, entry->name);
        }
        if (first >= 0) {
            return yaml_error(b->error, &entry->mark,
                              "found %s \"%s\" again, expected it once (it stands in line %d)",
                              what, entry->name,
                              named_entry(array, stride, (size_t)first)->mark.line);
        }
    }
    return ERROR_NONE;
}

#define CHECK_NAMED(b, what, list, count) check_named(b, what, list, count, sizeof *(list))

/* Checks the names of all lists of the file and of its variants. */
static enum error_code check_all_names(struct robot_builder *b)
{
    const struct robot_yaml *file = &b->file;
    enum error_code code;

    if ((code = CHECK_NAMED(b, "body", file->body, file->nbody)) ||
        (code = CHECK_NAMED(b, "joint", file->joint, file->njoint)) ||
        (code = CHECK_NAMED(b, "frame", file->frame, file->nframe)) ||
        (code = CHECK_NAMED(b, "capsule", file->capsule, file->ncapsule)) ||
        (code = CHECK_NAMED(b, "visual", file->visual, file->nvisual)) ||
        (code = CHECK_NAMED(b, "sensor", file->ft, file->nft)) ||
        (code = CHECK_NAMED(b, "pose", file->pose, file->npose)) ||
        (code = CHECK_NAMED(b, "variant", file->variant, file->nvariant))) {
        return code;
    }
    for (size_t i = 0; i < file->nvariant; i++) {
        const struct variant_yaml *variant = &file->variant[i];

        if ((code = CHECK_NAMED(b, "body", variant->body, variant->nbody)) ||
            (code = CHECK_NAMED(b, "joint", variant->joint, variant->njoint)) ||
            (code = CHECK_NAMED(b, "frame", variant->frame, variant->nframe)) ||
            (code = CHECK_NAMED(b, "capsule", variant->capsule, variant->ncapsule)) ||
            (code = CHECK_NAMED(b, "sensor", variant->ft, variant->nft))) {
            return code;
        }
    }
    return ERROR_NONE;
}

/* ---- variants ---- */

/* Merges the entries of change into *list: each replaces the entry with the same name, or is
 * appended. */
static enum error_code merge_named(struct robot_builder *b, void **list, size_t *count,
                                   const void *change, size_t nchange, size_t stride)
{
    char *merged = arena_alloc(b->arena, *count + nchange, stride);

    if (!merged) {
        return robot_no_memory(b);
    }
    memcpy(merged, *list ? *list : merged, *count * stride);
    for (size_t i = 0; i < nchange; i++) {
        const struct named *entry = named_entry(change, stride, i);
        int at = find_named_entry(merged, *count, stride, entry->name);

        memcpy(merged + (at >= 0 ? (size_t)at : (*count)++) * stride, entry, stride);
    }
    *list = merged;
    return ERROR_NONE;
}

/* Merges the joints of a variant. Each replaces the joint with the same name. A new joint goes
 * before the first joint attached to the body that it moves, or to the end. */
static enum error_code merge_joints(struct robot_builder *b, const struct variant_yaml *variant)
{
    struct robot_yaml *file = &b->file;
    struct joint_yaml *merged =
        arena_alloc(b->arena, file->njoint + variant->njoint, sizeof *merged);
    size_t count = file->njoint;

    if (!merged) {
        return robot_no_memory(b);
    }
    memcpy(merged, file->joint, count * sizeof *merged);
    /* Replace joints first, because they determine the positions of new joints */
    for (size_t i = 0; i < variant->njoint; i++) {
        int at = find_named_entry(merged, count, sizeof *merged, variant->joint[i].joint.name);

        if (at >= 0) {
            merged[at] = variant->joint[i];
        }
    }
    for (size_t i = 0; i < variant->njoint; i++) {
        const struct joint_yaml *joint = &variant->joint[i];
        size_t at = 0;

        if (find_named_entry(merged, count, sizeof *merged, joint->joint.name) >= 0) {
            continue;
        }
        while (at < count && strcmp(merged[at].parent, joint->child) != 0) {
            at++;
        }
        memmove(&merged[at + 1], &merged[at], (count - at) * sizeof *merged);
        merged[at] = *joint;
        count++;
    }
    file->joint = merged;
    file->njoint = count;
    return ERROR_NONE;
}

/* Applies a variant: each of its entries replaces the robot's entry with the same name, or is
 * added. */
static enum error_code apply_variant(struct robot_builder *b, struct variant_yaml *variant)
{
    struct robot_yaml *file = &b->file;
    void *body = file->body, *frame = file->frame, *capsule = file->capsule, *ft = file->ft;
    enum error_code code;

    if ((code = merge_joints(b, variant)) ||
        (code = merge_named(b, &body, &file->nbody, variant->body, variant->nbody,
                            sizeof *file->body)) ||
        (code = merge_named(b, &frame, &file->nframe, variant->frame, variant->nframe,
                            sizeof *file->frame)) ||
        (code = merge_named(b, &capsule, &file->ncapsule, variant->capsule, variant->ncapsule,
                            sizeof *file->capsule)) ||
        (code = merge_named(b, &ft, &file->nft, variant->ft, variant->nft, sizeof *file->ft)) ||
        (code = robot_change_drive(b, &variant->drive))) {
        return code;
    }
    file->body = body;
    file->frame = frame;
    file->capsule = capsule;
    file->ft = ft;
    if (yaml_has(&variant->mark, "passive")) {
        file->passive = variant->passive;
    }
    return ERROR_NONE;
}

/* Applies the variant with this name. NULL or "" selects the robot without a variant. mark: place
 * of the name, for errors. */
static enum error_code choose_variant(struct robot_builder *b, const char *name,
                                      const struct yaml_mark *mark)
{
    const struct robot_yaml *file = &b->file;
    enum error_code code = ERROR_NONE;
    int at = 0;

    if (!name || name[0] == '\0') {
        return ERROR_NONE;
    }
    if (file->nvariant == 0) {
        code =
            yaml_error(b->error, mark,
                       "found variant \"%.63s\" of a robot without variants, expected none", name);
    } else {
        code = yaml_find_name(YAML_NAMES(file->variant, file->nvariant, name), "variant", name,
                              mark, &at, b->error);
    }
    if (code) {
        return mark->file ? code : error_prefix(b->error, "%.200s", file->mark.file);
    }
    return apply_variant(b, &file->variant[at]);
}

/* ---- the whole file ---- */

enum error_code robot_load(const char *path, const char *variant, struct arena *arena,
                           const struct robot **robot, struct error *error)
{
    return robot_load_named(path, variant, &(struct yaml_mark){0}, arena, robot, error);
}

enum error_code robot_load_named(const char *path, const char *variant,
                                 const struct yaml_mark *mark, struct arena *arena,
                                 const struct robot **robot, struct error *error)
{
    struct robot_builder b = {.arena = arena, .error = error};
    enum error_code code = yaml_read_file(path, &robot_file_schema, arena, &b.file, error);

    if (code) {
        return code;
    }
    b.robot = arena_alloc(arena, 1, sizeof *b.robot);
    if (!b.robot) {
        return robot_no_memory(&b);
    }

    /* Build independent parts first, then parts that refer to earlier parts */
    b.robot->name = b.file.name;
    b.robot->file = b.file.mark.file;
    b.robot->source_hash = b.file.hash;
    b.robot->floating = b.file.floating;
    memcpy(b.robot->gravity, b.file.gravity, sizeof b.robot->gravity);
    if ((code = check_all_names(&b)) || (code = robot_take_drive(&b, &b.file.drive)) ||
        (code = choose_variant(&b, variant, mark)) || (code = robot_check_own_drives(&b)) ||
        (code = robot_build_hydraulic_supply(&b)) || (code = robot_build_tree(&b)) ||
        (code = robot_build_couplings(&b)) || (code = robot_build_frames(&b)) ||
        (code = robot_build_capsules(&b)) || (code = robot_build_visuals(&b)) ||
        (code = robot_build_sensors(&b)) || (code = robot_build_poses(&b))) {
        return code;
    }

    /* Check the whole robot last */
    if (robot_finish(b.robot, error)) {
        return error_prefix(error, "%.200s", b.file.mark.file);
    }
    *robot = b.robot;
    return ERROR_NONE;
}
