// Colour times coverage, or colour divided by it. One work-item for 64 pixels of any channel count.

#define SEGMENT 64

__kernel void associate(__global const float *restrict in, __global float *restrict out, int channels, int pixels)
{
    int first = get_global_id(0) * SEGMENT, last = min(first + SEGMENT, pixels);
    for (int i = first; i < last; i++) {
        size_t at = (size_t)i * channels;
        float coverage = in[at + channels - 1];
        for (int c = 0; c < channels - 1; c++)
            out[at + c] = in[at + c] * coverage;
        out[at + channels - 1] = coverage;
    }
}

__kernel void dissociate(__global const float *restrict in, __global float *restrict out, int channels, int pixels)
{
    int first = get_global_id(0) * SEGMENT, last = min(first + SEGMENT, pixels);
    for (int i = first; i < last; i++) {
        size_t at = (size_t)i * channels;
        float coverage = in[at + channels - 1];
        float divisor = fabs(coverage) < FLT_MIN ? 1.0f : coverage;
        for (int c = 0; c < channels - 1; c++)
            out[at + c] = in[at + c] / divisor;
        out[at + channels - 1] = coverage;
    }
}
