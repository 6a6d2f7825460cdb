/* Lines that serve many pixels; the twin of `lichen.operations.streamlines.reuse`, which tells how.
 *
 * A work-item follows SEGMENT lines that begin anywhere; positions are absolute, from the centre of the first pixel. Samples
 * lie by number, then by line. */

#include "texels.clh"

#define MOST_SUMS 9 /* of a constant and four waves */

kernel void trace(global const float *restrict field, global const float *restrict texture, global const int *restrict seeds,
                  global float *restrict path, global float *restrict sums, global float *restrict ends,
                  global const float *restrict factors, int width, int height, int texture_width, int texture_height,
                  int stride, int channel, int count, int lines, float step, int kinds) {
    const int first = get_global_id(0) * SEGMENT;
    if (first >= lines) return;
    const Flow flow = {field, field, width, height, 1, 0.0f, 0.0f};
    int zeros[SEGMENT];
    Home home;
    Places p;
    Vectors at, here, start, begun, there, d;
    float own[SEGMENT], last[SEGMENT], sampled[SEGMENT], total[MOST_SUMS][SEGMENT], share[SEGMENT], alive[SEGMENT], end[SEGMENT];
    texture += channel;
    EACH {
        const int seed = max(seeds[first + i], 0);
        zeros[i] = 0;
        begun.y[i] = seed / width;
        begun.x[i] = seed % width;
    }
    settle(&home, zeros, 0, width, height, texture_width, texture_height);
    find(&p, &begun, &home);
    sample(own, texture, stride, &p, texture_width, texture_height);
    look(&start, &p, &flow, &begun, zeros, 0, 0.0f);
    const int samples = 2 * count + 1;
    const size_t apart = (size_t)samples * lines; /* sums of one factor from those of the next */
    EACH vstore2((float2)(begun.x[i], begun.y[i]), (size_t)count * lines + first + i, path);
    for (int c = 0; c < kinds; ++c) EACH sums[c * apart + (size_t)count * lines + first + i] = 0.0f;
    for (int way = 0; way < 2; ++way) {
        const float sign = way ? -1.0f : 1.0f;
        at = begun;
        here = start;
        EACH {
            alive[i] = 1.0f;
            last[i] = end[i] = 0.0f;
        }
        for (int c = 0; c < kinds; ++c) EACH total[c][i] = 0.0f;
        for (int j = 1; j <= count; ++j) {
            advance(&d, &at, &here, &flow, zeros, 0, 0.0f, sign * step);
            Vectors q;
            offset(&q, &at, &d, 1.0f);
            look(&there, &p, &flow, &q, zeros, 0, 0.0f);
            EACH share[i] = alive[i];
            cut_at_border(share, &at, &d, zeros, 0, width, height);
            cut_at_critical_points(share, &here, &there, &d, sign);
            int cut = !SAME;
            EACH {
                share[i] = share[i] > 0.0f ? share[i] : 0.0f;
                at.x[i] = share[i] > 0.0f ? fma(share[i], d.x[i], at.x[i]) : at.x[i];
                at.y[i] = share[i] > 0.0f ? fma(share[i], d.y[i], at.y[i]) : at.y[i];
                alive[i] = share[i] == 1.0f ? 1.0f : 0.0f;
                cut |= share[i] > 0.0f && share[i] < 1.0f;
            }
            here = there;
            if (cut) find(&p, &at, &home);
            sample(sampled, texture, stride, &p, texture_width, texture_height);
            const int n = count + (way ? -j : j);
            const size_t to = (size_t)n * lines + first;
            EACH sampled[i] -= own[i];
            for (int c = 0; c < kinds; ++c) {
                const float a = factors[c * samples + n - (way ? -1 : 1)], b = factors[c * samples + n];
                EACH {
                    const float piece = fma(fma(share[i], b - a, a), sampled[i], a * last[i]);
                    total[c][i] = fma(share[i] * (sign * 0.5f * step), piece, total[c][i]);
                    sums[c * apart + to + i] = total[c][i];
                }
            }
            EACH {
                end[i] = fma(share[i], step, end[i]);
                last[i] = sampled[i];
            }
            EACH vstore2((float2)(at.x[i], at.y[i]), to + i, path);
        }
        EACH ends[(size_t)way * lines + first + i] = end[i];
    }
}

typedef struct {
    int pixel[SEGMENT];   /* -1: none */
    float along[SEGMENT]; /* from the sample to the point nearest to the pixel's centre */
    uint key[SEGMENT];
} Offers;

