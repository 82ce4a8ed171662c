/* Decisions about a solution: what is dropped, what else fits, which loads count, what is filtered. */

#ifndef POLICIES_H
#define POLICIES_H

#include "../linear/linear.h"
#include "../nonlinear/nonlinear.h"
#include "../filter/filter.h"

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
    int conditions;            /* of the sample, bits of sample.h */
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

/* Transfers of the solution's loads and coefficients to moment point and references of the settings. */
void flight_transfers(const Flight *flight, double of_loads[N_LOADS][N_LOADS], double of_coefficients[N_LOADS][N_LOADS]);

/* Write the solution to the outputs; whether it fits. */
int flight_conclude(Flight *flight, size_t used);

/* Nothing is known, for this condition, and the step leaves the track as it was. */
void flight_set_nothing_known(Flight *flight, int condition);

/* Flight states that fit about as well as the estimated one: where navigation does not give the pressure, and other flows that
   the gauges in use read alike where some are lost, or where inertia may have strained them: mirror images of gauges near one
   plane through the axis, several solutions of a few gauges. docs/explanation/nonlinear_estimator.md. */

/* Whether navigation gives neither p_inf nor q_inf. */
int flight_pressure_unknown(const FlightSolver *solver);

/* Widen the covariances of the solution by factors on standard deviations (N_WIDENING). */
void flight_widen(FlightSolver *solver, const double *widening);

/* Widen the solution of a search by what else fits; and that from a state by what a search finds, or go over to an end of
   it that fits better. */
void flight_widen_searched(FlightSolver *solver);
void flight_search_more(FlightSolver *solver);

int flight_gauges_are_lost(const FlightSolver *solver);

/* Add the differences to other solutions that fit as well to the covariances, or go over to one that
   fits better. Residuals of air data stay. */
void flight_look_for_others(FlightSolver *solver);

/* Read the parts of the tables, if there are any, and allocate. 1; 0 after a message. inputs, output, linear and loads are
   set. */
int flight_create(Flight *flight, MapFile *file);
void flight_reset(Flight *flight);

/* Set all outputs for the present inputs, from the track of the last step. */
void flight_update(Flight *flight);

/* Set flight->loads->value for the last update: by the tables, or by the linear map where it stands in or is alone. */
void flight_other_loads_update(Flight *flight);

/* The most Gauss-Newton iterations of a step; the last step's are flight->solver.iterations. */
size_t flight_most_iterations(const Flight *flight);

/* The gauges have other errors: the linear estimator's. */
void flight_renew(Flight *flight);

/* What the last step left is what the next one starts from. */
void flight_take_next(Flight *flight);

/* Whether a serialised track may be read. */
int flight_track_fits(const Flight *flight, const Track *track);

/* The outputs by the filter: what its channels are, and where filtered values go. Of linear maps, too: `flight` knows the
   linear estimator, inputs and outputs of every map. */

/* Read the filter's part and allocate, after all other parts. 1; 0 after a message. */
int filtered_outputs_create(MapFile *file, const Flight *flight, Filter *filter);

/* Filter the outputs, which are of the sample alone, by windows of at most a time [s]. */
void filtered_outputs(Filter *filter, Flight *flight, double time_constant);

#endif
