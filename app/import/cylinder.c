/* SPDX-License-Identifier: Apache-2.0 */
/* Fits cylinders to joints, sizes the hydraulic supply, and chooses gains. The rules are in
 * drive.h. */
#include "app/import/drive.h"

#include "model/hydraulics/hydraulic.h"

#include <math.h>

#define BASE_STROKES 4.0 /* distance from the joint to the cylinder's pin, in strokes */
#define ARM_STROKES 2.0  /* largest distance from the joint to the rod's pin, in strokes */
#define STROKE_SHARE 0.9 /* share of the stroke that the joint's range uses */
#define LEVER_SHARE 0.25 /* smallest lever at the range's ends, per largest lever */
/* Accumulator: precharge as a share of the pressure, and the adiabatic exponent of nitrogen. */
#define PRECHARGE_SHARE 0.6
#define GAS_EXPONENT 1.4
#define RETURN_PA 2e5 /* pressure in the return line */
#define CYCLE_S 2.0   /* time in which the pump can extend and retract all pistons once, s */
/* relative rise above the pressure at which the relief valve passes the whole pump flow */
#define RELIEF_SHARE 0.005
/* Velocity gain K_v, as a share of the natural frequency on the oil; upper bound of K_v, 1/s; ki /
 * (kp K_v). */
#define OIL_SHARE 0.2
#define GAIN_MOST 16.0
#define INTEGRAL_SHARE 0.2

enum { BISECTIONS = 60 /* bisections that reduce an interval to the resolution of a double */ };

bool import_takes_cylinder(const struct import_robot *from, size_t j)
{
    return from->drive[j] && from->drive[j]->hydraulic.present;
}

/* ---- the triangle ---- */

/* Triangle of the joint and the two pins. The sides base and arm, m, meet at the joint. The angle
 * between them goes from first to last, rad, over the joint's range. */
struct triangle {
    double base, arm, first, last;
};

/* Computes the distance between the pins at an angle, by the law of cosines, m. */
static double triangle_length(const struct triangle *t, double angle)
{
    return sqrt(t->base * t->base + t->arm * t->arm - 2.0 * t->base * t->arm * cos(angle));
}

/* Computes the lever of the cylinder's force at an angle, d length / d angle, m. */
static double triangle_lever(const struct triangle *t, double angle)
{
    return t->base * t->arm * sin(angle) / triangle_length(t, angle);
}

/* Finds, by bisection, the range of this width, rad, whose levers at both ends are equal. */
static void triangle_center(struct triangle *t, double width)
{
    double low = 0.0, high = M_PI - width;

    for (int i = 0; i < BISECTIONS; i++) {
        t->first = 0.5 * (low + high);
        t->last = t->first + width;
        if (triangle_lever(t, t->first) < triangle_lever(t, t->last)) {
            low = t->first;
        } else {
            high = t->first;
        }
    }
}

/* Computes the triangle with the longest arm for which a range of this width, rad, uses
 * STROKE_SHARE of the stroke, m. */
static struct triangle triangle_fit(double stroke, double width)
{
    struct triangle t = {.base = BASE_STROKES * stroke};
    double low = 0.0, high = ARM_STROKES * stroke;

    for (int i = 0; i < BISECTIONS; i++) {
        t.arm = 0.5 * (low + high);
        triangle_center(&t, width);
        if (triangle_length(&t, t.last) - triangle_length(&t, t.first) < STROKE_SHARE * stroke) {
            low = t.arm;
        } else {
            high = t.arm;
        }
    }
    return t;
}

/* Fits a joint's catalogue cylinder to the joint's range. *least and *most receive its smallest and
 * largest torque at this pressure, N m. Returns an error if the range is too wide. */
static enum error_code joint_fit_cylinder(const struct import_robot *from, size_t j,
                                          double pressure, double *least, double *most,
                                          struct error *error)
{
    struct robot_joint *joint = &from->robot->joint[j];
    struct robot_hydraulic *cylinder = &joint->hydraulic;
    const double width = joint->upper - joint->lower;
    const struct import_joint *source = from->source[j];
    struct triangle t = {.arm = 0.0};
    double end = 0.0, longest = 1.0;
    struct error why;

