/* Line integral convolution by whole pixels: Euler steps through the vectors of pixels, reading texels as they are.
 *
 * As in lic.cl, one work-item follows a SEGMENT of neighbouring pixels, and positions are relative to where a line began.
 * Built with SAME (whether texture and field are of one size) and ARC (whether lines go by arc length).
 */

#include "field.clh"

#if SAME
#define TEXEL_AT(x, y, cell) ((cell) * stride)
#else
#define TEXEL_AT(x, y, cell) (whole_texel(y, scale_y, texture_height) * texture_width + whole_texel(x, scale_x, texture_width)) * stride
inline int whole_texel(float x, float scale, int size) {
    return min((int)(x * scale), size - 1);
}
#endif

/* A step as `walk` reads it; zero where a line ends. Directions fit into 32 bits, in units of 1 / 32767, and are gathered
 * in two thirds of the time that pairs of floats take; steps in time keep their range. */
#if ARC
typedef int Step;
inline float step_x(Step s) { return (float)((s << 16) >> 16); }
inline float step_y(Step s) { return (float)(s >> 16); }
#else
typedef ulong Step;
inline float step_x(Step s) { return as_float((uint)s); }
inline float step_y(Step s) { return as_float((uint)(s >> 32)); }
#endif

kernel void prepare(global const float *restrict image, global Step *restrict steps, int count, int stride, float scale,
                    float bias, float limit) {
    const int first = get_global_id(0) * SEGMENT;
    float x[SEGMENT], y[SEGMENT];
    Step step[SEGMENT];
    vectors_at(x, y, image, first, count, stride, scale, bias, limit);
    EACH {
        const float u = fabs(x[i]), v = fabs(y[i]), m = u > v ? u : v;
        const int moves = (m > 0.0f) & (x[i] == x[i]);
#if ARC
        const float s = power_near(m), along = 32767.0f / sqrt(fma(x[i] * s, x[i] * s, y[i] * s * (y[i] * s)));
        const int h = (int)rint(moves ? x[i] * s * along : 0.0f), k = (int)rint(moves ? y[i] * s * along : 0.0f);
        step[i] = (h & 0xffff) | (k << 16);
#else
        step[i] = moves ? (ulong)as_uint(x[i]) | (ulong)as_uint(y[i]) << 32 : 0;
#endif
    }
    for (int i = 0; i < SEGMENT && first + i < count; ++i) steps[first + i] = step[i];
}

/* Euler steps through the vectors of whole pixels, reading whole texels: one channel of the texture at a time. */
kernel void walk(global const Step *restrict steps, global const float *restrict texture,
                 global const float *restrict weights, global float *restrict result, int width, int height,
                 int texture_width, int texture_height, int stride, int channel, int count, float step, float reach) {
    const int first = get_global_id(0) * SEGMENT, row = get_global_id(1);
    if (first >= width || row >= height) return;
    const int edge = !(first > reach && first + SEGMENT + reach < width && row > reach && row + 1 + reach < height);
    const float fw = width, fh = height, scale_x = (float)texture_width / (float)width, scale_y = (float)texture_height / (float)height;

    int columns[SEGMENT];
    float own[SEGMENT], sum[SEGMENT], weight[SEGMENT], x[SEGMENT], y[SEGMENT], u[SEGMENT], v[SEGMENT], alive[SEGMENT];
    texture += channel;
    for (int way = 0; way < 2; ++way) {
        const float by = way ? -step : step;
        global const float *along = weights + way * (count + 1);
        EACH {
            columns[i] = min(first + i, width - 1);
            const Step s = steps[row * width + columns[i]];
            x[i] = y[i] = 0.5f;
            u[i] = step_x(s);
            v[i] = step_y(s);
            alive[i] = fma(u[i], u[i], v[i] * v[i]) > 0.0f ? 1.0f : 0.0f;
            if (!way) {
                own[i] = texture[TEXEL_AT((float)columns[i] + 0.5f, (float)row + 0.5f, row * width + columns[i])];
                sum[i] = 0.0f;
                weight[i] = 0.0f;
            }
            weight[i] += along[0];
        }
        for (int k = 1; k <= count; ++k) {
            if (edge) EACH {
                const float a = fma(by, u[i], x[i]), b = fma(by, v[i], y[i]);
                const float left = (float)-columns[i], top = (float)-row;
                const int stays = a >= left && a < left + fw && b >= top && b < top + fh;
                alive[i] = stays ? alive[i] : 0.0f;
                u[i] = stays ? u[i] : 0.0f;
                v[i] = stays ? v[i] : 0.0f;
            }
            const float w = along[k];
            EACH {
                x[i] = fma(by, u[i], x[i]);
                y[i] = fma(by, v[i], y[i]);
                int a = (int)x[i], b = (int)y[i];
                a += columns[i] - (x[i] < (float)a);
                b += row - (y[i] < (float)b);
                const int cell = b * width + a;
                const Step s = steps[cell];
                const float next_u = step_x(s), next_v = step_y(s);
                const float share = w * alive[i];
                /* A line that has ended rests on a texel that it has read: weight zero times NaN is no news. */
                const float texel = texture[TEXEL_AT((float)columns[i] + x[i], (float)row + y[i], cell)];
                sum[i] = fma(share, texel - own[i], sum[i]);
                weight[i] += share;
                alive[i] = fma(next_u, u[i], next_v * v[i]) > 0.0f ? alive[i] : 0.0f;
                u[i] = next_u;
                v[i] = next_v;
            }
        }
    }
    EACH {
        if (first + i >= width) break;
        result[((size_t)row * width + first + i) * stride + channel] = weight[i] > 0.0f ? own[i] + sum[i] / weight[i] : own[i];
    }
}
