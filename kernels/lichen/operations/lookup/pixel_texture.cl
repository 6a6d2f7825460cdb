// Every pixel's channels as coordinates into a texture of DIMENSIONS axes; pixel_path.py is the definition.
//
// Definitions given at build time:
//   REAL               float or double: the precision of coordinates
//   DIMENSIONS, TAPS   1 to 4; 1 (nearest), 2 (linear) or 4 (cubic) texels along each axis
//   MADE               channels of the texture where they are 1, 3 or 4, so that a texel is one vector; else 0
// `n` holds 4 scales, 4 biases, 4 rows of 5 of the matrix, the background, and the tables before and after, 4 each of
// `before` and `after` entries, 0 for none. `sizes` holds the axes' sizes, then their borders.

#include "border.clh"
#include "numeric.clh"

#define SEGMENT 64
#define MOST 4
#define FARTHEST ((REAL)1073741824.0)
#define TABLES 29
#define TOTAL (1 << ((TAPS >> 1) * DIMENSIONS)) // TAPS to the power of DIMENSIONS

#if MADE == 4
#define T float4
#define LOAD(from, i) vload4(i, from)
#define STORE(value, to, i) vstore4(value, i, to)
#elif MADE == 3
#define T float3
#define LOAD(from, i) vload3(i, from)
#define STORE(value, to, i) vstore3(value, i, to)
#else
#define T float
#define LOAD(from, i) (from)[i]
#define STORE(value, to, i) (to)[i] = value
#endif

inline REAL looked_up(REAL x, global const REAL *restrict table, int entries)
{
    REAL place = (x < 0 ? (REAL)0 : (x > 1 ? (REAL)1 : x)) * (REAL)(entries - 1);
    int cell = x == x ? clamp((int)place, 0, max(entries - 2, 0)) : 0;
    REAL part = place - (REAL)cell, value = table[cell];
    return value + part * (table[min(cell + 1, entries - 1)] - value);
}

kernel void lookup(global const float *restrict in, global const float *restrict texels, global float *restrict out,
                   global const REAL *restrict n, global const int *restrict sizes, int channels, int made, int unit,
                   int projective, int before, int after, ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT, last = min(first + SEGMENT, pixels);
    float background = (float)n[28];
    for (ulong i = first; i < last; i++) {
        REAL c[MOST], y[MOST + 1];
        for (int k = 0; k < MOST; k++) {
            c[k] = (k < channels ? (REAL)in[i * channels + k] : (REAL)0) * n[k] + n[MOST + k];
            if (before)
                c[k] = looked_up(c[k], n + TABLES + k * before, before);
        }
        for (int row = 0; row < DIMENSIONS + projective; row++) {
            global const REAL *m = n + 2 * MOST + row * (MOST + 1);
            REAL total = m[MOST];
            for (int k = 0; k < MOST; k++)
                if (m[k] != 0)
                    total = total + m[k] * c[k];
            y[row] = after ? looked_up(total, n + TABLES + MOST * before + row * after, after) : total;
        }
        bool behind = projective && y[DIMENSIONS] <= 0, nan = false;
        int at[DIMENSIONS][TAPS];
        float weight[DIMENSIONS][TAPS];
        for (int k = 0; k < DIMENSIONS; k++) {
            REAL u = projective ? y[k] / (behind ? (REAL)1 : y[DIMENSIONS]) : y[k];
            nan |= u != u;
            REAL place = unit ? u * (REAL)sizes[k] : u;
            place = u != u ? (REAL)0 : (place < -FARTHEST ? -FARTHEST : (place > FARTHEST ? FARTHEST : place));
#if TAPS == 1
            at[k][0] = border_index((int)floor(place), sizes[k], sizes[MOST + k]);
            weight[k][0] = 1.0f;
#else
            place = place - (REAL)0.5;
            REAL left = floor(place), t = place - left;
            for (int j = 0; j < TAPS; j++)
                at[k][j] = border_index((int)left - (TAPS / 2 - 1) + j, sizes[k], sizes[MOST + k]);
#if TAPS == 2
            weight[k][0] = (float)(1 - t);
            weight[k][1] = (float)t;
#else
            REAL half_t = (REAL)0.5 * t;
            weight[k][0] = (float)(half_t * ((2 - t) * t - 1));
            weight[k][1] = (float)((REAL)0.5 * (t * t * (3 * t - 5) + 2));
            weight[k][2] = (float)(half_t * ((4 - 3 * t) * t + 1));
            weight[k][3] = (float)(half_t * t * (t - 1));
#endif
#endif
        }
        // A texel of weight 0 is not read: it may be NaN. Where the channels are many, every tap is found once for all.
#if MADE
        T total = (T)(0.0f);
#else
        int tap[TOTAL], taken = 0;
        float share[TOTAL];
#endif
#if DIMENSIONS >= 4
        for (int l = 0; l < TAPS; l++)
#endif
#if DIMENSIONS >= 3
        for (int m = 0; m < TAPS; m++)
#endif
#if DIMENSIONS >= 2
        for (int j = 0; j < TAPS; j++)
#endif
        for (int o = 0; o < TAPS; o++) {
            int index = at[0][o], plane = sizes[0];
            float w = 1.0f;
            bool outside = at[0][o] < 0;
#if DIMENSIONS >= 4
            w *= weight[3][l];
#endif
#if DIMENSIONS >= 3
            w *= weight[2][m];
#endif
#if DIMENSIONS >= 2
            w *= weight[1][j], index += plane * at[1][j], plane *= sizes[1], outside |= at[1][j] < 0;
#endif
#if DIMENSIONS >= 3
            index += plane * at[2][m], plane *= sizes[2], outside |= at[2][m] < 0;
#endif
#if DIMENSIONS >= 4
            index += plane * at[3][l], outside |= at[3][l] < 0;
#endif
            w *= weight[0][o];
            if (w == 0.0f)
                continue;
#if MADE
            T texel = (T)(background);
            if (!outside)
                texel = LOAD(texels, index);
            total += w * texel;
#else
            tap[taken] = outside ? -1 : index;
            share[taken++] = w;
#endif
        }
#if MADE
        STORE(nan ? (T)(NAN) : (behind ? (T)(background) : total), out, i);
#else
        for (int c = 0; c < made; c++) {
            float total = 0.0f;
            for (int k = 0; k < taken; k++)
                total += share[k] * (tap[k] < 0 ? background : texels[(size_t)tap[k] * made + c]);
            out[i * made + c] = nan ? NAN : (behind ? background : total);
        }
#endif
    }
}
