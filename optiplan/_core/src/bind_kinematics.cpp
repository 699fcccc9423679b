#include "arrays.hpp"
#include "kinematics/pose_descent.hpp"
#include "module.hpp"

namespace optiplan {

using namespace nb::literals;

static void make_descent(PoseDescent *self, const Tree &tree, int joint, const Matrix &placement, int rows,
                         const Vector &rules) {
    expect(joint >= 0 && joint < tree.count(), "a joint of the tree");
    expect(placement.shape(0) == 4 && placement.shape(1) == 4 && (rows == 3 || rows == 6), "a placement, 3 or 6 rows");
    expect(rules.size() == 5, "converged, damping, least damping, longest step, patience");
    const double *r = rules.data();
    const DescentRules given{r[0], r[1], r[2], r[3], static_cast<int>(r[4])};
    new (self) PoseDescent(tree, joint, pose_at(placement.data()), rows, given);
}

static nb::ndarray<nb::numpy, double> descend(PoseDescent &self, const Matrix &target, const Vector &low,
                                              const Vector &high, const Vector &seed, int iterations, double gain) {
    const auto n = static_cast<std::size_t>(self.joints());
    expect(target.shape(0) == 4 && target.shape(1) == 4, "a pose (4, 4)");
    expect(low.size() == n && high.size() == n && seed.size() == n, "bounds and a configuration (n,)");
    std::vector<double> q = to_vector(seed);
    self.descend(pose_at(target.data()), low.data(), high.data(), iterations, gain, q.data());
    return to_numpy(std::move(q), {n});
}

void bind_kinematics(nb::module_ &m) {
    nb::class_<PoseDescent>(m, "PoseDescent")
        .def("__init__", &make_descent, "tree"_a, "joint"_a, "placement"_a, "rows"_a, "rules"_a, nb::keep_alive<1, 2>())
        .def("descend", &descend, "target"_a, "low"_a, "high"_a, "seed"_a, "iterations"_a, "gain"_a);
}

}  // namespace optiplan
