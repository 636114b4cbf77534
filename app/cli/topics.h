/* SPDX-License-Identifier: Apache-2.0 */
/* Parts of the manual that belong to no command: coman-hil help TOPIC. Each prints itself. */
#ifndef RT_TOPICS_H
#define RT_TOPICS_H

#include <stdio.h>

void topic_rt(FILE *out);

#endif
