/* The node on SocketCAN: `node CHANNEL [SECONDS [LOG]]`. Status 0: led to the end, 1: any other end, 2: no such bus. */
#include "node.h"

#include "deployment.h"
#include "log.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <math.h>
#include <net/if.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define LISTEN_S 2.0  /* at most, for a drive */
#define GIVE_UP_S 5.0 /* in which the drive must be enabled */
#define REST_S 0.2    /* ticked on after the stop */
#define MOST_FRAMES 256
#define OLDEST_NS 100000000 /* age of a kernel's stamp, beyond which the frame's arrival counts */
#define BINS 10000 /* of lateness, 1 us each */

static node here;
static volatile sig_atomic_t wanted;
static long late_us[BINS], ticks, unsent;
static int64_t origin_ns;

static void asked(int number) { wanted = number; }

/* The number nearest to `ns`, as a log's digits are read back. */
static double of_ns(int64_t ns) { return (double)ns / 1e9; }

static int64_t whole_ns(const struct timespec *t) { return (int64_t)t->tv_sec * 1000000000 + t->tv_nsec; }

static int64_t ns_by(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return whole_ns(&t);
}

/* Time in s since the node began: effects over time count from there. */
static double seconds(void) { return of_ns(ns_by(CLOCK_MONOTONIC) - origin_ns); }

static int opened(const char *channel) {
    struct ifreq request;
    struct sockaddr_can address;
    const int bus = socket(PF_CAN, SOCK_RAW, CAN_RAW), on = 1;
    memset(&request, 0, sizeof request);
    memset(&address, 0, sizeof address);
    if (bus < 0 || strlen(channel) >= sizeof request.ifr_name) return -1;
    memcpy(request.ifr_name, channel, strlen(channel));
    if (ioctl(bus, SIOCGIFINDEX, &request) < 0) return -1;
    address.can_family = AF_CAN;
    address.can_ifindex = request.ifr_ifindex;
    if (fcntl(bus, F_SETFL, O_NONBLOCK) < 0 || setsockopt(bus, SOL_SOCKET, SO_TIMESTAMP, &on, sizeof on) < 0 ||
        bind(bus, (const struct sockaddr *)&address, sizeof address) < 0)
        return -1;
    return bus;
}

/* Takes in the waiting frames; the kernel stamps them by the wall clock. */
static void listen_to(int bus) {
    for (int k = 0; k < MOST_FRAMES; k++) {
        struct can_frame got;
        char control[CMSG_SPACE(sizeof(struct timeval))];
        struct iovec part = {&got, sizeof got};
        struct msghdr message;
        memset(&message, 0, sizeof message);
        message.msg_iov = &part;
        message.msg_iovlen = 1;
        message.msg_control = control;
        message.msg_controllen = sizeof control;
        if (recvmsg(bus, &message, 0) != (ssize_t)sizeof got) return;
        int64_t age_ns = 0;
        for (struct cmsghdr *c = CMSG_FIRSTHDR(&message); c; c = CMSG_NXTHDR(&message, c)) {
            if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_TIMESTAMP) continue;
            struct timeval t;
            memcpy(&t, CMSG_DATA(c), sizeof t);
            age_ns = ns_by(CLOCK_REALTIME) - ((int64_t)t.tv_sec * 1000000 + t.tv_usec) * 1000;
        }
        const double age_s = age_ns >= 0 && age_ns <= OLDEST_NS ? of_ns(age_ns) : 0.0;
        const double stamp_s = of_ns(llround(1e9 * fmax(seconds() - age_s, 0.0)));
        if (got.can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG)) continue;
        log_frame(stamp_s, got.can_id, got.data, got.can_dlc, 'R');
        node_hear(&here, got.can_id, got.data, got.can_dlc, stamp_s);
    }
}

static void say(int bus, double now, const frame *frames, int count) {
    for (int k = 0; k < count; k++) {
        struct can_frame sent;
        memset(&sent, 0, sizeof sent);
        sent.can_id = frames[k].id;
        sent.can_dlc = FRAME_BYTES;
        memcpy(sent.data, frames[k].data, FRAME_BYTES);
        log_frame(now, frames[k].id, frames[k].data, FRAME_BYTES, 'T');
        unsent += write(bus, &sent, sizeof sent) != (ssize_t)sizeof sent;
    }
}

