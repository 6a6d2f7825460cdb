/* Warps that take one interpolated value for each pixel: nearest, bilinear, and kernels of 4 or 6 samples.
 * Arguments: `matrix`, `table` or both, whichever is not null, or `given`, a picture of places, with its numbers as
 * `matrix`; the width of the result, its first row in the table and how many there are; the picture, and how many
 * samples were put around it; where to write. */

#include "taps.clh"

#define ARGUMENTS                                                                                                      \
    global const double *restrict matrix, global const double *restrict table, global const float *restrict given,     \
        int width, int top, int height, global const float *restrict pixels, int columns, int rows, int border,        \
        float value, int around, global float *restrict out, int stride, int channel

/* Places and fractions of a segment, and whether no pixel of it needs care, which is so almost everywhere: then it is
 * sampled without a branch. */
typedef struct {
    uint place[SEGMENT];
    float fx[SEGMENT], fy[SEGMENT];
    int quick;
} Found;

/* A work-item does ROWS segments, a definition given at build time, one below the other, and finds each while the samples
 * of the one before come from memory: they lie apart, where no processor sees them coming. */
#define BEGIN                                                                                                          \
    const int first = get_global_id(0) * SEGMENT, begin = get_global_id(1) * ROWS, end = min(begin + ROWS, height);    \
    if (first >= width) return;                                                                                        \
    const Picture picture = {pixels, columns, rows, border, value};                                                    \
    const size_t pitch = (size_t)CHANNELS * columns;                                                                   \
    Found found[2];
#define EACH_ROW for (int ahead = begin; ahead <= end; ++ahead)
#define FIND_NEXT(half_, before, taps)                                                                                 \
    if (ahead < end) {                                                                                                 \
        Found *next = found + (ahead & 1);                                                                             \
        next->quick = find_quick(next->place, next->fx, next->fy, matrix, table, given, first, top + ahead, ahead,     \
                                 width, half_, around, before, taps, &picture);                                        \
        if (next->quick) ask(next->place, before, taps - 1 - before, &picture);                                        \
    }                                                                                                                  \
    if (ahead == begin) continue;                                                                                      \
    Found *here = found + (~ahead & 1);                                                                                \
    const int below = ahead - 1, row = top + below;                                                                    \
    const uint *place = here->place;                                                                                   \
    float *fx = here->fx, *fy = here->fy;                                                                              \
    const size_t start = (size_t)row * width + first;

#define WRITE_ALL(value)                                                                                               \
    if (CHANNELS == 4 && stride == 4) {                                                                                \
        const ulong samples = 4 * (ulong)width * (top + height);                                                       \
        EACH put4(out + 4 * (start + i), value, samples);                                                              \
    } else {                                                                                                           \
        EACH put(out, start + i, stride, channel, value);                                                              \
    }

#define FIND                                                                                                           \
    double x[SEGMENT], y[SEGMENT];                                                                                     \
    int column[SEGMENT], line[SEGMENT], seen[SEGMENT], easy[SEGMENT];                                                  \
    if (given) {                                                                                                       \
        given_places(x, y, matrix, given, first, row);                                                                 \
    } else {                                                                                                           \
        locate(x, y, matrix, table, first, row, below, width);                                                         \
        from_corner(x, y, matrix);                                                                                     \
    }                                                                                                                  \
    EACH {                                                                                                             \
        x[i] += around;                                                                                                \
        y[i] += around;                                                                                                \
    }                                                                                                                  \
    fold(x, y, &picture);                                                                                              \
    const int count = min(SEGMENT, width - first);

#define SPLIT                                                                                                          \
    mirror(x, y, &picture);                                                                                            \
    split_both(column, line, fx, fy, seen, x, y);

/* Those that need no care first, then the others. */
#define WRITE(easy, quick, careful)                                                                                    \
    for (int i = 0; i < count; ++i)                                                                                    \
        if (easy[i]) put(out, start + i, stride, channel, quick);                                                      \
    for (int i = 0; i < count; ++i)                                                                                    \
        if (!easy[i]) put(out, start + i, stride, channel, seen[i] ? (careful) : (T)(value));

