// A conversion between colour spaces in one pass: sixteen pixels are split into planes, taken through every step in
// registers, and joined again. stages.py and coordinates.py define the steps and say where they come from.
//
// What bounds it is arithmetic, with polynomials too: of 2048 x 2048 pixels on two Zen 3 cores sRGB to PQ takes
// 8.5 ms at degree 5, where a copy takes 5.1, and 9.9 with planes one after the other. What lies beyond the polynomials
// or below zero is looked for in all planes at once and computed out of line, and the twelve roots of sixteen pixels keep
// one port for 60 cycles. Asking for lines 384 to 1536 floats ahead changed nothing, nor did two loops over 4 to 16
// sixteens, one up to the matrix and one from there.
//
// Definitions given at build time, beside those of planes.clh:
//   PATH    the steps as calls, each with the place of its numbers in k and with how many planes there are

#include "fitted.clh"
#include "numeric.clh"
#include "pq.clh"
#include "planes.clh"

#define STEP static inline __attribute__((always_inline))
#define BEND (6.0f / 29.0f)
#define GREY 0x1p-20f
#define COLOURLESS 1e-5f

// ------------------------------------------------------------------------------------------------ scalar functions

#define EACH(name, value)                                            \
    STEP void name(float16 *v, global const float *k, int planes)    \
    {                                                                \
        _Pragma("unroll") for (int c = 0; c < planes; c++) {         \
            float16 x = v[c], a = fabs(x);                           \
            v[c] = value;                                            \
        }                                                            \
    }

STEP float16 srgb_light(float16 a)
{
    float16 y = num_pow_12_5(fma(a, (float16)(1.0f / 1.055f), (float16)(0.055f / 1.055f)));
    return a <= 0.04045f ? a * (1.0f / 12.92f) : y;
}

STEP float16 srgb_signal(float16 a)
{
    float16 y = fma(num_pow_5_12(a), (float16)(1.055f), (float16)(-0.055f));
    return a <= 0.0031308f ? a * 12.92f : y;
}

STEP float16 bt2020_light(float16 a)
{
    float16 base = fma(a, (float16)(1.0f / 1.09929682680944f), (float16)(0.09929682680944f / 1.09929682680944f));
    return a < 4.5f * 0.018053968510807f ? a * (1.0f / 4.5f) : num_pow_fast(base, (float16)(1.0f / 0.45f));
}

STEP float16 bt2020_signal(float16 a)
{
    float16 y = fma(num_pow_fast(a, (float16)(0.45f)), (float16)(1.09929682680944f), (float16)(-0.09929682680944f));
    return a < 0.018053968510807f ? a * 4.5f : y;
}

#define PQ_CEILING 1.8396068f

// Signal to light, 1 at 203 cd/m2: w = expm1(ln N / m2), light ((q + w) / (q - c3 w))^(1/m1). See transfer's curves.py.
STEP float16 pq_light(float16 a)
{
    float16 n = a > PQ_CEILING ? (float16)(PQ_CEILING) : a;
    float16 v = num_log2(n) * 0.008791403f;  // ln 2 / m2
    v = v < -0.2f ? (float16)(-0.2f) : v;    // signal 1.4e-7, below black
    float16 p = fma(v, (float16)(1.0f / 5040.0f), (float16)(1.0f / 720.0f));
    p = fma(v, p, (float16)(1.0f / 120.0f));
    p = fma(v, p, (float16)(1.0f / 24.0f));
    p = fma(v, p, (float16)(1.0f / 6.0f));
    p = fma(v, p, (float16)(0.5f));
    float16 w = fma(v * v, p, v), above = PQ_Q + w;
    float16 ratio = above / fma(w, (float16)(-PQ_C3), (float16)(PQ_Q));
    float16 y = num_pow(ratio, (float16)(6.277394636f)) * 49.26108374f;
    y = above <= 0.0f ? (float16)(0.0f) : y;
    return a < INFINITY ? y : a;
}

// Light to signal; 203 cd/m2 are log2((203 / 10000)^m1).
STEP float16 pq_signal(float16 a) { return pq_of_light(a, -0.89565445f); }

