// What surrounds a renormalised mean: products with the weights before, the quotient after. See missing.py.
//
// `each` is the number of weights of a pixel: one, or one for each channel where samples that are not finite are left
// out. No product is taken where a weight is 0, since 0 x NaN is NaN.

#define SEGMENT 64

__kernel void weigh(__global const float *restrict in, __global const float *restrict mask, __global float *restrict out,
                    __global float *restrict weights, int count, int channels, int each,
                    int skip, float least, float scale)
{
    int first = get_global_id(0) * SEGMENT;
    for (int i = first; i < min(first + SEGMENT, count); i++) {
        float given = mask ? mask[i] : 1.0f;
        given = given < least ? 0.0f : given;
        if (each < channels)
            weights[i] = given;
        for (int c = 0; c < channels; c++) {
            float v = in[(size_t)i * channels + c];
            float weight = skip && !isfinite(v) ? 0.0f : given;
            if (each == channels)
                weights[(size_t)i * channels + c] = weight;
            out[(size_t)i * channels + c] = weight > 0.0f ? v * scale * weight : 0.0f;
        }
    }
}

__kernel void divide(__global float *restrict sums, __global const float *restrict shares, int count, int channels,
                     int each, float scale)
{
    int first = get_global_id(0) * SEGMENT;
    for (int i = first; i < min(first + SEGMENT, count); i++) {
        for (int c = 0; c < channels; c++) {
            float share = shares[(size_t)i * each + (each == channels ? c : 0)];
            float v = sums[(size_t)i * channels + c] / share * scale;
            sums[(size_t)i * channels + c] = share > 0.0f ? v : NAN;
        }
    }
}
