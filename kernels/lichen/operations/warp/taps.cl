/* Warps that take one interpolated value for each pixel: nearest, bilinear, and kernels of 4 or 6 samples.
 * Arguments: `matrix` or `table`, whichever is not null; the width of the result, its first row in the table and how many
 * there are; the picture, and how many samples were put around it; where to write. */

#include "taps.clh"

#define ARGUMENTS                                                                                                      \
    global const double *restrict matrix, global const double *restrict table, int width, int top, int height,         \
        global const float *restrict pixels, int columns, int rows, int border, float value, int around,               \
        global float *restrict out, int stride, int channel

#define BEGIN                                                                                                          \
    const int first = get_global_id(0) * SEGMENT, below = get_global_id(1), row = top + below;                         \
    if (first >= width || below >= height) return;                                                                     \
    const Picture picture = {pixels, columns, rows, border, value};                                                    \
    double x[SEGMENT], y[SEGMENT];                                                                                     \
    int seen[SEGMENT];                                                                                                 \
    locate(x, y, matrix, table, first, row, below, width);                                                             \
    from_corner(x, y, matrix);                                                                                         \
    EACH {                                                                                                             \
        x[i] += around;                                                                                                \
        y[i] += around;                                                                                                \
    }                                                                                                                  \
    fold(x, y, &picture);                                                                                              \
    const int count = min(SEGMENT, width - first);                                                                     \
    const size_t start = (size_t)row * width + first;

#define SPLIT                                                                                                          \
    int column[SEGMENT], line[SEGMENT], easy[SEGMENT];                                                                 \
    float fx[SEGMENT], fy[SEGMENT];                                                                                    \
    split_both(column, line, fx, fy, seen, x, y);

/* Where no pixel of the segment needs care, all of them in one loop without a branch; else those that need none first,
 * then the others. */
#define WRITE(easy, quick, careful)                                                                                    \
    int all = 1;                                                                                                       \
    for (int i = 0; i < count; ++i) all &= easy[i];                                                                    \
    if (all) {                                                                                                         \
        for (int i = 0; i < count; ++i) put(out, start + i, stride, channel, quick);                                   \
        return;                                                                                                        \
    }                                                                                                                  \
    for (int i = 0; i < count; ++i)                                                                                    \
        if (easy[i]) put(out, start + i, stride, channel, quick);                                                      \
    for (int i = 0; i < count; ++i)                                                                                    \
        if (!easy[i]) put(out, start + i, stride, channel, seen[i] ? (careful) : (T)(value));

kernel void nearest(ARGUMENTS) {
    BEGIN
    int column[SEGMENT], line[SEGMENT], easy[SEGMENT];
    EACH {
        seen[i] = fabs(x[i]) < INFINITY && fabs(y[i]) < INFINITY;
        column[i] = cell_before(within(x[i]));
        line[i] = cell_before(within(y[i]));
        easy[i] = seen[i] & (column[i] >= 0) & (line[i] >= 0) & (column[i] < columns) & (line[i] < rows);
        seen[i] = easy[i] | (seen[i] & (border != BORDER_CONSTANT));
    }
    WRITE(easy, LOAD(pixels + CHANNELS * ((size_t)line[i] * columns + column[i])), fetch(&picture, column[i], line[i]))
}

kernel void linear(ARGUMENTS) {
    BEGIN
    SPLIT
    find_easy(easy, seen, column, line, fx, fy, 0, 2, &picture);
    WRITE(easy, bilinear_inside(&picture, column[i], line[i], fx[i], fy[i]),
          bilinear(&picture, column[i], line[i], fx[i], fy[i]))
}

inline T taps4_anywhere(const Picture *picture, int column, int row, const Four *across, const Four *down, int i) {
    const float wx[4] = {across->w[0][i], across->w[1][i], across->w[2][i], across->w[3][i]};
    const float wy[4] = {down->w[0][i], down->w[1][i], down->w[2][i], down->w[3][i]};
    return taps_anywhere(picture, column - 1, row - 1, 4, wx, wy);
}

kernel void four(ARGUMENTS, int kind) {
    BEGIN
    SPLIT
    Four across, down;
    weigh4(&across, fx, kind);
    weigh4(&down, fy, kind);
    find_easy(easy, seen, column, line, fx, fy, 1, 4, &picture);
    const size_t pitch = (size_t)CHANNELS * columns;
    WRITE(easy, taps4(pixels + (line[i] - 1) * pitch + CHANNELS * (column[i] - 1), pitch, &across, &down, i),
          taps4_anywhere(&picture, column[i], line[i], &across, &down, i))
}

kernel void six(ARGUMENTS) {
    BEGIN
    SPLIT
    Six across, down;
    weigh6(&across, fx);
    weigh6(&down, fy);
    find_easy(easy, seen, column, line, fx, fy, 2, 6, &picture);
    const size_t pitch = (size_t)CHANNELS * columns;
    WRITE(easy, taps6(pixels + (line[i] - 2) * pitch + CHANNELS * (column[i] - 2), pitch, &across, &down, i),
          taps6_anywhere(&picture, column[i], line[i], &across, &down, i))
}
