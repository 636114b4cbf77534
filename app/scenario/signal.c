/* SPDX-License-Identifier: Apache-2.0 */
/* Finds and reads the signals of a scenario. */
#include "app/scenario/private.h"

#include "base/array.h"
#include "base/portable_math.h"
#include "base/text.h"
#include "canbus/wire/wire.h"

/* Limits: parts of a signal's name, bytes of a part, and names of one kind in a rig. */
enum { PART_SIZE = 64, NAMES_MAX = 128 };

/* ---- quantities ---- */

static const char *const joint_words[] = {"q",
                                          "qd",
                                          "qm",
                                          "qmd",
                                          "current",
                                          "torque",
                                          "voltage",
                                          "winding",
                                          "piston_pressure",
                                          "rod_pressure",
                                          "valve_opening"};
static const char *const wrench_words[] = {"fx", "fy", "fz", "tx", "ty", "tz"};
static const char *const host_joint_words[] = {"q", "qm", "current", "torque", "motor", "fault"};
static const char *const host_force_words[] = {"fx", "fy", "fz", "tx", "ty", "tz", "overflow"};
static const char *const base_words[] = {"x", "y", "z", "qw", "qx", "qy", "qz", "tilt"};
static const char *const com_words[] = {"x", "y", "z"};
static const char *const bus_words[] = {"rx",    "tx",        "rx_dropped", "tx_dropped",
                                        "state", "tec",       "bus_off",    "errors",
                                        "load",  "load_peak", "queued",     "latency_max"};
static const char *const boards_words[] = {"frames",   "foreign", "unknown",   "malformed",
                                           "timeouts", "trips",   "overflows", "fault"};
static const char *const lockstep_words[] = {"steps", "mismatches", "malformed", "silences"};

/* Returns a quantity of a joint; word: index in joint_words. */
static double joint_value(const struct motor_sense *motor, size_t word)
{
    const double value[ARRAY_COUNT(joint_words)] = {motor->q,
                                                    motor->qd,
                                                    motor->qm,
                                                    motor->qmd,
                                                    motor->current_a,
                                                    motor->torque_nm,
                                                    motor->voltage_v,
                                                    motor->winding_c,
                                                    motor->pressure_pa[0],
                                                    motor->pressure_pa[1],
                                                    motor->valve_opening};

    return value[word];
}

/* Returns a component of a wrench, N or N m; word: index in wrench_words. */
static double wrench_value(const struct ft_sense *ft, size_t word)
{
    return word < 3 ? ft->force_n[word] : ft->torque_nm[word - 3];
}

/* ---- readers ---- */

static double signal_read_joint(const struct scenario_view *view, size_t joint, size_t word)
{
    return joint_value(&plant_sensors(simulator_plant(view->simulator))->motor[joint], word);
}

static double signal_read_measured_joint(const struct scenario_view *view, size_t joint,
                                         size_t word)
{
    return joint_value(&simulator_measured(view->simulator)->motor[joint], word);
}

static double signal_read_ft(const struct scenario_view *view, size_t ft, size_t word)
{
    return wrench_value(&plant_sensors(simulator_plant(view->simulator))->ft[ft], word);
}

static double signal_read_measured_ft(const struct scenario_view *view, size_t ft, size_t word)
{
    return wrench_value(&simulator_measured(view->simulator)->ft[ft], word);
}

/* Returns a value of a joint that the host has received. */
static double signal_read_host_joint(const struct scenario_view *view, size_t axis, size_t word)
{
    const struct host_joint *joint = host_joint(view->host, axis);
    const double value[ARRAY_COUNT(host_joint_words)] = {
        joint->joint_rad, joint->motor_rad,     joint->current_a,
        joint->torque_nm, (double)joint->motor, (double)joint->fault};

    return value[word];
}

/* Returns a value of a force-torque sensor that the host has received. */
static double signal_read_host_ft(const struct scenario_view *view, size_t ft, size_t word)
{
    const struct host_force *force = host_force(view->host, ft);

    return word < 3   ? force->force_n[word]
           : word < 6 ? force->torque_nm[word - 3]
                      : (double)force->overflow;
}

static double signal_read_host(const struct scenario_view *view, size_t a, size_t b)
{
    (void)a;
    (void)b;
    return (double)view->host_phase;
}

