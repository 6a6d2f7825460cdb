// Magnitude and direction of two slopes: x becomes the result, 16 floats an item.

#include "numeric.clh"

inline float16 fetch(__global const float *from, int count)
{
    if (count == 16)
        return vload16(0, from);
    float lanes[16];
    for (int i = 0; i < 16; i++)
        lanes[i] = i < count ? from[i] : 0.0f;
    return vload16(0, lanes);
}

inline void put(__global float *to, float16 v, int count)
{
    if (count == 16) {
        vstore16(v, 0, to);
        return;
    }
    float lanes[16];
    vstore16(v, 0, lanes);
    for (int i = 0; i < count; i++)
        to[i] = lanes[i];
}

#define EACH(expression)                                                                                               \
    int at = get_global_id(0) * 16, count = min(16, size - at);                                                        \
    if (count <= 0)                                                                                                    \
        return;                                                                                                        \
    float16 a = fetch(x + at, count), b = fetch(y + at, count);                                                        \
    put(x + at, expression, count)

__kernel void l1(__global float *restrict x, __global const float *restrict y, int size)
{
    EACH(fabs(a) + fabs(b));
}

// The larger slope comes out of the root by a power of two, so that no square overflows or underflows.
inline float16 magnitude(float16 a, float16 b)
{
    a = fabs(a);
    b = fabs(b);
    float16 larger = num_max(a, b);
    int16 large = larger > 0x1p+60f, small = larger < 0x1p-60f;
    float16 down = large ? (float16)(0x1p-70f) : small ? (float16)(0x1p+80f) : (float16)(1.0f);
    float16 up = large ? (float16)(0x1p+70f) : small ? (float16)(0x1p-80f) : (float16)(1.0f);
    float16 u = a * down, v = b * down;
    float16 root = sqrt(fma(u, u, v * v)) * up;
    return ((a == INFINITY) | (b == INFINITY)) ? (float16)(INFINITY) : root;
}

__kernel void l2(__global float *restrict x, __global const float *restrict y, int size)
{
    EACH(magnitude(a, b));
}

// -0 + 0 is 0: a slope that vanishes has no side.
__kernel void direction(__global float *restrict x, __global const float *restrict y, int size)
{
    EACH(num_atan2(b + 0.0f, a + 0.0f) * 57.29577951308232f);
}
