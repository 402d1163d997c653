#include "node.h"

#include "deployment.h"
#include "frames.h"

#include <math.h>
#include <string.h>

#define HEARTBEAT_S 0.02
#define HEARTBEAT_LOST_S 0.06
#define CROWDED_S 0.1 /* after the last frame of another controller */
#define GUARD_REASON 2
#define OTHER_CONTROLLER 9
#define FASTEST_M_S 0.4 /* upper end of the range of speeds in frames */
#define LONGEST_S 167772.0

#ifdef NODE_CARRIAGE
#define DRIVE(part) frames_carriage_##part
#define DRIVE_ID(part) FRAMES_CARRIAGE_##part##_FRAME_ID
#define VALUE position_m
#define DECODED frames_carriage_feedback_position_m_decode
#define ENCODED frames_carriage_command_position_m_encode
#define FITS frames_carriage_feedback_position_m_is_in_range(m.position_m) && \
             frames_carriage_feedback_velocity_m_s_is_in_range(m.velocity_m_s)
#elif defined NODE_INNER_MASS
#define DRIVE(part) frames_inner_mass_##part
#define DRIVE_ID(part) FRAMES_INNER_MASS_##part##_FRAME_ID
#define VALUE level
#define ENCODED frames_inner_mass_command_level_encode
#define FITS frames_inner_mass_feedback_stretch_m_is_in_range(m.stretch_m) && \
             frames_inner_mass_feedback_current_a_is_in_range(m.current_a)
#else
#define DRIVE(part) frames_coil_##part
#define DRIVE_ID(part) FRAMES_COIL_##part##_FRAME_ID
#define VALUE current_a
#define DECODED frames_coil_feedback_current_a_decode
#define ENCODED frames_coil_command_current_a_encode
#define FITS frames_coil_feedback_current_a_is_in_range(m.current_a) && \
             frames_coil_feedback_voltage_v_is_in_range(m.voltage_v)
#endif

static int localisation_fits(const uint8_t *data) {
    struct frames_capsule_localisation_t m;
    frames_capsule_localisation_unpack(&m, data, FRAME_BYTES);
    return frames_capsule_localisation_position_m_is_in_range(m.position_m) &&
           frames_capsule_localisation_quality_is_in_range(m.quality) &&
           frames_capsule_localisation_age_s_is_in_range(m.age_s);
}

static int feedback_fits(const uint8_t *data) {
    struct DRIVE(feedback_t) m;
    DRIVE(feedback_unpack)(&m, data, FRAME_BYTES);
    return FITS && DRIVE(feedback_state_is_in_range)(m.state) &&
           DRIVE(feedback_temperature_deg_c_is_in_range)(m.temperature_deg_c);
}

static int fault_fits(const uint8_t *data) {
    struct DRIVE(fault_t) m;
    DRIVE(fault_unpack)(&m, data, FRAME_BYTES);
    return DRIVE(fault_code_is_in_range)(m.code);
}

static int heartbeat_fits(const uint8_t *data) {
    struct DRIVE(heartbeat_t) m;
    DRIVE(heartbeat_unpack)(&m, data, FRAME_BYTES);
    return DRIVE(heartbeat_state_is_in_range)(m.state) && DRIVE(heartbeat_uptime_s_is_in_range)(m.uptime_s);
}

static int anything_fits(const uint8_t *data) {
    (void)data;
    return 1;
}

void node_init(node *n) {
    memset(n, 0, sizeof *n);
    n->phase = IDLE;
    n->reason = "";
    n->temperature_C = 20.0;
    n->state = BOOT;
    n->located_s = n->fed_s = n->beat_s = n->other_s = -INFINITY;
    n->began_s = n->last_s = n->own_beat_s = n->own_stop_s = n->enabled_s = -INFINITY;
    receiver_init(&n->localisation, CAPSULE_LOCALISATION_DATA_ID, CAPSULE_LOCALISATION_CYCLE_S);
    receiver_init(&n->feedback, FEEDBACK_DATA_ID, FEEDBACK_CYCLE_S);
    receiver_init(&n->drive_fault, FAULT_DATA_ID, FAULT_CYCLE_S);
    receiver_init(&n->heartbeat, HEARTBEAT_DATA_ID, HEARTBEAT_CYCLE_S);
    receiver_init(&n->drive_challenge, CHALLENGE_DATA_ID, CHALLENGE_CYCLE_S);
    n->sync.data_id = SYNC_DATA_ID;
    n->own_heartbeat.data_id = CONTROLLER_HEARTBEAT_DATA_ID;
    n->command.data_id = COMMAND_DATA_ID;
    n->answer.data_id = ENABLE_ANSWER_DATA_ID;
    n->stop.data_id = SAFE_STOP_DATA_ID;
}

