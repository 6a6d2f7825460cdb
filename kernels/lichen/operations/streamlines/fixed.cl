/* Line integral convolution in the arithmetic of a frame buffer; the twin of `lichen.operations.streamlines.fixed`. */

#pragma OPENCL FP_CONTRACT OFF

#include "texels.clh"

/* The nearest whole number, halves to the even one, of what is far below 2^22; without a call, which a loop would make
 * pixel by pixel. */
inline float nearest_code(float x) { return (x + 0x1.8p+23f) - 0x1.8p+23f; }

kernel void advance_codes(global const float *restrict codes, global const float *restrict texture,
                          global const float *restrict weights, global float *restrict result, int width, int height,
                          int texture_width, int texture_height, int stride, int channel, int count, float step, float top,
                          float far) {
    const int first = get_global_id(0) * SEGMENT, row = get_global_id(1);
    if (first >= width || row >= height) return;
    const float wide = width, tall = height, unit_x = step / wide, unit_y = step / tall;
    const float texture_wide = texture_width, texture_tall = texture_height;
    int zeros[SEGMENT], columns[SEGMENT];
    Home home;
    float sum[SEGMENT], weight[SEGMENT], own[SEGMENT], texel[SEGMENT], rests[SEGMENT];
    Vectors centre, at, place;
    Places p;
    texture += channel;
    EACH {
        const int column = columns[i] = min(first + i, width - 1);
        global const float *code = codes + 4 * ((size_t)row * width + column);
        rests[i] = code[0] == 0.0f && code[1] == 0.0f && code[2] == 0.0f && code[3] == 0.0f ? 1.0f : 0.0f;
        zeros[i] = 0;
        centre.x[i] = (float)column + 0.5f;
        centre.y[i] = (float)row + 0.5f;
        place.x[i] = place.y[i] = 0.0f;
        sum[i] = weight[i] = 0.0f;
    }
    settle(&home, columns, row, width, height, texture_width, texture_height);
    find(&p, &place, &home);
    sample(own, texture, stride, &p, texture_width, texture_height);
    for (int way = 0; way < 2; ++way) {
        global const float *k = weights + way * (count + 1);
        EACH {
            at.x[i] = nearest_code(centre.x[i] / wide * top);
            at.y[i] = nearest_code(centre.y[i] / tall * top);
        }
        for (int j = 0; j <= count; ++j) {
            if (j) {
                EACH {
                    place.x[i] = at.x[i] / top * wide - 0.5f;
                    place.y[i] = at.y[i] / top * tall - 0.5f;
                }
                locate(&p, &place, zeros, 0, width, height);
                Vectors ahead, behind;
                EACH {
                    const int right = p.x[i] > 0.0f ? 4 : 0;
                    global const float *u = codes + 4 * (size_t)p.cell[i], *v = codes + 4 * (size_t)p.below[i];
                    const float4 a = vload4(0, u), b = vload4(0, u + right), c = vload4(0, v), d = vload4(0, v + right);
                    const float4 upper = a + p.x[i] * (b - a), lower = c + p.x[i] * (d - c);
                    const float4 move = upper + p.y[i] * (lower - upper);
                    ahead.x[i] = move.x;
                    ahead.y[i] = move.y;
                    behind.x[i] = move.z;
                    behind.y[i] = move.w;
                }
                const Vectors *first_ = way ? &behind : &ahead, *then = way ? &ahead : &behind;
                EACH {
                    const float x = within(nearest_code(at.x[i] + unit_x * first_->x[i]), 0.0f, top);
                    const float y = within(nearest_code(at.y[i] + unit_y * first_->y[i]), 0.0f, top);
                    at.x[i] = within(nearest_code(x - unit_x * then->x[i]), 0.0f, top);
                    at.y[i] = within(nearest_code(y - unit_y * then->y[i]), 0.0f, top);
                }
            }
            Vectors q;
            EACH {
                place.x[i] = at.x[i] / top * wide;
                place.y[i] = at.y[i] / top * tall;
                q.x[i] = place.x[i] / wide * texture_wide - 0.5f;
                q.y[i] = place.y[i] / tall * texture_tall - 0.5f;
            }
            locate(&p, &q, zeros, 0, texture_width, texture_height);
            sample(texel, texture, stride, &p, texture_width, texture_height);
            const float by = k[j];
            EACH {
                const float x = fabs(place.x[i] - centre.x[i]), y = fabs(place.y[i] - centre.y[i]);
                const float share = (x <= far) & (y <= far) & (rests[i] == 0.0f) ? by : 0.0f;
                const float piece = share * (texel[i] - own[i]);
                sum[i] += share != 0.0f ? piece : 0.0f;
                weight[i] += share;
            }
        }
    }
    EACH {
        if (first + i >= width) break;
        const float mean = weight[i] > 0.0f ? own[i] + sum[i] / weight[i] : own[i];
        result[((size_t)row * width + first + i) * stride + channel] = mean;
    }
}
