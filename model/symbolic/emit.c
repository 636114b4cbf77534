/* SPDX-License-Identifier: Apache-2.0 */
/* Writes expressions as straight-line C with the vector types of GCC and Clang. */
#include "model/symbolic/emit.h"

#include "base/array.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { TRIG_CHUNK = 8 };

/* Arrays are indexed by node. */
struct emission {
    FILE *file;
    const struct graph *graph;
    const struct derivation *derivation;
    const char *name;
    bool reads[DERIVE_ARRAYS];
    bool keeps; /* the function writes a pose */
    bool *reached;
    bool *early;  /* an angle depends on the node */
    int *slot;    /* index of an angle among all angles, or -1 */
    int nslot;    /* number of slots, a multiple of TRIG_CHUNK */
    int *piece;   /* piece that computes the node */
    int *last;    /* last piece that uses the node */
    int *scratch; /* index in the scratch array, or -1 */
    int *known;   /* last piece in which the value is in a local variable */
    int npiece, current;
    int nscratch;
    int memory[];
};

static const char *const array_name[DERIVE_ARRAYS] = {"inertia", "q",     "v",     "tau", "vdot",
                                                      "ext",     "extra", "added", "pose"};

const char *emit_array_name(enum derive_array array)
{
    return array_name[array];
}

/* Returns the number of operands of a node. */
static int operand_count(enum graph_op op, int width)
{
    switch (op) {
    case GRAPH_CONST:
    case GRAPH_INPUT:
        return 0;
    case GRAPH_ADD:
    case GRAPH_SUB:
    case GRAPH_MUL:
        return 2;
    case GRAPH_PACK:
        return width;
    default:
        return 1;
    }
}

bool emission_keeps(const struct emission *e)
{
    return e->keeps;
}

bool emission_reads(const struct emission *e, enum derive_array array)
{
    return e->reads[array];
}

static const char *vector_type_name(int width)
{
    return width == 1 ? "double" : width == 2 ? "v2" : "v4";
}

/* Writes a number with enough digits that C reads the same double. */
static void write_number(FILE *file, double value)
{
    char text[40];

    snprintf(text, sizeof text, "%.17g", value);
    fprintf(file, "%s%s", text, strpbrk(text, ".e") ? "" : ".0");
}

/* Writes a constant, with braces when it has lanes. */
static void write_constant(FILE *file, const struct graph_node *node)
{
    if (node->width == 1) {
        write_number(file, node->value[0]);
        return;
    }
    fprintf(file, "(%s){", vector_type_name(node->width));
    for (int l = 0; l < node->width; l++) {
        fprintf(file, "%s", l ? ", " : "");
        write_number(file, node->value[l]);
    }
    fprintf(file, "}");
}

/* Writes an operand: its sign, then a constant or the local variable of its node. */
static void write_operand(const struct emission *e, expr value)
{
    const struct graph_node *node = graph_get(e->graph, value);

    if (expr_negative(value)) {
        fputc('-', e->file);
    }
    if (node->op == GRAPH_CONST) {
        write_constant(e->file, node);
    } else {
        fprintf(e->file, "t%u", expr_node(value));
    }
}

/* Writes an element of an array of doubles, as a value with `width` lanes. */
static void write_place(FILE *file, bool reading, int width, const char *array, int at)
{
    if (width == 1) {
        fprintf(file, "%s[%d]", array, at);
    } else {
        fprintf(file, "*(%s%s *)(%s + %d)", reading ? "const " : "", vector_type_name(width), array,
                at);
    }
}

/* Returns whether the lanes of an input are consecutive and aligned. They are for mass properties
 * and poses. */
static bool is_row(const struct graph_node *node)
{
    bool row = node->array == DERIVE_INERTIA ||
               (node->array == DERIVE_POSE && node->index[0] % node->width == 0);

    for (int l = 1; row && l < node->width; l++) {
        row = node->index[l] == node->index[0] + l;
    }
    return row;
}

