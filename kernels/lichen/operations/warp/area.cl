/* Warps that take what a whole pixel sees: EWA, supersampling, and trilinear sampling of a pyramid.
 * `sizes` has three numbers for each level of the pyramid: where it starts in `pyramid`, counted in pixels, its width
 * and its height; level 0 is the picture itself. `means` is the mean of the picture. */

#include "ellipses_beyond.clh"

#define ARGUMENTS                                                                                                      \
    global const double *restrict matrix, global const double *restrict table, global const float *restrict steps,     \
        int width, int top, int height, global const float *restrict pixels, int columns, int rows, int border,        \
        float value,                                                                                                   \
        global float *restrict out, int stride, int channel, global const float *restrict pyramid,                     \
        global const int *restrict sizes, int levels, global const float *restrict means

#define BEGIN                                                                                                          \
    const int first = get_global_id(0) * SEGMENT, below = get_global_id(1), row = top + below;                         \
    if (first >= width || below >= height) return;                                                                     \
    const Picture picture = {pixels, columns, rows, border, value};                                                    \
    double x[SEGMENT], y[SEGMENT];                                                                                     \
    float xu[SEGMENT], yu[SEGMENT], xv[SEGMENT], yv[SEGMENT];                                                          \
    int seen[SEGMENT];                                                                                                 \
    locate(x, y, matrix, table, first, row, below, width);                                                             \
    derive(xu, yu, xv, yv, x, y, matrix, steps, first, row, below, width);                                             \
    Shapes shapes;                                                                                                     \
    shape(&shapes, xu, yu, xv, yv);                                                                                    \
    from_corner(x, y, matrix);                                                                                         \
    fold(x, y, &picture);                                                                                              \
    EACH {                                                                                                             \
        seen[i] = fabs(x[i]) < INFINITY && fabs(y[i]) < INFINITY;                                                      \
        x[i] = within(x[i]);                                                                                           \
        y[i] = within(y[i]);                                                                                           \
    }                                                                                                                  \
    const int count = min(SEGMENT, width - first);                                                                     \
    const size_t start = (size_t)row * width + first;

inline Picture level_of(const Picture *picture, global const float *pyramid, global const int *sizes, int level) {
    if (level == 0) return *picture;
    const Picture made = {pyramid + (size_t)CHANNELS * sizes[3 * level], sizes[3 * level + 1], sizes[3 * level + 2],
                          picture->border, picture->value};
    return made;
}

inline int beyond(const Picture *picture, const Shapes *shapes, int i) {
    const float w = picture->width, t = picture->height, cc = shapes->cc[i], ss = shapes->ss[i];
    return (cc * shapes->major[i] + ss * shapes->minor[i] > w * w) | (ss * shapes->major[i] + cc * shapes->minor[i] > t * t);
}

inline T mixed(T sharp, T soft, float t) {
    return t == 0.0f ? sharp : (t == 1.0f ? soft : fma((T)(t), soft, (1.0f - t) * sharp));
}

/* Begins to fetch what the row of pixels below will need first: the sample of each at the corner of 7 x 7 that moves
 * ahead. The items beside take that row next, and a tilted picture's lines lie too far apart to be seen coming. */
inline void ask_next(const int *restrict column, const int *restrict line, const float *restrict xv,
                     const float *restrict yv, const Picture *picture) {
    const float w = picture->width - 1, t = picture->height - 1;
    int at[SEGMENT];
    EACH {
        float x = column[i] + xv[i] + (xv[i] < 0.0f ? -3.0f : 3.0f), y = line[i] + yv[i] + (yv[i] < 0.0f ? -3.0f : 3.0f);
        x = x > 0.0f ? x : 0.0f;
        y = y > 0.0f ? y : 0.0f;
        at[i] = (int)(y < t ? y : t) * picture->width + (int)(x < w ? x : w);
    }
    for (int i = 0; i < SEGMENT; ++i) stream_ask(picture->pixels + (size_t)CHANNELS * at[i]);
}

/* What the map does not shrink is interpolated from 6 x 6 samples; SOFT gives the average of what it does, for all pixels
 * of `soft[i]` that are in their ellipse's stead neither background nor beyond it. */
