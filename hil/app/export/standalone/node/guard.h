/* The guard between controller and bus: every command is allowed, finite, in range, in slew rate and in time. */
#ifndef GUARD_H
#define GUARD_H

enum { OFF, READY, ENABLE, QUICK_STOP };                                             /* modes of a command */
enum { BOOT, SELF_TEST, STANDBY, WAITING, ENABLED, DERATED, STOPPING, DRIVE_FAULT }; /* states of a drive */
typedef enum { NO_REASON, LATE, FEEDBACK_LOST, NOT_ENABLED, LOCALISATION_LOST } stop_reason;

typedef struct {
    double low, high, rate; /* range of a command, and its change per s */
    int rests;              /* a carriage, whose safe command is to stay; else 0 is safe */
    double tick_s;
    double feedback_s, braking; /* age of feedback that stops, less the time to brake */
    double derate_s, stop_s;    /* ages of localisation that halve rate or range, and that stop */
    double first_share, growth; /* of rate or range once the drive is enabled, and per s */
} fence;

typedef struct {
    double localisation_s, feedback_s; /* ages, infinity: none yet */
    int state;
} evidence;

typedef struct {
    double value, rate;
    int mode, missed;
    stop_reason reason;
} passed;

/* The limits `since_s` after the drive was enabled. */
fence fence_after(fence limits, double since_s);
/* The permitted command `dt` s after `before`; a `wanted` that is not finite counts as missing. */
passed guarded(double wanted, int mode, evidence seen, passed before, double dt, fence limits);
#endif
