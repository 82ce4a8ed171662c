#include "consistency.h"

#include <math.h>

void filter_note(Filter *filter, double chi_square, double degrees_of_freedom) {
    const FilterMap *map = &filter->map;
    FilterTrack *next = &filter->next;
    if (!(degrees_of_freedom > 0.0)) {
        return;
    }
    const double band = map->band * sqrt(2.0 / (degrees_of_freedom * (2.0 * map->window - 1.0)));
    const double largest = 1.0 + 0.5 * map->window * band, own = chi_square / degrees_of_freedom;
    next->mean += ((own < largest ? own : largest) - next->mean) / map->window;
    next->steps += 1.0;
    if (next->steps >= map->window && next->mean > 1.0 + band) {
        const double wider = map->widen * next->widening;
        next->widening = wider < map->largest_widening ? wider : map->largest_widening;
    } else if (next->mean < 1.0) {
        const double narrower = map->narrow * next->widening;
        next->widening = narrower > 1.0 ? narrower : 1.0;
    }
}
