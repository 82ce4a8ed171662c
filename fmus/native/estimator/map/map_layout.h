/* The arrays of map.bin, one a line: kind, member of the structure T of its group, name, what its values must be,
   rank, smallest and largest number, symbol that a length binds, shape or bounds of a length; meaning.

   Written by python -m strainfmu.fmu.native.map_layout, of the schema of a map: do not edit. map.h
   makes members of structures and rows of tables of it; map_read reads, checks and refuses by these. */

#ifndef MAP_LAYOUT_H
#define MAP_LAYOUT_H

enum {
    SYM_NONE, SYM_STATES, SYM_GAUGES, SYM_ERRORS, SYM_STRAINS, SYM_HALF_SPACES, SYM_LAYERS, SYM_TERMS, SYM_MODES,
    SYM_SENSORS, SYM_POWERS, SYM_PARAMETERS, SYM_OTHERS, SYM_ARRAYS, SYM_LOADS, SYM_MACH, SYM_INCIDENCE, SYM_CHANNELS,
    SYM_HARMONICS, SYM_ROWS, SYM_COMMON, SYM_CONSIDERED_COMMON, SYM_SHAPES, SYM_PRODUCTS, SYM_PRODUCT_SIZE, SYM_BASIS,
    SYM_PATTERNS, N_SYMBOLS
};

#define LINEAR(X, T) \
    X(T, LENGTH, n_gauges, mean_strain, ANY, 0, 0, 0, SYM_GAUGES, FIXED(1), FIXED(4096)) \
    X(T, LENGTH, n_states, state_operator, ANY, 0, 0, 0, SYM_STATES, FIXED(0), FIXED(4096)) \
    X(T, LENGTH, n_errors, error_strain, ANY, 0, 0, 0, SYM_ERRORS, FIXED(0), FIXED(4096)) \
    X(T, ARRAY, state_operator, state_operator, ANY, 2, 0, 0, SYM_NONE, AXIS(STATES, 1, 0), AXIS(GAUGES, 1, 0)) /* A [(m/m)/state] */ \
    X(T, ARRAY, error_strain, error_strain, ANY, 2, 0, 0, SYM_NONE, AXIS(ERRORS, 1, 0), AXIS(GAUGES, 1, 0)) /* N, strain of each error that has a column per standard deviation, at the nominal dynamic pressure [m/m] */ \
    X(T, ARRAY, error_load, error_load, ANY, 2, 0, 0, SYM_NONE, AXIS(ERRORS, 1, 0), FIXED(5)) /* N_f, loads of the errors of error_strain [N, N.m] */ \
    X(T, NUMBER, regularisation, regularisation, BETWEEN, 0, 0, DBL_MAX, SYM_NONE, FIXED(0)) /* gamma, 0 in Case 1, positive in Case 2 */ \
    X(T, ARRAY, load_per_state, load_per_state, ANY, 2, 0, 0, SYM_NONE, AXIS(STATES, 1, 0), FIXED(5)) /* M, loads of each state [N/state, N.m/state] */ \
    X(T, ARRAY, load_of_mean, load_of_mean, ANY, 1, 0, 0, SYM_NONE, FIXED(5)) /* f_mean, loads of the mean pressure [N, N.m] */ \
    X(T, ARRAY, mean_strain, mean_strain, ANY, 1, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0)) /* m, strain of the mean pressure [m/m] */ \
    X(T, NUMBER, dynamic_pressure_error, dynamic_pressure_error, BETWEEN, 0, 0, 1, SYM_NONE, FIXED(0)) /* standard deviation of q_inf over q_inf, where the caller states none */ \
    X(T, NUMBER, chi_square_scale, chi_square_scale, POSITIVE, 0, 0, 0, SYM_NONE, FIXED(0)) /* factor on the detection threshold of chi-square, from data of a truth model */ \
    X(T, NUMBER, outlier_scale, outlier_scale, POSITIVE, 0, 0, 0, SYM_NONE, FIXED(0)) /* the same on the threshold of the square of the largest |z| */ \
    X(T, NUMBER, level_slope, level_slope, BETWEEN, 0, 0, 1, SYM_NONE, FIXED(0)) /* a */ \
    X(T, NUMBER, min_information, min_information, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* fraction of the information on some state below which the rest of the gauges does not identify it */ \
    X(T, NUMBER, ambiguous_correlation, ambiguous_correlation, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* above which gauges cannot be distinguished */ \
    X(T, NUMBER, min_dynamic_pressure, min_dynamic_pressure, POSITIVE, 0, 0, 0, SYM_NONE, FIXED(0)) /* below which there is no flow, and are no coefficients [Pa] */ \
    X(T, NUMBER, max_dynamic_pressure, max_dynamic_pressure, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* above which there are none [Pa] */ \
    X(T, WHOLE, degrees_of_freedom, degrees_of_freedom, ANY, 0, 1, 0, SYM_NONE, AXIS(GAUGES, 1, 0)) /* of the residual with all gauges */ \
    X(T, WHOLE, known_prior, known_prior, ANY, 0, 0, 1, SYM_NONE, FIXED(0)) /* 1 in Case 2 */ \
    X(T, ARRAY, chi_square_limit, chi_square_limit, POSITIVE, 1, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0)) /* by degrees of freedom from 1 on */ \
    X(T, ARRAY, outlier_threshold, outlier_threshold, POSITIVE, 1, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0)) /* by the number of gauges from 1 on */

#define GAUGE_COVARIANCE(X, T) \
    X(T, ARRAY, gauge_covariance, gauge_covariance, COVARIANCE, 2, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0), AXIS(GAUGES, 1, 0)) /* Gamma_g, covariance of the errors that have no columns [(m/m)^2] */

