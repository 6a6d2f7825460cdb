// The weighted sum of COUNT images of up to 16; COMPENSATED 1 carries what roundings lose (Ogita, Rump and Oishi). Where
// the count is an argument, looking at it takes as long as a sum of one image does: it is built for each.

#include "flat.clh"

#define IMAGE(i) global const float *restrict image_##i
#define ADD(i) if (i <= COUNT) add(image_##i, w[i - 1], at, samples, &total, &rest)

FLAT_FN void add(global const float *restrict image, float weight, ulong at, ulong samples, float16 *total, float16 *rest)
{
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
                       global float *restrict out, global const float *restrict w, ulong samples)
{
    ulong at = get_global_id(0) * (ulong)FLAT_WIDTH;
    if (at >= samples)
        return;
    float16 total = (float16)(0.0f), rest = (float16)(0.0f);
    ADD(1);
    ADD(2);
    ADD(3);
    ADD(4);
    ADD(5);
    ADD(6);
    ADD(7);
    ADD(8);
    ADD(9);
    ADD(10);
    ADD(11);
    ADD(12);
    ADD(13);
    ADD(14);
    ADD(15);
    ADD(16);
#if COMPENSATED
    total = fabs(rest) < INFINITY ? total + rest : total;
#endif
    flat_store(total, out, at, samples);
}
