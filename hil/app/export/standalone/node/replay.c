/* Runs the node again on what a log of it received: `build/replay_node LOG`. Prints a line for every tick in which it sends
   other frames, "differs TICK TIME LOGGED COMPUTED", at last ticks, frames, and whether the log is whole. */
#include "node.h"

#include "frames.h"
#include "log.h"

#include <stdio.h>
#include <string.h>

static node here;
static frame own[NODE_FRAMES];
static int count, sent;        /* frames of the tick that the node sends, and that the log has shown */
static int begun, ticked, off; /* since the last SYNC: whether there was one, whether the node ticked, whether it differs */
static long ticks, frames;
static double now;

static void shown(const frame *one) {
    if (!one) printf(" -");
    else {
        printf(" %x#", (unsigned)one->id);
        for (int k = 0; k < FRAME_BYTES; k++) printf("%02x", one->data[k]);
    }
}

static void compare(const frame *logged, const frame *computed) {
    if (off || (logged && computed && logged->id == computed->id &&
                memcmp(logged->data, computed->data, FRAME_BYTES) == 0))
        return;
    off = 1;
    printf("differs %ld %.9f", ticks, now);
    shown(logged);
    shown(computed);
    printf("\n");
}

static void ends(void) {
    if (begun && ticked && sent < count) compare(NULL, own + sent);
}

static void sends(const frame *logged) {
    if (sent == count && begun && !ticked) {
        count = node_tick(&here, now, own);
        sent = 0;
        ticked = 1;
    }
    compare(logged, sent < count ? own + sent : NULL);
    sent += sent < count;
    frames++;
}

static void begins(double time_s) {
    ends();
    now = time_s;
    begun = 1;
    ticked = off = sent = 0;
    ticks++;
    count = node_begin(&here, now, own);
}

int main(int argc, char **argv) {
    char line[256], digits[32], way;
    double time_s;
    unsigned id, byte;
    int whole = 0;
    FILE *file = argc > 1 ? fopen(argv[1], "r") : NULL;
    if (!file) return 2;
    node_init(&here);
    while (fgets(line, sizeof line, file)) {
        frame one = {0};
        int bytes = 0;
        digits[0] = '\0';
        if (sscanf(line, "(%lf) node %x#%16[0-9A-F] %c", &time_s, &id, digits, &way) != 4 &&
            sscanf(line, "(%lf) node %x# %c", &time_s, &id, &way) != 3)
            break;
        one.id = id;
        while (bytes < FRAME_BYTES && sscanf(digits + 2 * bytes, "%2x", &byte) == 1) one.data[bytes++] = (uint8_t)byte;
        whole = id == LOG_ENDED;
        if (id == LOG_STARTED) node_start(&here);
        else if (id == LOG_STOPPED) node_stop(&here);
        else if (way == 'R') node_hear(&here, id, one.data, bytes, time_s);
        else if (!whole) {
            if (id == FRAMES_SYNC_FRAME_ID) begins(time_s);
            sends(&one);
        }
    }
    if (whole) ends();
    fclose(file);
    printf("%ld %ld %s\n", ticks, frames, whole ? "whole" : "cut_off");
    return 0;
}
