/* Plant, autopilot and schedule are on no bus. */

#include "../core/ports.h"

const Ports PORTS = {0};
