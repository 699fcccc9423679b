// What tasks of one priority ask for as a quadratic program, and the rows of a pose.
//
// The formulas and their reasons are in optiplan/control/objective.py and optiplan/control/tasks/frame_tasks.py.
#pragma once

#include <cstdint>
#include <vector>

#include "pose.hpp"

namespace optiplan {

// Rows (k,) of tasks, one below the other, without their weights: J (k, n), and what each asks for.
struct TaskRows {
    std::size_t n;
    std::vector<double> J, error, wanted, cost;
    std::vector<double> change, drift;  // of the feed-forward in a step, and J̇ v; zeros where a task has none
    std::vector<double> asked;  // rates, where `by_rate` says that the task itself has made them of what it wants
    std::vector<char> by_rate;
};

struct TaskRules {
    double dt, late, steadiness, lasting;  // lasting: s, for which accelerations go on
    double near_singular, singular_damping;
};

// A (k, n); rates (3, k): asked, error, wanted, all weighted; H (n, n), g (n,).
struct TaskProgram {
    double *A, *rates, *H, *g;
};

struct TaskSummary {
    double error;  // weighted norm of the rows `main`
    double manipulability;  // product of the singular values of the rows `measured`
};

// `measured`: first row and the one behind the last, for the damping near singularities; none where they are equal.
// `weight`: of every velocity, squared.
TaskSummary task_program(const TaskRows &rows, const double *v, const double *a, const std::int64_t *main,
                         std::size_t main_size, std::size_t first, std::size_t last, double weight,
                         const TaskRules &rules, const TaskProgram &out);

// Singular values of J (rows, columns), falling: roots of the eigenvalues of J J' or J' J, by Jacobi's method.
std::vector<double> singular_values(const double *J, std::size_t rows, std::size_t columns);

// e (6,) = (p_WF - p_WT, log R_TF), and the matrix (6, 6) that takes twists along the axes of the world to its rates.
void pose_error(const Pose &X_WF, const Pose &X_WT, double *error, double *turn);

// -gain e (3,), slower where |e| is large.
void capped(const double *error, double gain, double speed, double brake, double *out);

// The same for each joint, with `brake`, `speed` (n,); as it is where it is large for none.
void curbed(const double *error, double gain, const double *brake, const double *speed, std::size_t n, double *out);

// |values| of some, and |A x - wanted| of some rows (k, n).
double norm_of(const double *values, const std::int64_t *which, std::size_t size);
double norm_left(const double *A, const double *wanted, const double *x, const std::int64_t *which, std::size_t size,
                 std::size_t n);

}  // namespace optiplan
