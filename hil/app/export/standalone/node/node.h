/* The controller as a node on the bus, without input and output: frames in, a tick, frames out. Times are in s of one
   clock that never jumps and that stamps received frames. */
#ifndef NODE_H
#define NODE_H
#include "controller.h"
#include "guard.h"
#include "protection.h"

#define NODE_FRAMES 6 /* frames of a tick, at most */

typedef enum { IDLE = 1, RUNNING, HALTING, FAULTY } node_phase; /* the numbers of its heartbeat */

typedef struct {
    uint32_t id;
    uint8_t data[FRAME_BYTES];
} frame;

typedef struct {
    capsule_state capsule;
    capsule_in in;
    capsule_out out;
    node_phase phase;
    const char *reason; /* why it stopped by itself */
    int leads;          /* whether the drive was commanded to move since the start */
    passed sent;
    /* the drive's last report */
    int state, fault, other_catalogue;
    double report, temperature_C;
    int challenged;
    uint32_t challenge;
    double located_s, fed_s, beat_s, other_s; /* when: localisation, feedback, heartbeat, another controller */
    /* sending */
    double began_s, last_s, own_beat_s, own_stop_s, enabled_s;
    uint32_t number;
    double reference_s, reference_m; /* where and when the reference begins */
    frame_receiver localisation, feedback, drive_fault, heartbeat, drive_challenge;
    frame_sender sync, own_heartbeat, command, answer, stop;
    long refused;
} node;

void node_init(node *n);
/* Starts to lead, or stops in a controlled way. */
void node_start(node *n);
void node_stop(node *n);
/* Whether a drive is heard that may be led, and what speaks against it, "" without a reason. */
const char *node_doubt(const node *n, double now);
/* Takes a classic frame that was received at `stamp_s`. */
void node_hear(node *n, uint32_t id, const uint8_t *data, int length, double stamp_s);
/* One tick at `now`: first SYNC and heartbeat, then, once the received frames are taken in, the command. Both return
   the number of frames to send. */
int node_begin(node *n, double now, frame out[NODE_FRAMES]);
int node_tick(node *n, double now, frame out[NODE_FRAMES]);
#endif
