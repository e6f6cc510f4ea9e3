/* The crusher by hand in C: what numba_peer.py integrates, the same right-hand side, tableau, error
 * norm and controller, for LANES designs side by side, each with its own angle and step.
 *
 * Compile with -DLANES=1 for scalar code. A lane that ends a turn begins its next one at once, and
 * the next design after its last turn, so no lane waits for another before the designs run out.
 */

#include <math.h>

#define PARAMETERS 24
#define SIZE 5
#define STAGES 7
#define PI 3.14159265358979323846
#define EACH_LANE _Pragma("omp simd") for (int lane = 0; lane < LANES; lane++)

/* Widths of the smoothed corners, as in jaxcrusher. */
static const double NORM_WIDTH = 1e-9, CONTACT_WIDTH = 1e-8, FRICTION_WIDTH = 1e-4,
                    FORCE_WIDTH = 1e-6;

/* Dormand and Prince 1980: nodes, stages, and the error's weights. */
static const double C[STAGES] = {0, 1. / 5, 3. / 10, 4. / 5, 8. / 9, 1, 1};
static const double A[STAGES][STAGES - 1] = {
    {0},
    {1. / 5},
    {3. / 40, 9. / 40},
    {44. / 45, -56. / 15, 32. / 9},
    {19372. / 6561, -25360. / 2187, 64448. / 6561, -212. / 729},
    {9017. / 3168, -355. / 33, 46732. / 5247, 49. / 176, -5103. / 18656},
    {35. / 384, 0, 500. / 1113, 125. / 192, -2187. / 6784, 11. / 84},
};
static const double ERROR[STAGES] = {
    71. / 57600, 0, -71. / 16695, 71. / 1920, -17253. / 339200, 22. / 525, -1. / 40,
};

typedef double Lanes[LANES];

static inline double least(double a, double b) { return a < b ? a : b; }
static inline double most(double a, double b) { return a > b ? a : b; }
static inline double squared(double x) { return x * x; }

static inline double positive(double x, double width) {
    double blend = least(most(x + width, 0), 2 * width);
    return blend * blend / (4 * width) + most(x - width, 0);
}

