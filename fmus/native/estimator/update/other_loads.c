#include "other_loads.h"

#include <stdlib.h>

#define MAX_LOADS 4096

static int parse(MapFile *file, size_t n, size_t states, OtherLoadsMap *map) {
    const size_t m = map->n_loads = map_length(file, "further.is_moment", 0, 1, MAX_LOADS);
    map_require(file, m % SECTION_LOADS == 1, "further.is_moment", "one for the body, and six for each section");
    map->is_moment = map_doubles(file, "further.is_moment", m);
    map->fixed = map_doubles(file, "further.fixed_load", m);
    map->of_mean = map_doubles(file, "further.load_of_mean", m);
    map->load_per_state = map_doubles(file, "further.load_per_state", states, m);
    map->spread_load = map_doubles(file, "further.spread_load", n, m);
    map->spread_unseen = map_doubles(file, "further.spread_unseen", m);
    return file->good;
}

int other_loads_create(MapFile *file, size_t n_gauges, size_t n_states, OtherLoads *other_loads) {
    if (!map_has(file, "further")) {
        return file->good;
    }
    if (!parse(file, n_gauges, n_states, &other_loads->map)) {
        return 0;
    }
    const size_t m = other_loads->map.n_loads;
    const size_t count = 2 * n_gauges * m + n_gauges + N_OTHER_VALUES * m;
    other_loads->memory = calloc(count, sizeof(double));
    if (other_loads->memory == NULL) {
        return map_no_memory(file);
    }
    other_loads->rows = other_loads->memory;
    other_loads->growth = other_loads->rows + 2 * m * n_gauges;
    other_loads->value[0] = other_loads->growth + n_gauges;
    for (int k = 1; k < N_OTHER_VALUES; k++) {
        other_loads->value[k] = other_loads->value[k - 1] + m;
    }
    other_loads->present = other_loads->outdated = 1;
    return 1;
}

void other_loads_free(OtherLoads *other_loads) {
    free(other_loads->memory);
}
