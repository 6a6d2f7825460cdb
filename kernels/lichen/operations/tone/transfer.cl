// Transfer curves over a flat run of samples, sixteen at a time. curves.py holds the formulas and says why they are
// written so.
//
// Definitions given at build time:
//   BODY      power | power_of_sum | sum_of_power | fifths_of_sum | sum_of_twelfths | eleven_fifths |
//             pq_decode | pq_encode | exponential | logarithm, the curve above its knee
//   TOE       linear | root | square, the curve below it
//   GAPPED    1 where the body is never below k[FLOOR], else 0
//   MOVED     1 where k[SHIFT] is to be added first, which makes 0 of -0 too, else 0
//   SHIFTED   1 where k[OFFSET] is to be added, else 0
//   CLAMPED   0 where negative values are mirrored, 1 where they are no light
//   DEGREE    0, or that of the body as polynomials (fitted.clh), with
//   ROOTS, SHIFTED_BITS   of its places
//   COVERAGE  0, or the number of channels, of which the last is coverage and passes as it is
//
// The numbers of a form arrive in `k`, in the order of transfer.clh.

#include "flat.clh"
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
    return mask_any(outside) ? select(y, BODY(a, k), outside) : y;
}

kernel void exact(global const float *restrict in, global float *restrict out, global const float *restrict k,
                  ulong samples)
{
    ulong at = get_global_id(0) * (ulong)WIDTH;
    if (at >= samples)
        return;
    float16 x = flat_load(in, at, samples), y = x;
    curve(&y, 1, k);
    flat_store(flat_keep_coverage(y, x, at), out, at, samples);
}

// `table` holds (value, rise to the next node): first the line below the first node, then the nodes, whose bit patterns
// run from `first` to `last` in steps of 2^shift.
kernel void table(global const float *restrict in, global float *restrict out, global const float *restrict k,
                  global const float2 *restrict nodes, int first, int last, int shift, ulong samples)
{
    ulong at = get_global_id(0) * (ulong)WIDTH;
    if (at >= samples)
        return;
    float16 x = flat_load(in, at, samples), far = moved(x, k), a = distance(far);
    float16 y = ended(far, a, looked_up(a, k, nodes, first, last, shift), k, !CLAMPED);
    flat_store(flat_keep_coverage(y, x, at), out, at, samples);
}