/* Writes an element of an argument array, or one element per lane. */
static void write_input(const struct emission *e, const struct graph_node *node)
{
    const char *name = array_name[node->array];

    if (node->width == 1 || is_row(node)) {
        write_place(e->file, true, node->width, name, node->index[0]);
        return;
    }
    fprintf(e->file, "(%s){", vector_type_name(node->width));
    for (int l = 0; l < node->width; l++) {
        fprintf(e->file, "%s%s[%d]", l ? ", " : "", name, node->index[l]);
    }
    fprintf(e->file, "}");
}

/* Writes the expression of one node. */
static void write_value(const struct emission *e, const struct graph_node *node)
{
    switch (node->op) {
    /* Write leaves */
    case GRAPH_CONST:
        write_constant(e->file, node);
        break;
    case GRAPH_INPUT:
        write_input(e, node);
        break;
    /* Write arithmetic */
    case GRAPH_ADD:
    case GRAPH_SUB:
    case GRAPH_MUL:
        write_operand(e, node->operand[0]);
        fprintf(e->file, " %c ", node->op == GRAPH_ADD ? '+' : node->op == GRAPH_SUB ? '-' : '*');
        write_operand(e, node->operand[1]);
        break;
    case GRAPH_INVERT:
        fprintf(e->file, "1.0 / ");
        write_operand(e, node->operand[0]);
        break;
    /* Write angles and lanes */
    case GRAPH_SIN:
    case GRAPH_COS:
        /* Write the reference to a sine or cosine, which is computed at the start */
        write_place(e->file, true, node->width, node->op == GRAPH_SIN ? "sine" : "cosine",
                    e->slot[expr_node(node->operand[0])]);
        break;
    case GRAPH_LANE:
        write_operand(e, node->operand[0]);
        fprintf(e->file, "[%d]", node->index[0]);
        break;
    case GRAPH_PACK:
        /* Write one-lane expressions side by side */
        fprintf(e->file, "(%s){", vector_type_name(node->width));
        for (int l = 0; l < node->width; l++) {
            fprintf(e->file, "%s", l ? ", " : "");
            write_operand(e, node->operand[l]);
        }
        fprintf(e->file, "}");
        break;
    }
}

/* Returns whether a node is cheaper to compute again than to store. */
static bool is_cheap(const struct emission *e, uint32_t n)
{
    enum graph_op op = e->graph->node[n].op;

    return e->early[n] || op == GRAPH_INPUT || op == GRAPH_SIN || op == GRAPH_COS ||
           op == GRAPH_LANE;
}

/* Writes the code that puts a node's value into a local variable of this piece. */
static void write_node_value(struct emission *e, uint32_t n)
{
    const struct graph_node *node = &e->graph->node[n];
    bool here = is_cheap(e, n) || e->piece[n] == e->current;

    if (node->op == GRAPH_CONST || e->known[n] == e->current) {
        return;
    }
    e->known[n] = e->current;
    /* Write the operands first. Sines and cosines are already computed */
    for (int m = 0; here && m < operand_count(node->op, node->width); m++) {
        if (node->op != GRAPH_SIN && node->op != GRAPH_COS) {
            write_node_value(e, expr_node(node->operand[m]));
        }
    }
    /* Compute the value here, or read it from the scratch array */
    fprintf(e->file, "    const %s t%u = ", vector_type_name(node->width), n);
    if (here) {
        write_value(e, node);
    } else {
        write_place(e->file, true, node->width, "work", e->scratch[n]);
    }
    fprintf(e->file, ";\n");
    /* Store the value for later pieces */
    if (here && e->scratch[n] >= 0) {
        fprintf(e->file, "    ");
        write_place(e->file, false, node->width, "work", e->scratch[n]);
        fprintf(e->file, " = t%u;\n", n);
    }
}

/* Returns whether a node is computed only once, in the piece assigned to it. */
static bool is_placed(const struct emission *e, uint32_t n)
{
    return e->reached[n] && e->graph->node[n].op != GRAPH_CONST && !is_cheap(e, n);
}

