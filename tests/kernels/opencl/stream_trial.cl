// flat_store over a run of samples that begins `shift` samples behind the start of the result.
#include "flat.clh"

__kernel void twice(__global const float* in, __global float* out, int shift, ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at < samples)
        flat_store(2.0f * flat_load(in, at, samples), out + shift, at, samples);
}
