/* What a solution says: loads, coefficients, air data, and the conditions that health follows from. */

#ifndef FLIGHT_OUTPUTS_H
#define FLIGHT_OUTPUTS_H

#include "../linear/linear_outputs.h"
#include "../nonlinear/flight_known.h"
#include "../nonlinear/flight_loads.h"
#include "../nonlinear/flight_sample.h"

#define N_FLIGHT_REALS (2 * N_AIR_DATA) /* outputs: air data, then their standard deviations */
#define NAVIGATION_USED N_AIR_DATA      /* flags: whether each of the air data is identified, then these */
#define LINEAR_LOADS (N_AIR_DATA + N_NAVIGATION)
#define N_FLIGHT_FLAGS (LINEAR_LOADS + 1)

/* What a step leaves to the next one: docs/explanation/nonlinear_estimator.md. */
typedef struct {
    double has_state; /* 0 or 1; all of it float64, as it is serialised */
    double state[N_STATES];
    double since_search, to_return; /* steps */
    double widening[N_WIDENING];    /* of the last search; 0 where navigation gave the pressure then */
    double stepped;                 /* whether the outputs are of a step that has been taken */
} Track;

typedef struct {
    int present; /* whether the map has tables; if not, nothing else is set */
    Inputs *inputs;
    double *output;   /* (N_OUTPUTS) of the estimator */
    Linear *linear;   /* for what fits no table */
    OtherLoads *loads;   /* in addition to the five, of a map that has some */
    FlightMap map;
    FlightSolver solver;
    FlightOtherLoads other_loads;
    Known known; /* parameters of the flow, of a map with tables of them */
    Track base; /* that the outputs follow from */
    Track next; /* that they leave */
    double prior_std[N_STATES];
    Navigation navigation;   /* of the inputs */
    double real[N_FLIGHT_REALS];
    unsigned char flag[N_FLIGHT_FLAGS];
    int conditions;            /* of the sample, bits of outputs.h */
    int fits;                  /* whether strain and navigation fit the tables, */
    double degrees_of_freedom; /* and the degrees of freedom of chi-square */
} Flight;

/* Whether a quantity of navigation fits strain and the others so badly that it is dropped: the worst one. Below the
   alarm it may as well be another one that is wrong: then they count with larger standard deviations. */
int flight_drop_inconsistent(Flight *flight);

/* Whether a quantity of navigation has a value that is not used, and that is no correct one. */
int flight_navigation_alarms(const Flight *flight);

/* Whether strain, of so many gauges in use, and navigation fit the tables. */
int flight_solution_fits(const Flight *flight, size_t used);

/* Write the solution to the outputs; whether it fits. */
int flight_conclude(Flight *flight, size_t used);

/* Nothing is known, for this condition, and the step leaves the track as it was. */
void flight_set_nothing_known(Flight *flight, int condition);

#endif