#define SHARP                                                                                                          \
    int column[SEGMENT], line[SEGMENT], easy[SEGMENT];                                                                 \
    float fx[SEGMENT], fy[SEGMENT], blend[SEGMENT];                                                                    \
    T sharp[SEGMENT], soft[SEGMENT];                                                                                   \
    split_both(column, line, fx, fy, easy, x, y);                                                                      \
    ask_next(column, line, xv, yv, &picture);                                                                          \
    int shrinking = 0, growing = 0;                                                                                    \
    EACH {                                                                                                             \
        blend[i] = seen[i] ? blend_of(shapes.rho[i]) : 0.0f;                                                    \
        shrinking |= blend[i] > 0.0f;                                                                                  \
        growing |= blend[i] < 1.0f;                                                                                    \
    }                                                                                                                  \
    if (growing) {                                                                                                     \
        Six across, down;                                                                                              \
        weigh6(&across, fx);                                                                                           \
        weigh6(&down, fy);                                                                                             \
        find_easy(easy, seen, column, line, fx, fy, 2, 6, &picture);                                                   \
        const size_t pitch = (size_t)CHANNELS * columns;                                                               \
        for (int i = 0; i < count; ++i)                                                                                \
            if (easy[i] && blend[i] < 1.0f)                                                                            \
                sharp[i] = taps6(pixels + (line[i] - 2) * pitch + CHANNELS * (column[i] - 2), pitch, &across, &down, i); \
        for (int i = 0; i < count; ++i)                                                                                \
            if (!easy[i] && blend[i] < 1.0f)                                                                           \
                sharp[i] = seen[i] ? taps6_anywhere(&picture, column[i], line[i], fx[i], fy[i], &across, &down, i)     \
                                   : (T)(value);                                                                       \
    }                                                                                                                  \
    int large[SEGMENT];                                                                                                \
    EACH large[i] = beyond(&picture, &shapes, i);                                                                      \
    if (shrinking) {                                                                                                   \
        const T mean = LOAD(means);                                                                                    \
        for (int i = 0; i < count; ++i)                                                                                \
            if (large[i] && blend[i] > 0.0f) soft[i] = distant(&picture, mean, x[i], y[i], &shapes, i);                \
    }

#define FINISH                                                                                                         \
    for (int i = 0; i < count; ++i) put(out, start + i, stride, channel, mixed(sharp[i], soft[i], blend[i]));

#define SOME 16
kernel void ewa(ARGUMENTS, float samples, float reach, float most) {
    BEGIN
    SHARP
    if (shrinking) {
        Ellipses at;
        place(&at, x, y, &shapes, levels, samples, reach, most);
        Windows in;
        frame(&in, &at);
        const float limit = reach * reach;
        /* what lies on the rim is inside; beyond a radius of 3 lies 1.5e-8 of the weight */
        const float cut = reach < 3.0f ? 0.9999f * num_exp(-2.0f * limit) : 0.0f;
        /* 0: nothing to do, 1: small, 2: inside, 3: near the border, 4: wholly beyond a constant one, 5: tiny,
         * 6: one of these, with what is not finite beside the ellipse or in it */
        int way[SEGMENT];
        int wide[SEGMENT], tall[SEGMENT], deep = 0;
        EACH {
            deep |= at.level[i];
            wide[i] = columns;
            tall[i] = rows;
        }
        if (deep)
            EACH {
                const int level = at.level[i];
                wide[i] = level ? sizes[3 * level + 1] : columns;
                tall[i] = level ? sizes[3 * level + 2] : rows;
            }
        EACH {
            const float from = at.fx[i] - at.wide[i], above = at.fy[i] - at.tall[i];
            const float left = (float)at.column[i] + (float)whole_below(from > -1e9f ? from : -1e9f);
            const float right = (float)at.column[i] + at.fx[i] + at.wide[i] + 8.0f;
            const float top_ = (float)at.row[i] + (float)whole_below(above > -1e9f ? above : -1e9f);
            const float bottom = (float)at.row[i] + at.fy[i] + at.tall[i] + 1.0f;
            const float most = (float)wide[i], lowest = (float)tall[i];
            const int small = at.wide[i] <= TINY, tiny = small & (at.tall[i] <= TINY);
            const int under = (bottom < lowest) & (!tiny | (top_ + (TALL + 1.0f) < lowest));
            const int inside = (left >= 0.0f) & (top_ >= 0.0f) & (right < most) & under;
            const int beside = (left >= most) | (top_ >= lowest) | (right < 8.0f) | (bottom < 1.0f);
            const int edge = (border == BORDER_CONSTANT) & beside ? 4 : 3;
            way[i] = (i >= count) | large[i] | !(blend[i] > 0.0f) ? 0 : (inside ? (tiny ? 5 : 2 - small) : edge);
        }
        /* some at a time, and one thing of them after another: a processor then works on many pixels at once */
        T holes = (T)(0.0f);
        for (int begin = 0; begin < count; begin += SOME) {
            float8 lines[SOME], changes[SOME];
            for (int k = 0; k < SOME; ++k) {
                lines[k] = first_row(&in, begin + k, at.xx[begin + k]);
                changes[k] = change_of(&in, begin + k);
            }
            for (int k = 0; k < SOME; ++k) {
                const int i = begin + k, level = at.level[i];
                if (way[i] != 5) continue;
                global const float *from = level ? pyramid + (size_t)CHANNELS * sizes[3 * level] : pixels;
                from += CHANNELS * ((at.row[i] + in.top[i]) * (size_t)wide[i] + at.column[i] + in.left[i]);
                soft[i] = window_sum(lines + k, from, CHANNELS * (size_t)wide[i], &in, i, lines[k], changes[k], cut);
            }
            for (int k = 0; k < SOME; ++k) {
                const int i = begin + k;
                if (way[i] != 5) continue;
                soft[i] = soft[i] / total8(lines[k]);
                holes += soft[i] - soft[i];
            }
        }
        if (!finite(holes))
            for (int i = 0; i < count; ++i)
                if (way[i] == 5 && !finite(soft[i])) way[i] = 6;
        for (int i = 0; i < count; ++i) {
            if (way[i] != 1 && way[i] != 2) continue;
            const int level = at.level[i];
            global const float *from = level ? pyramid + (size_t)CHANNELS * sizes[3 * level] : pixels;
            soft[i] = way[i] == 1 ? ellipse_small(from, wide[i], &at, i, limit)
                                  : ellipse_inside(from, wide[i], &at, i, limit);
            if (!finite(soft[i])) way[i] = 6;
        }
        for (int i = 0; i < count; ++i) {
            if (way[i] == 4) soft[i] = (T)(value);
            if (way[i] != 3 && way[i] != 6) continue;
            const Picture taken = level_of(&picture, pyramid, sizes, at.level[i]);
            const int tiny = at.wide[i] <= TINY && at.tall[i] <= TINY;
            if (way[i] == 3 && (tiny || border < BORDER_RING)) {
                const int open_ = border == BORDER_CONSTANT || border == BORDER_CLAMP;
                soft[i] = tiny    ? window_beyond(&taken, &at, &in, i, cut)
                          : open_ ? ellipse_across(&taken, &at, i, limit)
                                  : ellipse_repeated(&taken, &at, i, limit);
                if (finite(soft[i])) continue;
            }
            soft[i] = ellipse_anywhere(&taken, &at, i, limit);
        }
    }
    FINISH
}

