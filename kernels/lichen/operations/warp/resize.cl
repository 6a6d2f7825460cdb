/* One axis of a resize: each sample of the result is a weighted sum of a few samples of the source.
 * `index` and `weights` hold `taps` for each; `outside` is what the border's value adds. */

#define STRIP 64

/* Rows from rows. A row is `floats` long, whatever its pixels are. One work-item does STRIP floats of one row. */
kernel void down(global const float *restrict in, global float *restrict out, global const int *restrict index,
                 global const float *restrict weights, global const float *restrict outside, int taps, int floats,
                 int rows) {
    const int first = get_global_id(0) * STRIP, row = get_global_id(1);
    if (first >= floats || row >= rows) return;
    global const int *at = index + (size_t)row * taps;
    global const float *by = weights + (size_t)row * taps;
    global float *to = out + (size_t)row * floats + first;
    const float begin = outside[row];
    if (first + STRIP <= floats) {
        float16 a = begin, b = begin, c = begin, d = begin;
        for (int k = 0; k < taps; ++k) {
            global const float *p = in + (size_t)at[k] * floats + first;
            const float16 w = by[k];
            a = fma(w, vload16(0, p), a);
            b = fma(w, vload16(1, p), b);
            c = fma(w, vload16(2, p), c);
            d = fma(w, vload16(3, p), d);
        }
        vstore16(a, 0, to);
        vstore16(b, 1, to);
        vstore16(c, 2, to);
        vstore16(d, 3, to);
        return;
    }
    for (int i = 0; first + i < floats; ++i) {
        float sum = begin;
        for (int k = 0; k < taps; ++k) sum = fma(by[k], in[(size_t)at[k] * floats + first + i], sum);
        to[i] = sum;
    }
}

/* Columns from columns, of pixels of CHANNELS floats, or of `floats` where that is 0. One work-item does one column of BLOCK rows, so that indices and
 * weights are read once for all of them. */
#define BLOCK 4

kernel void across(global const float *restrict in, global float *restrict out, global const int *restrict index,
                   global const float *restrict weights, global const float *restrict outside, int taps, int columns,
                   int wide, int rows, int floats) {
    const int first = get_global_id(0) * STRIP, row = get_global_id(1) * BLOCK;
    if (first >= wide || row >= rows) return;
    const int count = min(STRIP, wide - first);
    const int channels = CHANNELS ? CHANNELS : floats;
    const size_t pitch = (size_t)columns * channels, step = (size_t)wide * channels;
    const int tall = min(BLOCK, rows - row);
    for (int i = first; i < first + count; ++i) {
        global const int *at = index + (size_t)i * taps;
        global const float *by = weights + (size_t)i * taps;
        global const float *from = in + row * pitch;
        global float *to = out + row * step + (size_t)i * channels;
        const float begin = outside[i];
#if CHANNELS == 4
        if (tall == BLOCK) {
            float4 a = begin, b = begin, c = begin, d = begin;
            for (int k = 0; k < taps; ++k) {
                global const float *p = from + 4 * at[k];
                const float4 w = by[k];
                a = fma(w, vload4(0, p), a);
                b = fma(w, vload4(0, p + pitch), b);
                c = fma(w, vload4(0, p + 2 * pitch), c);
                d = fma(w, vload4(0, p + 3 * pitch), d);
            }
            vstore4(a, 0, to);
            vstore4(b, 0, to + step);
            vstore4(c, 0, to + 2 * step);
            vstore4(d, 0, to + 3 * step);
            continue;
        }
#endif
        for (int j = 0; j < tall; ++j)
            for (int n = 0; n < channels; ++n) {
                float sum = begin;
                for (int k = 0; k < taps; ++k) sum = fma(by[k], from[j * pitch + channels * at[k] + n], sum);
                to[j * step + n] = sum;
            }
    }
}
