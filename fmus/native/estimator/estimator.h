/* The estimator: strains and dynamic pressure in; loads, coefficients and health out.

   Equations: strainfmu/estimator/reference/linear.py. Outputs are computed when they are read and kept until an
   input or a setting changes. Nothing is allocated after estimator_create, and instances share nothing. */

#ifndef ESTIMATOR_H
#define ESTIMATOR_H

#include "filter/linear_filter.h"
#include "linear/added_noise.h"
#include "linear/envelope.h"
#include "linear/further_loads.h"
#include "linear/masked_map.h"
#include "linear/scaled_state.h"
#include "manifold/flight.h"
#include "map/flow_parameters.h"
#include "map/sensor_rows.h"
#include "map/thermal.h"
#include "zeros/tare.h"

/* Sets of missing gauges whose matrices are kept; the least recently used gives way. */
#define CACHED_MASKS 4

/* Indices of the outputs; their numbers are the value references of FMI 2.0. Integers and the health state are whole
   numbers here too. */
enum {
    COEFFICIENTS = 0,      /* C_A, C_N, C_Y, M_P, M_Y [1] */
    COEFFICIENTS_STD = 5,  /* [1] */
    LOADS = 10,            /* axial, normal, side force; pitching, yawing moment [N, N m] */
    LOADS_STD = 15,        /* [N, N m] */
    HEALTH_STATE = 20,
    CHI_SQUARE = 21,       /* [1] */
    CHI_SQUARE_LIMIT = 22, /* [1] */
    VALID_GAUGES = 23,     /* number of gauges in use */
    SUSPECT_GAUGE = 24,    /* the first suspect, from 1; 0 for none */
    SUSPECTS = 25,         /* gauges that share the suspicion */
    ENVELOPE_SCORE = 26,   /* [1] */
    N_OUTPUTS = 27
};

/* Numbers of derivatives: those outputs, then air data, then further loads. Deviations among them are never read. */
#define N_DERIVATIVES (N_OUTPUTS + N_FLIGHT_REALS)

/* Number of outputs that are whole numbers: the health state, VALID_GAUGES to SUSPECTS, and the state of the tare. */
#define N_WHOLE 5
#define TARE_WHOLE (N_WHOLE - 1) /* place of the state of the tare among them */

/* States of health: strainfmu/estimator/health.py. */
enum { OK, INCONSISTENT, NO_COEFFICIENTS, INVALID, DEGRADED, UNIDENTIFIED, SUSPECT, OUTSIDE };

/* Indices of the real inputs after the readings: strains, then further sensors; the last five are settings. */
enum {
    DYNAMIC_PRESSURE,     /* [Pa] */
    DYNAMIC_PRESSURE_STD, /* [Pa]; these four are not given where they are 0 or below, or NaN: known_input */
    MACH_NUMBER,          /* [1] */
    ALTITUDE,             /* [m] */
    SENSOR_RANGE,         /* largest |strain| of a working gauge [1] */
    ALARM_SCALE,          /* factor on the limit of chi-square and on the square of that of z [1] */
    REFERENCE_AREA,       /* [m2] */
    REFERENCE_LENGTH,     /* [m] */
    MOMENT_STATION,       /* x of the moment point [m] */
    N_SCALAR_INPUTS,
    MACH_NUMBER_STD = N_SCALAR_INPUTS, /* [1]; this and the rest of maps with tables over the flight state only, */
    STATIC_PRESSURE,                   /* [Pa]; as the first four */
    STATIC_PRESSURE_STD,               /* [Pa] */
    N_ALL_SCALARS
};

/* After the scalars: zero of each strain gauge, deviation of each of them, deviation that they have in common [1]; then
   the temperature of each sensor [K], not known where it is 0 or below, or NaN; thrust [N], which may be NaN or the
   map's not_known, of a map with sensors that it moves; then the time constant of the filter [s], 0 for none, of a map
   that has one. Then further parameters of the flow, as thrust, and, with tables of them, their deviations, which are
   not stated where they are 0 or below, or NaN. */
static inline size_t number_of_zeros(size_t n_strains) {
    return 2 * n_strains + 1;
}

