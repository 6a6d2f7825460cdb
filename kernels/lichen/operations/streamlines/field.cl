/* Flows in closed form; FLOW is the place of the flow in `lichen.operations.streamlines.field.Flow`.
 *
 * Doubles without contraction, in the order of NumPy's: a pixel lies inside the cylinder alike everywhere. */
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#pragma OPENCL FP_CONTRACT OFF

#define UNIFORM 0
#define CIRCULAR 1
#define SADDLE 2
#define SOURCE 3
#define GYRE 4
#define CYLINDER 5
#define PI 3.14159265358979323846

kernel void sample_field(global float *restrict result, global const double *restrict columns,
                         global const double *restrict rows, int width, int height, double c, double s, double strength,
                         double square_radius, double circulation, double sway) {
    const int column = get_global_id(0), row = get_global_id(1);
    if (column >= width || row >= height) return;
    const double x = columns[column], y = rows[row];
    const double a = c * x + s * y, b = c * y - s * x;
    double u = 1.0, v = 0.0;
#if FLOW == CIRCULAR
    u = -y;
    v = x;
#elif FLOW == SADDLE
    u = a;
    v = -b;
#elif FLOW == SOURCE
    u = a;
    v = b;
#elif FLOW == GYRE
    const double at = (double)(2 * column + 1) / width, down = (double)(2 * row + 1) / (2.0 * height);
    const double f = sway * at * at + (1 - 2 * sway) * at, slope = 2 * sway * at + (1 - 2 * sway);
    u = -0.1 * PI * sin(PI * f) * cos(PI * down);
    v = 0.1 * PI * cos(PI * f) * sin(PI * down) * slope;
#elif FLOW == CYLINDER
    const double square = a * a + b * b;
    const int outside = square >= square_radius;
    const double far = outside ? square : 1.0;
    const double doublet = square_radius / (far * far), swirl = circulation / far;
    u = outside ? 1 - doublet * (a * a - b * b) - swirl * b : 0.0;
    v = outside ? swirl * a - 2 * doublet * a * b : 0.0;
#endif
#if FLOW == CIRCULAR || FLOW == GYRE
    const double h = u, k = v;
#else
    const double h = c * u - s * v, k = s * u + c * v;
#endif
    vstore2((float2)((float)(strength * h), (float)(strength * k)), (size_t)row * width + column, result);
}
