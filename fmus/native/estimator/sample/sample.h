/* What is given for a sample, and what is put out. */

#ifndef SAMPLE_H
#define SAMPLE_H

#include <math.h>
#include <stdint.h>

#include "../map/map.h"

/* Inputs and settings of the estimator: the place of each, its start value, and the values it accepts. */

/* Numbers and names of flow and navigation, the table of strainfmu/estimator/air_inputs.py. X is called with both. Those of
   later versions stand behind all others, among the inputs and among the variables, so that numbers of variables stay.

   An input is not given where it is 0 or below, or NaN (known_of); an angle, and what an inertial
   unit measures, where it is the map's not_known, or NaN (given_angle). In FMUs an angle counts only where its standard
   deviation is given, since hosts fill in 0 for inputs that nothing is connected to (measured_angle).

   Of every map: pressures [Pa], M [1], altitude [m]. */
#define FLOW_INPUTS(X)                                \
    X(DYNAMIC_PRESSURE, "dynamic_pressure")           \
    X(DYNAMIC_PRESSURE_STD, "dynamic_pressure_std")   \
    X(MACH_NUMBER, "mach_number")                     \
    X(ALTITUDE, "altitude")

/* Of maps with tables over the flight state besides. */
#define NAVIGATION_INPUTS(X)                          \
    X(MACH_NUMBER_STD, "mach_number_std")             \
    X(STATIC_PRESSURE, "static_pressure")             \
    X(STATIC_PRESSURE_STD, "static_pressure_std")

/* The same, of later versions: total temperature [K] and its standard deviation. */
#define LATER_INPUTS(X)                               \
    X(TOTAL_TEMPERATURE, "total_temperature")         \
    X(TOTAL_TEMPERATURE_STD, "total_temperature_std")

/* Of every map, behind all of these: what the dynamic pressure is computed from; angles [rad]. */
#define LAST_INPUTS(X)                                            \
    X(Q_SOURCE, "q_source")                                       \
    X(MEASURED_ATTACK, "measured_angle_of_attack")                \
    X(MEASURED_ATTACK_STD, "measured_angle_of_attack_std")        \
    X(MEASURED_SIDESLIP, "measured_sideslip_angle")               \
    X(MEASURED_SIDESLIP_STD, "measured_sideslip_angle_std")

/* Of maps with masses alone, behind health.usable: what an inertial unit measures [m/s2, rad/s,
   rad/s2], and the standard deviation of vibrating strain [1]. */
#define INERTIAL_INPUTS(X)                                        \
    X(SPECIFIC_FORCE_X, "specific_force_x")                       \
    X(SPECIFIC_FORCE_Y, "specific_force_y")                       \
    X(SPECIFIC_FORCE_Z, "specific_force_z")                       \
    X(ANGULAR_RATE_X, "angular_rate_x")                           \
    X(ANGULAR_RATE_Y, "angular_rate_y")                           \
    X(ANGULAR_RATE_Z, "angular_rate_z")                           \
    X(ANGULAR_ACCELERATION_Y, "angular_acceleration_y")           \
    X(ANGULAR_ACCELERATION_Z, "angular_acceleration_z")           \
    X(VIBRATION, "vibration")

#define AIR_INPUT_NUMBER(number, name) number,
#define AIR_INPUT_NAME(number, name) name,

/* Part "sensors" of map.bin: sensors that are no strain gauges are the last rows of a map, with units and ranges of their
   own. Row = (reading - thrust_response thrust) / scale, so that a row is a strain to all equations; a |reading| above
   the largest is not used. strainfmu/estimator/map/sensors.py. */
typedef struct {
    size_t n_strains;      /* strain gauges: all rows of a map without the part */
    int has_thrust;        /* whether thrust moves a reading */
    MAP_MEMBERS(SENSORS)
} SensorRows;

/* Read the part of a map of n_gauges rows, if there is one. 1; 0 after a message. */
int sensor_rows_parse(MapFile *file, size_t n_gauges, SensorRows *rows);

/* Part "parameters" of map.bin: ranges of flow parameters. The score of a value is its distance from the range over
   the span, 0 inside, for NaN and for a value that is not known; a score above the tolerance puts health to OUTSIDE.
   The linear estimate itself does not use the values. docs/howto/settings_and_health.md;
   strainfmu/estimator/map/validity.py. */
#define PARAMETER_NAME_SIZE 48 /* bytes of a name in the file, with its final zero */

typedef struct {
    MAP_MEMBERS(PARAMETERS) /* count: 0 in maps without */
} FlowParameters;

