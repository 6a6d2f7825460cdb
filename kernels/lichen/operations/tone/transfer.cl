// Transfer curves over a flat run of samples, sixteen at a time. curves.py holds the formulas and says why they are
// written so.
//
// Definitions given at build time:
//   BODY      power | power_of_sum | sum_of_power | pq_decode | pq_encode | exponential | logarithm
//             the curve above its knee
//   TOE       linear | root | square, the curve below it
//   GAPPED    1 where the body is never below k[FLOOR], else 0
//   SHIFTED   1 where k[OFFSET] is to be added, else 0
//   CLAMPED   0 where negative values are mirrored, 1 where they are no light
//   COVERAGE  0, or the number of channels, of which the last is coverage and passes as it is
//
// The numbers of a form arrive in `k`, in this order (`constants` in transfer.py):
enum { SHIFT, OFFSET, TOE_SCALE, KNEE, FLOOR, INNER, LIFT, POWER_HIGH, POWER_LOW, OUTER, DROP, CEILING };

#include "numeric.clh"

#define WIDTH 16
#define PQ_Q 0.1640625f
#define PQ_C3 18.6875f
#define PQ_LIMIT 1.9920601f

// ------------------------------------------------------------------------------------------------ powers

// log2 m for m in [sqrt(1/2), sqrt(2)), relative error 2^-25.1 (reweighted least squares, rounded from the lowest
// order up). Relative also next to m = 1, on which the PQ quotient depends.
inline float16 log2_of_fraction(float16 m)
{
    float16 f = m - 1.0f;
    float16 q = fma(f, (float16)(0x1.01ba3cp-3f), (float16)(-0x1.a78034p-3f));
    q = fma(f, q, (float16)(0x1.b94dfap-3f));
    q = fma(f, q, (float16)(-0x1.e9809ep-3f));
    q = fma(f, q, (float16)(0x1.26dd48p-2f));
    q = fma(f, q, (float16)(-0x1.715b7ep-2f));
    q = fma(f, q, (float16)(0x1.ec7366p-2f));
    q = fma(f, q, (float16)(-0x1.715472p-1f));
    q = fma(f, q, (float16)(0x1.715476p+0f));
    return f * q;
}

// 2^(whole + part), whole an integer in [-126, 129], |part| at most a half and a little. Half the power is in the
// polynomial's last factor, so that results up to the largest float are reached; below 2^-126 they are 0.
inline float16 exp2_of_sum(int16 whole, float16 part)
{
    return (num_exp2_core(part) * 2.0f) * as_float16((whole + 126) << 23);
}

// x^(high + low) for normal x > 0 and a positive exponent, the result above 2^-126; infinity and NaN stay. The exponent's product with the integer
// part of log2 x is taken apart by fused steps, so the relative error does not grow with |log x|, and an exponent such
// as 1/2.4 keeps what float32 drops of it.
inline float16 raised_normal(float16 x, float high, float low)
{
    int16 bits = as_int16(x);
    int16 e = (bits - 0x3f3504f3) >> 23;
    float16 l = log2_of_fraction(as_float16(bits - (e << 23)));
    float16 integer = convert_float16(e);
    int16 n;
    float16 whole = num_nearest(fmin(fma(integer, (float16)(high), l * high), 129.0f), &n);
    float16 part = fma(l, (float16)(high), fma(integer, (float16)(low), fma(integer, (float16)(high), -whole)));
    return select(x, exp2_of_sum(n, part), x < INFINITY);
}

// The same for any x >= 0: zero and denormals too.
inline float16 raised(float16 x, float high, float low)
{
    float16 e;
    float16 l = log2_of_fraction(num_split(x, &e));
    int16 n;
    float16 whole = num_nearest(clamp(fma(e, (float16)(high), l * high), -126.0f, 129.0f), &n);
    float16 part = fma(l, (float16)(high), fma(e, (float16)(low), fma(e, (float16)(high), -whole)));
    float16 y = select(exp2_of_sum(n, part), (float16)(0.0f), x <= 0.0f);
    return select(x, y, x < INFINITY);
}

// ------------------------------------------------------------------------------------------------ bodies

// Beside a toe the base is a normal number wherever the body counts. Decoding adds before the power, encoding after it.
inline float16 power_of_sum(float16 a, global const float *k)
{
    return raised_normal(fma(a, (float16)(k[INNER]), (float16)(k[LIFT])), k[POWER_HIGH], k[POWER_LOW]);
}

inline float16 sum_of_power(float16 a, global const float *k)
{
    return fma(raised_normal(a, k[POWER_HIGH], k[POWER_LOW]), (float16)(k[OUTER]), (float16)(k[DROP]));
}

inline float16 power(float16 a, global const float *k)
{
    return raised(a * k[INNER], k[POWER_HIGH], k[POWER_LOW]) * k[OUTER];
}

inline float16 exponential(float16 a, global const float *k)
{
    float16 t = a - 0.5f;
    int16 n;
    float16 whole = num_nearest(clamp(t * k[POWER_HIGH], -122.0f, 133.0f), &n);
    float16 part = fma(t, (float16)(k[POWER_LOW]), fma(t, (float16)(k[POWER_HIGH]), -whole));
    // The factor is small: 16 of it are taken first, or the power would leave float's range before the result does.
    float16 y = fma(exp2_of_sum(n - 4, part), (float16)(16 * k[OUTER]), (float16)(k[DROP]));
    return select(a, select((float16)(INFINITY), y, whole < 133.0f), a < INFINITY);
}