    *cylinder = from->drive[j]->hydraulic;
    if (width < M_PI) {
        t = triangle_fit(cylinder->stroke, width);
        end = triangle_lever(&t, t.first);

        /* Compute the largest lever in the range, m. It equals the arm if the rod is perpendicular
         * to the arm somewhere in the range. */
        const double across = acos(t.arm / t.base);

        longest = across > t.first && across < t.last
                      ? t.arm
                      : fmax(triangle_lever(&t, t.first), triangle_lever(&t, t.last));
    }
    if (end < LEVER_SHARE * longest) {
        return import_error(error, source->file, source->line,
                            "found joint \"%.63s\", which turns by %.3g rad, with the hydraulic "
                            "drive %.63s, expected at most some 2.6 rad: a cylinder has hardly a "
                            "lever at the ends of more",
                            source->name, width, from->drive[j]->name);
    }

    /* Write the triangle to the cylinder. The piston extends toward the end of the range that
     * is nearer to 0. */
    const double shortest = triangle_length(&t, t.first);
    const double way = triangle_length(&t, t.last) - shortest;
    const bool positive = fabs(joint->upper) <= fabs(joint->lower);

    cylinder->base = t.base;
    cylinder->arm = t.arm;
    cylinder->closed = shortest - 0.5 * (cylinder->stroke - way);
    cylinder->offset =
        remainder(positive ? t.first - joint->lower : -t.first - joint->upper, 2.0 * M_PI);

    /* The torque is smallest when the cylinder pulls at an end of the range, and largest when it
     * pushes with the largest lever */
    *least = pressure * cylinder->A2 * end;
    *most = pressure * cylinder->A1 * longest;
    return hydraulic_check(cylinder, joint->lower, joint->upper, &why)
               ? import_error(error, source->file, source->line, "%.63s: %.300s", source->name,
                              why.text)
               : ERROR_NONE;
}

/* ---- the supply ---- */

/* Sizes pump, accumulator and relief valve for the volumes of all cylinders, and adds a note. */
static void robot_size_supply(const struct import_robot *from, double pressure, int line,
                              struct import_notes *notes)
{
    const double emptied = 1.0 - pow(PRECHARGE_SHARE, 1.0 / GAS_EXPONENT);
    struct robot_hydraulic_supply *supply = &from->robot->hydraulic_supply;
    double out = 0.0, in = 0.0, leaks = 0.0;

    for (size_t j = 0; j < from->robot->njoint; j++) {
        const struct robot_hydraulic *cylinder = &from->robot->joint[j].hydraulic;

        out += cylinder->A1 * cylinder->stroke;
        in += cylinder->A2 * cylinder->stroke;
        leaks += cylinder->leakage * pressure;
    }
    /* Between the pressure and the precharge, an accumulator gives the share "emptied" of its
     * volume */
    *supply = (struct robot_hydraulic_supply){.pressure = pressure,
                                              .back = RETURN_PA,
                                              .pump = leaks + (out + in) / CYCLE_S,
                                              .accumulator = out / emptied,
                                              .precharge = PRECHARGE_SHARE * pressure,
                                              .relief = pressure};
    supply->relief_flow = supply->pump / (RELIEF_SHARE * pressure);
    import_note_add(notes, IMPORT_ASSUMED, from->model->file, line,
                    "hydraulic supply: %.4g bar, a pump of %.3g l/min and an accumulator of %.3g l "
                    "precharged to %.3g bar",
                    pressure * 1e-5, supply->pump * 6e4, supply->accumulator * 1e3,
                    supply->precharge * 1e-5);
}

/* ---- all of them ---- */

/* Adds a note on a joint's fitted cylinder. Adds a warning if it is too weak for a pose, or made
 * for another pressure. bears and least are in N m, pressure in Pa. */
