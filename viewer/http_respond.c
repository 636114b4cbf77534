/* SPDX-License-Identifier: Apache-2.0 */
/* Answers HTTP requests: for the page (the bundle viewer/page.js.gz, included in the program), for
 * meshes, for the database of messages, and for WebSockets. */
#include "viewer/private.h"

#include "base/array.h"
#include "base/text.h"

#include <stdio.h>
#include <strings.h>

extern const unsigned char viewer_page_begin[], viewer_page_end[];
__asm__(".section .rodata\n"
        ".balign 16\n"
        ".global viewer_page_begin\n"
        "viewer_page_begin:\n"
        ".incbin \"" VIEWER_PAGE "\"\n"
        ".global viewer_page_end\n"
        "viewer_page_end:\n"
        ".byte 0\n"
        ".previous\n");

/* Headers of each answer. The page cannot load anything from other sites, and other sites cannot
 * embed it. Caching is disabled, because tokens and bundles change. */
#define HEADERS                                                                                    \
    "Content-Security-Policy: default-src 'self'; base-uri 'none'; form-action 'none'; "           \
    "frame-ancestors 'none'\r\n"                                                                   \
    "X-Content-Type-Options: nosniff\r\n"                                                          \
    "Referrer-Policy: no-referrer\r\n"                                                             \
    "Cross-Origin-Resource-Policy: same-origin\r\n"                                                \
    "Cross-Origin-Opener-Policy: same-origin\r\n"                                                  \
    "Cache-Control: no-store\r\n"                                                                  \
    "Connection: close\r\n"

#define TEXT "text/plain; charset=utf-8"

enum { RESPONSE_MAX = 1024 + sizeof(struct error) }; /* a header and a message */

static const char index_page[] =
    "<!doctype html>\n"
    "<html lang=\"en\">\n"
    "<head>\n"
    "<meta charset=\"utf-8\">\n"
    "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
    "<meta name=\"color-scheme\" content=\"light dark\">\n"
    "<title>coman-hil</title>\n"
    "<link rel=\"icon\" href=\"/icon.svg\">\n"
    "<script type=\"module\" src=\"/page.js\"></script>\n"
    "</head>\n"
    "<body><noscript>This page needs JavaScript.</noscript></body>\n"
    "</html>\n";

/* The page's icon: a knee, SVG. */
static const char icon[] = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 32 32\"><rect "
                           "width=\"32\" height=\"32\" rx=\"7\" fill=\"#1f6feb\"/><path d=\"M12 "
                           "5l7 10-7 10h9\" fill=\"none\" stroke=\"#fff\" stroke-width=\"4\" "
                           "stroke-linecap=\"round\" stroke-linejoin=\"round\"/></svg>\n";

struct status_text {
    int status;
    const char *phrase, *text;
};

static const struct status_text texts[] = {
    {200, "OK", ""},
    {400, "Bad Request", "This is no request that a browser sends."},
    {401, "Unauthorized", "The token is missing or wrong: take the address that the run printed."},
    {403, "Forbidden",
     "This address or page may not ask here: take the address that the run "
     "printed, with the number of the machine instead of a name."},
    {404, "Not Found", "There is no such page. The page is at /."},
    {405, "Method Not Allowed", "Only GET is understood."},
    {413, "Content Too Large", "A request has no body here."},
    {414, "URI Too Long", "The address is too long."},
    {426, "Upgrade Required", "Here is a WebSocket (RFC 6455, version 13)."},
    {431, "Request Header Fields Too Large", "The request is too long."},
    {500, "Internal Server Error", "There is no memory for the answer."},
    {505, "HTTP Version Not Supported", "Only HTTP/1.1 is understood."},
};

/* Returns the texts of a status; for an unknown status, the texts of 400. */
static const struct status_text *find_status_text(int status)
{
    for (size_t i = 0; i < ARRAY_COUNT(texts); i++) {
        if (texts[i].status == status) {
            return &texts[i];
        }
    }
    return &texts[1];
}

/* Sends a header, a text (copied; NULL = none), and the bytes of a file in constant memory. */
static void respond_with(struct viewer *viewer, struct viewer_client *client, int status,
                         const struct viewer_file *file, const char *text)
{
    char *to = (char *)client_room(viewer, client, RESPONSE_MAX);

    client->mode = CLIENT_CLOSING;
    if (!to) {
        return;
    }
    client->filled += (size_t)snprintf(to, RESPONSE_MAX,
                                       "HTTP/1.1 %d %s\r\n" HEADERS
                                       "Content-Type: %s\r\n%sContent-Length: %zu\r\n\r\n%s",
                                       status, find_status_text(status)->phrase, file->type,
                                       file->gzip ? "Content-Encoding: gzip\r\n" : "",
                                       text ? strlen(text) : file->size, text ? text : "");
    client->body = file->data;
    client->body_size = file->size;
    client_flush(viewer, client);
}

/* Sends a status with a text (NULL = the status's own). */
static void respond_text(struct viewer *viewer, struct viewer_client *client, int status,
                         const char *text)
{
    respond_with(viewer, client, status, &(struct viewer_file){.type = TEXT},
                 text ? text : find_status_text(status)->text);
}

/* ---- tokens ---- */

/* Compares tokens in constant time, so that the time does not reveal the number of equal
 * letters. */
