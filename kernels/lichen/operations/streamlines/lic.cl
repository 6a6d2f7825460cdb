/* Line integral convolution in equal steps; see lines.clh for how lines are followed.
 *
 * Built with what lines.clh and texels.clh are built with, and SAME (whether texture and field are of one size).
 */

#include "hash.clh"
#include "texels.clh"

kernel void decode(global const float *restrict image, global float *restrict field, int count, int stride, float scale,
                   float bias, float limit) {
    const int first = get_global_id(0) * SEGMENT;
    float x[SEGMENT], y[SEGMENT];
    vectors_at(x, y, image, first, count, stride, scale, bias, limit);
    for (int i = 0; i < SEGMENT && first + i < count; ++i) vstore2((float2)(x[i], y[i]), first + i, field);
}

/* Noise of `lichen.operations.streamlines.task.noise`, bit for bit. */
kernel void noise(global float *restrict texture, int width, int height, uint seed, float density) {
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height) return;
    uint a = x, b = y, c = seed;
    hash_pcg3d(&a, &b, &c);
    const float value = hash_unit(a);
    texture[(size_t)y * width + x] = density == 1.0f ? value : (value < density ? 1.0f : 0.0f);
}

/* `kernels` holds the weights k(0), k(h), ..., k(count h), then those backwards. `reach` is how far a line can go. */
kernel void follow(global const float *restrict now, global const float *restrict later, global const float *restrict texture,
                   global const float *restrict weights, global float *restrict result, int width, int height,
                   int texture_width, int texture_height, int stride, int channel, int count, float step, int arc,
                   float reach, float time, float pace) {
    const int first = get_global_id(0) * SEGMENT, row = get_global_id(1);
    if (first >= width || row >= height) return;
    const int edge = !(first > reach && first + SEGMENT + reach < width && row > reach && row + 1 + reach < height);
    const Flow flow = {now, later, width, height, arc, time, pace};

    int columns[SEGMENT];
    EACH columns[i] = min(first + i, width - 1);
    Home home;
    settle(&home, columns, row, width, height, texture_width, texture_height);

    Places p;
    Vectors at, here, start, there, d;
    Texel own[SEGMENT], sum[SEGMENT], last[SEGMENT], sampled[SEGMENT];
    float weight[SEGMENT], share[SEGMENT], alive[SEGMENT];
    texture += channel;
    EACH {
        at.x[i] = at.y[i] = 0.0f;
        sum[i] = (Texel)0.0f;
        weight[i] = 0.0f;
    }
    find(&p, &at, &home);
    sample(own, texture, stride, &p, texture_width, texture_height);
    look(&start, &p, &flow, &at, columns, row, 0.0f);

    for (int way = 0; way < 2; ++way) {
        const float sign = way ? -1.0f : 1.0f;
        global const float *k = weights + way * (count + 1);
        EACH {
            at.x[i] = at.y[i] = 0.0f;
            alive[i] = 1.0f;
            last[i] = own[i] - own[i];
        }
        here = start;
        int whole = 1; /* no line has ended */
        for (int j = 0; j < count; ++j) {
            Vectors q;
            const float s = sign * step * (float)j;
            advance(&d, &at, &here, &flow, columns, row, s, sign * step);
            offset(&q, &at, &d, 1.0f);
            look(&there, &p, &flow, &q, columns, row, fma(sign, step, s));
            if (!edge && whole && !any_opposed(&there, &d, sign)) {
                at = q;
                here = there;
                if (!SAME) find(&p, &at, &home);
                sample(sampled, texture, stride, &p, texture_width, texture_height);
                accumulate_whole(sum, weight, last, own, sampled, k[j], k[j + 1]);
                continue;
            }
            EACH share[i] = alive[i];
            if (edge) cut_at_border(share, &at, &d, columns, row, width, height);
            cut_at_critical_points(share, &here, &there, &d, sign);
            int cut = !SAME;
            EACH {
                at.x[i] = share[i] > 0.0f ? fma(share[i], d.x[i], at.x[i]) : at.x[i];
                at.y[i] = share[i] > 0.0f ? fma(share[i], d.y[i], at.y[i]) : at.y[i];
                alive[i] = share[i] == 1.0f ? 1.0f : 0.0f;
                cut |= share[i] > 0.0f && share[i] < 1.0f;
                whole &= share[i] == 1.0f;
            }
            here = there;
            /* Where texture and field are of one size and no step was cut, the texels lie where the vectors did. */
            if (cut) find(&p, &at, &home);
            sample(sampled, texture, stride, &p, texture_width, texture_height);
            accumulate(sum, weight, last, own, sampled, share, k[j], k[j + 1]);
        }
    }
    EACH {
        if (first + i >= width) break;
        const Texel mean = weight[i] > 0.0f ? own[i] + sum[i] / weight[i] : own[i];
        STORE(mean, result + ((size_t)row * width + first + i) * stride + channel);
    }
}
