// Spherical harmonics of an image of all directions, and back; harmonics.py is the definition. All in doubles.
//
// BANDS of degrees, CHANNELS of the light. `d` holds planes of x, y and z, `count` of each, a multiple of eight.
// `factor` holds a and b of the recurrence for every (m, degree), BANDS x BANDS of each, then the first of every m.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define ALL (BANDS * BANDS)

// Calls `DO(index, value)` for every function in eight directions.
#define EACH_FUNCTION(x, y, z, factor, DO)                                                                             \
    {                                                                                                                  \
        double8 c = (double8)(1.0), s = (double8)(0.0);                                                                \
        for (int m = 0; m < BANDS; m++) {                                                                              \
            if (m > 0) {                                                                                               \
                double8 turned = x * c - y * s;                                                                        \
                s = x * s + y * c;                                                                                     \
                c = turned;                                                                                            \
            }                                                                                                          \
            double8 before = (double8)(0.0), p = (double8)(factor[2 * ALL + m]);                                       \
            for (int l = m; l < BANDS; l++) {                                                                          \
                if (l > m) {                                                                                           \
                    double8 next = factor[m * BANDS + l] * (z * p - factor[ALL + m * BANDS + l] * before);             \
                    before = p;                                                                                        \
                    p = next;                                                                                          \
                }                                                                                                      \
                DO(l * l + l + m, p * c)                                                                               \
                if (m > 0)                                                                                             \
                    DO(l * l + l - m, p * s)                                                                           \
            }                                                                                                          \
        }                                                                                                              \
    }

// Sums of light less its mean times solid angle and function, over a chunk of directions.
kernel void project(global const double *restrict d, global const double *restrict angle,
                    global const float *restrict light, global const double *restrict mean,
                    global const double *restrict factor, global double *restrict out, int count, int chunk)
{
    int item = get_global_id(0), first = item * chunk;
    if (first >= count)
        return;
    double8 total[ALL * CHANNELS];
    for (int k = 0; k < ALL * CHANNELS; k++)
        total[k] = (double8)(0.0);
    for (int at = first; at < min(first + chunk, count); at += 8) {
        double8 x = vload8(0, d + at), y = vload8(0, d + count + at), z = vload8(0, d + 2 * count + at);
        double8 w = vload8(0, angle + at), share[CHANNELS];
        for (int k = 0; k < CHANNELS; k++)
            share[k] = w * (convert_double8(vload8(0, light + (size_t)k * count + at)) - mean[k]);
#define ADD(index, value)                                                                                              \
    {                                                                                                                  \
        double8 function = value;                                                                                      \
        for (int k = 0; k < CHANNELS; k++)                                                                             \
            total[(index) * CHANNELS + k] += share[k] * function;                                                      \
    }
        EACH_FUNCTION(x, y, z, factor, ADD)
    }
    for (int k = 0; k < ALL * CHANNELS; k++) {
        double8 t = total[k];
        out[(size_t)item * ALL * CHANNELS + k] = ((t.s0 + t.s1) + (t.s2 + t.s3)) + ((t.s4 + t.s5) + (t.s6 + t.s7));
    }
}

// The sum of all functions with their coefficients, for eight directions.
kernel void evaluate(global const double *restrict d, global const double *restrict coefficients,
                     global const double *restrict mean, global const double *restrict factor,
                     global float *restrict out, int count)
{
    int at = get_global_id(0) * 8;
    if (at >= count)
        return;
    double8 x = vload8(0, d + at), y = vload8(0, d + count + at), z = vload8(0, d + 2 * count + at), total[CHANNELS];
    for (int k = 0; k < CHANNELS; k++)
        total[k] = (double8)(mean[k]);
#define SUM(index, value)                                                                                              \
    {                                                                                                                  \
        double8 function = value;                                                                                      \
        for (int k = 0; k < CHANNELS; k++)                                                                             \
            total[k] += coefficients[(index) * CHANNELS + k] * function;                                               \
    }
    EACH_FUNCTION(x, y, z, factor, SUM)
    for (int k = 0; k < CHANNELS; k++)
        vstore8(convert_float8(total[k]), 0, out + (size_t)k * count + at);
}
