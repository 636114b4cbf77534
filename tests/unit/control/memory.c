/* SPDX-License-Identifier: Apache-2.0 */
/* The control socket when there is no memory for a request or its answer: each is refused with a
 * line of its own, nothing is lost, and the next one is served. */
#include "tests/unit/control/control_bench.h"

static struct bench bench;
static pthread_t client_thread;
static _Atomic long
    until_failure; /* allocations of the server until one fails; below 0: none does */
static _Atomic long failures;

/* the server's n-th allocation fails; the client shares the library and must not */
static void *allocate(size_t size)
{
    if (!pthread_equal(pthread_self(), client_thread) && atomic_fetch_sub(&until_failure, 1) == 0) {
        atomic_fetch_add(&failures, 1);
        return NULL;
    }
    return malloc(size);
}

/* Whether an answer has all keys and entries of another. */
static bool is_as_complete(const json_t *answer, const json_t *other)
{
    bool good = json_object_size(answer) == json_object_size(other) &&
                json_array_size(answer) == json_array_size(other);
    const char *key;
    json_t *value;

    json_object_foreach((json_t *)(uintptr_t)other, key, value)
    {
        const json_t *of = json_object_get(answer, key);

        good = good && of && is_as_complete(of, value);
    }
    for (size_t i = 0; i < json_array_size(other) && good; i++) {
        good = is_as_complete(json_array_get(answer, i), json_array_get(other, i));
    }
    return good;
}

static void fail_each_allocation_of(const char *request)
{
    json_t *complete = client_ask(&bench.client, request);
    long n = 0, failed = 0;

    for (bool whole = false; !whole; n++) {
        json_t *answer;

        assert_in_range(n, 0, 20000);
        atomic_store(&failures, 0);
        atomic_store(&until_failure, n);
        answer = client_ask(&bench.client, request);
        atomic_store(&until_failure, -1);
        assert_true(json_is_object(answer));
        whole = atomic_load(&failures) == 0;
        if (whole) {
            assert_true(is_ok(answer));
        } else if (!is_ok(answer)) {
            /* some failures are made good, as that of a longer buffer */
            bool told = strcmp(string_of(answer, "code"), "memory") == 0;

            /* while it reads names and strings the library tells of a wrong word instead */
            assert_true(told || strncmp(string_of(answer, "error"), "line ", 5) == 0);
            failed += told;
        } else if (!is_as_complete(answer, complete)) {
            fail_msg("%s: allocation %ld failed, and the answer lacks something", request, n);
        }
        json_decref(answer);
    }
    assert_true(failed > 0);
    json_decref(complete);
    bench_do(&bench, "{\"cmd\":\"hello\"}");
}

TEST(every_failed_allocation_is_told)
{
    client_thread = pthread_self();
    atomic_store(&until_failure, -1);
    json_set_alloc_funcs(allocate, free);
    bench_open(&bench, &(struct bench_options){.clock = LOOP_CLOCK_FREE});
    bench_do(&bench,
             "{\"cmd\":\"step\",\"count\":5}"); /* joints and contacts are told from then on */
    bench_do(&bench, "{\"cmd\":\"checkpoint\",\"slot\":1}");
    fail_each_allocation_of("{\"id\":\"one\",\"cmd\":\"hello\"}");
    fail_each_allocation_of("{\"id\":2,\"cmd\":\"status\"}");
    fail_each_allocation_of("{\"cmd\":\"statistics\"}");
    fail_each_allocation_of("{\"cmd\":\"list\",\"what\":\"signals\",\"match\":\"q_*\"}");
    fail_each_allocation_of("{\"cmd\":\"list\",\"what\":\"checkpoints\"}");
    fail_each_allocation_of("{\"cmd\":\"get\",\"name\":\"supply_v\"}");
    fail_each_allocation_of("{\"cmd\":\"set\",\"name\":\"supply_v\",\"value\":40}");
    fail_each_allocation_of("{\"cmd\":\"wait\",\"tick\":0}");
    fail_each_allocation_of("{\"cmd\":\"subscribe\",\"signals\":[\"q_?Knee*\"]}");
    fail_each_allocation_of("{\"cmd\":\"unsubscribe\"}");
    bench_do(&bench, "{\"cmd\":\"stop\"}");
    bench_close(&bench);
    json_set_alloc_funcs(malloc, free);
}
