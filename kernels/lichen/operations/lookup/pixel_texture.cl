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

// The coordinates of `count` pixels, and behind them what divides them, if anything does.
LOOK_FN void locate(REAL y[MOST][SEGMENT], global const float *restrict in, global const REAL *restrict n, int channels,
                    int projective, int before, int after, int count)
{
    global const REAL *rows = n + 2 * MOST;
    REAL c[MOST][SEGMENT];
    for (int k = 0; k < MOST; k++) {
        bool used = false;
        for (int row = 0; row < DIMENSIONS + projective; row++)
            used |= rows[row * (MOST + 1) + k] != 0;
        if (!used)
            continue;
        REAL scale = n[k], bias = n[MOST + k];
        if (k >= channels)
            EACH c[k][i] = 0 * scale + bias;
        else if (count == SEGMENT && channels == 2)
            EACH c[k][i] = (REAL)in[i * 2 + k] * scale + bias;
        else if (count == SEGMENT && channels == 3)
            EACH c[k][i] = (REAL)in[i * 3 + k] * scale + bias;
        else if (count == SEGMENT && channels == 4)
            EACH c[k][i] = (REAL)in[i * 4 + k] * scale + bias;
        else
            EACH c[k][i] = (REAL)in[min(i, count - 1) * channels + k] * scale + bias;
        if (before)
            EACH c[k][i] = looked_up(c[k][i], n + TABLES + k * before, before);
    }
    for (int row = 0; row < DIMENSIONS + projective; row++) {
        global const REAL *m = rows + row * (MOST + 1);
        REAL added = m[MOST];
        EACH y[row][i] = added;
        for (int k = 0; k < MOST; k++) {
            REAL factor = m[k];
            if (factor != 0)
                EACH y[row][i] = y[row][i] + factor * c[k][i];
        }
        if (after)
            EACH y[row][i] = looked_up(y[row][i], n + TABLES + MOST * before + row * after, after);
    }
}

// Texels and weights along axis k from its coordinates. What is NaN is noted, and which pixels remain `easy`: where all
// texels lie inside, and none has weight 0.
LOOK_FN void split(Taps *taps, int k, const REAL *restrict y, int *restrict nan, int *restrict easy, int size, int unit)
{
    REAL factor = unit ? (REAL)size : (REAL)1;
    EACH {
        REAL u = y[i], place = u * factor;
        nan[i] |= u != u;
        place = place < -FARTHEST ? -FARTHEST : place;
        place = place > FARTHEST ? FARTHEST : place;
        place = u != u ? (REAL)0 : place;
#if TAPS > 1
        place = place - (REAL)0.5;
#endif
        int cut = (int)place, left = cut - ((REAL)cut > place);
        REAL t = place - (REAL)left;
        int cell = left - (TAPS == 4);
        taps->cell[k][i] = cell;
        easy[i] &= (cell >= 0) & (cell <= size - TAPS) & (u == u);
#if TAPS == 2
        taps->w[k][0][i] = (float)(1 - t);
        taps->w[k][1][i] = (float)t;
        easy[i] &= t > 0;
#elif TAPS == 4
        REAL half_t = (REAL)0.5 * t;
        taps->w[k][0][i] = (float)(half_t * ((2 - t) * t - 1));
        taps->w[k][1][i] = (float)((REAL)0.5 * (t * t * (3 * t - 5) + 2));
        taps->w[k][2][i] = (float)(half_t * ((4 - 3 * t) * t + 1));
        taps->w[k][3][i] = (float)(half_t * t * (t - 1));
        easy[i] &= t > 0;
#endif
    }
}

// The sum over an axis and those before it, where all texels lie inside: `p` is the first, two lie `step` floats apart.
LOOK_FN T one(global const float *p, const Taps *taps, const size_t *step, int i) { return LOAD(p); }
#if TAPS == 1
#define ALONG(name, axis, inner)                                                                                       \
    LOOK_FN T name(global const float *p, const Taps *taps, const size_t *step, int i)                                 \
    {                                                                                                                  \
        return inner(p, taps, step, i);                                                                                \
    }
#else
#define ALONG(name, axis, inner)                                                                                       \
    LOOK_FN T name(global const float *p, const Taps *taps, const size_t *step, int i)                                 \
    {                                                                                                                  \
        T sum = taps->w[axis][0][i] * inner(p, taps, step, i);                                                         \
        for (int j = 1; j < TAPS; j++)                                                                                 \
            sum = fma((T)(taps->w[axis][j][i]), inner(p + j * step[axis], taps, step, i), sum);                        \
        return sum;                                                                                                    \
    }
#endif
ALONG(sum1, 0, one)
#if DIMENSIONS == 1
#define SUM sum1
#elif DIMENSIONS == 2
#if MADE == 4 && TAPS == 2
// Two texels beside each other are one vector.
LOOK_FN T sum2(global const float *p, const Taps *taps, const size_t *step, int i)
{
    float8 both = fma((float8)(taps->w[1][1][i]), vload8(0, p + step[1]), taps->w[1][0][i] * vload8(0, p));
    return fma((T)(taps->w[0][1][i]), both.hi, taps->w[0][0][i] * both.lo);
}
#else
ALONG(sum2, 1, sum1)
#endif
#define SUM sum2
#elif DIMENSIONS == 3
ALONG(sum2, 1, sum1)
ALONG(sum3, 2, sum2)
#define SUM sum3
#else
ALONG(sum2, 1, sum1)
ALONG(sum3, 2, sum2)
ALONG(sum4, 3, sum3)
#define SUM sum4
#endif

// The same, called where there is little of it.
T summed(global const float *p, const Taps *taps, const size_t *step, int i) { return SUM(p, taps, step, i); }

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
    EACH behind[i] = nan[i] = 0;
    if (projective) {
        const int last = DIMENSIONS < MOST ? DIMENSIONS : 0;
        EACH behind[i] = y[last][i] <= 0;
        for (int k = 0; k < DIMENSIONS; k++)
            EACH y[k][i] = y[k][i] / (behind[i] ? (REAL)1 : y[last][i]);
    }
    EACH easy[i] = !behind[i] & (i < count);
    for (int k = 0; k < DIMENSIONS; k++)
        split(&found->taps, k, y[k], nan, easy, sizes[k], unit);
    int apart = 1, quick = 1;
    EACH place[i] = found->taps.cell[0][i];
    for (int k = 1; k < DIMENSIONS; k++) {
        apart *= sizes[k - 1];
        EACH place[i] += (int)((uint)apart * (uint)found->taps.cell[k][i]);
    }
    EACH quick &= easy[i];
    found->quick = quick;
#if MADE && DIMENSIONS == 2
    if (quick) {
        global const float *last = texels + (TAPS - 1) * (step[0] + step[1]);
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
    step[0] = made;
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
#if MADE
        if (here->quick) {
            EACH {
                const T sum = SUM(texels + (size_t)place[i] * MADE, taps, step, i);
                STORE(sum, to + i * MADE, pixels * MADE);
            }
            continue;
        }
#endif
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
