// White noise: sixteen pixels a work-item. white.py has the formulas.
#include "hash.clh"
#include "numeric.clh"

#define LANES 16

kernel void white(global float *restrict out, int width, int height, int left, int top, int channels, int distribution,
                  uint seed, float middle, float half_range)
{
    const int column = (int)get_global_id(0) * LANES, row = get_global_id(1);
    if (column >= width || row >= height)
        return;
    const uint16 lane = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    for (int channel = 0; channel < channels; channel++) {
        uint16 a = lane + ((uint)column + (uint)left), b = (uint16)((uint)row + (uint)top);
        uint16 c = (uint16)(seed + (uint)channel * 0x9E3779B9u);
        hash_pcg3d(&a, &b, &c);
        float16 u = hash_unit(a), v = hash_unit(b), n;
        if (distribution == 0)
            n = 2.0f * u - 1.0f;
        else if (distribution == 1)
            n = u - v;
        else
            n = sqrt(-2.0f * num_log(u + 0x1p-25f)) * num_cospi(2.0f * v) * (1.0f / 6.0f);
        float16 y = middle + half_range * n;
        global float *to = out + ((size_t)row * width + column) * channels + channel;
        if (channels == 1 && column + LANES <= width) {
            vstore16(y, 0, to);
            continue;
        }
        float each[LANES];
        vstore16(y, 0, each);
        for (int i = 0; i < LANES && column + i < width; i++)
            to[(size_t)i * channels] = each[i];
    }
}