/* Cuts the nodes, in order of creation, into pieces of equal length, about `longest`. */
static void cut_pieces(struct emission *e, int longest)
{
    int total = 0, count = 0, length;

    for (uint32_t n = 0; n < e->graph->count; n++) {
        total += is_placed(e, n);
    }
    e->npiece = total / longest + 1;
    length = total / e->npiece + 1;
    for (uint32_t n = 0; n < e->graph->count; n++) {
        e->piece[n] = is_placed(e, n) ? count++ / length : e->npiece - 1;
    }
}

/* Records that a piece needs a node's value. */
static void note_use(struct emission *e, uint32_t n, int piece)
{
    const struct graph_node *node = &e->graph->node[n];

    if (is_placed(e, n)) {
        e->last[n] = piece > e->last[n] ? piece : e->last[n];
        return;
    }
    for (int m = 0; node->op != GRAPH_CONST && m < operand_count(node->op, node->width); m++) {
        note_use(e, expr_node(node->operand[m]), piece);
    }
}

/* Assigns scratch indices to values that later pieces use. An index is free again after the last
 * use. unused: scratch memory of this function, one entry per node. */
static void place_scratch(struct emission *e, int *unused)
{
    for (int width = GRAPH_LANES; width >= 1; width /= 2) {
        int free_count = 0;

        for (int piece = 0; piece < e->npiece; piece++) {
            for (uint32_t n = 0; n < e->graph->count; n++) {
                if (is_placed(e, n) && e->graph->node[n].width == width && e->piece[n] == piece &&
                    e->last[n] > piece) {
                    e->scratch[n] = free_count ? unused[--free_count] : e->nscratch;
                    e->nscratch += e->scratch[n] == e->nscratch ? width : 0;
                }
            }
            for (uint32_t n = 0; n < e->graph->count; n++) {
                if (e->scratch[n] >= 0 && e->graph->node[n].width == width && e->last[n] == piece) {
                    unused[free_count++] = e->scratch[n];
                }
            }
        }
    }
}

/* Writes the operations of one piece, and the outputs whose values are known after them. */
static void write_piece(struct emission *e, int piece)
{
    e->current = piece;
    for (uint32_t n = 0; n < e->graph->count; n++) {
        if (is_placed(e, n) && e->piece[n] == piece) {
            write_node_value(e, n);
        }
    }
    for (size_t o = 0; o < e->derivation->count; o++) {
        const struct derive_output *output = &e->derivation->output[o];

        if (e->piece[expr_node(output->value)] == piece) {
            write_node_value(e, expr_node(output->value));
            fprintf(e->file, "    ");
            write_place(e->file, false, output->pose ? graph_width(e->graph, output->value) : 1,
                        output->pose ? "pose" : "out", output->index);
            fprintf(e->file, " = ");
            write_operand(e, output->value);
            fprintf(e->file, ";\n");
        }
    }
}

/* Writes the arguments, with or without types. inside: adds the arguments of a piece. */
static void write_arguments(const struct emission *e, bool types, bool inside)
{
    const char *input = types ? "const double *restrict " : "";

    for (int a = 0; a < DERIVE_ARRAYS; a++) {
        if (e->reads[a]) {
            fprintf(e->file, "%s%s, ", input, array_name[a]);
        }
    }
    if (inside && e->nslot) {
        fprintf(e->file, "%ssine, %scosine, ", input, input);
    }
    if (inside && e->nscratch) {
        fprintf(e->file, "%swork, ", types ? "double *restrict " : "");
    }
    if (e->keeps) {
        fprintf(e->file, "%spose, ", types ? "double *restrict " : "");
    }
    fprintf(e->file, "%sout)", types ? "double *restrict " : "");
}

