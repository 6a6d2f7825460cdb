// Smallest and largest finite value of an array, and how many values are NaN or infinite, per block of `block` values.
// One work-item takes a block; four running results in turn hide the time that a comparison takes. The three numbers
// are the same in any order.
#define TURNS 4

__kernel void extent(__global const float* restrict values, ulong count, int block, __global float* restrict parts)
{
    int item = get_global_id(0);
    ulong start = (ulong)item * block;
    if (start >= count)
        return;
    int here = (int)min((ulong)block, count - start);
    __global const float* restrict from = values + start;
    float16 low[TURNS], high[TURNS];
    int16 finite[TURNS]; // minus their number
    #pragma unroll
    for (int k = 0; k < TURNS; k++) {
        low[k] = INFINITY;
        high[k] = -INFINITY;
        finite[k] = 0;
    }
    int vectors = here / (16 * TURNS) * TURNS;
    for (int i = 0; i < vectors; i += TURNS) {
        #pragma unroll
        for (int k = 0; k < TURNS; k++) {
            float16 v = vload16(i + k, from);
            int16 good = fabs(v) < INFINITY; // -1 where it is finite
            float16 upper = good ? v : (float16)(-INFINITY), lower = good ? v : (float16)(INFINITY);
            low[k] = lower < low[k] ? lower : low[k];
            high[k] = upper > high[k] ? upper : high[k];
            finite[k] += good;
        }
    }
    float16 low16 = fmin(fmin(low[0], low[1]), fmin(low[2], low[3]));
    float16 high16 = fmax(fmax(high[0], high[1]), fmax(high[2], high[3]));
    int16 finite16 = (finite[0] + finite[1]) + (finite[2] + finite[3]);
    float lows[16], highs[16];
    int finites[16];
    vstore16(low16, 0, lows);
    vstore16(high16, 0, highs);
    vstore16(finite16, 0, finites);
    float smallest = INFINITY, largest = -INFINITY;
    int nonfinite = vectors * 16;
    for (int i = 0; i < 16; i++) {
        smallest = fmin(smallest, lows[i]);
        largest = fmax(largest, highs[i]);
        nonfinite += finites[i];
    }
    for (int i = vectors * 16; i < here; i++) {
        float v = from[i];
        bool good = fabs(v) < INFINITY;
        smallest = good ? fmin(smallest, v) : smallest;
        largest = good ? fmax(largest, v) : largest;
        nonfinite += !good;
    }
    parts[3 * item] = smallest;
    parts[3 * item + 1] = largest;
    parts[3 * item + 2] = nonfinite; // at most `block`, exact in a float
}
