/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil-bench paper: reproduces the tables and figures of the paper in one report. */
#include "app/bench/bench.h"

#include "base/options.h"
#include "manual/paper.h"
#include "manual/peers.h"
#include "base/config.h"

#include <unistd.h>

static const char title[] =
    "Multi-physics Modelling of a Compliant Humanoid Robot: the paper and coman-hil";

void paper_progress(struct paper *paper, const char *what)
{
    paper->step++;
    if (isatty(STDERR_FILENO)) {
        fprintf(stderr, "\r\033[Kbench paper: %zu of %zu: %s", paper->step, paper->nstep, what);
    }
}

/* Measures all parts of the paper, and adds their sections. */
static enum error_code paper_measure_all(struct paper *paper, struct error *error)
{
    struct report *report = &paper->report;
    struct pendulum_table table;
    char path[PATH_MAX];
    enum error_code code;

    /* Find a rig first, so that a missing rig is reported before the pendulums run for minutes */
    if ((code = config_locate(CONFIG_RIG, "grasp", path, error)) ||
        (code = paper_pendulums(paper, &table, error)) || (code = paper_grasp(paper, error)) ||
        (code = paper_squat(paper, error)) || (code = paper_speed(paper, &table, error))) {
        return code;
    }

    /* Add the findings that depend on our own choices, where the paper gives no value */
    report_section(report, "choices", "What follows from choices of ours");
    report_text(report, "Measured on a real robot is nothing here. What agrees with the paper "
                        "agrees with what it says of its own simulator, and these findings with "
                        "the help of choices where it says nothing or cannot be followed.");
    report_table(report, "choices-made", "", "finding|our choice|why");
    report_row(report, "the wrists touch at 1.06 s; how hard they press; angles of the arm|The "
                       "path of the arms, found by inverse kinematics so that the wrists meet the "
                       "box's middle at that time.|The paper only plots its own.");
    report_row(report,
               "the box is lifted; how hard the wrists press|Elastic layers 1 mm thick.|Table 2 "
               "has no thickness; with 1 cm the wrists could not carry the box.");
    report_row(report,
               "all that stands on its feet|Feet and ground with the layers and friction of the "
               "authors' walking code.|With the 1e4 Pa of Table 2 gravity topples the robot.");
    report_row(report, "the soft elbow presses less than the stiff one|Forearms that weigh "
                       "nothing.|An elbow of 0.0012 N m/rad cannot carry one of 2.2 kg.");
    report_row(report, "energy errors of the pendulums at 1e-4 and 1e-6|Compensated summation of "
                       "the state.|Plain RK4 has the paper's.");
    report_row(report, "all of Table 1 and Fig. 3|The second pendulum's mass is 2.|The paper "
                       "leaves it out; no other mass makes both turn as one.");

    /* Add the list of results that are not reproduced, with reasons */
    report_section(report, "rest", "What is not reproduced");
    report_table(report, "not-reproduced", "", "of the paper|why");
    report_row(report,
               "Figs. 1, 2, 5 to 8|Drawings of the robot, the simulator's parts, the actuator, "
               "meshes in contact, the coupling with Simbody; pictures of the tasks, which the "
               "page of a run shows (run --http): there is nothing to measure.");
    report_row(report, "Fig. 9: the references themselves|Plotted only. The path here is our own.");
    report_row(report, "Fig. 12: measured curves|Measured on the real WALK-MAN, plotted only.");
    report_row(report, "Figs. 3, 4, 9 to 12: curves point by point|No numbers are published; "
                       "compared is what the text says of them.");
    report_row(report,
               "supplementary animations|A recording (run --record) has all motion, as numbers.");
    return ERROR_NONE;
}

/* Opens, fills and closes the report. After an error it writes nothing more. */
static enum error_code make_report(struct paper *paper, struct error *error)
{
    enum error_code code = report_open(&paper->report, paper->folder, title, error);

    if (code) {
        return code;
    }
    code = paper_measure_all(paper, error);
    if (isatty(STDERR_FILENO)) {
        fprintf(stderr, "\r\033[K");
    }
    if (code) {
        report_abandon(&paper->report);
        return code;
    }
    return report_close(&paper->report, error);
}

int bench_paper(int argc, char **argv)
{
    static const char *folder = "paper-report", *module;
    static bool quick;
    static const struct option_spec options[] = {
        {"--quick", OPTION_FLAG, NULL,
         "a preview in seconds: without the pendulums' step of 1e-6, one cycle of the squat, one "
         "run for each real-time factor, the whole robot only in Fig. 4",
         .value = &quick},
        BENCH_OUT_OPTION(&folder,
                         "index.html, the tables and figures as CSV, and the plots as SVG"),
        BENCH_PEERS_OPTION(&module),
    };
    static const struct command_spec spec = {
        .program = "coman-hil-bench",
        .name = "paper",
        .summary = "A report with every table and figure of the paper that can be reproduced.",
        OPTION_TABLE(options),
        .manual = MANUAL_PAPER "\n\n" MANUAL_PEERS,
    };
    static struct paper paper;
    struct peers_library library;
    struct error error;
    enum error_code code;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    /* Other simulators are optional: without them the report has only our numbers */
    code = bench_peers(module, "ours only", &library, &error);
    if (!code) {
        paper = (struct paper){.folder = folder,
                               .quick = quick,
                               .peers = library.peers,
                               .nstep = 8 + PAPER_SPEEDS * (quick ? 1 : 5)};
        code = make_report(&paper, &error);
    }
    peers_close(&library);
    if (!code) {
        printf("%s/index.html\n", folder);
    }
    return options_end(&spec, code, &error);
}
