#include "guard.h"

#include <math.h>

#define LATE_STOP 3 /* missing commands in a row that stop */

static double within(double value, double low, double high) {
    const double above = value > low ? value : low;
    return above < high ? above : high;
}

static double rest(double value, const fence *limits) { return limits->rests ? value : 0.0; }

fence fence_after(fence limits, double since_s) {
    const double share = limits.first_share + limits.growth * (since_s > 0.0 ? since_s : 0.0);
    if (share >= 1.0) return limits;
    if (limits.rests) {
        limits.rate *= share;
    } else {
        limits.low *= share;
        limits.high *= share;
    }
    return limits;
}

static stop_reason stopping(evidence seen, int missed, double rate, const fence *limits) {
    const double newest_s = seen.feedback_s < seen.localisation_s ? seen.feedback_s : seen.localisation_s;
    if (missed >= LATE_STOP || newest_s < -limits->tick_s) return LATE;
    if (!(seen.feedback_s <= limits->feedback_s - fabs(rate) / limits->braking)) return FEEDBACK_LOST;
    if (seen.state != WAITING && seen.state != ENABLED && seen.state != DERATED) return NOT_ENABLED;
    return seen.localisation_s <= limits->stop_s ? NO_REASON : LOCALISATION_LOST;
}

passed guarded(double wanted, int mode, evidence seen, passed before, double dt, fence limits) {
    const int known = isfinite(wanted);
    const double here = limits.rests && known ? within(wanted, limits.low, limits.high) : rest(before.value, &limits);
    if (mode != ENABLE) return (passed){here, 0.0, mode, 0, NO_REASON};
    const int missed = known ? 0 : before.missed + 1;
    const stop_reason why = before.mode == QUICK_STOP ? before.reason : stopping(seen, missed, before.rate, &limits);
    if (why != NO_REASON) return (passed){rest(before.value, &limits), 0.0, QUICK_STOP, missed, why};
    if (missed > 0) wanted = missed == 1 || limits.rests ? before.value : 0.5 * before.value;
    const double share = seen.localisation_s <= limits.derate_s ? 1.0 : 0.5, reach = limits.rests ? 1.0 : share;
    double value = within(wanted, reach * limits.low, reach * limits.high);
    dt = dt > 0.0 ? (dt < 2 * limits.tick_s ? dt : 2 * limits.tick_s) : 0.0;
    if (isfinite(limits.rate)) {
        const double most = limits.rate * (limits.rests ? share : 1.0) * dt;
        value = within(value, before.value - most, before.value + most);
    }
    return (passed){value, dt > 0.0 ? (value - before.value) / dt : 0.0, ENABLE, missed, NO_REASON};
}