/* What the samples `k` from the starts of a segment of lines offer. */
inline void offers_of(Offers *restrict o, global const int *restrict seeds, global const float *restrict path,
                      global const float *restrict ends, int first, int k, int lines, int width, int height, int count,
                      float step, float distance) {
    const int n = k + count;
    const float s = (float)abs(k) * step, wide = width, tall = height;
    global const float *at = path + 2 * ((size_t)n * lines + first);
    global const float *ahead = path + 2 * ((size_t)min(n + 1, 2 * count) * lines + first);
    global const float *behind = path + 2 * ((size_t)max(n - 1, 0) * lines + first);
    ends += (k >= 0 ? 0 : lines) + first;
    EACH {
        const float way_x = ahead[2 * i] - behind[2 * i], way_y = ahead[2 * i + 1] - behind[2 * i + 1];
        const float length = sqrt(fma(way_x, way_x, way_y * way_y)), by = length > 0.0f ? 1.0f / length : 0.0f;
        const float unit_x = way_x * by, unit_y = way_y * by;
#if WRAP
        const float x = at[2 * i] - wide * floor((at[2 * i] + 0.5f) / wide);
        const float y = at[2 * i + 1] - tall * floor((at[2 * i + 1] + 0.5f) / tall);
#else
        const float x = at[2 * i], y = at[2 * i + 1];
#endif
        const float cell_x = within(floor(x + 0.5f), 0.0f, wide - 1.0f), cell_y = within(floor(y + 0.5f), 0.0f, tall - 1.0f);
        const float off_x = cell_x - x, off_y = cell_y - y, t = fma(off_x, unit_x, off_y * unit_y);
        const float across_x = off_x - t * unit_x, across_y = off_y - t * unit_y;
        const float apart = sqrt(fma(across_x, across_x, across_y * across_y));
        const int taken = (s <= ends[i]) & (fabs(t) <= 0.5f * step) & (apart <= distance) & (seeds[first + i] >= 0);
        o->pixel[i] = taken ? (int)cell_y * width + (int)cell_x : -1;
        o->along[i] = t;
        o->key[i] = ((uint)(int)rint(taken ? apart / distance * 255.0f : 0.0f) << 24) | (uint)(first + i + 1);
    }
}

inline float sum_at(global const float *restrict sums, int line, int lines, int count, float place) {
    const int cell = min(max((int)floor(place), 0), 2 * count - 1);
    const float a = sums[(size_t)cell * lines + line], b = sums[(size_t)(cell + 1) * lines + line];
    return fma(place - (float)cell, b - a, a);
}

inline float between(global const float *restrict sums, int line, int lines, int count, float from, float to) {
    return sum_at(sums, line, lines, count, to) - sum_at(sums, line, lines, count, from);
}

#define ARGUMENTS                                                                                                      \
    global const int *restrict seeds, global const float *restrict path, global const float *restrict sums,            \
        global const float *restrict ends, global const float *restrict texture, global uint *restrict keys,           \
        global float *restrict result, global const float *restrict waves, int width, int height, int texture_width, int texture_height, int stride,       \
        int channel, int count, int lines, float step, int window, int extra, float distance,     \
        int wave_count, float constant_weight, float whole, float least, float most

/* Every pixel that a line passes near learns of it: the least key is that of the nearest line. */
kernel void offer(ARGUMENTS) {
    const int first = get_global_id(0) * SEGMENT;
    if (first >= lines) return;
    for (int k = -extra; k <= extra; ++k) {
        Offers o;
        offers_of(&o, seeds, path, ends, first, k, lines, width, height, count, step, distance);
        for (int i = 0; i < SEGMENT; ++i)
            if (o.pixel[i] >= 0 && keys[o.pixel[i]] > o.key[i]) atomic_min(keys + o.pixel[i], o.key[i]);
    }
}

/* The line whose key a pixel holds gives it its value. */
kernel void settle_values(ARGUMENTS) {
    const int first = get_global_id(0) * SEGMENT;
    if (first >= lines) return;
    Home home;
    int zeros[SEGMENT];
    Places p;
    Vectors begun;
    float own[SEGMENT];
    const size_t apart = (size_t)(2 * count + 1) * lines;
    EACH {
        const int seed = max(seeds[first + i], 0);
        zeros[i] = 0;
        begun.y[i] = seed / width;
        begun.x[i] = seed % width;
    }
    settle(&home, zeros, 0, width, height, texture_width, texture_height);
    find(&p, &begun, &home);
    sample(own, texture + channel, stride, &p, texture_width, texture_height);
    for (int k = -extra; k <= extra; ++k) {
        Offers o;
        offers_of(&o, seeds, path, ends, first, k, lines, width, height, count, step, distance);
        for (int i = 0; i < SEGMENT; ++i) {
            if (o.pixel[i] < 0 || keys[o.pixel[i]] != o.key[i]) continue;
            const int line = first + i;
            const float s = fma((float)k, step, o.along[i]), far = (float)window * step;
            const float forwards = ends[line], backwards = -ends[lines + line];
            const float high = s + far < forwards ? s + far : forwards, low = s - far > backwards ? s - far : backwards;
            const float place = high / step + (float)count, from = low / step + (float)count;
            float total = constant_weight * between(sums, line, lines, count, from, place);
            const int cut = high != s + far || low != s - far;
            float weight = cut || !wave_count ? constant_weight * (high - low) : whole;
            for (int w = 0; w < wave_count; ++w) {
                const float4 wave = vload4(w, waves); /* weight, radians a pixel, phase, weight of the integral */
                const float angle = wave.z - wave.y * s;
                float cosine;
                const float sine = sincos(angle, &cosine);
                const float x = between(sums + (2 * w + 1) * apart, line, lines, count, from, place);
                const float y = between(sums + (2 * w + 2) * apart, line, lines, count, from, place);
                total = fma(wave.x, cosine * x - sine * y, total);
                if (cut) {
                    const float middle = wave.y * (0.5f * (high + low)) + angle, half_width = wave.y * (0.5f * (high - low));
                    weight = fma(wave.w, cos(middle) * sin(half_width), weight);
                }
            }
            const float mean = weight > 0.0f ? own[i] + total / weight : own[i];
            result[(size_t)o.pixel[i] * stride + channel] = within(mean, least, most);
            keys[o.pixel[i]] = 0;
        }
    }
}
