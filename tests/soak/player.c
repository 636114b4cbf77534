/* SPDX-License-Identifier: Apache-2.0 */
/* The host library and the servo of the tasks, used as somebody would who never gives up. */
#include "tests/soak/player.h"

#include <stdio.h>

#define ARENA ((size_t)4 << 20)
#define MS INT64_C(1000000)

static const int64_t RETRY_NS = 100 * MS;   /* between two attempts at the same thing */
static const int64_t SILENT_NS = 1000 * MS; /* as long as that: the board is gone */
static const double RAMP_S = 1.0;
enum { TRIES = 10 }; /* to switch an axis on before all is begun anew */

static enum error_code start_host(struct player *player, struct error *error)
{
    const struct rig *rig = player->rig;
    const struct host_config config = rig_host_config(rig, player->ports.port, false);
    enum error_code code;

    arena_fini(&player->arena);
    code = arena_init(&player->arena, ARENA, error);
    if (!code) {
        code = host_create(&config, &player->arena, &player->host, error);
    }
    if (!code) {
        code = servo_create(&rig->servo, player->host, &player->arena, &player->servo, error);
    }
    for (size_t i = 0; i < rig->naxis; i++) {
        player->axis[i].was_off = player->axis[i].told_off = false;
        player->axis[i].tries = 0;
    }
    player->ready = false;
    player->starts++;
    return code;
}

enum error_code player_init(struct player *player, const struct rig *rig, uint64_t seed,
                            struct error *error)
{
    struct bus_ports ports = player->ports;

    memset(player, 0, sizeof *player);
    player->ports = ports;
    player->rig = rig;
    player->random = random_named(seed, "player");
    if (rig->naxis > PLAYER_AXES_MAX) {
        return error_set(error, ERROR_INPUT, "%zu axes, expected at most %d", rig->naxis,
                         PLAYER_AXES_MAX);
    }
    for (size_t i = 0; i < rig->naxis; i++) {
        const struct host_axis *axis = &rig->axis[i];
        double room =
            fmin(axis->upper_rad - rig->initial_rad[i], rig->initial_rad[i] - axis->lower_rad);

        player->axis[i] = (struct player_axis){
            .amplitude_rad = fmax(0.0, fmin(0.2, 0.5 * room)),
            .frequency_hz = 0.1 + 0.4 * random_uniform(&player->random),
            .phase_rad = 6.283 * random_uniform(&player->random),
        };
    }
    return start_host(player, error);
}

void player_fini(struct player *player)
{
    arena_fini(&player->arena);
}

static void begin(struct player *player, int64_t time_ns)
{
    player->ready = true;
    player->ready_ns = time_ns;
    servo_start(player->servo);
    for (size_t i = 0; i < player->rig->naxis; i++) {
        player->from_rad[i] = servo_wanted(player->servo, i);
    }
}

/* Sines about the initial pose, reached smoothly */
static void move(struct player *player, int64_t time_ns)
{
    double t = (double)time_ns * 1e-9;
    double blend = fmin(1.0, (double)(time_ns - player->ready_ns) * 1e-9 / RAMP_S);

    for (size_t i = 0; i < player->rig->naxis; i++) {
        const struct player_axis *axis = &player->axis[i];
        double omega = 6.283185307179586 * axis->frequency_hz;
        double goal =
            player->rig->initial_rad[i] + axis->amplitude_rad * sin(omega * t + axis->phase_rad);
        double rate = axis->amplitude_rad * omega * cos(omega * t + axis->phase_rad);

        servo_set(player->servo, i, player->from_rad[i] + blend * (goal - player->from_rad[i]),
                  blend * rate);
    }
}

/* Off first, which leaves a fault, then on. True: one has come back, and stands somewhere else than
 * it was to be: at full voltage towards it, it would trip again. */
static bool switch_on_again(struct player *player, int64_t time_ns)
{
    bool back = false;

    for (size_t i = 0; i < player->rig->naxis; i++) {
        struct player_axis *axis = &player->axis[i];

        if (host_joint(player->host, i)->motor == HOST_MOTOR_ON) {
            axis->on_ns = time_ns;
            back = back || axis->was_off;
            axis->was_off = axis->told_off = false;
            axis->tries = 0;
        } else if (time_ns >= axis->retry_ns) {
            axis->was_off = true;
            host_set_motor(player->host, i, axis->told_off);
            player->switched_on += axis->told_off;
            axis->tries += axis->told_off;
            axis->told_off = !axis->told_off;
            axis->retry_ns = time_ns + RETRY_NS;
        }
    }
    return back;
}

/* A board that boots anew is silent, or will not switch on before it is told again what it
 * drives. */
static bool some_board_forgot(const struct player *player, int64_t time_ns)
{
    for (size_t i = 0; i < player->rig->naxis; i++) {
        if (time_ns - host_joint(player->host, i)->motor_time_ns > SILENT_NS ||
            player->axis[i].tries > TRIES) {
            return true;
        }
    }
    return false;
}

enum error_code player_step(struct player *player, int64_t time_ns, bool silent,
                            struct error *error)
{
    enum host_phase phase;

    host_receive(player->host, time_ns);
    if (silent || time_ns < player->resume_ns) {
        return ERROR_NONE;
    }
    if (!player->ready) {
        phase = host_start_up(player->host);
        if (phase == HOST_FAILED) {
            player->resume_ns = time_ns + RETRY_NS;
            return start_host(player, error);
        }
        if (phase == HOST_READY) {
            begin(player, time_ns);
        }
    } else if (some_board_forgot(player, time_ns)) {
        return start_host(player, error);
    } else {
        if (switch_on_again(player, time_ns)) {
            begin(player, time_ns);
        }
        move(player, time_ns);
        servo_update(player->servo);
    }
    host_send(player->host);
    return ERROR_NONE;
}

bool player_all_back(const struct player *player, int64_t since_ns, char *text, size_t size)
{
    static const char *const modes[] = {"unknown", "off", "on", "in another mode", "in fault"};

    for (size_t i = 0; i < player->rig->naxis; i++) {
        const struct host_joint *found = host_joint(player->host, i);

        if (player->axis[i].on_ns <= since_ns || found->motor_time_ns <= since_ns) {
            snprintf(text, size, "%s has not been on, last at %.3f s; is %s, faults 0x%x, %s",
                     player->rig->axis[i].joint, (double)player->axis[i].on_ns * 1e-9,
                     modes[found->motor], (unsigned)found->fault, host_message(player->host));
            return false;
        }
    }
    return true;
}
