/* Strokes of round pens with soft edges; the twin of `lichen.operations.streamlines.strokes`.
 *
 * One work-item draws one stroke. A pixel keeps the largest of what strokes bring to it, so their order does not matter;
 * non-negative floats are ordered as their bits are. */

kernel void draw(global const int *restrict cells, global const float *restrict shapes, global const float *restrict values,
                 global int *restrict result, int count, int width, int height, int channels) {
    const int n = get_global_id(0);
    if (n >= count) return;
    const int column = cells[2 * n], row = cells[2 * n + 1];
    global const float *shape = shapes + 5 * n;
    const float x = shape[0], y = shape[1], dx = shape[2], dy = shape[3], radius = shape[4];
    const float square = fma(dx, dx, dy * dy);
    const int reach = (int)ceil(radius + fabs(dx) + fabs(dy)) + 1;
    for (int j = max(row - reach, 0); j <= min(row + reach, height - 1); ++j)
        for (int i = max(column - reach, 0); i <= min(column + reach, width - 1); ++i) {
            const float ax = (float)(i - column) - x, ay = (float)(j - row) - y;
            float along = square > 0.0f ? fma(ax, dx, ay * dy) / square : 0.0f;
            along = along > 0.0f ? (along < 1.0f ? along : 1.0f) : 0.0f;
            const float ex = ax - along * dx, ey = ay - along * dy;
            const float inside = radius + 0.5f - sqrt(fma(ex, ex, ey * ey));
            const float cover = inside > 0.0f ? (inside < 1.0f ? inside : 1.0f) : 0.0f;
            if (cover > 0.0f)
                for (int c = 0; c < channels; ++c)
                    atomic_max(result + ((size_t)j * width + i) * channels + c, as_int(cover * values[n * channels + c]));
        }
}
