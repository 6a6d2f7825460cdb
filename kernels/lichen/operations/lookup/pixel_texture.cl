// Every pixel's channels as coordinates into a texture of DIMENSIONS axes; pixel_path.py is the definition.
//
// A work-item does SEGMENT neighbouring pixels in phases, each a loop over all of them: arithmetic is done in full
// vectors, and only texels are fetched pixel by pixel. Pixels that have all of their texels inside, none of weight 0,
// need no care, and where a whole segment needs none, they are summed without a branch.
//
// Definitions given at build time:
//   REAL               float or double: the precision of coordinates
//   DIMENSIONS, TAPS   1 to 4; 1 (nearest), 2 (linear) or 4 (cubic) texels along each axis
//   MADE               channels of the texture where they are 1, 3 or 4, so that a texel is one vector; else 0
// `n` holds 4 scales, 4 biases, 4 rows of 5 of the matrix, the background, and the tables before and after, 4 each of
// `before` and `after` entries, 0 for none. `sizes` holds the axes' sizes, then their borders.

#include "border.clh"
#include "stream.clh"

#define SEGMENT 64
#define EACH for (int i = 0; i < SEGMENT; i++)
#define MOST 4
#define FARTHEST ((REAL)1073741824.0)
#define TABLES 29
#define LOOK_FN static inline __attribute__((always_inline))

#if MADE == 4
#define T float4
#define LOAD(p) vload4(0, p)
#define STORE(value, to, samples) stream_store4(value, to, samples)
#elif MADE == 3
#define T float3
#define LOAD(p) vload3(0, p)
#define STORE(value, to, samples) vstore3(value, 0, to)
#else
#define T float
#define LOAD(p) (*(p))
#define STORE(value, to, samples) *(to) = value
#endif

// Of a segment: the first texel along each axis, and all weights.
typedef struct {
    int cell[DIMENSIONS][SEGMENT];
    float w[DIMENSIONS][TAPS][SEGMENT];
} Taps;

inline REAL looked_up(REAL x, global const REAL *restrict table, int entries)
{
    REAL place = (x < 0 ? (REAL)0 : (x > 1 ? (REAL)1 : x)) * (REAL)(entries - 1);
    int cell = x == x ? clamp((int)place, 0, max(entries - 2, 0)) : 0;
    REAL part = place - (REAL)cell, value = table[cell];
    return value + part * (table[min(cell + 1, entries - 1)] - value);
}

// Adds a factor times a channel of `count` pixels, which lie from `in` on.
LOOK_FN void add_channel(REAL *restrict y, REAL factor, global const float *restrict in, int k, int channels, REAL scale,
                         REAL bias, int count)
{
    if (k >= channels)
        EACH y[i] = y[i] + factor * (0 * scale + bias);
    else if (count == SEGMENT && channels == 2)
        EACH y[i] = y[i] + factor * ((REAL)in[i * 2 + k] * scale + bias);
    else if (count == SEGMENT && channels == 3)
        EACH y[i] = y[i] + factor * ((REAL)in[i * 3 + k] * scale + bias);
    else if (count == SEGMENT && channels == 4)
        EACH y[i] = y[i] + factor * ((REAL)in[i * 4 + k] * scale + bias);
    else
        EACH y[i] = y[i] + factor * ((REAL)in[min(i, count - 1) * channels + k] * scale + bias);
}

// The coordinates of `count` pixels, and behind them what divides them, if anything does.
LOOK_FN void locate(REAL y[MOST][SEGMENT], global const float *restrict in, global const REAL *restrict n, int channels,
                    int projective, int before, int after, int count)
{
    for (int row = 0; row < DIMENSIONS + projective; row++) {
        global const REAL *m = n + 2 * MOST + row * (MOST + 1);
        REAL added = m[MOST];
        EACH y[row][i] = added;
        for (int k = 0; k < MOST; k++) {
            REAL factor = m[k], scale = n[k], bias = n[MOST + k];
            if (factor == 0)
                continue;
            if (!before) {
                add_channel(y[row], factor, in, k, channels, scale, bias, count);
                continue;
            }
            REAL c[SEGMENT];
            EACH c[i] = 0;
            add_channel(c, 1, in, k, channels, scale, bias, count);
            EACH y[row][i] = y[row][i] + factor * looked_up(c[i], n + TABLES + k * before, before);
        }
        if (after)
            EACH y[row][i] = looked_up(y[row][i], n + TABLES + MOST * before + row * after, after);
    }
}

