/* Variables by number, one by one as in FMI 2.0, and as arrays, which are the variables of FMI 3.0.

   Both follow from one list of runs. A run has `count` variables of a kind, in arrays of `size`; arrays are numbered as
   they follow each other:

       outputs (27) | readings (n) | valid (n) | scalars | of maps with tables: air data, real outputs, flags | zero offsets |
       temperatures, thrust, time constant | other loads | tare | parameters, scores, standard deviations | later air data |
       last air data | health.usable | inertial unit

   Runs that a map does not have are empty, and later runs move up. The list is gone through for each variable that is
   looked for: number less `first` is compared with `count` in size_t, so that one comparison tests both ends.
   docs/developers/native.md, "Variables"; strainfmu/interface/estimator_variables.py lists the same for
   modelDescription.xml. */

#include "interface.h"

typedef struct {
    VariableKind kind;
    size_t place, count, size; /* the first place; variables; variables in an array */
} VariableRun;

enum { N_RUNS = 28 }; /* at most, with all other loads as one */

/* All runs; other loads are one whose arrays have sizes of their own. */
static void list_runs(const Estimator *e, VariableRun run[N_RUNS]) {
    const size_t n = e->map.n_gauges, strains = e->sensors.n_strains, *first = e->inputs.first, ones = e->sensors.count;
    const size_t flight = e->flight.present ? 1 : 0, tare = e->tare.present ? 1 : 0, parameters = e->parameters.count;
    const VariableRun all[N_RUNS] = {
        {OUTPUT, COEFFICIENTS, 2 * N_LOADS, N_LOADS}, /* with standard deviations; then forces and moments, the same of these */
        {OUTPUT, LOADS, 3, 3},
        {OUTPUT, LOADS + 3, 2, 2},
        {OUTPUT, LOADS_STD, 3, 3},
        {OUTPUT, LOADS_STD + 3, 2, 2},
        {OUTPUT, HEALTH_STATE, N_OUTPUTS - HEALTH_STATE, 1},
        {INPUT, first[READING_RUN], strains, strains},
        {INPUT, strains, ones, 1},
        {VALID, 0, n, n},
        {INPUT, first[SCALAR_RUN], N_SCALAR_INPUTS, 1},
        {INPUT, first[SCALAR_RUN] + N_SCALAR_INPUTS, flight * N_NAVIGATION_INPUTS, 1},
        {AIR_DATA, 0, flight * N_FLIGHT_REALS, 1},
        {FLIGHT_FLAG, 0, flight * N_FLIGHT_FLAGS, 1},
        {INPUT, first[ZERO_RUN], 2 * strains, strains},
        {INPUT, first[ZERO_RUN] + 2 * strains, 1, 1},
        {INPUT, first[TEMPERATURE_RUN], e->inputs.n_temperatures, e->inputs.n_temperatures},
        {INPUT, first[THRUST_RUN], first[PARAMETER_RUN] - first[THRUST_RUN], 1}, /* and the time constant */
        {OTHER_LOAD, 0, e->other_loads.n_outputs, 0},
        {TARE_INPUT, 0, tare, 1},
        {TARE_STATE, 0, tare, 1},
        {ZERO_IN_USE, 0, tare * 2 * strains, strains},
        {ZERO_IN_USE, 2 * strains, tare, 1},
        {INPUT, first[PARAMETER_RUN], parameters, 1},
        {SCORE, 0, parameters, 1},
        {INPUT, first[PARAMETER_STD_RUN], first[LATER_RUN] - first[PARAMETER_STD_RUN], 1},
        {INPUT, flight ? first[LATER_RUN] : first[LAST_RUN], (flight ? N_LATER_INPUTS : 0) + N_LAST_INPUTS, 1},
        {USABLE, 0, 1, 1},
        {INPUT, first[INERTIAL_RUN], e->inputs.n_inertial, 1},
    };
    memcpy(run, all, sizeof all);
}

Variable variable_of(const Estimator *e, size_t number) {
    VariableRun run[N_RUNS];
    list_runs(e, run);
    for (size_t k = 0; k < N_RUNS; number -= run[k++].count) {
        if (number < run[k].count) {
            const size_t place = run[k].place + number;
            return (Variable){run[k].kind, run[k].kind == OTHER_LOAD ? e->other_loads.output[place] : place};
        }
    }
    return (Variable){NOTHING, 0};
}

Type variable_type(const Estimator *e, Variable variable) {
    switch (variable.kind) {
    case OUTPUT:
        return variable.place == HEALTH_STATE                                       ? ENUMERATION
             : variable.place >= VALID_GAUGES && variable.place < ENVELOPE_SCORE ? INTEGER
                                                                                    : REAL;
    case INPUT:
        return variable.place == e->inputs.first[LAST_RUN] + Q_SOURCE ? ENUMERATION : REAL;
    case TARE_STATE:
        return ENUMERATION;
    case VALID:
    case FLIGHT_FLAG:
    case TARE_INPUT:
    case USABLE:
        return BOOLEAN;
    case NOTHING:
        return NO_VARIABLE;
    default:
        return REAL;
    }
}

Type model_type_of(const Model *model, size_t variable) {
    const Estimator *e = estimator_of(model);
    return variable_type(e, variable_of(e, variable));
}

static size_t arrays_of(const Estimator *e, const VariableRun *run) {
    return run->count == 0 ? 0 : run->kind == OTHER_LOAD ? e->other_loads.map.n_arrays : run->count / run->size;
}

unsigned time_reference(const Estimator *e) {
    VariableRun run[N_RUNS];
    size_t arrays = 0;
    list_runs(e, run);
    for (size_t k = 0; k < N_RUNS; k++) {
        arrays += arrays_of(e, &run[k]);
    }
    return (unsigned)arrays;
}

Selection model_array(const Model *model, unsigned reference) {
    const Estimator *e = estimator_of(model);
    VariableRun run[N_RUNS];
    size_t number = 0, array = reference;
    list_runs(e, run);
    for (size_t k = 0; k < N_RUNS; number += run[k].count, array -= arrays_of(e, &run[k++])) {
        if (array < arrays_of(e, &run[k])) {
            const OtherLoads *loads = &e->other_loads;
            return run[k].kind == OTHER_LOAD
                     ? (Selection){NULL, number + loads->array_start[array], (size_t)loads->map.array_size[array]}
                     : (Selection){NULL, number + array * run[k].size, run[k].size};
        }
    }
    return (Selection){NULL, 0, 0};
}
