/* The fixed sequence of random numbers of an estimator: xorshift128 (Marsaglia 2003), the same on every machine. */
#ifndef CAPSULE_RANDOM_H
#define CAPSULE_RANDOM_H

#include "elementary.h"

CAPSULE_INLINE void capsule_seed(uint32_t *random)
{
    random[0] = 123456789u;
    random[1] = 362436069u;
    random[2] = 521288629u;
    random[3] = 88675127u;
}

CAPSULE_INLINE uint32_t capsule_draw(uint32_t *random)
{
    const uint32_t t = random[0] ^ (random[0] << 11);
    random[0] = random[1];
    random[1] = random[2];
    random[2] = random[3];
    random[3] = random[3] ^ (random[3] >> 19) ^ t ^ (t >> 8);
    return random[3];
}

/* Uniform in [0, 1), 24 bits. */
CAPSULE_INLINE real capsule_uniform(uint32_t *random)
{
    return R(capsule_draw(random) >> 8) * R(5.9604644775390625e-08);
}

/* Nearly normal: the sum of eight uniform numbers of 16 bits, of mean 0 and variance 1, within 4.9. */
CAPSULE_INLINE real capsule_normal(uint32_t *random)
{
    uint32_t sum = 0u;
    int k;
    for (k = 0; k < 4; k++) {
        const uint32_t two = capsule_draw(random);
        sum += (two & 0xFFFFu) + (two >> 16);
    }
    return (R(sum) - R(262140)) * R(1.8688123647942946e-05); /* sqrt(12 / 8) / 65536 */
}

#endif