// Weights of texels from the fraction t of a place.
LOOK_FN void weigh(Taps *taps, int k, int i, REAL t)
{
#if TAPS == 2
    taps->w[k][0][i] = (float)(1 - t);
    taps->w[k][1][i] = (float)t;
#elif TAPS == 4
    REAL half_t = (REAL)0.5 * t;
    taps->w[k][0][i] = (float)(half_t * ((2 - t) * t - 1));
    taps->w[k][1][i] = (float)((REAL)0.5 * (t * t * (3 * t - 5) + 2));
    taps->w[k][2][i] = (float)(half_t * ((4 - 3 * t) * t + 1));
    taps->w[k][3][i] = (float)(half_t * t * (t - 1));
#endif
}

#define MIDDLE (TAPS > 1 ? (REAL)0.5 : (REAL)0)

// The first texels and all weights of a segment whose pixels need no care, and whether that holds for all of them: else
// what was written means nothing.
LOOK_FN int split_quick(Taps *taps, int *restrict place, REAL y[MOST][SEGMENT], global const int *restrict sizes,
                        int unit)
{
    int all = 1;
    uint apart = 1;
    for (int k = 0; k < DIMENSIONS; k++) {
        const REAL factor = unit ? (REAL)sizes[k] : (REAL)1, low = TAPS / 4, high = sizes[k] - TAPS / 2;
        EACH {
            const REAL at = y[k][i] * factor - MIDDLE;
            REAL inside = at > low ? at : low;
            inside = inside < high ? inside : high;
            const int left = (int)inside;
            const REAL t = inside - (REAL)left;
            weigh(taps, k, i, t);
            place[i] = (int)(apart * (uint)(left - TAPS / 4) + (k ? (uint)place[i] : 0));
            all &= TAPS > 1 ? t > 0 : (at >= low) & (at < high);
        }
        apart *= sizes[k];
    }
    return all;
}

// Texels and weights along axis k from its coordinates. What is NaN is noted, and which pixels remain `easy`: where all
// texels lie inside, and none has weight 0; of two, where those inside have all of the weight. A place beyond a clamped
// end is that end itself, where there are two.
LOOK_FN void split(Taps *taps, int k, const REAL *restrict y, int *restrict nan, int *restrict easy, int size,
                   int border, int unit)
{
    REAL factor = unit ? (REAL)size : (REAL)1;
    const int ends = TAPS == 2 && border == BORDER_CLAMP;
    EACH {
        REAL u = y[i], place = u * factor;
        nan[i] |= u != u;
        place = place < -FARTHEST ? -FARTHEST : place;
        place = place > FARTHEST ? FARTHEST : place;
        place = u != u ? (REAL)0 : place;
        place = place - MIDDLE;
        place = ends && place < 0 ? 0 : place;
        place = ends && place > size - 1 ? size - 1 : place;
        int cut = (int)place, left = cut - ((REAL)cut > place);
        REAL t = place - (REAL)left;
        int cell = left - TAPS / 4;
        taps->cell[k][i] = cell;
        weigh(taps, k, i, t);
        easy[i] &= (cell >= 0) & (cell + (TAPS == 2 ? t > 0 : TAPS - 1) < size) & ((TAPS < 4) | (t > 0)) & (u == u);
    }
}

// The sum over an axis and those before it: `p` is the first texel, two lie `step` floats apart. `all`, a literal: all
// texels lie inside and have a weight; else of two one of weight 0 is not read, since it may lie outside, or be NaN.
LOOK_FN T one(global const float *p, const Taps *taps, const size_t *step, int i, const int all) { return LOAD(p); }
#if TAPS == 1
#define ALONG(name, axis, inner)                                                                                       \
    LOOK_FN T name(global const float *p, const Taps *taps, const size_t *step, int i, const int all)                  \
    {                                                                                                                  \
        return inner(p, taps, step, i, all);                                                                           \
    }
