/* The estimator: strains and dynamic pressure in; loads, coefficients and health out.

   Equations: strainfmu/estimator/reference/linear.py. Outputs are computed when they are read and kept until an
   input or a setting changes. Nothing is allocated after estimator_create, and instances share nothing. */

#ifndef ESTIMATOR_H
#define ESTIMATOR_H

#include "policies/policies.h"
#include "temperature/thermal.h"
#include "zeros/zeros.h"

/* The matrices of the map follow the standard deviations of zero offsets: in a step a part of those for other ones, at once
   where nothing has a deadline. */

typedef struct {
    double under_way; /* whether a step has been taken; these three float64, as they are serialised */
    double parts;     /* of the matrices for `target` that are made, */
    double waited;    /* and steps in a row that made none */
    int made;         /* whether those are all: the next step uses the matrices */
    double *held;     /* (number_of_zeros) in use in the last step; the map holds for their standard deviations */
    double *target;   /* (number_of_zeros) those that matrices are made for */
} Renewal;

/* Number of outputs that are whole numbers: the health state, VALID_GAUGES to SUSPECTS, and the state of the tare. */
#define N_WHOLE 5
#define TARE_WHOLE (N_WHOLE - 1) /* place of the state of the tare among them */

typedef struct {
    Model base; /* for the FMI fronts, filled in by estimator_model.c */
    Map map;
    unsigned char *bytes; /* of map.bin, if the instance owns them */
    Memory memory;        /* blocks of the instance: estimator_model.c frees them */
    SensorRows sensors;
    FlowParameters parameters;
    OtherLoads other_loads;      /* loads in addition to the five, of a map that has some */
    Thermal thermal;      /* of a map with temperature modes */
    Tare tare;
    Inputs inputs;
    double output[N_OUTPUTS];
    int outdated;         /* whether an input has changed since output was computed, */
    int noise_outdated;   /* and whether zeros or their standard deviations may be others than in use */
    Linear linear;
    Renewal renewal;
    Flight flight; /* the nonlinear estimator, if the map has tables */
    Filter filter; /* over time, if the map has one */
    double *direction;       /* as inputs.value, of derivatives, for estimator_model.c, */
    double *derivative;      /* (estimator_derivatives) which keeps the outputs' derivatives along it, */
    double *derivative_work; /* (inputs_count) and twice (estimator_derivatives) scratch, */
    int reported_health;     /* the last health that was reported, */
    int reported_angles;     /* whether an angle without standard deviation was, */
    double settled[N_WHOLE]; /* and the whole numbers of the last event in model exchange */
} Estimator;

/* Make an estimator of the map in bytes [length], which must outlive it, in blocks of `memory`: the caller frees these, also
   if it fails. Return NULL with a text then. */
Estimator *estimator_create(Memory *memory, const unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]);

/* Give inputs and settings their start values, and forget steps and tare. */
void estimator_reset(Estimator *estimator);

/* Zeros, their standard deviations, and the common one, to be in use: of the last tare, or of the inputs. */
static inline const double *latest_zeros(const Estimator *e) {
    return e->tare.present && e->tare.flags.has_zeros != 0.0 ? e->tare.zero : zeros_given(&e->inputs);
}

/* Of renewal.c: hand out the arrays; no step has been taken; let the map hold for zeros (number_of_zeros), and, if they are
   others, for the known temperature sensors. */
void renewal_arrays(Estimator *estimator, Room *room);
void renewal_reset(Estimator *estimator);
void renewal_at_once(Estimator *estimator, const double *zeros, int other_sensors);

/* A step begins: the first one follows the latest zeros at once, others use matrices that are made. The estimate of the step
   is made. Whether steps have yet to follow the latest zeros, and which are in use. */
void renewal_begin_step(Estimator *estimator);
void renewal_end_step(Estimator *estimator);
int renewal_pending(const Estimator *estimator);
const double *zeros_in_use(const Estimator *estimator);

/* Its state in bytes; whether bytes may be read. */
size_t renewal_state_size(const Estimator *estimator);
void renewal_write_state(const Estimator *estimator, unsigned char *bytes);
int renewal_state_fits(const Estimator *estimator, const unsigned char *bytes);
void renewal_read_state(Estimator *estimator, const unsigned char *bytes);

/* Let the latest zeros be in use, however long that takes. */
void estimator_renew(Estimator *estimator);

/* Whether samples are filtered: the time constant is positive, and the instance takes steps. */
int estimator_filters(const Estimator *estimator);

/* An input changes: what follows starts from what the last step left. */
void estimator_before_change(Estimator *estimator);

/* The next sample is the first one. */
void estimator_restart(Estimator *estimator);

/* Take a step with the present inputs, from a point in time [s]. */
void estimator_step(Estimator *estimator, double start);

/* A step or an event takes the input of the tare in; an accepted step also takes readings. */
void estimator_follow_tare(Estimator *estimator);
void estimator_take_readings(Estimator *estimator);

/* The axis, 1 or 2, of the specific force that contradicts the loads of the last outputs; 0 for none. */
int estimator_contradicted_force(const Estimator *estimator);

/* The N_OUTPUTS outputs for the present inputs; of maps with tables also those in estimator->flight. */
const double *estimator_outputs(Estimator *estimator);

/* The N_OTHER_VALUES arrays of loads in addition to the five, of outputs that are computed; NULL without. */
const double *other_loads_of(Estimator *estimator);

/* Give an input or setting a value. Readings count as given, other zeros end the use of a tare's. 1; 0, after a message, if it
   is refused. */
int estimator_set_input(Estimator *estimator, size_t input, double value, char text[MODEL_TEXT_SIZE]);

/* Number of derivatives: N_OUTPUTS, air data, all loads in addition to the five. */
static inline size_t estimator_derivatives(const Estimator *e) {
    return N_OUTPUTS + N_FLIGHT_REALS + N_OTHER_VALUES * e->other_loads.map.n_loads;
}

/* Derivatives of loads, coefficients and air data: differences of fourth order of the estimates that the iterations end at.

   The nonlinear estimator takes steps with the same inputs until they no longer move the flight state; with a filter it is
   the one step, from what the steps before left. Searches and waiting for the tables are held as they are. */

/* Derivatives of the estimate along a direction of the inputs (inputs_count), which is scratch: estimator_derivatives of
   them; for loads, coefficients and air data they are good, NaN where the output is. The estimator is left as it was. 1; 0,
   after a message, where it has none. */
int estimator_derivative(Estimator *estimator, double *direction, double *derivative, char text[MODEL_TEXT_SIZE]);

#endif
