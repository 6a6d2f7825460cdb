// Colours brought into a gamut, sixteen pixels at a time; gamut.py says how and why.
//
// Definitions given at build time, beside those of planes.clh:
//   ACTION    0 clip, 1 compress, 2 expand
//   TURNED    1 where the gamut's primaries are not the picture's: then there are matrices
//   PEAKED    1 where light above k[PEAK] is out of the gamut too
// `k` holds the matrix there and the matrix back, rows of three, then:
enum { PEAK = 18, POWER, LAST, SLOPE = LAST + 3, THRESHOLD = SLOPE + 3, SCALE = THRESHOLD + 3 };

#include "numeric.clh"
#include "planes.clh"

#define FARTHEST 4.0f
#define GAMUT_FN static inline __attribute__((always_inline))
#define EACH_CHANNEL _Pragma("unroll") for (int c = 0; c < 3; c++)

GAMUT_FN void turned(float16 *v, global const float *m)
{
    float16 r = v[0], g = v[1], b = v[2];
    for (int row = 0; row < 3; row++)
        v[row] = fma(b, (float16)(m[3 * row + 2]), fma(g, (float16)(m[3 * row + 1]), r * m[3 * row]));
}

#if ACTION == 1
// f(d) = t + (d - t) / (1 + u^p)^(1/p) with u = (d - t) / s, written as s (1 + u^-p)^(-1/p) where u is large. The power
// a of what is at most 1 has a logarithm of either sign, and the root of 1 + a, within [1/2, 1], needs no exponent. Step
// by step for all channels, whose chains of operations then hide behind one another: 0.87 of the time.
GAMUT_FN void moved(const float16 *d, global const float *t, global const float *s, float p, float16 *y)
{
    float16 u[3], a[3];
    int16 any = 0;
    EACH_CHANNEL
    {
        u[c] = (d[c] - t[c]) * (1.0f / s[c]);
        any |= u[c] > 0.0f;
        y[c] = d[c];
    }
    if (!mask_any(any))
        return;
    EACH_CHANNEL
    {
        int16 bits = as_int16(u[c]), exponent = (bits - 0x3f3504f3) >> 23, n;
        float16 m = as_float16(bits - (exponent << 23)), e = convert_float16(exponent);
        float16 q = (m - 1.0f) / (m + 1.0f), z = q * q, by = u[c] > 1.0f ? (float16)(-p) : (float16)(p);
        float16 share = by * fma(q * z, num_log2_tail(z), q * 0x1.715476p+1f), product = fma(by, e, share);
        float16 whole = num_nearest(product, &n), power = num_exp2_core(fma(by, e, -whole) + share);
        a[c] = product > -126.0f ? as_float16(as_int16(power) + (n << 23)) : (float16)(0.0f);
    }
    EACH_CHANNEL
    {
        int16 upper = a[c] > 0x1.a82798p-2f; // sqrt(2) - 1
        float16 above = upper ? a[c] - 1.0f : a[c], e = upper ? (float16)(1.0f) : (float16)(0.0f);
        float16 q = above / (a[c] + (upper ? (float16)(3.0f) : (float16)(2.0f))), z = q * q;
        float16 log = fma(q * z, num_log2_tail(z), fma(q, (float16)(0x1.715476p+1f), e));
        float16 root = num_exp2_core(fma(log, (float16)(-1.0f / p), (float16)(0.5f))) * 0x1.6a09e6p-1f;
        float16 bent = fma(root * (u[c] > 1.0f ? (float16)(1.0f) : u[c]), (float16)(s[c]), (float16)(t[c]));
        y[c] = u[c] > 0.0f ? bent : d[c];
    }
}
#else
// Its inverse, with powers by num_pow_fast, which errs more the larger its exponent p, and the root then divides that by p.
GAMUT_FN void moved(const float16 *d, global const float *t, global const float *s, float p, float16 *y)
{
    EACH_CHANNEL
    {
        float16 w = (d[c] - t[c]) * (1.0f / s[c]);
        int16 far = w > 0.0f;
        y[c] = d[c];
        if (mask_any(far)) {
            w = w < 0.0f ? (float16)(0.0f) : w;
            float16 root = num_pow_fast(1.0f - num_pow_fast(w, (float16)(p)), (float16)(-1.0f / p));
            y[c] = far ? fma(w * root, (float16)(s[c]), (float16)(t[c])) : d[c];
        }
    }
}
#endif

kernel void gamut(global const float *restrict in, global float *restrict out, global const float *restrict k, int pixels)
{
    int end = run_end(pixels);
    for (int first = run_start(); first < end; first += WIDTH) {
        int count = min(end - first, WIDTH);
        global const float *from = in + (size_t)first * IN;
        float16 v[4];
        load_planes(from, count, v);
#if TURNED
        turned(v, k);
#endif
#if ACTION == 0
        for (int c = 0; c < 3; c++) {
            v[c] = v[c] < 0.0f ? (float16)(0.0f) : v[c];
#if PEAKED
            v[c] = v[c] > k[PEAK] ? (float16)(k[PEAK]) : v[c];
#endif
        }
#else
        float16 top = num_max(num_max(v[0], v[1]), v[2]), size = fabs(top);
        float16 below[3], d[3], f[3];
        EACH_CHANNEL
        {
            below[c] = top - v[c];
            d[c] = below[c] / (size == 0.0f ? (float16)(1.0f) : size);
        }
        moved(d, k + THRESHOLD, k + SCALE, k[POWER], f);
        EACH_CHANNEL
        {
            float16 y = fma(-f[c], size, top);
#if ACTION == 2
            // Beyond the last distance the tangent goes on, without the quotient.
            float last = k[LAST + c], slope = k[SLOPE + c];
            float16 beyond = (top - size * FARTHEST) - slope * (below[c] - size * last);
            y = (d[c] > last) | (size == 0.0f) ? beyond : y;
#else
            y = size == 0.0f ? top : y;
#endif
            v[c] = below[c] == below[c] ? y : below[c];
        }
#endif
#if TURNED
        turned(v, k + 9);
#endif
        store_planes(v, from, count, out + (size_t)first * OUT, pixels);
    }
}
