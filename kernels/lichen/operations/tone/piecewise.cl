// Transfer curves of several pieces over a flat run of samples. piecewise.py and bodies.py say what the pieces are and why
// they are computed so.
//
// Definitions given at build time, beside COVERAGE of flat.clh:
//   PIECES     the pieces as calls of piecewise.clh; each but the first chosen from where it starts
//   MIRRORED   1 where the pieces are of the distance from a centre
//   HELD       1 where negative samples are none, 2 where negative results are none, else 0
//   CHANNELS   of a sample; for `powers` alone
//
// `k` holds the centre, as -x0 in two parts and y0, then the pieces' numbers.

#include "flat.clh"
#include "piecewise.clh"

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