/* `grid` holds u, v and weight of each sample in the pixel's own frame. */
inline T supersampled(const Picture *picture, int column, int row, float fx, float fy, const Shapes *shapes, int i,
                      global const float *grid, int samples) {
    const float big = sqrt(shapes->major[i]), small = sqrt(shapes->minor[i]);
    const float xx = shapes->cc[i] * big + shapes->ss[i] * small, xy = shapes->cs[i] * (big - small);
    const float yy = shapes->ss[i] * big + shapes->cc[i] * small;
    T sum = (T)(0.0f);
    for (int k = 0; k < samples; ++k) {
        const float u = grid[3 * k], v = grid[3 * k + 1];
        const float x = fx + fma(xx, u, xy * v), y = fy + fma(xy, u, yy * v);
        const float left = floor(x), top = floor(y);
        sum = fma((T)(grid[3 * k + 2]), bilinear(picture, column + (int)left, row + (int)top, x - left, y - top), sum);
    }
    return sum;
}

kernel void super(ARGUMENTS, global const float *restrict grid, int samples) {
    BEGIN
    SHARP
    for (int i = 0; i < count; ++i)
        if (blend[i] > 0.0f && !large[i])
            soft[i] = supersampled(&picture, column[i], line[i], fx[i], fy[i], &shapes, i, grid, samples);
    FINISH
}

inline T bilinear_at(const Picture *picture, double x, double y) {
    const double left = floor(x), top = floor(y);
    return bilinear(picture, (int)left, (int)top, (float)(x - left), (float)(y - top));
}

kernel void mip(ARGUMENTS) {
    BEGIN
    for (int i = 0; i < count; ++i) {
        if (!seen[i]) {
            put(out, start + i, stride, channel, (T)(value));
            continue;
        }
        const float rho = shapes.rho[i], most = (float)(levels - 1);
        float detail = rho > 1.0f ? log2(rho) : 0.0f;
        detail = detail < most ? detail : most;
        const int lower = (int)detail, upper = min(lower + 1, levels - 1);
        const double a = ldexp(1.0, -lower), b = ldexp(1.0, -upper);
        const float share = detail - (float)lower;
        const Picture fine = level_of(&picture, pyramid, sizes, lower), coarse = level_of(&picture, pyramid, sizes, upper);
        const T sharp = bilinear_at(&fine, fma(x[i], a, -0.5), fma(y[i], a, -0.5));
        T made = sharp;
        if (share > 0.0f) made = fma((T)(share), bilinear_at(&coarse, fma(x[i], b, -0.5), fma(y[i], b, -0.5)), (1.0f - share) * sharp);
        put(out, start + i, stride, channel, made);
    }
}
