/* Places that a picture gives; grids.py is the definition. After the periods, p holds: the channels of the picture; and
 * for x and then for y, what is added, taken off a channel first, the factor, and how much of the pixel's own place. */
#include "look.clh"
#include "stream.clh"

/* The coordinate of an axis at a place of the picture; NaN unless both are finite. */
inline double given_at(global const double *restrict p, global const float *restrict given, int width, int column,
                       int row, int axis) {
    const size_t at = ((size_t)row * width + column) * (int)p[2];
    const double x = fma(p[6], column + 0.5, p[3] + (given[at] - p[4]) * p[5]);
    const double y = fma(p[10], row + 0.5, p[7] + (given[at + 1] - p[8]) * p[9]);
    return ((fabs(x) < INFINITY) & (fabs(y) < INFINITY)) ? (axis ? y : x) : NAN;
}

/* Half the way from the neighbour before to the one after; the whole way to the only one there is; else nothing. */
inline float slope(double before, double here, double after) {
    const double ahead = after - here, behind = here - before, both = 0.5 * (ahead + behind);
    const double made = both == both ? both : (ahead == ahead ? ahead : behind);
    return made == made ? (float)made : 0.0f;
}

/* The same for all of a segment, both axes at once. */
inline void given_here(global const double *restrict p, global const float *restrict given, int width, int first,
                       int row, global double *restrict to) {
    const int channels = (int)p[2];
    const double from_x = p[4], by_x = p[5], own_x = p[6], from_y = p[8], by_y = p[9], own_y = p[10];
    const double add_x = p[3], add_y = p[7], down = row + 0.5;
    global const float *at = given + ((size_t)row * width + first) * channels;
    /* the next row lies apart, where a processor does not see it coming */
    for (int i = 0; i < SEGMENT * channels; i += 16) stream_ask(at + (size_t)width * channels + i);
    EACH {
        const double x = fma(own_x, first + i + 0.5, add_x + (at[i * channels] - from_x) * by_x);
        const double y = fma(own_y, down, add_y + (at[i * channels + 1] - from_y) * by_y);
        const int known = (fabs(x) < INFINITY) & (fabs(y) < INFINITY);
        to[2 * i] = known ? x : NAN;
        to[2 * i + 1] = known ? y : NAN;
    }
}

kernel void places(ARGUMENTS) {
    WHERE
    if (!steps && count == SEGMENT) {
        given_here(p, given, width, first, row, table + 2 * start);
        return;
    }
    for (int i = 0; i < count; ++i) {
        const int column = first + i;
        float by[4];
        for (int axis = 0; axis < 2; ++axis) {
            const double here = given_at(p, given, width, column, row, axis);
            table[2 * (start + i) + axis] = here;
            if (!steps) continue;
            const double left = column > 0 ? given_at(p, given, width, column - 1, row, axis) : NAN;
            const double right = column + 1 < width ? given_at(p, given, width, column + 1, row, axis) : NAN;
            const double above = row > 0 ? given_at(p, given, width, column, row - 1, axis) : NAN;
            const double below = row + 1 < height ? given_at(p, given, width, column, row + 1, axis) : NAN;
            by[axis] = slope(left, here, right);
            by[2 + axis] = slope(above, here, below);
        }
        if (steps) vstore4((float4)(by[0], by[1], by[2], by[3]), start + i, steps);
    }
}
