// Four configurations at a time: numbers, vectors and poses in lanes.
//
// Every lane computes as one number would, in the same order, so results do not depend on the width of the machine's
// registers.
#pragma once

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wpsabi"  // lanes cross no border of a library
#endif

#include <cmath>
#include <cstdint>

#include "pose.hpp"
#include "world/tree.hpp"

namespace optiplan {

constexpr int LANES = 4;

typedef double Lanes __attribute__((vector_size(8 * LANES)));
typedef std::int64_t LaneBits __attribute__((vector_size(8 * LANES)));  // all ones where a comparison holds

inline Lanes lanes_of(double value) { return Lanes{} + value; }

struct Vec3Lanes {
    Lanes x, y, z;
};

struct PoseLanes {
    Lanes R[3][3];
    Vec3Lanes p;
};

inline Vec3Lanes lanes_of(const Vec3 &v) { return {lanes_of(v.x), lanes_of(v.y), lanes_of(v.z)}; }

// X v of a fixed point.
inline Vec3Lanes moved(const PoseLanes &X, const Vec3 &v) {
    return {X.R[0][0] * v.x + X.R[0][1] * v.y + X.R[0][2] * v.z + X.p.x,
            X.R[1][0] * v.x + X.R[1][1] * v.y + X.R[1][2] * v.z + X.p.y,
            X.R[2][0] * v.x + X.R[2][1] * v.y + X.R[2][2] * v.z + X.p.z};
}

// X Y of a fixed pose.
inline PoseLanes moved(const PoseLanes &X, const Pose &Y) {
    PoseLanes out;
    for (int i = 0; i < 3; ++i) {
        out.R[i][0] = X.R[i][0] * Y.R.rows[0].x + X.R[i][1] * Y.R.rows[1].x + X.R[i][2] * Y.R.rows[2].x;
        out.R[i][1] = X.R[i][0] * Y.R.rows[0].y + X.R[i][1] * Y.R.rows[1].y + X.R[i][2] * Y.R.rows[2].y;
        out.R[i][2] = X.R[i][0] * Y.R.rows[0].z + X.R[i][1] * Y.R.rows[1].z + X.R[i][2] * Y.R.rows[2].z;
    }
    out.p = moved(X, Y.p);
    return out;
}

// Sine and cosine, rad, to a few units in the last place: the polynomials of fdlibm after taking quarter turns out;
// angles beyond 1e5 go to the library.
inline void sine_and_cosine(const Lanes &angle, Lanes &sine, Lanes &cosine) {
    constexpr double MAGIC = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to whole numbers
    constexpr double QUARTER[] = {1.57079632673412561417e+00, 6.07710050630396597660e-11, 2.02226624879595063154e-21};
    const Lanes shifted = angle * 6.36619772367581382433e-01 + MAGIC;
    const Lanes turns = shifted - MAGIC;
    const LaneBits quarter = (LaneBits)shifted;
    const Lanes r = ((angle - turns * QUARTER[0]) - turns * QUARTER[1]) - turns * QUARTER[2];
    const Lanes z = r * r;
    const Lanes s = r + r * z *
                            (-1.66666666666666324348e-01 +
                             z * (8.33333333332248946124e-03 +
                                  z * (-1.98412698298579493134e-04 +
                                       z * (2.75573137070700676789e-06 +
                                            z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
    const Lanes c = 1.0 - 0.5 * z +
                    z * z *
                        (4.16666666666666019037e-02 +
                         z * (-1.38888888888741095749e-03 +
                              z * (2.48015872894767294178e-05 +
                                   z * (-2.75573143513906633035e-07 +
                                        z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
    const LaneBits odd = (quarter & 1) != 0;
    const Lanes a = odd ? c : s, b = odd ? s : c;
    sine = (quarter & 2) != 0 ? -a : a;
    cosine = ((quarter + 1) & 2) != 0 ? -b : b;
    for (int lane = 0; lane < LANES; ++lane)
        if (!(std::fabs(angle[lane]) < 1e5)) sine[lane] = std::sin(angle[lane]), cosine[lane] = std::cos(angle[lane]);
}

// Poses X_WJ of all joints at four configurations (4, n), row after row; out[0] is the world.
inline void poses_in_lanes(const Tree &tree, const double *q, PoseLanes *out) {
    const Lanes none = lanes_of(0.0), one = lanes_of(1.0);
    out[0] = {{{one, none, none}, {none, one, none}, {none, none, one}}, {none, none, none}};
    for (int j = 1; j < tree.count(); ++j) {
        const Joint &joint = tree.joints[j];
        Lanes position;
        for (int lane = 0; lane < LANES; ++lane) position[lane] = q[lane * tree.planned + joint.leader];
        position = joint.multiplier * position + joint.offset;
        const PoseLanes fixed = moved(out[joint.parent], joint.X_PJ);
        const Vec3 &a = joint.axis;
        if (!joint.revolute) {
            out[j] = fixed;
            out[j].p.x += position * (fixed.R[0][0] * a.x + fixed.R[0][1] * a.y + fixed.R[0][2] * a.z);
            out[j].p.y += position * (fixed.R[1][0] * a.x + fixed.R[1][1] * a.y + fixed.R[1][2] * a.z);
            out[j].p.z += position * (fixed.R[2][0] * a.x + fixed.R[2][1] * a.y + fixed.R[2][2] * a.z);
            continue;
        }
        Lanes s, c;
        sine_and_cosine(position, s, c);
        out[j].p = fixed.p;
        if (a.x == 0.0 && a.y == 0.0 && a.z == 1.0) {
            for (int i = 0; i < 3; ++i) {
                out[j].R[i][0] = fixed.R[i][0] * c + fixed.R[i][1] * s;
                out[j].R[i][1] = fixed.R[i][1] * c - fixed.R[i][0] * s;
                out[j].R[i][2] = fixed.R[i][2];
            }
            continue;
        }
        const Lanes v = 1.0 - c, xy = v * (a.x * a.y), xz = v * (a.x * a.z), yz = v * (a.y * a.z);
        const Lanes turn[3][3] = {{c + v * (a.x * a.x), xy - s * a.z, xz + s * a.y},
                                  {xy + s * a.z, c + v * (a.y * a.y), yz - s * a.x},
                                  {xz - s * a.y, yz + s * a.x, c + v * (a.z * a.z)}};
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k)
                out[j].R[i][k] = fixed.R[i][0] * turn[0][k] + fixed.R[i][1] * turn[1][k] + fixed.R[i][2] * turn[2][k];
    }
}

// The pose of one lane.
inline Pose lane_of(const PoseLanes &X, int lane) {
    Pose out;
    for (int i = 0; i < 3; ++i) out.R.rows[i] = {X.R[i][0][lane], X.R[i][1][lane], X.R[i][2][lane]};
    out.p = {X.p.x[lane], X.p.y[lane], X.p.z[lane]};
    return out;
}

}  // namespace optiplan
