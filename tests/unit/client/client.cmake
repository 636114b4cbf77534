# SPDX-License-Identifier: Apache-2.0
hil_test(client SOURCES unit/client/client.c LIBS coman_hil_client Threads::Threads
         -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc,--wrap=getaddrinfo LABELS unit)
