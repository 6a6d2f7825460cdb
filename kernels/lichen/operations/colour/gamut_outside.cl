// What lies outside a gamut, in doubles, eight pixels at a time: the tests and quotients of gamut.py, bit for bit.
//
// Definitions given at build time:
//   IN        channels of a pixel, of which the first three are colours
//   TURNED    1 where `m`, rows of three, takes them to the gamut's primaries
//   PEAKED    1 where light above m[9] is outside too
//   SHOWN     1 where `out` becomes 1 for pixels outside and 0 for others
//
// A work-item takes `share` pixels and leaves in `parts` how many are outside by red, green, blue and any, and the
// largest distance, -1 where none is known. Of 2048 x 2048 RGB it takes as long as a copy.

#include "interleaved.clh"

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define LANES 8
#define FN static inline __attribute__((always_inline))

// Red, green and blue of `count` pixels; NaN, which is outside nothing and has no distance, in lanes beyond them.
FN void load(global const float *restrict in, int count, float8 *v)
{
    if (count == LANES && IN == 3)
        split3_eight(in, v, v + 1, v + 2);
    else if (count == LANES && IN == 4) {
        float8 rest;
        split4_eight(in, v, v + 1, v + 2, &rest);
    } else {
        float lanes[3][LANES];
        for (int c = 0; c < 3; c++)
            for (int i = 0; i < LANES; i++)
                lanes[c][i] = i < count ? in[i * IN + c] : NAN;
        for (int c = 0; c < 3; c++)
            v[c] = vload8(0, lanes[c]);
    }
}

// 1 in lanes that are outside, else 0: masks that are joined would be packed and unpacked.
FN double8 beyond(double8 v, double peak)
{
    double8 found = v < 0.0 ? (double8)(1.0) : (double8)(0.0);
#if PEAKED
    found = v > peak ? (double8)(1.0) : found;
#endif
    return found;
}

FN double8 larger(double8 a, double8 b) { return a > b ? a : b; }

FN double8 smaller(double8 a, double8 b) { return a < b ? a : b; }

FN double sum_of(double8 v)
{
    double4 a = v.lo + v.hi;
    double2 b = a.lo + a.hi;
    return b.x + b.y;
}

kernel void outside(global const float *restrict in, global float *restrict out, global double *restrict parts,
                    global const double *restrict m, int pixels, int share)
{
    int part = get_global_id(0), first = part * share, end = min(pixels - first, share) + first;
    if (first >= pixels)
        return;
    double8 red = 0.0, green = 0.0, blue = 0.0, any = 0.0, farthest = -1.0;
    for (int at = first; at < end; at += LANES) {
        int count = min(end - at, LANES);
        float8 v[3];
        load(in + (size_t)at * IN, count, v);
        double8 r = convert_double8(v[0]), g = convert_double8(v[1]), b = convert_double8(v[2]);
#if TURNED
        double8 x = r, y = g, z = b;
        r = (x * m[0] + y * m[1]) + z * m[2];
        g = (x * m[3] + y * m[4]) + z * m[5];
        b = (x * m[6] + y * m[7]) + z * m[8];
#endif
        double8 off_red = beyond(r, m[9]), off_green = beyond(g, m[9]), off_blue = beyond(b, m[9]);
        double8 off = larger(larger(off_red, off_green), off_blue);
        red += off_red;
        green += off_green;
        blue += off_blue;
        any += off;
        double8 top = larger(larger(r, g), b), low = smaller(smaller(r, g), b);
        double8 distance = top != 0.0 ? (top - low) / fabs(top) : (double8)(0.0);
        farthest = larger(distance + 0.0 * (r + g + b), farthest); // NaN, which is no larger, where one of them is not finite
#if SHOWN
        float8 shown = convert_float8(off);
        if (count == LANES)
            vstore8(shown, 0, out + at);
        else {
            float lanes[LANES];
            vstore8(shown, 0, lanes);
            for (int i = 0; i < count; i++)
                out[at + i] = lanes[i];
        }
#endif
    }
    double4 most = farthest.lo > farthest.hi ? farthest.lo : farthest.hi;
    double2 more = most.lo > most.hi ? most.lo : most.hi;
    parts += 5 * (size_t)part;
    parts[0] = sum_of(red);
    parts[1] = sum_of(green);
    parts[2] = sum_of(blue);
    parts[3] = sum_of(any);
    parts[4] = more.x > more.y ? more.x : more.y;
}
