// A picture moved by its relief; parallax.py is the definition. BORDER is the number of the border.
//
// Places are kept as a pixel and a way from it, so that their fraction is as accurate at the end of a large picture as at
// its beginning.
#include "border.clh"
#include "numeric.clh"

#define SEGMENT 64

inline float mixed(float a, float b, float share) { return share == 0.0f ? a : fma(share, b - a, a); }

typedef struct {
    int column[2], row[2];
    float across, down;
} Place;

inline Place place_at(int column, int row, float right, float below, int width, int height)
{
    Place made;
    float x = floor(right), y = floor(below);
    column += x == x ? (int)x : 0;
    row += y == y ? (int)y : 0;
    for (int i = 0; i < 2; i++) {
        made.column[i] = border_index(column + i, width, BORDER);
        made.row[i] = border_index(row + i, height, BORDER);
    }
    made.across = right - x;
    made.down = below - y;
    return made;
}

inline float sampled(global const float *image, Place at, int width, int channels, int c, float outside)
{
    float line[2];
    for (int j = 0; j < 2; j++) {
        float corner[2];
        for (int i = 0; i < 2; i++)
            corner[i] = at.column[i] < 0 || at.row[j] < 0
                            ? outside
                            : image[((size_t)at.row[j] * width + at.column[i]) * channels + c];
        line[j] = mixed(corner[0], corner[1], at.across);
    }
    return mixed(line[0], line[1], at.down);
}

// Heights outside [0, 1] count as the nearer end: brought there before they are mixed.
inline float height_at(global const float *height, Place at, int width)
{
    float line[2];
    for (int j = 0; j < 2; j++) {
        float corner[2];
        for (int i = 0; i < 2; i++)
            corner[i] = at.column[i] < 0 || at.row[j] < 0
                            ? 0.0f
                            : num_clamp(height[(size_t)at.row[j] * width + at.column[i]], 0.0f, 1.0f);
        line[j] = mixed(corner[0], corner[1], at.across);
    }
    return mixed(line[0], line[1], at.down);
}

kernel void parallax(global const float *restrict image, global const float *restrict height,
                     global float *restrict out, int width, int tall, int channels, float across, float down,
                     float reference, int levels, float outside)
{
    int row = get_global_id(1), first = get_global_id(0) * SEGMENT, last = min(first + SEGMENT, width);
    for (int column = first; column < last; column++) {
        float z = NAN, above = -INFINITY;
        if (levels == 0)
            z = num_clamp(height[(size_t)row * width + column], 0.0f, 1.0f);
        for (int level = 0; levels && level <= levels; level++) {
            float at = 1.0f - (float)level / levels;
            Place looked = place_at(column, row, (at - reference) * across, (at - reference) * down, width, tall);
            float over = height_at(height, looked, width) - at;
            if (!(over < 0.0f)) {
                z = at + (level ? over / (over - above) : over * 0.0f) / levels;
                break;
            }
            above = over;
        }
        Place seen = place_at(column, row, (z - reference) * across, (z - reference) * down, width, tall);
        for (int c = 0; c < channels; c++) {
            float made = sampled(image, seen, width, channels, c, outside);
            out[((size_t)row * width + column) * channels + c] = z == z ? made : NAN;
        }
    }
}
