/* Protection of frames by CRC, counter and age, as in AUTOSAR E2E profile 2. Byte 0 is the CRC, the low half of byte 1
   the counter. */
#ifndef PROTECTION_H
#define PROTECTION_H
#include <stdint.h>

#define FRAME_BYTES 8

typedef enum { ACCEPTED, BAD_LENGTH, BAD_CRC, BAD_COUNTER, REPEATED, BAD_RANGE } verdict;

typedef struct {
    uint8_t data_id, counter;
} frame_sender;

typedef struct {
    uint8_t data_id;
    double cycle_s; /* 0: sent on events */
    double stamp_s; /* of the last good frame */
    int counter, candidate, row;
} frame_receiver;

/* CRC-8 (polynomial 0x2F, start and final XOR 0xFF) of `count` bytes and the data id. */
uint8_t crc8(const uint8_t *bytes, int count, uint8_t data_id);
/* The answer to a drive's challenge: CRC-32 of its number, little endian, and the target. */
uint32_t answer_of(uint32_t number, uint8_t target);
/* Sets counter and CRC of a packed frame. */
void protect(frame_sender *sender, uint8_t data[FRAME_BYTES]);
void receiver_init(frame_receiver *receiver, uint8_t data_id, double cycle_s);
/* Checks length, CRC and counter of a frame received at `now`; `in_range` says whether its signals are. */
verdict receive(frame_receiver *receiver, const uint8_t *data, int length, double now, int (*in_range)(const uint8_t *));
#endif
