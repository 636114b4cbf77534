/* SPDX-License-Identifier: Apache-2.0 */
/* Publishes views: one block of memory with status, signals and boards, protected by a sequence
 * lock. */

#include "sim/simulator_private.h"

_Static_assert(sizeof(struct simulator_status) % 8 == 0 && sizeof(struct board_state) % 8 == 0,
               "a snapshot consists of words");

/* Returns the size of a view: status, signals, boards. */
static size_t view_size(const struct simulator *simulator)
{
    return sizeof(struct simulator_status) + simulator->nsignal * sizeof(double) +
           simulator->config.rig->boards.nboard * sizeof(struct board_state);
}

static double *view_signals(void *memory)
{
    return (double *)((char *)memory + sizeof(struct simulator_status));
}

static struct board_state *view_boards(const struct simulator *simulator, void *memory)
{
    return (struct board_state *)(view_signals(memory) + simulator->nsignal);
}

/* Fills in and publishes the view of the last tick. */
static void view_publish(struct simulator *simulator)
{
    void *memory = simulator->view;

    memcpy(memory, &simulator->status, sizeof simulator->status);
    simulator_fill_stream(simulator, view_signals(memory));
    for (size_t i = 0; i < simulator->config.rig->boards.nboard; i++) {
        boards_state(simulator->boards, i, &view_boards(simulator, memory)[i]);
    }
    snapshot_write(simulator->published_view, memory);
    simulator->view_stale = false;
}

const double *simulator_view_signals(const struct simulator *simulator)
{
    return simulator->view_stale ? NULL : view_signals(simulator->view);
}

void simulator_renew_view(struct simulator *simulator)
{
    if (simulator->view_stale &&
        atomic_load_explicit(&simulator->view_wanted, memory_order_relaxed)) {
        view_publish(simulator);
    }
}

void simulator_end_views(struct simulator *simulator)
{
    if (simulator->view_stale) {
        view_publish(simulator);
    }
}

enum error_code simulator_create_view(struct simulator *simulator, struct error *error)
{
    size_t size = view_size(simulator);
    enum error_code code =
        snapshot_create(size, simulator->arena, &simulator->published_view, error);

    if (code) {
        return code;
    }
    simulator->view = arena_alloc(simulator->arena, size / 8, 8);
    if (!simulator->view) {
        return error_set(error, ERROR_MEMORY, "no memory left for a view of %zu bytes", size);
    }
    simulator_fill_start(simulator);
    view_publish(simulator);
    return ERROR_NONE;
}

enum error_code simulator_view_create(const struct simulator *simulator, struct arena *arena,
                                      struct simulator_view *view, struct error *error)
{
    size_t size = view_size(simulator);

    memset(view, 0, sizeof *view);
    view->memory = arena_alloc(arena, size / 8, 8);
    if (!view->memory) {
        return error_set(error, ERROR_MEMORY, "no memory left for a view of %zu bytes", size);
    }
    view->signal = view_signals(view->memory);
    view->board = view_boards(simulator, view->memory);
    return ERROR_NONE;
}

void simulator_want_views(struct simulator *simulator, bool wanted)
{
    atomic_store_explicit(&simulator->view_wanted, wanted, memory_order_relaxed);
}

uint64_t simulator_view_read(const struct simulator *simulator, struct simulator_view *view)
{
    uint64_t count = snapshot_read(simulator->published_view, view->memory);

    memcpy(&view->status, view->memory, sizeof view->status);
    return count;
}