// The cube root of x >= 0 without a division, as the powers of displays: x y^2 (1 - r)^(-2/3) with y near x^(-1/3).
// Denormals count as 0. [2^-120, 2^120]: 1.13 ULP, mean 0.29.
STEP float16 fast_cube_root(float16 x)
{
    float16 y = num_rough_root(x, -1.0f / 3.0f, 1419900544.0f), w = x * y * y;
    float16 r = fma(-w, y, (float16)(1.0f));
    float16 q = fma(r, (float16)(0x1.b6e9e4p-2f), (float16)(0x1.d58d3cp-2f));
    q = fma(r, q, (float16)(0x1.f9a73ap-2f));
    q = fma(r, q, (float16)(0x1.1c6f48p-1f));
    q = fma(r, q, (float16)(0x1.555556p-1f));
    float16 root = fma(w * r, q, w);
    root = x < FLT_MIN ? (float16)(0.0f) : root;
    return x == INFINITY ? x : root;
}

STEP float16 lightness_of(float16 t)
{
    float16 line = fma(t, (float16)(1.0f / (3.0f * BEND * BEND)), (float16)(4.0f / 29.0f));
    return t <= BEND * BEND * BEND ? line : fast_cube_root(t);
}

STEP float16 light_of(float16 f)
{
    return f <= BEND ? (3.0f * BEND * BEND) * (f - 4.0f / 29.0f) : f * f * f;
}

EACH(srgb_decode, copysign(srgb_light(a), x))
EACH(srgb_encode, copysign(srgb_signal(a), x))
EACH(bt2020_decode, copysign(bt2020_light(a), x))
EACH(bt2020_encode, copysign(bt2020_signal(a), x))
EACH(pq_decode, copysign(pq_light(a), x))
EACH(pq_encode, copysign(pq_signal(a), x))
EACH(power, copysign(num_pow_fast(a, (float16)(k[0])), x))
EACH(cube, x * x * x)
EACH(cube_root, copysign(fast_cube_root(a), x))
EACH(lightness, lightness_of(x))
EACH(lightness_inverse, light_of(x))

// The same as polynomials (fitted_steps.py): k holds their top, the end of the straight start and its slope, then theirs.
// They are odd: a sign is taken off and put back, where there may be one.
STEP void polynomials(float16 *v, global const float *k, int planes, int roots, int shift, int degree, int odd)
{
    float16 a[MOST_PLANES], y[MOST_PLANES];
    EACH_PLANE(c, planes) y[c] = a[c] = odd ? fabs(v[c]) : v[c];
    fitted(y, planes, k + 3, roots, shift, degree);
    if (roots < 2)
        EACH_PLANE(c, planes) y[c] = a[c] < k[1] ? a[c] * k[2] : y[c];
    EACH_PLANE(c, planes) v[c] = odd ? as_float16(as_int16(y[c]) ^ (as_int16(v[c]) & (int)0x80000000)) : y[c];
}

#define FITTED(exact, k, planes, roots, shift, degree)                  \
    if (fitted_all(v, planes, (k)[0]))                                  \
        polynomials(v, k, planes, roots, shift, degree, 0);             \
    else {                                                              \
        float16 w[4];                                                   \
        int16 far[4];                                                   \
        _Pragma("unroll") for (int c = 0; c < planes; c++) {            \
            w[c] = v[c];                                                \
            far[c] = !(fabs(v[c]) <= (k)[0]);                           \
        }                                                               \
        exact(w, k, planes);                                            \
        polynomials(v, k, planes, roots, shift, degree, 1);             \
        _Pragma("unroll") for (int c = 0; c < planes; c++)              \
            v[c] = far[c] ? w[c] : v[c];                                \
    }

// --------------------------------------------------------------------------------------------------------- matrices

