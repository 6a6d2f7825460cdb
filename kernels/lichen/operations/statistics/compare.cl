// Differences of two pictures; COVERAGE is their channels where colour is straight, else 0. SIGNED 0 or 1.

#include "flat.clh"

// Sixteen samples as they show: colour times its coverage.
FLAT_FN float16 shown(global const float *restrict in, ulong at, ulong samples)
{
    float16 x = flat_load(in, at, samples);
#if COVERAGE
    // A vector may end amid a pixel; its lanes then look for their coverage beyond it.
    float own[FLAT_WIDTH];
    for (int i = 0; i < FLAT_WIDTH; i++) {
        ulong alpha = (at + i) / COVERAGE * COVERAGE + COVERAGE - 1;
        own[i] = alpha < samples && alpha != at + i ? in[alpha] : 1.0f;
    }
    x *= vload16(0, own);
#endif
    return x;
}

kernel void compare(global const float *restrict image, global const float *restrict reference,
                    global float *restrict out, ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    float16 apart = shown(image, at, samples) - shown(reference, at, samples);
    flat_store(SIGNED ? apart : fabs(apart), out, at, samples);
}
