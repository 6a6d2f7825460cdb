// The functions of border.clh, sampling.clh and hash.clh over arrays. BORDER is the border's number.
#include "hash.clh"
#include "sampling.clh"

__kernel void indices(__global const int* at, int n, __global int* out, int count)
{
    int i = get_global_id(0);
    if (i < count)
        out[i] = border_index(at[i], n, BORDER);
}

#define SAMPLE(method)                                                                                                 \
    __kernel void method##_trial(__global const float* image, int width, int height, __global const float* x,          \
                                 __global const float* y, __global float* out, int count)                              \
    {                                                                                                                  \
        int i = get_global_id(0);                                                                                      \
        if (i >= count)                                                                                                \
            return;                                                                                                    \
        __global const float4* four = (__global const float4*)image;                                                   \
        __global const float2* two = (__global const float2*)image;                                                    \
        float4 whole = method(four, width, height, x[i], y[i], BORDER, (float4)(5.0f));                                \
        vstore4(whole, 2 * i, out);                                                                                    \
        out[8 * i + 4] = method(image, 4, 2, width, height, x[i], y[i], BORDER, 5.0f);                                 \
        vstore2(method(two, 2 * width, height, x[i], y[i], BORDER, (float2)(5.0f)), 0, out + 8 * i + 5);               \
        out[8 * i + 7] = method(image, 4 * width, height, x[i], y[i], BORDER, 5.0f);                                   \
    }

SAMPLE(sample_nearest)
SAMPLE(sample_bilinear)
SAMPLE(sample_bicubic)

__kernel void hashes(__global uint* a, __global uint* b, __global uint* c, __global float* u)
{
    int i = get_global_id(0) * 16;
    if (i >= 160)
        return;
    uint16 x = vload16(0, a + i), y = vload16(0, b + i), z = vload16(0, c + i);
    hash_pcg3d(&x, &y, &z);
    hash_pcg2d(&x, &y);
    z = hash_pcg(z);
    vstore16(x, 0, a + i);
    vstore16(y, 0, b + i);
    vstore16(z, 0, c + i);
    vstore16(hash_unit(z), 0, u + i);
}

__kernel void hashes_one(__global uint* a, __global uint* b, __global uint* c, __global float* u)
{
    int i = get_global_id(0);
    if (i >= 160)
        return;
    uint x = a[i], y = b[i], z = c[i];
    hash_pcg3d(&x, &y, &z);
    hash_pcg2d(&x, &y);
    z = hash_pcg(z);
    a[i] = x;
    b[i] = y;
    c[i] = z;
    u[i] = hash_unit(z);
}