void node_start(node *n) {
    n->phase = RUNNING;
    n->reason = "";
    n->leads = 0;
}

void node_stop(node *n) {
    if (n->phase == RUNNING) n->phase = HALTING;
}

static void fail(node *n, const char *reason) {
    if (n->phase != RUNNING) return;
    n->phase = FAULTY;
    n->reason = reason;
}

const char *node_doubt(const node *n, double now) {
    if (now - n->other_s < CROWDED_S) return "another controller is on the bus";
    if (!isfinite(n->beat_s)) return "no heartbeat of a drive";
    if (n->other_catalogue) return "drive knows another DBC";
    if (n->fault) return "drive fault";
    return now - n->beat_s > HEARTBEAT_LOST_S ? "drive heartbeat lost" : "";
}

static void measured(node *n, int channel, double value, double stamp_s) {
    capsule_in *in = &n->in;
    if (in->readings == CAPSULE_READINGS) {
        memmove(in->reading, in->reading + 1, sizeof in->reading - sizeof in->reading[0]);
        in->readings--;
    }
    in->reading[in->readings++] = (capsule_reading){stamp_s, (real)value, channel};
}

static void located(node *n, const uint8_t *data, double stamp_s) {
    struct frames_capsule_localisation_t m;
    frames_capsule_localisation_unpack(&m, data, FRAME_BYTES);
    if (!m.valid) return;
    n->located_s = stamp_s - frames_capsule_localisation_age_s_decode(m.age_s);
    measured(n, CAPSULE_POSITION, frames_capsule_localisation_position_m_decode(m.position_m), n->located_s);
}

/* A report is true at the begin of the tick in which it was sent. */
static void fed(node *n, const uint8_t *data, double stamp_s) {
    struct DRIVE(feedback_t) m;
    DRIVE(feedback_unpack)(&m, data, FRAME_BYTES);
    n->fed_s = stamp_s;
    n->state = m.state;
    n->temperature_C = DRIVE(feedback_temperature_deg_c_decode)(m.temperature_deg_c);
#ifdef DECODED /* an inner mass does not report its level */
    n->report = DECODED(m.VALUE);
    const double ticks = isfinite(n->last_s) ? floor((stamp_s - n->last_s) / NODE_TICK_S + 1e-6) : 0.0;
    measured(n, NODE_CHANNEL, n->report, isfinite(n->last_s) ? n->last_s + ticks * NODE_TICK_S : stamp_s);
#endif
}

static int good(node *n, frame_receiver *receiver, const uint8_t *data, int length, double stamp_s,
                int (*fits)(const uint8_t *)) {
    const int accepted = receive(receiver, data, length, stamp_s, fits) == ACCEPTED;
    n->refused += !accepted;
    return accepted;
}

void node_hear(node *n, uint32_t id, const uint8_t *data, int length, double stamp_s) {
    static const uint32_t own[] = NODE_CONTROLLERS_FRAMES;
    for (size_t k = 0; k < sizeof own / sizeof own[0]; k++)
        if (id == own[k]) n->other_s = stamp_s;
    if (id == FRAMES_CAPSULE_LOCALISATION_FRAME_ID) {
        if (good(n, &n->localisation, data, length, stamp_s, localisation_fits)) located(n, data, stamp_s);
    } else if (id == DRIVE_ID(FEEDBACK)) {
        if (good(n, &n->feedback, data, length, stamp_s, feedback_fits)) fed(n, data, stamp_s);
    } else if (id == DRIVE_ID(FAULT)) {
        struct DRIVE(fault_t) m;
        if (!good(n, &n->drive_fault, data, length, stamp_s, fault_fits)) return;
        DRIVE(fault_unpack)(&m, data, FRAME_BYTES);
        n->fault = m.code;
    } else if (id == DRIVE_ID(CHALLENGE)) {
        struct DRIVE(challenge_t) m;
        if (!good(n, &n->drive_challenge, data, length, stamp_s, anything_fits)) return;
        DRIVE(challenge_unpack)(&m, data, FRAME_BYTES);
        n->challenge = m.number;
        n->challenged = 1;
    } else if (id == DRIVE_ID(HEARTBEAT)) {
        struct DRIVE(heartbeat_t) m;
        if (!good(n, &n->heartbeat, data, length, stamp_s, heartbeat_fits)) return;
        DRIVE(heartbeat_unpack)(&m, data, FRAME_BYTES);
        n->beat_s = stamp_s;
        n->other_catalogue = m.catalogue != NODE_CATALOGUE;
    }
}