// Rows of five numbers. Bit 5 row + c of `present` is set where that number is not zero: those alone take part.
STEP void linear(float16 *v, global const float *k, int planes, int rows, int present)
{
    float16 y[4];
#pragma unroll
    for (int row = 0; row < rows; row++) {
        float16 sum = (float16)(present >> (5 * row + 4) & 1 ? k[5 * row + 4] : 0.0f);
#pragma unroll
        for (int c = 0; c < planes; c++)
            if (present >> (5 * row + c) & 1)
                sum = fma(v[c], (float16)(k[5 * row + c]), sum);
        y[row] = sum;
    }
#pragma unroll
    for (int row = 0; row < rows; row++)
        v[row] = y[row];
}

// ------------------------------------------------------------------------------------------- changes of coordinates

STEP float16 quotient(float16 a, float16 b, float16 otherwise)
{
    int16 none = fabs(b) < FLT_MIN;
    return none ? 0.0f * a + otherwise : a / (none ? (float16)(1.0f) : b);
}

STEP float16 in_turn(float16 hue)
{
    float16 turn = fma(floor(hue * (1.0f / 360.0f)), (float16)(-360.0f), hue);
    if (any(fabs(hue) > 9e7f))
        turn = fabs(hue) > 9e7f ? fmod(hue, (float16)(360.0f)) : turn;
    turn = turn < 0.0f ? turn + 360.0f : turn;
    return turn >= 360.0f ? turn - 360.0f : turn;
}

STEP void to_xyy(float16 *v, global const float *k, int planes)
{
    float16 x = v[0], y = v[1], total = v[0] + v[1] + v[2];
    v[0] = quotient(x, total, (float16)(k[0]));
    v[1] = quotient(y, total, (float16)(k[1]));
    v[2] = y;
}

STEP void from_xyy(float16 *v, global const float *k, int planes)
{
    float16 x = v[0], y = v[1], light = v[2], scale = quotient(light, y, (float16)(0.0f));
    v[0] = x * scale;
    v[1] = light;
    v[2] = (1.0f - x - y) * scale;
}

STEP void to_luv(float16 *v, global const float *k, int planes)
{
    float16 x = v[0], y = v[1], total = fma(y, (float16)(15.0f), fma(v[2], (float16)(3.0f), x));
    float16 f = y <= BEND * BEND * BEND ? y * (116.0f / (3.0f * BEND * BEND)) : fma(fast_cube_root(y), (float16)(116.0f), (float16)(-16.0f));
    v[0] = f;
    v[1] = 13.0f * f * (quotient(4.0f * x, total, (float16)(k[0])) - k[0]);
    v[2] = 13.0f * f * (quotient(9.0f * y, total, (float16)(k[1])) - k[1]);
}

STEP void from_luv(float16 *v, global const float *k, int planes)
{
    float16 l = v[0], f = (l + 16.0f) * (1.0f / 116.0f);
    float16 y = f <= BEND ? l * (3.0f * BEND * BEND / 116.0f) : f * f * f;
    float16 u1 = quotient(v[1], 13.0f * l, (float16)(0.0f)) + k[0];
    float16 v1 = quotient(v[2], 13.0f * l, (float16)(0.0f)) + k[1];
    float16 scale = quotient(y, 4.0f * v1, (float16)(0.0f));
    v[0] = 9.0f * u1 * scale;
    v[1] = y;
    v[2] = (12.0f - 3.0f * u1 - 20.0f * v1) * scale;
}

STEP void to_polar(float16 *v, global const float *k, int planes)
{
    float16 a = v[1], b = v[2], u = fabs(a), w = fabs(b);
    float16 larger = u > w ? u : w, ratio = quotient(u > w ? w : u, larger, (float16)(0.0f));
    float16 chroma = larger * sqrt(fma(ratio, ratio, (float16)(1.0f)));
    chroma = larger < INFINITY ? chroma : larger;
    float16 hue = num_atan2(b, a) * 57.2957795f;
    hue = hue < 0.0f ? hue + 360.0f : hue;
    int16 none = (chroma <= COLOURLESS * fmax(fabs(v[0]), k[0])) | (hue >= 360.0f);
    none |= chroma * fma(v[0], v[0], chroma * chroma) <= k[1];
    v[1] = chroma + 0.0f * ratio;
    v[2] = none ? (float16)(0.0f) : hue;
}