#else
#define ALONG(name, axis, inner)                                                                                       \
    LOOK_FN T name(global const float *p, const Taps *taps, const size_t *step, int i, const int all)                  \
    {                                                                                                                  \
        const T first = inner(p, taps, step, i, all);                                                                  \
        if (TAPS == 2 && !all && taps->w[axis][1][i] == 0.0f)                                                          \
            return first;                                                                                              \
        T sum = taps->w[axis][0][i] * first;                                                                           \
        for (int j = 1; j < TAPS; j++)                                                                                 \
            sum = fma((T)(taps->w[axis][j][i]), inner(p + j * step[axis], taps, step, i, all), sum);                   \
        return sum;                                                                                                    \
    }
#endif
#if DIMENSIONS == 1
ALONG(blend, 0, one)
#elif DIMENSIONS == 2 && TAPS == 2
// Two texels beside each other are one vector: down comes first.
ALONG(down, 1, one)
ALONG(across, 0, down)
LOOK_FN T blend(global const float *p, const Taps *taps, const size_t *step, int i, const int all)
{
#if MADE == 4
    if (all) {
        float8 both = fma((float8)(taps->w[1][1][i]), vload8(0, p + step[1]), taps->w[1][0][i] * vload8(0, p));
        return fma((T)(taps->w[0][1][i]), both.hi, taps->w[0][0][i] * both.lo);
    }
#endif
    return across(p, taps, step, i, all);
}
#elif DIMENSIONS == 2
ALONG(across, 0, one)
ALONG(blend, 1, across)
#elif DIMENSIONS == 3
ALONG(across, 0, one)
ALONG(down, 1, across)
ALONG(blend, 2, down)
#else
ALONG(across, 0, one)
ALONG(down, 1, across)
ALONG(deep, 2, down)
ALONG(blend, 3, deep)
#endif

// The same, called where there is little of it.
T summed(global const float *p, const Taps *taps, const size_t *step, int i) { return blend(p, taps, step, i, 0); }

// The sum of channel c of pixel i with care: a texel may lie beyond a border, and one of weight 0 is not read, since it
// may be NaN. With MADE, all channels.
T anywhere(global const float *restrict texels, const Taps *taps, global const int *restrict sizes, int made, int c,
           float background, int i)
{
    int at[MOST][TAPS];
    float weight[MOST][TAPS];
    for (int k = 0; k < MOST; k++)
        for (int j = 0; j < TAPS; j++) {
            const int axis = min(k, DIMENSIONS - 1), index = taps->cell[axis][i] + j;
            at[k][j] = k < DIMENSIONS ? border_index(index, sizes[k], sizes[MOST + k]) : 0;
            weight[k][j] = k < DIMENSIONS && TAPS > 1 ? taps->w[axis][j][i] : 1.0f;
        }
    T total = (T)(0.0f);
    for (int l = 0; l < (DIMENSIONS > 3 ? TAPS : 1); l++)
        for (int m = 0; m < (DIMENSIONS > 2 ? TAPS : 1); m++)
            for (int j = 0; j < (DIMENSIONS > 1 ? TAPS : 1); j++) {
                float outer = weight[3][l] * weight[2][m] * weight[1][j];
                int beyond = (at[3][l] | at[2][m] | at[1][j]) < 0;
                size_t line = sizes[0] * (at[1][j] + (size_t)sizes[1] * (at[2][m] + (size_t)sizes[2] * at[3][l]));
                for (int o = 0; o < TAPS; o++) {
                    float w = outer * weight[0][o];
                    if (w == 0.0f)
                        continue;
                    T texel = (T)(background);
                    if (!beyond && at[0][o] >= 0)
                        texel = LOAD(texels + (line + at[0][o]) * made + c);
                    total += w * texel;
                }
            }
    return total;
}

// What is found of a segment before texels come: `quick` where all of its pixels are easy.
typedef struct {
    Taps taps;
    int place[SEGMENT], behind[SEGMENT], nan[SEGMENT], easy[SEGMENT], quick;
} Found;