/* The reference at `at_s`: linear between its knots, at rest before and after them. */
static void reference(const node *n, double at_s, real *position_m, real *speed_m_s) {
    static const double times_s[] = REFERENCE_S, places_m[] = REFERENCE_M;
    const int last = (int)(sizeof times_s / sizeof times_s[0]) - 1;
    const double t = at_s - n->reference_s;
    int low = 0, high = last;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (times_s[middle] <= t) low = middle;
        else high = middle;
    }
    const double speed = t < times_s[0] || t >= times_s[last]
                             ? 0.0
                             : (places_m[low + 1] - places_m[low]) / (times_s[low + 1] - times_s[low]);
    const double place_m = t >= times_s[last] ? places_m[last] : t <= times_s[0] ? places_m[0]
                                                               : places_m[low] + speed * (t - times_s[low]);
    *position_m = (real)(n->reference_m + place_m - places_m[0]);
    *speed_m_s = (real)speed;
}

static double in_force(const node *n) { return n->sent.mode == ENABLE ? n->sent.value : n->report; }

/* Ticks missed before `now`; -1 after a step of the clock backwards or beyond the life of the last command. */
static int missed_before(const node *n, double now) {
    if (!isfinite(n->last_s)) return 0;
    const double steps = (now - n->last_s) / NODE_TICK_S;
    return steps >= 0.5 && now - n->last_s <= 1e-3 * NODE_STILL_MS ? (int)lround(steps) - 1 : -1;
}

/* Makes up for missed ticks; after a longer pause the estimate begins anew. */
static void estimate(node *n, double now, int missed) {
    capsule_in *in = &n->in;
    const int readings = in->readings;
    in->in_force = (real)in_force(n);
    in->temperature_C = (real)n->temperature_C;
    in->least = -(real)INFINITY;
    in->most = (real)INFINITY;
    if (missed < 0) fail(n, "clock jumped");
    if (missed < 0 || !isfinite(n->last_s)) capsule_init(&n->capsule, &capsule_deployment, now, in->in_force);
    in->readings = 0;
    for (int k = missed; k > 0; k--) {
        in->time_s = now + (1 - k) * NODE_TICK_S;
        capsule_estimate(&n->capsule.estimator, in);
    }
    in->readings = readings;
    in->time_s = now + NODE_TICK_S;
    capsule_estimate(&n->capsule.estimator, in);
    in->readings = 0;
}

/* The mode of the next command: one state of the drive up at a time while running, else off. */
static int mode_of(const node *n, evidence seen) {
    if (n->phase != RUNNING) return OFF;
    if (n->leads) return ENABLE;
    if (!isfinite(n->beat_s) || seen.feedback_s > NODE_FEEDBACK_S) return OFF;
    if (seen.state == STANDBY) return READY;
    if (seen.state == WAITING) return n->capsule.estimator.belief.lost ? READY : ENABLE;
    return OFF;
}

static double acted(node *n, double now, int mode) {
    const capsule_belief *belief = &n->capsule.estimator.belief;
    if (mode != ENABLE) return n->report;
    if (!n->leads) {
        n->leads = 1;
        n->enabled_s = now;
        n->reference_s = now + NODE_TICK_S;
        n->reference_m = (double)belief->state[0];
        capsule_controller_init(&n->capsule.controller, &capsule_deployment, now, belief, (real)n->report);
    }
    reference(n, n->in.time_s, &n->in.position_m[0], &n->in.speed_m_s[0]);
#if CAPSULE_STAGES > 0
    for (int k = 1; k <= CAPSULE_STAGES; k++)
        reference(n, n->in.time_s + k * (double)capsule_deployment.stage_s, &n->in.position_m[k], &n->in.speed_m_s[k]);
#endif
    real ahead_m;
    reference(n, n->in.time_s + (double)capsule_deployment.reach_s, &ahead_m, &n->in.next_speed_m_s);
    capsule_control(&n->capsule.controller, belief, &n->in, &n->out);
    return (double)n->out.command;
}

static void send(frame *to, uint32_t id, frame_sender *sender) {
    to->id = id;
    protect(sender, to->data);
}

