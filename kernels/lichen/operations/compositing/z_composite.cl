// Of two pictures with depth, the nearer at every pixel; z_composite.py is the definition. Decisions are made in doubles.
//
// CHANNELS of both pictures, COVERAGE 1 where the last is coverage. TIE: 0 the image, 1 the base, 2 their mean, 3 the
// image over the base. DEPTH 1: the result is the depth of what is taken. OVER 1: what is farther shows through.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define SEGMENT 64

inline float part(float c, float f) { return f == 0.0f ? 0.0f : c * f; }

kernel void nearer(global const float *restrict image, global const float *restrict depth,
                   global const float *restrict base, global const float *restrict base_depth,
                   global float *restrict out, global const double *restrict n, ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT, last = min(first + SEGMENT, pixels);
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
}
