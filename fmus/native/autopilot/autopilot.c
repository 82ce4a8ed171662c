/* The autopilot: holds an angle of attack, and takes gauges out of use that do not fit the others.

   It samples its inputs at the end of every step. docs/explanation/flight.md derives the control law;
   strainfmu/cosim/models/autopilot_law.py holds it in Python. */

#include <math.h>
#include <stdio.h>

#include "../system/system_model.h"

enum {
    CONTROL_MOMENT, ESTIMATED_ANGLE, TRUSTED, ISOLATED_GAUGES, /* outputs, then a valid per gauge, then the rest */
    N_OUTPUTS
};
enum {
    COMMANDED_ANGLE, C_N, M_P, CHI_SQUARE, CHI_SQUARE_LIMIT, SUSPECT_GAUGE, DYNAMIC_PRESSURE, PITCH_RATE,
    FREQUENCY, DAMPING_RATIO, OBSERVER_RATE, LARGEST_MOMENT, HOLD_TIME, CONFIRMATIONS, LARGEST_ISOLATED,
    N_INPUTS
};
/* Constants at the head of the data; the table of angle of attack [rad] and C_N follows. */
enum { N_GAUGES, N_ROWS, REFERENCE_AREA, REFERENCE_LENGTH, MASS, PITCH_INERTIA, SPEED, N_CONSTANTS };
/* The last good C_N and M_P, whether there are any, since when [s]; the gauge suspected and how many times in a row;
   the angular acceleration that nothing explains [rad/s2], the rate of the angle of attack that was predicted for now
   [rad/s], the acceleration that is predicted from now on, the time of the sample, and whether there was one before. */
enum {
    GOOD_C_N, GOOD_M_P, HAS_GOOD, GOOD_TIME,
    SUSPECT, TIMES,
    UNEXPLAINED, PREDICTED_RATE, PREDICTED_ACCELERATION, SAMPLE_TIME, OBSERVING,
    N_STATES
};

static size_t count(double value) {
    return value >= 0.0 && value < 1e6 ? (size_t)value : 0;
}

static int prepare(SystemModel *model, char text[MODEL_TEXT_SIZE]) {
    const double *data = model->data;
    const size_t rows = model->n_data > N_CONSTANTS ? count(data[N_ROWS]) : 0;
    int good = rows >= 2 && model->n_data == N_CONSTANTS + 2 * rows
            && model->n_variables == N_OUTPUTS + count(data[N_GAUGES]) + N_INPUTS;
    for (int k = REFERENCE_AREA; good && k < N_CONSTANTS; k++) {
        good = data[k] > 0.0;
    }
    for (size_t k = 1; good && k < rows; k++) {
        const double *row = data + N_CONSTANTS + 2 * k;
        good = row[0] > row[-2] && row[1] > row[-1];
    }
    if (!good) {
        snprintf(text, MODEL_TEXT_SIZE, "holds an autopilot whose data do not fit, or whose C_N does not rise");
        return STATUS_ERROR;
    }
    model->n_states = N_STATES;
    return STATUS_OK;
}

static double *inputs_of(const SystemModel *model) {
    return model->value + N_OUTPUTS + count(model->data[N_GAUGES]);
}

/* Angle of attack at a C_N, and the slope of C_N there: the table's, its ends prolonged. */
static double angle_at(const SystemModel *model, double c_n, double *slope) {
    const double *row = model->data + N_CONSTANTS;
    for (size_t k = count(model->data[N_ROWS]); k > 2 && c_n > row[3]; k--) {
        row += 2;
    }
    *slope = (row[3] - row[1]) / (row[2] - row[0]);
    return row[0] + (c_n - row[1]) / *slope;
}

/* Compare the rate of the angle of attack with what was predicted: the difference, filtered, is an acceleration that
   neither C_N nor M_P nor the control explains. */
static void observe(SystemModel *model, double angle_rate) {
    double *state = model->state;
    const double rate = inputs_of(model)[OBSERVER_RATE];
    if (state[OBSERVING] != 0.0 && model->value[TRUSTED] != 0.0 && rate > 0.0) {
        state[PREDICTED_RATE] += (model->base.time - state[SAMPLE_TIME]) * state[PREDICTED_ACCELERATION];
        state[UNEXPLAINED] = rate * (angle_rate - state[PREDICTED_RATE]);
    } else { /* nothing new is known: go on from here */
        state[UNEXPLAINED] = rate > 0.0 ? state[UNEXPLAINED] : 0.0;
        state[PREDICTED_RATE] = angle_rate - (rate > 0.0 ? state[UNEXPLAINED] / rate : 0.0);
    }
    state[OBSERVING] = 1.0;
    state[SAMPLE_TIME] = model->base.time;
}

static double bounded(double moment, double largest) {
    return moment > largest ? largest : moment < -largest ? -largest : moment;
}