/* Returns a component of the base's position (m) or quaternion, or the base's tilt (rad). */
static double signal_read_base(const struct scenario_view *view, size_t a, size_t word)
{
    size_t count;
    const double *state = plant_values(simulator_plant(view->simulator), &count);
    double up;

    (void)a;
    if (word < 7) {
        return state[word];
    }
    up = 1.0 - 2.0 * (state[4] * state[4] +
                      state[5] * state[5]); /* cosine of the tilt, from the quaternion's x and y */
    return portable_acos(fmin(fmax(up, -1.0), 1.0));
}

/* Returns a coordinate of the robot's center of mass in the world, m. */
static double signal_read_com(const struct scenario_view *view, size_t a, size_t word)
{
    double position[3], momentum[3];

    (void)a;
    plant_center_of_mass(simulator_plant(view->simulator), position, momentum);
    return position[word];
}

/* Returns a component of the contact wrench on a body, N or N m. */
static double signal_read_contact(const struct scenario_view *view, size_t body, size_t word)
{
    const struct contact_wrench *wrench =
        &plant_contact_wrenches(simulator_plant(view->simulator))[body];

    return word < 3 ? wrench->force[word] : wrench->moment[word - 3];
}

static double signal_read_supply(const struct scenario_view *view, size_t a, size_t b)
{
    (void)a;
    (void)b;
    return plant_sensors(simulator_plant(view->simulator))->supply_v;
}

static double signal_read_oil(const struct scenario_view *view, size_t a, size_t b)
{
    (void)a;
    (void)b;
    return plant_sensors(simulator_plant(view->simulator))->oil_pa;
}

static double signal_read_clamped(const struct scenario_view *view, size_t a, size_t b)
{
    (void)a;
    (void)b;
    return (double)plant_is_clamped(simulator_plant(view->simulator));
}

static double signal_read_task(const struct scenario_view *view, size_t a, size_t b)
{
    const struct task_runner *runner = simulator_task_runner(view->simulator);

    (void)a;
    (void)b;
    return runner ? (double)runner->now.status : 0.0;
}

/* Returns the largest transmit error counter of the boards' CAN controllers on a bus. */
static double largest_tec(const struct scenario_view *view, const struct wire *wire, size_t bus)
{
    unsigned largest = 0;

    for (size_t i = 0; i < view->rig->bus[bus].nboard; i++) {
        struct wire_node_stats stats;

        wire_node_stats(wire, i, &stats);
        largest = stats.tec > largest ? stats.tec : largest;
    }
    return (double)largest;
}

/* Returns a quantity of a bus whose frames take virtual time; NAN for other buses. */
static double signal_read_wire(const struct scenario_view *view, size_t bus, size_t word)
{
    const struct wire *wire = simulator_wire(view->simulator, bus);
    struct wire_stats stats;
    uint64_t errors = 0;

    if (!wire) {
        return (double)NAN;
    }

    /* Words 5 to 11 of bus_words: tec, bus_off, errors, load, load_peak, queued, latency_max */
    if (word == 5) {
        return largest_tec(view, wire, bus);
    }
    wire_stats(wire, &stats);
    if (word == 11) {
        return (double)stats.latency_max_ns * 1e-9;
    }
    for (int i = 0; i < WIRE_ERRORS; i++) {
        errors += stats.errors[i];
    }
    return word == 6   ? (double)stats.bus_offs
           : word == 7 ? (double)errors
           : word == 8 ? stats.load_now
           : word == 9 ? stats.load_peak
                       : (double)stats.queued_peak;
}

/* Returns a quantity of a bus: a counter or the state of its port, or a quantity of its wire. */
static double signal_read_bus(const struct scenario_view *view, size_t bus, size_t word)
{
    const struct can_port *port = simulator_port(view->simulator, bus);
    const double value[] = {(double)port->counters.rx_frames, (double)port->counters.tx_frames,
                            (double)port->counters.rx_dropped, (double)port->counters.tx_dropped,
                            (double)port->state};

    return word < ARRAY_COUNT(value) ? value[word] : signal_read_wire(view, bus, word);
}

/* Returns a counter of the boards, or the boards' fault bits. */
static double signal_read_boards(const struct scenario_view *view, size_t a, size_t word)
{
    const struct boards *boards = simulator_parts(view->simulator).boards;
    struct boards_counters counters;

    (void)a;
    boards_counters(boards, &counters);
    {
        const double value[] = {(double)counters.frames,    (double)counters.foreign,
                                (double)counters.unknown,   (double)counters.malformed,
                                (double)counters.timeouts,  (double)counters.trips,
                                (double)counters.overflows, (double)boards_fault(boards)};

        return value[word];
    }
}

