// Pixels at a jump of their value within a disc around them; outline.py is the definition.
//
// `halves` holds, for each row of the disc from -WIDTH to WIDTH, how far it reaches. SIDE: 0 inside, 1 outside, 2 both.
// SIGN is 1 where larger values are in front, -1 where smaller ones are. One work-item for 64 pixels of a row.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define SEGMENT 64

kernel void outline(global const float *restrict in, global float *restrict out, global const int *restrict halves,
                    int width, int columns, int rows, int channels, double jump)
{
    int from = get_global_id(0) * SEGMENT, to = min(from + SEGMENT, columns), row = get_global_id(1);
    if (row >= rows)
        return;
    for (int column = from; column < to; column++) {
        float low = INFINITY, high = -INFINITY;
        for (int dy = -width; dy <= width; dy++) {
            global const float *line = in + (size_t)clamp(row + dy, 0, rows - 1) * columns * channels;
            int reach = halves[dy + width];
            for (int dx = -reach; dx <= reach; dx++) {
                float v = line[clamp(column + dx, 0, columns - 1) * channels] * SIGN;
                low = v < low ? v : low;
                high = v > high ? v : high;
            }
        }
        float own = in[((size_t)row * columns + column) * channels] * SIGN;
        bool front = (double)own - (double)low > jump, behind = (double)high - (double)own > jump;
        bool drawn = (SIDE != 1 && front) || (SIDE != 0 && behind);
        out[(size_t)row * columns + column] = own != own ? own : (drawn ? 1.0f : 0.0f);
    }
}