/* Read the part, if there is one. 1; 0 after a message. */
int flow_parameters_parse(MapFile *file, FlowParameters *parameters);

/* Part of its range by which parameter `which` leaves it at a value, 0 inside and for NaN. */
double parameter_score(const FlowParameters *parameters, size_t which, double value);
/* Indices of the real inputs after the readings: strains, then other sensors; the last five are settings. */
enum {
    FLOW_INPUTS(AIR_INPUT_NUMBER)
    SENSOR_RANGE,         /* largest |strain| of a working gauge [1] */
    ALARM_SCALE,          /* factor on the limit of chi-square and on the square of the limit of z [1] */
    REFERENCE_AREA,       /* [m2] */
    REFERENCE_LENGTH,     /* [m] */
    MOMENT_STATION,       /* x of the moment point [m] */
    N_SCALAR_INPUTS,
    BEFORE_NAVIGATION = N_SCALAR_INPUTS - 1, /* what follows is of maps with tables over the flight state only */
    NAVIGATION_INPUTS(AIR_INPUT_NUMBER)
    N_ALL_SCALARS
};

/* Names of flow and settings, by these numbers. */
extern const char *const SCALAR_NAMES[N_SCALAR_INPUTS];

enum { N_FLOW_INPUTS = SENSOR_RANGE, N_NAVIGATION_INPUTS = N_ALL_SCALARS - N_SCALAR_INPUTS };

/* Behind all other inputs; variables of maps with tables only. */
enum { LATER_INPUTS(AIR_INPUT_NUMBER) N_LATER_INPUTS };

/* Behind these; variables of every map. */
enum { LAST_INPUTS(AIR_INPUT_NUMBER) N_LAST_INPUTS };

/* Behind these, of maps with masses. */
enum { INERTIAL_INPUTS(AIR_INPUT_NUMBER) N_INERTIAL_INPUTS };

/* Runs of the inputs in their order, empty where a map has none: readings; scalars; zero of each strain gauge, sigma of each
   of them, sigma that they have in common [1]; the temperature of each sensor [K], not known where it is 0 or below, or NaN;
   thrust [N], which may be NaN or the map's not_known, of a map with sensors that it moves; the time constant of the filter
   [s], 0 for none; other parameters of the flow, as thrust, and, with tables of them, their sigmas, which are not stated
   where they are 0 or below, or NaN; LATER_INPUTS, LAST_INPUTS, and of a map with masses INERTIAL_INPUTS. */
enum {
    READING_RUN, SCALAR_RUN, ZERO_RUN, TEMPERATURE_RUN, THRUST_RUN, TIME_CONSTANT_RUN, PARAMETER_RUN, PARAMETER_STD_RUN,
    LATER_RUN, LAST_RUN, INERTIAL_RUN, N_INPUT_RUNS
};

static inline size_t number_of_zeros(size_t n_strains) {
    return 2 * n_strains + 1;
}

/* What is given for a sample. */
typedef struct {
    const Map *map;
    const SensorRows *sensors;         /* behind the strain gauges */
    const FlowParameters *parameters;  /* of the flow */
    size_t n_temperatures;             /* sensors of temperature */
    MAP_MEMBERS(ZERO_OFFSETS)
    size_t n_inertial;                 /* N_INERTIAL_INPUTS, 0 of a map without masses */
    int angles_need_std;               /* whether a measured angle counts only with a standard deviation: in FMUs, whose hosts fill
                                          in 0; NaN is what no host fills in */
    double smallest_time, largest_time; /* of the filter's time constant, of a map that has one [s] */
    size_t first[N_INPUT_RUNS + 1];    /* place of each run; the last one is the number of inputs */
    double *value;                     /* (first[N_INPUT_RUNS]) */
    unsigned char *valid;              /* (n_gauges) 1 for the gauges that the caller trusts */
    unsigned char *given;              /* (n_gauges) 1 for those whose reading was set: start values are none */
    size_t n_given;
    const double *zeros; /* (number_of_zeros) in use: of the last tare, or of value */
    double *strain; /* (n_gauges) less zeros, at the reference temperature, since output was computed; of other sensors the
                       reading over its scale */
} Inputs;

/* Set the places of all runs. */
void inputs_lay_out(Inputs *inputs);

/* The place of a run of one input; SIZE_MAX where a map has none. */
static inline size_t single_input(const Inputs *inputs, int run) {
    return inputs->first[run] < inputs->first[run + 1] ? inputs->first[run] : SIZE_MAX;
}

