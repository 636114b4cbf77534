/* SPDX-License-Identifier: Apache-2.0 */
/* Writes the results of a plan as one self-contained HTML page. */
#include "app/sweep/plan.h"

#include "base/markup.h"
#include "base/text.h"
#include "base/whole_file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Ranges per parameter; listed worst cases; words per parameter; width and height of the map,
 * px. */
enum { BINS = 5, BIN_TEXT = 2 * SCENARIO_VALUE_MAX, WORST = 10, WORDS_MAX = 32, MAP_SIDE = 480 };

/* A range of a parameter's values, or one of its words, with the number of its cases. */
struct page_bin {
    char label[BIN_TEXT];
    size_t passed, count;
};

/* Statistics of a parameter over all cases. */
struct page_parameter {
    const char *name;
    bool number; /* all values are numbers and they differ; low and high are their range */
    double low, high;
    size_t nbin;
    struct page_bin bin[WORDS_MAX];
    double spread; /* highest minus lowest share of a bin */
};

/* The page being written. */
struct page {
    FILE *out;
    const struct plan *plan;
    const struct plan_result *result;
    size_t count;
    struct page_parameter parameter[PLAN_NAMES_MAX];
};

/* ---- sensitivity ---- */

/* Checks whether all values of a parameter are numbers, and finds their range. */
static void page_find_range(const struct page *page, struct page_parameter *parameter)
{
    parameter->number = true;
    parameter->low = HUGE_VAL;
    parameter->high = -HUGE_VAL;
    for (size_t i = 0; i < page->plan->ncase; i++) {
        double value = 0.0;

        if (!text_to_double(plan_value(&page->plan->list[i], parameter->name), &value)) {
            parameter->number = false;
            return;
        }
        parameter->low = fmin(parameter->low, value);
        parameter->high = fmax(parameter->high, value);
    }
    parameter->number = parameter->high > parameter->low;
}

/* Returns the bin of a value: a range for a number, else the bin of its word, which is added if it
 * is new. Returns NULL if there is no room. */
static struct page_bin *page_find_bin(struct page_parameter *parameter, const char *text)
{
    double width = (parameter->high - parameter->low) / BINS, value = 0.0;
    size_t k = 0;

    if (parameter->number) {
        text_to_double(text, &value);
        k = (size_t)((value - parameter->low) / width);
        return &parameter->bin[k < BINS ? k : BINS - 1];
    }
    while (k < parameter->nbin && strcmp(parameter->bin[k].label, text) != 0) {
        k++;
    }
    if (k == parameter->nbin && k < WORDS_MAX) {
        snprintf(parameter->bin[k].label, BIN_TEXT, "%s", text);
        parameter->nbin++;
    }
    return k < WORDS_MAX ? &parameter->bin[k] : NULL;
}

/* Counts the cases and the passed cases of each bin, and computes the spread of their shares. */
static void page_count_bins(const struct page *page, struct page_parameter *parameter)
{
    double least = 1.0, greatest = 0.0;

    for (size_t k = 0; parameter->number && k < BINS; k++) {
        double width = (parameter->high - parameter->low) / BINS;

        snprintf(parameter->bin[k].label, BIN_TEXT, "%.4g to %.4g",
                 parameter->low + width * (double)k, parameter->low + width * (double)(k + 1));
        parameter->nbin = BINS;
    }

    /* Count each case in the bin of its value */
    for (size_t i = 0; i < page->plan->ncase; i++) {
        struct page_bin *bin =
            page_find_bin(parameter, plan_value(&page->plan->list[i], parameter->name));

        if (bin) {
            bin->count++;
            bin->passed += page->result[i].status == SCENARIO_PASSED;
        }
    }

    /* The spread of the shares measures the influence of the parameter */
    for (size_t k = 0; k < parameter->nbin; k++) {
        double share = (double)parameter->bin[k].passed / (double)parameter->bin[k].count;

        if (parameter->bin[k].count) {
            least = fmin(least, share);
            greatest = fmax(greatest, share);
        }
    }
    parameter->spread = fmax(0.0, greatest - least);
}