void emission_write(struct emission *e, FILE *file)
{
    e->file = file;

    /* If there are several pieces, write each piece as a function */
    for (int piece = 0; e->npiece > 1 && piece < e->npiece; piece++) {
        fprintf(e->file, "\nTARGET static __attribute__((noinline)) void NAME(%s_%d)(", e->name,
                piece);
        write_arguments(e, true, true);
        fprintf(e->file, "\n{\n");

        /* Write void casts of arguments that a piece may not use */
        for (int a = 0; a < DERIVE_ARRAYS; a++) {
            if (e->reads[a]) {
                fprintf(e->file, "    (void)%s;\n", array_name[a]);
            }
        }
        fprintf(e->file, "%s%s%s    (void)out;\n", e->keeps ? "    (void)pose;\n" : "",
                e->nslot ? "    (void)sine;\n    (void)cosine;\n" : "",
                e->nscratch ? "    (void)work;\n" : "");
        write_piece(e, piece);
        fprintf(e->file, "}\n");
    }

    /* Write the function itself and its local variables */
    fprintf(e->file, "\nTARGET static void NAME(%s)(", e->name);
    write_arguments(e, true, false);
    fprintf(e->file, "\n{\n");
    if (e->nslot) {
        fprintf(e->file, "    double angle[%d] ALIGNED, sine[%d] ALIGNED, cosine[%d] ALIGNED;\n",
                e->nslot, e->nslot, e->nslot);
    }
    if (e->nscratch) {
        fprintf(e->file, "    double work[%d] ALIGNED;\n", e->nscratch);
    }
    if (e->derivation->count == 0) {
        fprintf(e->file, "    (void)out;\n");
    }

    /* Write all sines and cosines first, then the pieces in order */
    int used = 0;

    e->current = e->npiece;
    for (uint32_t n = 0; n < e->graph->count; n++) {
        if (e->slot[n] >= 0) {
            int width = e->graph->node[n].width;

            write_node_value(e, n);
            fprintf(e->file, "    ");
            write_place(e->file, false, width, "angle", e->slot[n]);
            fprintf(e->file, " = t%u;\n", n);
            used += width;
        }
    }
    /* Fill the last chunk, then call the vector function for each chunk */
    for (int s = used; s < e->nslot; s++) {
        fprintf(e->file, "    angle[%d] = 0.0;\n", s);
    }
    for (int s = 0; s < e->nslot; s += TRIG_CHUNK) {
        fprintf(e->file, "    NAME(sincos)(angle + %d, sine + %d, cosine + %d);\n", s, s, s);
    }
    for (int piece = 0; e->npiece > 1 && piece < e->npiece; piece++) {
        fprintf(e->file, "    NAME(%s_%d)(", e->name, piece);
        write_arguments(e, false, true);
        fprintf(e->file, ";\n");
    }
    if (e->npiece == 1) {
        write_piece(e, 0);
    }
    fprintf(e->file, "}\n");
}

/* Adds the operations of a function to count; each lane counts. */
static void count_operations(const struct emission *e, struct symbolic_count *count)
{
    for (size_t n = 0; n < e->graph->count; n++) {
        const struct graph_node *node = &e->graph->node[n];
        size_t width = e->reached[n] ? (size_t)node->width : 0;

        count->add += node->op == GRAPH_ADD || node->op == GRAPH_SUB ? width : 0;
        count->multiply += node->op == GRAPH_MUL ? width : 0;
        count->divide += node->op == GRAPH_INVERT ? width : 0;
        count->sincos += e->slot[n] >= 0 ? width : 0;
        count->statements += width && (node->op == GRAPH_ADD || node->op == GRAPH_SUB ||
                                       node->op == GRAPH_MUL || node->op == GRAPH_INVERT);
    }
    count->operations = count->add + count->multiply + count->divide;
}

enum error_code emission_create(const char *name, const struct graph *graph,
                                const struct derivation *derivation, int longest,
                                struct emission **out, struct symbolic_count *count,
                                struct error *error)
{
    size_t nodes = graph->count;
    /* Allocate the struct, with six arrays of int and two arrays of bool behind it */
    struct emission *e = calloc(1, sizeof *e + nodes * (6 * sizeof(int) + 2 * sizeof(bool)));

    *out = e;
    if (!e) {
        return error_set(error, ERROR_MEMORY, "no memory to write %zu expressions", nodes);
    }
    e->name = name;
    e->graph = graph;
    e->derivation = derivation;
    e->slot = e->memory;
    e->piece = e->memory + nodes;
    e->last = e->memory + 2 * nodes;
    e->scratch = e->memory + 3 * nodes;
    e->known = e->memory + 4 * nodes;
    e->reached = (bool *)(e->memory + 6 * nodes);
    e->early = e->reached + nodes;
    for (size_t n = 0; n < nodes; n++) {
        e->slot[n] = e->last[n] = e->scratch[n] = e->known[n] = -1;
    }

