/* Variables of the estimator by number: outputs, strains, other sensors, valid flags, then the scalar inputs and
   settings; of maps with tables over the flight state then other inputs, real outputs and Boolean outputs; then the
   zeros and their sigmas; then temperatures, of maps with modes of it, and thrust, of maps with sensors that it
   moves; then the loads besides the five, of maps with such; then the tare; then other parameters of the flow and how
   far they leave their ranges, of maps with such, then their sigmas, of maps with tables of them; then later inputs of
   navigation, of maps with tables; then the last ones, of air data, and whether the loads are usable. */

#ifndef ESTIMATOR_VARIABLES_H
#define ESTIMATOR_VARIABLES_H

#include "../../core/model.h"
#include "../estimator.h"

static inline Estimator *estimator_of(const Model *model) {
    return (Estimator *)(uintptr_t)model; /* its first member */
}

/* Index of a real input or setting in estimator->input; SIZE_MAX for any other variable. */
size_t input_of(const Estimator *e, size_t variable);

/* Index of a variable among the real outputs, and among the flags, of the nonlinear estimator; SIZE_MAX for others. */
size_t flight_real(const Estimator *e, size_t variable);
size_t flight_flag(const Estimator *e, size_t variable);

int is_real_output(size_t variable);

/* Whether a variable is the source of the dynamic pressure, an enumeration that is kept among the real inputs. */
int is_source(const Estimator *e, size_t variable);

/* Where a variable of the other loads is kept; NULL for any other. */
const double *other_real(const Estimator *e, size_t variable);

/* Number of the input of the tare; its state and the zeros in use follow. */
size_t tare_variable(const Estimator *e);

/* Index of a variable among the zeros in use; SIZE_MAX for others. */
size_t zero_in_use(const Estimator *e, size_t variable);

/* Which parameter of the flow a variable states the score of; SIZE_MAX for any other. */
size_t parameter_output(const Estimator *e, size_t variable);

/* Number of health.usable, the last variable. */
size_t usable_variable(const Estimator *e);

/* Value reference of FMI 3.0 of the time, behind all arrays. */
unsigned time_reference(const Estimator *e);

#endif
