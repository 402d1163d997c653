/* The native node for a caller in Python. */
#include "log.h"
#include "node.h"

#include <stddef.h>

static node here;

void begin(void) { node_init(&here); }
void start(double now) {
    node_start(&here);
    log_frame(now, LOG_STARTED, NULL, 0, 'T');
}
void stop(void) { node_stop(&here); }
void hear(uint32_t id, const uint8_t *data, int length, double stamp_s) {
    log_frame(stamp_s, id, data, length, 'R');
    node_hear(&here, id, data, length, stamp_s);
}
static int logged(double now, const frame *sent, int count) {
    for (int k = 0; k < count; k++) log_frame(now, sent[k].id, sent[k].data, FRAME_BYTES, 'T');
    return count;
}
int speak(double now, frame out[NODE_FRAMES]) { return logged(now, out, node_begin(&here, now, out)); }
int tick(double now, frame out[NODE_FRAMES]) {
    const int count = logged(now, out, node_tick(&here, now, out));
    log_tick();
    return count;
}
int log_to(const char *path) { return log_begin(path); }
long end_log(double now) { return log_end(now); }
int phase(void) { return (int)here.phase; }
int leads(void) { return here.leads; }
const char *reason(void) { return here.reason; }
const char *doubt(double now) { return node_doubt(&here, now); }
double reference_m(void) { return here.reference_m; }
double reference_s(void) { return here.reference_s; }
