#include "log.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <sys/wait.h>
#include <unistd.h>

#define ROOM (1 << 20)
#define PIPE_SIZE 1031  /* F_SETPIPE_SZ of fcntl(2), which stands behind _GNU_SOURCE */
#define TICK_ROOM 4096  /* what the pipe takes whole or not at all */
#define LINE_ROOM 64

static int lines = -1;
static pid_t writer;
static char text[TICK_ROOM];
static size_t length;
static long missing;

static void copy(int from, int to) {
    static char part[1 << 16];
    for (ssize_t got; (got = read(from, part, sizeof part)) > 0;)
        for (ssize_t put = 0, more; put < got; put += more)
            if ((more = write(to, part + put, (size_t)(got - put))) < 0) _exit(1);
    _exit(0);
}

int log_begin(const char *path) {
    int ends[2];
    const int file = open(path, O_WRONLY | O_CREAT | O_TRUNC, 0644);
    if (file < 0 || pipe(ends) < 0) return 0;
    (void)fcntl(ends[1], PIPE_SIZE, ROOM);
    writer = fork();
    if (writer < 0) return 0;
    if (writer == 0) {
        (void)setsid(); /* a stop of the node from the terminal is not the writer's */
        (void)close(ends[1]);
        copy(ends[0], file);
    }
    (void)signal(SIGPIPE, SIG_IGN);
    (void)close(ends[0]);
    (void)close(file);
    lines = ends[1];
    return fcntl(lines, F_SETFL, O_NONBLOCK) == 0;
}

void log_tick(void) {
    if (length > 0 && write(lines, text, length) != (ssize_t)length) missing++;
    length = 0;
}

void log_frame(double time_s, uint32_t id, const uint8_t *data, int bytes, char way) {
    if (lines < 0) return;
    if (length + LINE_ROOM > sizeof text) log_tick();
    char *at = text + length;
    at += snprintf(at, LINE_ROOM, id > 0x7FFu ? "(%.9f) node %08X#" : "(%.9f) node %03X#", time_s, (unsigned)id);
    for (int k = 0; k < bytes && k < 8; k++) at += snprintf(at, 3, "%02X", (unsigned)data[k]);
    *at++ = ' ';
    *at++ = way;
    *at++ = '\n';
    length = (size_t)(at - text);
}

long log_end(double time_s) {
    if (lines < 0) return 0;
    if (missing == 0) log_frame(time_s, LOG_ENDED, NULL, 0, 'T');
    log_tick();
    (void)close(lines);
    (void)waitpid(writer, NULL, 0);
    return missing;
}
