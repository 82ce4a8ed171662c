/* The node of an instance: made of its file, with the tables there; its ports; the check of a state.

   A table lies at a multiple of 8 bytes and within the file, or the file is refused; what numbers in the tables refer to
   is checked where strainfmu/can writes them. */

#include "ports.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "resource.h"

#define HEADER_OF_NODE 32
#define NODE_VERSION 1

/* Set the tables; 0 if the file is of another FMU, or a table does not lie in it. */
static int read_setup(Node *node, size_t length) {
    const NodeKind *kind = node->kind;
    const NodeSetup *setup = (const NodeSetup *)(const void *)(node->bytes + HEADER_OF_NODE);
    int good = length >= HEADER_OF_NODE + sizeof *setup && memchr(setup->guid, 0, sizeof setup->guid) != NULL
            && strcmp(setup->guid, node->model->guid) == 0 && setup->n_ports >= 1 && setup->n_ports <= kind->most_ports;
    for (int k = 0; good && k < MAX_TABLES && kind->row_size[k] > 0; k++) {
        const int64_t place = setup->table[k].place, count = setup->table[k].count;
        good = place >= 0 && place % 8 == 0 && count >= 0 && (uint64_t)place <= length
            && (uint64_t)count <= (length - (size_t)place) / kind->row_size[k];
        node->table[k] = node->bytes + (good ? place : 0);
    }
    node->setup = setup;
    return good;
}

Node *node_create(const NodeKind *kind, Model *model, unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]) {
    if (!resource_check(bytes, length, "SFMUNOD", NODE_VERSION, "node", text)) {
        free(bytes);
        return NULL;
    }
    Node *node = calloc(1, kind->node_size);
    if (node == NULL) {
        free(bytes);
        snprintf(text, MODEL_TEXT_SIZE, "needs more memory than there is");
        return NULL;
    }
    node->kind = kind;
    node->model = model;
    node->bytes = bytes;
    node->size = read_setup(node, length) ? kind->prepare(node) : 0;
    node->state = node->size > 0 ? calloc(1, node->size) : NULL;
    if (node->state == NULL) {
        snprintf(text, MODEL_TEXT_SIZE, node->size > 0 ? "needs more memory than there is" : "is no node of this FMU");
        node_destroy(node);
        return NULL;
    }
    return node;
}

void node_destroy(Node *node) {
    if (node != NULL) {
        free(node->state);
        free(node->bytes);
        free(node);
    }
}

void node_begin(Node *node, double time) {
    memset(node->state, 0, node->size);
    node->kind->begin(node, time);
}

/* The link of a port in a state. */
static Link *link_in(const Node *node, void *state, size_t port) {
    return (Link *)(void *)((unsigned char *)state + port * node->kind->port_size);
}

Link *node_link(const Node *node, size_t port) {
    return port < (size_t)node->setup->n_ports ? link_in(node, node->state, port) : NULL;
}

double node_due(const Node *node, size_t port) {
    const Link *link = node_link(node, port);
    return link->has_begun && link->n_reply == 0 ? node->kind->due(node, port) : -INFINITY;
}

int node_check_state(const Node *node, const unsigned char *bytes, char text[MODEL_TEXT_SIZE]) {
    void *state = malloc(node->size); /* aligned, which the bytes may not be */
    int good = state != NULL;
    for (size_t port = 0; good && port < (size_t)node->setup->n_ports; port++) {
        const Link *link = link_in(node, memcpy(state, bytes, node->size), port);
        good = link->n_heard <= PORT_BYTES && link->n_out <= PORT_BYTES && link->n_reply <= REPLY_BYTES;
    }
    good = good && (node->kind->check_state == NULL || node->kind->check_state(node, state));
    free(state);
    if (!good) {
        snprintf(text, MODEL_TEXT_SIZE, "holds frames that cannot be");
    }
    return good;
}
