// Light of one pixel in many given to those between, 64 of a row to a work-item; coarse.py is the definition.
//
// Definitions given at build time: channels of POSITION, ROUGHNESS, ALBEDO, SPECULAR and VISIBILITY, 0 for none; SHINY 1
// where there are highlights; LIKE, ENOUGH and STEP. `planes` holds what is known of the pixels that are lit, a plane of `size`
// numbers for each: normals, positions, roughness, diffuse light, highlights, those that there are.

#define SEGMENT 64
#define EACH for (int i = 0; i < SEGMENT; i++)
#define LIGHTS (SHINY ? 6 : 3)
#define SHAPES (3 + POSITION + ROUGHNESS)

// A row's part of an image, in planes; after its end, the last pixel again.
static inline __attribute__((always_inline)) void row_part(global const float *restrict in, int channels, int last,
                                                           float (*restrict to)[SEGMENT])
{
    for (int c = 0; c < channels; c++)
        EACH to[c][i] = in[min(i, last) * channels + c];
}

// Of one plane what each pixel has from the one that is lit before it, or after it.
static inline __attribute__((always_inline)) void spread(global const float *restrict line, int from, int wide,
                                                         float *restrict to)
{
    for (int k = 0; k < SEGMENT / STEP; k++) {
        float value = line[min(from + k, wide - 1)];
        for (int i = 0; i < STEP; i++)
            to[k * STEP + i] = value;
    }
}

kernel void upsampled(global const float *restrict normal, global const float *restrict position,
                      global const float *restrict roughness, global const float *restrict albedo,
                      global const float *restrict specular, global const float *restrict visibility,
                      global const float *restrict planes, int size, int wide,
                      global const float *restrict share,
                      global const int *restrict above, global const int *restrict below,
                      global const float *restrict lower, global const float *restrict colours,
                      global float *restrict out, global uchar *restrict alone, int width, int height)
{
    int per_row = (width + SEGMENT - 1) / SEGMENT, row = (int)get_global_id(0) / per_row;
    if (row >= height)
        return;
    int begin = (int)get_global_id(0) % per_row * SEGMENT, last = min(SEGMENT, width - begin) - 1;
    size_t first = (size_t)row * width + begin;
    float shape[SHAPES + 1][SEGMENT], total[LIGHTS][SEGMENT], weights[SEGMENT], colour[3][SEGMENT];
    row_part(normal + 3 * first, 3, last, shape);
    EACH {
        float largest = fmax(fabs(shape[0][i]), fmax(fabs(shape[1][i]), fabs(shape[2][i])));
        float x = shape[0][i] / largest, y = shape[1][i] / largest, z = shape[2][i] / largest;
        float per = 1 / sqrt(x * x + y * y + z * z);
        shape[0][i] = x * per;
        shape[1][i] = y * per;
        shape[2][i] = z * per;
        weights[i] = 0;
    }
    for (int c = 0; c < LIGHTS; c++)
        EACH total[c][i] = 0;
#if POSITION
    row_part(position + 3 * first, 3, last, shape + 3);
#endif
#if ROUGHNESS
    row_part(roughness + first, 1, last, shape + 3 + POSITION);
#endif
    for (int corner = 0; corner < 4; corner++) {
        float part = corner < 2 ? 1 - lower[row] : lower[row], alike[SEGMENT], there[SHAPES][SEGMENT], light[SEGMENT];
        global const float *line = planes + (size_t)(corner < 2 ? above[row] : below[row]) * wide;
        int from = begin / STEP + (corner & 1);
        for (int c = 0; c < SHAPES; c++)
            spread(line + (size_t)c * size, from, wide, there[c]);
        EACH {
            float apart = 1 - (shape[0][i] * there[0][i] + shape[1][i] * there[1][i] + shape[2][i] * there[2][i]);
#if POSITION
            float x = there[3][i] - shape[3][i], y = there[4][i] - shape[4][i], z = there[5][i] - shape[5][i];
            float off = shape[0][i] * x + shape[1][i] * y + shape[2][i] * z, far = x * x + y * y + z * z;
            apart += far == 0 ? 0.0f : off * off / far;
#endif
#if ROUGHNESS
            apart += fabs(shape[3 + POSITION][i] - there[3 + POSITION][i]);
#endif
            float s = 1 - LIKE * apart, near = corner & 1 ? share[begin + i] : 1 - share[begin + i];
            s = s > 0 ? s : s - s;
            s = part * near * s * s;
            alike[i] = s > 0 ? s : 0.0f;
            weights[i] += alike[i];
        }
        for (int c = 0; c < LIGHTS; c++) {
            spread(line + (size_t)(SHAPES + c) * size, from, wide, light);
            EACH total[c][i] += alike[i] > 0 ? alike[i] * light[i] : 0.0f;
        }
    }
    int single[SEGMENT];
    EACH single[i] = !(weights[i] >= ENOUGH);
    for (int c = 0; c < SHAPES; c++)
        EACH single[i] |= !(fabs(shape[c][i]) < INFINITY);
#if ALBEDO
    row_part(albedo + ALBEDO * first, ALBEDO, last, colour);
    for (int c = 0; c < ALBEDO; c++)
        EACH single[i] |= !(fabs(colour[c][i]) < INFINITY);
#endif
    for (int c = 0; c < 3; c++)
        EACH total[c][i] *= (ALBEDO ? colours[c] * colour[ALBEDO == 3 ? c : 0][i] : colours[c]) / weights[i];
#if SHINY
#if SPECULAR
    row_part(specular + SPECULAR * first, SPECULAR, last, colour);
    for (int c = 0; c < SPECULAR; c++)
        EACH single[i] |= !(fabs(colour[c][i]) < INFINITY);
#endif
    for (int c = 0; c < 3; c++)
        EACH total[c][i] += total[3 + c][i] * (SPECULAR ? colours[3 + c] * colour[SPECULAR == 3 ? c : 0][i] : colours[3 + c]) / weights[i];
#endif
#if VISIBILITY
    row_part(visibility + first, 1, last, colour);
    EACH single[i] |= !(fabs(colour[0][i]) < INFINITY);
    for (int c = 0; c < 3; c++)
        EACH total[c][i] *= colour[0][i];
#endif
    for (int i = 0; i <= last; i++) {
        alone[first + i] = single[i] != 0;
        for (int c = 0; c < 3; c++)
            out[3 * (first + i) + c] = total[c][i];
    }
}
