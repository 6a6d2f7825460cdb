// Colour times coverage, or colour divided by it. CHANNELS of a pixel, of which the last is coverage.
//
// Of four channels a work-item takes four pixels as one vector, in which coverage is a lane like the others; of any other
// count it takes 64 pixels one by one. `samples` are those of the whole picture.

#include "flat.clh"

#if CHANNELS == 4
static inline __attribute__((always_inline)) float16 coverage_of(float16 x) { return x.s33337777bbbbffff; }

// y, with coverage as it was in x.
static inline __attribute__((always_inline)) float16 covered(float16 y, float16 x)
{
    const int16 last = (int16)(0, 0, 0, -1, 0, 0, 0, -1, 0, 0, 0, -1, 0, 0, 0, -1);
    return last ? x : y;
}

kernel void associate(global const float *restrict in, global float *restrict out, ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    float16 x = flat_load(in, at, samples);
    flat_store(covered(x * coverage_of(x), x), out, at, samples);
}

kernel void dissociate(global const float *restrict in, global float *restrict out, ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    float16 x = flat_load(in, at, samples), coverage = coverage_of(x);
    float16 divisor = fabs(coverage) < FLT_MIN ? (float16)(1.0f) : coverage;
    flat_store(covered(x / divisor, x), out, at, samples);
}
#else
#define SEGMENT (64 * CHANNELS)

kernel void associate(global const float *restrict in, global float *restrict out, ulong samples)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT, last = min(first + SEGMENT, samples);
    for (ulong at = first; at < last; at += CHANNELS) {
        float coverage = in[at + CHANNELS - 1];
        for (int c = 0; c < CHANNELS - 1; c++)
            out[at + c] = in[at + c] * coverage;
        out[at + CHANNELS - 1] = coverage;
    }
}

kernel void dissociate(global const float *restrict in, global float *restrict out, ulong samples)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT, last = min(first + SEGMENT, samples);
    for (ulong at = first; at < last; at += CHANNELS) {
        float coverage = in[at + CHANNELS - 1];
        float divisor = fabs(coverage) < FLT_MIN ? 1.0f : coverage;
        for (int c = 0; c < CHANNELS - 1; c++)
            out[at + c] = in[at + c] / divisor;
        out[at + CHANNELS - 1] = coverage;
    }
}
#endif
