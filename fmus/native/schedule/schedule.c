/* The schedule: outputs that jump to the values of a table at its times. */

#include <stdio.h>
#include <string.h>

#include "../system/system_model.h"

#define ROUND_OFF 1e-9 /* [s]: communication points are sums of steps */

static int prepare(SystemModel *model, char text[MODEL_TEXT_SIZE]) {
    const size_t row = 1 + model->n_variables;
    if (model->n_data < row || model->n_data % row != 0) {
        snprintf(text, MODEL_TEXT_SIZE, "holds a schedule whose rows do not fit its variables");
        return STATUS_ERROR;
    }
    for (size_t k = 0; k < model->n_data; k++) {
        const size_t variable = k % row - 1;
        if (k % row > 0 && model->type[variable] != (double)REAL
            && !(model->data[k] >= model->minimum[variable] && model->data[k] <= model->maximum[variable])) {
            snprintf(text, MODEL_TEXT_SIZE, "holds a schedule with a value that cannot be");
            return STATUS_ERROR;
        }
    }
    return STATUS_OK;
}

static void outputs(SystemModel *model) {
    const size_t row = 1 + model->n_variables;
    const double *current = model->data;
    for (const double *next = current; next < model->data + model->n_data; next += row) {
        if (next[0] <= model->base.time + ROUND_OFF) {
            current = next;
        }
    }
    memcpy(model->value, current + 1, model->n_variables * sizeof *model->value);
}

static int step(SystemModel *model, double end, char text[MODEL_TEXT_SIZE]) {
    (void)text;
    model->base.time = end;
    return STATUS_OK;
}

const Behaviour SCHEDULE = {prepare, NULL, outputs, step};