kernel void nearest(ARGUMENTS) {
    BEGIN
    EACH_ROW {
        FIND_NEXT(0.0, 0, 1)
        if (here->quick) {
            WRITE_ALL(LOAD(pixels + CHANNELS * (size_t)place[i]))
            continue;
        }
        FIND
        EACH {
            seen[i] = fabs(x[i]) < INFINITY && fabs(y[i]) < INFINITY;
            column[i] = cell_before(within(x[i]));
            line[i] = cell_before(within(y[i]));
            easy[i] = seen[i] & (column[i] >= 0) & (line[i] >= 0) & (column[i] < columns) & (line[i] < rows);
            seen[i] = easy[i] | (seen[i] & (border != BORDER_CONSTANT));
        }
        WRITE(easy, LOAD(pixels + CHANNELS * ((size_t)line[i] * columns + column[i])), fetch(&picture, column[i], line[i]))
    }
}

kernel void linear(ARGUMENTS) {
    BEGIN
    EACH_ROW {
        FIND_NEXT(0.5, 0, 2)
        if (here->quick) {
            WRITE_ALL(bilinear_between(pixels + CHANNELS * (size_t)place[i], pitch, fx[i], fy[i]))
            continue;
        }
        FIND
        draw_in(x, y, &picture);
        split_both(column, line, fx, fy, seen, x, y);
        find_kept(easy, seen, column, line, fx, fy, &picture);
        ask_easy(easy, column, line, 0, 1, &picture);
        WRITE(easy, bilinear_kept(pixels + line[i] * pitch + CHANNELS * column[i], pitch, fx[i], fy[i]),
              bilinear(&picture, column[i], line[i], fx[i], fy[i]))
    }
}

inline T taps4_anywhere(const Picture *picture, int column, int row, float fx, float fy, const Four *across,
                        const Four *down, int i) {
    const float wx[4] = {across->w[0][i], across->w[1][i], across->w[2][i], across->w[3][i]};
    const float wy[4] = {down->w[0][i], down->w[1][i], down->w[2][i], down->w[3][i]};
    if (open_between(picture, fx, fy)) return taps_beyond(picture, column - 1, row - 1, 4, wx, wy);
    return taps_anywhere(picture, column - 1, row - 1, 4, wx, wy);
}

kernel void four(ARGUMENTS, int kind) {
    BEGIN
    Four across, down;
    EACH_ROW {
        FIND_NEXT(0.5, 1, 4)
        if (here->quick) {
            weigh4(&across, fx, kind);
            weigh4(&down, fy, kind);
            WRITE_ALL(taps4(pixels + CHANNELS * (size_t)(place[i] - columns - 1), pitch, &across, &down, i))
            continue;
        }
        FIND
        SPLIT
        weigh4(&across, fx, kind);
        weigh4(&down, fy, kind);
        find_easy(easy, seen, column, line, fx, fy, 1, 4, &picture);
        ask_easy(easy, column, line, 1, 2, &picture);
        WRITE(easy, taps4(pixels + (line[i] - 1) * pitch + CHANNELS * (column[i] - 1), pitch, &across, &down, i),
              taps4_anywhere(&picture, column[i], line[i], fx[i], fy[i], &across, &down, i))
    }
}

kernel void six(ARGUMENTS) {
    BEGIN
    Six across, down;
    EACH_ROW {
        FIND_NEXT(0.5, 2, 6)
        if (here->quick) {
            weigh6(&across, fx);
            weigh6(&down, fy);
            WRITE_ALL(taps6(pixels + CHANNELS * (size_t)(place[i] - 2 * columns - 2), pitch, &across, &down, i))
            continue;
        }
        FIND
        SPLIT
        weigh6(&across, fx);
        weigh6(&down, fy);
        find_easy(easy, seen, column, line, fx, fy, 2, 6, &picture);
        ask_easy(easy, column, line, 2, 3, &picture);
        WRITE(easy, taps6(pixels + (line[i] - 2) * pitch + CHANNELS * (column[i] - 2), pitch, &across, &down, i),
              taps6_anywhere(&picture, column[i], line[i], fx[i], fy[i], &across, &down, i))
    }
}
