// A curve through points over a flat run of samples. pieces.py holds the theory.
//
// Definitions: COVERAGE (flat.clh), EXTENDED 0 or 1, PICKED -1 or the one colour channel meant, CHANNELS of a sample,
// FEW 4 or 8 where there are at most as many pieces (those that are missing begin beyond all samples), or 0.
// `ends` holds the first and last knot, the slopes beyond them, and the number of cells over the knots' distance.

#include "flat.clh"
#include "numeric.clh"
#include "curve.clh"
#define OWN(name) name
#include "curve_ends.clh"

FLAT_FN float16 finished(float16 y, float16 x, float16 held, global const float *ends, ulong at)
{
    y = extended(y, x, held, ends);
#if PICKED >= 0
    uint16 lane = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) + (uint)(at % CHANNELS);
    return select(x, y, lane % CHANNELS == PICKED);
#else
    return flat_keep_coverage(y, x, at);
#endif
}

kernel void exact(global const float *restrict in, global float *restrict out, global const float *restrict ends,
                  global const float *restrict pieces, int count, ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    float16 x = flat_load(in, at, samples);
    float16 held = num_clamp(x, (float16)(ends[0]), (float16)(ends[1]));
    float16 y = held;
#if FEW
    pieced(&y, 1, pieces, FEW, FEW);
#else
    pieced(&y, 1, pieces, count, count);
#endif
    flat_store(finished(y, x, held, ends, at), out, at, samples);
}

// `nodes` holds (value, rise to the next), cells + 1 of them.
kernel void table(global const float *restrict in, global float *restrict out, global const float *restrict ends,
                  global const float2 *restrict nodes, int cells, ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    float16 x = flat_load(in, at, samples);
    float16 held = num_clamp(x, (float16)(ends[0]), (float16)(ends[1]));
    float16 place = (held - ends[0]) * ends[4];
    float16 known = held == held ? place : (float16)(0.0f);
    int16 cell = clamp(convert_int16(known), 0, cells);
    float16 part = place - convert_float16(cell);
    float values[FLAT_WIDTH], rises[FLAT_WIDTH];
    int cells_of[FLAT_WIDTH];
    vstore16(cell, 0, cells_of);
    for (int i = 0; i < FLAT_WIDTH; i++) {
        float2 node = nodes[cells_of[i]];
        values[i] = node.x;
        rises[i] = node.y;
    }
    float16 y = fma(part, vload16(0, rises), vload16(0, values));
    flat_store(finished(y, x, held, ends, at), out, at, samples);
}