inline float16 logarithm(float16 a, global const float *k)
{
    float16 e;
    float16 l = log2_of_fraction(num_split(fma(a, (float16)(k[INNER]), (float16)(k[LIFT])), &e));
    float16 y = fma(l, (float16)(k[OUTER]), fma(e, (float16)(k[OUTER]), (float16)(k[DROP])));
    return select(a, y, a < INFINITY);
}

// Signal to light. w = expm1(ln N / m2); k[POWER_HIGH] is 1 / m1.
inline float16 pq_decode(float16 a, global const float *k)
{
    float16 n = select(a, (float16)(k[CEILING]), a > k[CEILING]);
    float16 e;
    float16 l = log2_of_fraction(num_split(n, &e));
    float16 v = (e + l) * 0.008791403f;  // ln 2 / m2
    v = select(v, (float16)(-0.2f), v < -0.2f);  // signal 1.4e-7, below black
    float16 p = fma(v, (float16)(1.0f / 5040.0f), (float16)(1.0f / 720.0f));
    p = fma(v, p, (float16)(1.0f / 120.0f));
    p = fma(v, p, (float16)(1.0f / 24.0f));
    p = fma(v, p, (float16)(1.0f / 6.0f));
    p = fma(v, p, (float16)(0.5f));
    float16 w = fma(v * v, p, v);
    float16 above = PQ_Q + w;
    float16 ratio = above / fma(w, (float16)(-PQ_C3), (float16)(PQ_Q));
    float16 y = raised(ratio, k[POWER_HIGH], k[POWER_LOW]) * k[OUTER];
    y = select(y, (float16)(0.0f), above <= 0.0f);
    return select(a, y, a < INFINITY);
}

// Light to signal. p = Y^m1, log2 N = (2 m2 / ln 2) atanh(s); k[POWER_HIGH] is m1 and k[INNER] the power of the factor
// between light and Y, since the product itself could be lost among the denormals.
inline float16 pq_encode(float16 a, global const float *k)
{
    float16 p = raised(a, k[POWER_HIGH], k[POWER_LOW]) * k[INNER];
    float16 s = PQ_Q * (p - 1.0f) / fma(p, (float16)(2.0f * PQ_C3 + PQ_Q), (float16)(2.0f - PQ_Q));
    float16 z = s * s;  // at most 0.008
    float16 q = fma(z, (float16)(1.0f / 7.0f), (float16)(0.2f));
    q = fma(z, q, (float16)(1.0f / 3.0f));
    float16 exponent = fma(s * z, q, s) * 227.494974f;  // 2 m2 / ln 2
    int16 n;
    float16 whole = num_nearest(exponent, &n);
    float16 y = exp2_of_sum(n, exponent - whole);
    y = select(y, (float16)(PQ_LIMIT), a == INFINITY);
    return select(y, a, isnan(a));
}

// -------------------------------------------------------------------------------------------------- toes

inline float16 linear(float16 a) { return a; }
inline float16 root(float16 a) { return sqrt(a); }
inline float16 square(float16 a) { return a * a; }

// ---------------------------------------------------------------------------------------------- the whole

// Interpolates between 2^(23 - shift) nodes per binade of `a`: the index is the leading bits of the number itself. Below
// the first node the line goes to the curve's value at zero; above the last one, and for NaN, the curve is computed.
inline float16 looked_up(float16 a, global const float *k, global const float2 *table, int first, int last, int shift)
{
    int16 bits = as_int16(a);
    int16 at = max((bits - first) >> shift, 0);
    at = min(at, (last - first) >> shift);
    int16 cell = (at << shift) + first;
    float16 part = convert_float16(bits - cell) * as_float((127 - shift) << 23);
    float value[WIDTH], rise[WIDTH];
    int index[WIDTH];
    vstore16(at, 0, index);
    for (int i = 0; i < WIDTH; i++) {
        value[i] = table[index[i] + 1].x;
        rise[i] = table[index[i] + 1].y;
    }
    float16 y = fma(part, vload16(0, rise), vload16(0, value));
    y = select(y, fma(a, (float16)(table[0].y), (float16)(table[0].x)), bits < first);
    int16 outside = bits > last;
    return any(outside) ? select(y, BODY(a, k), outside) : y;
}

// The distance from the curve's zero; clamped pictures have none below it.
inline float16 distance(float16 shifted)
{
    return CLAMPED ? select(shifted, (float16)(0.0f), shifted < 0.0f) : fabs(shifted);
}

// Everything around the curve: the gap's floor, the toe, the sign, the offset and the coverage channel. `at` is the first
// sample's place in the picture.
inline float16 finished(float16 x, float16 a, float16 y, global const float *k, ulong at)
{
    if (GAPPED)
        y = select(y, (float16)(k[FLOOR]), y < k[FLOOR]);
    y = select(y, TOE(a) * k[TOE_SCALE], a < k[KNEE]);
    if (!CLAMPED)
        y = as_float16(as_int16(y) ^ (as_int16(x + k[SHIFT]) & (int)0x80000000));
    if (SHIFTED)
        y = y + k[OFFSET];
#if COVERAGE
    uint16 lane = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) + (uint)(at % COVERAGE);
    y = select(y, x, lane % COVERAGE == COVERAGE - 1);
#endif
    return y;
}

inline float16 load(global const float *in, ulong at, ulong samples)
{
    if (at + WIDTH <= samples)
        return vload16(0, in + at);
    float rest[WIDTH];
    for (int i = 0; i < WIDTH; i++)
        rest[i] = at + i < samples ? in[at + i] : 0.0f;
    return vload16(0, rest);
}

inline void store(float16 y, global float *out, ulong at, ulong samples)
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