STEP void from_polar(float16 *v, global const float *k, int planes)
{
    float16 half_turns = in_turn(v[2]) * (1.0f / 180.0f), chroma = v[1];
    v[1] = chroma * num_cospi(half_turns);
    v[2] = chroma * num_sinpi(half_turns);
}

STEP float16 hue_of(float16 r, float16 g, float16 b, float16 top, float16 range)
{
    int16 none = range <= GREY * fmax(fabs(top), 1.0f);
    float16 inverse = 60.0f / (none ? (float16)(1.0f) : range);
    float16 hue = top == r ? (g - b) * inverse
                           : (top == g ? fma(b - r, inverse, (float16)(120.0f)) : fma(r - g, inverse, (float16)(240.0f)));
    hue = hue < 0.0f ? hue + 360.0f : hue;
    return (none | (hue >= 360.0f)) ? 0.0f * range : hue;
}

STEP void to_hsv(float16 *v, global const float *k, int planes)
{
    float16 r = v[0], g = v[1], b = v[2];
    float16 top = num_max(num_max(r, g), b), range = top - num_min(num_min(r, g), b);
    v[0] = hue_of(r, g, b, top, range);
    v[1] = quotient(range, top, (float16)(0.0f));
    v[2] = top;
}

STEP float16 below(float16 hue, float n)
{
    float16 at = fma(hue, (float16)(1.0f / 60.0f), (float16)(n));
    at = at >= 6.0f ? at - 6.0f : at;
    float16 y = at < 4.0f - at ? at : 4.0f - at;
    y = y > 1.0f ? (float16)(1.0f) : y;
    return y < 0.0f ? (float16)(0.0f) : y;
}

STEP void sectors(float16 *v, float16 hue, float16 top, float16 range)
{
    hue = in_turn(hue);
    v[0] = fma(-range, below(hue, 5.0f), top);
    v[1] = fma(-range, below(hue, 3.0f), top);
    v[2] = fma(-range, below(hue, 1.0f), top);
}

STEP void from_hsv(float16 *v, global const float *k, int planes) { sectors(v, v[0], v[2], v[2] * v[1]); }

STEP void to_hsl(float16 *v, global const float *k, int planes)
{
    float16 r = v[0], g = v[1], b = v[2];
    float16 top = num_max(num_max(r, g), b), low = num_min(num_min(r, g), b);
    float16 room = top + low < 1.0f ? top + low : (1.0f - top) + (1.0f - low);
    v[0] = hue_of(r, g, b, top, top - low);
    v[1] = quotient(top - low, room, (float16)(0.0f));
    v[2] = fma(top, (float16)(0.5f), low * 0.5f);
}

STEP void from_hsl(float16 *v, global const float *k, int planes)
{
    float16 l = v[2], range = v[1] * (l < 0.5f ? 2.0f * l : 2.0f * (1.0f - l));
    sectors(v, v[0], fma(range, (float16)(0.5f), l), range);
}

STEP void to_cmyk(float16 *v, global const float *k, int planes)
{
    float16 top = num_max(num_max(v[0], v[1]), v[2]);
    for (int c = 0; c < 3; c++)
        v[c] = quotient(top - v[c], top, (float16)(0.0f));
    v[3] = 1.0f - top;
}

STEP void from_cmyk(float16 *v, global const float *k, int planes)
{
    float16 rest = 1.0f - v[3];
    for (int c = 0; c < 3; c++)
        v[c] = (1.0f - v[c]) * rest;
}

kernel void convert(global const float *restrict in, global float *restrict out, global const float *restrict k,
                    int pixels)
{
    int end = run_end(pixels);
    for (int first = run_start(); first < end; first += WIDTH) {
        int count = min(end - first, WIDTH);
        global const float *from = in + (size_t)first * IN;
        float16 v[4];
        load_planes(from, count, v);
        PATH
        store_planes(v, from, count, out + (size_t)first * OUT, pixels);
    }
}
