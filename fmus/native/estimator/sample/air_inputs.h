/* The inputs for flow and navigation: their numbers and names, the table of strainfmu/estimator/air_inputs.py. X is called
   with number and name.

   Those of later versions stand behind all others, among the inputs and among the variables, so that numbers of variables
   stay. All of them are not given where they are 0 or below, or NaN: known_input, later_input, last_input; but for angles,
   which are not known where they are the map's not_known, or NaN: given_angle; so are an inertial unit's. In FMUs an angle counts
   only where its standard deviation is given, since hosts fill in 0 for inputs that nothing is connected to: measured_angle. */

#ifndef AIR_INPUTS_H
#define AIR_INPUTS_H

/* Of every map: pressures [Pa], M [1], altitude [m]. */
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

/* Of every map, behind all of these: what the dynamic pressure is computed from, air_data.h; angles [rad]. */
#define LAST_INPUTS(X)                                            \
    X(Q_SOURCE, "q_source")                                       \
    X(MEASURED_ATTACK, "measured_angle_of_attack")                \
    X(MEASURED_ATTACK_STD, "measured_angle_of_attack_std")        \
    X(MEASURED_SIDESLIP, "measured_sideslip_angle")               \
    X(MEASURED_SIDESLIP_STD, "measured_sideslip_angle_std")

/* Of maps with masses alone, behind health.usable: what an inertial unit measures [m/s2, rad/s,
   rad/s2], and the standard deviation of vibrating strain [1], inertia.h. */
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

#endif