/* Waits for the next tick of the grid, ticks, and returns its time. */
static double ticked(int bus, struct timespec *due) {
    frame frames[NODE_FRAMES];
    const long tick_ns = lround(1e9 * NODE_TICK_S);
    due->tv_nsec += tick_ns;
    while (due->tv_nsec >= 1000000000L) {
        due->tv_nsec -= 1000000000L;
        due->tv_sec++;
    }
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, due, NULL) == EINTR) {
    }
    const double now = seconds(), due_s = of_ns(whole_ns(due) - origin_ns);
    const double skipped = floor((now - due_s) / NODE_TICK_S); /* ticks that were slept through are not caught up */
    due->tv_nsec += tick_ns * (long)skipped;
    say(bus, now, frames, node_begin(&here, now, frames));
    listen_to(bus);
    say(bus, now, frames, node_tick(&here, now, frames));
    log_tick();
    const long us = lround(1e6 * (seconds() - due_s));
    late_us[us < BINS ? us : BINS - 1]++;
    ticks++;
    return now;
}

static long percentile_us(double share) {
    long sum = 0;
    for (int k = 0; k < BINS; k++)
        if ((double)(sum += late_us[k]) >= share * (double)ticks) return k;
    return BINS;
}

int main(int argc, char **argv) {
    const double lasts_s = argc > 2 ? atof(argv[2]) : NODE_DURATION_S;
    const int bus = argc > 1 ? opened(argv[1]) : -1;
    if (bus < 0) {
        fprintf(stderr, "node CHANNEL [SECONDS [LOG]] must name a CAN interface that is up; got %s: %s\n",
                argc > 1 ? argv[1] : "none", argc > 1 ? strerror(errno) : "no argument");
        return 2;
    }
    if (!(lasts_s > 0.0)) {
        fprintf(stderr, "SECONDS must be a time above 0; got %s\n", argv[2]);
        return 2;
    }
    if (argc > 3 && !log_begin(argv[3])) {
        fprintf(stderr, "log must be a file that can be written; got %s: %s\n", argv[3], strerror(errno));
        return 2;
    }
    const struct sched_param priority = {.sched_priority = 20};
    if (sched_setscheduler(0, SCHED_FIFO, &priority) || mlockall(MCL_CURRENT | MCL_FUTURE))
        fprintf(stderr, "no real-time priority or locked memory: ticks may be late\n");
    signal(SIGINT, asked);
    signal(SIGTERM, asked);
    node_init(&here);
    struct timespec due;
    clock_gettime(CLOCK_MONOTONIC, &due);
    origin_ns = whole_ns(&due);
    const double began = ticked(bus, &due);
    double now = began, led_s = INFINITY;
    while (!wanted && now - began < LISTEN_S && (now - began < 0.3 || node_doubt(&here, now)[0]))
        now = ticked(bus, &due);
    const char *ended = node_doubt(&here, now);
    if (!ended[0]) {
        const double started = now;
        node_start(&here);
        log_frame(now, LOG_STARTED, NULL, 0, 'T');
        while (here.phase == RUNNING && !wanted && now - led_s < lasts_s) {
            now = ticked(bus, &due);
            if (here.leads && isinf(led_s)) led_s = now;
            if (isinf(led_s) && now - started > GIVE_UP_S) break;
        }
        ended = here.phase == FAULTY ? here.reason : isinf(led_s) ? "drive was not enabled" : wanted ? "stopped" : "done";
    }
    node_stop(&here);
    log_frame(now, LOG_STOPPED, NULL, 0, 'T');
    for (const double stopped = now; now - stopped < REST_S;) now = ticked(bus, &due);
    printf("ended: %s\n%ld ticks; sent after us: median %ld, 99 of 100 %ld, most %ld; refused %ld, unsent %ld, missing in "
           "the log %ld\n",
           ended, ticks, percentile_us(0.5), percentile_us(0.99), percentile_us(1.0), here.refused, unsent,
           log_end(now));
    return here.phase == FAULTY || !isfinite(led_s);
}