// `count` pixels of the image lie from `in` on; two texels along axis k lie step[k] floats apart.
LOOK_FN void find(Found *found, global const float *restrict in, global const float *restrict texels,
                  global const REAL *restrict n, global const int *restrict sizes, int channels, int unit,
                  int projective, int before, int after, int count, const size_t *step)
{
    REAL y[MOST][SEGMENT];
    int *behind = found->behind, *nan = found->nan, *easy = found->easy, *place = found->place;
    locate(y, in, n, channels, projective, before, after, count);
    int quick = count == SEGMENT;
    if (projective) {
        const int last = DIMENSIONS < MOST ? DIMENSIONS : 0;
        EACH behind[i] = y[last][i] <= 0;
        for (int k = 0; k < DIMENSIONS; k++)
            EACH y[k][i] = y[k][i] / (behind[i] ? (REAL)1 : y[last][i]);
        EACH quick &= !behind[i];
    }
    quick = quick && split_quick(&found->taps, place, y, sizes, unit);
    found->quick = quick;
    if (!quick) {
        if (!projective)
            EACH behind[i] = 0;
        EACH nan[i] = 0;
        EACH easy[i] = !behind[i] & (i < count);
        for (int k = 0; k < DIMENSIONS; k++)
            split(&found->taps, k, y[k], nan, easy, sizes[k], sizes[MOST + k], unit);
        int apart = 1;
        EACH place[i] = found->taps.cell[0][i];
        for (int k = 1; k < DIMENSIONS; k++) {
            apart *= sizes[k - 1];
            EACH place[i] += (int)((uint)apart * (uint)found->taps.cell[k][i]);
        }
    }
#if MADE && DIMENSIONS == 2
    if (quick) {
        global const float *last = texels + (TAPS - 1) * step[1];
        EACH {
            stream_ask(texels + (size_t)place[i] * MADE);
            stream_ask(last + (size_t)place[i] * MADE);
        }
    }
#endif
}

// A work-item does ROWS segments, a definition given at build time, one below the other, which share most of their
// texels, and finds each while the texels of the one before come from memory: they lie apart, where no processor sees them
// coming.
kernel void lookup(global const float *restrict in, global const float *restrict texels, global float *restrict out,
                   global const REAL *restrict n, global const int *restrict sizes, int channels, int made, int unit,
                   int projective, int before, int after, int width, int height)
{
    int column = get_global_id(0) * SEGMENT, begin = get_global_id(1) * ROWS, end = min(begin + ROWS, height);
    if (column >= width || begin >= end)
        return;
    int count = min(SEGMENT, width - column);
    ulong pixels = (ulong)width * height;
    float background = (float)n[28];
    size_t step[MOST];
    step[0] = MADE ? MADE : made;
    for (int k = 1; k < DIMENSIONS; k++)
        step[k] = step[k - 1] * sizes[k - 1];
    Found both[2];
    for (int ahead = begin; ahead <= end; ahead++) {
        if (ahead < end)
            find(both + (ahead & 1), in + ((size_t)ahead * width + column) * channels, texels, n, sizes, channels, unit,
                 projective, before, after, count, step);
        if (ahead == begin)
            continue;
        const Found *here = both + (~ahead & 1);
        const Taps *taps = &here->taps;
        global float *to = out + ((size_t)(ahead - 1) * width + column) * made;
        const int *place = here->place;
        if (here->quick) {
            EACH for (int c = 0; c < (MADE ? 1 : made); c++) {
                const T value = blend(texels + place[i] * step[0] + c, taps, step, i, 1);
                STORE(value, to + i * step[0] + c, pixels * MADE);
            }
            continue;
        }
        for (int i = 0; i < count; i++)
            for (int c = 0; c < (MADE ? 1 : made); c++)
                if (here->easy[i])
                    STORE(summed(texels + (size_t)place[i] * made + c, taps, step, i), to + (size_t)i * made + c, 0);
                else {
                    T value = here->nan[i] ? (T)(NAN) : (T)(background);
                    if (!here->nan[i] & !here->behind[i])
                        value = anywhere(texels, taps, sizes, made, c, background, i);
                    STORE(value, to + (size_t)i * made + c, 0);
                }
    }
}
