/* Rows and columns put in another order: out[y][x] = in[rows[y]][columns[x]], or `value` where an index is negative.
 * Pixels are CHANNELS floats, or `floats` where that is 0; with `turned`, rows and columns of the source change places. */

#define STRIP 64

kernel void arrange(global const float *restrict in, global float *restrict out, global const int *restrict columns,
                    global const int *restrict rows, int wide, int tall, int source, int floats, int turned,
                    float value) {
    const int first = get_global_id(0) * STRIP, y = get_global_id(1);
    if (first >= wide || y >= tall) return;
    const int row = rows[y], count = min(STRIP, wide - first), channels = CHANNELS ? CHANNELS : floats;
    global float *to = out + ((size_t)y * wide + first) * channels;
    for (int i = 0; i < count; ++i) {
        const int column = columns[first + i];
        const size_t at = turned ? (size_t)column * source + row : (size_t)row * source + column;
        for (int c = 0; c < channels; ++c)
            to[i * channels + c] = row < 0 || column < 0 ? value : in[at * channels + c];
    }
}
