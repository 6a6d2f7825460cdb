// Transfer curves of several pieces over a flat run of samples. piecewise.py and bodies.py say what the pieces are and why
// they are computed so.
//
// Definitions given at build time, beside COVERAGE of flat.clh:
//   PIECES     the pieces as calls of piecewise.clh; each but the first chosen from where it starts
//   MIRRORED   1 where the pieces are of the distance from a centre
//   HELD       1 where negative samples are none, 2 where negative results are none, else 0
//   LOWER      the pieces below a table, and
//   FLAT       1 where they are lines and constants, 0 where what lies there is computed like the rest; for `table` alone
//   CHANNELS   of a sample; for `powers` alone
//
// `k` holds the centre, as -x0 in two parts and y0, then the pieces' numbers.

#include "flat.clh"
#include "lookup.clh"
#include "piecewise.clh"

// ---------------------------------------------------------------------------------------------------- the whole

// The distance from the centre, and in *away the same with its sign; without a centre the sample itself.
inline float16 distance_of(float16 x, float16 *away, global const float *k)
{
#if HELD == 1
    x = x < 0.0f ? (float16)(0.0f) : x;
#endif
    *away = x;
#if MIRRORED
    *away = (x + k[0]) + k[1];
    x = fabs(*away);
#endif
    return x;
}

inline float16 ended(float16 y, float16 away, global const float *k)
{
#if MIRRORED
    y = as_float16(as_int16(y) ^ (as_int16(away) & (int)0x80000000)) + k[2];
#endif
#if HELD == 2
    y = y < 0.0f ? (float16)(0.0f) : y;
#endif
    return y;
}

kernel void curve(global const float *restrict in, global float *restrict out, global const float *restrict k,
                  ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    float16 x = flat_load(in, at, samples), y, away;
    float16 a = distance_of(x, &away, k);
    PIECES
    flat_store(flat_keep_coverage(ended(y, away, k), x, at), out, at, samples);
}

#ifdef LOWER
// Looked up from `knee` to the table's last node; what lies beyond, and NaN, is computed where there is any.
kernel void table(global const float *restrict in, global float *restrict out, global const float *restrict k,
                  global const float2 *restrict nodes, int first, int last, int shift, float knee, ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    float16 x = flat_load(in, at, samples), y, away;
    float16 a = distance_of(x, &away, k);
    float16 found = lookup(a, nodes, first, last, shift);
    int16 low = a < knee, rest = !(a <= as_float(last));
#if FLAT
    LOWER
    found = low ? y : found;
#else
    rest |= low;
#endif
    if (any(rest)) {
        PIECES
        found = rest ? y : found;
    }
    flat_store(flat_keep_coverage(ended(found, away, k), x, at), out, at, samples);
}
#endif

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
