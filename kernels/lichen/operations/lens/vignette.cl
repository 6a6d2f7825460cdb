// A lens's fall-off towards the corners; vignette.py is the definition.
//
// CHANNELS of the picture, the last COLOURS + 1st of which is coverage and stays. TABLE 1: gains by radius, `entries` of
// them up to the radius 1 / n[2]; 0: by the formula. REMOVE 1 where the fall-off is taken out.
// `n` holds the centre, the scale of radii to the table or to the formula's unit, the power's half, the tangent's
// scale, that of the pupils' distance, and the largest gain.

#include "numeric.clh"

#define SEGMENT 64
#define EACH for (int i = 0; i < SEGMENT; ++i)

kernel void vignette(global const float *restrict in, global float *restrict out, global const float *restrict n,
                     global const float *restrict table, int width, int height, int entries)
{
    int first = get_global_id(0) * SEGMENT, row = get_global_id(1);
    if (first >= width || row >= height)
        return;
    float gain[SEGMENT], y = row + 0.5f - n[1];
    EACH {
        float x = first + i + 0.5f - n[0], radius = sqrt(x * x + y * y) * n[2];
#if TABLE
        float place = radius * (entries - 1);
        int cell = min((int)place, entries - 2);
        float before = table[cell];
        gain[i] = before + (place - cell) * (table[cell + 1] - before);
#else
        float t = radius * n[4], made = num_pow(1.0f + t * t, -n[3]), d = radius * n[5];
        d = d > 2.0f ? 2.0f : d;
        float across = sqrt((2.0f - d) * (2.0f + d));
        float open = (2.0f * num_atan2(across, d) - 0.5f * d * across) * 0.318309886f;
        made *= n[5] > 0.0f ? open : 1.0f;
        gain[i] = REMOVE ? (made * n[6] < 1.0f ? n[6] : 1.0f / made) : made;
#endif
    }
    for (int i = 0; i < min(SEGMENT, width - first); ++i) {
        size_t at = ((size_t)row * width + first + i) * CHANNELS;
        for (int c = 0; c < CHANNELS; ++c)
            out[at + c] = c < COLOURS ? in[at + c] * gain[i] : in[at + c];
    }
}
