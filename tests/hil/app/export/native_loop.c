/* The native node for a caller in Python. */
#include "node.h"

static node here;

void begin(void) { node_init(&here); }
void start(void) { node_start(&here); }
void stop(void) { node_stop(&here); }
void hear(uint32_t id, const uint8_t *data, int length, double stamp_s) { node_hear(&here, id, data, length, stamp_s); }
int speak(double now, frame out[NODE_FRAMES]) { return node_begin(&here, now, out); }
int tick(double now, frame out[NODE_FRAMES]) { return node_tick(&here, now, out); }
int phase(void) { return (int)here.phase; }
int leads(void) { return here.leads; }
const char *reason(void) { return here.reason; }
const char *doubt(double now) { return node_doubt(&here, now); }
double reference_m(void) { return here.reference_m; }
double reference_s(void) { return here.reference_s; }
