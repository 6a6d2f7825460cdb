// Transfer curves over a flat run of samples, sixteen at a time. curves.py holds the formulas and says why they are
// written so.
//
// Definitions given at build time:
//   BODY      power | pq_decode | pq_encode | exponential | logarithm   the curve above its knee
//   TOE       linear | root | square                                    the curve below it
//   COVERAGE  0, or the number of channels, of which the last is coverage and passes as it is
//
// The numbers of a form arrive in `k`, in this order (`constants` in transfer.py):
enum { SHIFT, OFFSET, CLAMPED, TOE_SCALE, KNEE, FLOOR, INNER, LIFT, POWER_HIGH, POWER_LOW, OUTER, DROP, CEILING };

#define WIDTH 16
#define PQ_Q 0.1640625f
#define PQ_C3 18.6875f
#define PQ_LIMIT 1.9920601f

// ------------------------------------------------------------------------------------------------ powers

// log2 of m where x = m 2^e, m in [sqrt(1/2), sqrt(2)); x positive and finite, denormals are scaled up first.
// With s = (m - 1) / (m + 1) it is s P(s^2); P misses by 3e-9 (Lawson fit).
inline float16 log2_of_mantissa(float16 x, float16 *exponent)
{
    int16 small = x < 0x1p-126f;
    int16 bits = as_int16(select(x, x * 0x1p24f, small));
    int16 e = (bits - 0x3f3504f3) >> 23;
    *exponent = convert_float16(e) - select((float16)(0.0f), (float16)(24.0f), small);
    float16 f = as_float16(bits - (e << 23)) - 1.0f;
    float16 s = f / (f + 2.0f);
    float16 z = s * s;
    float16 p = fma(z, (float16)(0.42675658f), (float16)(0.57691592f));
    p = fma(z, p, (float16)(0.96179696f));
    return fma(s * z, p, s * 2.88539008f);
}

// 2^(whole + part), whole an integer and part a few units; infinity above, gradual underflow below. Fit: 2e-9.
inline float16 exp2_of_sum(float16 whole, float16 part)
{
    float16 r = rint(part);
    float16 f = part - r;
    float16 p = fma(f, (float16)(1.53458119e-4f), (float16)(1.33999312e-3f));
    p = fma(f, p, (float16)(9.61848896e-3f));
    p = fma(f, p, (float16)(5.55032878e-2f));
    p = fma(f, p, (float16)(0.240226469f));
    p = fma(f, p, (float16)(0.693147206f));
    p = fma(f, p, (float16)(1.0f));
    int16 e = convert_int16(clamp(whole + r, -252.0f, 252.0f));
    int16 lower = e >> 1;
    return p * as_float16((lower + 127) << 23) * as_float16((e - lower + 127) << 23);
}

// x^(high + low) for x >= 0 and a positive exponent. The exponent's product with the integer part of log2 x is split
// exactly, so the relative error does not grow with |log x|.
inline float16 raised(float16 x, float high, float low)
{
    float16 e;
    float16 l = log2_of_mantissa(x, &e);
    float16 whole = rint(e * high);
    float16 part = fma(e, (float16)(high), -whole) + fma(e, (float16)(low), l * high);
    float16 y = select(exp2_of_sum(whole, part), (float16)(0.0f), x <= 0.0f);
    return select(x, y, x < INFINITY);  // infinity and NaN stay
}

// ------------------------------------------------------------------------------------------------ bodies

inline float16 power(float16 a, global const float *k)
{
    float16 base = fma(a, (float16)(k[INNER]), (float16)(k[LIFT]));
    return fma(raised(base, k[POWER_HIGH], k[POWER_LOW]), (float16)(k[OUTER]), (float16)(k[DROP]));
}

inline float16 exponential(float16 a, global const float *k)
{
    float16 t = a - 0.5f;
    float16 whole = rint(t * k[POWER_HIGH]);
    whole = clamp(whole, -1000.0f, 1000.0f);
    float16 part = fma(t, (float16)(k[POWER_HIGH]), -whole) + t * k[POWER_LOW];
    part = select(part, (float16)(0.0f), fabs(part) > 1.0f);  // beyond the clamp, where the result is infinite
    float16 y = fma(exp2_of_sum(whole, part), (float16)(k[OUTER]), (float16)(k[DROP]));
    return select(a, y, a < INFINITY);
}

inline float16 logarithm(float16 a, global const float *k)
{
    float16 e;
    float16 base = fma(a, (float16)(k[INNER]), (float16)(k[LIFT]));
    float16 l = log2_of_mantissa(base, &e);
    float16 y = fma(l, (float16)(k[OUTER]), fma(e, (float16)(k[OUTER]), (float16)(k[DROP])));
    return select(a, y, a < INFINITY);
}

// Signal to light. w = expm1(ln N / m2); k[POWER_HIGH] is 1 / m1.
inline float16 pq_decode(float16 a, global const float *k)
{
    float16 n = select(a, (float16)(k[CEILING]), a > k[CEILING]);
    float16 e;
    float16 l = log2_of_mantissa(n, &e);
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
    return select(y, a, isnan(a));
}

// Light to signal. p = Y^m1, log2 N = (2 m2 / ln 2) atanh(s); k[POWER_HIGH] is m1.
inline float16 pq_encode(float16 a, global const float *k)
{
    float16 p = raised(a * k[INNER], k[POWER_HIGH], k[POWER_LOW]);
    float16 s = PQ_Q * (p - 1.0f) / fma(p, (float16)(2.0f * PQ_C3 + PQ_Q), (float16)(2.0f - PQ_Q));
    float16 z = s * s;  // at most 0.008
    float16 q = fma(z, (float16)(1.0f / 7.0f), (float16)(0.2f));
    q = fma(z, q, (float16)(1.0f / 3.0f));
    float16 exponent = fma(s * z, q, s) * 227.494974f;  // 2 m2 / ln 2
    float16 y = exp2_of_sum((float16)(0.0f), exponent);
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

// Everything around the curve: the shift, negative values, the toe and the coverage channel. `first_sample` counts from
// the picture's start.
inline float16 finished(float16 x, float16 a, float16 y, global const float *k, ulong first_sample)
{
    y = select(y, (float16)(k[FLOOR]), y < k[FLOOR]);
    y = select(y, TOE(a) * k[TOE_SCALE], a < k[KNEE]);
    int16 negative = x + k[SHIFT] < 0.0f;
    y = select(y, -y, negative && (int16)(k[CLAMPED] == 0.0f)) + k[OFFSET];
#if COVERAGE
    uint16 lane = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) + (uint)(first_sample % COVERAGE);
    y = select(y, x, lane % COVERAGE == COVERAGE - 1);
#endif
    return y;
}

// The distance from the curve's zero; clamped pictures have none below it.
inline float16 distance_from_zero(float16 x, global const float *k)
{
    float16 a = x + k[SHIFT];
    float16 below = k[CLAMPED] != 0.0f ? (float16)(0.0f) : -a;
    return select(a, below, a < 0.0f);
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
    float16 a = distance_from_zero(x, k);
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
    float16 a = distance_from_zero(x, k);
    store(finished(x, a, looked_up(a, k, nodes, first, last, shift), k, at), out, at, samples);
}
