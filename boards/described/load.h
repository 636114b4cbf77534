/* SPDX-License-Identifier: Apache-2.0 */
/* Shared by the parts of the loader of protocol files: load.c looks names up and checks frames,
 * load_fields.c lays their fields out. Not RT-safe. */
#ifndef BOARDS_DESCRIBED_LOAD_H
#define BOARDS_DESCRIBED_LOAD_H

#include "boards/described/protocol.h"
#include "boards/described/schema.h"

struct described_loader {
    const struct raw_described *raw;
    struct described_protocol *made;
    struct arena *arena;
    struct error *error;
};

enum error_code described_no_memory(struct described_loader *l);

/* Checks a name, which tools must be able to take: letters, digits and _, after a letter. */
enum error_code described_check_word(struct described_loader *l, const struct yaml_mark *mark,
                                     const char *word);

/* Lays out the fields of a frame in its data and its identifier: layout, length and repetition;
 * and the places of fields in the identifier. */
enum error_code described_lay_out(struct described_loader *l, const struct raw_described_frame *raw,
                                  struct described_frame *made);

/* Lays out the field of a parameter, which a board tells, or a host sets where it is a setting. */
enum error_code described_lay_out_parameter(struct described_loader *l,
                                            const struct raw_described_field *raw,
                                            struct described_parameter *made);

/* Refuses identifiers that two frames of one board, or of the host and a board, have and nobody
 * tells apart, and frames that never come, as another takes theirs (load_ids.c). Reads the whole
 * list of frames. */
enum error_code described_check_ids(struct described_loader *l);

#endif