typedef struct Estimator {
    Model base; /* for the FMI fronts, filled in by estimator_model.c */
    Map map;
    unsigned char *bytes; /* of map.bin */
    void *memory;         /* of all arrays below */
    double *input;        /* (estimator_inputs) readings, scalars, zeros, temperatures, .. */
    double *strain;       /* (n_gauges) less zeros, at the reference temperature, since output was computed; of further
                             sensors the reading over its scale */
    unsigned char *valid; /* (n_gauges) 1 for the gauges that the caller trusts */
    unsigned char *given; /* (n_gauges) 1 for those whose reading was set: start values are none */
    size_t n_given;
    double output[N_OUTPUTS];
    HalfSpaces half_spaces;
    Flow flow;            /* of the inputs since output was computed */
    int outdated; /* whether an input has changed since output was computed */
    int wide;     /* panels_wide() */
    SensorRows sensors;   /* behind the strain gauges */
    FlowParameters parameters; /* of the flow */
    Further further;      /* of a map with loads beside the five */
    Thermal thermal;      /* of a map with temperature modes */
    Tare tare;
    AddedNoise noise;     /* errors of the zeros, */
    double *noise_std;    /* (n_strains + 1) the deviations that map holds for, */
    int noise_outdated;   /* and whether those of the inputs may be others */
    MaskedMap *masked;
    MaskedMap cache[CACHED_MASKS];
    unsigned long last_use[CACHED_MASKS], uses; /* 0 for an empty entry */
    Workspace work;
    unsigned char *mask; /* (n_gauges) gauges in use in this step */
    double *residual;
    double *z, *whitened;              /* (panel_length(n_gauges)) */
    float *narrow;                     /* (n_gauges) whitened */
    Scaled scaled;                     /* the rest of a map in form "dynamic_pressure"; not set for others */
    LinearFilter linear_filter;        /* over time, of a map without tables that has one */
    Flight flight;                     /* of the nonlinear estimator, if the map has tables */
    double *direction;                 /* as input, of derivatives, for estimator_model.c, */
    double *derivative;                /* (estimator_derivatives) which keeps those of the outputs along it, */
    double *derivative_work;           /* (estimator_inputs) and twice (estimator_derivatives) scratch, */
    int reported_health;               /* the last health that was reported, */
    double settled[N_WHOLE];           /* and the whole numbers of the last event in model exchange */
} Estimator;

/* Make an estimator of the map in bytes [length], and own them: they are freed here if that fails. Return NULL with a
   text that states why. */
Estimator *estimator_create(unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]);

void estimator_free(Estimator *estimator);

/* Number of inputs and settings. */
size_t estimator_inputs(const Estimator *estimator);

/* Whether a gauge may be used: the caller trusts it, and its reading was set and is a number within its range, which is
   `range` [m/m] for strain. */
unsigned char gauge_in_use(const Estimator *estimator, size_t gauge, double range);

/* Whether strain is no reading: every gauge that may be used reads exactly 0 in a flow, as no gauge under load does. Then
   none is used. With the linear estimator a flow is a dynamic pressure of one, with tables any sample. */
int estimator_silent(const Estimator *estimator);

/* Readings `first` up to, not including, `end` were set. */
void estimator_note_given(Estimator *estimator, size_t first, size_t end);

/* Of the inputs, the first of the temperatures, thrust, SIZE_MAX for none, and the first of the parameters of the flow and
   of their deviations, which a map has with tables of them. */
size_t first_temperature(const Estimator *estimator);
size_t thrust_input(const Estimator *estimator);
size_t first_parameter(const Estimator *estimator);
size_t first_parameter_std(const Estimator *estimator);

/* The parameter of the flow that leaves its range; SIZE_MAX for none. */
size_t estimator_outside(const Estimator *estimator);

/* Zeros, their deviations, and that in common, in use: those of the last tare, or those of the inputs. */
static inline const double *zeros_in_use(const Estimator *e) {
    return e->tare.present && e->tare.flags.has_zeros != 0.0 ? e->tare.zero : e->input + e->map.n_gauges + N_ALL_SCALARS;
}

/* Index of the time constant of the filter among the inputs; SIZE_MAX for none. */
size_t filter_setting(const Estimator *estimator);

/* Take the zeros in use off the strains of the inputs, and scale further sensors. */
void estimator_set_strain(Estimator *estimator);

/* An input changes: what follows starts from what the last step left. */
void estimator_before_change(Estimator *estimator);

/* A step or an event takes the input of the tare in; an accepted step also takes readings. */
void estimator_follow_tare(Estimator *estimator);
void estimator_take_readings(Estimator *estimator);

/* Give inputs and settings their start values, */
void inputs_reset(Estimator *estimator);

/* and forget steps and tare, too. */
void estimator_reset(Estimator *estimator);

/* Whether value may be given to input `index` (numbered as estimator->input); if not, text states what is allowed.
   Strains and pressures may have any value: health reports those that make no sense. */
int estimator_accepts(const Estimator *estimator, size_t index, double value, char text[MODEL_TEXT_SIZE]);

/* Write loads and coefficients of the linear map at a dynamic pressure and its deviation to the outputs. 1; 0, and they
   keep their values, if it has none. */
int estimator_linear_loads(Estimator *estimator, double dynamic_pressure, double deviation);

/* The N_OUTPUTS outputs for the present inputs; of maps with tables also those in estimator->flight. */
const double *estimator_outputs(Estimator *estimator);

/* Derivatives of the estimate along a direction of the inputs (estimator_inputs), which is scratch: N_OUTPUTS, air data,
   all of estimator->further; those of loads, coefficients and air data are good, NaN where the output is. The estimator is
   left as it was. 1; 0, after a message, where it has none. */
int estimator_derivative(Estimator *estimator, double *direction, double *derivative, char text[MODEL_TEXT_SIZE]);

/* Number of these derivatives. */
size_t estimator_derivatives(const Estimator *estimator);

#endif
