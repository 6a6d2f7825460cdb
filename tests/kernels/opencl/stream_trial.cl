// Stores over a run of samples that begins `shift` samples behind the start of the result.
#include "flat.clh"

__kernel void twice(__global const float* in, __global float* out, int shift, ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at < samples)
        flat_store(2.0f * flat_load(in, at, samples), out + shift, at, samples);
}

__kernel void twice_by_four(__global const float* in, __global float* out, int shift, ulong samples)
{
    ulong at = get_global_id(0) * 4;
    if (at < samples)
        stream_store4(2.0f * vload4(0, in + at), out + shift + at, samples);
}
