/* SPDX-License-Identifier: Apache-2.0 */
/* The store of solids: what is shared, and that it changes nothing. */
#include "contact/mesh/solid_store.h"

#include "contact/contact.h"

#include <unistd.h>

#include "tests/unit/arena_fixture.h"

static const struct mesh *make_box(double half)
{
    const double side[3] = {half, 2 * half, 3 * half};
    const struct mesh *mesh;

    assert_ok(mesh_box(side, 3, &arena, &mesh, NULL));
    return mesh;
}

static const struct solid *find(const struct mesh *mesh)
{
    const struct solid *solid;

    assert_ok(solid_store_find(mesh, &arena, &solid, NULL));
    return solid;
}

static const struct field *find_field(const struct solid *solid)
{
    const struct field *field;

    assert_ok(solid_store_find_field(solid, "box", &arena, &field, NULL));
    return field;
}

TEST_WITH(equal_meshes_share_what_was_made, open_arena, close_arena)
{
    const struct solid *first, *other;

    assert_ok(solid_store_open(NULL));
    first = find(make_box(0.1));
    other = find(make_box(0.2));
    assert_ptr_not_equal(first, other);
    assert_ptr_equal(find(make_box(0.1)), first);
    assert_int_equal(solid_store_made(), 2);
    assert_ptr_equal(find_field(first), find_field(first));
    assert_ptr_not_equal(find_field(first), find_field(other));
    assert_int_equal(solid_store_made(), 4);
    solid_store_close();
}

/* Writes a tetrahedron of that height, m. */
static void write_obj(const char *path, const char *height)
{
    FILE *file = fopen(path, "w");

    assert_non_null(file);
    fprintf(file, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 %s\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n",
            height);
    assert_int_equal(fclose(file), 0);
}

static const struct mesh *read_obj(const char *path)
{
    const struct mesh *mesh;

    assert_ok(solid_store_read_obj(path, &arena, &mesh, NULL));
    return mesh;
}

TEST_WITH(file_of_the_same_text_is_read_once, open_arena, close_arena)
{
    char path[] = "/tmp/solid-store-XXXXXX";
    const struct mesh *first;
    struct error error;
    int file = mkstemp(path);

    assert_true(file >= 0);
    close(file);
    write_obj(path, "1");
    assert_ptr_not_equal(read_obj(path), read_obj(path));
    assert_ok(solid_store_open(NULL));
    first = read_obj(path);
    assert_ptr_equal(read_obj(path), first);
    assert_string_equal(first->name, path);

    /* Another text is another mesh; a wrong one is told each time */
    write_obj(path, "2");
    assert_true(read_obj(path)->vertex[3][2] == 2 && first->vertex[3][2] == 1);
    write_obj(path, "x");
    for (int again = 0; again < 2; again++) {
        assert_int_equal(solid_store_read_obj(path, &arena, &first, &error), ERROR_INPUT);
        assert_non_null(strstr(error.text, ":4:7"));
    }
    solid_store_close();
    unlink(path);
}

TEST_WITH(solid_outlives_the_mesh_it_was_made_of, open_arena, close_arena)
{
    const struct mesh *mesh = make_box(0.1), *again = make_box(0.1);
    const struct solid *solid;

    assert_ok(solid_store_open(NULL));
    solid = find(mesh);
    memset((void *)(uintptr_t)mesh->vertex, 0, mesh->nvertex * sizeof *mesh->vertex);
    memset((void *)(uintptr_t)mesh->face, 0, mesh->nface * sizeof *mesh->face);
    assert_ptr_equal(find(again), solid);
    assert_memory_equal(solid->vertex, again->vertex, again->nvertex * sizeof *again->vertex);
    assert_int_equal(find_field(solid)->solid == solid, 1);
    solid_store_close();
}

TEST_WITH(closed_store_shares_nothing, open_arena, close_arena)
{
    const struct mesh *mesh = make_box(0.1);
    const struct solid *one = find(mesh), *two = find(mesh);

    assert_ptr_not_equal(one, two);
    assert_ptr_equal(one->vertex, mesh->vertex);
    assert_ptr_not_equal(find_field(one), find_field(one));
    solid_store_close();
}

/* The wrench of one box in another, turned; from an engine made anew. */
static void find_wrench(struct contact_wrench wrench[2])
{
    const struct contact_material rubber = {.young_pa = 1e6,
                                            .thickness_m = 0.01,
                                            .dissipation_s_per_m = 1,
                                            .static_friction = 0.8,
                                            .dynamic_friction = 0.6};
    struct contact_surface surface[2] = {
        {.name = "one", .body = 0, .shape = CONTACT_BOX, .cells_per_edge = 3, .material = rubber},
        {.name = "two", .body = 1, .shape = CONTACT_BOX, .cells_per_edge = 4, .material = rubber}};
    const struct contact_pair pair = {.a = 0, .b = 1};
    const struct contact_config config = {.nbody = 2,
                                          .nsurface = 2,
                                          .surface = surface,
                                          .npair = 1,
                                          .pair = &pair,
                                          .transition_velocity_m_s = 0.01};
    struct body_motion motion[2] = {
        {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}},
        {.R = {0.8, -0.6, 0, 0.6, 0.8, 0, 0, 0, 1}, .p = {0.01, 0.02, 0.195}, .v = {0.1, 0, -0.2}}};
    struct contact_world *world;

    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < 3; k++) {
            surface[i].half_extent_m[k] = 0.1;
            surface[i].rotation[4 * k] = 1;
        }
    }
    assert_ok(contact_native_create(&config, &arena, &world, NULL));
    assert_ok(world->ops->evaluate(world, motion, NULL, wrench));
    assert_true(wrench[1].force[2] > 1);
    world->ops->destroy(world);
}

TEST_WITH(last_user_closes_it, open_arena, close_arena)
{
    const struct mesh *mesh = make_box(0.1);
    const struct solid *solid;

    assert_ok(solid_store_open(NULL));
    solid = find(mesh);
    assert_ok(solid_store_open(NULL));
    assert_ptr_equal(find(mesh), solid);
    solid_store_close();
    assert_ptr_equal(find(mesh), solid);
    solid_store_close();
    assert_ptr_equal(find(mesh)->vertex, mesh->vertex);

    /* Allowed on a closed one, and counts for nothing */
    solid_store_close();
    assert_ok(solid_store_open(NULL));
    assert_int_equal(solid_store_made(), 0);
    solid_store_close();
}

TEST_WITH(engine_gives_the_same_bits_with_the_store, open_arena, close_arena)
{
    struct contact_wrench without[2], with[2], again[2];
    size_t made;

    find_wrench(without);
    assert_ok(solid_store_open(NULL));
    find_wrench(with);
    made = solid_store_made();
    assert_true(made >= 3);
    find_wrench(again);
    assert_int_equal(solid_store_made(), made);
    solid_store_close();
    assert_memory_equal(with, without, sizeof with);
    assert_memory_equal(again, without, sizeof again);
}
