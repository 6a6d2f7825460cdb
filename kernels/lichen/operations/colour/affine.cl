// Every pixel's first SIZE channels times a matrix of SIZE rows of 5: four factors, then what is added.
//
// A factor of zero takes no part, so a NaN reaches only the results that depend on it. FOLLOWS is the channel that what
// is added is multiplied by (coverage, where colour is associated with it), or -1. DENSE is 1 where no factor is zero, ADDED 0 where
// nothing is added to any row.

#include "planes.clh"
#define OWN(name) name
#include "affine_mixed.clh"

kernel void affine(global const float *restrict in, global float *restrict out, global const float *restrict m,
                   int pixels)
{
    int end = run_end(pixels);
    for (int first = run_start(); first < end; first += WIDTH) {
        int count = min(end - first, WIDTH);
        global const float *from = in + (size_t)first * IN;
        float16 v[4], y[4];
        load_planes(from, count, v);
        float16 follows = (float16)(1.0f);
#if FOLLOWS >= 4
        float plane[WIDTH];
        for (int i = 0; i < WIDTH; i++)
            plane[i] = i < count ? from[i * IN + FOLLOWS] : 0.0f;
        follows = vload16(0, plane);
#elif FOLLOWS >= 0
        follows = v[FOLLOWS];
#endif
        mixed(v, follows, m, y);
        store_planes(y, from, count, out + (size_t)first * OUT, pixels);
    }
}