    /* Mark the nodes that the outputs need. Operands have lower numbers than the nodes that use
     * them */
    for (size_t o = 0; o < e->derivation->count; o++) {
        e->reached[expr_node(e->derivation->output[o].value)] = true;
        e->keeps = e->keeps || e->derivation->output[o].pose;
    }
    for (size_t n = e->graph->count; n-- > 0;) {
        const struct graph_node *node = &e->graph->node[n];

        for (int m = 0; e->reached[n] && m < operand_count(node->op, node->width); m++) {
            e->reached[expr_node(node->operand[m])] = true;
        }
        if (e->reached[n] && node->op == GRAPH_INPUT) {
            e->reads[node->array] = true;
        }
    }

    /* Assign an index to each angle. Wide angles come first, for alignment */
    for (int width = GRAPH_LANES; width >= 1; width /= 2) {
        for (size_t n = 0; n < e->graph->count; n++) {
            const struct graph_node *node = &e->graph->node[n];
            uint32_t angle = expr_node(node->operand[0]);

            if (e->reached[n] && (node->op == GRAPH_SIN || node->op == GRAPH_COS) &&
                node->width == width && e->slot[angle] < 0) {
                e->slot[angle] = e->nslot;
                e->nslot += width;
                e->early[angle] = true;
            }
        }
    }
    /* Pad to whole chunks for the vector function */
    while (e->nslot % TRIG_CHUNK) {
        e->nslot++;
    }
    /* Mark the operands of angles, which are needed early too */
    for (size_t n = e->graph->count; n-- > 0;) {
        const struct graph_node *node = &e->graph->node[n];

        for (int m = 0; e->early[n] && m < operand_count(node->op, node->width); m++) {
            e->early[expr_node(node->operand[m])] = true;
        }
    }
    cut_pieces(e, longest);

    /* Find the last piece that uses each node */
    for (uint32_t n = 0; n < e->graph->count; n++) {
        const struct graph_node *node = &e->graph->node[n];

        for (int m = 0; is_placed(e, n) && m < operand_count(node->op, node->width); m++) {
            note_use(e, expr_node(node->operand[m]), e->piece[n]);
        }
    }
    for (size_t o = 0; o < e->derivation->count; o++) {
        uint32_t n = expr_node(e->derivation->output[o].value);

        note_use(e, n, e->piece[n]);
    }

    place_scratch(e, e->memory + 5 * nodes);
    count_operations(e, count);
    return ERROR_NONE;
}

void emission_destroy(struct emission *e)
{
    free(e);
}

/* ---- common text of each file: vector types, sine and cosine ---- */

/*
 * Text of the module's functions for sine and cosine of 8 lanes.
 *
 * Reduction by n pi/2 after Cody and Waite, with pi/2 in 33 + 33 + 53 bits. The first two products
 * are exact (n < 2^16). The rounding error of the second difference and the third product are kept
 * in e, at most 2.5e-16. Taylor polynomials on |r| <= pi/4: the terms left out are below
 * (pi/4)^18/19! = 1.1e-19 relative to r, and (pi/4)^18/18! = 2.1e-18 relative to 1 (alternating
 * series). Above 1e5 rad, portable_sincos uses as many digits of pi as the angle needs. Below,
 * both functions give the same bits. The error measured against long double up to 1e15 rad is 0.86
 * units in the last place.
 */