/* Whether an input is one of the zeros or their standard deviations. */
static inline int is_zero(const Inputs *inputs, size_t input) {
    return input >= inputs->first[ZERO_RUN] && input < inputs->first[ZERO_RUN + 1];
}

/* Zeros, their standard deviations, and the common one, of the inputs. */
static inline const double *zeros_given(const Inputs *inputs) {
    return inputs->value + inputs->first[ZERO_RUN];
}

/* One of the inputs and settings after the readings. */
static inline double scalar_input(const Inputs *inputs, size_t scalar) {
    return inputs->value[inputs->map->n_gauges + scalar];
}

/* An input of a run; NaN where it is not given: 0, which hosts fill in, or below, or NaN. */
static inline double known_of(const Inputs *inputs, int run, size_t which) {
    const double value = inputs->value[inputs->first[run] + which];
    return value > 0.0 ? value : NAN;
}

/* The same of one of flow or navigation. */
static inline double known_input(const Inputs *inputs, size_t scalar) {
    return known_of(inputs, SCALAR_RUN, scalar);
}

/* An angle among LAST_INPUTS [rad], with or without its standard deviation; NaN where it is not known. */
static inline double given_angle(const Inputs *inputs, size_t last) {
    const double value = inputs->value[inputs->first[LAST_RUN] + last];
    return value != inputs->map->not_known && isfinite(value) ? value : NAN;
}

/* The same where it counts as a measurement; its standard deviation is the input behind it. */
static inline double measured_angle(const Inputs *inputs, size_t last) {
    return inputs->angles_need_std && isnan(known_of(inputs, LAST_RUN, last + 1)) ? NAN : given_angle(inputs, last);
}

/* How much further aft the moment point is than the map's [m]. */
static inline double moment_shift(const Inputs *inputs) {
    return scalar_input(inputs, MOMENT_STATION) - inputs->map->moment_station;
}

/* The score of parameter `which`, 0 where it is not known. */
double known_parameter_score(const Inputs *inputs, size_t which);

/* The parameter of the flow that leaves its range; SIZE_MAX for none. */
size_t parameter_beyond(const Inputs *inputs);

/* Read the start values of the zeros. 1; 0 after a message. */
int inputs_parse(MapFile *file, Inputs *inputs);

/* Give inputs and settings their start values. */
void inputs_reset(Inputs *inputs);

/* Whether value may be given to input `index`; if not, text states what is allowed. Strains and pressures may have any
   value: health reports those that make no sense. */
int inputs_accept(const Inputs *inputs, size_t index, double value, char text[MODEL_TEXT_SIZE]);

/* Whether a gauge may be used: the caller trusts it, and its reading was set and is a number within its range, which is
   `range` [m/m] for strain. */
unsigned char gauge_in_use(const Inputs *inputs, size_t gauge, double range);

/* Whether strain is no reading: every gauge that may be used reads exactly 0 in a flow, as no gauge under load does. Then
   none is used. With the linear estimator a flow is a dynamic pressure of one, with tables any sample. */
int readings_silent(const Inputs *inputs);

/* Whether the gauges that may be used are the gauges of a mask (n_gauges). */
int readings_are_of(const Inputs *inputs, const unsigned char *mask);

/* Readings `first` up to, not including, `end` were set. */
void readings_note_given(Inputs *inputs, size_t first, size_t end);

/* Take the zeros in use off the strains of the inputs, and scale other sensors. */
void readings_set_strain(Inputs *inputs);

/* What an inertial unit measures becomes channels: specific force, angular acceleration, and the products of angular
   rates that turn with the body. Each is an amplitude of a mode of strain; strainfmu/estimator/map/sensors.py has the
   formulas. */

/* Specific force along x, y, z [m/s2]; angular acceleration about y, z [rad/s2]; xx, yy, zz, xy, xz, yz of
   w w' - |w|^2 1 [rad2/s2]. */
enum { N_INERTIAL_CHANNELS = 11 };

/* Set the channels of the present inputs, NaN of those that are not known. */
void inertial_channels(const Inputs *inputs, double channel[N_INERTIAL_CHANNELS]);

/* The standard deviation of vibrating strain [1]; NaN where it is not known. */
double known_vibration(const Inputs *inputs);

/* Air data: what a dynamic pressure is computed from, and its standard deviation then; measured angles as components of the flow
   direction. strainfmu/estimator/reference/air.py in C. */

/* Relative standard deviations of what a dynamic pressure is computed from, which no other measurement confirms: of M by the
   day's temperature and wind, of p_inf by its port, of p(h) by the day; as in that file. */
