// Of two pictures with depth, the nearer at every pixel; z_composite.py is the definition. Decisions are made in doubles.
//
// CHANNELS of both pictures, COVERAGE 1 where the last is coverage. TIE: 0 the image, 1 the base, 2 their mean, 3 the
// image over the base. DEPTH 1: the result is the depth of what is taken. OVER 1: what is farther shows through.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#include "planes.clh"

#define SEGMENT 64

#if DEPTH || CHANNELS > 4
inline float part(float c, float f) { return f == 0.0f ? 0.0f : c * f; }
#else
#define ONE ((float16)(1.0f))

PLANE_FN float16 part(float16 c, float16 f) { return f == 0.0f ? (float16)(0.0f) : c * f; }

// Of eight pixels: whether the image is taken, and whether it is a tie.
PLANE_FN void decided(float8 depth, float8 base_depth, double scale, double bias, double tolerance, double sign,
                      int8 *top, int8 *tie)
{
    double8 own = convert_double8(depth) * scale + bias, other = convert_double8(base_depth);
    double8 apart = (own - other) * sign;
    long8 none = own != own, nothing = other != other;
    long8 image_first = (nothing & ~none) | (apart < -tolerance), base_first = (none & ~nothing) | (apart > tolerance);
    *tie = convert_int8(~image_first & ~base_first);
    *top = TIE == 1 ? convert_int8(image_first) : convert_int8(image_first) | *tie;
}

// Sixteen pixels or fewer.
PLANE_FN void taken(global const float *restrict image, float16 depth, global const float *restrict base,
                    float16 base_depth, global float *restrict out, global const double *restrict n, int count,
                    ulong pixels)
{
    int8 top[2], ties[2];
    decided(depth.lo, base_depth.lo, n[0], n[1], n[2], n[3], &top[0], &ties[0]);
    decided(depth.hi, base_depth.hi, n[0], n[1], n[2], n[3], &top[1], &ties[1]);
    int16 first = (int16)(top[0], top[1]), tie = (int16)(ties[0], ties[1]);
    float16 x[4], y[4];
    planes_load(image, CHANNELS, CHANNELS, count, x);
    planes_load(base, CHANNELS, CHANNELS, count, y);
    float16 through = ONE - (COVERAGE ? (first ? x[CHANNELS - 1] : y[CHANNELS - 1]) : ONE);
    for (int c = 0; c < CHANNELS; c++) {
        float16 a = first ? x[c] : y[c], mean = 0.5f * x[c] + 0.5f * y[c];
        float16 over = a + part(first ? y[c] : x[c], through);
#if OVER
        a = over;
#elif TIE == 3
        a = tie ? over : a;
#endif
#if TIE == 2
        a = tie ? mean : a;
#endif
        x[c] = a;
    }
    planes_stream(x, out, CHANNELS, count, pixels);
}
#endif

kernel void nearer(global const float *restrict image, global const float *restrict depth,
                   global const float *restrict base, global const float *restrict base_depth,
                   global float *restrict out, global const double *restrict n, ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT, last = min(first + SEGMENT, pixels);
#if !DEPTH && CHANNELS <= 4
    for (ulong i = first; i < last; i += LANES) {
        int count = (int)min(last - i, (ulong)LANES);
        float16 own = plane_load(depth + i, 1, 0, count), other = plane_load(base_depth + i, 1, 0, count);
        taken(image + i * CHANNELS, own, base + i * CHANNELS, other, out + i * CHANNELS, n, count, pixels);
    }
#else
    double scale = n[0], bias = n[1], tolerance = n[2], sign = n[3];
    for (ulong i = first; i < last; i++) {
        double own = depth[i] * scale + bias, other = base_depth[i], apart = (own - other) * sign;
        bool none = own != own, nothing = other != other;
        bool image_first = (nothing && !none) || apart < -tolerance, base_first = (none && !nothing) || apart > tolerance;
        bool tie = !image_first && !base_first;
        bool top = image_first || (tie && TIE != 1);
#if DEPTH
        double nearest = (own < other) == (sign > 0.0) ? own : other;
        out[i] = (float)(image_first ? own : (base_first ? other : (none ? own : (TIE == 0 ? own : (TIE == 1 ? other : nearest)))));
#else
        global const float *x = image + i * CHANNELS, *y = base + i * CHANNELS;
        bool over = OVER ? !(tie && TIE == 2) : tie && TIE == 3;
        float above = top ? (COVERAGE ? x[CHANNELS - 1] : 1.0f) : (COVERAGE ? y[CHANNELS - 1] : 1.0f);
        for (int c = 0; c < CHANNELS; c++) {
            float mean = 0.5f * x[c] + 0.5f * y[c], a = top ? x[c] : y[c], b = top ? y[c] : x[c];
            out[i * CHANNELS + c] = over ? a + part(b, 1.0f - above) : (tie && TIE == 2 ? mean : a);
        }
#endif
    }
#endif
}
