// A colour where depth is infinite, 64 pixels to a work-item, sixteen at a time; background.py is the definition. CHANNELS
// of the picture; of `channels` of depth three are read, or one.
#include "../compositing/planes.clh"

#define SEGMENT 64

PLANE_FN float16 shown(float16 v, int16 nan, int16 nothing, float colour)
{
    v = nothing ? (float16)(colour) : v;
    return nan ? (float16)(NAN) : v;
}

kernel void background(global const float *restrict image, global const float *restrict depth, global float *restrict out,
                       global const float *restrict colour, int channels, ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT, last = min(first + SEGMENT, pixels);
    for (ulong i = first; i < last; i += LANES) {
        int count = (int)min((ulong)LANES, last - i);
        float16 d[3];
        if (channels == 3)
            planes_load(depth + i * 3, 3, 3, count, d);
        else
            d[0] = d[1] = d[2] = plane_load(depth + i * channels, channels, 0, count);
        int16 nan = (d[0] != d[0]) | (d[1] != d[1]) | (d[2] != d[2]);
        int16 nothing = (fabs(d[0]) == INFINITY) | (fabs(d[1]) == INFINITY) | (fabs(d[2]) == INFINITY);
        global const float *in = image + i * CHANNELS;
        global float *to = out + i * CHANNELS;
#if CHANNELS == 1 || CHANNELS == 3 || CHANNELS == 4
        float16 v[CHANNELS];
        planes_load(in, CHANNELS, CHANNELS, count, v);
        for (int c = 0; c < CHANNELS; c++)
            v[c] = shown(v[c], nan, nothing, colour[c]);
        planes_store(v, to, CHANNELS, count);
#else
        for (int c = 0; c < CHANNELS; c++)
            plane_store(shown(plane_load(in, CHANNELS, c, count), nan, nothing, colour[c]), to, CHANNELS, c, count);
#endif
    }
}
