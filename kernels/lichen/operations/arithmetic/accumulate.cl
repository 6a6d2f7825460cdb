// The weighted sum of `count` images of up to 16; COMPENSATED 1 carries what roundings lose (Ogita, Rump and Oishi).

#include "flat.clh"

#define IMAGE(i) global const float *restrict image_##i

FLAT_FN void add(global const float *restrict image, float weight, bool there, ulong at, ulong samples, float16 *total,
                 float16 *rest)
{
    if (!there)
        return;
    float16 x = flat_load(image, at, samples), product = x * weight, sum = *total + product;
#if COMPENSATED
    float16 part = sum - *total;
    float16 lost = fma(x, (float16)(weight), -product);
    *rest += ((*total - (sum - part)) + (product - part)) + (fabs(lost) < INFINITY ? lost : (float16)(0.0f));
#endif
    *total = sum;
}

kernel void accumulate(IMAGE(1), IMAGE(2), IMAGE(3), IMAGE(4), IMAGE(5), IMAGE(6), IMAGE(7), IMAGE(8), IMAGE(9),
                       IMAGE(10), IMAGE(11), IMAGE(12), IMAGE(13), IMAGE(14), IMAGE(15), IMAGE(16),
                       global float *restrict out, global const float *restrict w, int count, ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    float16 total = (float16)(0.0f), rest = (float16)(0.0f);
    add(image_1, w[0], count > 0, at, samples, &total, &rest);
    add(image_2, w[1], count > 1, at, samples, &total, &rest);
    add(image_3, w[2], count > 2, at, samples, &total, &rest);
    add(image_4, w[3], count > 3, at, samples, &total, &rest);
    add(image_5, w[4], count > 4, at, samples, &total, &rest);
    add(image_6, w[5], count > 5, at, samples, &total, &rest);
    add(image_7, w[6], count > 6, at, samples, &total, &rest);
    add(image_8, w[7], count > 7, at, samples, &total, &rest);
    add(image_9, w[8], count > 8, at, samples, &total, &rest);
    add(image_10, w[9], count > 9, at, samples, &total, &rest);
    add(image_11, w[10], count > 10, at, samples, &total, &rest);
    add(image_12, w[11], count > 11, at, samples, &total, &rest);
    add(image_13, w[12], count > 12, at, samples, &total, &rest);
    add(image_14, w[13], count > 13, at, samples, &total, &rest);
    add(image_15, w[14], count > 14, at, samples, &total, &rest);
    add(image_16, w[15], count > 15, at, samples, &total, &rest);
#if COMPENSATED
    total = fabs(rest) < INFINITY ? total + rest : total;
#endif
    flat_store(total, out, at, samples);
}
