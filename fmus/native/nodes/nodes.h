/* Nodes of a network other than the estimator's: the sender of a vehicle's strains, and the bus. */

#ifndef NODES_H
#define NODES_H

#include "../network/link.h"

extern const NodeKind SENDER, CAN_BUS;

#endif