/* Writes a row: the share of passed cases, its 95 % interval, and a bar with both. */
static void page_put_share(const struct page *page, const char *label, size_t passed, size_t count)
{
    double low, high;

    plan_wilson_interval(passed, count, &low, &high);
    fputs("<tr><td>", page->out);
    markup_put(page->out, label);
    fprintf(page->out,
            "</td><td>%zu of %zu</td><td>%.1f %%</td><td>%.1f to %.1f %%</td><td><svg "
            "width=\"200\" height=\"12\"><rect width=\"200\" height=\"12\" fill=\"#eee\"/><rect "
            "x=\"%.1f\" width=\"%.1f\" height=\"12\" fill=\"#9bd\"/><rect x=\"%.1f\" width=\"2\" "
            "height=\"12\"/></svg></td></tr>\n",
            passed, count, count ? 100.0 * (double)passed / (double)count : 0.0, 100.0 * low,
            100.0 * high, 200.0 * low, 200.0 * (high - low),
            count ? 199.0 * (double)passed / (double)count : 0.0);
}

/* ---- the map ---- */

/* Chooses the two numeric parameters with the largest spread. Returns false if there are fewer than
 * two. */
static bool page_choose_axes(const struct page *page, size_t axis[2])
{
    size_t found = 0;

    for (size_t i = 0; i < page->count; i++) {
        const struct page_parameter *parameter = &page->parameter[i];

        if (!parameter->number) {
            continue;
        }
        if (found == 0 || parameter->spread > page->parameter[axis[0]].spread) {
            axis[1] = axis[0];
            axis[0] = i;
        } else if (found == 1 || parameter->spread > page->parameter[axis[1]].spread) {
            axis[1] = i;
        }
        found++;
    }
    return found >= 2;
}

/* Computes the position of a case on an axis of the map, px. */
static double page_place(const struct page_parameter *parameter, const struct plan_case *one)
{
    double value = parameter->low;

    text_to_double(plan_value(one, parameter->name), &value);
    return MAP_SIDE * (value - parameter->low) / (parameter->high - parameter->low);
}

/* Draws the map: one point per case, at its values of the two most influential parameters, in the
 * color of its verdict. */
static void page_put_map(const struct page *page)
{
    static const char *const color[] = {"#2a7", "#c22", "#000"};
    size_t axis[2] = {0, 0};
    const struct page_parameter *x, *y;

    if (!page_choose_axes(page, axis)) {
        return;
    }
    x = &page->parameter[axis[0]];
    y = &page->parameter[axis[1]];
    fprintf(page->out,
            "<h2>Map</h2>\n<p>Every case by the two parameters that matter most: passed green, "
            "failed red, broken black. %s from %.4g (left) to %.4g, %s from %.4g (bottom) to "
            "%.4g.</p>\n<svg width=\"%d\" height=\"%d\" viewBox=\"-10 -10 %d %d\"><rect "
            "width=\"%d\" height=\"%d\" fill=\"none\" stroke=\"#888\"/>\n",
            x->name, x->low, x->high, y->name, y->low, y->high, MAP_SIDE + 20, MAP_SIDE + 20,
            MAP_SIDE + 20, MAP_SIDE + 20, MAP_SIDE, MAP_SIDE);
    for (size_t i = 0; i < page->plan->ncase; i++) {
        fprintf(page->out,
                "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3\" fill=\"%s\" "
                "fill-opacity=\"0.6\"><title>case %zu</title></circle>\n",
                page_place(x, &page->plan->list[i]), MAP_SIDE - page_place(y, &page->plan->list[i]),
                color[page->result[i].status], i + 1);
    }
    fputs("</svg>\n", page->out);
}

/* ---- worst cases ---- */

/* Orders results from worst to best: broken, failed, passed. An earlier failure is worse, and so is
 * a smaller margin. */
static int page_compare_results(const void *left, const void *right)
{
    const struct plan_result *a = *(const struct plan_result *const *)left;
    const struct plan_result *b = *(const struct plan_result *const *)right;
    double by = 0.0;

    if (a->status != b->status) {
        return a->status > b->status ? -1 : 1;
    }
    if (a->status == SCENARIO_FAILED) {
        by = a->failed_s - b->failed_s;
    } else if (a->status == SCENARIO_PASSED) {
        by = (a->has_margin ? a->margin : 1.0) - (b->has_margin ? b->margin : 1.0);
    }
    return by < 0.0 ? -1 : by > 0.0 ? 1 : a->number < b->number ? -1 : 1;
}

/* Writes the table of the worst cases, with the commands to repeat them. */
static enum error_code page_put_worst(const struct page *page, struct error *error)
{
    size_t count = page->plan->ncase;
    const struct plan_result **sorted = calloc(count, sizeof *sorted);
    const char *slash = strrchr(page->plan->path, '/');