#define DAY_OF_MACH 0.025
#define DAY_OF_PRESSURE 0.03
#define DAY_OF_ALTITUDE 0.07

/* The values of the input q_source; it is AUTO where it is none of them. */
typedef enum { AUTO, INDEPENDENT, MACH_AND_PRESSURE, MACH_AND_ALTITUDE } PressureSource;

/* p(h) of the standard atmosphere [Pa]; NaN where the altitude is not known, 0, which no flight has, where it is above the
   atmosphere. */
double pressure_by_altitude(const Inputs *inputs);

/* The source of the dynamic pressure of the inputs, never AUTO: what nothing states counts as computed from the Mach number,
   where that is known, and from the static pressure, or else from an atmosphere. */
PressureSource pressure_source(const Inputs *inputs);

/* The relative standard deviation of a dynamic pressure by the ones of what it is computed from. */
double computed_pressure_error(double mach, double mach_std, double pressure_std);

/* The standard deviation [Pa] of a dynamic pressure that is computed: the stated one, which has to be larger than `own`,
   of its sources, where the inputs do not state the source. NaN for none stated. */
double computed_pressure_std(const Inputs *inputs, double stated, double own);

/* u and w [rad], with precisions, 0 where not known. */
typedef struct {
    size_t count; /* of the angles that are known */
    double value[2], precision[2];
} MeasuredAngles;

/* Those of the inputs. An angle that is not known is 0 for the other one. */
void measured_angles(const Inputs *inputs, MeasuredAngles *angles);

/* Fields of the outputs: the place of the first value, a name, the number of values. Places are the value references of FMI 2.0.
   Integers and the health state are whole numbers here too. */
#define OUTPUT_FIELDS(X)                                                                                               \
    X(COEFFICIENTS, "coefficients", N_LOADS)         /* C_A, C_N, C_Y, M_P, M_Y [1] */                                 \
    X(COEFFICIENTS_STD, "coefficients_std", N_LOADS) /* [1] */                                                         \
    X(LOADS, "loads", N_LOADS)                       /* axial, normal, side force; pitching, yawing moment [N, N m] */ \
    X(LOADS_STD, "loads_std", N_LOADS)               /* [N, N m] */                                                    \
    X(HEALTH_STATE, "health", 1)                                                                                       \
    X(CHI_SQUARE, "chi_square", 1)                   /* [1] */                                                         \
    X(CHI_SQUARE_LIMIT, "chi_square_limit", 1)       /* [1] */                                                         \
    X(VALID_GAUGES, "valid_gauges", 1)               /* number of gauges in use */                                     \
    X(SUSPECT_GAUGE, "suspect_gauge", 1)             /* the first suspect, from 1; 0 for none */                       \
    X(SUSPECTS, "suspects", 1)                       /* gauges that share the suspicion */                             \
    X(ENVELOPE_SCORE, "envelope_score", 1)           /* [1] */
#define FIELD_PLACE(place, name, count) place, place##_LAST = place + (count) - 1,
enum { OUTPUT_FIELDS(FIELD_PLACE) N_OUTPUTS };

/* States of health: strainfmu/estimator/health.py. */
enum { OK, INCONSISTENT, NO_COEFFICIENTS, INVALID, DEGRADED, UNIDENTIFIED, SUSPECT, OUTSIDE };

/* What may hold of a sample, as bits, and the state of health that each one means; the first one that holds counts: health.c.
   Estimators set the bits. */
#define CONDITIONS(X) \
    X(NO_GAUGE, INVALID)                 /* no gauge gives a strain */                                                 \
    X(FILTER_HOLDS, INVALID)             /* the same, and the filter holds the last loads */                           \
    X(NOT_IDENTIFIED, UNIDENTIFIED)      /* the gauges in use do not identify the loads */                             \
    X(PRESSURE_UNKNOWN, NO_COEFFICIENTS) /* no q_inf, or none with a standard deviation: no coefficients */            \
    X(FLOW_OUTSIDE, OUTSIDE)             /* air data, flow parameters or the flight state leave what the map covers */ \
    X(STRAIN_MISFIT, INCONSISTENT)       /* chi-square or discrepancy modes are above their thresholds */              \
    X(ANGLES_CONTRADICT, INCONSISTENT)   /* measured angles are others than by strain */                               \
    X(FORCE_CONTRADICTS, INCONSISTENT)   /* the specific force of the stated mass is another one than the load */      \
    X(GAUGE_MISFIT, SUSPECT)             /* one gauge does not fit the others */                                       \
    X(COEFFICIENTS_OUTSIDE, OUTSIDE)     /* the coefficients leave the envelope of a linear map */                     \
    X(GAUGES_LOST, DEGRADED)                                                                                           \
    X(AIR_DATA_LOST, DEGRADED)           /* an input is left out, with an alarm */                                     \
    X(STATE_MOVES, DEGRADED)             /* the iterations have not come to rest */                                    \
    X(LOADS_OF_LINEAR_MAP, DEGRADED)     /* fall-back of the nonlinear estimator */                                    \
    X(RENEWAL_PENDING, DEGRADED)         /* matrices for other zero offsets are being made */                          \
    X(VIBRATES, DEGRADED)                /* more than the map states */
