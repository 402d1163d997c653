/* The controller's step: from fresh readings to the limited command. SI units; a command is in the drive's own unit:
   the carriage's position in m, the coil's current in A or voltage in V. No heap, bounded time, nothing raises. */
#ifndef CAPSULE_CONTROLLER_H
#define CAPSULE_CONTROLLER_H

#include <stdint.h>

#ifdef CAPSULE_FLOAT32
typedef float real;
#else
typedef double real;
#endif

#include "numbers.h" /* the deployment's sizes (CAPSULE_...) and `capsule_numbers` */

#define CAPSULE_READINGS 8 /* newest readings of a tick that are used */
#define CAPSULE_EVENTS 4   /* changes of the leading controller in a tick, at most */

/* channels of readings */
#define CAPSULE_POSITION 0  /* localisation of the capsule, m */
#define CAPSULE_COMMANDED 1 /* the drive's report of its command, in the command's unit */
#define CAPSULE_CURRENT 2   /* the coil's current, A, where the command is a voltage */
#define CAPSULE_OTHER 3     /* counted as unusable */

/* status of an answer */
#define CAPSULE_OK 0
#define CAPSULE_LATE 1 /* never answered: time is bounded by iterations */
#define CAPSULE_FAILED 2
#define CAPSULE_LOST 3    /* estimate lost: controlled stop */
#define CAPSULE_LIMITED 4 /* a limit changed the command */
#define CAPSULE_STOPPED 5

/* reasons of an event; the rank it is about in bits 8..15, the limits concerned from bit 16 on */
#define CAPSULE_START 0
#define CAPSULE_ESTIMATE_LOST 1
#define CAPSULE_RECOVERED 2
#define CAPSULE_HALTED 3      /* `capsule_in.halt` */
#define CAPSULE_ANSWERED 4    /* the rank answered no usable command */
#define CAPSULE_TOO_LONG 5    /* the rank was limited too long */
#define CAPSULE_SWINGS 6      /* the capsule swung about the reference under the rank */
#define CAPSULE_TRIED_AGAIN 7 /* after a suspension */
#define CAPSULE_NONE_LEFT 8   /* every controller is suspended for good */
#define CAPSULE_TAKEN_OVER 9  /* `capsule_continue` */

/* limits that acted, bits of `capsule_out.limits` */
#define CAPSULE_LIMIT_PREVIOUS 1
#define CAPSULE_LIMIT_TEMPERATURE 2
#define CAPSULE_LIMIT_COMMAND 4
#define CAPSULE_LIMIT_ESTIMATE 8
#define CAPSULE_LIMIT_RANGE 16
#define CAPSULE_LIMIT_GAP 32
#define CAPSULE_LIMIT_SPEED 64
#define CAPSULE_LIMIT_RATE 128

typedef struct {
    double stamp_s; /* when the value was true, on the clock of `capsule_in.time_s` */
    real value;     /* in the channel's unit */
    int channel;    /* CAPSULE_POSITION, ... */
} capsule_reading;

typedef struct {
    double time_s;                              /* of this tick, one CAPSULE tick after the last */
    int readings;                               /* number of fresh readings, 0 to CAPSULE_READINGS */
    int halt;                                   /* not 0: stop for good, until `capsule_init` */
    capsule_reading reading[CAPSULE_READINGS];  /* those that arrived since the last tick */
    real in_force;                              /* command that the drive has followed since; NaN: the last answer */
    real position_m[CAPSULE_STAGES + 1];        /* reference at time_s + k stage_s, m */
    real speed_m_s[CAPSULE_STAGES + 1];         /* its speed, m/s */
    real next_speed_m_s;                        /* its speed at time_s + reach_s, m/s */
    real least, most;                           /* bounds of the command for now; infinite: none */
    real temperature_C;                         /* the drive's last report */
} capsule_in;

typedef struct {
    int before, after; /* rank of the controller that led and leads, 0 the best; -1: controlled stop */
    int reason;
} capsule_event;

typedef struct {
    real command;   /* in the drive's unit, within all limits */
    real rate;      /* of the command, per s */
    int status;     /* CAPSULE_OK, ... */
    int active;     /* rank of the controller that leads; -1: controlled stop */
    int limits;     /* that acted, CAPSULE_LIMIT_... */
    int iterations; /* of the quadratic programs of this tick */
    int plans;      /* steps of sequential quadratic programming in this tick */
    int halted;     /* stopped for good */
    int lost;       /* the estimate must not be acted on */
    int events;     /* number of events in this tick */
    capsule_event event[CAPSULE_EVENTS];
    real position_m, speed_m_s, std_m, disturbance_N; /* the estimate; disturbance: force along +x the model lacks */
    real friction_scale;                              /* learned friction over the model's */
    real resting_s; /* how long capsule and reference have been at rest */
} capsule_out;

/* What the estimator says of this tick. */
typedef struct {
    double time_s;
    real state[CAPSULE_STATES], std[CAPSULE_STATES]; /* in the control model's order: position m, speed m/s, ... */
    real lacking_N;                                  /* force along +x that the model's own parameters lack */
    real force_N;                                    /* the same with `parameters` */
    real parameters[CAPSULE_PARAMETERS];             /* as learned */
    real level;                                      /* friction: the scale is 1 + level */
    real surprise;                                   /* normalised innovation of the newest position; NaN: none */
    real offset;                                     /* of the drive's report from its command */
    real innovation[CAPSULE_READINGS];               /* of the accepted positions */
    int innovations, lost, learned;                  /* learned: `parameters` and `force_N` are to be used */
    uint32_t accepted, outliers, unusable, restarts, followed; /* readings since `capsule_init` by outcome */
} capsule_belief;

typedef struct capsule_state capsule_state;

#include "state.h" /* capsule_estimator, capsule_controller, capsule_state: fixed size, no pointer into themselves */

/* Begins at `begin_s` at rest with `command` in force. `numbers` must outlive the state. */
void capsule_init(capsule_state *state, const capsule_numbers *numbers, double begin_s, real command);
/* One tick: estimate, controller with its fallbacks, limits. */
void capsule_step(capsule_state *state, const capsule_in *in, capsule_out *out);

/* The two halves of a step. */
void capsule_estimator_init(capsule_estimator *estimator, const capsule_numbers *numbers, double begin_s, real command);
void capsule_estimate(capsule_estimator *estimator, const capsule_in *in); /* result in `estimator->belief` */
void capsule_controller_init(capsule_controller *controller, const capsule_numbers *numbers, double begin_s,
                             const capsule_belief *belief, real command);
void capsule_control(capsule_controller *controller, const capsule_belief *belief, const capsule_in *in,
                     capsule_out *out);
/* `controller`, of another model, takes over from `before`: the step between their commands fades. */
void capsule_continue(capsule_controller *controller, const capsule_controller *before);

#endif
