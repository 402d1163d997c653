/* The log of a node: lines as candump -L writes them, with R or T, on the node's clock to the ns. A child writes them to
   the file, so the node never waits and a kill loses nothing; between both lies at most a megabyte. */
#ifndef LOG_H
#define LOG_H
#include <stdint.h>

/* frames that never are on a bus: what the node did between two ticks */
#define LOG_STARTED 0x1FFFFF01u
#define LOG_STOPPED 0x1FFFFF02u
#define LOG_ENDED 0x1FFFFF03u /* the last line of a log in which none is missing */

/* Whether a log begins at `path`; without one nothing is written. */
int log_begin(const char *path);
/* Notes a frame: 'R' received, 'T' sent. */
void log_frame(double time_s, uint32_t id, const uint8_t *data, int length, char way);
/* Hands the lines of a tick over. */
void log_tick(void);
/* Ends the log; how many ticks are missing in it. */
long log_end(double time_s);
#endif