#define CONDITION_PLACE(condition, state) condition##_PLACE,
#define CONDITION_BIT(condition, state) condition = 1 << condition##_PLACE,
enum { CONDITIONS(CONDITION_PLACE) N_CONDITIONS };
enum { CONDITIONS(CONDITION_BIT) NO_CONDITION = 0 };

/* Names of the states, by number; and the state of the first condition that holds, OK for none. */
extern const char *const HEALTH_NAMES[];
int health_state(int conditions);

/* Whether loads may be used with their stated standard deviations in a state of health. */
static inline int is_usable(double health) {
    return health == (double)OK || health == (double)DEGRADED;
}

/* Factors of coefficients at q_inf [Pa]: 1 / (q S) for the three forces, 1 / (q S L) for the two moments. */
static inline void coefficient_scales(double pressure, double area, double length, double *scale) {
    scale[0] = scale[1] = scale[2] = 1.0 / (pressure * area);
    scale[3] = scale[4] = 1.0 / (pressure * (area * length));
}

/* Outputs without an estimate: no loads and coefficients, and a residual without terms, whose chi-square and envelope
   margin are 0. Counts and health are the caller's. */
static inline void set_unknown(double *output, double chi_square_limit) {
    for (int i = COEFFICIENTS; i < HEALTH_STATE; i++) {
        output[i] = NAN;
    }
    output[CHI_SQUARE] = output[ENVELOPE_SCORE] = 0.0;
    output[CHI_SQUARE_LIMIT] = chi_square_limit;
}

/* M_P' = M_P + shift F_N and M_Y' = M_Y + shift F_Y about a point further aft. */
static inline void move_moments(double shift, double *loads) {
    loads[3] += shift * loads[1];
    loads[4] += shift * loads[2];
}

/* Rows (5, 5) of the transfer of loads to the moment point of the settings, each times its scale. */
void moment_transfer(const Inputs *inputs, const double *scale, double transfer[N_LOADS][N_LOADS]);

/* Linear outputs of a map in form "dynamic_pressure" in addition to the five loads, computed when they are read: part
   "other_loads" of resources/map.bin. */

#define OUTPUT_NAME_SIZE 48

/* Loads of states and errors; the arrays point into the bytes of the file. */
typedef struct {
    MAP_MEMBERS(OTHER_LOADS)
} OtherLoadsMap;

/* Each array of (n_loads). */
enum { OTHER_LOADS, OTHER_LOADS_STD, OTHER_COEFFICIENTS, OTHER_COEFFICIENTS_STD, N_OTHER_VALUES };

typedef struct {
    int present;         /* whether the map has such loads; if not, nothing else is set */
    OtherLoadsMap map;      /* as the file has it */
    double *value[N_OTHER_VALUES]; /* (n_loads) [N, N m, 1, 1] */
    size_t n_outputs;    /* of all arrays */
    size_t *output;        /* (n_outputs) place of each in value[0] and what follows it */
    size_t *array_start;   /* (n_arrays) number of its first output */
    int outdated;
} OtherLoads;

/* Where load k, of the five and those in addition, is put out with its coefficient, and whether it is a moment. */
typedef struct {
    double *value, *std, *coefficient, *coefficient_std;
    int is_moment;
} LoadOutput;

LoadOutput load_output(double *output, const OtherLoads *other_loads, size_t k);

/* The reference of its coefficient at the settings: an area, of a moment times a length. */
static inline double own_reference(const Inputs *inputs, int is_moment) {
    return scalar_input(inputs, REFERENCE_AREA) * (is_moment ? scalar_input(inputs, REFERENCE_LENGTH) : 1.0);
}

/* Read the part, if there is one, and allocate. 1; 0 after a message. */
int other_loads_create(MapFile *file, OtherLoads *other_loads);

#endif