static void joint_tell_cylinder(const struct import_robot *from, size_t j, double pressure,
                                double bears, double least, struct import_notes *notes)
{
    const struct robot_joint *joint = &from->robot->joint[j];
    const struct robot_hydraulic *cylinder = &joint->hydraulic;
    const struct import_joint *source = from->source[j];
    const struct robot_drive *drive = from->drive[j];

    import_note_add(notes, IMPORT_ASSUMED, source->file, source->line,
                    "drive of joint \"%.63s\": %.63s of the catalogue on a triangle with base %.4g "
                    "m, arm %.4g m and %.4g m between the pins with the piston drawn in, pushing "
                    "%s; %.3g N m at most, %.3g at least; the file's effort %g and velocity %g are "
                    "not used",
                    source->name, drive->name, cylinder->base, cylinder->arm, cylinder->closed,
                    hydraulic_direction(cylinder, joint->lower, joint->upper) > 0.0 ? "positively"
                                                                                    : "negatively",
                    joint->torque_limit, least, source->effort, source->velocity);

    /* Do not refuse weak or mismatched drives, because the user has chosen them */
    if (least < bears) {
        import_note_add(notes, IMPORT_CHANGED, source->file, source->line,
                        "joint \"%.63s\" bears %.3g N m in a pose, its drive %.63s gives %.3g to "
                        "%.3g",
                        source->name, bears, drive->name, least, joint->torque_limit);
    }
    if (drive->pressure != pressure) {
        import_note_add(notes, IMPORT_CHANGED, source->file, source->line,
                        "joint \"%.63s\" has a drive for %.4g bar, %.63s, on a supply of %.4g bar",
                        source->name, drive->pressure * 1e-5, drive->name, pressure * 1e-5);
    }
}

enum error_code import_take_cylinders(struct import_robot *from, const double *bears,
                                      struct import_notes *notes, struct error *error)
{
    struct robot *robot = from->robot;
    double pressure = 0.0, least;
    int line = 0;

    /* The supply has the highest nominal pressure of the drives; errors are reported at the first
     * of their joints */
    for (size_t j = robot->njoint; j-- > 0;) {
        if (import_takes_cylinder(from, j)) {
            line = from->source[j]->line;
            pressure = fmax(pressure, from->drive[j]->pressure);
        }
    }
    if (!(pressure > 0.0)) {
        return ERROR_NONE;
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        if (import_takes_cylinder(from, j)) {
            enum error_code code =
                joint_fit_cylinder(from, j, pressure, &least, &robot->joint[j].torque_limit, error);

            if (code) {
                return code;
            }
            joint_tell_cylinder(from, j, pressure, bears[j], least, notes);
        }
    }
    robot_size_supply(from, pressure, line, notes);
    return ERROR_NONE;
}

/* ---- gains ---- */

/* Computes the stiffness of the trapped oil at the joint behind a closed valve, N m/rad: lever^2
 * beta (A1^2 / V1 + A2^2 / V2). */
static double cylinder_stiffness(const struct robot_hydraulic *cylinder, double q)
{
    double lever, x = hydraulic_length(cylinder, q, &lever) - cylinder->closed;
    const double V1 = cylinder->dead + cylinder->A1 * x;
    const double V2 = cylinder->dead + cylinder->A2 * (cylinder->stroke - x);

    return lever * lever * cylinder->beta *
           (cylinder->A1 * cylinder->A1 / V1 + cylinder->A2 * cylinder->A2 / V2);
}

struct import_gains import_cylinder_gains(const struct robot *robot, size_t j, double q,
                                          double inertia)
{
    const struct robot_joint *joint = &robot->joint[j];
    /* K_v is a share of the natural frequency on the oil, sqrt(k / I) */
    const double swings = sqrt(cylinder_stiffness(&joint->hydraulic, q) / inertia);
    const double gain = fmin(OIL_SHARE * swings, GAIN_MOST);
    const double kw = hydraulic_speed_constant(&joint->hydraulic, &robot->hydraulic_supply,
                                               joint->lower, joint->upper);

    return (struct import_gains){.kp_v_per_rad = gain * kw,
                                 .ki_v_per_rad_s = INTEGRAL_SHARE * gain * gain * kw,
                                 .kw_v_s_per_rad = kw};
}
