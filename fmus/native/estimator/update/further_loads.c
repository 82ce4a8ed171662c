#include "further_loads.h"

#include <stdlib.h>

#define MAX_LOADS 4096

static int parse(MapFile *file, size_t n, size_t states, FurtherMap *map) {
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

int further_create(MapFile *file, size_t n_gauges, size_t n_states, Further *further) {
    if (!map_has(file, "further")) {
        return file->good;
    }
    if (!parse(file, n_gauges, n_states, &further->map)) {
        return 0;
    }
    const size_t m = further->map.n_loads;
    const size_t count = 3 * n_gauges * m + m + n_gauges + N_FURTHER * m;
    further->memory = calloc(count, sizeof(double));
    if (further->memory == NULL) {
        return map_no_memory(file);
    }
    further->load = further->memory;
    further->unseen = further->load + n_gauges * m;
    further->rows = further->unseen + m;
    further->growth = further->rows + 2 * m * n_gauges;
    further->value[0] = further->growth + n_gauges;
    for (int k = 1; k < N_FURTHER; k++) {
        further->value[k] = further->value[k - 1] + m;
    }
    further->present = further->outdated = 1;
    return 1;
}

void further_free(Further *further) {
    free(further->memory);
}
