/* Elementary functions without a branch or a call, so that a loop over particles becomes vector code, and the same on
   every machine in double precision: after fdlibm (Sun Microsystems 1993), as the Python model's machine code. */
#ifndef CAPSULE_ELEMENTARY_H
#define CAPSULE_ELEMENTARY_H

#include <math.h>
#include <string.h>

#include "controller.h"

#define R(x) ((real)(x))
#define CAPSULE_INLINE static inline __attribute__((unused))

#ifdef CAPSULE_FLOAT32
#define real_sqrt sqrtf
#define real_abs fabsf
#define real_floor floorf
#define real_ceil ceilf
#define real_copysign copysignf
#define real_exp expf
#define real_log logf
#define real_log1p log1pf
#define real_expm1 expm1f
#define real_sinh sinhf
#define real_cosh coshf
#define real_tanh tanhf
#define real_sin sinf
#define real_cos cosf
#define real_power powf
#define real_tan tanf
#define real_atan atanf
#define real_asin asinf
#define real_acos acosf
#define real_erf erff
#define real_atan2 atan2f
#define real_fmod fmodf
#define real_hypot hypotf
#define REAL_LEAST 1e-37f
#else
#define real_sqrt sqrt
#define real_abs fabs
#define real_floor floor
#define real_ceil ceil
#define real_copysign copysign
#define real_tan tan
#define real_atan atan
#define real_asin asin
#define real_acos acos
#define real_erf erf
#define real_atan2 atan2
#define real_fmod fmod
#define real_hypot hypot
#define REAL_LEAST 1e-300

#define CAPSULE_ROUND 6755399441055744.0 /* 1.5 * 2^52: what is added to it is rounded to a whole number */
#define CAPSULE_LN2_HIGH 6.93147180369123816490e-01
#define CAPSULE_LN2_LOW 1.90821492927058770002e-10

CAPSULE_INLINE uint64_t bits_of(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

CAPSULE_INLINE double made_of(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* e^x; below -708 as at -708, above 709 as at 709 */
CAPSULE_INLINE double real_exp(double x)
{
    double whole, k, high, low, r, t, c;
    x = x > 709.0 ? 709.0 : x;
    x = x < -708.0 ? -708.0 : x;
    whole = x * 1.44269504088896338700e+00 + CAPSULE_ROUND;
    k = whole - CAPSULE_ROUND;
    high = x - k * CAPSULE_LN2_HIGH;
    low = k * CAPSULE_LN2_LOW;
    r = high - low;
    t = r * r;
    c = r - t * (1.66666666666666019037e-01
                 + t * (-2.77777777770155933842e-03
                        + t * (6.61375632143793436117e-05
                               + t * (-1.65339022054652515390e-06 + t * 4.13813679705723846039e-08))));
    return (1.0 - ((low - r * c / (2.0 - c)) - high)) * made_of((bits_of(whole) + 1023u) << 52);
}

/* ln x of a normal number; -inf at 0, NaN below it */
CAPSULE_INLINE double real_log(double x)
{
    /* the fraction lies between sqrt(1/2) and sqrt(2) */
    const uint64_t bits = bits_of(x), above = bits - 0x3FE6A09E667F3BCDu + ((uint64_t)1023 << 52);
    const uint64_t exponent = above >> 52; /* plus 1023 */
    const double f = made_of(bits - ((exponent - 1023u) << 52)) - 1.0;
    const double k = made_of(exponent - 1023u + 0x4338000000000000u) - CAPSULE_ROUND;
    const double s = f / (2.0 + f), z = s * s, half = 0.5 * f * f;
    const double sum = 6.666666666666735130e-01
        + z * (3.999999999940941908e-01
               + z * (2.857142874366239149e-01
                      + z * (2.222219843214978396e-01
                             + z * (1.818357216161805012e-01
                                    + z * (1.531383769920937332e-01 + z * 1.479819860511658591e-01)))));
    const double y = k * CAPSULE_LN2_HIGH - ((half - (s * (half + z * sum) + k * CAPSULE_LN2_LOW)) - f);
    const double of_positive = x < (double)INFINITY ? y : x;
    return x > 0.0 ? of_positive : (x == 0.0 ? -(double)INFINITY : (double)NAN);
}

/* ln(1 + x) for x > -1 */
CAPSULE_INLINE double real_log1p(double x)
{
    const double u = 1.0 + x;
    return real_log(u) + (x - (u - 1.0)) / u;
}

/* sinh x: the series near 0, where the exponentials cancel */
CAPSULE_INLINE double real_sinh(double x)
{
    const double e = real_exp(x), z = x * x;
    const double near = x + x * z * (1.0 / 6 + z * (1.0 / 120 + z * (1.0 / 5040 + z * (1.0 / 362880
        + z * (1.0 / 39916800 + z * (1.0 / 6227020800.0 + z * (1.0 / 1307674368000.0 + z / 355687428096000.0)))))));
    return z < 1.0 ? near : 0.5 * (e - 1.0 / e);
}

CAPSULE_INLINE double real_cosh(double x)
{
    const double e = real_exp(x);
    return 0.5 * (e + 1.0 / e);
}

CAPSULE_INLINE double real_tanh(double x)
{
    return real_sinh(x) / real_cosh(x);
}

CAPSULE_INLINE double real_expm1(double x)
{
    return 2.0 * real_sinh(0.5 * x) * real_exp(0.5 * x);
}

/* x^y for x >= 0; NaN for a negative x */
CAPSULE_INLINE double real_power(double x, double y)
{
    const double at_zero = y > 0.0 ? 0.0 : (y == 0.0 ? 1.0 : (double)INFINITY);
    const double of_positive = real_exp(y * real_log(x > 0.0 ? x : 1.0));
    return x > 0.0 ? of_positive : (x == 0.0 ? at_zero : (double)NAN);
}

/* sin(x + quarters pi/2), |x| < 8e5 rad */
CAPSULE_INLINE double real_turned(double x, unsigned quarters)
{
    const double whole = x * 6.36619772367581382433e-01 + CAPSULE_ROUND, k = whole - CAPSULE_ROUND;
    const double r = ((x - k * 1.57079632673412561417e+00) - k * 6.07710050630396597660e-11)
        - k * 2.02226624871116645580e-21;
    const double z = r * r;
    const double sine = r + r * z * (-1.66666666666666324348e-01
        + z * (8.33333333332248946124e-03
               + z * (-1.98412698298579493134e-04
                      + z * (2.75573137070700676789e-06
                             + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
    const double cosine = 1.0 - (0.5 * z - z * z * (4.16666666666666019037e-02
        + z * (-1.38888888888741095749e-03
               + z * (2.48015872894767294178e-05
                      + z * (-2.75573143513906633035e-07
                             + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))))));
    const uint64_t n = bits_of(whole) + quarters;
    const double y = (n & 1u) != 0u ? cosine : sine;
    return made_of(bits_of(y) ^ ((n & 2u) << 62));
}

CAPSULE_INLINE double real_sin(double x)
{
    return real_turned(x, 0u);
}

CAPSULE_INLINE double real_cos(double x)
{
    return real_turned(x, 1u);
}
#endif

CAPSULE_INLINE real real_sign(real x)
{
    return x > 0 ? R(1) : (x < 0 ? R(-1) : R(0));
}

/* `value` moved into [low, high]; NaN stays NaN */
CAPSULE_INLINE real within(real value, real low, real high)
{
    const real above = value < low ? low : value;
    return above > high ? high : above;
}

#endif
