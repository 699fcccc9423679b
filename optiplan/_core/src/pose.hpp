// Vectors, rotations and poses of three-dimensional space.
#pragma once

#include <cmath>

namespace optiplan {

struct Vec3 {
    double x = 0.0, y = 0.0, z = 0.0;

    Vec3 &operator+=(const Vec3 &b) {
        x += b.x, y += b.y, z += b.z;
        return *this;
    }
    double operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
};

inline Vec3 operator+(const Vec3 &a, const Vec3 &b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(const Vec3 &a, const Vec3 &b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator-(const Vec3 &a) { return {-a.x, -a.y, -a.z}; }
inline Vec3 operator*(double s, const Vec3 &a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(const Vec3 &a, const Vec3 &b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline double squared_norm(const Vec3 &a) { return dot(a, a); }
inline double norm(const Vec3 &a) { return std::sqrt(dot(a, a)); }
inline Vec3 cross(const Vec3 &a, const Vec3 &b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// A unit vector perpendicular to `a`, which need not have unit length but must not be zero.
inline Vec3 perpendicular(const Vec3 &a) {
    const double x = std::fabs(a.x), y = std::fabs(a.y), z = std::fabs(a.z);
    const Vec3 axis = x <= y && x <= z ? Vec3{1, 0, 0} : y <= z ? Vec3{0, 1, 0} : Vec3{0, 0, 1};
    const Vec3 c = cross(a, axis);
    return (1.0 / norm(c)) * c;
}

struct Mat3 {
    Vec3 rows[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
};

inline Vec3 operator*(const Mat3 &m, const Vec3 &v) {
    return {dot(m.rows[0], v), dot(m.rows[1], v), dot(m.rows[2], v)};
}

// m^T v
inline Vec3 transposed(const Mat3 &m, const Vec3 &v) { return v.x * m.rows[0] + v.y * m.rows[1] + v.z * m.rows[2]; }

// a b
inline Mat3 operator*(const Mat3 &a, const Mat3 &b) {
    return {{transposed(b, a.rows[0]), transposed(b, a.rows[1]), transposed(b, a.rows[2])}};
}

inline Mat3 transpose(const Mat3 &m) {
    const Vec3 *r = m.rows;
    return {{{r[0].x, r[1].x, r[2].x}, {r[0].y, r[1].y, r[2].y}, {r[0].z, r[1].z, r[2].z}}};
}

// The rotation vector, rad, of at most half a turn: R = exp([v]). By the quaternion, whose largest part is found first.
inline Vec3 rotation_vector(const Mat3 &R) {
    const Vec3 *m = R.rows;
    const double trace = m[0].x + m[1].y + m[2].z;
    double w;
    Vec3 u;
    if (trace >= 0.0) {
        w = 1.0 + trace, u = {m[2].y - m[1].z, m[0].z - m[2].x, m[1].x - m[0].y};
    } else if (m[0].x >= m[1].y && m[0].x >= m[2].z) {
        w = m[2].y - m[1].z, u = {1.0 + m[0].x - m[1].y - m[2].z, m[0].y + m[1].x, m[0].z + m[2].x};
    } else if (m[1].y >= m[2].z) {
        w = m[0].z - m[2].x, u = {m[0].y + m[1].x, 1.0 - m[0].x + m[1].y - m[2].z, m[1].z + m[2].y};
    } else {
        w = m[1].x - m[0].y, u = {m[0].z + m[2].x, m[1].z + m[2].y, 1.0 - m[0].x - m[1].y + m[2].z};
    }
    const double size = norm(u);
    if (w < 0.0) w = -w, u = -u;
    return (size > 1e-12 * w ? 2.0 * std::atan2(size, w) / size : 2.0 / w) * u;
}

// X_AB: the pose of frame B in frame A; X_AB * p_B = p_A, X_AB * X_BC = X_AC.
struct Pose {
    Mat3 R;
    Vec3 p;

    Pose inverse() const { return {transpose(R), -transposed(R, p)}; }
};

inline Vec3 operator*(const Pose &X, const Vec3 &p) { return X.R * p + X.p; }
inline Pose operator*(const Pose &X, const Pose &Y) { return {X.R * Y.R, X.R * Y.p + X.p}; }

// X^-1 Y
inline Pose relative(const Pose &X, const Pose &Y) { return {transpose(X.R) * Y.R, transposed(X.R, Y.p - X.p)}; }

}  // namespace optiplan
