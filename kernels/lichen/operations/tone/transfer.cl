// Transfer curves over a flat run of samples, sixteen at a time. curves.py holds the formulas and says why they are
// written so.
//
// Definitions given at build time:
//   BODY      power | power_of_sum | sum_of_power | fifths_of_sum | sum_of_twelfths | pq_decode | pq_encode |
//             exponential | logarithm, the curve above its knee
//   TOE       linear | root | square, the curve below it
//   GAPPED    1 where the body is never below k[FLOOR], else 0
//   SHIFTED   1 where k[OFFSET] is to be added, else 0
//   CLAMPED   0 where negative values are mirrored, 1 where they are no light
//   COVERAGE  0, or the number of channels, of which the last is coverage and passes as it is
//
// The numbers of a form arrive in `k`, in the order of transfer.clh.

#include "lookup.clh"
#include "transfer.clh"

#define OWN(name) name
#include "transfer_ends.clh"

// ---------------------------------------------------------------------------------------------- the whole

// From the table; above its last node, and for NaN, computed.
static inline __attribute__((always_inline)) float16 looked_up(float16 a, global const float *k, global const float2 *table, int first, int last, int shift)
{
    float16 y = lookup(a, table, first, last, shift);
    int16 outside = as_int16(a) > last;
    return any(outside) ? select(y, BODY(a, k), outside) : y;
}

// Everything around the curve and the coverage channel. `at` is the first sample's place in the picture.
static inline __attribute__((always_inline)) float16 finished(float16 x, float16 a, float16 y, global const float *k, ulong at)
{
    y = ended(x, a, y, k);
#if COVERAGE
    uint16 lane = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) + (uint)(at % COVERAGE);
    y = select(y, x, lane % COVERAGE == COVERAGE - 1);
#endif
    return y;
}

static inline __attribute__((always_inline)) float16 load(global const float *in, ulong at, ulong samples)
{
    if (at + WIDTH <= samples)
        return vload16(0, in + at);
    float rest[WIDTH];
    for (int i = 0; i < WIDTH; i++)
        rest[i] = at + i < samples ? in[at + i] : 0.0f;
    return vload16(0, rest);
}

static inline __attribute__((always_inline)) void store(float16 y, global float *out, ulong at, ulong samples)
{
    if (at + WIDTH <= samples) {
        vstore16(y, 0, out + at);
        return;
    }
    float rest[WIDTH];
    vstore16(y, 0, rest);
    for (int i = 0; i < WIDTH && at + i < samples; i++)
        out[at + i] = rest[i];
}

kernel void exact(global const float *restrict in, global float *restrict out, global const float *restrict k,
                  ulong samples)
{
    ulong at = get_global_id(0) * (ulong)WIDTH;
    if (at >= samples)
        return;
    float16 x = load(in, at, samples);
    float16 a = distance(x + k[SHIFT]);
    store(finished(x, a, BODY(a, k), k, at), out, at, samples);
}

// `table` holds (value, rise to the next node): first the line below the first node, then the nodes, whose bit patterns
// run from `first` to `last` in steps of 2^shift.
kernel void table(global const float *restrict in, global float *restrict out, global const float *restrict k,
                  global const float2 *restrict nodes, int first, int last, int shift, ulong samples)
{
    ulong at = get_global_id(0) * (ulong)WIDTH;
    if (at >= samples)
        return;
    float16 x = load(in, at, samples);
    float16 a = distance(x + k[SHIFT]);
    store(finished(x, a, looked_up(a, k, nodes, first, last, shift), k, at), out, at, samples);
}
