// A camera's depths as points, 64 pixels of a row to a work-item, sixteen at a time, in doubles; deproject.py is the
// definition, operation for operation. `kind`: 0 planar, 1 euclidean, 2 a window's, by `terms` s, a and b: s / (a + b d).

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#include "../compositing/planes.clh"

#define SEGMENT 64
#define DEPROJECT_FN static inline __attribute__((always_inline))

// The planar depths of eight pixels of a row.
DEPROJECT_FN double8 planar(double8 z, double8 x, double y, global const double *terms, int kind)
{
    if (kind == 1)
        return z / sqrt((1.0 + x * x) + y * y);
    if (kind == 2) {
        double8 below = terms[1] + terms[2] * z, made = terms[0] / below;
        return (below <= 0.0) | (made > (double)FLT_MAX) ? (double8)(INFINITY) : made;
    }
    return z;
}

// Eight points; of what is infinitely far all three numbers are infinite.
DEPROJECT_FN void points(float8 depth, double8 x, double y, global const double *terms, int kind, float8 *v)
{
    double8 z = planar(convert_double8(depth), x, y, terms, kind), far = fabs(z);
    long8 there = far != INFINITY;
    v[0] = convert_float8(there ? x * z : far);
    v[1] = convert_float8(there ? y * z : far);
    v[2] = convert_float8(there ? -z : far);
}

kernel void deproject(global const float *restrict depth, global float *restrict out, global const double *restrict terms,
                      global const double *restrict xs, global const double *restrict ys, int kind, int width, int height)
{
    int per_row = (width + SEGMENT - 1) / SEGMENT, row = (int)get_global_id(0) / per_row;
    if (row >= height)
        return;
    int begin = ((int)get_global_id(0) % per_row) * SEGMENT, end = min(begin + SEGMENT, width);
    double y = ys[row];
    for (int column = begin; column < end; column += 16) {
        size_t at = (size_t)row * width + column;
        int count = min(end - column, 16);
        double8 low = (double8)(0.0), high = low;
        if (count == 16) {
            low = vload8(0, xs + column);
            high = vload8(1, xs + column);
        } else {
            double each[16];
            for (int i = 0; i < 16; i++)
                each[i] = i < count ? xs[column + i] : 0.0;
            low = vload8(0, each);
            high = vload8(1, each);
        }
        float16 d = plane_load(depth + at, 1, 0, count), v[3];
        float8 left[3], right[3];
        points(d.lo, low, y, terms, kind, left);
        points(d.hi, high, y, terms, kind, right);
        for (int c = 0; c < 3; c++)
            v[c] = (float16)(left[c], right[c]);
        planes_stream(v, out + at * 3, 3, count, (ulong)width * height);
    }
}