/* The rate of y by shaft angle; the lane's numbers are columns of p, in numba_peer's order. */
static inline void field_of_lane(int lane, double cosine, double sine, const Lanes y[SIZE],
                                 const Lanes p[PARAMETERS], Lanes rate[SIZE]) {
    double w = p[0][lane], c = p[1][lane], ox = p[2][lane], oy = p[3][lane], l1 = p[4][lane],
           l2 = p[5][lane], l3 = p[6][lane], m1 = p[7][lane], m2 = p[8][lane], m3 = p[9][lane],
           j2 = p[10][lane], j3 = p[11][lane], g = p[12][lane], load = p[13][lane],
           k = p[14][lane], damping = p[15][lane], cf = p[16][lane], v0 = p[17][lane],
           v1 = p[18][lane], bore = p[19][lane], s1x = p[20][lane], s1y = p[21][lane],
           s2x = p[22][lane], s2y = p[23][lane];
    double ex = c * y[0][lane], ey = c * y[1][lane], ux = y[2][lane], uy = y[3][lane];
    double ax = ox + l1 * cosine - ex, ay = oy + l1 * sine - ey;
    double vx = -l1 * w * sine - ux, vy = l1 * w * cosine - uy;
    /* Toggle and jaw: unit vectors and spins. */
    double distance = ax * ax + ay * ay;
    double share = (distance + l3 * l3 - l2 * l2) / (2 * distance);
    /* Out of the linkage's reach a trial step has a huge error; NaN is not for -Ofast. */
    double height = -sqrt(most(l3 * l3 / distance - share * share, 1e-12));
    double tx = (share * ax - height * ay) / l3, ty = (share * ay + height * ax) / l3;
    double jx = (ax - l3 * tx) / l2, jy = (ay - l3 * ty) / l2;
    double lever = tx * jy - ty * jx;
    double w3 = (vx * jx + vy * jy) / (l3 * lever), w2 = -(vx * tx + vy * ty) / (l2 * lever);
    /* Contact. */
    double length = sqrt(ex * ex + ey * ey + NORM_WIDTH * NORM_WIDTH);
    double nx = ex / length, ny = ey / length;
    double depth = length - c, approach = ux * nx + uy * ny;
    double base = positive(depth, CONTACT_WIDTH);
    double normal = k * base * sqrt(base) * (1 + damping * approach);
    double arm = bore - length;
    double slip = ux * ny - uy * nx + bore * w2 - arm * w;
    double ramp = (positive(slip - v0, FRICTION_WIDTH) - positive(slip - v1, FRICTION_WIDTH)
                   - positive(-slip - v0, FRICTION_WIDTH) + positive(-slip - v1, FRICTION_WIDTH))
                  / (v1 - v0);
    double tangential = -cf * normal * ramp;
    double fx = normal * nx - tangential * ny, fy = normal * ny + tangential * nx;
    double moment = bore * tangential;
    /* Lagrange's equations of toggle and jaw. */
    double rx = l2 * jx + s2x * jx - s2y * jy, ry = l2 * jy + s2x * jy + s2y * jx;
    double lx = -load * jx, ly = -load * jy - m2 * g;
    double swing = m2 * l3 * (tx * ry - ty * rx);
    double m11 = j3 + (m3 / 4 + m2) * l3 * l3, m12 = m2 * l3 * (tx * rx + ty * ry);
    double m22 = j2 + m2 * (rx * rx + ry * ry);
    double q3 = swing * w2 * w2 + l3 * (tx * ly - ty * lx) - m3 * g * l3 / 2 * tx
                + l3 * (tx * fy - ty * fx);
    double q2 = -swing * w3 * w3 + rx * ly - ry * lx + l2 * (jx * fy - jy * fx) + moment;
    double determinant = m11 * m22 - m12 * m12;
    double a3 = (m22 * q3 - m12 * q2) / determinant, a2 = (m11 * q2 - m12 * q3) / determinant;
    /* Accelerations of B, A and S2; reactions at O and C. */
    double bx = l3 * (-a3 * ty - w3 * w3 * tx), by = l3 * (a3 * tx - w3 * w3 * ty);
    double axx = bx + l2 * (-a2 * jy - w2 * w2 * jx), axy = by + l2 * (a2 * jx - w2 * w2 * jy);
    double sx = bx - a2 * ry - w2 * w2 * rx, sy = by + a2 * rx - w2 * w2 * ry;
    double hx = s1x * cosine - s1y * sine, hy = s1x * sine + s1y * cosine;
    double at_ox = -m1 * w * w * hx + fx, at_oy = m1 * (g - w * w * hy) + fy;
    double at_cx = m2 * sx - fx - lx + m3 * bx / 2;
    double at_cy = m2 * sy - fy - ly + m3 * (by / 2 + g);
    double force = sqrt(at_ox * at_ox + at_oy * at_oy + FORCE_WIDTH * FORCE_WIDTH)
                   + sqrt(at_cx * at_cx + at_cy * at_cy + FORCE_WIDTH * FORCE_WIDTH);
    rate[0][lane] = ux / (c * w);
    rate[1][lane] = uy / (c * w);
    rate[2][lane] = (-l1 * w * w * cosine - axx) / w;
    rate[3][lane] = (-l1 * w * w * sine - axy) / w;
    rate[4][lane] = force * force / (2 * PI);
}

/* Integrate `designs` over whole turns, from start[design][SIZE] with parameters
 * p[design][PARAMETERS]: the mean of |R_O| + |R_C| squared over the last `turns`, and the steps,
 * accepted and rejected. `first` is the first step (rad). */
