/* SPDX-License-Identifier: Apache-2.0 */
/* Topics of the manual that belong to no command: coman-hil help TOPIC. Each prints itself. Not
 * RT-safe. */
#ifndef APP_CLI_TOPICS_H
#define APP_CLI_TOPICS_H

#include <stdio.h>

void topic_board(FILE *out);
void topic_bus(FILE *out);
void topic_fault(FILE *out);
void topic_rig(FILE *out);
void topic_robot(FILE *out);
void topic_rt(FILE *out);
void topic_scenario(FILE *out);
void topic_signal(FILE *out);

#endif