static const char *const preamble[] = {
    "typedef double v2 __attribute__((vector_size(16), may_alias));",
    "typedef double v4 __attribute__((vector_size(32), may_alias));",
    "typedef double v8 __attribute__((vector_size(64), may_alias));",
    "typedef int64_t w8 __attribute__((vector_size(64), may_alias));",
    "#define ALIGNED __attribute__((aligned(64)))",
    "#define JOIN(a, b) a##b",
    "#define JOIN2(a, b) JOIN(a, b)",
    "#define NAME(function) JOIN2(function##_, VARIANT)",
    "",
    "/* Of coman-hil, the same bits on every machine (base/portable_math.h); elsewhere libm's. */",
    "__attribute__((weak)) void portable_sincos(double x, double *sine, double *cosine);",
    "",
    "/* Angles beyond the reach of the fast reduction, infinities and NaN. */",
    "static __attribute__((noinline, cold)) void sincos_far(const double *x, double *sine,",
    "                                                       double *cosine)",
    "{",
    "    for (int l = 0; l < 8; l++) {",
    "        if (!(fabs(x[l]) <= 1e5)) {",
    "            if (portable_sincos) {",
    "                portable_sincos(x[l], &sine[l], &cosine[l]);",
    "            } else {",
    "                sine[l] = sin(x[l]);",
    "                cosine[l] = cos(x[l]);",
    "            }",
    "        }",
    "    }",
    "}",
};

static const char *const sincos_text[] = {
    "/* Sine and cosine of 8 angles: x = n pi/2 + r + e, then Taylor polynomials in r. */",
    "TARGET static inline void NAME(sincos)(const double *x, double *sine, double *cosine)",
    "{",
    "    const v8 a = *(const v8 *)x;",
    "    const v8 shifted = a * 0.6366197723675814 + 6755399441055744.0;",
    "    const v8 n = shifted - 6755399441055744.0;",
    "    const v8 y = a - n * 1.5707963267341256;",
    "    const v8 r = y - n * 6.077100506303966e-11;",
    "    const v8 e = ((y - r) - n * 6.077100506303966e-11) - n * 2.0222662487959506e-21;",
    "    const v8 z = r * r;",
    "    v8 s = z * 2.8114572543455206e-15 - 7.647163731819816e-13;",
    "    v8 c = z * 4.779477332387385e-14 - 1.1470745597729725e-11;",
    "    s = z * s + 1.6059043836821613e-10;",
    "    c = z * c + 2.08767569878681e-09;",
    "    s = z * s - 2.505210838544172e-08;",
    "    c = z * c - 2.755731922398589e-07;",
    "    s = z * s + 2.7557319223985893e-06;",
    "    c = z * c + 2.4801587301587302e-05;",
    "    s = z * s - 0.00019841269841269841;",
    "    c = z * c - 0.0013888888888888889;",
    "    s = z * s + 0.0083333333333333332;",
    "    c = z * c + 0.041666666666666664;",
    "    s = z * s - 0.16666666666666666;",
    "    const v8 half = 0.5 * z, w = 1.0 - half;",
    "    s = r + (z * (r * s - 0.5 * e) + e);",
    "    c = w + (((1.0 - w) - half) + (z * (z * c) - r * e));",
    "    const w8 k = (w8)shifted;",
    "    const w8 odd = -(k & 1), minus = (k & 2) << 62, turned = ((k + 1) & 2) << 62;",
    "    *(w8 *)sine = (((w8)s & ~odd) | ((w8)c & odd)) ^ minus;",
    "    *(w8 *)cosine = (((w8)c & ~odd) | ((w8)s & odd)) ^ turned;",
    "    const w8 near = ((v8)((w8)a & INT64_MAX) <= 1e5);",
    "    const int64_t *flag = (const int64_t *)&near;",
    "    if (__builtin_expect((flag[0] & flag[1] & flag[2] & flag[3] &",
    "                          flag[4] & flag[5] & flag[6] & flag[7]) == 0, 0)) {",
    "        sincos_far(x, sine, cosine);",
    "    }",
    "}",
};

void emit_preamble(FILE *file)
{
    for (size_t n = 0; n < ARRAY_COUNT(preamble); n++) {
        fprintf(file, "%s\n", preamble[n]);
    }
}

void emit_sincos(FILE *file)
{
    for (size_t n = 0; n < ARRAY_COUNT(sincos_text); n++) {
        fprintf(file, "%s\n", sincos_text[n]);
    }
}
