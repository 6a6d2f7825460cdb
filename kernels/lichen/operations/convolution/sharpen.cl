// The unsharp mask: `blurred` becomes the image plus its detail above the threshold, 16 floats an item.

#include "numeric.clh"

__kernel void sharpen(__global const float *restrict in, __global float *restrict blurred, int size, float amount,
                      float threshold)
{
    int at = get_global_id(0) * 16;
    if (at + 16 <= size) {
        float16 image = vload16(0, in + at), detail = image - vload16(0, blurred + at);
        detail -= num_clamp(detail, (float16)(-threshold), (float16)(threshold));
        vstore16(fma((float16)(amount), detail, image), 0, blurred + at);
        return;
    }
    for (; at < size; at++) {
        float detail = in[at] - blurred[at];
        detail -= num_clamp(detail, -threshold, threshold);
        blurred[at] = fma(amount, detail, in[at]);
    }
}
