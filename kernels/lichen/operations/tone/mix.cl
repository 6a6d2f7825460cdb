// s (b base + a image) for an image and what it is mixed with. mix.py says why both weights are divided by s.
//
// `w` holds b, a, s and the weights of luminance. A weight of zero is left out by NONE_OF_BASE or NONE_OF_IMAGE, so
// that nothing of what it weighs comes through.

#include "flat.clh"

#ifndef COVERED
#define COVERED 0
#endif

FLAT_FN float16 mixed(float16 base, float16 image, global const float *restrict w)
{
#if NONE_OF_BASE
    return image;
#elif NONE_OF_IMAGE
    return base;
#else
    return (base * w[0] + image * w[1]) * w[2];
#endif
}

kernel void pictures(global const float *restrict in, global float *restrict out, global const float *restrict base,
                     global const float *restrict w, ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    flat_store(mixed(flat_load(base, at, samples), flat_load(in, at, samples), w), out, at, samples);
}

// The base is one number, times coverage where COVERED: black, or the grey of the average luminance.
kernel void grey(global const float *restrict in, global float *restrict out, global const float *restrict w,
                 float value, ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    float16 x = flat_load(in, at, samples);
    float16 base = (float16)(value);
#if COVERED
    // A vector may end amid a pixel; its lanes then look for their coverage beyond it.
    float own[FLAT_WIDTH];
    for (int i = 0; i < FLAT_WIDTH; i++) {
        ulong alpha = (at + i) / COVERAGE * COVERAGE + COVERAGE - 1;
        own[i] = alpha < samples ? in[alpha] : 0.0f;
    }
    base *= vload16(0, own);
#endif
    flat_store(flat_keep_coverage(mixed(base, x, w), x, at), out, at, samples);
}

// The base is the luminance of each pixel. CHANNELS of a sample, the first three colour. One work-item for 64 pixels.
#define SEGMENT 64

kernel void luminance(global const float *restrict in, global float *restrict out, global const float *restrict w,
                      ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT, last = min(first + SEGMENT, pixels);
    float red = w[3], green = w[4], blue = w[5];
    for (ulong i = first; i < last; i++) {
        global const float *x = in + i * CHANNELS;
        global float *y = out + i * CHANNELS;
        float grey = x[0] * red + x[1] * green + x[2] * blue;
#if NONE_OF_BASE
        y[0] = x[0], y[1] = x[1], y[2] = x[2];
#elif NONE_OF_IMAGE
        y[0] = grey, y[1] = grey, y[2] = grey;
#else
        y[0] = (grey * w[0] + x[0] * w[1]) * w[2];
        y[1] = (grey * w[0] + x[1] * w[1]) * w[2];
        y[2] = (grey * w[0] + x[2] * w[1]) * w[2];
#endif
        for (int c = 3; c < CHANNELS; c++)
            y[c] = x[c];
    }
}
