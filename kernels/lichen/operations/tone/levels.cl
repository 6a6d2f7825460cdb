// Levels over a flat run of samples. levels.py holds the formulas and says why they are written so.
//
// Definitions: COVERAGE (flat.clh), CLAMPED 0 or 1, CURVED 1 where there is an exponent, 2 where all are from 1/4 to 4,
// CHANNELS of a sample.
// `k` holds five runs of CHANNELS + 16 numbers, one for each channel and over again, so that sixteen lanes read their
// own wherever a vector begins: black, black's rest, scale, base, exponent. Clamped or curved, scale is that to [0, 1]
// and a sixth run, the output's span, takes it from there.

#include "flat.clh"
#include "numeric.clh"

#define OWN(name) name
#include "levels_one.clh"

#define RUN (CHANNELS + 16)

kernel void levels(global const float *restrict in, global float *restrict out, global const float *restrict k,
                   ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    float16 x = flat_load(in, at, samples);
    global const float *own = k + at % CHANNELS;
    float16 y = levelled(x, vload16(0, own), vload16(0, own + RUN), vload16(0, own + 2 * RUN), vload16(0, own + 3 * RUN),
                         vload16(0, own + 4 * RUN), vload16(0, own + 5 * RUN));
    flat_store(flat_keep_coverage(y, x, at), out, at, samples);
}
