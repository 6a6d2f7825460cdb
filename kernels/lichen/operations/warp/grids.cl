/* Places that a picture gives, and their steps, as tables. */
#include "look.clh"
#include "given.clh"

/* Both coordinates at a place of the picture; NaN beside it. */
inline double2 given_at(global const double *restrict p, global const float *restrict given, int column, int row) {
    GIVEN_NUMBERS
    if (column < 0 || row < 0 || column >= wide || row >= GIVEN_TALL) return (double2)(NAN);
    global const float *at = given + ((size_t)row * wide + column) * channels;
    double x, y;
    GIVEN_PLACE(x, y, column, at[0], at[1])
    return (double2)(x, y);
}

/* Half the way from the neighbour before to the one after; the whole way to the only one there is; else nothing. */
inline float slope(double before, double here, double after) {
    const double ahead = after - here, behind = here - before, both = 0.5 * (ahead + behind);
    const double made = both == both ? both : (ahead == ahead ? ahead : behind);
    return made == made ? (float)made : 0.0f;
}

kernel void places(ARGUMENTS) {
    WHERE
    double x[SEGMENT], y[SEGMENT];
    given_places(x, y, p, given, column, row);
    for (int i = 0; i < count; ++i) {
        table[2 * (start + i)] = x[i];
        table[2 * (start + i) + 1] = y[i];
    }
    if (!steps) return;
    for (int i = 0; i < count; ++i) {
        const double2 left = given_at(p, given, column + i - 1, row), right = given_at(p, given, column + i + 1, row);
        const double2 above_ = given_at(p, given, column + i, row - 1), below = given_at(p, given, column + i, row + 1);
        vstore4((float4)(slope(left.x, x[i], right.x), slope(left.y, y[i], right.y), slope(above_.x, x[i], below.x),
                         slope(above_.y, y[i], below.y)), start + i, steps);
    }
}
