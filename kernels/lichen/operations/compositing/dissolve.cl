// A picture that dissolves into another; dissolve.py is the definition. One work-item for sixteen pixels.
//
// CHANNELS of both pictures. `pattern` is read where `given`, else the hash of place and seed stands for it.

#include "hash.clh"
#include "numeric.clh"
#include "planes.clh"

#define ONE ((float16)(1.0f))
#define ZERO ((float16)(0.0f))

PLANE_FN float16 part(float16 c, float16 f) { return f == 0.0f ? ZERO : c * f; }

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
        uint at[LANES], down[LANES];
        for (int i = 0; i < LANES; i++) {
            at[i] = (uint)((first + i) % columns);
            down[i] = (uint)((first + i) / columns);
        }
        uint16 x = vload16(0, at), y = vload16(0, down), z = (uint16)(seed);
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
    for (int c = 0; c < CHANNELS; c++) {
        float16 a = plane_load(image + first * CHANNELS, CHANNELS, c, count);
        float16 b = plane_load(base + first * CHANNELS, CHANNELS, c, count);
        plane_store(part(a, ONE - w) + part(b, w), out + first * CHANNELS, CHANNELS, c, count);
    }
}