static int send_command(node *n, frame *to) {
    struct DRIVE(command_t) m = {0};
    const double life_ms = floor(NODE_STILL_MS - 1e3 * fabs(n->sent.rate) / NODE_BRAKING);
    m.VALUE = ENCODED(n->sent.value);
#ifdef NODE_CARRIAGE
    m.velocity_m_s = frames_carriage_command_velocity_m_s_encode(fmin(fmax(n->sent.rate, -FASTEST_M_S), FASTEST_M_S));
#endif
    m.time_to_live_ms = (uint8_t)(life_ms > 6.0 ? life_ms : 6.0);
    m.mode = (uint8_t)n->sent.mode;
    DRIVE(command_pack)(to->data, &m, FRAME_BYTES);
    send(to, DRIVE_ID(COMMAND), &n->command);
    return 1;
}

static int send_stop(node *n, frame *to, double now, uint8_t target, uint8_t reason) {
    struct frames_safe_stop_t m = {0};
    if (now - n->own_stop_s < HEARTBEAT_S - 0.5 * NODE_TICK_S) return 0;
    n->own_stop_s = now;
    m.target = target;
    m.reason = reason;
    frames_safe_stop_pack(to->data, &m, FRAME_BYTES);
    send(to, FRAMES_SAFE_STOP_FRAME_ID, &n->stop);
    return 1;
}

static int send_answer(node *n, frame *to) {
    struct frames_enable_answer_t m = {0};
    n->challenged = 0;
    m.target = NODE_TARGET;
    m.answer = answer_of(n->challenge, NODE_TARGET);
    frames_enable_answer_pack(to->data, &m, FRAME_BYTES);
    send(to, FRAMES_ENABLE_ANSWER_FRAME_ID, &n->answer);
    return 1;
}

int node_begin(node *n, double now, frame to[NODE_FRAMES]) {
    struct frames_sync_t sync = {0};
    struct frames_controller_heartbeat_t beat = {0};
    const int missed = missed_before(n, now);
    memset(to, 0, NODE_FRAMES * sizeof to[0]);
    if (!isfinite(n->began_s)) n->began_s = now;
    n->number += missed > 0 ? (uint32_t)missed : 0u;
    sync.tick = n->number++;
    sync.period_s = frames_sync_period_s_encode(NODE_TICK_S);
    frames_sync_pack(to->data, &sync, FRAME_BYTES);
    send(to, FRAMES_SYNC_FRAME_ID, &n->sync);
    if (now - n->own_beat_s < HEARTBEAT_S - 0.5 * NODE_TICK_S) return 1;
    n->own_beat_s = now;
    beat.state = (uint8_t)n->phase;
    beat.uptime_s = frames_controller_heartbeat_uptime_s_encode(fmin(now - n->began_s, LONGEST_S));
    beat.catalogue = NODE_CATALOGUE;
    frames_controller_heartbeat_pack(to[1].data, &beat, FRAME_BYTES);
    send(to + 1, FRAMES_CONTROLLER_HEARTBEAT_FRAME_ID, &n->own_heartbeat);
    return 2;
}

static void judge(node *n, double now, evidence seen) {
    const char *doubt = node_doubt(n, now);
    if (now - n->other_s < CROWDED_S || (n->leads && doubt[0])) fail(n, doubt);
    if (n->leads && seen.state != WAITING && seen.state != ENABLED && seen.state != DERATED)
        fail(n, "drive left operation");
}

int node_tick(node *n, double now, frame out[NODE_FRAMES]) {
    static const char *const words[] = {"", "controller late", "feedback lost", "drive not enabled",
                                        "localisation lost"};
    static const fence limits = NODE_FENCE;
    memset(out, 0, NODE_FRAMES * sizeof out[0]);
    estimate(n, now, missed_before(n, now));
    int count = 0;
    const evidence seen = {now - n->located_s, now - n->fed_s, n->state};
    judge(n, now, seen);
    const int mode = mode_of(n, seen);
    const double wanted = acted(n, now, mode);
    if (mode == READY && n->challenged) count += send_answer(n, out + count);
    const double dt = isfinite(n->last_s) ? now - n->last_s : 0.0;
    n->sent = guarded(wanted, mode, seen, n->sent, dt, fence_after(limits, now - n->enabled_s));
    count += send_command(n, out + count);
    if (n->sent.mode == QUICK_STOP) {
        count += send_stop(n, out + count, now, NODE_TARGET, GUARD_REASON);
        fail(n, words[n->sent.reason]);
    } else if (n->phase == FAULTY && now - n->other_s < CROWDED_S) {
        count += send_stop(n, out + count, now, 0, OTHER_CONTROLLER);
    }
    n->last_s = now;
    return count;
}
