// How far apart two eyes see a depth; disparity.py is the definition. `n` holds the scale, one over the depth that
// coincides, and the largest disparity.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define SEGMENT 64

kernel void disparity(global const float *restrict depth, global float *restrict out, global const double *restrict n,
                      ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT;
    double scale = n[0], back = n[1], largest = n[2];
    for (ulong i = first; i < min(first + SEGMENT, pixels); i++) {
        double z = depth[i], apart = scale == 0 ? 0.0 : scale * (1 / fabs(z) - back);
        apart = apart < -largest ? -largest : (apart > largest ? largest : apart);
        out[i] = z >= 0 ? (float)apart : NAN;
    }
}
