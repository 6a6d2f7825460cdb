// The smallest kernel that shows a device works: vector loads, a fused step, integers, and the bounds check.
__kernel void probe(__global const float* restrict in, __global float* restrict out, int vectors)
{
    int i = get_global_id(0);
    if (i >= vectors)
        return;
    float16 value = vload16(i, in);
    vstore16(fma(value, value, (float16)(1.0f)) + convert_float16((int16)(i)), i, out);
}
