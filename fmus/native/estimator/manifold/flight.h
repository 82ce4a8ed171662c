/* The nonlinear estimator's state and outputs, beside those of Estimator.

   The equations are those of strainfmu/estimator/reference/nonlinear.py and air.py. */

#ifndef FLIGHT_H
#define FLIGHT_H

#include "../filter/filter.h"
#include "../tables/flight_known.h"
#include "flight_further.h"

#define N_AIR_DATA 7
#define N_FLIGHT_REALS (2 * N_AIR_DATA) /* outputs: air data, then their deviations */
#define NAVIGATION_USED N_AIR_DATA      /* flags: whether each of the air data is identified, then these */
#define LINEAR_LOADS (N_AIR_DATA + N_NAVIGATION)
#define N_FLIGHT_FLAGS (LINEAR_LOADS + 1)

enum { ANGLE_OF_ATTACK, SIDESLIP_ANGLE, TOTAL_INCIDENCE, WIND_ROLL_ANGLE, AIR_MACH_NUMBER, AIR_PRESSURE, AIR_DYNAMIC };

/* Real inputs after those of the linear estimator. */
#define N_FLIGHT_INPUTS 3 /* deviation of the Mach number [1]; static pressure and its deviation [Pa] */

/* What a step leaves to the next one: docs/explanation/nonlinear_estimator.md. */
typedef struct {
    double has_state; /* 0 or 1; all of it float64, as it is serialised */
    double state[N_STATES];
    double since_search, to_return; /* steps */
    double widening[N_WIDENING];    /* of the last search; 0 where navigation told the pressure then */
    double stepped;                 /* whether the outputs are those of a step that has been taken */
} Track;

typedef struct {
    int present; /* whether the map has tables; if not, nothing else is set */
    FlightMap map;
    FlightSolver solver;
    FlightFurther further;
    Known known; /* parameters of the flow, of a map with tables of them */
    Filter filter; /* over time, if the map has one */
    void *memory;
    Track base; /* that the outputs follow from */
    Track next; /* that they leave */
    int searched_again; /* whether a step from the last state has searched the tables for what else fits */
    double prior_std[N_STATES];
    double value[N_NAVIGATION], std[N_NAVIGATION]; /* of navigation; NaN where not known */
    double real[N_FLIGHT_REALS];
    unsigned char flag[N_FLIGHT_FLAGS];
    int fits;                  /* whether strain and navigation fit the tables, */
    double degrees_of_freedom; /* and those of chi-square */
} Flight;

struct Estimator;

/* Read the parts of the tables, if there are any, and allocate. 1; 0 after a message. */
int flight_create(struct Estimator *e, MapFile *file);
void flight_free(Flight *flight);
void flight_reset(Flight *flight);

/* Set all outputs for the present inputs, from the track of the last step. */
void flight_update(struct Estimator *e);

/* For estimator_before_change. */
void flight_before_change(struct Estimator *e);

/* Take a step with the present inputs, from a point in time [s]. */
void flight_step(struct Estimator *e, double start);

/* Air data of a solution, in flight->real and flight->flag. */
void flight_air_data(Flight *flight, const Solution *found);

/* Least deviation of a value of navigation, relative: LEAST_RELATIVE_STD of navigation.py. */
#define MIN_RELATIVE_STD 1e-3

/* Whether samples are filtered: the time constant is positive. */
int flight_filters(const struct Estimator *e);

/* Set all outputs by the filter, for so many gauges in use. */
void flight_filter_update(struct Estimator *e, size_t used);

/* Whether a serialised track of the filter, and a law, may be read. */
int filter_track_fits(const Filter *filter, const FilterTrack *track, const unsigned char *law);

/* Whether a serialised track may be read. */
int flight_track_fits(const Flight *flight, const Track *track);

#endif
