/* SPDX-License-Identifier: Apache-2.0 */
/* Computes the answers to WebSocket keys, and reads and writes frames. */
#include "viewer/websocket.h"

#include <stdio.h>
#include <string.h>

/* ---- SHA-1, FIPS 180-4: a checksum that the protocol requires, not for security ---- */

enum { SHA1_BLOCK = 64, SHA1_SIZE = 20 };

static uint32_t sha1_rotate(uint32_t x, int by)
{
    return x << by | x >> (32 - by);
}

/* Adds a block to the digest. */
static void sha1_add_block(uint32_t h[5], const uint8_t block[SHA1_BLOCK])
{
    uint32_t w[80], a = h[0], b = h[1], c = h[2], d = h[3], e = h[4];

    /* The message schedule */
    for (int t = 0; t < 16; t++) {
        w[t] = (uint32_t)block[4 * t] << 24 | (uint32_t)block[4 * t + 1] << 16 |
               (uint32_t)block[4 * t + 2] << 8 | block[4 * t + 3];
    }
    for (int t = 16; t < 80; t++) {
        w[t] = sha1_rotate(w[t - 3] ^ w[t - 8] ^ w[t - 14] ^ w[t - 16], 1);
    }

    /* Four times twenty rounds */
    for (int t = 0; t < 80; t++) {
        static const uint32_t K[4] = {0x5a827999, 0x6ed9eba1, 0x8f1bbcdc, 0xca62c1d6};
        uint32_t f = t < 20   ? (b & c) | (~b & d)
                     : t < 40 ? b ^ c ^ d
                     : t < 60 ? (b & c) | (b & d) | (c & d)
                              : b ^ c ^ d;
        uint32_t next = sha1_rotate(a, 5) + f + e + K[t / 20] + w[t];

        e = d;
        d = c;
        c = sha1_rotate(b, 30);
        b = a;
        a = next;
    }
    h[0] += a;
    h[1] += b;
    h[2] += c;
    h[3] += d;
    h[4] += e;
}

void websocket_accept(const char *key, char accept[WEBSOCKET_ACCEPT])
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    uint8_t digest[SHA1_SIZE + 1] = {0};
    char text[96];

    snprintf(text, sizeof text, "%.24s258EAFA5-E914-47DA-95CA-C5AB0DC85B11", key);

    /* Compute the SHA-1 digest of the text, at most two blocks with padding */
    uint32_t h[5] = {0x67452301, 0xefcdab89, 0x98badcfe, 0x10325476, 0xc3d2e1f0};
    uint8_t block[2 * SHA1_BLOCK] = {0};
    size_t size = strlen(text), blocks = size + 9 > SHA1_BLOCK ? 2 : 1;

    /* Pad the text: a one bit, zeros, and the text's length in bits, big-endian */
    memcpy(block, text, size);
    block[size] = 0x80;
    block[blocks * SHA1_BLOCK - 2] = (uint8_t)(8 * size >> 8);
    block[blocks * SHA1_BLOCK - 1] = (uint8_t)(8 * size);
    for (size_t i = 0; i < blocks; i++) {
        sha1_add_block(h, block + i * SHA1_BLOCK);
    }
    for (int i = 0; i < SHA1_SIZE; i++) {
        digest[i] = (uint8_t)(h[i / 4] >> (24 - 8 * (i % 4)));
    }

    /* Encode in base64: 20 bytes are six groups of three bytes, and two bytes */
    for (int i = 0; i < 7; i++) {
        uint32_t group = (uint32_t)digest[3 * i] << 16 | (uint32_t)digest[3 * i + 1] << 8 |
                         (i < 6 ? digest[3 * i + 2] : 0U);

        for (int k = 0; k < 4; k++) {
            accept[4 * i + k] = digits[group >> (18 - 6 * k) & 63];
        }
    }
    accept[27] = '=';
    accept[28] = '\0';
}

/* ---- frames ---- */

/* Reads length and offset of the payload. Returns false if the header is incomplete. */
static bool frame_read_length(const uint8_t *data, size_t size, uint64_t *length, size_t *begin)
{
    size_t more = (data[1] & 0x7f) == 126 ? 2 : (data[1] & 0x7f) == 127 ? 8 : 0;

    *length = data[1] & 0x7f;
    if (size < 2 + more) {
        return false;
    }
    if (more > 0) {
        *length = 0;
    }
    for (size_t i = 0; i < more; i++) {
        *length = *length << 8 | data[2 + i];
    }
    *begin = 2 + more + 4; /* 4: the mask */
    return true;
}

int websocket_read(uint8_t *data, size_t size, size_t max, struct websocket_frame *frame)
{
    uint64_t length;
    size_t begin;
    bool control;

    if (size < 2) {
        return 0;
    }
    frame->final = data[0] & 0x80;
    frame->opcode = (enum websocket_opcode)(data[0] & 0x0f);
    control = frame->opcode >= WEBSOCKET_CLOSE;

    /* Refuse reserved bits, unmasked frames, unknown kinds, and long or fragmented control
     * frames */
    if (data[0] & 0x70 || !(data[1] & 0x80) || frame->opcode > WEBSOCKET_PONG ||
        (frame->opcode > WEBSOCKET_BINARY && !control) ||
        (control && (!frame->final || (data[1] & 0x7f) > WEBSOCKET_CONTROL_MAX))) {
        return WEBSOCKET_PROTOCOL;
    }

    /* Check the length before the payload has arrived, so that the server does not wait for a
     * payload that does not fit */
    if (!frame_read_length(data, size, &length, &begin)) {
        return 0;
    }
    if (length > max) {
        return WEBSOCKET_TOO_BIG;
    }
    if (size < begin + length) {
        return 0;
    }
    frame->payload = data + begin;
    frame->size = (size_t)length;
    frame->used = begin + frame->size;
    for (size_t i = 0; i < frame->size; i++) {
        frame->payload[i] ^= data[begin - 4 + i % 4];
    }
    return 1;
}

size_t websocket_header(uint8_t header[WEBSOCKET_HEADER], enum websocket_opcode opcode, size_t size)
{
    size_t more = size > 0xffff ? 8 : size > 125 ? 2 : 0;

    header[0] = (uint8_t)(0x80 | opcode);
    header[1] = (uint8_t)(more == 8 ? 127 : more == 2 ? 126 : size);
    for (size_t i = 0; i < more; i++) {
        header[2 + i] = (uint8_t)((uint64_t)size >> (8 * (more - 1 - i)));
    }
    return 2 + more;
}
