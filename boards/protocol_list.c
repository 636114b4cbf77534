/* SPDX-License-Identifier: Apache-2.0 */
/* Lists the protocols: boards/CMakeLists.txt makes the list of the folders that are modules. */
#include "boards/protocol_list.h"

#include "base/array.h"

#include <string.h>

#define PROTOCOL_ADDRESS(NAME) &protocol_##NAME,
static const struct protocol *const protocols[] = {PROTOCOLS(PROTOCOL_ADDRESS)};

/* A member for each, so that its offset is its index. */
#define PROTOCOL_MEMBER(NAME) char NAME;
struct protocol_index {
    PROTOCOLS(PROTOCOL_MEMBER)
};

#define PROTOCOL_WORD(NAME) {#NAME, (int)offsetof(struct protocol_index, NAME)},
const struct word protocol_words[] = {PROTOCOLS(PROTOCOL_WORD){NULL, 0}};

const struct protocol *protocol_at(size_t index)
{
    return index < ARRAY_COUNT(protocols) ? protocols[index] : NULL;
}

const struct protocol *protocol_find(const char *name)
{
    for (size_t i = 0; i < ARRAY_COUNT(protocols); i++) {
        if (!strcmp(protocols[i]->name, name)) {
            return protocols[i];
        }
    }
    return NULL;
}

const char *protocols_list(size_t capability, char *text, size_t size)
{
    const struct protocol *has[ARRAY_COUNT(protocols)];
    size_t count = 0, used = 0;

    for (size_t i = 0; i < ARRAY_COUNT(protocols); i++) {
        if (*(const bool *)((const char *)protocols[i] + capability)) {
            has[count++] = protocols[i];
        }
    }
    text[0] = '\0';
    for (size_t i = 0; i < count && used < size; i++) {
        used += (size_t)snprintf(text + used, size - used, "%s%s",
                                 i == 0           ? ""
                                 : i == count - 1 ? " or "
                                                  : ", ",
                                 has[i]->name);
    }
    return text;
}