static double signal_read_lockstep(const struct scenario_view *view, size_t a, size_t word)
{
    const struct lockstep_counters *counters = &simulator_stats(view->simulator)->lockstep;
    const double value[ARRAY_COUNT(lockstep_words)] = {
        (double)counters->steps, (double)counters->mismatches, (double)counters->malformed,
        (double)counters->silences};

    (void)a;
    return value[word];
}

/* ---- names ---- */

/* Return the name with index i; NULL after the last name. */

static const char *signal_joint_name(const struct rig *rig, size_t i)
{
    return i < rig->robot->njoint ? rig->robot->joint[i].name : NULL;
}

static const char *signal_axis_name(const struct rig *rig, size_t i)
{
    return i < rig->naxis ? rig->axis[i].joint : NULL;
}

static const char *signal_ft_name(const struct rig *rig, size_t i)
{
    return i < rig->robot->nft ? rig->robot->ft[i].name : NULL;
}

static const char *signal_host_ft_name(const struct rig *rig, size_t i)
{
    return i < rig->nft ? rig->ft[i].name : NULL;
}

static const char *signal_contact_name(const struct rig *rig, size_t i)
{
    return i < rig->contact.nbody ? rig_contact_name(rig, i) : NULL;
}

static const char *signal_bus_name(const struct rig *rig, size_t i)
{
    return i < rig->nbus ? rig->bus[i].name : NULL;
}

/* Lists the names of one kind, at most NAMES_MAX. Returns the number of names. */
static size_t signal_list_names(const struct rig *rig,
                                const char *(*name_at)(const struct rig *rig, size_t i),
                                const char *name[NAMES_MAX])
{
    size_t count = 0;

    while (count < NAMES_MAX && (name[count] = name_at(rig, count))) {
        count++;
    }
    return count;
}

/* The forms of signal names: PREFIX.NAME.WORD. An empty prefix is omitted. Forms without names omit
 * NAME. Forms with longer prefixes come first. */
static const struct form {
    const char *prefix;
    const char *(*name)(const struct rig *rig, size_t i);
    const char *const *word;
    size_t nword;
    double (*read)(const struct scenario_view *view, size_t a, size_t b);
    bool host, floating; /* needs a host; needs a floating base */
} forms[] = {
    {"measured.ft", signal_ft_name, wrench_words, ARRAY_COUNT(wrench_words),
     signal_read_measured_ft, false, false},
    {"host.ft", signal_host_ft_name, host_force_words, ARRAY_COUNT(host_force_words),
     signal_read_host_ft, true, false},
    {"measured", signal_joint_name, joint_words, ARRAY_COUNT(joint_words),
     signal_read_measured_joint, false, false},
    {"host", signal_axis_name, host_joint_words, ARRAY_COUNT(host_joint_words),
     signal_read_host_joint, true, false},
    {"ft", signal_ft_name, wrench_words, ARRAY_COUNT(wrench_words), signal_read_ft, false, false},
    {"contact", signal_contact_name, wrench_words, ARRAY_COUNT(wrench_words), signal_read_contact,
     false, false},
    {"bus", signal_bus_name, bus_words, ARRAY_COUNT(bus_words), signal_read_bus, false, false},
    {"", signal_joint_name, joint_words, ARRAY_COUNT(joint_words), signal_read_joint, false, false},
    {"base", NULL, base_words, ARRAY_COUNT(base_words), signal_read_base, false, true},
    {"com", NULL, com_words, ARRAY_COUNT(com_words), signal_read_com, false, false},
    {"boards", NULL, boards_words, ARRAY_COUNT(boards_words), signal_read_boards, false, false},
    {"lockstep", NULL, lockstep_words, ARRAY_COUNT(lockstep_words), signal_read_lockstep, false,
     false},
    {"supply", NULL, (const char *const[]){"v"}, 1, signal_read_supply, false, false},
    {"hydraulic_supply", NULL, (const char *const[]){"pressure"}, 1, signal_read_oil, false, false},
    {"links", NULL, (const char *const[]){"clamped"}, 1, signal_read_clamped, false, false},
    {"host", NULL, (const char *const[]){"phase"}, 1, signal_read_host, true, false},
    {"task", NULL, (const char *const[]){"status"}, 1, signal_read_task, false, false},
};

/* Finds a word in a list; returns false if it is missing. */
static bool signal_find_word(const char *const *word, size_t count, const char *text, size_t *index)
{
    for (*index = 0; *index < count; ++*index) {
        if (strcmp(word[*index], text) == 0) {
            return true;
        }
    }
    return false;
}