static bool token_is(const char *token, const char *given)
{
    unsigned difference = 0;

    if (strlen(given) != VIEWER_TOKEN - 1) {
        return false;
    }
    for (size_t i = 0; i < VIEWER_TOKEN - 1; i++) {
        difference |= (unsigned char)(token[i] ^ given[i]);
    }
    return difference == 0;
}

enum viewer_right viewer_token_right(const struct viewer *viewer, const char *token)
{
    return token_is(viewer->token[1], token) && viewer->config.control ? RIGHT_CONTROL
           : token_is(viewer->token[0], token)                         ? RIGHT_LOOK
                                                                       : RIGHT_NONE;
}

/* ---- available resources ---- */

/* Finds a file of the page, which is public. */
static bool respond_find_page(const char *path, struct viewer_file *file)
{
    if (strcmp(path, "/") == 0) {
        *file = (struct viewer_file){"text/html; charset=utf-8", index_page, sizeof index_page - 1,
                                     false};
    } else if (strcmp(path, "/page.js") == 0) {
        *file = (struct viewer_file){"text/javascript; charset=utf-8", viewer_page_begin,
                                     (size_t)(viewer_page_end - viewer_page_begin), true};
    } else if (strcmp(path, "/icon.svg") == 0) {
        *file = (struct viewer_file){"image/svg+xml", icon, sizeof icon - 1, false};
    } else {
        return false;
    }
    return true;
}

/* Parses the number of a path of the form PREFIX NUMBER. The number must be less than count.
 * Returns false for other paths. */
static bool respond_find_number(const char *path, const char *prefix, size_t count, int64_t *number)
{
    const size_t length = strlen(prefix);

    return strncmp(path, prefix, length) == 0 &&
           text_to_int(path + length, 0, (int64_t)count - 1, number);
}

/* Finds data of the run, which need a token: the database of messages, events, files of the
 * recording, rows of a second recording, and meshes of surfaces and visuals. Returns the HTTP
 * status. why: receives the reason if a visual has no mesh. */
static int respond_find_data(struct viewer *viewer, const char *path, struct viewer_file *file,
                             struct error *why)
{
    const struct recording *shown = viewer->config.recording, *with = viewer->config.with;
    const struct recorded_file *recorded = NULL;
    const struct viewer_file *found = file;
    int64_t number;

    *file = (struct viewer_file){.type = "text/csv; charset=utf-8"};
    if (strcmp(path, "/messages.json") == 0) {
        if (!viewer_make_database(viewer)) {
            return 500;
        }
        *file = (struct viewer_file){"application/json", viewer->database, viewer->database_size,
                                     false};
        return 200;
    }
    if (strcmp(path, "/events.log") == 0 && shown) {
        recorded = &shown->events;
        file->type = TEXT;
    } else if (strcmp(path, "/with/signals.csv") == 0 && with) {
        recorded = &with->signals.file;
    } else if (strcmp(path, "/with/poses.csv") == 0 && with) {
        recorded = &with->poses.file;
    } else if (respond_find_number(path, "/mesh/", viewer->rig->contact.nsurface, &number)) {
        found = viewer_mesh_file(viewer, (size_t)number);
    } else if (respond_find_number(path, "/visual/", viewer->rig->robot->nvisual, &number)) {
        found = viewer_visual_file(viewer, (size_t)number, why);
    } else if (strncmp(path, "/recording/", 11) != 0 || !viewer->ended ||
               !viewer_find_file(viewer, path + 11, file)) {
        return 404;
    }
    if (recorded) {
        file->data = recorded->data;
        file->size = recorded->size;
    } else if (found) {
        *file = *found;
    }
    return found ? 200 : 404;
}

/* Upgrades the connection to a WebSocket. */
static void respond_upgrade(struct viewer *viewer, struct viewer_client *client,
                            const struct http_request *request)
{
    char accept[WEBSOCKET_ACCEPT], *to = (char *)client_room(viewer, client, 256);

    if (!request->upgrade || !to) {
        respond_text(viewer, client, 426, NULL);
        return;
    }
    websocket_accept(request->key, accept);
    client->filled += (size_t)snprintf(to, 256,
                                       "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n"
                                       "Connection: Upgrade\r\nSec-WebSocket-Accept: %s\r\n\r\n",
                                       accept);
    client->mode = CLIENT_SOCKET;
    client->since_ns = viewer->now_ns;
    client_flush(viewer, client);
}

void viewer_respond(struct viewer *viewer, struct viewer_client *client, int status,
                    const struct http_request *request)
{
    struct error why = {.text = ""};
    struct viewer_file file;

    /* Refuse invalid requests, and requests for another host. The page is public; its data need a
     * token */
    if (status == 200 && !http_request_is_ours(request, &viewer->bound)) {
        viewer->counters.refused++;
        status = 403;
    } else if (status == 200 && strcmp(request->path, "/socket") == 0) {
        respond_upgrade(viewer, client, request);
        return;
    } else if (status == 200 && !respond_find_page(request->path, &file)) {
        const char *token = request->authorization + 6 + strspn(request->authorization + 6, " ");

        if (strncasecmp(request->authorization, "Bearer ", 7) == 0 &&
            viewer_token_right(viewer, token) != RIGHT_NONE) {
            status = respond_find_data(viewer, request->path, &file, &why);
        } else {
            viewer->counters.refused++;
            status = 401;
        }
    }
    if (status == 200) {
        respond_with(viewer, client, status, &file, NULL);
    } else {
        respond_text(viewer, client, status, why.text[0] ? why.text : NULL);
    }
}