#define LOW_RANK(X, T) \
    X(T, ARRAY, noise_variance, noise_variance, POSITIVE, 1, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0)) /* variances of errors of each gauge alone that do not scale [(m/m)^2] */ \
    X(T, ARRAY, own_variance, own_variance, FROM_0, 1, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0)) /* of those that scale [(m/m)^2] */ \
    X(T, NUMBER, common_variance, common_variance, BETWEEN, 0, 0, DBL_MAX, SYM_NONE, FIXED(0)) /* of an error that does not scale and is the same of all gauges [(m/m)^2] */

#define ZERO_OFFSETS(X, T) \
    X(T, ARRAY, zero_offset, zero_offset, ANY, 1, 0, 0, SYM_NONE, AXIS(STRAINS, 1, 0)) /* reading of each strain gauge without strain by the calibration [m/m] */

#define SETTINGS(X, T) \
    X(T, NUMBER, dynamic_pressure, dynamic_pressure, POSITIVE, 0, 0, 0, SYM_NONE, FIXED(0)) /* mean q_inf of the snapshots [Pa] */ \
    X(T, NUMBER, smallest_setting, smallest, BETWEEN, 0, DBL_MIN, 1, SYM_NONE, FIXED(0)) /* bounds of settings */ \
    X(T, NUMBER, largest_setting, largest, BETWEEN, 0, 1, DBL_MAX, SYM_NONE, FIXED(0)) /* the same */ \
    X(T, NUMBER, largest_zero, largest_zero, BETWEEN, 0, 0, DBL_MAX, SYM_NONE, FIXED(0)) /* of zero offsets and their standard deviations */ \
    X(T, NUMBER, not_known, not_known, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* start value of flow parameters, and a value of thrust, that means what NaN does */ \
    X(T, NUMBER, reference_area, reference_area, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* what the map was built with [m2] */ \
    X(T, NUMBER, reference_length, reference_length, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* the same [m] */ \
    X(T, NUMBER, moment_station, moment_station, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* the same [m] */ \
    X(T, NUMBER, sensor_range, sensor_range, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* start value */

#define ENVELOPE(X, T) \
    X(T, LENGTH, n_half_spaces, limit, ANY, 0, 0, 0, SYM_HALF_SPACES, FIXED(0), FIXED(65536)) \
    X(T, LENGTH, n_layers, layers, ANY, 0, 0, 0, SYM_LAYERS, FIXED(1), FIXED(4096)) \
    X(T, ARRAY, direction, direction, ANY, 2, 0, 0, SYM_NONE, FIXED(5), AXIS(HALF_SPACES, 1, 0)) /* half-spaces of the coefficients, n'C <= envelope_limit */ \
    X(T, ARRAY, limit, limit, ANY, 1, 0, 0, SYM_NONE, AXIS(HALF_SPACES, 1, 0)) /* see envelope_direction */ \
    X(T, NUMBER, score_limit, score_limit, POSITIVE, 0, 0, 0, SYM_NONE, FIXED(0)) /* standard deviations beyond them that count as outside */ \
    X(T, NUMBER, half_gamma, half_gamma, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* q = half_gamma M^2 p(h) */ \
    X(T, NUMBER, pressure_tolerance, pressure_tolerance, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* relative difference of q_inf and 0.7 M^2 p(h) that is no contradiction, but errors of navigation and weather */ \
    X(T, VALUES_2, dynamic_pressure, dynamic_pressure, BOUNDS, 1, 0, 0, SYM_NONE, FIXED(2)) /* smallest and largest, may be infinite [Pa] */ \
    X(T, VALUES_2, mach_number, mach_number, BOUNDS, 1, 0, 0, SYM_NONE, FIXED(2)) /* the same */ \
    X(T, VALUES_2, altitude, altitude, BOUNDS, 1, 0, 0, SYM_NONE, FIXED(2)) /* the same [m] */ \
    X(T, ARRAY, layers, layers, ANY, 2, 0, 0, SYM_NONE, AXIS(LAYERS, 1, 0), FIXED(LAYER_SIZE)) /* of the atmosphere */

#define SCALED(X, T) \
    X(T, NUMBER, min_expected_ratio, min_expected_ratio, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* smallest expected chi-square over its degrees of freedom */ \
    X(T, WHOLE, follows_pressure, follows_pressure, ANY, 0, 0, 1, SYM_NONE, FIXED(0)) /* whether the form is dynamic_pressure */ \
    X(T, ARRAY, fixed_strain, fixed_strain, ANY, 1, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0)) /* d_0 [m/m] */ \
    X(T, ARRAY, mean_strain, mean_strain, ANY, 1, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0)) /* m - d_0, at the nominal dynamic pressure [m/m] */ \
    X(T, ARRAY, fixed_load, fixed_load, ANY, 1, 0, 0, SYM_NONE, FIXED(5)) /* f_0 [N, N.m] */ \
    X(T, ARRAY, load_of_mean, load_of_mean, ANY, 1, 0, 0, SYM_NONE, FIXED(5)) /* f_mean - f_0 [N, N.m] */

#define SPREAD(X, T) \
    X(T, ARRAY, spread, spread, ANY, 2, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0), AXIS(GAUGES, 1, 0)) /* N of what has a prior, N N' the sum over its columns [m/m] */ \
    X(T, ARRAY, spread_load, spread_load, ANY, 2, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0), FIXED(5)) /* loads of its columns [N, N.m] */ \
    X(T, ARRAY, spread_unseen, spread_unseen, ANY, 2, 0, 0, SYM_NONE, FIXED(5), FIXED(5)) /* what those columns do not hold */

#define SCALED_ERRORS(X, T) \
    X(T, LENGTH, n_terms, common, ANY, 0, 0, 0, SYM_TERMS, FIXED(0), FIXED(4096)) \
    X(T, ARRAY, of_gauge, of_gauge, ANY, 2, 0, 0, SYM_NONE, FIXED(21), AXIS(GAUGES, 1, 0)) /* errors that follow the current strain [(m/m)^2] */ \
    X(T, ARRAY, common, common, ANY, 3, 0, 0, SYM_NONE, AXIS(TERMS, 1, 0), FIXED(6), AXIS(GAUGES, 1, 0)) /* E of each such term that all gauges have in common [m/m] */ \
    X(T, ARRAY, mean_product, mean_product, ANY, 1, 0, 0, SYM_NONE, FIXED(21)) /* mean of c_a c_b over the snapshots */

#define ANGLES(X, T) \
    X(T, NUMBER, incidence_per_force, incidence_per_force, POSITIVE, 0, 0, 0, SYM_NONE, FIXED(0)) /* largest total angle of attack over the largest lateral coefficient [rad] */

#define THERMAL(X, T) \
    X(T, LENGTH, n_modes, prior_std, ANY, 0, 0, 0, SYM_MODES, FIXED(1), FIXED(4096)) \
    X(T, LENGTH, n_sensors, sensor_std, ANY, 0, 0, 0, SYM_SENSORS, FIXED(0), FIXED(4096)) \
    X(T, LENGTH, n_powers, apparent_strain, ANY, 0, 0, 0, SYM_POWERS, FIXED(0), FIXED(4096)) \
    X(T, NUMBER, reference_temperature, reference_temperature, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* at which zeros, gauge factors and modulus hold [K] */ \
    X(T, ARRAY, prior_std, prior_std, POSITIVE, 1, 0, 0, SYM_NONE, AXIS(MODES, 1, 0)) /* s, standard deviation of each mode's amplitude [K] */ \
    X(T, ARRAY, mode_strain, mode_strain, ANY, 2, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0), AXIS(MODES, 1, 0)) /* Phi, what gauges read of each mode per amplitude [1/K] */ \
    X(T, ARRAY, gauge_operator, gauge_operator, ANY, 2, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0), AXIS(MODES, 1, 0)) /* B, temperature of the gauges per amplitude */ \
    X(T, ARRAY, sensor_operator, sensor_operator, ANY, 2, 0, 0, SYM_NONE, AXIS(SENSORS, 1, 0), AXIS(MODES, 1, 0)) /* C, temperature of the sensors per amplitude */ \
    X(T, ARRAY, sensor_std, sensor_std, POSITIVE, 1, 0, 0, SYM_NONE, AXIS(SENSORS, 1, 0)) /* standard deviations of the sensors' errors [K] */ \
    X(T, ARRAY, apparent_strain, apparent_strain, ANY, 1, 0, 0, SYM_NONE, AXIS(POWERS, 1, 0)) /* coefficients of p, of rise^1 to rise^j [1/K, 1/K^2 ..] */ \
    X(T, NUMBER, gauge_factor_slope, gauge_factor_slope, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* g [1/K] */ \
    X(T, NUMBER, modulus_slope, modulus_slope, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* m [1/K] */ \
    X(T, ARRAY, isothermal_covariance, isothermal_covariance, COVARIANCE, 2, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0), AXIS(GAUGES, 1, 0)) /* the map's gauge_covariance without the modes [(m/m)^2] */ \
    X(T, NUMBER, largest_rise, largest_rise, POSITIVE, 0, 0, 0, SYM_NONE, FIXED(0)) /* |rise| above the reference beyond which a sensor of temperature is taken to be broken [K] */ \
    X(T, ARRAY, scaled_covariance, scaled_covariance, ANY, 2, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0), AXIS(GAUGES, 1, 0)) /* of the errors that scale [(m/m)^2] */

#define INERTIA(X, T) \
    X(T, COUNT, n_channels, channels, ANY, 0, 1, 4096, SYM_NONE, FIXED(0)) /* of the sensors, the last */ \
    X(T, COUNT, n_vibrations, vibrations, ANY, 0, 0, 4096, SYM_NONE, FIXED(0)) /* of the modes, the last */

#define VEHICLE(X, T) \
    X(T, NUMBER, vehicle_mass, mass, POSITIVE, 0, 0, 0, SYM_NONE, FIXED(0)) /* mass of the whole vehicle in flight [kg] */

#define PARAMETERS(X, T) \
    X(T, LENGTH, count, minimum, ANY, 0, 0, 0, SYM_PARAMETERS, FIXED(1), FIXED(64)) \
    X(T, ARRAY, minimum, minimum, ANY, 1, 0, 0, SYM_NONE, AXIS(PARAMETERS, 1, 0)) /* over the snapshots */ \
    X(T, ARRAY, maximum, maximum, ANY, 1, 0, 0, SYM_NONE, AXIS(PARAMETERS, 1, 0)) /* the same */ \
    X(T, NUMBER, tolerance, tolerance, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* score up to which a parameter is inside */ \
    X(T, NUMBER, largest_score, largest_score, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* of a value that is no finite number, infinity */ \
    X(T, ARRAY, span, span, POSITIVE, 1, 0, 0, SYM_NONE, AXIS(PARAMETERS, 1, 0)) /* width of the range, at least the size of a value that is fixed */ \
    X(T, TEXT, names, names, ANY, 2, 0, 0, SYM_NONE, AXIS(PARAMETERS, 1, 0), FIXED(PARAMETER_NAME_SIZE)) /* as in the vehicle file */

#define SENSORS(X, T) \
    X(T, LENGTH, count, scale, ANY, 0, 0, 0, SYM_OTHERS, FIXED(0), AXIS(GAUGES, 1, -1)) \
    X(T, ARRAY, scale, scale, POSITIVE, 1, 0, 0, SYM_NONE, AXIS(OTHERS, 1, 0)) /* reading per row [unit/(m/m)] */ \
    X(T, ARRAY, largest, largest, POSITIVE, 1, 0, 0, SYM_NONE, AXIS(OTHERS, 1, 0)) /* largest |reading| of a working sensor [unit] */ \
    X(T, ARRAY, thrust_response, thrust_response, ANY, 1, 0, 0, SYM_NONE, AXIS(OTHERS, 1, 0)) /* reading per thrust, forward along the axis [unit/N] */

#define OTHER_LOADS(X, T) \
    X(T, LENGTH, n_loads, is_moment, ANY, 0, 0, 0, SYM_LOADS, FIXED(1), FIXED(4096)) \
    X(T, LENGTH, n_arrays, array_size, ANY, 0, 0, 0, SYM_ARRAYS, FIXED(1), FIXED(4096)) \
    X(T, TEXT, array_name, array_name, ANY, 2, 0, 0, SYM_NONE, AXIS(ARRAYS, 1, 0), FIXED(OUTPUT_NAME_SIZE)) /* names of the arrays of outputs */ \
    X(T, ARRAY, array_value, array_value, ANY, 1, 0, 0, SYM_NONE, AXIS(ARRAYS, 1, 0)) /* what each holds */ \
    X(T, ARRAY, array_first, array_first, ANY, 1, 0, 0, SYM_NONE, AXIS(ARRAYS, 1, 0)) /* the first of its loads */ \
    X(T, ARRAY, array_size, array_size, ANY, 1, 0, 0, SYM_NONE, AXIS(ARRAYS, 1, 0)) /* and how many they are */ \
    X(T, ARRAY, like, like, ANY, 1, 0, 0, SYM_NONE, AXIS(LOADS, 1, 0)) /* which of the five loads its standard deviation grows as */ \
    X(T, ARRAY, is_moment, is_moment, ANY, 1, 0, 0, SYM_NONE, AXIS(LOADS, 1, 0)) /* 0 or 1 */ \
    X(T, ARRAY, fixed_load, fixed_load, ANY, 1, 0, 0, SYM_NONE, AXIS(LOADS, 1, 0)) /* f_0 [N, N.m] */ \
    X(T, ARRAY, load_of_mean, load_of_mean, ANY, 1, 0, 0, SYM_NONE, AXIS(LOADS, 1, 0)) /* f_mean - f_0 [N, N.m] */ \
    X(T, ARRAY, load_per_state, load_per_state, ANY, 2, 0, 0, SYM_NONE, AXIS(STATES, 1, 0), AXIS(LOADS, 1, 0)) /* M [N/state, N.m/state] */ \
    X(T, ARRAY, spread_load, spread_load, ANY, 2, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0), AXIS(LOADS, 1, 0)) /* loads of the columns of spread [N, N.m] */ \
    X(T, ARRAY, spread_unseen, spread_unseen, ANY, 1, 0, 0, SYM_NONE, AXIS(LOADS, 1, 0)) /* variances of what those do not hold */

#define FILTER(X, T) \
    X(T, NUMBER, white_navigation, white_navigation, BETWEEN, 0, 0, 1, SYM_NONE, FIXED(0)) /* part of the variance of air data that is independent from sample to sample */ \
    X(T, NUMBER, smallest_time, smallest_time, POSITIVE, 0, 0, 0, SYM_NONE, FIXED(0)) /* of the time constant [s] */ \
    X(T, NUMBER, largest_time, largest_time, POSITIVE, 0, 0, 0, SYM_NONE, FIXED(0)) /* of the time constant, and of a step [s] */ \
    X(T, VALUES_4, rate, rate, POSITIVE, 1, 0, 0, SYM_NONE, FIXED(4)) /* standard deviations of the rates of (M, u, w, ln p_inf) while no strain comes [1/s] */ \
    X(T, ARRAY, noise, noise, POSITIVE, 1, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0)) /* variances of what is independent from sample to sample [(m/m)^2] */

#define KNOTS(X, T) \
    X(T, LENGTH, n_mach, mach_knots, ANY, 0, 0, 0, SYM_MACH, FIXED(2), FIXED(4096)) \
    X(T, LENGTH, n_incidence, incidence_knots, ANY, 0, 0, 0, SYM_INCIDENCE, FIXED(2), FIXED(4096)) \
    X(T, ARRAY, mach_knots, mach_knots, INCREASING, 1, 0, 0, SYM_NONE, AXIS(MACH, 1, 0)) /* increasing */ \
    X(T, ARRAY, incidence_knots, incidence_knots, INCREASING, 1, 0, 0, SYM_NONE, AXIS(INCIDENCE, 1, 0)) /* total angles of attack from 0, increasing [rad] */ \
    X(T, NUMBER, min_incidence, min_incidence, POSITIVE, 0, 0, 0, SYM_NONE, FIXED(0)) /* rounds the cone of total angle of attack off at its tip [rad] */

#define TABLES(X, T) \
    X(T, LENGTH, n_channels, table, ANY, 2, 0, 0, SYM_CHANNELS, FIXED(1), AXIS(ROWS, 2, 0)) \
    X(T, LENGTH, n_harmonics, table, ANY, 3, 0, 0, SYM_HARMONICS, FIXED(1), FIXED(4096)) \
    X(T, LENGTH, n_terms, row, ANY, 0, 0, 0, SYM_TERMS, AXIS(ROWS, 1, 0), AXIS(ROWS, 2, 0)) \
    X(T, ARRAY, table, table, ANY, 4, 0, 0, SYM_NONE, AXIS(MACH, 1, 2), AXIS(INCIDENCE, 1, 2), AXIS(CHANNELS, 1, 0), AXIS(HARMONICS, 1, 0)) /* coefficients of each channel, per p_inf [1/Pa, m2, m3] */ \
    X(T, ARRAY, row, row, ANY, 1, 0, 0, SYM_NONE, AXIS(TERMS, 1, 0)) /* row of the response that a term adds to, ascending */ \
    X(T, ARRAY, channel, channel, ANY, 1, 0, 0, SYM_NONE, AXIS(TERMS, 1, 0)) /* channel of each term */ \
    X(T, ARRAY, cosine, cosine, ANY, 2, 0, 0, SYM_NONE, AXIS(TERMS, 1, 0), AXIS(HARMONICS, 1, 0)) /* factors of cos m phi_T in a term */ \
    X(T, ARRAY, sine, sine, ANY, 2, 0, 0, SYM_NONE, AXIS(TERMS, 1, 0), AXIS(HARMONICS, 1, 0)) /* the same of sin m phi_T */ \
    X(T, ARRAY, fixed_response, fixed_response, ANY, 1, 0, 0, SYM_NONE, AXIS(ROWS, 1, 0)) /* part that does not follow p_inf [m/m, N, N.m] */

#define FLIGHT(X, T) \
    X(T, LENGTH, n_common, common_error, ANY, 0, 0, 0, SYM_COMMON, FIXED(0), FIXED(4096)) \
    X(T, LENGTH, n_shapes, shapes, ANY, 0, 0, 0, SYM_SHAPES, FIXED(0), FIXED(16)) \
    X(T, LENGTH, n_considered_common, considered_common, ANY, 0, 0, 0, SYM_CONSIDERED_COMMON, FIXED(0), FIXED(4096)) \
    X(T, ARRAY, gauge_covariance, gauge_covariance, COVARIANCE, 2, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0), AXIS(GAUGES, 1, 0)) /* of what does not scale, as gauge noise and apparent strain [(m/m)^2] */ \
    X(T, ARRAY, gauge_error_product, gauge_error_product, ANY, 2, 0, 0, SYM_NONE, FIXED(21), AXIS(GAUGES, 1, 0)) /* sum over errors of each gauge of D_a D_b, doubled for a < b [1/Pa^2] */ \
    X(T, ARRAY, common_error, common_error, ANY, 3, 0, 0, SYM_NONE, AXIS(COMMON, 1, 0), FIXED(6), AXIS(GAUGES, 1, 0)) /* errors that all gauges have in common, per p_inf and c_a, that the gain may correct [1/Pa] */ \
    X(T, NUMBER, reference_area, reference_area, POSITIVE, 0, 0, 0, SYM_NONE, FIXED(0)) /* S [m2] */ \
    X(T, NUMBER, reference_length, reference_length, POSITIVE, 0, 0, 0, SYM_NONE, FIXED(0)) /* L [m] */ \
    X(T, VALUES_2, mach_range, mach_range, RANGE, 1, 0, 0, SYM_NONE, FIXED(2)) /* M that the map holds for */ \
    X(T, VALUES_2, pressure_range, pressure_range, RANGE, 1, 0, 0, SYM_NONE, FIXED(2)) /* p_inf that the map holds for [Pa] */ \
    X(T, NUMBER, incidence_limit, incidence_limit, POSITIVE, 0, 0, 0, SYM_NONE, FIXED(0)) /* largest total angle of attack that it holds for [rad] */ \
    X(T, NUMBER, altitude_error, altitude_error, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* standard deviation of p_inf of the standard atmosphere at a stated altitude, relative */ \
    X(T, NUMBER, chi_square_scale, chi_square_scale, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* factor on the detection threshold of chi-square, from data of a truth model */ \
    X(T, NUMBER, outlier_scale, outlier_scale, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* the same on the square of the largest leave-one-out residual */ \
    X(T, NUMBER, half_gamma, half_gamma, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* q = half_gamma M^2 p */ \
    X(T, NUMBER, log_half_gamma, log_half_gamma, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* its logarithm */ \
    X(T, VALUES_4, largest_step, largest_step, POSITIVE, 1, 0, 0, SYM_NONE, FIXED(4)) /* largest change of M [1], u, w [rad] and ln p_inf in one iteration */ \
    X(T, WHOLE, start_iterations, start_iterations, ANY, 0, 2, 1000, SYM_NONE, FIXED(0)) /* iterations of every state of the search, an even number */ \
    X(T, WHOLE, cold_iterations, cold_iterations, ANY, 0, 0, 1000, SYM_NONE, FIXED(0)) /* iterations of the best of them from there */ \
    X(T, WHOLE, warm_iterations, warm_iterations, ANY, 0, 0, 1000, SYM_NONE, FIXED(0)) /* iterations of a step that goes on, from the state of the last one */ \
    X(T, WHOLE, search_every, search_every, ANY, 0, 0, 1e+06, SYM_NONE, FIXED(0)) /* steps from one search of the tables */ \
    X(T, WHOLE, return_after, return_after, ANY, 0, 0, 1e+06, SYM_NONE, FIXED(0)) /* steps in a row that must fit the tables before their loads follow the linear map's again */ \
    X(T, VALUES_3, navigation_limit, navigation_limit, ANY, 1, 0, 0, SYM_NONE, FIXED(3)) /* standardised residuals above which navigation is dropped */ \
    X(T, NUMBER, navigation_alarm, navigation_alarm, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* standardised residual from which navigation that is dropped is an alarm */ \
    X(T, NUMBER, range_tolerance, range_tolerance, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* relative excess of a range that does not count */ \
    X(T, NUMBER, min_gain, min_gain, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* part of the prior's standard deviation above which strain and navigation have not identified a quantity */ \
    X(T, NUMBER, min_incidence_score, min_incidence_score, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* from which the wind has a roll angle */ \
    X(T, VALUES_2, log_pressure_range, log_pressure_range, INCREASING, 1, 0, 0, SYM_NONE, FIXED(2)) /* ln(p_inf / Pa) */ \
    X(T, NUMBER, middle_log_pressure, middle_log_pressure, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* the same */ \
    X(T, WHOLE, has_crossflow_range, has_crossflow_range, ANY, 0, 0, 1, SYM_NONE, FIXED(0)) /* 1, or 0 */ \
    X(T, VALUES_2, crossflow_middle, crossflow_middle, ANY, 1, 0, 0, SYM_NONE, FIXED(2)) /* of the ranges of u and w [rad] */ \
    X(T, VALUES_2, crossflow_half, crossflow_half, POSITIVE, 1, 0, 0, SYM_NONE, FIXED(2)) /* half widths of these [rad] */ \
    X(T, NUMBER, outside_score, outside_score, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* of the flight state from which it is outside */ \
    X(T, VALUES_3, navigation_error, navigation_error, ANY, 1, 0, 0, SYM_NONE, FIXED(3)) /* of navigation without a standard deviation */ \
    X(T, VALUES_4, prior_mean, prior_mean, ANY, 1, 0, 0, SYM_NONE, FIXED(4)) /* of the flight state where nothing is known */ \
    X(T, VALUES_4, prior_precision, prior_precision, POSITIVE, 1, 0, 0, SYM_NONE, FIXED(4)) /* its inverse variance */ \
    X(T, NUMBER, shape_limit, shape_limit, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* sum of squares of discrepancy modes from which strain does not fit */ \
    X(T, NUMBER, outlier_threshold, outlier_threshold, ANY, 0, 0, 0, SYM_NONE, FIXED(0)) /* of the largest leave-one-out residual */ \
    X(T, ARRAY, chi_square_limit, chi_square_limit, ANY, 1, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 4)) /* by degrees of freedom from 0 on */ \
    X(T, ARRAY, gain_std, gain_std, ANY, 1, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0)) /* error of each gain, relative */ \
    X(T, ARRAY, common_gain, common_gain, ANY, 1, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0)) /* error that gains have in common, in each of them */ \
    X(T, ARRAY, scaled_covariance, scaled_covariance, ANY, 2, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0), AXIS(GAUGES, 1, 0)) /* of errors that the gain may correct, per p_inf^2 [1/Pa^2] */ \
    X(T, ARRAY, load_strain_covariance, load_strain_covariance, ANY, 2, 0, 0, SYM_NONE, FIXED(5), AXIS(GAUGES, 1, 0)) /* the same of loads with strain */ \
    X(T, ARRAY, load_covariance, load_covariance, ANY, 2, 0, 0, SYM_NONE, FIXED(5), FIXED(5)) /* the same of loads */ \
    X(T, ARRAY, considered_covariance, considered_covariance, ANY, 2, 0, 0, SYM_NONE, AXIS(GAUGES, 1, 0), AXIS(GAUGES, 1, 0)) /* of considered errors [1/Pa^2] */ \
    X(T, ARRAY, considered_load_strain_covariance, considered_load_strain_covariance, ANY, 2, 0, 0, SYM_NONE, FIXED(5), AXIS(GAUGES, 1, 0)) /* the same of loads with strain */ \
    X(T, ARRAY, considered_load_covariance, considered_load_covariance, ANY, 2, 0, 0, SYM_NONE, FIXED(5), FIXED(5)) /* the same of loads */ \
    X(T, ARRAY, considered_common, considered_common, ANY, 3, 0, 0, SYM_NONE, AXIS(CONSIDERED_COMMON, 1, 0), FIXED(6), AXIS(GAUGES, 1, 0)) /* considered ones of common_error [1/Pa] */ \
    X(T, ARRAY, shapes, shapes, ANY, 2, 0, 0, SYM_NONE, AXIS(SHAPES, 1, 0), AXIS(GAUGES, 1, 0)) /* discrepancy modes */

#define FLIGHT_LOADS(X, T) \
    X(T, ARRAY, strain_covariance, strain_covariance, ANY, 2, 0, 0, SYM_NONE, AXIS(LOADS, 1, 0), AXIS(GAUGES, 1, 0)) /* with strain, of errors that the gain may correct, per p_inf^2 */ \
    X(T, ARRAY, variance, variance, ANY, 1, 0, 0, SYM_NONE, AXIS(LOADS, 1, 0)) /* the same of each load */ \
    X(T, ARRAY, considered_strain_covariance, considered_strain_covariance, ANY, 2, 0, 0, SYM_NONE, AXIS(LOADS, 1, 0), AXIS(GAUGES, 1, 0)) /* with strain, of considered errors */ \
    X(T, ARRAY, considered_variance, considered_variance, ANY, 1, 0, 0, SYM_NONE, AXIS(LOADS, 1, 0)) /* the same of each load */

#define PRODUCTS(X, T) \
    X(T, ARRAY, product, product, ANY, 2, 0, 0, SYM_NONE, AXIS(PRODUCTS, 1, 0), AXIS(PRODUCT_SIZE, 1, 0)) /* of errors, per p_inf^2 */

#define PARAMETER_TABLES(X, T) \
    X(T, LENGTH, n_parameters, mean, ANY, 0, 0, 0, SYM_PARAMETERS, FIXED(1), FIXED(64)) \
    X(T, LENGTH, n_powers, power, ANY, 0, 0, 0, SYM_POWERS, FIXED(0), AXIS(PARAMETERS, 3, 0)) \
    X(T, LENGTH, n_basis, basis, ANY, 0, 0, 0, SYM_BASIS, FIXED(0), FIXED(65536)) \
    X(T, ARRAY, mean, mean, ANY, 1, 0, 0, SYM_NONE, AXIS(PARAMETERS, 1, 0)) /* of the parameters over the snapshots */ \
    X(T, ARRAY, spread, spread, FROM_0, 1, 0, 0, SYM_NONE, AXIS(PARAMETERS, 1, 0)) /* the same, 0 where they hold one value */ \
    X(T, ARRAY, parameter, parameter, ANY, 1, 0, 0, SYM_NONE, AXIS(POWERS, 1, 0)) /* parameter of each power, ascending */ \
    X(T, ARRAY, power, power, ANY, 1, 0, 0, SYM_NONE, AXIS(POWERS, 1, 0)) /* exponent of each power, 1 to 3 */ \
    X(T, ARRAY, offset, offset, ANY, 1, 0, 0, SYM_NONE, AXIS(POWERS, 1, 0)) /* mean of each power over the snapshots */ \
    X(T, NUMBER, largest_score, largest_score, BETWEEN, 0, 0, DBL_MAX, SYM_NONE, FIXED(0)) /* part of its range by which a flow parameter may leave it and still be used */ \
    X(T, ARRAY, basis, basis, ANY, 4, 0, 0, SYM_NONE, AXIS(BASIS, 1, 0), AXIS(INCIDENCE, 1, 2), AXIS(HARMONICS, 1, 0), FIXED(2)) /* tables, orthonormal, whose sums by */ \
    X(T, ARRAY, row_weight, row_weight, ANY, 4, 0, 0, SYM_NONE, AXIS(MACH, 1, 2), AXIS(POWERS, 1, 0), AXIS(ROWS, 1, 0), AXIS(BASIS, 1, 0)) /* are of a unit of a power, per p_inf [1/Pa, m2, m3] */

#define TARE(X, T) \
    X(T, LENGTH, n_patterns, pattern, ANY, 0, 0, 0, SYM_PATTERNS, FIXED(1), AXIS(STRAINS, 1, 0)) \
    X(T, ARRAY, noise_std, noise_std, POSITIVE, 1, 0, 0, SYM_NONE, AXIS(STRAINS, 1, 0)) /* sigma, standard deviation of the noise of each gauge [m/m] */ \
    X(T, NUMBER, least_samples, least_samples, BETWEEN, 0, 64, DBL_MAX, SYM_NONE, FIXED(0)) /* readings that a window of a tare must hold */ \
    X(T, NUMBER, least_part, least_part, BETWEEN, 0, 0, DBL_MAX, SYM_NONE, FIXED(0)) /* part of a window in which a gauge must read */ \
    X(T, NUMBER, least_gauges, least_gauges, BETWEEN, 0, 0, DBL_MAX, SYM_NONE, FIXED(0)) /* part of the gauges that must have a zero */ \
    X(T, NUMBER, own_factor, own_factor, BETWEEN, 0, 0, DBL_MAX, SYM_NONE, FIXED(0)) /* of the scatter of a gauge by its own noise */ \
    X(T, NUMBER, moved, moved, BETWEEN, 0, 0, DBL_MAX, SYM_NONE, FIXED(0)) /* factor on the scatter from which gauges move */ \
    X(T, NUMBER, loud, loud, BETWEEN, 0, 0, DBL_MAX, SYM_NONE, FIXED(0)) /* factor on the map's noise from which the scatter of a gauge is loud */ \
    X(T, NUMBER, dynamic_pressure, dynamic_pressure, BETWEEN, 0, 0, DBL_MAX, SYM_NONE, FIXED(0)) /* largest |q_inf| at which air does not load the vehicle [Pa] */ \
    X(T, NUMBER, zero, zero, BETWEEN, 0, 0, DBL_MAX, SYM_NONE, FIXED(0)) /* largest plausible |zero| [m/m] */ \
    X(T, NUMBER, drift, drift, BETWEEN, 0, 0, DBL_MAX, SYM_NONE, FIXED(0)) /* largest rise of a gauge over the window [m/m] */ \
    X(T, ARRAY, known_strain, known_strain, ANY, 1, 0, 0, SYM_NONE, AXIS(STRAINS, 1, 0)) /* of the loads that act meanwhile [m/m] */ \
    X(T, ARRAY, known_std, known_std, FROM_0, 1, 0, 0, SYM_NONE, AXIS(STRAINS, 1, 0)) /* its standard deviation [m/m] */ \
    X(T, ARRAY, pattern, pattern, ANY, 2, 0, 0, SYM_NONE, AXIS(PATTERNS, 1, 0), AXIS(STRAINS, 1, 0)) /* orthonormal strains of flights */ \
    X(T, ARRAY, load_odds, load_odds, ANY, 1, 0, 0, SYM_NONE, AXIS(STRAINS, 1, 1)) /* threshold of the part along them by the number of gauges */

#endif
