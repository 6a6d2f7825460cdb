// A picture that dissolves into another; dissolve.py is the definition. One work-item for sixteen pixels.
//
// CHANNELS of both pictures. `pattern` is read where `given`, else the hash of place and seed stands for it.

#include "hash.clh"
#include "numeric.clh"
#include "planes.clh"

#define ONE ((float16)(1.0f))
#define ZERO ((float16)(0.0f))

PLANE_FN float16 part(float16 c, float16 f) { return f == 0.0f ? ZERO : c * f; }

// Columns and rows of sixteen pixels that follow each other. One division finds the first; the others are beside it, or
// in the row below, where rows are as long as that.
PLANE_FN void places(ulong first, ulong columns, uint16 *x, uint16 *y)
{
    ulong row = first / columns;
    if (columns >= LANES) {
        uint16 at = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) + (uint)(first - row * columns);
        uint16 below = as_uint16(at >= (uint)columns);
        *x = at - (below & (uint)columns);
        *y = (uint)row - below;
        return;
    }
    uint at[LANES], down[LANES];
    for (int i = 0; i < LANES; i++) {
        at[i] = (uint)((first + i) % columns);
        down[i] = (uint)((first + i) / columns);
    }
    *x = vload16(0, at);
    *y = vload16(0, down);
}

kernel void dissolve(global const float *restrict image, global const float *restrict base,
                     global const float *restrict pattern, global float *restrict out, int given, uint seed,
                     float amount, float softness, ulong columns, ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)LANES;
    if (first >= pixels)
        return;
    int count = (int)min(pixels - first, (ulong)LANES);
    float16 t;
    if (given)
        t = plane_load(pattern + first, 1, 0, count);
    else {
        uint16 x, y, z = (uint16)(seed);
        places(first, columns, &x, &y);
        hash_pcg3d(&x, &y, &z);
        t = hash_unit(x);
    }
    float16 w;
    if (amount >= 1.0f)
        w = t == t ? ONE : t;
    else if (softness == 0.0f)
        w = t < amount ? ONE : (t == t ? ZERO : t);
    else
        w = num_clamp((amount * (1.0f + softness) - t) / softness, ZERO, ONE);
    image += first * CHANNELS, base += first * CHANNELS, out += first * CHANNELS;
#if CHANNELS <= 4
    float16 a[4], b[4];
    planes_load(image, CHANNELS, CHANNELS, count, a);
    planes_load(base, CHANNELS, CHANNELS, count, b);
    for (int c = 0; c < CHANNELS; c++)
        a[c] = part(a[c], ONE - w) + part(b[c], w);
    planes_stream(a, out, CHANNELS, count, pixels);
#else
    for (int c = 0; c < CHANNELS; c++) {
        float16 a = plane_load(image, CHANNELS, c, count), b = plane_load(base, CHANNELS, c, count);
        plane_store(part(a, ONE - w) + part(b, w), out, CHANNELS, c, count);
    }
#endif
}