void integrate(int designs, const double *start, const double *parameters, int settle, int turns,
               double rtol, double first, double *mean_square, long *steps) {
    const double end = 2 * PI;
    Lanes p[PARAMETERS], y[SIZE], trial[SIZE], k[STAGES][SIZE];
    Lanes angle, cosine, sine, h, step, last, previous, accepted;
    /* The design in each lane, -1 for none, and the turn it is in. */
    int design[LANES], turn[LANES] = {0}, next = 0, active = 0;

    /* A lane without a design stands at the end of a turn and takes steps of length zero. */
    for (int lane = 0; lane < LANES; lane++) {
        design[lane] = -1;
        for (int i = 0; i < PARAMETERS; i++) p[i][lane] = parameters[i];
        for (int i = 0; i < SIZE; i++) y[i][lane] = k[0][i][lane] = start[i];
        angle[lane] = end;
        h[lane] = previous[lane] = 1;
    }
    for (;;) {
        for (int lane = 0; lane < LANES; lane++) {
            if (angle[lane] < end) continue;
            if (design[lane] >= 0) {
                if (turn[lane] >= settle) mean_square[design[lane]] += y[4][lane] / turns;
                if (++turn[lane] == settle + turns) {
                    design[lane] = -1;
                    active--;
                }
            }
            if (design[lane] < 0) {
                if (next == designs) continue;
                design[lane] = next;
                for (int i = 0; i < PARAMETERS; i++)
                    p[i][lane] = parameters[next * PARAMETERS + i];
                for (int i = 0; i < SIZE; i++) y[i][lane] = start[next * SIZE + i];
                mean_square[next] = steps[next] = turn[lane] = 0;
                h[lane] = first;
                previous[lane] = 1;
                active++;
                next++;
            }
            angle[lane] = y[4][lane] = 0;
            h[lane] = least(h[lane], end);
            field_of_lane(lane, 1, 0, y, p, k[0]);
        }
        if (!active) return;
        EACH_LANE {
            last[lane] = angle[lane] + h[lane] >= end;
            step[lane] = last[lane] ? end - angle[lane] : h[lane];
        }
#pragma GCC unroll 6
        for (int stage = 1; stage < STAGES; stage++) {
#pragma GCC unroll 5
            for (int i = 0; i < SIZE; i++)
                EACH_LANE {
                    double change = 0;
#pragma GCC unroll 6
                    for (int j = 0; j < stage; j++) change += A[stage][j] * k[j][i][lane];
                    trial[i][lane] = y[i][lane] + step[lane] * change;
                }
            /* Apart: gcc makes one scalar call of a sine and a cosine in the same loop. */
            EACH_LANE cosine[lane] = cos(angle[lane] + C[stage] * step[lane]);
            EACH_LANE sine[lane] = sin(angle[lane] + C[stage] * step[lane]);
            EACH_LANE field_of_lane(lane, cosine[lane], sine[lane], trial, p, k[stage]);
        }
        EACH_LANE {
            double squares = 0;
#pragma GCC unroll 4
            for (int i = 0; i < SIZE - 1; i++) {
                double error = 0;
#pragma GCC unroll 7
                for (int j = 0; j < STAGES; j++) error += ERROR[j] * k[j][i][lane];
                double scale = rtol + rtol * most(fabs(y[i][lane]), fabs(trial[i][lane]));
                squares += squared(step[lane] * error / scale);
            }
            double size = most(sqrt(squares / 4), 1e-10);
            /* PI control as diffrax writes it: pcoeff 0.4, icoeff 0.3, safety 0.9. */
            double factor = 0.9 * pow(size, -0.7 / 5) * pow(previous[lane], 0.4 / 5);
            double good = size < 1;
            accepted[lane] = good;
            factor = good ? most(factor, 1) : factor;
            double next_step = step[lane] * least(most(factor, 0.2), 10);
            h[lane] = last[lane] && good ? h[lane] : next_step;
            previous[lane] = good ? size : previous[lane];
            angle[lane] = good ? (last[lane] ? end : angle[lane] + step[lane]) : angle[lane];
        }
        for (int i = 0; i < SIZE; i++)
            EACH_LANE {
                y[i][lane] = accepted[lane] ? trial[i][lane] : y[i][lane];
                k[0][i][lane] = accepted[lane] ? k[6][i][lane] : k[0][i][lane];
            }
        for (int lane = 0; lane < LANES; lane++)
            if (design[lane] >= 0) steps[design[lane]]++;
    }
}
