#include "protection.h"

#include <math.h>

#define COUNTS 16
#define MOST_LOST 4 /* frames that a counter may skip */
#define CYCLES 5    /* without a frame, after which data are invalid */
#define RESYNC 3    /* good frames in a row after which they are valid again */

uint8_t crc8(const uint8_t *bytes, int count, uint8_t data_id) {
    unsigned rest = 0xFFu;
    for (int k = 0; k <= count; k++) {
        rest ^= k < count ? bytes[k] : data_id;
        for (int bit = 0; bit < 8; bit++) rest = ((rest << 1) ^ ((rest & 0x80u) != 0u ? 0x2Fu : 0u)) & 0xFFu;
    }
    return (uint8_t)(rest ^ 0xFFu);
}

uint32_t answer_of(uint32_t number, uint8_t target) {
    uint32_t rest = 0xFFFFFFFFu;
    for (unsigned k = 0; k < 5u; k++) {
        rest ^= k < 4u ? (number >> (8u * k)) & 0xFFu : target;
        for (int bit = 0; bit < 8; bit++) rest = (rest >> 1) ^ ((rest & 1u) != 0u ? 0xEDB88320u : 0u);
    }
    return ~rest;
}

void protect(frame_sender *sender, uint8_t data[FRAME_BYTES]) {
    data[1] = (uint8_t)((data[1] & 0xF0u) | sender->counter);
    data[0] = crc8(data + 1, FRAME_BYTES - 1, sender->data_id);
    sender->counter = (uint8_t)((sender->counter + 1u) % COUNTS);
}

void receiver_init(frame_receiver *receiver, uint8_t data_id, double cycle_s) {
    receiver->data_id = data_id;
    receiver->cycle_s = cycle_s;
    receiver->stamp_s = -INFINITY;
    receiver->counter = receiver->candidate = -1;
    receiver->row = 0;
}

/* Whether the frame's counter may follow the last one at `now`. */
static verdict followed(frame_receiver *receiver, int counter, double now) {
    const int cyclic = receiver->cycle_s > 0.0, step = (counter - receiver->counter + COUNTS) % COUNTS;
    const double age_s = now - receiver->stamp_s;
    const int fresh = age_s >= 0.0 && (!cyclic || age_s <= CYCLES * receiver->cycle_s);
    if (receiver->counter < 0 || (step != 0 && !cyclic)) return ACCEPTED;
    if (fresh && step >= 1) {
        const double due = age_s / receiver->cycle_s + 0.5;
        if (step <= (due < MOST_LOST ? due : MOST_LOST) + 1) return ACCEPTED;
    }
    if (fresh) return step == 0 ? REPEATED : BAD_COUNTER;
    receiver->row = (counter - receiver->candidate + COUNTS) % COUNTS == 1 ? receiver->row + 1 : 1;
    receiver->candidate = counter;
    return receiver->row >= RESYNC || !cyclic ? ACCEPTED : BAD_COUNTER;
}

verdict receive(frame_receiver *receiver, const uint8_t *data, int length, double now,
                int (*in_range)(const uint8_t *)) {
    if (length != FRAME_BYTES) return BAD_LENGTH;
    if (crc8(data + 1, FRAME_BYTES - 1, receiver->data_id) != data[0]) return BAD_CRC;
    const int counter = data[1] & 0x0F;
    const verdict found = followed(receiver, counter, now);
    if (found != ACCEPTED) return found;
    if (!in_range(data)) return BAD_RANGE;
    receiver->counter = counter;
    receiver->row = 0;
    receiver->stamp_s = now;
    return ACCEPTED;
}
