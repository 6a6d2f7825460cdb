// Transfer curves of several pieces over a flat run of samples. piecewise.py and bodies.py say what the pieces are and why
// they are computed so.
//
// Definitions given at build time, beside COVERAGE of flat.clh:
//   PIECES     the pieces as calls; each but the first chosen from where it starts
//   MIRRORED   1 where the pieces are of the distance from a centre
//   HELD       1 where negative samples are none, 2 where negative results are none, else 0
//   CHANNELS   of a sample; for `powers` alone
//
// `k` holds the centre, as -x0 in two parts and y0, then for each piece:
enum { HIGH, LOW, INNER, OUTER, DROP, EXPONENT, START, NUMBERS };

#include "flat.clh"
#include "numeric.clh"

#define CENTRE 3

// ------------------------------------------------------------------------------------------------------- bodies

FLAT_FN float16 body_line(float16 t, float e) { return t; }
FLAT_FN float16 body_log(float16 t, float e) { return num_log2(t); }
FLAT_FN float16 body_exp(float16 t, float e) { return num_exp2(t); }
FLAT_FN float16 body_power(float16 t, float e) { return num_pow_fast(t, (float16)(e)); }

#define POLYNOMIAL(x, ...)                                          \
    {                                                               \
        const double c[] = {__VA_ARGS__};                           \
        y = (double16)(c[sizeof(c) / sizeof(double) - 1]);          \
        for (int i = sizeof(c) / sizeof(double) - 2; i >= 0; i--)   \
            y = fma(y, x, (double16)(c[i]));                        \
    }

// JND index of luminance.
FLAT_FN float16 body_gsdf_signal(float16 t, float e)
{
    double16 x = convert_double16(num_log2(t)) * 0.30102999566398120, y;
    POLYNOMIAL(x, 71.498068, 94.593053, 41.912053, 9.8247004, 0.28175407, -1.1878455, -0.18014349, 0.14710899,
               -0.017046845)
    return convert_float16(y);
}

// Luminance of a JND index.
FLAT_FN float16 body_gsdf_light(float16 t, float e)
{
    double16 x = convert_double16(num_log(t)), y;
    POLYNOMIAL(x, -1.3011877, 0.080242636, 0.13646699, -0.025468404, 0.0013635334)
    double16 above = y;
    POLYNOMIAL(x, 1.0, -0.025840191, -0.10320229, 0.02874562, -0.0031978977, 0.00012992634)
    return num_exp2(convert_float16(above / y * 3.3219280948873623));
}

#define ROOTLOG 0.28257f

FLAT_FN float16 body_rootlog(float16 t, float e) { return fma(num_log(t), (float16)(ROOTLOG), sqrt(t)); }

// Newton's steps from above; six are enough for float.
FLAT_FN float16 body_rootlog_inverse(float16 z, float e)
{
    const float k = 2.0f * ROOTLOG;
    float16 low = num_min(z * (1.0f / k), (z - 1.0f) * (1.0f / (1.0f + k)));
    float16 u = z > 1.0f ? num_log(z) : low;
    for (int step = 0; step < 6; step++) {
        float16 power = num_exp(u);
        u -= (fma(u, (float16)(k), power) - z) / (power + k);
    }
    return fabs(z) < INFINITY ? num_exp(2.0f * u) : num_exp(z);
}

FLAT_FN float16 argument(float16 a, global const float *k)
{
    return ((a + k[HIGH]) + k[LOW]) * k[INNER];
}

#define PIECE(body, at) fma(body_##body(argument(a, k + at), k[at + EXPONENT]), (float16)(k[at + OUTER]), (float16)(k[at + DROP]))
#define LINE(at) (argument(a, k + at) + k[at + DROP])
#define CONSTANT(at) (a == a ? (float16)(k[at + DROP]) : a)
#define FROM(at, piece) y = a >= k[at + START] ? piece : y;

// ---------------------------------------------------------------------------------------------------- the whole

kernel void curve(global const float *restrict in, global float *restrict out, global const float *restrict k,
                  ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    float16 x = flat_load(in, at, samples), a = x, y;
#if HELD == 1
    a = a < 0.0f ? (float16)(0.0f) : a;
#endif
#if MIRRORED
    float16 away = (a + k[0]) + k[1];
    a = fabs(away);
#endif
    PIECES
#if MIRRORED
    y = as_float16(as_int16(y) ^ (as_int16(away) & (int)0x80000000)) + k[2];
#endif
#if HELD == 2
    y = y < 0.0f ? (float16)(0.0f) : y;
#endif
    flat_store(flat_keep_coverage(y, x, at), out, at, samples);
}

// A power of its own for each channel: `k` holds one run of CHANNELS + 16 exponents, over and over again, so that sixteen
// lanes read their own wherever a vector begins.
#ifdef CHANNELS
kernel void powers(global const float *restrict in, global float *restrict out, global const float *restrict k,
                   ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    float16 x = flat_load(in, at, samples);
    float16 y = num_pow(fabs(x), vload16(0, k + at % CHANNELS));
#if HELD
    y = x < 0.0f ? (float16)(0.0f) : y;
#else
    y = copysign(y, x);
#endif
    flat_store(flat_keep_coverage(y, x, at), out, at, samples);
}
#endif
