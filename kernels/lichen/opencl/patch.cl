// A picture with a rectangle of another in it: a row of the result for each work-item. Bound by bytes; what is written is
// not read again soon, and goes past the caches.
#include "stream.clh"

static inline void move(global const float *restrict from, global float *restrict to, int count, ulong samples)
{
    int i = 0;
    for (; i < count && ((size_t)(to + i) & 63); i++)
        to[i] = from[i];
    for (; i + 16 <= count; i += 16)
        stream_store16(vload16(0, from + i), to + i, samples);
    for (; i < count; i++)
        to[i] = from[i];
}

// Rows are `width` floats, those of the part `wide`, which begin at float `left` of rows `top` to `bottom`.
kernel void patch(global const float *restrict image, global const float *restrict part, global float *restrict out,
                  int height, int width, int top, int bottom, int left, int wide)
{
    int y = get_global_id(0);
    if (y >= height)
        return;
    ulong samples = (ulong)height * width;
    size_t row = (size_t)y * width;
    if (y < top || y >= bottom) {
        move(image + row, out + row, width, samples);
        return;
    }
    move(image + row, out + row, left, samples);
    move(part + (size_t)(y - top) * wide, out + row + left, wide, samples);
    move(image + row + left + wide, out + row + left + wide, width - left - wide, samples);
}
