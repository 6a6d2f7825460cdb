// Tone curves. operators.py holds the formulas: y = x (A x + B) / (x (C x + D) + E) for light x >= 0.
//
// Definitions: DEGREE 0 for y = x, 1 where C is 0, 2 otherwise; RISING 1 where A is not 0; CLAMPED 0 or 1; COVERAGE
// (flat.clh); CHANNELS of a sample, the first three colour where a kernel takes pixels.
// `k` holds A, B, C, D, E, the exposure's factor, three weights, and two 3 x 3 matrices by rows.

#include "flat.clh"
#include "numeric.clh"

enum { A, B, C, D, E, EXPOSURE, WEIGHTS, INTO = 9, OUT_OF = 18 };

// Beyond 1 numerator and denominator are divided by the denominator's highest power, so that nothing overflows.
#define TONE_CURVE(FLOATN)                                                                                             \
    FLAT_FN __attribute__((overloadable)) FLOATN curve(FLOATN x, global const float *restrict k)                       \
    {                                                                                                                  \
        if (DEGREE == 0)                                                                                               \
            return x;                                                                                                  \
        FLOATN r = 1.0f / x;                                                                                           \
        FLOATN near = x * (x * k[A] + k[B]) / (x * (x * k[C] + k[D]) + k[E]);                                          \
        FLOATN above = DEGREE == 2 ? r * k[B] + k[A] : RISING ? x * k[A] + k[B] : (FLOATN)(k[B]);                      \
        FLOATN below = DEGREE == 2 ? r * (r * k[E] + k[D]) + k[C] : r * k[E] + k[D];                                   \
        return x > 1.0f ? above / below : near;                                                                        \
    }
TONE_CURVE(float16)
TONE_CURVE(float)

// curve(x) / x, which needs no division by x.
FLAT_FN float gain(float x, global const float *restrict k)
{
    if (DEGREE == 0)
        return 1.0f;
    float r = 1.0f / x;
    float near = (x * k[A] + k[B]) / (x * (x * k[C] + k[D]) + k[E]);
    float above = DEGREE == 2 ? r * (r * k[B] + k[A]) : r * k[B] + k[A];
    float below = DEGREE == 2 ? r * (r * k[E] + k[D]) + k[C] : r * k[E] + k[D];
    return x > 1.0f ? above / below : near;
}

FLAT_FN float limited(float y)
{
    if (CLAMPED) {
        y = y < 0.0f ? 0.0f : y;
        y = y > 1.0f ? 1.0f : y;
    }
    return y;
}

// What exposure takes beyond the largest float stays there; an infinity stays infinite.
FLAT_FN float exposed(float x, float factor)
{
    float y = x * factor;
    return isinf(y) && !isinf(x) ? copysign(FLT_MAX, x) : y;
}

kernel void channels(global const float *restrict in, global float *restrict out, global const float *restrict k,
                     ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    float16 x = flat_load(in, at, samples);
    float16 light = x * k[EXPOSURE];
    float16 y = copysign(curve(fabs(light), k), light);
    y = x == x ? y : x;
    if (CLAMPED)
        y = num_clamp(y, (float16)(0.0f), (float16)(1.0f));
    flat_store(flat_keep_coverage(y, x, at), out, at, samples);
}

#define SEGMENT 64

kernel void luminance(global const float *restrict in, global float *restrict out, global const float *restrict k,
                      ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT, last = min(first + SEGMENT, pixels);
    for (ulong i = first; i < last; i++) {
        global const float *x = in + i * CHANNELS;
        global float *y = out + i * CHANNELS;
        float red = exposed(x[0], k[EXPOSURE]), green = exposed(x[1], k[EXPOSURE]), blue = exposed(x[2], k[EXPOSURE]);
        float light = (red < 0.0f ? 0.0f : red) * k[WEIGHTS] + (green < 0.0f ? 0.0f : green) * k[WEIGHTS + 1] +
                      (blue < 0.0f ? 0.0f : blue) * k[WEIGHTS + 2];
        float by = gain(light, k);
        y[0] = limited(red * by), y[1] = limited(green * by), y[2] = limited(blue * by);
        for (int c = 3; c < CHANNELS; c++)
            y[c] = x[c];
    }
}

// Into the space of the fit, through (x^2 + P x - Q) / (C x^2 + D x + E), and out of it. A, B are P, -Q here.
FLAT_FN float fitted(float x, global const float *restrict k)
{
    x = x < 0.0f ? 0.0f : x;
    float r = 1.0f / x;
    float near = (x * (x + k[A]) + k[B]) / (x * (x * k[C] + k[D]) + k[E]);
    float far = (r * (r * k[B] + k[A]) + 1.0f) / (r * (r * k[E] + k[D]) + k[C]);
    return x > 1.0f ? far : near;
}

kernel void fit(global const float *restrict in, global float *restrict out, global const float *restrict k,
                ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT, last = min(first + SEGMENT, pixels);
    for (ulong i = first; i < last; i++) {
        global const float *x = in + i * CHANNELS;
        global float *y = out + i * CHANNELS;
        global const float *m = k + INTO, *n = k + OUT_OF;
        float red = exposed(x[0], k[EXPOSURE]), green = exposed(x[1], k[EXPOSURE]), blue = exposed(x[2], k[EXPOSURE]);
        float u = fitted(red * m[0] + green * m[1] + blue * m[2], k);
        float v = fitted(red * m[3] + green * m[4] + blue * m[5], k);
        float w = fitted(red * m[6] + green * m[7] + blue * m[8], k);
        y[0] = limited(u * n[0] + v * n[1] + w * n[2]);
        y[1] = limited(u * n[3] + v * n[4] + w * n[5]);
        y[2] = limited(u * n[6] + v * n[7] + w * n[8]);
        for (int c = 3; c < CHANNELS; c++)
            y[c] = x[c];
    }
}
