// Sums down rows whose weights come again every `period` rows: row r of the result is the sum over k < taps of
// weights[r % period, k] times row r / period * step + k of those that `sources` names, -1 being the constant. A filter
// that leaves rows out has a period of one row and a step of several, one that puts them back in the reverse.
//
// sums: one item owns a tile of a band of rows, some floats wide, and stages what they read, as `staged.clh` has it.
//   ROWS rows are summed together, so that each staged sample is loaded once for all of them: twelve sums of eight floats
//   fill the registers. Beside a row's weights lie zeros, `beside` of them, for samples that only its neighbours take;
//   what is blurred so is finite. One row after the other took 1.4 times as long.
// apart: one item for each float, where items step together.
//
// `width` counts floats; the result begins at row `top` of `out` and has `height` rows.

#include "staged.clh"

#define ROWS 3
#define LANES 32

#ifdef STAGE
// Floats of a row from `from` on, -1 being the constant.
STAGED_FN void stage_line(float *to, __global const Sample *in, __global const float *meant, int source, int from,
                          int count, int width, float value)
{
    if (source >= 0)
        stage_run(to, in + (size_t)source * width + from, meant, count);
    for (int i = 0; i < count && source < 0; i++)
        to[i] = value;
}

__kernel void sums(__global const Sample *restrict in, __global const float *restrict meant,
                   __global const int *restrict sources, __global Result *restrict out,
                   __global const float *restrict weights, int top, int height, int width,
                   int taps, int period, int step, int beside, int band, int tile, int capacity, float value,
                   __global const float *restrict numbers, __global int *restrict counts)
{
    int x = get_global_id(0) * tile, y = get_global_id(1) * band;
    if (x >= width || y >= height)
        return;
    float stage[STAGE] __attribute__((aligned(64)));
    int moved[2] = {0, 0}, end = min(y + band, height), count = min(tile, width - x), whole = (width & 15) == 0;
    // A pitch of a power of two would have rows fight for the same cache sets.
    int pitch = tile + 16, first = y / period * step, held = 0;
    for (int r = y; r < end; r += ROWS) {
        int wanted = r / period * step, stop = min(r + ROWS - 1, end - 1) / period * step + taps;
        if (stop - first > capacity) {
            move_up(stage, wanted - first, held, pitch);
            held -= wanted - first;
            first = wanted;
        }
        for (; first + held < stop; held++)
            stage_line(stage + held * pitch, in, meant, sources[first + held], x, count, width, value);
        // What the next are summed from is on its way meanwhile.
        int next = min(r + 2 * ROWS - 1, end - 1) / period * step + taps;
        for (int n = first + held; n < next; n++)
            for (int i = 0; i < count; i += 64 / (int)sizeof(Sample))
                stream_ask((__global const float *)(in + (size_t)max(sources[n], 0) * width + x + i));
        __global const float *own[ROWS];
        #pragma unroll
        for (int j = 0; j < ROWS; j++) {
            int row = min(r + j, end - 1);
            own[j] = weights + (row % period) * (taps + 2 * beside) + beside - (row / period * step - wanted);
        }
        __global Result *to = out + (size_t)(top + r) * width + x;
        for (int i = 0; i < count; i += LANES) {
            const float *p = stage + (wanted - first) * pitch + i;
            float8 s[ROWS][LANES / 8];
            #pragma unroll
            for (int j = 0; j < ROWS; j++)
                for (int q = 0; q < LANES / 8; q++)
                    s[j][q] = (float8)(0.0f);
            for (int k = 0; k < stop - wanted; k++, p += pitch) {
                float8 w[ROWS];
                #pragma unroll
                for (int j = 0; j < ROWS; j++)
                    w[j] = (float8)(own[j][k]);
                #pragma unroll
                for (int q = 0; q < LANES / 8; q++) {
                    float8 v = vload8(q, p);
                    #pragma unroll
                    for (int j = 0; j < ROWS; j++)
                        s[j][q] = fma(w[j], v, s[j][q]);
                }
            }
            #pragma unroll
            for (int j = 0; j < ROWS; j++)
                if (r + j < end)
                    put_result(to + (size_t)j * width + i, TAIL((float16)(s[j][0], s[j][1]), numbers),
                               TAIL((float16)(s[j][2], s[j][3]), numbers), count - i, whole, 0, moved);
        }
    }
    tell(moved, counts);
}
#endif

__kernel void apart(__global const float *restrict in, __global const int *restrict sources,
                    __global float *restrict out, __global const float *restrict weights, int top, int height, int width,
                    int taps, int period, int step, float value)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    float sum = 0.0f;
    for (int k = 0; k < taps; k++) {
        int source = sources[y / period * step + k];
        sum = fma(weights[y % period * taps + k], source < 0 ? value : in[(size_t)source * width + x], sum);
    }
    out[(size_t)(top + y) * width + x] = sum;
}
