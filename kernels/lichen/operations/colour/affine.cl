// Every pixel's first SIZE channels times a matrix of SIZE rows of 5: four factors, then what is added.
//
// A factor of zero takes no part, so a NaN reaches only the results that depend on it. FOLLOWS is the channel that what
// is added is multiplied by (coverage, where colour is associated with it), or -1.

#include "planes.clh"
#define OWN(name) name
#include "affine_mixed.clh"

kernel void affine(global const float *restrict in, global float *restrict out, global const float *restrict m,
                   int pixels)
{
    int first = get_global_id(0) * WIDTH;
    if (first >= pixels)
        return;
    int count = min(pixels - first, WIDTH);
    in += (size_t)first * IN;
    out += (size_t)first * OUT;
    float16 v[4], y[4];
    load_planes(in, count, v);
    float16 follows = (float16)(1.0f);
#if FOLLOWS >= 4
    float plane[WIDTH];
    for (int i = 0; i < WIDTH; i++)
        plane[i] = i < count ? in[i * IN + FOLLOWS] : 0.0f;
    follows = vload16(0, plane);
#elif FOLLOWS >= 0
    follows = v[FOLLOWS];
#endif
    mixed(v, follows, m, y);
    store_planes(y, in, count, out);
}
