// A lens's fall-off towards the corners; vignette.py is the definition.
//
// CHANNELS of the picture, the last COLOURS + 1st of which is coverage and stays. TABLE 1: gains by radius, `entries` of
// them up to the radius 1 / n[2]; 0: by the formula. REMOVE 1 where the fall-off is taken out. FOURTH 1 where the power is
// that of nature, MECHANICAL 0 where no rim closes the corners.
// `n` holds the centre, the scale of radii to the table or to the formula's unit, the power's half, the tangent's
// scale, that of the pupils' distance, and the largest gain.

#define IN CHANNELS
#define OUT CHANNELS
#define READ CHANNELS
#define MADE CHANNELS
#include "../colour/planes.clh"
#include "numeric.clh"

#define STEPS ((float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))

inline float16 gain_of(float16 radius, global const float *restrict n, global const float *restrict table, int entries)
{
#if TABLE
    float16 place = radius * (entries - 1), before, after;
    int16 cell = min(convert_int16(place), entries - 2);
    int cells[WIDTH];
    float values[WIDTH], next[WIDTH];
    vstore16(cell, 0, cells);
    for (int i = 0; i < WIDTH; ++i) {
        values[i] = table[cells[i]];
        next[i] = table[cells[i] + 1];
    }
    before = vload16(0, values);
    return before + (place - convert_float16(cell)) * (vload16(0, next) - before);
#else
    float16 t = radius * n[4], b = 1.0f + t * t;
    float16 made = FOURTH ? 1.0f / (b * b) : num_pow(b, (float16)(-n[3]));
#if MECHANICAL
    float16 d = radius * n[5];
    d = d > 2.0f ? (float16)(2.0f) : d;
    float16 across = sqrt((2.0f - d) * (2.0f + d));
    made *= (2.0f * num_atan2(across, d) - 0.5f * d * across) * 0.318309886f;
#endif
    return REMOVE ? (made * n[6] < 1.0f ? (float16)(n[6]) : 1.0f / made) : made;
#endif
}

kernel void vignette(global const float *restrict in, global float *restrict out, global const float *restrict n,
                     global const float *restrict table, int width, int height, int entries)
{
    int first = get_global_id(0) * WIDTH, row = get_global_id(1);
    if (first >= width || row >= height)
        return;
    int count = min(width - first, WIDTH);
    float16 x = first + 0.5f - n[0] + STEPS;
    float y = row + 0.5f - n[1];
    float16 gain = gain_of(sqrt(x * x + y * y) * n[2], n, table, entries);
    size_t at = ((size_t)row * width + first) * CHANNELS;
#if CHANNELS <= 4
    float16 v[4];
    load_planes(in + at, count, v);
#pragma unroll
    for (int c = 0; c < COLOURS; ++c)
        v[c] *= gain;
    store_planes(v, in + at, count, out + at, width * height);
#else
    float gains[WIDTH];
    vstore16(gain, 0, gains);
    for (int i = 0; i < count; ++i)
        for (int c = 0; c < CHANNELS; ++c)
            out[at + i * CHANNELS + c] = c < COLOURS ? in[at + i * CHANNELS + c] * gains[i] : in[at + i * CHANNELS + c];
#endif
}
