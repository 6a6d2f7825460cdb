// A colour where depth is infinite, 64 pixels to a work-item; background.py is the definition. CHANNELS of the picture;
// of `channels` of depth three are read, or one.

#define SEGMENT 64

kernel void background(global const float *restrict image, global const float *restrict depth, global float *restrict out,
                       global const float *restrict colour, int channels, ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT, last = min(first + SEGMENT, pixels);
    for (ulong i = first; i < last; i++) {
        global const float *d = depth + i * channels;
        float x = d[0], y = channels == 3 ? d[1] : x, z = channels == 3 ? d[2] : x;
        bool nan = x != x || y != y || z != z, nothing = isinf(x) || isinf(y) || isinf(z);
        for (int c = 0; c < CHANNELS; c++)
            out[i * CHANNELS + c] = nan ? NAN : (nothing ? colour[c] : image[i * CHANNELS + c]);
    }
}
