// Small kernels for the tests of the runtime.
#ifndef FACTOR
#define FACTOR 2.0f
#endif

__kernel void scale(__global const float* restrict in, __global float* restrict out, int count)
{
    int i = get_global_id(0);
    if (i < count)
        out[i] = FACTOR * in[i];
}

__kernel void increase(__global float* values, int count)
{
    int i = get_global_id(0);
    if (i < count)
        values[i] += 1.0f;
}

__kernel void place(__global int* restrict out, int width, int height)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x < width && y < height)
        out[y * width + x] = 1000 * y + x;
}

// A product that a fused step would not round.
__kernel void unfused(float a, float b, float c, __global float* restrict out)
{
    if (get_global_id(0) == 0)
        out[0] = a * b + c;
}

__kernel void given(__global const float* restrict in, __global int* restrict out)
{
    if (get_global_id(0) == 0)
        out[0] = in != 0;
}