/* The moment that gives the angle of attack the chosen second-order motion; *angle is the inferred one. */
static double control_moment(SystemModel *model, double *angle) {
    const double *data = model->data, *in = inputs_of(model);
    double *state = model->state;
    const double frequency = in[FREQUENCY], damping = 2.0 * in[DAMPING_RATIO] * frequency;
    if (state[HAS_GOOD] == 0.0 || !isfinite(in[DYNAMIC_PRESSURE]) || !isfinite(in[PITCH_RATE])) {
        state[OBSERVING] = 0.0;
        const double moment = isfinite(in[PITCH_RATE]) ? -data[PITCH_INERTIA] * damping * in[PITCH_RATE] : 0.0;
        return bounded(moment, in[LARGEST_MOMENT]);
    }
    double slope;
    *angle = angle_at(model, state[GOOD_C_N], &slope);
    const double force_scale = in[DYNAMIC_PRESSURE] * data[REFERENCE_AREA], momentum = data[MASS] * data[SPEED];
    const double angle_rate = in[PITCH_RATE] - force_scale * state[GOOD_C_N] / momentum;
    const double relief = force_scale * slope / momentum * angle_rate;
    const double aerodynamic = force_scale * data[REFERENCE_LENGTH] * state[GOOD_M_P];
    observe(model, angle_rate);
    const double acceleration =
        frequency * frequency * (in[COMMANDED_ANGLE] - *angle) - damping * angle_rate - state[UNEXPLAINED];
    const double moment =
        bounded(data[PITCH_INERTIA] * (acceleration + relief) - aerodynamic, in[LARGEST_MOMENT]);
    state[PREDICTED_ACCELERATION] = (moment + aerodynamic) / data[PITCH_INERTIA] - relief + state[UNEXPLAINED];
    return moment;
}

/* Whether the estimate fits its gauges, and which gauge does not: states INCONSISTENT and SUSPECT of the health. */
static int is_suspect(const double *in) {
    return in[SUSPECT_GAUGE] > 0.0 || in[CHI_SQUARE] > in[CHI_SQUARE_LIMIT];
}

/* Count how often in a row a gauge was the suspect. */
static void watch(SystemModel *model) {
    double *state = model->state;
    const double suspect = inputs_of(model)[SUSPECT_GAUGE];
    const int is_gauge = count(suspect) > 0;
    state[TIMES] = is_gauge ? (suspect == state[SUSPECT] ? state[TIMES] + 1.0 : 1.0) : 0.0;
    state[SUSPECT] = suspect;
}

/* Take a gauge out of use that was the suspect often enough in a row. Only steps do so: at the start valid depends on
   nothing, so that estimator and autopilot, each fed by the other, need no iteration there. */
static void isolate(SystemModel *model) {
    double *state = model->state, *out = model->value;
    const double *in = inputs_of(model);
    const size_t gauge = count(in[SUSPECT_GAUGE]);
    const int confirmed = in[CONFIRMATIONS] > 0.0 && gauge > 0 && state[TIMES] >= in[CONFIRMATIONS];
    if (confirmed && gauge <= count(model->data[N_GAUGES]) && out[ISOLATED_GAUGES] < in[LARGEST_ISOLATED]
        && out[N_OUTPUTS + gauge - 1] != 0.0) {
        out[N_OUTPUTS + gauge - 1] = 0.0;
        out[ISOLATED_GAUGES] += 1.0;
        state[TIMES] = 0.0;
    }
}

/* One sample. What is not finite is never used; what is suspect is not used for hold_time, then used after all. */
static void sample(SystemModel *model) {
    double *state = model->state, *out = model->value;
    const double *in = inputs_of(model);
    const int finite = isfinite(in[C_N]) && isfinite(in[M_P]);
    const double held = model->base.time - state[GOOD_TIME];
    const int overdue = held > in[HOLD_TIME] * (1.0 + 1e-9);
    out[TRUSTED] = finite && !is_suspect(in);
    if (finite && (out[TRUSTED] != 0.0 || overdue || state[HAS_GOOD] == 0.0)) {
        state[GOOD_C_N] = in[C_N];
        state[GOOD_M_P] = in[M_P];
        state[HAS_GOOD] = 1.0;
    } else if (!finite && overdue) {
        state[HAS_GOOD] = 0.0; /* nothing to go by: damp the motion */
    }
    if (out[TRUSTED] != 0.0) {
        state[GOOD_TIME] = model->base.time;
    }
    watch(model);
    const double moment = control_moment(model, out + ESTIMATED_ANGLE);
    out[CONTROL_MOMENT] = isfinite(moment) ? moment : 0.0;
}

static void begin(SystemModel *model) {
    const size_t n = count(model->data[N_GAUGES]);
    for (int k = 0; k < N_STATES; k++) {
        model->state[k] = 0.0;
    }
    model->state[GOOD_TIME] = model->base.time;
    for (size_t g = 0; g < n; g++) {
        model->value[N_OUTPUTS + g] = 1.0;
    }
    model->value[ISOLATED_GAUGES] = model->value[ESTIMATED_ANGLE] = 0.0;
    sample(model);
}

static int step(SystemModel *model, double end, char text[MODEL_TEXT_SIZE]) {
    (void)text;
    model->base.time = end;
    sample(model);
    isolate(model);
    return STATUS_OK;
}

const Behaviour AUTOPILOT = {prepare, begin, NULL, step};