/* Splits a name into PREFIX.middle.WORD. Returns false if it does not match the form. */
static bool signal_fits_form(const struct form *form, const char *name, char middle[PART_SIZE],
                             const char **word)
{
    size_t prefix = strlen(form->prefix);
    const char *last = strrchr(name, '.');
    const char *from = name;

    if (prefix) {
        if (strncmp(name, form->prefix, prefix) != 0 || name[prefix] != '.') {
            return false;
        }
        from = name + prefix + 1;
    }
    *word = last ? last + 1 : "";
    middle[0] = '\0';
    if (!form->name) {
        return last == name + prefix;
    }
    if (!last || last <= from) {
        return false;
    }
    snprintf(middle, PART_SIZE, "%.*s", (int)(last - from), from);
    return true;
}

/* Reports a signal with an unknown part, and suggests the nearest word. */
static enum error_code signal_unknown(const char *name, const char *part, const char *const *words,
                                      size_t count, const struct yaml_mark *mark,
                                      struct error *error)
{
    const char *nearest = text_nearest(part, words, count);

    return yaml_error(error, mark, "found signal \"%.80s\" with unknown \"%.60s\", expected %s%s%s",
                      name, part, nearest ? "\"" : "one that is listed by test --help",
                      nearest ? nearest : "", nearest ? "\"" : "");
}

enum error_code scenario_signal_find(const char *name, const struct rig *rig,
                                     const struct yaml_mark *mark, struct scenario_signal *signal,
                                     struct error *error)
{
    const char *names[NAMES_MAX], *word, *part = name;
    const char *const *words = NULL;
    const struct form *unnamed = NULL;
    char unknown[PART_SIZE];
    size_t count = 0;

    /* Longer prefixes come first in the table, so that measured.ft does not match a joint "ft" */
    for (size_t i = 0; i < ARRAY_COUNT(forms); i++) {
        const struct form *form = &forms[i];
        size_t n = 0, a = 0, b;
        char middle[PART_SIZE];

        if (!signal_fits_form(form, name, middle, &word)) {
            continue;
        }
        if (form->name) {
            n = signal_list_names(rig, form->name, names);
        }
        if (form->floating && !rig->robot->floating) {
            return yaml_error(error, mark, "found signal \"%.80s\", but the robot's base is fixed",
                              name);
        }

        /* The rig must have the name, and the form must have the quantity */
        if (!form->name || signal_find_word(names, n, middle, &a)) {
            if (signal_find_word(form->word, form->nword, word, &b)) {
                *signal = (struct scenario_signal){form->read, a, b, form->host};
                return ERROR_NONE;
            }
            words = form->word;
            count = form->nword;
            part = word;
        } else if (!unnamed) {
            unnamed = form;
            memcpy(unknown, middle, sizeof unknown);
        }
    }

    /* Choose the form for the error message: the last form that matched. Without a match, the first
     * form with only an unknown name. Otherwise, a joint */
    if (words) {
        return signal_unknown(name, part, words, count, mark, error);
    }
    count = signal_list_names(rig, unnamed ? unnamed->name : signal_joint_name, names);
    return signal_unknown(name, unnamed ? unknown : name, names, count, mark, error);
}

const char *const *scenario_signal_help(void)
{
    static const char *const lines[] = {
        "JOINT.q qd qm qmd current torque voltage winding: the true value (rad, A, N m, V, deg C)",
        "JOINT.piston_pressure rod_pressure valve_opening of a hydraulic joint, and "
        "hydraulic_supply.pressure (Pa, -1 to 1)",
        "measured.JOINT.*: as the boards' sensors measure it",
        "host.JOINT.q qm current torque motor fault: as received by the host in frames; motor 2 "
        "is on, 4 in fault",
        "ft.SENSOR.fx fy fz tx ty tz, measured.ft.SENSOR.*, host.ft.SENSOR.* and .overflow (N, N "
        "m)",
        "base.x y z qw qx qy qz tilt (m, rad); com.x y z; contact.BODY.fx fy fz tx ty tz",
        "bus.NAME.rx tx rx_dropped tx_dropped state; of a wire also tec bus_off errors load "
        "load_peak queued latency_max (s)",
        "boards.frames foreign unknown malformed timeouts trips overflows fault",
        "supply.v; links.clamped; host.phase (3 = ready, 4 = failed); task.status (0 running, 1 "
        "done, 2 failed); lockstep.steps mismatches malformed silences",
        NULL};

    return lines;
}