    if (!sorted) {
        return error_set(error, ERROR_MEMORY, "no memory left for %zu results", count);
    }
    for (size_t i = 0; i < count; i++) {
        sorted[i] = &page->result[i];
    }
    qsort(sorted, count, sizeof *sorted, page_compare_results);
    fputs("<h2>Worst cases</h2>\n<p>The first to fail, then those that came nearest to a bound "
          "(margin: the least distance from it, as a share of the room between two). The command "
          "repeats a case, compares, and leaves a recording of one that "
          "fails.</p>\n<table><tr><th>case</th><th>verdict</th><th>failed "
          "at</th><th>margin</th><th>values</th><th>what</th><th>command</th></tr>\n",
          page->out);

    /* One row per case; times and margins may be missing */
    for (size_t i = 0; i < count && i < WORST; i++) {
        const struct plan_case *one = &page->plan->list[sorted[i]->number - 1];

        fprintf(page->out, "<tr><td>%zu</td><td>%s</td><td>", one->number,
                plan_status_word[sorted[i]->status]);
        if (sorted[i]->failed_s >= 0.0) {
            fprintf(page->out, "%.3f s", sorted[i]->failed_s);
        }
        fputs("</td><td>", page->out);
        if (sorted[i]->has_margin) {
            fprintf(page->out, "%.3g", sorted[i]->margin);
        }
        fputs("</td><td>", page->out);
        for (size_t k = 0; k < one->nvalue; k++) {
            fprintf(page->out, "%s%s=%s", k ? ", " : "", one->value[k].name, one->value[k].text);
        }
        fputs("</td><td>", page->out);
        markup_put(page->out, sorted[i]->message);
        fprintf(page->out, "</td><td><code>coman-hil test --case %zu --output case-%zu ",
                one->number, one->number);
        markup_put(page->out, slash ? slash + 1 : page->plan->path);
        fputs("</code></td></tr>\n", page->out);
    }
    fputs("</table>\n", page->out);
    free(sorted);
    return ERROR_NONE;
}

/* ---- the page ---- */

enum error_code plan_page_write(const struct plan *plan, const struct plan_result *result,
                                const char *path, struct error *error)
{
    struct page *page = calloc(1, sizeof *page);
    const char *name[PLAN_NAMES_MAX];
    struct whole_file file;
    size_t passed = 0;
    enum error_code code = page ? whole_file_open(&file, path, error)
                                : error_set(error, ERROR_MEMORY, "no memory left for a page");

    if (code) {
        free(page);
        return code;
    }

    /* Compute the statistics of each parameter */
    *page = (struct page){.out = file.out, .plan = plan, .result = result};
    page->count = plan_names(plan, name);
    for (size_t i = 0; i < page->count; i++) {
        page->parameter[i].name = name[i];
        page_find_range(page, &page->parameter[i]);
        page_count_bins(page, &page->parameter[i]);
    }
    for (size_t i = 0; i < plan->ncase; i++) {
        passed += result[i].status == SCENARIO_PASSED;
    }

    /* Write the summary first, then details */
    fprintf(file.out,
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>%s</title>"
            "<style>body{font:15px sans-serif;margin:2em;max-width:80em}table{border-collapse:"
            "collapse}td,th{padding:2px 10px;text-align:left;border-bottom:1px solid #ddd}"
            "</style></head><body>\n<h1>%s</h1>\n<p>",
            plan->name, plan->name);
    markup_put(file.out, plan->description);
    fprintf(file.out, "</p>\n<p>Plan %s, program %s.</p>\n<table>\n", plan->id, result[0].binary);
    page_put_share(page, "all cases", passed, plan->ncase);
    fputs("</table>\n", file.out);

    /* Writes a table of shares for each parameter that has more than one bin */
    fputs("<h2>By parameter</h2>\n", page->out);
    for (size_t i = 0; i < page->count; i++) {
        const struct page_parameter *parameter = &page->parameter[i];

        if (parameter->nbin < 2) {
            continue;
        }
        fprintf(page->out,
                "<h3>%s</h3>\n<p>Shares differ by %.1f %%.</p>\n<table><tr><th>range</th>"
                "<th>passed</th><th>share</th><th>95 %% interval</th><th></th></tr>\n",
                parameter->name, 100.0 * parameter->spread);
        for (size_t k = 0; k < parameter->nbin; k++) {
            page_put_share(page, parameter->bin[k].label, parameter->bin[k].passed,
                           parameter->bin[k].count);
        }
        fputs("</table>\n", page->out);
    }
    page_put_map(page);
    code = page_put_worst(page, error);
    fputs("</body></html>\n", file.out);
    free(page);
    return whole_file_close(&file, code, error);
}
