// A camera's depths as points, 64 pixels of a row to a work-item, in doubles; deproject.py is the definition, operation
// for operation. `kind`: 0 planar, 1 euclidean, 2 a window's, by `terms` s, a and b: s / (a + b d).

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define SEGMENT 64

kernel void deproject(global const float *restrict depth, global float *restrict out, global const double *restrict terms,
                      global const double *restrict xs, global const double *restrict ys, int kind, int width, int height)
{
    int per_row = (width + SEGMENT - 1) / SEGMENT, row = (int)get_global_id(0) / per_row;
    if (row >= height)
        return;
    int begin = ((int)get_global_id(0) % per_row) * SEGMENT, end = min(begin + SEGMENT, width);
    double y = ys[row];
    for (int column = begin; column < end; column++) {
        size_t at = (size_t)row * width + column;
        double x = xs[column], z = depth[at];
        if (kind == 1)
            z = z / sqrt((1.0 + x * x) + y * y);
        else if (kind == 2) {
            double below = terms[1] + terms[2] * z;
            z = below <= 0.0 ? (double)INFINITY : terms[0] / below;
        }
        bool there = !isinf(z);
        out[at * 3] = (float)(there ? x * z : fabs(z));
        out[at * 3 + 1] = (float)(there ? y * z : fabs(z));
        out[at * 3 + 2] = (float)(there ? -z : fabs(z));
    }
}
